"""The radar's own view of an image: amplitude against range and direction.

A radar resolves range and u, the sine of the angle off broadside, and the resolution cell has the same size in range
and in u everywhere. Thresholds, side lobes, shadows and lines of sight are simple in these coordinates, so the steps
after imaging work in them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates, spline_filter
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mirrorfold.common.types import Array, Complex, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.complex_image import ComplexImage
from mirrorfold.detection.views.image_lobes import side_lobes
from mirrorfold.detection.views.view import View

SAMPLES_PER_CELL = 3
"""Polar samples per resolution cell: amplitude, unlike the complex image, has twice the image's bandwidth."""

SPLINE_MARGIN = 16
"""Pixels around the places of an interpolation from which cubic splines are computed. The influence of a pixel falls by
``2 - sqrt(3)`` from one to the next, to 1e-9 over the margin."""

COVERED_CELLS = 0.75
"""Half-width of the shadow of an object, in resolution cells: there the beam has fallen by 14 dB. With a whole cell, up
to the nulls of the beam, two small objects side by side would each hide half of what the radar shows of both."""

UNIFORM_CELL = 1.207
"""Half-amplitude width of the main lobe of equal weights, ``sinc(x) = 1/2``."""

EDGE_CELLS = 2
"""Distance, in resolution cells, over which the main lobe of a beam reaches: past the edge of a mirror, for example."""

OPAQUE_CELLS = 2.5
"""Depth of an object in range cells: what lies farther behind its first echo is multiple scattering."""

BLURRED_CELLS = 1.25, 0.5
"""Half-size of the area around a misplaced echo, in range cells and in cells across, in which it moves the
centroids of power of a wall: a profile reaches over 0.75 cells, and the echo over half a cell, in its own beam."""

CORNER_CELLS = 2.0
"""Largest distance of a place from a corner, in range cells and in cells across, at which it is the same: rows are cut
between two lines of sight, which may meet a steep row more than a cell apart."""

LARGEST_SINE = 0.985
"""Largest sine of the angle off broadside (80 degrees): the array does not resolve directions closer to its own
line."""


def uniform_cell(aperture_tx: float, aperture_rx: float) -> float:
    """Half-amplitude width in u of ``sinc(D_tx u) sinc(D_rx u)``, whose curvature adds as that of Gaussians does.

    The apertures are in wavelengths.
    """
    return UNIFORM_CELL / max(float(np.hypot(aperture_tx, aperture_rx)), 1.0)


@dataclass(frozen=True, eq=False)
class ImageView(View):
    """Normalised amplitude against range and sine of the angle off broadside, as the radar sees the image.

    Attributes
    ----------
    along, broadside : (2,) arrays
        Unit vectors along the array, and square to it in the direction in which it looks.
    u : (nu,) array
        Sine of the angle from broadside towards `along`, uniform, rising.
    amplitude : (nr, nu) array
        Linear; zero where the image has no pixels, or is zero.
    power : float
        Exponent p of the normalisation: `amplitude` was multiplied by ``range ** p``.
    u_cell : float
        Width of the resolution cell in u between half-amplitude points.
    aperture_tx, aperture_rx : float
        Lengths of the transmitting and the receiving array in wavelengths of mid-band; they set the side lobes in u.
        For a single antenna that moves along a path, and both sends and receives: twice the length of the path, and
        zero.
    noisy : bool
        Whether the noise can be estimated from the image, see `noise_level`.
    height : float [m]
        Of the radar above the plane of the image. Ranges are distances in this plane.
    aperture_filled : float
        Length, in wavelengths, of the array that the pairs of antennas fill where one of both arrays has gaps; or zero.
    misplaced : (m, 2) array [m]
        Where the image shows misplaced echoes: by the sweep, most of their energy came back by another path than it
        went out.
    corners : (c, 2) array [m]
        Where the image shows the vertices of right-angled corners, found by the sweep.
    doubtful : (s, 2, 2) array [m]
        Ends of rows of echoes of which only a part is a wall, as its waves show.
    waves : ComplexImage, optional
        The image with its phases, if these are known.
    radar, range, range_cell, normalization, wavelength, window
        See `View`.
    """

    radar: Array
    along: Array
    broadside: Array
    range: Array
    u: Array
    amplitude: Array
    power: float
    range_cell: float
    u_cell: float
    aperture_tx: float
    aperture_rx: float
    normalization: str = "r"
    wavelength: float = np.inf
    noisy: bool = True
    height: float = 0.0
    aperture_filled: float = 0.0
    misplaced: Array = field(default_factory=lambda: np.zeros((0, 2)))
    corners: Array = field(default_factory=lambda: np.zeros((0, 2)))
    doubtful: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    window: Array = field(default_factory=lambda: np.zeros(0))
    waves: ComplexImage | None = None

    def knowing(self, **known: Array) -> ImageView:
        """The same view with other `misplaced` echoes, `corners` or `doubtful` rows; what was computed is kept."""
        view = replace(self, **known)  # type: ignore[arg-type]
        kept = vars(self).keys() - vars(view).keys() - {"_misplaced_in_cells"}
        view.__dict__.update({name: vars(self)[name] for name in kept})
        return view

    def near_misplaced(self, points: Array) -> Mask:
        """Which places (n, 2) [m] lie so close to a misplaced echo that it moves centroids of power, (n,)."""
        found = np.zeros(len(points), dtype=bool)
        if len(self.misplaced):
            places = self.in_cells(points) / BLURRED_CELLS
            seen = np.isfinite(places).all(axis=1)  # not behind the radar
            found[seen] = self._misplaced_in_cells.query(places[seen], p=np.inf)[0] <= 1.0
        return found

    def misplaced_about(self, points: Array) -> Array:
        """The misplaced echoes within twice `BLURRED_CELLS` of any of points (n, 2) [m], (m, 2): those that may blur a
        row near these points, wherever a fit moves it.
        """
        apart = cdist(self._misplaced_in_cells.data, self.in_cells(points) / BLURRED_CELLS, "chebyshev")
        return self.misplaced[np.any(apart <= 2.0, axis=1)]

    def near_corner(self, points: Array) -> Mask:
        """Which places (n, 2) [m] are within `CORNER_CELLS` of one of the `corners`, (n,)."""
        apart = self.in_cells(points)[:, None] - self.in_cells(self.corners)
        return np.any(np.all(np.abs(apart) <= CORNER_CELLS, axis=2), axis=1)

    @cached_property
    def _misplaced_in_cells(self) -> cKDTree:
        """Search tree of the `misplaced` echoes, in units of `BLURRED_CELLS`."""
        return cKDTree(self.in_cells(self.misplaced) / BLURRED_CELLS)

    @property
    def axes(self) -> tuple[Array, ...]:
        """The sines `u` of the directions."""
        return (self.u,)

    @cached_property
    def sight(self) -> Array:
        """Unit vectors of all lines of sight, (nu, 2)."""
        return self.to_points(np.ones(self.u.size), self.u) - self.radar

    @cached_property
    def fits(self) -> dict[tuple[str, bytes, bytes], Any]:
        """Fits of straight rows to this image, see `mirrorfold.detection.search.remembered`."""
        return {}

    @cached_property
    def amplitude_by_direction(self) -> Array:
        """The `amplitude` with the samples of each direction side by side in memory, (nu, nr)."""
        return np.ascontiguousarray(self.amplitude.T)

    @property
    def frame(self) -> Array:
        """Unit vectors along the array and to broadside, (2, 2)."""
        return np.stack([self.along, self.broadside])

    def angles(self, points: ArrayLike) -> tuple[Array, Array]:
        """Range [m] and u of points (..., 2) [m], (..., 1)."""
        range_, u = self.to_polar(points)
        return range_, u[..., None]

    def column(self, u: Array) -> Index:
        """Number of the direction nearest to u."""
        return np.clip(np.rint((u - self.u[0]) / self.du).astype(np.intp), 0, self.u.size - 1)

    def width(self, range_: Array | float) -> Array:
        """Width of the resolution cell at broadside [m], ``range u_cell``."""
        return self.u_cell * np.asarray(range_)

    def object_depth(self, range_: Array) -> Array:
        """`OPAQUE_CELLS` range cells, at all ranges."""
        return np.full(np.shape(range_), OPAQUE_CELLS * self.range_cell)

    def beside_steps(self, range_: Array) -> Index:
        """The samples in `EDGE_CELLS` resolution cells, at all ranges."""
        return np.full(np.shape(range_), EDGE_CELLS * SAMPLES_PER_CELL)

    def looks_at(self, echoes: Echoes) -> Mask:
        """Directions no farther from broadside than the outermost strong echo, (nu,)."""
        _, u = self.to_polar(echoes.position[echoes.strong])
        return np.abs(self.u) <= np.abs(u).max(initial=0.0)

    @property
    def glint(self) -> float:
        """Length [m] of the row of echoes of a smooth wall that faces the array; infinite where the array is not known.

        A transmitter and a receiver see such a wall at the middle between the two. So the row is as long as the mean of
        both arrays, ``wavelength (D_tx + D_rx) / 2``.
        """
        return 0.5 * self.wavelength * (self.aperture_tx + self.aperture_rx)

    @property
    def one_way(self) -> bool:
        """Whether side lobes fall as slowly as those of one array: of one that is extended, or of a filled one."""
        one = min(self.aperture_tx, self.aperture_rx) == 0.0 or self.aperture_filled > 0.0
        return one and bool(np.isfinite(self.glint))

    def on_radar(self, points: Array, reach: Array | float) -> Mask:
        """Which points (n, 2) lie at most `reach` [m] from the line of the array, which is as long as `glint`, (n,)."""
        if not np.isfinite(self.wavelength):
            return super().on_radar(points, reach)
        offset = np.abs((points - self.radar) @ self.frame.T)
        return np.hypot(np.maximum(offset[:, 0] - 0.5 * self.glint, 0.0), offset[:, 1]) <= reach

    @property
    def covered_angle(self) -> float:
        """Half-width of the shadow of an object in u."""
        return COVERED_CELLS * self.u_cell

    @property
    def du(self) -> float:
        """Step of u."""
        return float(self.u[1] - self.u[0])

    def to_points(self, range_: ArrayLike, u: ArrayLike) -> Array:
        """Positions (..., 2) [m] of range and u."""
        range_, u = np.asarray(range_, dtype=float), np.asarray(u, dtype=float)
        cosine = np.sqrt(np.maximum(1.0 - u**2, 0.0))
        return self.radar + range_[..., None] * (u[..., None] * self.along + cosine[..., None] * self.broadside)

    def to_polar(self, points: ArrayLike) -> tuple[Array, Array]:
        """Range [m] and u of positions (..., 2) [m]; u is NaN behind the radar."""
        offset = np.asarray(points, dtype=float) - self.radar
        range_ = np.sqrt(offset[..., 0] ** 2 + offset[..., 1] ** 2)
        with np.errstate(invalid="ignore", divide="ignore"):
            u = np.where(offset @ self.broadside >= 0.0, (offset @ self.along) / range_, np.nan)
        return range_, u

    def power_at(self, range_: ArrayLike, u: ArrayLike) -> Array:
        """Power at range [m] and u, by cubic splines; zero outside the view.

        Amplitude has cusps where speckle fades. Its square is smooth, and sampled finely enough for splines.
        """
        rows = (np.asarray(range_, dtype=float) - self.range[0]) / self.dr
        columns = (np.asarray(u, dtype=float) - self.u[0]) / self.du
        # NaN marks places behind the radar.
        columns = np.where(np.isnan(columns), -10.0, columns)
        return np.maximum(map_coordinates(self._power, [rows, columns], order=3, prefilter=False), 0.0)

    def complex_along(
        self, image: xr.DataArray, points: Array, half: float, step: float, wavenumber: float
    ) -> tuple[Array, Complex]:
        """Interpolated between pixels by cubic splines."""
        range_, u = self.to_polar(points)
        depth = np.arange(-half, half, step)
        x, y = image["x"].values.astype(float), image["y"].values.astype(float)
        places = self.to_points(range_[:, None] + depth, np.broadcast_to(u[:, None], (u.size, depth.size)))
        pixel = [(places[..., 1] - y[0]) / (y[1] - y[0]), (places[..., 0] - x[0]) / (x[1] - x[0])]
        # Only the part of the image around these places is used; its carrier is removed before the interpolation.
        low = [max(int(np.floor(axis.min())) - SPLINE_MARGIN, 0) for axis in pixel]
        high = [int(np.ceil(axis.max())) + SPLINE_MARGIN + 1 for axis in pixel]
        part = image.values[low[0] : high[0], low[1] : high[1]]
        across, ahead = x[low[1] : high[1]] - self.radar[0], y[low[0] : high[0]] - self.radar[1]
        distance = np.sqrt(across[None, :] ** 2 + ahead[:, None] ** 2 + self.height**2)
        carried = part * np.exp(-2j * wavenumber * distance)
        where = [axis - first for axis, first in zip(pixel, low, strict=True)]
        values = sum(
            unit * map_coordinates(spline_filter(piece), where, prefilter=False, order=3)
            for unit, piece in ((1.0, carried.real), (1j, carried.imag))
        )
        return depth, np.asarray(values)

    @cached_property
    def side_lobes(self) -> Array:
        """Amplitude that side lobes of brighter echoes may reach, (nr, nu); see `image_lobes`."""
        return side_lobes(self)

    def distance_along(self, place: float) -> Array:
        """Distance of the samples (nr, nu) of the view from a place along the array, so far from its middle [m]."""
        range_ = self.range[:, None]
        return np.sqrt(np.maximum(range_**2 - 2.0 * range_ * place * self.u + place**2, 0.0))

    def from_along(self, place: float) -> ImageView:
        """The same directions, but with distances from a place along the array, so far from its middle [m], as ranges.

        In a direction u from the middle of the array, the place has the distance d from what stands at the range
        ``place u + sqrt(d^2 - place^2 (1 - u^2))``.
        """
        if place == 0.0:
            return self
        distance = self.range[:, None]
        range_ = place * self.u + np.sqrt(np.maximum(distance**2 - place**2 * (1.0 - self.u**2), 0.0))
        return replace(self, amplitude=self.amplitude[self.row(range_), np.arange(self.u.size)])

    @property
    def places_along(self) -> Array:
        """Places along the array, from its middle [m], two range cells apart or less.

        If two points whose u differ by one are at the same distance from some place of the array, their distances from
        the nearest of these places differ by at most a range cell.
        """
        count = int(np.ceil(0.25 * self.glint / self.range_cell)) if np.isfinite(self.glint) else 0
        return np.linspace(-0.5, 0.5, 2 * count + 1) * self.glint if count else np.zeros(1)

    def part_lobes(self, level: Array, aside: Array) -> Array:
        """Largest side lobes, at distances `aside` (n,) in u, of echoes of a `level` (n,) that part of the array sees.

        A wall that ends throws its glint on a part of the pairs of antennas, which no window weighs. At its edge the
        glint begins at once, so that the lobes fall as ``1 / (pi D u)`` in an array of D wavelengths.
        """
        length = 0.5 * (self.aperture_tx + self.aperture_rx)
        return level / np.maximum(np.pi * length * np.abs(aside), 1.0)

    def brightest_at(self, range_: Array) -> tuple[Array, Index]:
        """Amplitude of the brightest place within a range cell of each range (n,) [m], and its direction, (n,) each."""
        level, column = self._brightest
        rows = self.row(range_)[:, None] + np.arange(-SAMPLES_PER_CELL, SAMPLES_PER_CELL + 1)
        rows = np.clip(rows, 0, level.size - 1)
        brightest = rows[np.arange(len(rows)), level[rows].argmax(axis=1)]
        return level[brightest], column[brightest]

    @cached_property
    def _brightest(self) -> tuple[Array, Index]:
        """Amplitude of the brightest place at each range, and the number of its direction, (nr,) each."""
        column = self.amplitude.argmax(axis=1)
        return self.amplitude[np.arange(column.size), column], column

    @cached_property
    def _power(self) -> Array:
        """Coefficients of the cubic splines through the power."""
        return spline_filter(self.amplitude**2)

    def beam_power(self, aside: Array) -> Array:
        """The two-way beam pattern of both arrays, taken as uniform apertures, and as wide as `u_cell` says."""
        u = uniform_cell(self.aperture_tx, self.aperture_rx) * aside
        return (np.sinc(self.aperture_tx * u) * np.sinc(self.aperture_rx * u)) ** 2

    def cross_cell(self, points: Array) -> Array:
        """Width of the resolution cell across the line of sight [m]: ``range u_cell / sqrt(1 - u^2)``."""
        range_, u = self.to_polar(points)
        return range_ * self.u_cell / np.sqrt(np.maximum(1.0 - u**2, 1.0 - LARGEST_SINE**2))
