"""Echoes that are grating lobes of brighter ones at the same range, in images of arrays with antennas too far apart.

An echo spreads in the image as the product of the transmitters' and the receivers' beams, so that the levels of both
add in decibels: where both have a lobe in the same direction, the image repeats an echo below its own level by the sum
of both lobes' levels. A full array has no such lobes; where every third antenna is missing, they are 12 dB below the
echo.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import label, maximum, maximum_filter1d

from mirrorfold.common.types import Array
from mirrorfold.detection import ImageView
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL
from mirrorfold.detection.views.view import in_pieces
from mirrorfold.tree.explaining.waves import SweepWaves

LOBE = "is a grating lobe of a brighter one"

MARGIN_DB = 3.0
"""A lobe may be this much stronger than the strongest one expected at its place: lobes of two echoes add."""

HIGHEST = 0.5
"""Lobes at least this high, relative to their echo, are not used: an echo would pass for the lobe of its own ghost."""


def lobe_level(waves: SweepWaves, view: ImageView, range_: Array, u: Array) -> Array:
    """Amplitude of the strongest lobe of other echoes at ranges [m] and u, (n,) each; zero where there is none.

    The sweep of the `waves` is one of several transmitters and receivers; the `view` holds the echoes that have lobes.
    """
    cell = 2 * SAMPLES_PER_CELL + 1  # lobes are a little out of focus
    level = waves.lobes(view).copy()
    each, count = label(level > 0.0)
    height = np.asarray(maximum(level, each, np.arange(count + 1)))
    level[height[each] >= HIGHEST] = 0.0
    level = maximum_filter1d(level, cell)
    brightest = maximum_filter1d(view.amplitude, cell, axis=0)
    row = view.row(range_)
    beside, found = np.arange(view.u.size), np.empty(range_.size)
    for some in in_pieces(range_.size):
        column = view.column(u[some])
        found[some] = (level[np.abs(column[:, None] - beside)] * brightest[row[some]]).max(axis=1)
    return found
