"""The floor plan of the folded scene."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.types import Array, Chain
from mirrorfold.detection.image_view import EDGE_CELLS, SAMPLES_PER_CELL, ImageView
from mirrorfold.tree.lines_of_sight import ROOT, LinesOfSight, hidden_at, through_at

EDGE_COLUMNS = EDGE_CELLS * SAMPLES_PER_CELL
"""Directions beside a pixel that must show it through the same mirror, where the radar's own view is empty."""


def draw_image(
    x: Array,
    y: Array,
    view: ImageView,
    sight: LinesOfSight,
    folds: dict[Chain, Isometry],
    wall_margin: float,
    blobs: NDArray[np.int16],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Folded and unfolded amplitude on a grid, (y, x) each.

    Every pixel of the true scene looks up the amplitude of the image where each chain of mirrors shows it: there are
    no holes, as pushing pixels to their folded places would leave them.

    Parameters
    ----------
    x, y : 1D arrays [m]
    view : ImageView
    sight : LinesOfSight
    folds : dict
        For every chain, the map from the image to the true place.
    wall_margin : float [m]
        How far behind a mirror echoes still belong to the wall.
    blobs : (directions, ranges) array of int
        Where the image shows what folds to a point, see `folded_blobs`; nothing else is folded.
    """
    initial = np.zeros((y.size, x.size), dtype=np.float32)
    intensity = np.zeros_like(initial)
    crossing, through = sight.passages
    grid = (view.radar, view.along, view.broadside, view.range[0], view.dr, view.u[0], view.du)
    empty = sight.open if sight.open.size else np.zeros(view.u.size)
    hides = (sight.cover.range, sight.cover.level, empty)
    lines = (*hides, np.ascontiguousarray(crossing), np.ascontiguousarray(through), wall_margin, blobs)
    here = Isometry.identity()
    _draw(x, y, here.linear, here.shift, view.amplitude, *grid, *lines, ROOT, intensity, initial)
    for index, chain in enumerate(sight.chain):
        if chain:
            outline = folds[chain](view.to_points(*_region(view, sight.crossing[index]).T))
            first, last = outline.min(axis=0), outline.max(axis=0)
            rows, columns = (
                slice(np.searchsorted(axis, first[i]), np.searchsorted(axis, last[i], side="right"))
                for i, axis in ((1, y), (0, x))
            )
            back = folds[chain].inverse
            part = intensity[rows, columns]
            _draw(x[columns], y[rows], back.linear, back.shift, view.amplitude, *grid, *lines, index, part, part[:0])
    return intensity, initial


def _region(view: ImageView, crossing: Array) -> Array:
    """Outline (n, 2) of all that may be seen through a mirror: range [m] and u."""
    columns = np.flatnonzero(np.isfinite(crossing))
    edges = [
        np.stack(np.broadcast_arrays(range_, view.u[columns] + side), axis=-1)
        for range_ in (crossing[columns], view.range[-1])
        for side in (-0.5 * view.du, 0.5 * view.du)
    ]
    return np.concatenate(edges)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _draw(  # type: ignore[no-untyped-def]
    x, y, linear, shift, amplitude, radar, along, broadside, range0, dr, u0, du, begin, level, empty, crossing,
    through, wall_margin, blobs, mirror, intensity, initial,
):  # fmt: skip
    """``intensity = max(intensity, image(linear @ p + shift))`` where `mirror` shows it; `initial` if it has rows."""
    rows, columns = amplitude.shape
    for i in range(y.size):
        for j in range(x.size):
            px = linear[0, 0] * x[j] + linear[0, 1] * y[i] + shift[0] - radar[0]
            py = linear[1, 0] * x[j] + linear[1, 1] * y[i] + shift[1] - radar[1]
            if px * broadside[0] + py * broadside[1] < 0.0:
                continue
            distance = np.hypot(px, py)
            row = (distance - range0) / dr
            column = ((px * along[0] + py * along[1]) / distance - u0) / du
            if not (0.0 <= row <= rows - 1 and 0.0 <= column <= columns - 1):
                continue
            r, c = min(int(row), rows - 2), min(int(column), columns - 2)
            a, b = row - r, column - c
            value = (1.0 - a) * ((1.0 - b) * amplitude[r, c] + b * amplitude[r, c + 1]) + a * (
                (1.0 - b) * amplitude[r + 1, c] + b * amplitude[r + 1, c + 1]
            )
            if initial.shape[0]:
                initial[i, j] = value
            nearest = min(int(column + 0.5), columns - 1)
            if value <= intensity[i, j] or value <= hidden_at(begin, level, distance, nearest):
                continue
            if through_at(crossing, through, distance - wall_margin, nearest) != mirror:
                continue
            if mirror >= 0:
                if blobs[nearest, min(int(row + 0.5), rows - 1)] != mirror:
                    continue
                # Next to the edge of what the mirror shows, the radar's own view must not contradict.
                px, py = x[j] - radar[0], y[i] - radar[1]
                own = np.hypot(px, py)
                column = (px * along[0] + py * along[1]) / max(own, range0) - u0
                at = int(column / du + 0.5)
                ahead = px * broadside[0] + py * broadside[1] >= 0.0 and 0 <= at < columns
                if ahead and range0 <= own < empty[at]:
                    left, right = max(nearest - EDGE_COLUMNS, 0), min(nearest + EDGE_COLUMNS, columns - 1)
                    if through_at(crossing, through, distance - wall_margin, left) != mirror or (
                        through_at(crossing, through, distance - wall_margin, right) != mirror
                    ):
                        continue
            intensity[i, j] = value
