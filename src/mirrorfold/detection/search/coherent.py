"""Step 2 in the floor plan, at its end: the line of a mirror, fitted to the complex image.

A rough wall scatters from every place along it. Within a resolution cell these waves interfere, and the brightest spot
of a cell that lies askew to the wall is not on the wall: centroids of power (`fit`) stray by tenths of a cell. The
complex image holds more. It is the sum of the responses to points on the wall, each with an unknown amplitude and
phase. On the true line such points explain the whole image of the wall, speckle included; beside it they do not. So the
line is moved to where the residual of the best amplitudes is smallest: a separable least-squares problem (Golub and
Pereyra, SIAM J. Numer. Anal. 10, 1973; by the approximation of Kaufman, BIT 15, 1975), solved by Gauss-Newton steps.
Errors are then those of noise and foreign echoes, not of speckle: a hundredth of a cell and less.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from mirrorfold.common.geometry import unit
from mirrorfold.common.kernels import njit
from mirrorfold.common.normalization import RANGE_POWERS
from mirrorfold.common.types import Array, Complex, Index
from mirrorfold.common.windows import known_weights
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.fit import block_covariance
from mirrorfold.detection.views.image_view import ImageView

NODES = 10
"""Number of antennas of each array, and of frequencies, by which the response to a point is computed within
`REACH_CELLS`: two for each of its lobes on the way there."""

REACH_CELLS = 3.5
"""Distance along a wall, in resolution cells, up to which the response to a point counts: side lobes beyond it are 50
dB below the peak."""

BAND_CELLS, END_CELLS = 0.8, 0.6
"""Half-width of the band about a wall whose pixels are explained, in resolution cells across it: as wide as its main
lobe. And the length that the band leaves out at either end of the wall, in cells along it."""

SPACING_CELLS, PIXELS_A_CELL = 0.5, 3.0
"""Distance of neighbouring points on a wall, in resolution cells along it, at which they make up any speckle; and
largest number of pixels across a cell that are used."""

SMOOTHING = 1e-3
"""Share of the mean power of the response to a point that is added to its own: amplitudes that the image does not tell
apart stay small."""

OWN_ERROR, LEAST_ERROR = 0.1, 0.03
"""Expected error of a pixel, as a share of its own amplitude: what foreign echoes and their side lobes add; and as a
share of the root mean square of the row, which keeps faint pixels from counting too much."""

ROUNDS, STEPS = 2, 2
"""Number of times that the responses are computed, and of Gauss-Newton steps with each."""

DIFFERENCE = 0.01
"""Distance, in resolution cells across a wall, over which the change of the responses is taken for linear."""

FARTHEST_CELLS = 0.5
"""Largest distance, in resolution cells, by which either end is moved: centroids of power do not err by more, so what
asks for more is no single row of points on a line."""

LARGEST_ERROR_CELLS = 0.1
"""Largest standard error of either end of the line, in resolution cells, as that of centroids of power: where other
echoes fill the row of a short wall, its waves tell no more than they do."""

MOST_UNEXPLAINED = 0.02
"""Largest share of the weighted power about a wall that points on it may leave unexplained. Rough walls leave half a
per cent, or one and a half beside bright objects; walls that scatter from one to three centimetres inside leave more,
two to four per cent where a range cell is as wide as 7 cm, and seven to nine where it is 3 cm wide."""


class Row(NamedTuple):
    """The pixels about a wall, and the points on it that explain them.

    `pixel` (p, 2) [m] and `value` (p,) are the pixels and their complex amplitudes without the carrier, `along` (p,)
    [m] their positions along the wall, from its middle; `places` (q,) [m] are those of the points.
    """

    pixel: Array
    value: Complex
    along: Array
    places: Array


class State(NamedTuple):
    """Both parameters of the line: how far its middle is moved along its normal [m], and the slope by which it turns;
    their covariance (2, 2); and the share of the weighted power that the points on the line do not explain.
    """

    moved: Array
    covariance: Array
    unexplained: float


@dataclass(frozen=True, eq=False)
class ComplexImage:
    """A complex image with all that its response to a point depends on.

    Attributes
    ----------
    values : (ny, nx) complex array
    x, y : arrays [m]
    view : ImageView
        The radar's view of the image.
    k : (`NODES`,) array [rad/m]
        Wavenumbers across the band.
    taper : (`NODES`,) array
        Weights over frequency; their sum is one.
    arrays : (1 or 2, `NODES`, 2) array [m]
        Places of transmitters and receivers, evenly along each array; only one if both are the same.
    monostatic : bool
        Whether one antenna goes along the array, and each place receives only what was sent from there.
    apodization : (`NODES`,) array
        Weights over the antennas; their sum is one.
    power : int
        Exponent p of the ``range ** p`` that the values were multiplied with.
    """

    values: Complex
    x: Array
    y: Array
    view: ImageView
    k: Array
    taper: Array
    arrays: Array
    apodization: Array
    monostatic: bool
    power: int

    @classmethod
    def of(cls, image: xr.DataArray, view: ImageView) -> ComplexImage | None:
        """The image; None if it is not complex, or if it does not tell band, windows and arrays without gaps."""
        attrs, known = image.attrs, np.iscomplexobj(image.values) and np.isfinite(view.wavelength)
        if not known or not view.window.size or view.aperture_filled > 0.0 or abs(view.height) > view.range_cell:
            return None
        antennas = attrs.get("apodization", "uniform")
        weights = known_weights(antennas, NODES) if isinstance(antennas, str) else np.zeros(0)
        if not weights.size:
            return None
        # Nodes lie in the middle of equal parts. Samples do so too: each stands for what lies nearest to it.
        share, points = (np.arange(NODES) + 0.5) / NODES, view.window.size
        low, high = float(attrs["frequency_start"]), float(attrs["frequency_stop"])
        beyond = 0.5 * (high - low) / (points - 1)
        frequency = low - beyond + share * (high - low + 2.0 * beyond)
        taper = np.interp(points * share - 0.5, np.arange(points), view.window)
        monostatic = bool(attrs.get("monostatic"))
        pitch = view.wavelength * (0.25 if monostatic else 0.5)
        lengths = [float(attrs.get(name, 0.0)) for name in ("tx_aperture", "rx_aperture")]
        lengths = [length + pitch * (length > 0.0) for length in lengths]
        lengths = lengths[:1] if lengths[0] == lengths[1] or monostatic else lengths
        return cls(
            *(image.values, image["x"].values.astype(float), image["y"].values.astype(float), view),
            k=2.0 * np.pi * frequency / float(attrs.get("wave_speed", speed_of_light)),
            taper=taper / taper.sum(),
            arrays=np.stack([view.radar + np.outer((share - 0.5) * length, view.along) for length in lengths]),
            apodization=weights / weights.sum(),
            monostatic=monostatic,
            power=RANGE_POWERS[str(attrs.get("normalization", "none"))],
        )

    def fitted(self, mirror: LineMirror) -> LineMirror:
        """The mirror on the line on which points explain the image best, with its standard errors.

        The same mirror, if its row has too few pixels, if the line would leave the row, by `FARTHEST_CELLS`, if it is
        not known well, by `LARGEST_ERROR_CELLS`, or if the wall scatters from elsewhere too, by `MOST_UNEXPLAINED`.
        """
        row = self.row(mirror)
        if len(row.pixel) <= 2 * len(row.places):
            return mirror
        across = float(self.view.extent(mirror.center[None], mirror.normal)[0])
        state = State(np.zeros(2), np.zeros((2, 2)), 1.0)
        for _ in range(ROUNDS):
            state = self._improved(row, mirror, state.moved, across)
            offset, slope = state.moved
            if not abs(offset) + 0.5 * mirror.length * abs(slope) < FARTHEST_CELLS * across:
                return mirror
        errors = np.sqrt(np.diag(state.covariance))
        at_ends = errors[0] + 0.5 * mirror.length * errors[1]
        if state.unexplained > MOST_UNEXPLAINED or at_ends > LARGEST_ERROR_CELLS * across:
            return mirror
        normal = unit(mirror.normal - slope * mirror.direction)
        line = mirror.moved(normal, mirror.center + offset * mirror.normal)
        return replace(line, offset_error=float(errors[0]), angle_error=float(np.degrees(errors[1])))

    def row(self, mirror: LineMirror) -> Row:
        """The pixels about a mirror, and the points on it."""
        view = self.view
        wide = BAND_CELLS * float(view.extent(mirror.ends, mirror.normal).max())
        (x0, y0), (x1, y1) = mirror.ends.min(axis=0) - wide, mirror.ends.max(axis=0) + wide
        cell = view.extent(mirror.center[None], np.eye(2))[0]
        columns, rows = _chosen(self.x, x0, x1, cell[0]), _chosen(self.y, y0, y1, cell[1])
        pixel = np.stack(np.meshgrid(self.x[columns], self.y[rows]), axis=-1).reshape(-1, 2)
        along, beside = (pixel - mirror.center) @ mirror.direction, (pixel - mirror.center) @ mirror.normal
        inside = 0.5 * mirror.length - np.abs(along) > END_CELLS * mirror.section(view, pixel)
        inside &= np.abs(beside) < BAND_CELLS * view.extent(pixel, mirror.normal)
        value = self.values[np.ix_(rows, columns)].ravel()
        inside &= np.isfinite(value) & (value != 0.0)  # masked pixels tell nothing
        pixel, value = pixel[inside], value[inside]
        range_ = np.linalg.norm(pixel - view.radar, axis=1)
        value = value * np.exp(-1j * (self.k[0] + self.k[-1]) * range_) / range_**self.power
        # The wall may go on, seen by another way: points beyond its ends explain what of that reaches into the band.
        steps = np.linspace(-0.5 * mirror.length, 0.5 * mirror.length, 33)
        section = mirror.section(view, mirror.center + steps[:, None] * mirror.direction)
        far = np.concatenate([[steps[0] - section[0]], steps, [steps[-1] + section[-1]]])
        sections = np.interp(0.5 * (far[1:] + far[:-1]), steps, section)
        number = np.concatenate([[0.0], np.cumsum(np.diff(far) / sections)])
        count = 1 + int(np.ceil(number[-1] / SPACING_CELLS))
        return Row(pixel, value, along[inside], np.interp(np.linspace(0.0, number[-1], count), number, far))

    def _improved(self, row: Row, mirror: LineMirror, moved: Array, across: float) -> State:
        """The state after some Gauss-Newton steps, from responses that are linear in both parameters."""
        aside = np.array([DIFFERENCE * across, 0.0])
        before, after = self.responses(row, mirror, moved - aside), self.responses(row, mirror, moved + aside)
        change, response = (after - before) / (2.0 * aside[0]), 0.5 * (before + after)
        weight, step = np.ones(len(row.value)), np.zeros(2)
        for _ in range(STEPS):
            shifted = (response + change @ diags_array(step[0] + step[1] * row.places)).tocsc()
            residual = row.value - shifted @ _amplitudes(shifted, row.value, weight)[0]
            level = np.abs(row.value - residual)
            error = OWN_ERROR * level + LEAST_ERROR * np.sqrt(np.mean(level**2))
            weight = 1.0 / (error * np.sqrt(1.0 + (np.abs(residual) / (2.0 * error)) ** 2))
            amplitude, solve = _amplitudes(shifted, row.value, weight)
            residual = weight * (row.value - shifted @ amplitude)
            slopes = weight[:, None] * (change @ np.column_stack([amplitude, amplitude * row.places]))
            weighted = diags_array(weight) @ shifted
            slopes = slopes - weighted @ solve(weighted.conj().T @ slopes)
            slopes, left = (np.concatenate([part.real, part.imag]) for part in (slopes, residual))
            step = step + np.linalg.lstsq(slopes, left, rcond=None)[0]
        covariance = block_covariance(
            *(slopes, left, np.ones(len(left)), np.tile(row.along, 2)[:, None], mirror.independent(self.view))
        )
        unexplained = np.sum(np.abs(residual) ** 2) / np.sum(np.abs(weight * row.value) ** 2)
        return State(moved + step, covariance, float(unexplained))

    def responses(self, row: Row, mirror: LineMirror, moved: Array) -> csc_array:
        """How each pixel shows each point, if the line is moved by an offset [m] and a slope, (p, q), sparse.

        The sum over frequencies and antennas that focusing is, for a point of amplitude one, without the carrier.
        """
        offset, slope = moved
        beside = (offset + slope * row.places)[:, None] * mirror.normal
        points = mirror.center + row.places[:, None] * mirror.direction + beside
        reach = REACH_CELLS * mirror.section(self.view, row.pixel)
        first, end = (np.searchsorted(row.places, row.along + side * reach) for side in (-1.0, 1.0))
        count = end - first
        pixel = np.repeat(np.arange(count.size), count)
        point = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
        response = np.empty(pixel.size, dtype=complex)
        weights = self.k, self.taper, self.apodization
        _respond(row.pixel, points, pixel, point, self.view.radar, self.arrays, self.monostatic, *weights, response)
        return csc_array((response, (pixel, point)), shape=(len(row.pixel), len(points)))


@njit(makes_arrays=True, nogil=True, error_model="numpy")
def _respond(  # type: ignore[no-untyped-def]
    pixels, points, pixel, point, radar, arrays, monostatic, k, taper, apodization, response
):
    """The response (n,) of pixels (p, 2) to points (q, 2), for n pairs of their numbers; see `ComplexImage.responses`.

    The phases of each antenna turn by equal steps from one wavenumber to the next.
    """
    lines, count = arrays.shape[:2]
    turn, step = np.empty((2, lines, count), dtype=np.complex128)
    for i in range(pixel.size):
        p, q = pixels[pixel[i]], points[point[i]]
        deeper = np.hypot(p[0] - radar[0], p[1] - radar[1]) - np.hypot(q[0] - radar[0], q[1] - radar[1])
        for a in range(lines):
            for x in range(count):
                place = arrays[a, x]
                way = np.hypot(p[0] - place[0], p[1] - place[1]) - np.hypot(q[0] - place[0], q[1] - place[1]) - deeper
                way *= 2.0 if monostatic else 1.0
                turn[a, x], step[a, x] = np.exp(1j * k[0] * way), np.exp(1j * (k[1] - k[0]) * way)
        carrier, change = np.exp(1j * (k[0] - k[-1]) * deeper), np.exp(2j * (k[1] - k[0]) * deeper)
        total = 0.0j
        for f in range(k.size):
            both = 1.0 + 0.0j
            for a in range(lines):
                arriving = 0.0j
                for x in range(count):
                    arriving += apodization[x] * turn[a, x]
                    turn[a, x] *= step[a, x]
                both *= arriving
            if lines == 1 and not monostatic:
                both *= both
            total += taper[f] * carrier * both
            carrier *= change
        response[i] = total


def _chosen(axis: Array, first: float, last: float, cell: float) -> Index:
    """Numbers of the pixels of an axis from `first` to `last` [m], not more than `PIXELS_A_CELL` in a `cell` [m]."""
    start, stop = np.searchsorted(axis, [first, last]).tolist()
    return np.arange(start, stop, max(1, int(cell / PIXELS_A_CELL / (axis[1] - axis[0]))))


def _amplitudes(responses: csc_array, value: Complex, weight: Array) -> tuple[Complex, Callable[[Complex], Complex]]:
    """Amplitudes (q,) of the points that explain the values (p,) best, with these weights (p,); and the function that
    solves for them: the inverse of the normal equations.
    """
    weighted = diags_array(weight) @ responses
    normal = weighted.conj().T @ weighted
    least = SMOOTHING * float(normal.diagonal().real.mean())
    solve = splu((normal + least * eye_array(normal.shape[0])).tocsc()).solve
    return solve(weighted.conj().T @ (weight * value)), solve
