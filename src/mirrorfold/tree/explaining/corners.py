"""Right-angled corners, distinguished from points and faces by the curvature of their waves.

Each leg of a corner shows the image of the other leg, which continues that leg straight beyond the vertex. So the image
shows a cross, and half of each of its rows is no wall. The vertex is the brightest place. The wave that it returns is
that of a corner: by way of both legs, the path from transmitter to receiver is that by way of the transmitter's mirror
image in the vertex.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import ImageView, Mirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import LARGEST_SINE
from mirrorfold.focusing.echoes.coherence import CORNER, FACE, POINT
from mirrorfold.tree.explaining.waves import SweepWaves

Corners = Callable[[Array], Mask]
"""Tells which places (n, 2) [m] of the image are vertices of right-angled corners, (n,)."""

BRIGHTER = ratio_of(16.0)
"""Least amplitude of a vertex relative to the median of a row that leads through it: it is at least 16 dB brighter than
the edges of its legs."""

DIRECTIONS = np.linspace(-1.5, 1.5, 13)
"""Directions around a crossing of two rows in which a corner is looked for, in resolution cells of the array."""


def row_crossings(mirrors: Sequence[Mirror]) -> Array:
    """Where two straight rows of an image cross each other, (n, 2) [m]."""
    rows = [mirror for mirror in mirrors if isinstance(mirror, LineMirror)]
    found = []
    for one, other in combinations(rows, 2):
        beside = other.beside(one.ends)
        if beside[0] * beside[1] < 0.0:
            place = one.start + beside[0] / (beside[0] - beside[1]) * (one.end - one.start)
            if 0.0 < other.along(place) < other.length:
                found.append(place)
    return np.array(found).reshape(-1, 2)


def bright_places(mirrors: Sequence[Mirror], view: ImageView) -> Array:
    """The brightest place of each straight row, if it is bright enough for the vertex of a corner, (n, 2) [m].

    Often only one of the two rows of a corner is long enough to be found.
    """
    found = []
    for row in (mirror for mirror in mirrors if isinstance(mirror, LineMirror)):
        power = view.power_at(*view.to_polar(places := row.places(view)))
        if power.max() >= (BRIGHTER * row.strength) ** 2:
            found.append(places[power.argmax()])
    return np.array(found).reshape(-1, 2)


def corner_ratio(waves: SweepWaves, view: ImageView, range_: Array, u: Array) -> Array:
    """How much better echoes at ranges [m] and u, (n,) each, fit waves from a corner than from a point or face, (n,).

    At most one where there is a single transmitter or receiver: faces and corners then return the same wave.
    """
    most, ratio = waves.by(waves.counts[-1], view), np.zeros(range_.size)
    for i, (r, sine) in enumerate(zip(range_.tolist(), u.tolist(), strict=True)):
        directions = np.clip(sine + DIRECTIONS * most.cell, -LARGEST_SINE, LARGEST_SINE)
        fit = most.fit(most.around(r), r, directions)
        ratio[i] = fit[CORNER] / max(fit[POINT], fit[FACE], np.finfo(float).tiny)
    return ratio
