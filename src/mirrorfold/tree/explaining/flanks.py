"""Echoes on the flank of a wave that is explained.

One wave focuses to a blob as large as a resolution cell. Where the blob lies across the end of a mirror, one part of it
seems to stand in line of sight, and the other in the mirror; each part is explained by itself, or is not. But both are
the same wave: what is less than a cell from an explained echo, and no brighter, cannot be told from it.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Names
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.misplaced import LATE, MIXED
from mirrorfold.tree.explaining.to_and_fro import TO_AND_FRO

WAVES = (MIXED, LATE, TO_AND_FRO)
"""Explanations that give a wave another path; they hold for all of its blob."""

FLANK_CELLS = np.array([1.0, 2.0])
"""Largest distance of a flank from an explained echo in range and in direction, in resolution cells. The end of a
mirror divides the antennas, and the beam of half of them is twice as wide."""

AS_BRIGHT_DB = 1.0
"""Two echoes on either side of the peak of one wave, a quarter of a cell from it, differ by less than this."""


def flanks(echoes: Echoes, found: Found, view: ImageView) -> Names:
    """The explanation of the wave that each echo is on the flank of, (n,); "" where there is none."""
    wave = np.isin(found.explanation, WAVES)
    result = np.full(len(echoes), "", dtype=found.explanation.dtype if wave.any() else "<U1")
    if not wave.any() or not len(echoes):
        return result
    peaks, why = found.explained.take(wave), found.explanation[wave]
    level = ratio_of(AS_BRIGHT_DB) * peaks.amplitude
    at, tops = (view.in_cells(some.position) / FLANK_CELLS for some in (echoes, peaks))
    near = cKDTree(tops).query_ball_point(at, 1.0)
    for index, (those, amplitude) in enumerate(zip(near, echoes.amplitude, strict=True)):
        brighter = [peak for peak in those if level[peak] >= amplitude]
        if brighter:
            result[index] = why[max(brighter, key=level.__getitem__)]
    return result
