"""Curved and short mirrors: rows of echoes that only the echoes behind them prove to be mirrors.

Behind an opaque object a radar image holds at most multiple scattering. Behind a mirror it holds the mirrored scene,
and none of its echoes folds to a place that the radar sees to be empty. So a row (in space, a sheet) is tried as a
mirror, and the echoes that are then seen by way of it are the evidence. `mirrorfold.tree.curved` and
`mirrorfold.tree.short_rows` decide which rows are tried, and how much evidence is enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import unit
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import Echoes, Mirror, View, fold_of
from mirrorfold.detection.finding import find_echoes
from mirrorfold.detection.mirrors.curved import growth_over, overlap
from mirrorfold.detection.mirrors.mirror import turns
from mirrorfold.tree.assignment import Found, Pass
from mirrorfold.tree.rounds import ordered_again

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

KNOWN_CELLS = 1.5
"""An echo that folds to within this distance of a known place shows that place and is not new. The distance is in
resolution cells, as wide as the mirror makes them. In range cells alone, fewer echoes would show known places, but then
multiple scattering behind round objects would seem to show as many new places as a mirror does."""

CONFIRMING_CELLS = 0.75
"""An echo confirms a known place that lies within `KNOWN_CELLS` range cells of the place it folds to, and within this
number of cells across the ray: twice the error of an echo's place, and as much for the known one."""

SAMPLES, PIECE = 9, 0.4
"""Number of places tested along a flat mirror; and the least share of them that lies on an arc if the mirror is a
piece of the arc: of an S-shaped wall that was taken for straight, half lies on either arc."""

ROUNDING = 1e-9
"""Largest distance of a mirror from a row of which it is a part, in lengths of the row."""

MOST_EMPTY = 0.3
"""Largest share of the cells behind a mirror that may fold to places that the radar sees to be empty."""

EvidenceSelector = Callable[[View, Echoes, Mirror], Mask]
"""Which echoes are evidence for a row, (n,)."""


class NewEchoes(NamedTuple):
    """New echoes by one chain that ends at a row, (n,), their true places (n, d) [m] and errors of these (n,) [m]."""

    echoes: Echoes
    place: Array
    reach: Array

    def cells_at(self, others: Sequence[NewEchoes], view: View) -> int:
        """Number of resolution cells that hold echoes which fold to the same places as some of the `others`."""
        agrees = np.zeros(len(self.place), dtype=bool)
        for other in others:
            if len(other.place):
                away, nearest = cKDTree(other.place).query(self.place)
                agrees |= away <= np.hypot(self.reach, other.reach[nearest])
        return view.filled_cells(self.echoes.position[agrees])


@dataclass(frozen=True)
class Evidence:
    """The echoes behind a row, counted as evidence that the row is a mirror.

    So many resolution `cells` of the image hold such echoes. Of `new` ones the echoes fold to places where nothing was
    known to be: for each chain that ends at the row these are `new_echoes`. The share `empty` folds to places that the
    radar sees to be empty. For curved rows in line of sight, `confirmed` cells have echoes that fold to known places
    and agree with these in range, and `unconfirmed` ones neither these nor any that fold to places seen to be empty.
    """

    cells: int
    new: int
    empty: float
    confirmed: int = 0
    unconfirmed: int = 0
    new_echoes: tuple[NewEchoes, ...] = field(default=(), compare=False, repr=False)

    @property
    def possible(self) -> bool:
        """Whether few enough of its cells fold to places that the radar sees to be empty."""
        return self.empty <= MOST_EMPTY


def behind(view: View, echoes: Echoes, row: Mirror) -> Mask:
    """Strong echoes farther behind a row than an object is deep, (n,)."""
    crossing = row.crossing(view)[echoes.direction]
    return echoes.strong & (echoes.range > crossing + view.object_depth(echoes.range))


def with_rows(
    found: Found,
    view: View,
    settings: FoldSettings,
    full_pass: Pass,
    *,
    proposed: Callable[[Found, View], Sequence[Mirror]],
    fewest: int,
    selected: EvidenceSelector = behind,
    is_enough: Callable[[Evidence], bool] = lambda seen: True,
    besides: Sequence[Mirror] = (),
) -> tuple[Found, list[Mirror], list[Mirror]]:
    """Steps 2 to 4 once more, with the rows that the echoes behind them prove to be mirrors; unchanged if none is.

    Rows are proposed twice: first by what is found without them, then by what is found with the mirrors of the first
    round, behind which further rows may stand. All rows of a round are tried at once; those without enough evidence are
    taken out, and the others are tried again without them.

    What is `found` so far lacks these rows, but not those `besides` that are known to be mirrors. From what is found,
    `proposed` makes rows that may be mirrors. The evidence for a row are `selected` echoes. They must fill at least the
    `fewest` resolution cells, and `is_enough` judges the rest.

    Returns the result with the rows that are mirrors; these rows, with those `besides`; and the rejected rows.
    """
    proved, every_row, first = list[Mirror](), list[Mirror](), found
    # The echoes depend on the curved mirrors alone, since flat ones dim nothing.
    echoes_through = lru_cache(1)(lambda *curved: find_echoes(view, threshold_db=settings.threshold_db, through=curved))

    def kept_of(trial: Sequence[Mirror]) -> tuple[list[Mirror], Found]:
        """Those of the rows whose evidence is enough if all are mirrors, and the result of steps 2 to 4 with them."""
        every = [*besides, *trial]
        echoes = echoes_through(*(mirror for mirror in every if mirror.curved))
        kept = [row for row in trial if view.filled_cells(echoes.position[selected(view, echoes, row)]) >= fewest]
        if len(kept) < len(trial):
            return kept, found
        places = known_places(first, view, every)
        # Without tests of echoes, a pass takes a twentieth of the time. Echoes that fail the tests can only add to what
        # seems new behind a row: if too little is new even with them, the row is no mirror.
        quick = partial(ordered_again, view, echoes, [*_flat_besides(found, every, view), *every], settings)
        full = partial(full_pass, echoes=echoes, besides=every, earlier=first)
        for run, is_full in ((quick, False), (full, True)):
            tried = run()
            seen = agreeing([evidence_of(tried, view, row, places, selected) for row in trial], view)
            convincing = (one.cells >= fewest and is_enough(one) and (one.possible or not is_full) for one in seen)
            kept = list(compress(trial, convincing))
            if len(kept) < len(trial):
                break
        return kept, tried

    for _ in range(2):
        known = [*besides, *proved]
        new = [row for row in proposed(found, view) if not any(overlap(row, other) for other in known)]
        every_row += new
        trial, tried = [*proved, *new], found
        while len(trial) > len(proved):
            kept, tried = kept_of(trial)
            if len(kept) == len(trial):
                break
            trial = kept
        if len(trial) <= len(proved):
            break
        proved, found = trial, tried
    rejected = [row for row in every_row if not any(overlap(row, other) for other in proved)]
    return found, [*besides, *proved], rejected


def known_places(found: Found, view: View, rows: Sequence[Mirror]) -> Array:
    """True places of all objects and mirrors' echoes found so far, (n, d) [m].

    Left out are echoes seen by way of flat mirrors that are pieces of the rows: they were folded to wrong places.
    """
    parts = [np.empty((0, view.dimensions))]
    for node in found.tree.walk():
        for way, fold, echoes in ((node.way, node.fold, node.objects), (node.way[:-1], node.face_fold, node.face)):
            if not any(_along(mirror, row, view) for mirror in way for row in rows):
                parts.append(fold(echoes.position))
    return np.concatenate(parts)


def _flat_besides(found: Found, rows: Sequence[Mirror], view: View) -> list[Mirror]:
    """The flat mirrors found so far, where the image shows them, without those that are pieces of the rows."""
    last = [node.mirror for node in found.tree.walk() if node.mirror is not None]
    return [mirror for mirror in last if not (mirror.curved or any(_along(mirror, row, view) for row in rows))]


def _along(mirror: Mirror, row: Mirror, view: View) -> bool:
    """Whether a flat mirror is a piece, or a chord, of a row."""
    places = mirror.ends[0] + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (mirror.ends[1] - mirror.ends[0])
    cell = view.cell_at(row.center)
    return not mirror.curved and bool(row.holds(places, cell, cell).mean() >= PIECE)


def evidence_of(found: Found, view: View, row: Mirror, known: Array, selected: EvidenceSelector = behind) -> Evidence:
    """The evidence for a row that was tried as a mirror in `found`; `known` (n, d) [m] are places known before."""
    sight, echoes = found.sight, found.echoes
    cells, empty, confirmed, unconfirmed, shows = 0, 0, 0, 0, list[NewEchoes]()
    tree = cKDTree(known)
    through = sight.through(echoes)
    for index, way in sight.ways.items():
        if not _part_of(way[-1], row):
            continue
        seen = echoes.take(echoes.visible & (through == index))
        seen = seen.take(selected(view, seen, row))
        fold = fold_of(way, view.dimensions)
        place = fold(seen.position)
        contradicted = sight.seen_empty(place)
        across = growth_over([row], seen.position).max(axis=1) * view.cross_cell(seen.position)
        reach = KNOWN_CELLS * np.hypot(view.range_cell, across)
        new = (tree.query(place)[0] > reach) & ~contradicted
        filled = view.filled_cells(seen.position)
        cells += filled
        empty += view.filled_cells(seen.position[contradicted])
        if row.curved and len(way) == 1:
            arrival = np.einsum("nij,nj->ni", turns(fold, seen.position), unit(seen.position - view.radar))
            agrees = _agree_in_range(place, arrival, across, tree, view)
            confirmed += view.filled_cells(seen.position[agrees])
            unconfirmed += filled - view.filled_cells(seen.position[agrees | contradicted])
        shows.append(NewEchoes(seen.take(new), place[new], reach[new]))
    fresh = sum(view.filled_cells(one.echoes.position) for one in shows)
    return Evidence(cells, fresh, empty / max(cells, 1), confirmed, unconfirmed, tuple(shows))


def _agree_in_range(place: Array, arrival: Array, across: Array, known: cKDTree, view: View) -> Mask:
    """Which echoes have a `known` place in the resolution cell about the `place` (n, d) they fold to, (n,).

    Known places count within `KNOWN_CELLS` range cells along the ray that arrives there, in the direction `arrival`
    (n, d), and within `CONFIRMING_CELLS` of the cells `across` it, (n,) [m].
    """
    depth, width = KNOWN_CELLS * view.range_cell, CONFIRMING_CELLS * across
    agrees = np.zeros(len(place), dtype=bool)
    for k, near in enumerate(known.query_ball_point(place, np.hypot(depth, width))):
        away = known.data[near] - place[k]
        along = away @ arrival[k]
        beside = np.linalg.norm(away - along[:, None] * arrival[k], axis=1)
        agrees[k] = np.any((np.abs(along) <= depth) & (beside <= width[k]))
    return agrees


def agreeing(seen: Sequence[Evidence], view: View) -> list[Evidence]:
    """The evidence for each row, with the cells of other rows that show the same new places added: only true mirrors
    agree on a place.
    """
    together = []
    for own in seen:
        others = [shows for other in seen if other is not own for shows in other.new_echoes]
        more = sum(shows.cells_at(own.new_echoes, view) for shows in others)
        together.append(replace(own, cells=own.cells + more, new=own.new + more))
    return together


def _part_of(mirror: Mirror, row: Mirror) -> bool:
    """Whether a mirror is a row, or a piece that was left when the row was cut."""
    return isinstance(mirror, type(row)) and np.allclose(row.beside(mirror.ends), 0.0, atol=ROUNDING * row.size)
