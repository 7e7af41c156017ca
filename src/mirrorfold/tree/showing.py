"""Rows of echoes that are mirrors by what the image shows behind them, and by nothing else: curved and short ones.

Behind an opaque object a radar image holds multiple scattering at most. Behind a mirror it holds the scene, and no echo
of the scene folds to where the radar sees that nothing stands. So a row, in space a sheet, is tried as a mirror, and
what is then seen by way of it is the evidence. Which rows are tried, and what evidence is enough, is told by
`mirrorfold.tree.curved` and `mirrorfold.tree.short_rows`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from typing import NamedTuple, Protocol

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.curved import growth_over, overlap
from mirrorfold.detection.mirrors.mirror import Mirror, fold_of
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found

KNOWN_CELLS = 1.5
"""An echo that folds so close to a known place, in resolution cells as wide as the mirror makes them, shows that place.
By range alone fewer would, but then multiple scattering behind round objects would seem to show as much that is new."""

SAMPLES, PIECE = 9, 0.4
"""Places that are looked at along a flat mirror, and the least share of them on an arc if the mirror is a piece of it:
of an S-shaped wall that was taken for straight, half lies on either arc."""

ROUNDING = 1e-9
"""A mirror that lies no farther beside a row, in lengths of the row, is a part of it."""

MOST_EMPTY = 0.3
"""Largest share of the cells behind a mirror that may fold to where the radar sees nothing."""


Shown = Callable[[View, Echoes, Mirror], Mask]
"""Which echoes are evidence for a row, (n,)."""


class Heard(Protocol):
    """The echoes of the image; behind mirrors that dim what they show, the threshold is lower by as much."""

    def __call__(self, *, through: Sequence[Mirror]) -> Echoes: ...  # noqa: D102


class Again(Protocol):
    """Steps 2 to 4 with echoes and mirrors besides those found, see `mirrorfold.tree.rounds.find_tree`."""

    def __call__(self, *, echoes: Echoes, besides: Sequence[Mirror]) -> Found: ...  # noqa: D102


class ShownNew(NamedTuple):
    """New echoes by one way over a row, (n,), where they fold to, (n, d) [m], and how uncertain that is, (n,) [m]."""

    echoes: Echoes
    place: Array
    reach: Array

    def cells_at(self, others: Sequence[ShownNew], view: View) -> int:
        """Resolution cells of these echoes that fold to a place where some of the others do, too."""
        agrees = np.zeros(len(self.place), dtype=bool)
        for other in others:
            if len(other.place):
                away, nearest = cKDTree(other.place).query(self.place)
                agrees |= away <= np.hypot(self.reach, other.reach[nearest])
        return filled_cells(view, self.echoes.take(agrees))


@dataclass(frozen=True)
class Evidence:
    """What stands behind a row.

    Attributes
    ----------
    cells : int
        Resolution cells of the image with strong echoes in them.
    new : int
        Those of them that fold to places where nothing was known to be.
    empty : float
        Share of all that fold to where the radar sees nothing.
    shown : tuple of ShownNew
        What the `new` ones show, by each way over the row.
    """

    cells: int
    new: int
    empty: float
    shown: tuple[ShownNew, ...] = field(default=(), compare=False, repr=False)

    @property
    def possible(self) -> bool:
        """Whether few enough of its cells fold to where the radar sees nothing."""
        return self.empty <= MOST_EMPTY


@dataclass(frozen=True)
class Steps:
    """How rows are tried as mirrors.

    Attributes
    ----------
    heard, glance, again : callable
        See `Heard` and `Again`. The `glance` leaves out no copies and no echoes from elsewhere, and takes a tenth of
        the time. These, too, seem new behind an arc: if even so too little is new at a glance, the arc is no mirror.
        That settled 16 of 70 arcs of random scenes, none of which had been a mirror in the end.
    """

    heard: Heard
    glance: Again
    again: Again


def with_rows(
    found: Found,
    view: View,
    steps: Steps,
    *,
    proposed: Callable[[Found, View], Sequence[Mirror]],
    fewest: int,
    shown: Shown | None = None,
    tells: Callable[[Evidence], bool] = lambda seen: True,
    besides: Sequence[Mirror] = (),
) -> tuple[Found, list[Mirror], list[Mirror]]:
    """Steps 2 to 4 once more, with the rows that are mirrors by what they show; as before where there are none.

    Those in line of sight are looked for first, then those that known mirrors show.

    Parameters
    ----------
    found : Found
        Without them.
    view : View
    steps : Steps
    proposed : callable
        Rows that may be mirrors, by what is found so far.
    fewest : int
        Resolution cells behind a row with echoes in them that count, at least.
    shown : callable, optional
        Which echoes count, `behind` by default.
    tells : callable
        Whether the evidence is enough.
    besides : sequence of Mirror
        Rows that are known to be mirrors.

    Returns
    -------
    Found, list of Mirror, list of Mirror
        What is found, the rows that are mirrors with those of `besides`, and the rows that were tried in vain.
    """
    told, every_row, first, shown = list[Mirror](), list[Mirror](), found, shown or behind
    for _ in range(2):
        known = [*besides, *told]
        new = [row for row in proposed(found, view) if not any(overlap(row, other) for other in known)]
        every_row += new
        trial, tried = [*told, *new], found
        while len(trial) > len(told):
            every = [*besides, *trial]
            echoes = steps.heard(through=every)
            kept = [row for row in trial if filled_cells(view, echoes.take(shown(view, echoes, row))) >= fewest]
            places = known_places(first, view, every)
            for step, whole in ((steps.glance, False), (steps.again, True)):
                if len(kept) < len(trial):
                    break
                tried = step(echoes=echoes, besides=every)
                seen = agreeing([evidence(tried, view, row, places, shown) for row in trial], view)
                enough = [what.cells >= fewest and tells(what) and (what.possible or not whole) for what in seen]
                kept = list(compress(trial, enough))
            if len(kept) == len(trial):
                break
            trial = kept
        if len(trial) <= len(told):
            break
        told, found = trial, tried
    in_vain = [row for row in every_row if not any(overlap(row, other) for other in told)]
    return found, [*besides, *told], in_vain


def behind(view: View, echoes: Echoes, row: Mirror) -> Mask:
    """Strong echoes behind a row, deeper than an object is, (n,)."""
    crossing = row.crossing(view)[echoes.direction]
    return np.asarray(echoes.strong & (echoes.range > crossing + view.object_depth(echoes.range)))


def filled_cells(view: View, echoes: Echoes) -> int:
    """Resolution cells of the image in which echoes stand."""
    return int(view.cell_numbers(echoes.position).max(initial=-1)) + 1


def known_places(found: Found, view: View, rows: Sequence[Mirror]) -> Array:
    """Where all stands that was found, (n, d) [m], but what flat pieces of these rows show, which is misplaced."""
    folds, ways = found.tree.folds(), found.tree.ways()
    parts = [np.empty((0, view.dimensions))]
    for node in found.tree.walk():
        for way, echoes in ((node.chain, node.objects), (node.chain[:-1], node.face)):
            if not any(_along(mirror, row, view) for mirror in ways[way] for row in rows):
                parts.append(folds[way](echoes.position))
    return np.concatenate(parts)


def _along(mirror: Mirror, row: Mirror, view: View) -> bool:
    """Whether a flat mirror is a piece of a row, or a chord of it."""
    places = mirror.ends[0] + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (mirror.ends[1] - mirror.ends[0])
    cell = view.cell_at(row.center)
    return not mirror.curved and bool(row.holds(places, cell, cell).mean() >= PIECE)


def evidence(found: Found, view: View, row: Mirror, known: Array, shown: Shown = behind) -> Evidence:
    """What is seen by way of a row that was tried as a mirror, besides known places (n, d) [m]."""
    sight, echoes = found.sight, found.echoes
    ways = found.tree.ways()
    own = [(index, ways[chain]) for index, chain in enumerate(sight.chain) if chain and _part_of(ways[chain][-1], row)]
    cells, empty, shows = 0, 0, list[ShownNew]()
    tree = cKDTree(known)
    through = sight.seen_through(echoes.range, echoes.direction)
    for index, way in own:
        seen = echoes.take(echoes.visible & (through == index))
        seen = seen.take(shown(view, seen, row))
        if not len(seen):
            continue
        place = fold_of(way, view.dimensions)(seen.position)
        range_, direction, inside = view.locate(place)
        contradicted = inside & (range_ < sight.open[direction]) if sight.open.size else np.zeros(len(seen), bool)
        across = growth_over([row], seen.position).max(axis=1) * view.cross_cell(seen.position)
        reach = KNOWN_CELLS * np.hypot(view.range_cell, across)
        new = (tree.query(place)[0] > reach) & ~contradicted
        cells += filled_cells(view, seen)
        empty += filled_cells(view, seen.take(contradicted))
        shows.append(ShownNew(seen.take(new), place[new], reach[new]))
    fresh = sum(filled_cells(view, one.echoes) for one in shows)
    return Evidence(cells, fresh, empty / max(cells, 1), tuple(shows))


def agreeing(seen: Sequence[Evidence], view: View) -> list[Evidence]:
    """The evidence of each row, and with it what other rows show at the same new places: only true mirrors agree."""
    together = []
    for own in seen:
        more = sum(shows.cells_at(own.shown, view) for other in seen if other is not own for shows in other.shown)
        together.append(replace(own, cells=own.cells + more, new=own.new + more))
    return together


def _part_of(mirror: Mirror, row: Mirror) -> bool:
    """Whether a mirror is what was left of a row when it was cut."""
    return isinstance(mirror, type(row)) and np.allclose(row.beside(mirror.ends), 0.0, atol=ROUNDING * row.size)
