"""Which curved rows of echoes are mirrors: those behind which the image shows what an opaque thing cannot.

Behind a round object a radar image holds multiple scattering at most. Behind a mirror it holds the scene, and each echo
of it folds to a place that the radar does not see to be empty. So a row is a mirror if enough echoes stand behind it,
strong for what the arc leaves of them, most of them fold to where something may stand, and some show what is not known
without: of what is seen directly or in flat mirrors, a convex one shows a coarser picture at best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.arc_mirror import ArcMirror, dimming, overlap
from mirrorfold.detection.arcs import find_arcs
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.mirror import Mirror, faces, fold_of
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT
from mirrorfold.tree.ordering import Order

FEWEST_CELLS, FEWEST_NEW = 3, 2
"""Resolution cells behind a mirror in which echoes stand, at least, and those that show what is not known without:
multiple scattering may fill one."""

NEW_SHARE = 0.2
"""Least share of the cells behind a mirror that show what is not known: ways over it and further mirrors, which fold to
wrong places, fill fewer of the cells behind a pillar that shows known things. It was 0.25 and more behind true mirrors
of random scenes, and 0.17 at most behind others."""

KNOWN_CELLS = 1.5
"""What folds so close, in resolution cells as wide as the mirror leaves them, to a place that is known shows that.
Range alone would tell it more sharply, but then multiple scattering behind round objects shows as much that is new."""

SAMPLES, PIECE = 9, 0.4
"""Places along a flat mirror, and the share of them that lie on an arc if it is a piece of it: of an S-shaped wall that
was taken for straight, half of it lies on either arc."""

MOST_EMPTY = 0.3
"""Share of these cells that may fold to where the radar sees nothing."""


class Heard(Protocol):
    """The echoes of the image; where known mirrors dim what they show, down to thresholds lower by so much."""

    def __call__(self, *, gain: Array) -> Echoes: ...  # noqa: D102


class Again(Protocol):
    """Steps 2 to 4 with echoes and curved mirrors, see `mirrorfold.tree.rounds.find_tree`."""

    def __call__(self, *, echoes: Echoes, arcs: Sequence[ArcMirror]) -> Found: ...  # noqa: D102


def find_curved(found: Found, view: ImageView, *, heard: Heard, glance: Again, again: Again) -> Found:
    """Steps 2 to 4 once more, with the curved mirrors that the image tells; the same as before where it tells none.

    Those in line of sight are looked for first, then those that flat mirrors show.

    Parameters
    ----------
    found : Found
        With flat mirrors alone.
    view : ImageView
    heard, glance, again : callable
        See `Heard` and `Again`. The `glance` leaves out no copies and no echoes from elsewhere, and takes a tenth of
        the time. As these seem new behind an arc, one that shows too little new at a glance is no mirror: of 70 arcs of
        random scenes 16 were, and none of them had turned out to be one.
    """
    arcs, flat = list[ArcMirror](), found
    for _ in range(2):
        trial = [*arcs, *(arc for arc in candidates(found, view) if not any(overlap(arc, other) for other in arcs))]
        tried = found
        while len(trial) > len(arcs):
            echoes = heard(gain=gains(view, trial))
            shown = [arc for arc in trial if filled_cells(view, echoes.take(behind(view, echoes, arc))) >= FEWEST_CELLS]
            known = known_places(flat, view, trial)
            if len(shown) == len(trial):
                tried = glance(echoes=echoes, arcs=trial)
                shown = [arc for arc in trial if evidence(tried, view, arc, known).tells]
            if len(shown) == len(trial):
                tried = again(echoes=echoes, arcs=trial)
                shown = [arc for arc in trial if evidence(tried, view, arc, known).enough]
            if len(shown) == len(trial):
                break
            trial = shown
        if len(trial) <= len(arcs):
            break
        arcs, found = trial, tried
    return found


def candidates(found: Found, view: ImageView) -> list[ArcMirror]:
    """Curved rows among the echoes in line of sight, and among those that flat mirrors show.

    Parameters
    ----------
    found : Found
        What is known so far; its flat mirrors may be pieces of a curved one.
    view : ImageView
    """
    sight, echoes = found.sight, found.echoes
    ways = found.tree.ways()
    lines = {index: ways[chain][-1] for index, chain in enumerate(sight.chain) if chain}
    own = sight.seen_through(echoes.range, echoes.direction)
    if lines:
        numbers = np.array(list(lines))
        face = faces(list(lines.values()), view, echoes, 0.0, nobody=NOBODY, root=ROOT)
        on_it = face >= 0
        own = own.copy()
        own[on_it] = sight.parent[numbers[face[on_it]]]
    curved = [index for index, chain in enumerate(sight.chain) if any(mirror.curved for mirror in ways[chain])]
    own[np.isin(own, curved)] = NOBODY
    return find_arcs(view, echoes, own)


def gains(view: ImageView, arcs: Sequence[ArcMirror]) -> Array:
    """By how much curved mirrors dim what the image shows behind them, (nr, nu); one elsewhere."""
    gain = np.ones((view.range.size, view.u.size))
    for arc in arcs:
        crossing = arc.crossing(view)
        met = np.flatnonzero(np.isfinite(crossing))
        places = view.to_points(view.range[:, None], view.u[None, met])
        behind = view.range[:, None] > crossing[met]
        own = dimming([arc], places.reshape(-1, 2)).reshape(behind.shape)
        gain[:, met] = np.where(behind, np.maximum(gain[:, met], own), gain[:, met])
    return gain


@dataclass(frozen=True)
class Evidence:
    """What stands behind an arc.

    Attributes
    ----------
    cells : int
        Resolution cells of the image with strong echoes in them.
    new : int
        Those of them that fold to places where nothing was known to be.
    empty : float
        Share of all that fold to where the radar sees nothing.
    """

    cells: int
    new: int
    empty: float

    @property
    def tells(self) -> bool:
        """Whether enough stands behind it, and enough of that is new."""
        return self.cells >= FEWEST_CELLS and self.new >= max(FEWEST_NEW, NEW_SHARE * self.cells)

    @property
    def enough(self) -> bool:
        """Whether this is a mirror: it tells, and little of it cannot be."""
        return self.tells and self.empty <= MOST_EMPTY


def behind(view: ImageView, echoes: Echoes, arc: ArcMirror) -> Mask:
    """Strong echoes behind an arc, deeper than an object is, (n,)."""
    crossing = arc.crossing(view)[echoes.direction]
    return np.asarray(echoes.strong & (echoes.range > crossing + view.object_depth(echoes.range)))


def filled_cells(view: ImageView, echoes: Echoes) -> int:
    """Resolution cells of the image in which echoes stand."""
    return int(view.cell_numbers(echoes.position).max(initial=-1)) + 1


def known_places(found: Found, view: ImageView, arcs: Sequence[ArcMirror]) -> Array:
    """Where all stands that was found without flat pieces along those arcs, (n, 2) [m]: they place it wrongly."""
    folds, ways = found.tree.folds(), found.tree.ways()
    parts = [np.empty((0, 2))]
    for node in found.tree.walk():
        for way, echoes in ((node.chain, node.objects), (node.chain[:-1], node.face)):
            if not any(_along(mirror, arc, view) for mirror in ways[way] for arc in arcs):
                parts.append(folds[way](echoes.position))
    return np.concatenate(parts)


def _along(mirror: Mirror, arc: ArcMirror, view: ImageView) -> bool:
    """Whether a flat mirror is a piece of an arc, or a chord of it."""
    places = mirror.ends[0] + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (mirror.ends[1] - mirror.ends[0])
    cell, along = view.cell_at(arc.center), arc.along(places)
    near = (np.abs(arc.beside(places)) <= cell) & (along >= -cell) & (along <= arc.length + cell)
    return not mirror.curved and bool(near.mean() >= PIECE)


def evidence(found: Found, view: ImageView, arc: ArcMirror, known: Array) -> Evidence:
    """What is seen by way of an arc that was tried as a mirror, besides known places (n, 2) [m]."""
    sight, echoes = found.sight, found.echoes
    ways = found.tree.ways()
    own = [
        (index, ways[chain])
        for index, chain in enumerate(sight.chain)
        if chain and isinstance(line := ways[chain][-1], ArcMirror) and np.allclose(line.middle, arc.middle)
    ]
    cells, fresh, empty = 0, 0, 0
    tree = cKDTree(known)
    through = sight.seen_through(echoes.range, echoes.direction)
    for index, way in own:
        shown = echoes.take(echoes.visible & behind(view, echoes, arc) & (through == index))
        if not len(shown):
            continue
        place = fold_of(way, view.dimensions)(shown.position)
        range_, direction, inside = view.locate(place)
        contradicted = inside & (range_ < sight.open[direction]) if sight.open.size else np.zeros(len(shown), bool)
        across = np.abs(arc.spread(shown.position)[0]) * view.cross_cell(shown.position)
        near = tree.query(place)[0] <= KNOWN_CELLS * np.hypot(view.range_cell, across)
        cells += filled_cells(view, shown)
        fresh += filled_cells(view, shown.take(~near & ~contradicted))
        empty += filled_cells(view, shown.take(contradicted))
    return Evidence(cells, fresh, empty / max(cells, 1))


def without_bent(order: Order) -> list[Mirror] | None:
    """The mirrors without those seen by way of a curved one; None if there are no such."""
    bent = [any(mirror.curved for mirror in order.way(index)[:-1]) for index in range(len(order.mirrors))]
    return [mirror for mirror, is_bent in zip(order.mirrors, bent, strict=True) if not is_bent] if any(bent) else None
