"""Normalizations: what an image is multiplied with, because echoes grow weaker with their range r.

``"none"`` leaves the amplitude of the focusing sum; ``"r"`` and ``"r2"`` multiply it by r and r^2; ``"beam"`` by the
area ``w(r)^2 / w0^2`` of a focused Gaussian beam over that of its spot (see `mirrorfold.common.beams`).
"""

from __future__ import annotations

RANGE_POWERS = {"none": 0, "r": 1, "r2": 2}
"""Powers of the range, of those normalizations that are one."""

IMAGE_NORMALIZATIONS = ("none", "r", "r2")
"""Of the image by an array."""

VOLUME_NORMALIZATIONS = ("none", "r2", "beam")
"""Of the volume of a raster scan."""
