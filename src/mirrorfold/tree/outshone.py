"""Echoes so weak beside the brightest one at their range that they may be side lobes of it.

What full apertures of equal antennas show beside an echo is known, and never taken for echoes. Far from a bright glint
there is more: antennas that differ by a few percent leave lobes 40 dB below it. And where a mirror ends, or one thing
hides another, a part of the array sees the glint and the rest does not; the lobes of such a part fall no faster than
``1 / (pi D u / lambda)``. They stay until the whole tree is found, for what hides other things does so whatever it is.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from mirrorfold.common.types import Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL, ImageView
from mirrorfold.detection.views.view import View

OUTSHONE = "may be a side lobe of a much brighter one"

OUTSHONE_DB = 40.0
"""An echo this much weaker than the brightest within a resolution cell of its range is no evidence of anything."""


def outshone(objects: Echoes, view: View) -> Mask:
    """Which objects may be side lobes of others at their range, (n,). In a volume, none are."""
    if not isinstance(view, ImageView):
        return np.zeros(len(objects), dtype=bool)
    brightest = maximum_filter1d(view.amplitude.max(axis=1, initial=0.0), 2 * SAMPLES_PER_CELL + 1)
    return np.asarray(objects.amplitude < brightest[view.row(objects.range)] * 10.0 ** (-OUTSHONE_DB / 20.0))
