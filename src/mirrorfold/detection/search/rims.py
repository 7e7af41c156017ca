"""Step 2 in space: the beams at which a plane mirror ends, by how much of their footprints falls on it.

A beam whose axis passes beside a wall still shows the wall's echoes, as a part of its footprint falls on the wall. So a
sheet of echoes reaches up to a beam radius beyond the wall. Lines of sight there see past the wall, and what they show
behind it must not be folded. A beam whose axis meets the very edge has half of its footprint on the wall, and receives
half the mean power of the beams around it that lie on the wall as a whole.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_closing, binary_opening, distance_transform_edt, gaussian_filter

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.views.volume_view import VolumeView

ON_EDGE = 0.5
"""Mean power of a beam whose axis meets the edge of a mirror, relative to a beam on its inside."""

INNER_RADII = 1.2
"""Distance from the rim of a sheet of echoes, in beam radii, from which on all of a footprint lies on the wall, to
within 10 %: sheets reach half a radius beyond the wall."""

SMOOTHED_RADII, LEVEL_RADII = 0.7, 1.5
"""Standard deviations, in beam radii, of the Gaussian weights with which the power of beams is averaged: for beams at
the edge, which must be few, and for the level around them, which must not fade with speckle."""

REACH, PROFILE_SAMPLES = 1.2, 41
"""Depth to either side of a face, in widths of the resolution cell across it, that holds the footprint of a beam; and
number of samples there."""


def within_rim(mirror: PlaneMirror, view: VolumeView) -> PlaneMirror:
    """The mirror in those of its beams that have at least half of their footprint on it.

    It stays as it is if no beam lies on it as a whole, so that the full power is not known, or if nothing would remain.
    """
    radius, beams = mirror.beam_steps(view), mirror.beams.reshape(view.shape)
    # Mirrors go on beyond the edge of the scan.
    pad = int(np.ceil(4.0 * LEVEL_RADII * radius))
    found = np.pad(beams, pad, mode="edge")
    power = np.pad(np.where(beams, _face_power(mirror, view), 0.0), pad, mode="edge")
    inner = distance_transform_edt(found) > INNER_RADII * radius
    level, known = (gaussian_filter(part.astype(float), LEVEL_RADII * radius) for part in (power * inner, inner))
    full = gaussian_filter(power, SMOOTHED_RADII * radius) * known >= ON_EDGE * level
    steps = int(np.ceil(radius))
    full = binary_opening(binary_closing(full, iterations=steps), iterations=steps)
    inside: Mask = (full[pad:-pad, pad:-pad] & beams).ravel()
    return mirror.part_in_beams(view, inside) if inner.any() and inside.any() else mirror


def _face_power(mirror: PlaneMirror, view: VolumeView) -> Array:
    """Mean power that each beam of a mirror receives from its face, in the shape of the scan; zero in other beams."""
    places = mirror.places(view)
    across = view.extent_each(places, mirror.facing(places)[1])
    _, power = mirror.profiles(view, places, across[:, None] * np.linspace(-REACH, REACH, PROFILE_SAMPLES))
    found = np.zeros(len(view.sight))
    found[mirror.beams] = power.mean(axis=1)
    return np.maximum(found, 0.0).reshape(view.shape)
