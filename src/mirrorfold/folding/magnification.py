"""How wide the resolution cell is behind a curved mirror, and where the caustics of the mirror are.

A thin pencil of rays that meets the mirror at the angle of incidence i, after the length r1, and goes on for s is
``q = r1 + s + 2 r1 s / (R cos(i))`` wide for each radian, with R < 0 for a concave mirror, and ``r1 + s`` wide behind a
flat one. So the resolution cell of the array grows across the line of sight by the factor ``|q| / (r1 + s)``.

At a caustic, ``1/r1 + 1/s = 2 / (|R| cos(i))``, q is zero. The image is not sharper there, because waves from a point
arrive at the array with the curvature ``(1 + 2 s / (R cos(i))) / q``, while the array is focused for
``1 / (r1 + s)``. Over an array of length D, the direction of the waves deviates by D times the difference of these
curvatures, of which the taper of a focused beam leaves about a half. At the distance of the image, this is a second
blur.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.types import Array, Names
from mirrorfold.detection import ArcMirror, ImageView, Mirror, View
from mirrorfold.detection.mirrors.curved import growth_over, last_curved

TAPERED = 0.5
"""Share of the aperture over which deviating directions of waves count: transmitters and receivers together weight the
aperture by a triangle, which exceeds half of its maximum within this share."""

OUT_OF_FOCUS = 0.25
"""Wavelengths by which waves may deviate from the focus between the middle and the ends of the array (Rayleigh's
quarter)."""

NEAR, BEYOND = "near", "beyond"
"""Where a point is seen: near a caustic, or beyond it."""


def magnified(way: Sequence[Mirror], points: Array, view: View | None) -> tuple[Array, Names]:
    """By what factor the resolution cell across the line of sight is wider than behind flat mirrors, at points (n, d)
    [m] of the image, (n,); and where a caustic is, (n,) of str.

    "near" a caustic, waves arrive out of focus: images blur and overlap. "beyond" it, images are upside down. Where
    both hold, the word is "near"; it is empty for what flat and convex mirrors show.
    """
    growth, caustic = np.ones(len(points)), np.full(len(points), "", dtype=object)
    bent = last_curved(way)
    if view is None or bent is None:
        return growth, caustic
    if not isinstance(view, ImageView) or not isinstance(bent, ArcMirror):
        return growth_over(way, points).max(axis=1), caustic
    width, bend = bent.spread(points)
    length = view.glint if np.isfinite(view.wavelength) else 0.0
    range_ = np.linalg.norm(points - view.radar, axis=1)
    with np.errstate(divide="ignore"):
        curvature = np.abs(bend / width - 1.0) / range_
    blur = TAPERED * length * np.abs(bend - width) / np.asarray(view.width(range_))
    concave = any(mirror.curvature < 0.0 for mirror in way)
    caustic[concave & (width < 0.0)] = BEYOND
    if length:
        # At the ends of the array, ``D / 2`` from its middle, the path is off by ``(D / 2)^2 / 2`` times the curvature.
        caustic[concave & (0.125 * length**2 * curvature > OUT_OF_FOCUS * view.wavelength)] = NEAR
    return np.hypot(width, blur), caustic
