"""Right-angled corners, told from points and faces by the curvature of their waves.

Each leg of a corner shows the image of the other leg, which continues that leg straight beyond the vertex. So the image
shows a cross, and half of each of its rows is no wall. The vertex is the brightest place. The wave that it returns is
that of a corner: by way of both legs, the path from transmitter to receiver is that by way of the transmitter's mirror
image in the vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import xarray as xr

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import ImageView, Mirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import LARGEST_SINE
from mirrorfold.focusing.echoes.coherence import CORNER, FACE, POINT
from mirrorfold.sweep.pairs import pairs_of
from mirrorfold.tree.explaining.waves import Waves, numbers_of_pairs

LIKE_A_CORNER = 1.1
"""Least coherence with waves from a corner, over those with waves from a point and from a face at the same place.
Corners have ratios of 1.25 and more, other echoes of at most one."""

DIRECTIONS = np.linspace(-1.5, 1.5, 13)
"""Directions around a crossing of two rows in which a corner is looked for, in resolution cells of the array."""


def vertices(mirrors: Sequence[Mirror]) -> Array:
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


def are_corners(sweep: xr.Dataset, view: ImageView, places: Array) -> Mask:
    """Whether echoes at places (n, 2) [m] of the image are those of right-angled corners, (n,).

    False for all where there is a single transmitter or receiver: points, faces and corners then return the same wave.
    """
    if not len(places):
        return np.zeros(0, dtype=bool)
    pairs = pairs_of(sweep)
    chosen = np.random.default_rng(0).permutation(pairs.tx_of.size)[: numbers_of_pairs(*pairs.s.shape)[-1]]
    waves, found = Waves(pairs, chosen, view), np.zeros(len(places), dtype=bool)
    for i, (r, u) in enumerate(zip(*view.to_polar(places), strict=True)):
        directions = np.clip(u + DIRECTIONS * waves.cell, -LARGEST_SINE, LARGEST_SINE)
        fit = waves.fit(waves.around(float(r)), float(r), directions)
        found[i] = fit[CORNER] > LIKE_A_CORNER * max(fit[POINT], fit[FACE])
    return found
