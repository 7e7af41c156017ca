"""What a curved mirror leaves of the resolution, and where its caustics are.

A thin pencil of rays leaves the radar, meets the mirror after r1 at the angle of incidence i, and goes on for s. The
mirror has the radius of curvature R, negative if it is concave. For each radian that the pencil opens by it is then
``q = r1 + s + 2 r1 s / (R cos(i))`` wide, where behind a flat mirror it would be ``r1 + s``. So the resolution cell of
the array grows by ``|q| / (r1 + s)``.

At a caustic, ``1/r1 + 1/s = 2 / (|R| cos(i))``, q is zero. But there the waves from a point do not arrive with the
curvature ``1 / (r1 + s)`` for which the array is focused, but with ``(1 + 2 s / (R cos(i))) / q``. From one end of the
array, of length D, to the other their direction is off by the difference of both curvatures times D, of which the taper
of a focused beam leaves about a half. At the distance of the image, that is a blur of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.types import Array, Names
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.curved import growth_over, last_curved
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View

TAPERED = 0.5
"""Share of the aperture over which the inclination of waves counts: half of the power under both arrays' triangular
overlap lies within it."""

OUT_OF_FOCUS = 0.25
"""Wavelengths by which waves may bend off the array's focus from its middle to its ends (Rayleigh's quarter)."""

NEAR, BEYOND = "near", "beyond"


def magnified(way: Sequence[Mirror], points: Array, view: View | None) -> tuple[Array, Names]:
    """How much wider the resolution cell is across the line of sight than behind flat mirrors, at points (n, d) [m] of
    the image, (n,); and on which side of a caustic they are seen, (n,) of str.

    "near" a caustic waves arrive out of focus: images blur and overlap. "beyond" it images are upside down. Where both
    hold it is "near"; for what flat and convex mirrors show it is empty.
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
