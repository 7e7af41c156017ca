"""Echoes on the flank of a wave that is explained.

One wave focuses to a blob as large as a resolution cell. Where the blob lies across the end of a mirror, one part of it
seems to stand in line of sight, and the other in the mirror; each part is explained by itself, or is not. But both are
the same wave: the explanation of an echo holds for all that is less than a cell from it, and no brighter.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Names
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.misplaced import LATE, MIXED
from mirrorfold.tree.explaining.reflected_on import REFLECTED_ON
from mirrorfold.tree.explaining.to_and_fro import TO_AND_FRO

ASIDE_CELLS = {TO_AND_FRO: 2.0, REFLECTED_ON: 2.0, MIXED: 1.0, LATE: 1.0}
"""Explanations that give a wave another path and so hold for all of its blob, and the largest distance of a flank in
direction, in resolution cells. The end of a mirror divides the antennas, and the beam of half of them is twice as wide.
The sweep was asked about each cell by itself, so that only the neighbouring cell is in question."""

FLANK_CELLS = 1.0
"""Largest distance of a flank in range, in resolution cells."""

AS_BRIGHT_DB = 1.0
"""Two echoes on either side of the peak of one wave, a quarter of a cell from it, differ by less than this."""


def flanks(echoes: Echoes, found: Found, view: ImageView) -> Names:
    """The explanation of the wave that each echo is on the flank of, (n,); "" where there is none."""
    result, brightest = np.full(len(echoes), "", dtype=found.explanation.dtype), np.zeros(len(echoes))
    for reason, cells in ASIDE_CELLS.items():
        peaks = found.explained.take(found.explanation == reason)
        at, tops = (view.in_cells(some.position) / (FLANK_CELLS, cells) for some in (echoes, peaks))
        near = cKDTree(tops).query_ball_point(at, 1.0)
        amplitude = np.array([peaks.amplitude[those].max(initial=0.0) for those in near])
        flank = (echoes.amplitude <= ratio_of(AS_BRIGHT_DB) * amplitude) & (amplitude > brightest)
        result[flank], brightest[flank] = reason, amplitude[flank]
    return result
