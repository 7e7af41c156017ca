"""Step 2 in the floor plan, by waves: the line of a mirror, and how far along it the wall reaches.

A rough wall scatters from every place along it. Within a resolution cell these waves interfere, and the brightest spot
of a cell that lies askew to the wall is not on the wall: centroids of power (`fit`) stray by tenths of a cell. The
complex image holds more. It is the sum of the responses to points on the wall, each with an unknown amplitude and
phase. On the true line such points explain the whole image of the wall, speckle included; beside it they do not. So the
line is moved to where the residual of the best amplitudes is smallest: a separable least-squares problem (Golub and
Pereyra, SIAM J. Numer. Anal. 10, 1973; by the approximation of Kaufman, BIT 15, 1975), solved by Gauss-Newton steps.
Errors are then those of noise and foreign echoes, not of speckle: a hundredth of a cell and less.

Where points on the line explain a wall to a thousandth of its power, and the next stretch of the row not at all, the
wall has ended, and the row goes on with echoes of something else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from mirrorfold.common.geometry import unit
from mirrorfold.common.statistics import consecutive
from mirrorfold.common.types import Array, Complex, Index
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.search.fit import block_covariance
from mirrorfold.detection.search.remembered import remembered
from mirrorfold.detection.views.image_view import ImageView

REACH_CELLS = 3.5
"""Distance along a wall, in resolution cells, up to which the response to a point counts: side lobes beyond it are 50
dB below the peak."""

BAND_CELLS, END_CELLS = 0.8, 0.6
"""Half-width of the band about a wall whose pixels are explained, in resolution cells across it: as wide as its main
lobe. And the length that the band leaves out at either end of the wall, in cells along it."""

SPACING_CELLS, PIXELS_A_CELL = 0.5, 3.0
"""Distance of neighbouring points on a wall, in resolution cells along it, at which they make up any speckle; and
largest number of pixels across a cell that are used."""

WIDTHS = 33
"""Number of places along a wall at which the width of the cell is computed, and interpolated between them: it changes
slowly, as range and angle of incidence do."""

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

FOREIGN = 0.5
"""Share of the power of a section of a row that points on its line leave unexplained if it is of other echoes: the
points make up about half of any echo near them. Walls leave a thousandth; faint ends of walls over which other echoes
lie, up to 0.5 in one section, and objects, curved walls and mixed paths in line with a wall 0.5 to 2 in most."""


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
    """A line near a row: how far its middle is moved along the normal [m], and the slope by which it turns; their
    covariance (2, 2); what points on it leave of the values, (p,), and the weights of these, (p,).
    """

    moved: Array
    covariance: Array
    residual: Complex
    weight: Array


class Explained(NamedTuple):
    """What points on the best line near a row explain.

    `moved` and `covariance` are as in `State`; `unexplained` is the share of the weighted power that is left. Along the
    row, `power` (n,) is that of n sections, each as long as a resolution cell, and `left` (n,) what is left of it.
    """

    moved: Array
    covariance: Array
    unexplained: float
    power: Array
    left: Array


def fitted(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The mirror on the line on which points explain the image best, with its standard errors.

    The same mirror, if its row has too few pixels, if the line would leave the row, by `FARTHEST_CELLS`, if it is
    not known well, by `LARGEST_ERROR_CELLS`, or if the wall scatters from elsewhere too, by `MOST_UNEXPLAINED`.
    """
    best = _explained(mirror, view)
    if best is None or best.unexplained > MOST_UNEXPLAINED:
        return mirror
    (offset, slope), errors = best.moved, np.sqrt(np.diag(best.covariance))
    if errors[0] + 0.5 * mirror.length * errors[1] > LARGEST_ERROR_CELLS * _cell_across(mirror, view):
        return mirror
    line = mirror.moved(unit(mirror.normal - slope * mirror.direction), mirror.center + offset * mirror.normal)
    return replace(line, offset_error=float(errors[0]), angle_error=float(np.degrees(errors[1])))


def shown_part(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The part of a row that is a wall: points on its line explain it, and not what follows.

    The part is that of the largest sum of ``1 - share / FOREIGN`` over its sections, with the share that is left of
    each, and no term below -1. But it is the whole row, unless most of these sections are explained to
    `MOST_UNEXPLAINED`.
    """
    best = _explained(mirror, view)
    if best is None:
        return mirror
    told = np.flatnonzero(best.power)
    share = best.left[told] / best.power[told]
    score = np.maximum(1.0 - share / FOREIGN, -1.0)
    total = np.concatenate([[0.0], np.cumsum(score)])
    first, end = np.unravel_index(np.argmax(np.triu(total - total[:, None])), (told.size + 1, told.size + 1))
    if end - first in (0, told.size) or np.median(share[first:end]) > MOST_UNEXPLAINED:
        return mirror
    borders = np.concatenate([[0], told[1:], [best.power.size]]) / best.power.size * mirror.length
    return mirror.part(float(borders[first]), float(borders[end]))


def trimmed(mirror: LineMirror, view: ImageView) -> LineMirror:
    """The `shown_part` of a mirror that lies on one of the rows that are `doubtful`; any other as it is."""
    places = mirror.at(np.linspace(0.0, mirror.length, 2 + int(mirror.independent(view))))
    for ends in view.doubtful:
        row = LineMirror(*ends)
        if row.holds(places, view.extent(places, row.normal), 0.0).any():
            return shown_part(mirror, view)
    return mirror


def doubtful_rows(mirrors: Sequence[Mirror], view: ImageView) -> Array:
    """Ends of those mirrors that are only in part a wall, and lie on no row that is `doubtful` yet, (s, 2, 2) [m]."""
    lines = [mirror for mirror in mirrors if isinstance(mirror, LineMirror)]
    longer = [line.ends for line in lines if trimmed(line, view) is line and shown_part(line, view) is not line]
    return np.reshape(longer, (-1, 2, 2))


@remembered
def _explained(mirror: LineMirror, view: ImageView) -> Explained | None:
    """What points on the best line near a row explain; None if the image does not tell, or the line leaves the row."""
    row = row_of(mirror, view)
    if row is None or len(row.pixel) <= 2 * len(row.places):  # no more pixels than unknown amplitudes
        return None
    moved, cell = np.zeros(2), _cell_across(mirror, view)
    for _ in range(ROUNDS):
        state = _improved(row, mirror, view, moved)
        moved = state.moved
        if not abs(moved[0]) + 0.5 * mirror.length * abs(moved[1]) < FARTHEST_CELLS * cell:
            return None
    count = max(1, int(mirror.independent(view)))
    section = np.clip((row.along / mirror.length + 0.5) * count, 0, count - 1).astype(np.intp)
    power, left = np.abs(row.value) ** 2, np.abs(state.residual) ** 2
    square = state.weight**2
    unexplained = float((square @ left) / (square @ power))
    along = [np.bincount(section, values, count).astype(float) for values in (power, left)]
    return Explained(moved, state.covariance, unexplained, *along)


def row_of(mirror: LineMirror, view: ImageView) -> Row | None:
    """The pixels about a mirror, and the points on it; None if the view does not know the waves of its image."""
    image = view.waves
    if image is None:
        return None
    wide = BAND_CELLS * float(view.extent(mirror.ends, mirror.normal).max())
    (x0, y0), (x1, y1) = mirror.ends.min(axis=0) - wide, mirror.ends.max(axis=0) + wide
    cell = view.extent(mirror.center[None], np.eye(2))[0]
    pixel, value = image.samples(_chosen(image.y, y0, y1, cell[1]), _chosen(image.x, x0, x1, cell[0]))
    along, beside = (pixel - mirror.center) @ mirror.direction, (pixel - mirror.center) @ mirror.normal
    inside = 0.5 * mirror.length - np.abs(along) > END_CELLS * mirror.section(view, pixel)
    inside &= np.abs(beside) < BAND_CELLS * view.extent(pixel, mirror.normal)
    # The wall may go on, seen by another way: points beyond its ends explain what of that reaches into the band.
    steps = np.linspace(-0.5 * mirror.length, 0.5 * mirror.length, WIDTHS)
    section = mirror.section(view, mirror.center + steps[:, None] * mirror.direction)
    far = np.concatenate([[steps[0] - section[0]], steps, [steps[-1] + section[-1]]])
    sections = np.interp(0.5 * (far[1:] + far[:-1]), steps, section)
    number = np.concatenate([[0.0], np.cumsum(np.diff(far) / sections)])
    count = 1 + int(np.ceil(number[-1] / SPACING_CELLS))
    places = np.interp(np.linspace(0.0, number[-1], count), number, far)
    return Row(pixel[inside], value[inside], along[inside], places)


def _improved(row: Row, mirror: LineMirror, view: ImageView, moved: Array) -> State:
    """The state after some Gauss-Newton steps, from responses that are linear in both parameters."""
    aside = np.array([DIFFERENCE * _cell_across(mirror, view), 0.0])
    before, after = responses(row, mirror, view, moved - aside), responses(row, mirror, view, moved + aside)
    change, response = (after - before) / (2.0 * aside[0]), 0.5 * (before + after)
    weight, step = np.ones(len(row.value)), np.zeros(2)
    for _ in range(STEPS):
        shifted = (response + change @ diags_array(step[0] + step[1] * row.places)).tocsc()
        residual = row.value - shifted @ _amplitudes(shifted, row.value, weight)[0]
        level = np.abs(row.value - residual)
        error = OWN_ERROR * level + LEAST_ERROR * np.sqrt(np.mean(level**2))
        trust = 1.0 / (1.0 + (np.abs(residual) / (2.0 * error)) ** 2)
        weight = np.sqrt(trust) / error
        amplitude, solve = _amplitudes(shifted, row.value, weight)
        residual = row.value - shifted @ amplitude
        slopes = weight[:, None] * (change @ np.column_stack([amplitude, amplitude * row.places]))
        weighted = diags_array(weight) @ shifted
        slopes = slopes - weighted @ solve(weighted.conj().T @ slopes)
        slopes, left = (np.concatenate([part.real, part.imag]) for part in (slopes, weight * residual))
        last = np.linalg.lstsq(slopes, left, rcond=None)[0]
        step = step + last
    # A pixel that leaves more is trusted less; its pull grows by trust^2 on average over both directions of its plane.
    along, trust = np.tile(row.along, 2)[:, None], np.tile(trust, 2)
    covariance = block_covariance(slopes, left - slopes @ last, trust, along, mirror.independent(view))
    return State(moved + step, covariance, residual, weight)


def responses(row: Row, mirror: LineMirror, view: ImageView, moved: Array) -> csc_array:
    """How each pixel shows each point, if the line is moved by an offset [m] and a slope, (p, q), sparse."""
    assert view.waves is not None  # where it is, there is no row
    offset, slope = moved
    beside = (offset + slope * row.places)[:, None] * mirror.normal
    points = mirror.center + row.places[:, None] * mirror.direction + beside
    reach = REACH_CELLS * mirror.section(view, row.pixel)
    first, end = (np.searchsorted(row.places, row.along + side * reach) for side in (-1.0, 1.0))
    count = end - first
    pixel, point = np.repeat(np.arange(count.size), count), consecutive(first, count)
    response = view.waves.response(row.pixel, points, pixel, point)
    return csc_array((response, (pixel, point)), shape=(len(row.pixel), len(points)))


def _cell_across(mirror: LineMirror, view: ImageView) -> float:
    """Width [m] of the resolution cell across a mirror, in its middle."""
    return float(view.extent(mirror.center[None], mirror.normal)[0])


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
