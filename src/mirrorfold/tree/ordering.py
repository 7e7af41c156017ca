"""Step 3 of the algorithm: the order of the mirrors, from those in line of sight to those seen through others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.common.stopping import go_on
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes, brightest_of, reference_echo
from mirrorfold.detection.mirrors.curved import dimming
from mirrorfold.detection.mirrors.mirror import Mirror, faces, fold_of
from mirrorfold.detection.views.view import View
from mirrorfold.tree.explaining.shadowless import without_shadow
from mirrorfold.tree.lines_of_sight import ITSELF_CELLS, NOBODY, ROOT, Cover, LinesOfSight

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

BEAM = 0.5
"""Directions are counted in beams of this many resolution cells where the brightest echo of each is looked for."""


@dataclass(frozen=True, eq=False)
class Order:
    """Mirrors in their order.

    Attributes
    ----------
    mirrors : sequence of Mirror
        Those that are seen, cut where one part is seen by way of another mirror than the next.
    sight : LinesOfSight
        With the parent of each mirror.
    face : (n,) array of int
        The mirror that each echo lies on, `NOBODY` for echoes from inside a wall, `ROOT` for all others.
    """

    mirrors: Sequence[Mirror]
    sight: LinesOfSight
    face: Index

    def itself(self) -> Mask:
        """Which mirrors are the radar's own antennas, seen in another mirror, (mirrors,)."""
        view, found = self.sight.view, np.zeros(len(self.mirrors), dtype=bool)
        for index, mirror in enumerate(self.mirrors):
            place = fold_of(self.way(self.sight.parent[index]), view.dimensions)(mirror.center)
            found[index] = view.on_radar(place[None], ITSELF_CELLS * view.cell_at(mirror.center))[0]
        return found

    def way(self, index: int) -> tuple[Mirror, ...]:
        """The mirrors on the way to what is seen by way of one of them, the first first; none for `ROOT`."""
        way: tuple[Mirror, ...] = ()
        while index >= 0:
            way, index = (self.mirrors[index], *way), int(self.sight.parent[index])
        return way

    def shown_by(self, echoes: Echoes) -> Index:
        """The mirror by way of which each of the echoes is seen, those of mirrors' own faces, too: its number, (n,)."""
        parent = np.append(self.sight.parent, [NOBODY, ROOT])
        through = self.sight.seen_through(echoes.range, echoes.direction)
        return np.where(self.face == ROOT, through, parent[self.face])

    def seen(self, echoes: Echoes) -> Echoes:
        """The echoes with their marks `visible` and `strong` as they follow from this order."""
        visible = echoes.visible & self.sight.clear(echoes)
        through = self.sight.seen_through(echoes.range, echoes.direction)
        strong, limit = echoes.strong.copy(), echoes.limit.copy()
        beam = np.rint(self.sight.view.in_cells(echoes.position)[:, 1:] / BEAM).astype(np.intp)
        beam -= beam.min(axis=0, initial=0)
        number = beam @ np.cumprod([1, *(beam.max(axis=0, initial=0) + 1)])[:-1]
        # A lossy mirror dims all that is seen through it: where the objects behind it are dimmer than the reference,
        # the threshold follows them down.
        for mirror in range(len(self.mirrors)):
            behind = visible & (self.face == ROOT) & (through == mirror)
            objects = behind & echoes.strong
            if objects.any():
                # What a curved mirror spreads is known, and is no loss.
                gain = dimming(self.way(mirror), echoes.position)
                level = echoes.amplitude * gain
                reference = reference_echo(brightest_of(number[objects], level[objects]))
                limit[behind] = (min(reference / echoes.reference, 1.0) * echoes.threshold / gain)[behind]
                strong |= behind & (echoes.amplitude >= limit)
        return replace(echoes, visible=visible, strong=strong, limit=limit)


def order_mirrors(
    mirrors: Sequence[Mirror], view: View, echoes: Echoes, settings: FoldSettings, walls: Mask | None = None
) -> Order:
    """Who is seen through whom.

    Parameters
    ----------
    mirrors : sequence of Mirror
    view : View
    echoes : Echoes
    settings : FoldSettings
        The minimum length is also that of the pieces that a mirror is cut into.
    walls : (n,) bool array, optional
        Where the mirrors are given by hand: the echoes of all walls that the image shows, used as mirrors or not. They
        are no objects. As a given mirror is in view whatever stands before it, objects then hide only what is seen
        behind the same mirrors, and all that is not folded stays.
    """
    found = _ordered(mirrors, view, echoes, settings, walls)
    if settings.generations is not None:
        before = np.arange(len(found.mirrors))
        for _ in range(min(settings.generations, len(found.mirrors))):
            before = np.where(before >= 0, found.sight.parent[before], before)
        if (before >= 0).any():
            kept = [mirror for mirror, deeper in zip(found.mirrors, before, strict=True) if deeper < 0]
            found = _ordered(kept, view, echoes, settings, walls)
    return found


def _ordered(
    mirrors: Sequence[Mirror], view: View, echoes: Echoes, settings: FoldSettings, walls: Mask | None
) -> Order:
    """Cut the mirrors, find what hides them, and the parent of each that is seen."""
    whole, pieces, remains = mirrors, [[mirror] for mirror in mirrors], list[Mirror]()
    # A mirror may be hidden by a piece of one that is cut itself: the second pass knows the pieces of the first.
    for _ in range(2):
        others = [list(chain(*pieces[:i], *pieces[i + 1 :])) for i in range(len(whole))]
        cut = [_pieces(mirror, rest, view, settings) for mirror, rest in zip(whole, others, strict=True)]
        pieces, remains = [kept for kept, _ in cut], [small for _, rest in cut for small in rest]
    mirrors = list(chain(*pieces))
    # A piece too small for a mirror is still the edge of a wall, and no object that hides anything.
    face, edge = (
        faces(some, view, echoes, settings.wall_margin or 0.0, nobody=NOBODY, root=ROOT) for some in (mirrors, remains)
    )
    face[(face == ROOT) & (edge != ROOT)] = NOBODY
    crossing = np.array([mirror.crossing(view) for mirror in mirrors]).reshape(len(mirrors), len(view.sight))
    cover = Cover.nothing(len(view.sight))
    if settings.opaque:
        hides = echoes.visible & echoes.strong & (face == ROOT)
        nearest = crossing.min(axis=0, initial=np.inf)
        if walls is not None:
            hides &= ~walls & (nearest[echoes.direction] < echoes.range)
        objects = echoes.take(hides)
        if walls is None and not settings.published:
            objects = without_shadow(objects, mirrors, crossing, view)
        cover = Cover.of(objects, view)
        if walls is not None:
            cover = cover._replace(range=np.where(np.isfinite(nearest), cover.range, np.inf))
    shown = crossing.copy()
    for row, mirror in zip(shown, mirrors, strict=True):
        met = np.flatnonzero(np.isfinite(row))
        row[met[~cover.clear(row[met] + view.object_depth(row[met]), met, mirror.strength)]] = np.inf
    # A mirror's parent is the one through which most of it is seen.
    before = [_last_before(index, shown)[1] - ROOT for index in range(len(mirrors))]
    parent = np.array([np.argmax(np.bincount(b)) + ROOT if b.size else NOBODY for b in before], dtype=np.intp)
    seen = np.flatnonzero([b.size for b in before])
    # Numbers of the mirrors that are left; one whose parent is never seen cannot be seen either.
    number = np.full(len(mirrors) + 2, NOBODY, dtype=np.intp)
    number[seen], number[ROOT] = np.arange(seen.size), ROOT
    own = np.where((face >= 0) & (number[face] == NOBODY), ROOT, number[face])
    sight = LinesOfSight(view, crossing[seen], number[parent[seen]], cover)
    return Order([mirrors[index] for index in seen], sight, own)


def _pieces(
    mirror: Mirror, others: list[Mirror], view: View, settings: FoldSettings
) -> tuple[list[Mirror], list[Mirror]]:
    """The pieces of a mirror that is seen by more than one way, and those too small to be one.

    The mirror image of a wall in another one at right angles to it continues the wall itself.
    """
    go_on()  # each takes as long as there are others: hundreds of mirrors take a minute
    directions, before = _last_before(0, np.stack([m.crossing(view) for m in (mirror, *others)]))
    if not directions.size or np.all(before == before[0]):
        return [mirror], []
    return mirror.pieces(view, directions, before, settings.minimum_length or 0.0)


def _last_before(index: int, crossing: Array) -> tuple[Index, Index]:
    """Directions that meet a mirror, and the mirror that each met last before it (ROOT: none)."""
    directions = np.flatnonzero(np.isfinite(crossing[index]))
    ranges = np.where(crossing[:, directions] < crossing[index, directions], crossing[:, directions], -np.inf)
    return directions, np.where(np.isfinite(ranges).any(axis=0), np.argmax(ranges, axis=0), ROOT)
