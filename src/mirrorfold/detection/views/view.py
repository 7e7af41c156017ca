"""The radar's own view: amplitude along straight lines of sight, of an image or of a volume.

Steps 2 to 6 of the algorithm work on this view. A line of sight is a column of an image in polar coordinates, or a beam
of a scanner. The methods below, and those of a mirror (`mirrorfold.detection.mirrors.mirror`), hide all differences
between the floor plan and space.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.common.facts import VOLUME, VOXELS, check_facts, check_unit
from mirrorfold.common.geometry import unit_or_zero
from mirrorfold.common.plausible import not_finite
from mirrorfold.common.statistics import consecutive, in_equal_steps
from mirrorfold.common.types import Array, Complex, Index, Mask
from mirrorfold.common.windows import cell_of
from mirrorfold.detection.echoes import Echoes, strongest_of
from mirrorfold.errors import InputError

DEVIATION = 0.3
"""Standard deviation of the distribution of an echo's power about its position, in half-amplitude widths of the
resolution cell: for the main lobe of the Hann window, and for a Gaussian beam there and back."""

NEGATIVE_SHARE = 0.9
"""Share of negative pixels above which an image holds levels in dB, which are negative everywhere but at the peak. Real
parts of waves are negative at half of all pixels."""

FEWEST_SAMPLES = 4
"""Smallest number of pixels, or beams, along each axis of an image that can be folded."""

POINTS_AT_ONCE = 1000
"""Number of points that are given to `View.within` at once. Each may be near hundreds of directions, so that the pairs
of all points would take far more memory than the image."""


def in_pieces(count: int, size: int = POINTS_AT_ONCE) -> list[slice]:
    """Slices that cut `count` points, or rows, into pieces of at most `size`."""
    return [slice(first, first + size) for first in range(0, count, size)]


class View(ABC):
    """What the radar sees, of an image or of a volume. Lines of sight are numbered from 0: a `direction` is a number.

    Attributes
    ----------
    radar : (d,) array [m]
        Position of the radar.
    range : (nr,) array [m]
        Ranges of the samples, uniform, rising.
    wavelength : float [m]
        In the middle of the band; infinite where it is not known.
    range_cell : float [m]
        Width of an echo in range, between half-amplitude points.
    normalization : str
        How the decay of amplitudes with range was undone.
    window : (frequencies,) array
        The weights over frequency, which set the shape of an echo in range; empty where they are not known.
    """

    radar: Array
    range: Array
    range_cell: float
    wavelength: float
    normalization: str
    window: Array

    widths_a_cell = 1.0
    """Width of the resolution cell across the line of sight, in widths of a line of sight."""

    @cached_property
    def searches(self) -> dict[bytes, Any]:
        """Results of searches for mirrors in this view, see `mirrorfold.detection.find_mirrors`."""
        return {}

    @property
    def range_unit(self) -> float:
        """``c / (2 B)`` [m], with the bandwidth B: the unit in which the side lobes of a window are given."""
        return self.range_cell / cell_of(self.window)

    @property
    @abstractmethod
    def axes(self) -> tuple[Array, ...]:
        """Directions of the lines of sight, uniform along each axis; the last axis varies fastest.

        For an image u, the sine of the angle off broadside; for a volume azimuth and elevation [rad].
        """

    @property
    @abstractmethod
    def sight(self) -> Array:
        """Unit vectors of all lines of sight, (n, d)."""

    @abstractmethod
    def angles(self, points: ArrayLike) -> tuple[Array, Array]:
        """Range [m] of points (..., d) [m], and their angles as in `axes`, (..., axes); NaN where they have none."""

    @abstractmethod
    def width(self, range_: Array | float) -> Array:
        """Width of a line of sight [m] at ranges [m]: that of the resolution cell of an image, or the beam radius."""

    def cell(self, range_: Array | float, growth: Array | float = 1.0) -> Array:
        """Diagonal of the resolution cell [m] at ranges [m]: the size of the echo of a small object.

        Curved mirrors make the cell wider across the line of sight, by the factor `growth`.
        All lengths in the steps after imaging are multiples of it, so that they suit any radar.
        """
        return np.hypot(self.range_cell, self.widths_a_cell * growth * self.width(range_))

    @abstractmethod
    def cross_cell(self, points: Array) -> Array:
        """Width of the resolution cell square to the line of sight [m] at points (n, d), between half amplitudes."""

    @abstractmethod
    def beam_power(self, aside: Array) -> Array:
        """Two-way power pattern of the beam, 1 on its axis; `aside` is the distance from that in `cross_cell`s."""

    @abstractmethod
    def object_depth(self, range_: Array) -> Array:
        """Depth [m] behind the first echo of an object, at ranges [m], within which echoes may be its own."""

    @abstractmethod
    def beside_steps(self, range_: Array) -> Index:
        """Number of directions to either side, at ranges [m], over which a beam still shows an object."""

    @abstractmethod
    def complex_along(
        self, image: xr.DataArray, points: Array, half: float, step: float, wavenumber: float
    ) -> tuple[Array, Complex]:
        """Values of the complex image on the lines of sight through points (n, d), up to `half` [m] to either side.

        Returns the distances (m,) [m] from the points along the line of sight, at most twice the `step` [m] apart, and
        the values (n, m), from which the carrier of the given `wavenumber` [rad/m] is removed.
        """

    @property
    def covered_angle(self) -> float:
        """How far beside its direction, along one of the `axes`, an object hides what is behind it."""
        return 0.0

    def strays(self, range_: Array) -> Array:
        """How far beside its direction, along one of the `axes`, the object of an echo at a range [m] may be, (n,)."""
        return np.zeros(np.shape(range_))

    def looks_at(self, echoes: Echoes) -> Mask:
        """Directions into which the radar surely looks, (n,): beyond its outermost echoes, antennas may be blind."""
        return np.ones(len(self.sight), dtype=bool)

    def on_radar(self, points: Array, reach: Array | float) -> Mask:
        """Which points (n, d) lie at most `reach` [m] from the antennas; none where the array is not known."""
        return np.zeros(len(points), dtype=bool)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of directions along each axis."""
        return tuple(axis.size for axis in self.axes)

    @property
    def steps(self) -> Array:
        """Step from one direction to the next along each of the `axes`, (axes,): of u, or in [rad]."""
        return np.array([(axis[-1] - axis[0]) / (axis.size - 1) for axis in self.axes])

    def indices(self, points: ArrayLike) -> tuple[Array, Array]:
        """Range [m] of points (..., d) [m], and their position on each axis in steps from its first, (..., axes)."""
        range_, angles = self.angles(points)
        return range_, (angles - [axis[0] for axis in self.axes]) / self.steps

    def locate(self, points: ArrayLike) -> tuple[Array, Index, Mask]:
        """Range [m] and nearest direction of points (..., d) [m], and whether these lie inside the view."""
        range_, place = self.indices(points)
        at = np.rint(np.nan_to_num(place, nan=-9.0)).astype(np.intp)
        inside = np.all((at >= 0) & (at < self.shape), axis=-1) & (range_ >= self.range[0])
        return range_, np.ravel_multi_index(tuple(np.moveaxis(at, -1, 0)), self.shape, mode="clip"), inside

    def within(self, points: Array, aside: Array | float) -> tuple[Index, Index]:
        """All pairs of a point (n, d) and a direction less than `aside` away from it along each of the `axes`.

        The direction nearest to a point is always among them, if it lies in the view. Returns the numbers of the points
        and of the directions, each (pairs,).
        """
        _, place = self.indices(points)
        row, direction = np.arange(len(points)), np.zeros(len(points), dtype=np.intp)
        for at, step, size in zip(place.T, self.steps, self.shape, strict=True):
            reach = np.maximum(np.asarray(aside) / step, 0.5)
            first, last = (np.clip(np.ceil(edge), 0, size).astype(np.intp) for edge in (at - reach, at + reach))
            count = (last - first)[row]
            direction = np.repeat(direction * size, count) + consecutive(first[row], count)
            row = np.repeat(row, count)
        return row, direction

    def beside(self, range_: Array, direction: Index, share: float = 1.0) -> tuple[Index, ...]:
        """Directions beside those of points, two for each axis, `share` times `beside_steps` to either side."""
        at = np.array(np.unravel_index(direction, self.shape))
        step = np.rint(share * self.beside_steps(range_)).astype(np.intp)
        axes = np.eye(len(self.shape), dtype=np.intp)
        moved = (at + np.multiply.outer(side * axis, step) for axis in axes for side in (-1, 1))
        return tuple(np.ravel_multi_index(tuple(place), self.shape, mode="clip") for place in moved)

    def in_cells(self, points: Array) -> Array:
        """Range and angles of points (n, d), in units of the range cell and of the width of a line of sight, (n, d)."""
        range_, angles = self.angles(points)
        angle = self.width(range_) / np.maximum(range_, self.dr)
        return np.column_stack([range_ / self.range_cell, angles / angle[:, None]])

    def cell_numbers(self, points: Array) -> Index:
        """Number of the resolution cell of each of points (n, d), (n,); only cells with points count, from zero."""
        return np.unique(np.rint(self.in_cells(points)), axis=0, return_inverse=True)[1].ravel()

    def filled_cells(self, points: Array) -> int:
        """Number of resolution cells that hold at least one of points (n, d)."""
        return int(self.cell_numbers(points).max(initial=-1)) + 1

    def brightest(self, points: Array, amplitude: Array) -> Index:
        """Index of the brightest of points (n, d) in each resolution cell that holds any, (cells,)."""
        return strongest_of(self.cell_numbers(points), amplitude)

    @property
    def dimensions(self) -> int:
        """2 for the floor plan, 3 for space."""
        return self.radar.size

    @property
    def dr(self) -> float:
        """Range step [m]."""
        return float(self.range[1] - self.range[0])

    def row(self, range_: Array) -> Index:
        """Number of the sample nearest to ranges [m]."""
        return np.clip(np.rint((range_ - self.range[0]) / self.dr).astype(np.intp), 0, self.range.size - 1)

    def cell_at(self, point: Array) -> float:
        """Diagonal of the resolution cell [m] at a point (d,)."""
        return float(self.cell(float(np.linalg.norm(point - self.radar))))

    def cells_at(self, points: Array) -> Array:
        """Diagonal of the resolution cell [m] at each of points (n, d), (n,)."""
        return self.cell(np.linalg.norm(points - self.radar, axis=1))

    def squares(self, points: Array) -> Callable[..., Array]:
        """A function that gives the squared `extent` at points (n, d), or at some of them, along unit vectors."""
        offset, cross = points - self.radar, self.cross_cell(points) ** 2
        sight = offset.T / np.maximum(np.sqrt(sum(part**2 for part in offset.T)), np.finfo(float).tiny)

        def square(along: Array, which: Index | slice = slice(None)) -> Array:
            cosine = along.T @ sight[:, which]
            return (cross[which] + (self.range_cell**2 - cross[which]) * cosine**2).T

        return square

    def extent(self, points: Array, along: Array) -> Array:
        """Width of the resolution cell [m] at points (n, d) along a unit vector, (n,), or each of (d, m), (n, m).

        At the angle a to the line of sight it is ``sqrt((range_cell cos(a))^2 + (cross_cell sin(a))^2)``.
        """
        return np.sqrt(self.squares(points)(along))

    def extent_each(self, points: Array, along: Array) -> Array:
        """The `extent` [m] at points (n, d), each along a unit vector of its own, (n, d); returns (n,)."""
        cross = self.cross_cell(points) ** 2
        cosine = np.sum(unit_or_zero(points - self.radar) * along, axis=1)
        return np.sqrt(cross + (self.range_cell**2 - cross) * cosine**2)

    def points(self, range_: Array, direction: Index) -> Array:
        """Positions (n, d) [m] at ranges [m] in numbered directions; not finite where the range is not."""
        with np.errstate(invalid="ignore"):
            return self.radar + range_[..., None] * self.sight[direction]

    def meets(self, normal: Array, center: Array) -> Array:
        """Range [m] at which each line of sight meets an infinite line or plane, (n,); infinite where it does not."""
        with np.errstate(divide="ignore", invalid="ignore"):
            range_ = float((center - self.radar) @ normal) / (self.sight @ normal)
        return np.where(range_ > 0.0, range_, np.inf)


PRECISIONS = {"f": np.float32, "c": np.complex64}
"""Single precision of amplitudes and of complex images, by the kind of their numbers."""


def in_single_precision(image: xr.DataArray) -> xr.DataArray:
    """The image in single precision, in which images are computed, if it has floating-point numbers of another one.

    Raises
    ------
    InputError
        If its amplitudes are larger or smaller than single precision holds.
    """
    single = PRECISIONS.get(image.dtype.kind)
    if single is None or image.dtype.itemsize == np.dtype(single).itemsize:
        return image
    with np.errstate(over="ignore", under="ignore"):
        found = image.astype(single)
    lost = np.isfinite(image.values).all() and not np.isfinite(found.values).all()
    if lost or (image.values.any() and not found.values.any()):
        raise InputError("image: has amplitudes beyond single precision, 1e-38 to 1e38; multiply all by one number")
    return found


def check_samples(image: xr.DataArray, dims: tuple[str, ...]) -> None:
    """Refuse anything but an image of these dimensions with finite values, no levels in dB, on a regular grid, and with
    possible facts about the radar.
    """
    check_axes(image, dims)
    check_facts(image.attrs, "image")
    if image.dtype.kind not in "cfiu":
        raise InputError(f"image: holds values of type {image.dtype}, expected real or complex amplitudes")
    if missing := not_finite(image.values):
        wrong = f"{missing} of {image.size} pixels are not finite (NaN or infinite); mask them with 0"
        raise InputError(f"image: {wrong}")
    if image.dtype.kind != "c" and (image.values < 0).sum() > NEGATIVE_SHARE * np.count_nonzero(image.values):
        raise InputError(
            "image: nearly all values are negative, as levels in dB are, expected amplitudes; import it with "
            "--decibel, in Python import_image(file, decibel=True), or take 10 ** (image / 20)"
        )


def check_axes(image: xr.DataArray, dims: tuple[str, ...]) -> None:
    """Refuse anything but an image of these dimensions on a regular grid, with at least `FEWEST_SAMPLES` along each."""
    if not isinstance(image, xr.DataArray) or image.dims != dims:
        found = getattr(image, "dims", type(image).__name__)
        many = f"; choose one, image.isel({found[0]}=0)" if found[1:] == dims else ""
        for axes in (dims, VOXELS, VOLUME):
            if sorted(map(str, found)) == sorted(axes):
                many = f"; image.transpose({', '.join(map(repr, axes))}) sorts them"
        raise InputError(f"image: has dimensions {found}, expected an image with dimensions {dims}{many}")
    for name in dims:
        if name not in image.coords or image.sizes[name] < FEWEST_SAMPLES:
            raise InputError(
                f"image: axis {name} needs a coordinate [m or degree] with at least {FEWEST_SAMPLES} pixels"
            )
        check_unit(image[name], "image")
        step = np.diff(image[name].values.astype(float))
        if not in_equal_steps(image[name].values.astype(float)):
            falls = np.isfinite(step).all() and (step < 0.0).all()
            remedy = f"turn it over by image.sortby({name!r})" if falls else "resample to a regular grid"
            raise InputError(f"image: the coordinate {name} does not rise in equal steps; {remedy}")
