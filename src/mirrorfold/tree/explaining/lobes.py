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

HIGHEST = 0.7
"""Lobes at least this high, relative to their echo, are not used: with the margin, they would be as strong as the echo,
and of two echoes each would pass for a lobe of the other. Lobes that are so high at a single frequency, as those of
antennas a wavelength apart, may be lower in the image of the whole band, because they wander: then that height counts.
"""

LONGEST_CELLS = 8
"""Distance in range, in resolution cells, up to which such a wandering lobe is looked for. A lobe that is n times as
long as its echo is n times as low: at eight cells it is 18 dB below, at the threshold of strong echoes."""


def lobe_level(waves: SweepWaves, view: ImageView, range_: Array, u: Array) -> Array:
    """Amplitude of the strongest lobe of other echoes at ranges [m] and u, (n,) each; zero where there is none.

    The sweep of the `waves` is one of several transmitters and receivers; the `view` holds the echoes that have lobes.
    """
    cell = 2 * SAMPLES_PER_CELL + 1  # lobes are a little out of focus
    level = maximum_filter1d(_levels(waves, view), cell, axis=1)
    brightest = maximum_filter1d(view.amplitude, cell, axis=0)
    row, beside, found = view.row(range_), np.arange(view.u.size), np.zeros(range_.size)
    for some in in_pieces(range_.size):
        column = np.abs(view.column(u[some])[:, None] - beside)
        for away, lobe in enumerate(level):
            for there in {-away, away}:
                echo = brightest[np.clip(row[some] + there, 0, len(brightest) - 1)]
                found[some] = np.maximum(found[some], (lobe[column] * echo).max(axis=1))
    return found


def _levels(waves: SweepWaves, view: ImageView) -> Array:
    """Heights of lobes relative to their echo, by the distances in samples of range and u, (m, n).

    There is more than one row only if some lobes count by their height in the whole band.
    """
    level = waves.lobes(view)
    high = _heights(level) >= HIGHEST
    steady = np.where(high, 0.0, level)
    if not high.any():
        return steady[None]
    wandering = np.zeros((1 + LONGEST_CELLS * SAMPLES_PER_CELL, level.size))
    wandering[:, high] = waves.wandering_lobes(view, len(wandering), np.flatnonzero(high))
    wandering[:, _heights(wandering[0]) >= HIGHEST] = 0.0
    wandering[0] += steady
    return wandering


def _heights(level: Array) -> Array:
    """The height of the lobe that each of the `level` (n,) belongs to, (n,); zero outside of lobes."""
    each, count = label(level > 0.0)
    return np.asarray(maximum(level, each, np.arange(count + 1)))[each]
