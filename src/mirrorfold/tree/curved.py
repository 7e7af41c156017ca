"""Curved mirrors: which curved rows of echoes are mirrors, judged by the echoes behind them.

A curved row may be a mirror or a round object. It is a mirror if enough echoes stand behind it that are strong enough,
given how much the arc spreads the wave; if most of them fold to where an object may stand; and if some of them fold to
places that are not known otherwise. The last condition is needed because multiple scattering behind a round object
folds to objects that are known, and of those a convex mirror shows a coarser picture at best.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.common.types import UNSEEN
from mirrorfold.detection import Mirror, View, any_curved
from mirrorfold.detection.finding import find_curved_rows
from mirrorfold.detection.mirrors.mirror import faces
from mirrorfold.tree.assignment import Found, Pass
from mirrorfold.tree.evidence import Evidence, with_rows

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

FEWEST_CELLS = 3
"""Least number of resolution cells with echoes behind a mirror, and of those that fold to places not known before:
multiple scattering may fill one or two."""

NEW_SHARE = 0.23
"""Least share of the cells behind a mirror that fold to places not known before. Behind a pillar that shows known
objects, fewer cells do: those of echoes by way of the pillar and further mirrors, which fold to wrong places. The share
was at least 0.25 behind true mirrors of random scenes, at most 0.17 behind other rows, and 0.21 behind an arc of full
waves."""

UNCONFIRMED_SHARE = 0.4
"""Least share of the cells behind a mirror that agree with no known place in range, where others do. It was 0.44 and
more behind pillars of 10 cm radius, and 0.25 at most behind round objects in line of sight that show little new."""


def find_curved(
    found: Found, view: View, settings: FoldSettings, full_pass: Pass
) -> tuple[Found, list[Mirror], list[Mirror]]:
    """Steps 2 to 4 once more with curved mirrors: the result, the mirrors, and the rejected rows, see `with_rows`."""
    return with_rows(found, view, settings, full_pass, proposed=candidates, fewest=FEWEST_CELLS, is_enough=shows_new)


def shows_new(seen: Evidence) -> bool:
    """Whether enough cells behind a row fold to places not known before.

    A small convex mirror makes cells so wide that nearly all of them hold a known place. But where such a mirror shows
    several known places at their own ranges, cells that agree with no range show something else.
    """
    too_wide = seen.new < FEWEST_CELLS and seen.confirmed >= FEWEST_CELLS
    if too_wide and seen.unconfirmed >= max(FEWEST_CELLS, UNCONFIRMED_SHARE * seen.cells):
        return True
    return seen.new >= max(FEWEST_CELLS, NEW_SHARE * seen.cells)


def candidates(found: Found, view: View) -> Sequence[Mirror]:
    """Curved rows (in space, round sheets) among the echoes in line of sight, and among those that flat mirrors show.

    Echoes on a flat mirror that is `found` already are among them: it may be a piece of a curved one.
    """
    sight, echoes = found.sight, found.echoes
    own, numbers = sight.through(echoes), np.array(list(sight.ways), dtype=np.intp)
    face = faces([way[-1] for way in sight.ways.values()], view, echoes, 0.0)
    own[face >= 0] = sight.parent[numbers[face[face >= 0]]]
    own[np.isin(own, [index for index, way in sight.ways.items() if any_curved(way)])] = UNSEEN
    return find_curved_rows(view, echoes, own)
