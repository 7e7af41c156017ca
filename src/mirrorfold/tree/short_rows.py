"""Short and faint mirrors: rows of echoes that are none by themselves, but that echoes behind them outshine.

Half of a wall is often hidden, by an object before it or beyond the end of the mirror that shows it. The row that is
left says too little about the wall's direction, and may be as short as the flat side of an object. A smooth wall at a
slant is faint all along, beside whatever faces the radar. But a mirror is smoother than what it shows: echoes behind it
are brighter than those of its own face. Multiple scattering behind an object never is, except behind a small corner:
its vertex is so bright that what goes to and fro between the corner and a wall outshines the corner's legs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import ROOT, UNSEEN, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror, View, any_curved
from mirrorfold.detection.mirrors.mirror import faces
from mirrorfold.detection.search.arcs import SMALLEST_FILL
from mirrorfold.detection.search.lines import MINIMUM_CELLS, SHORT_CELLS, find_lines
from mirrorfold.tree.assignment import Found, Pass
from mirrorfold.tree.evidence import behind, with_rows
from mirrorfold.tree.explaining.corners import Corners, bright_places
from mirrorfold.tree.lines_of_sight import OUTSHINES_DB

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

FEWEST = 2
"""Least number of echoes, a resolution cell apart, that outshine a row: one alone may be seen past the row's end."""


def find_short(
    found: Found,
    view: ImageView,
    settings: FoldSettings,
    full_pass: Pass,
    *,
    corners: Corners | None = None,
    besides: Sequence[Mirror] = (),
) -> tuple[Found, list[Mirror]]:
    """Steps 2 to 4 once more with short mirrors: the result, and the mirrors with those of `besides`.

    `found` is the result so far. It holds `besides`, mirrors that steps 2 to 4 do not find by themselves, such as
    curved ones. `corners` tells which places (n, 2) [m] of the image are vertices of corners, (n,).
    """
    shortest = SHORT_CELLS / MINIMUM_CELLS * (settings.minimum_length or 0.0)
    return with_rows(
        *(found, view, settings, full_pass), proposed=partial(short_rows, shortest=shortest, corners=corners),
        fewest=FEWEST, selected=outshining, besides=besides,
    )[:2]  # fmt: skip


def outshining(view: View, echoes: Echoes, row: Mirror) -> Mask:
    """Echoes behind a row that outshine its median by `OUTSHINES_DB`, only the brightest within a cell, (n,)."""
    level = ratio_of(OUTSHINES_DB) * row.strength
    which = np.flatnonzero(behind(view, echoes, row) & (echoes.amplitude > level))
    which = which[np.argsort(-echoes.amplitude[which])]
    place, found = view.in_cells(echoes.position[which]), np.zeros(len(echoes), dtype=bool)
    while which.size:
        found[which[0]] = True
        apart = np.abs(place - place[0]).max(axis=1) > 1.0
        which, place = which[apart], place[apart]
    return found


def short_rows(found: Found, view: ImageView, shortest: float, corners: Corners | None = None) -> list[Mirror]:
    """Straight rows of echoes that are all seen by way of the same mirrors, and lie on no known mirror.

    In line of sight, rows of faint echoes are among them, if they are long.

    Rows with the vertex of a corner at an end are left out: they are its legs. It is the brightest place of such a row.
    Without `corners`, every place at an end that is bright enough counts as a vertex.
    """
    sight, echoes = found.sight, found.echoes
    loose = faces([way[-1] for way in sight.ways.values()], view, echoes, 0.0) == ROOT
    own = np.where(loose & echoes.visible, sight.through(echoes), UNSEEN)
    rows = list[Mirror]()
    for index in np.unique(own[own >= ROOT]):
        if not any_curved(sight.ways.get(index, ())):
            some = echoes.take(own == index)
            rows += find_lines(some, view, minimum_length=shortest)
            if index == ROOT:  # faint rows, as long as other mirrors
                some = replace(some, strong=np.ones(len(some), dtype=bool))
                rows += find_lines(some, view, minimum_length=MINIMUM_CELLS / SHORT_CELLS * shortest)
    rows = [row for row in rows if row.fill >= SMALLEST_FILL]
    vertex = bright_places(rows, view)
    if corners is not None and len(vertex):
        vertex = vertex[corners(vertex)]
    marked = view.knowing(corners=vertex)
    return [row for row in rows if not marked.near_corner(row.ends).any()]
