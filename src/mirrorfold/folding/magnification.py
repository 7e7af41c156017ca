"""What a curved mirror leaves of the resolution, and where its caustics are.

A thin pencil of rays from the radar is as wide as ``q = r1 + s + 2 r1 s / (R cos(i))`` for each radian where it has
met the mirror, of radius R (negative if concave) and at the angle of incidence i, after r1 and gone on for s. So the
resolution cell of the array grows by ``|q| / (r1 + s)``. At a caustic, ``1/r1 + 1/s = 2 / (|R| cos(i))``, q is zero;
but there the waves from a point no longer arrive with the curvature ``1 / (r1 + s)`` for which the array is focused,
but with ``(1 + 2 s / (R cos(i))) / q``. Over the array of length D they are inclined by the difference times D, of
which the taper of a focused beam leaves about a half; at the distance of the image that is a blur of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.types import Array, Names
from mirrorfold.detection.arc_mirror import ArcMirror
from mirrorfold.detection.curved import growth_over, last_curved
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.mirror import Mirror
from mirrorfold.detection.view import View

TAPERED = 0.5
"""Share of the aperture over which the inclination of waves counts: half of the power under both arrays' triangular
overlap lies within it."""

OUT_OF_FOCUS = 0.25
"""Wavelengths by which waves may bend off the array's focus from its middle to its ends (Rayleigh's quarter)."""

NEAR, BEYOND = "near", "beyond"


def magnified(way: Sequence[Mirror], points: Array, view: View | None) -> tuple[Array, Names]:
    """Growth of the resolution cell across at points (n, d) of the image, (n,), and where they are of a caustic.

    "near" a caustic waves arrive out of focus: images blur and overlap. "beyond" it they are upside down; where both
    apply, "near". Empty for what flat mirrors and convex ones show.
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
        caustic[concave & (0.125 * length**2 * curvature > OUT_OF_FOCUS * view.wavelength)] = NEAR
    return np.hypot(width, blur), caustic
