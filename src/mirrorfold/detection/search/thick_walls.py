"""Step 2 in the floor plan, after `fronts`: the direction of the face of a wall that scatters from inside.

Speckle inside such a wall turns the line that is fitted to it. It is turned back to where the wall's power, averaged
along the wall, begins most suddenly.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.types import Array
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.remembered import remembered
from mirrorfold.detection.views.image_view import ImageView

LARGEST_TURN_DEG, TURNS = 0.8, (17, 9)
"""Largest angle [degree] by which the speckle of a thick wall may have turned the line through it, as a depth of 1.4 %
of its length would. And numbers of angles that are tried: over that interval, and then between the neighbours of the
best angle."""

BEHIND = 2.0
"""Half-length, in resolution cells across the wall, of the profiles that show what scatters behind its face."""

LEVEL_CELLS = 8.0
"""Resolution cells along a wall over which its speckle is averaged to estimate the brightness of the wall there."""

SPECKLE_SAMPLES = 241
"""Number of samples of the profiles that are turned with the line: close enough for linear interpolation."""

SPECKLE_FLOOR = 1e-4
"""Power, relative to the wall's, below which speckle cannot be distinguished from noise and side lobes."""


@remembered
def normal_by_speckle(mirror: LineMirror, view: ImageView) -> Array | None:
    """Normal of the mirror of a thick wall, turned to the angle at which the wall's speckle is likeliest, (2,).

    None if the likeliest angle is `LARGEST_TURN_DEG` itself: then something else than the wall's speckle decides.

    The power of speckle is distributed exponentially (Goodman 2007), with a mean that depends on the depth z behind the
    face alone. With that mean, m(z), taken from the wall itself, the likelihood is largest where the mean of ``ln
    m(z)`` over all depths is smallest. A line askew to the wall smears the steep front of m(z) and makes that mean
    larger.
    """
    places = mirror.places(view)
    across = view.extent(places, mirror.normal)
    power = mirror.profiles(view, places, across[:, None] * np.linspace(-BEHIND, BEHIND, SPECKLE_SAMPLES))[1]
    width = round(LEVEL_CELLS * len(places) / mirror.independent(view))
    level = uniform_filter1d(power.max(axis=1), max(1, width), mode="nearest")
    power /= np.maximum(level, np.finfo(float).tiny)[:, None]
    # If the line turns by an angle a, each profile is shifted along itself by ``tan(a) samples``.
    samples = (places - mirror.center) @ mirror.direction / (across * 2.0 * BEHIND / (SPECKLE_SAMPLES - 1))

    def unlikelihood(angle: float) -> float:
        """The mean of ``ln m(z)`` if the line is turned by an angle [rad]."""
        shift = np.tan(angle) * samples
        whole = np.floor(shift).astype(np.intp)
        # Neighbouring profiles that are shifted by the same number of whole samples are added up before the shift.
        first = np.flatnonzero(np.diff(whole, prepend=whole[0] + 1))
        total = np.zeros(SPECKLE_SAMPLES)
        for more, share in ((0, 1.0 - shift + whole), (1, shift - whole)):
            at = np.clip(whole[first][:, None] + more + np.arange(SPECKLE_SAMPLES), 0, SPECKLE_SAMPLES - 1)
            total += np.take_along_axis(np.add.reduceat(share[:, None] * power, first), at, axis=1).sum(axis=0)
        return float(np.log(total / len(places) + SPECKLE_FLOOR).mean())

    angle, step = 0.0, np.radians(LARGEST_TURN_DEG)
    for turns in TURNS:
        angle = min(angle + np.linspace(-step, step, turns), key=unlikelihood)
        step *= 2.0 / (turns - 1)
    if abs(angle) >= np.radians(LARGEST_TURN_DEG):
        return None
    tilted = mirror.direction + np.tan(angle) * mirror.inward(view)
    return unit(turned(tilted))
