"""Pixels of the folded floor plan."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from mirrorfold.detection.image_view import EDGE_CELLS, SAMPLES_PER_CELL, ImageView
from mirrorfold.tree.lines_of_sight import hidden_at, through_at


def image_tables(view: ImageView) -> tuple[Any, ...]:
    """What `draw_row` needs to know of an image."""
    grid = float(view.range[0]), view.dr, float(view.u[0]), view.du
    return view.amplitude, view.radar, view.along, view.broadside, *grid, EDGE_CELLS * SAMPLES_PER_CELL


@numba.njit(cache=True, nogil=True, error_model="numpy")
def draw_row(  # type: ignore[no-untyped-def]
    x, y, linear, shift, number, crossing, through, begin, level, empty, margin, blobs, out,
    amplitude, radar, along, broadside, range0, dr, u0, du, edge,
):  # fmt: skip
    """Pixels of one y, (x,): the largest amplitude with which any chain of mirrors shows them, see `pictures.draw`."""
    rows, columns = amplitude.shape
    for w in range(number.size):
        a = linear[w]
        for j in range(x.size):
            px = a[0, 0] * x[j] + a[0, 1] * y + shift[w, 0] - radar[0]
            py = a[1, 0] * x[j] + a[1, 1] * y + shift[w, 1] - radar[1]
            if px * broadside[0] + py * broadside[1] < 0.0:
                continue
            distance = np.hypot(px, py)
            row = (distance - range0) / dr
            column = ((px * along[0] + py * along[1]) / distance - u0) / du
            if not (0.0 <= row <= rows - 1 and 0.0 <= column <= columns - 1):
                continue
            nearest = min(int(column + 0.5), columns - 1)
            if through_at(crossing, through, distance - margin, nearest) != number[w]:
                continue
            r, c = min(int(row), rows - 2), min(int(column), columns - 2)
            f, g = row - r, column - c
            value = (1.0 - f) * ((1.0 - g) * amplitude[r, c] + g * amplitude[r, c + 1]) + f * (
                (1.0 - g) * amplitude[r + 1, c] + g * amplitude[r + 1, c + 1]
            )
            if value <= out[j] or value <= hidden_at(begin, level, distance, nearest):
                continue
            if number[w] >= 0:
                if blobs[nearest, min(int(row + 0.5), rows - 1)] != number[w]:
                    continue
                # Next to the edge of what the mirror shows, the radar's own view must not contradict.
                px, py = x[j] - radar[0], y - radar[1]
                own = np.hypot(px, py)
                at = int(((px * along[0] + py * along[1]) / max(own, range0) - u0) / du + 0.5)
                ahead = px * broadside[0] + py * broadside[1] >= 0.0 and 0 <= at < columns
                if ahead and range0 <= own < empty[at]:
                    left, right = max(nearest - edge, 0), min(nearest + edge, columns - 1)
                    if through_at(crossing, through, distance - margin, left) != number[w] or (
                        through_at(crossing, through, distance - margin, right) != number[w]
                    ):
                        continue
            out[j] = value
