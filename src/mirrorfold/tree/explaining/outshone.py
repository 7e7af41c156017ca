"""Echoes so weak beside the brightest one at their range that they may be side lobes of it.

The side lobes of a full aperture of equal antennas are known, and are never taken for echoes. The side lobes of a real
array are higher. Antennas that differ by a few percent leave lobes 40 dB below a bright glint in all directions. And if
only a part of the array, D wide, sees the glint, past the end of a mirror or beside an object, its lobes fall no faster
than ``1 / (pi D u / lambda)``. Echoes as weak as that are left out once the whole tree is found. Until then they hide
what is behind them, and a wall may go on through them.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from mirrorfold.common.types import Mask
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL

OUTSHONE = "may be a side lobe of a much brighter one"

OUTSHONE_DB = 40.0
"""An echo weaker by this than the brightest echo within a range cell of its range is no evidence of an object."""


def outshone(objects: Echoes, view: ImageView) -> Mask:
    """Which objects may be side lobes of brighter echoes at their range, (n,)."""
    brightest = maximum_filter1d(view.amplitude.max(axis=1, initial=0.0), 2 * SAMPLES_PER_CELL + 1)
    return np.asarray(objects.amplitude < brightest[view.row(objects.range)] * 10.0 ** (-OUTSHONE_DB / 20.0))
