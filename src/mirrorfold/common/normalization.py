"""Normalizations: the factors by which an image is multiplied because echoes grow weaker with their range r.

``"none"`` leaves the amplitude of the focusing sum. ``"r"`` and ``"r2"`` multiply it by r and by r^2. ``"beam"``
multiplies it by ``w(r)^2 / w0^2``, the area of a focused Gaussian beam over that of its spot (see
`mirrorfold.common.beams`).
"""

from __future__ import annotations

RANGE_POWERS = {"none": 0, "r": 1, "r2": 2}
"""The exponent of those normalizations that are a power of the range."""

IMAGE_NORMALIZATIONS = ("none", "r", "r2")
"""Normalizations for the image of an array."""

VOLUME_NORMALIZATIONS = ("none", "r2", "beam")
"""Normalizations for the volume of a raster scan."""
