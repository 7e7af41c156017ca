"""Step 3 of the algorithm: the order of the mirrors, from those in line of sight to those seen through others.

Each line of sight is followed outward from the radar. The parent of a mirror is the mirror that most of its lines of
sight meet last before it; those that an object blocks before the mirror do not count. A row of echoes that is seen
partly by way of one mirror and partly by way of another is cut.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.common.stopping import go_on
from mirrorfold.common.types import ROOT, UNSEEN, Array, Index, Mask
from mirrorfold.detection import Echoes, ImageView, LineMirror, Mirror, View, any_curved
from mirrorfold.detection.echoes import brightest_of, reference_echo
from mirrorfold.detection.mirrors.curved import dimming
from mirrorfold.detection.mirrors.mirror import faces
from mirrorfold.tree.explaining.shadowless import levels_behind
from mirrorfold.tree.lines_of_sight import ITSELF_CELLS, Cover, LinesOfSight

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

BEAM = 0.5
"""Width, in resolution cells, of the beams of which the brightest echoes give the reference level behind a mirror."""

MOST_CUTS = 4
"""Number of passes in which mirrors cut each other at most: two or three mostly settle all pieces."""

PAST_CELLS = 2.0
"""How far past the end of a mirror the image of a wall may go on, in resolution cells: the beam of half of the array is
as wide."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Order(LinesOfSight):
    """Mirrors, and which is seen through which: the lines of sight, and which echoes lie on which mirror.

    Attributes
    ----------
    face : (n,) array of int
        The mirror that each echo lies on, `UNSEEN` for echoes from inside a wall, `ROOT` for all others.
    """

    face: Index

    def images_of_radar(self) -> Mask:
        """Which mirrors are images of the radar's own antennas in another mirror, (mirrors,)."""
        view, found = self.view, np.zeros(len(self.mirrors), dtype=bool)
        for index, mirror in enumerate(self.mirrors):
            place = self.fold(self.parent[index])(mirror.center)
            found[index] = view.on_radar(place[None], ITSELF_CELLS * view.cell_at(mirror.center))[0]
        return found

    def images_in_corners(self) -> Mask:
        """Which mirrors are seen in one leg of a corner, and are images of a known wall by way of both, (mirrors,)."""
        view, parents, found = self.view, self.parent.tolist(), np.zeros(len(self.mirrors), dtype=bool)
        for index, (mirror, leg) in enumerate(zip(self.mirrors, parents, strict=True)):
            if leg >= 0 and isinstance(view, ImageView) and isinstance(mirror, LineMirror):
                before = parents[leg]
                walls = [wall for i, wall in enumerate(self.mirrors) if parents[i] == before and i != leg]
                walls += [self.mirrors[before]] if before >= 0 else []
                images = [2.0 * vertex - mirror.ends for vertex in vertices_of(self.mirrors[leg], view)]
                found[index] = any(is_image(mirror, image, walls, view) for image in images)
        return found

    def shown_by(self, echoes: Echoes) -> Index:
        """Number of the mirror by way of which each echo is seen, (n,); for echoes on a mirror, its parent."""
        through = self.through(echoes)
        return np.where(self.face == ROOT, through, self.parent_of[self.face])

    def flattened(self, echoes: Echoes) -> Mask:
        """Which echoes are seen by way of a concave mirror, (n,): it flattens their waves, as a longer way would."""
        numbers = range(len(self.mirrors))
        concave = [index for index in numbers if any(mirror.curvature < 0.0 for mirror in self.way(index))]
        return np.isin(self.through(echoes), concave)

    def seen(self, echoes: Echoes) -> Echoes:
        """The echoes with their marks `visible` and `strong`, and their `limit`, as they follow from this order."""
        visible = echoes.visible & self.clear(echoes)
        through = self.through(echoes)
        strong, limit = echoes.strong.copy(), echoes.limit.copy()
        beam = np.rint(self.view.in_cells(echoes.position)[:, 1:] / BEAM).astype(np.intp)
        beam -= beam.min(axis=0, initial=0)
        number = np.ravel_multi_index(tuple(beam.T), tuple(beam.max(axis=0, initial=0) + 1))
        # A lossy mirror dims all that is seen through it. Where the objects behind it are dimmer than the reference,
        # the threshold is lowered by the same factor.
        for mirror in range(len(self.mirrors)):
            behind = visible & (self.face == ROOT) & (through == mirror)
            objects = behind & echoes.strong
            if objects.any():
                # How much a curved mirror spreads the wave is known from its shape, and does not count as loss.
                gain = dimming(self.way(mirror), echoes.position)
                level = echoes.amplitude * gain
                reference = reference_echo(brightest_of(number[objects], level[objects]))
                limit[behind] = (min(reference / echoes.reference, 1.0) * echoes.threshold / gain)[behind]
                strong |= behind & (echoes.amplitude >= limit)
        return replace(echoes, visible=visible, strong=strong, limit=limit)


def order_mirrors(
    mirrors: Sequence[Mirror], view: View, echoes: Echoes, settings: FoldSettings, walls: Mask | None = None
) -> Order:
    """The order of mirrors: which is seen through which.

    Parameters
    ----------
    mirrors : sequence of Mirror
    view : View
    echoes : Echoes
    settings : FoldSettings
        Its minimum length is also the least length of the pieces that a mirror is cut into.
    walls : (n,) bool array, optional
        Where the mirrors are given by hand: which echoes are those of walls, whether these are used as mirrors or not.
        They are no objects. A given mirror is in view whatever stands before it. So objects hide only what is seen
        behind the same mirrors as they are, and all that is not folded stays.
    """
    found = _ordered(mirrors, view, echoes, settings, walls)
    if settings.generations is not None:
        before = np.arange(len(found.mirrors))
        for _ in range(min(settings.generations, len(found.mirrors))):
            before = np.where(before >= 0, found.parent[before], before)
        if (before >= 0).any():
            kept = [mirror for mirror, deeper in zip(found.mirrors, before, strict=True) if deeper < 0]
            found = _ordered(kept, view, echoes, settings, walls)
    return found


def without_bent(order: Order, ordered: Callable[[Sequence[Mirror]], Order]) -> Order:
    """The order without the mirrors that are seen by way of a curved one; `ordered` orders the others anew.

    A curved mirror shows no straight line as straight. So a straight row of echoes behind it is no image of a wall.
    """
    bent = [any_curved(order.way(index)[:-1]) for index in range(len(order.mirrors))]
    kept = [mirror for mirror, is_bent in zip(order.mirrors, bent, strict=True) if not is_bent]
    return ordered(kept) if any(bent) else order


def _ordered(
    mirrors: Sequence[Mirror], view: View, echoes: Echoes, settings: FoldSettings, walls: Mask | None
) -> Order:
    """`order_mirrors`, with any number of mirrors in a chain."""
    met_at = cache(lambda mirror: mirror.crossing(view))  # each pair of mirrors asks for it
    mirrors, remains = _cut(mirrors, view, settings.minimum_length or 0.0, met_at)
    # A piece that is too small for a mirror is still part of a wall. It is no object, and hides nothing.
    margin = settings.wall_margin or 0.0
    face, edge = (faces(some, view, echoes, margin) for some in (mirrors, remains))
    face[(face == ROOT) & (edge != ROOT)] = UNSEEN
    crossing = np.array([met_at(mirror) for mirror in mirrors]).reshape(len(mirrors), len(view.sight))
    objects = echoes.visible & echoes.strong & (face == ROOT) & settings.opaque
    if walls is None:
        hiding = echoes.take(objects)
        cover = Cover.of(hiding, view, None if settings.published else levels_behind(hiding, mirrors, crossing, view))
    else:
        cover = _cover_behind(echoes, objects & ~walls, crossing, view)
    parent = _parents(mirrors, crossing, cover, view)
    if isinstance(view, ImageView) and not settings.published:
        parent = _with_images(parent, mirrors, crossing, view)
    seen = np.flatnonzero(parent != UNSEEN)
    # New numbers of the mirrors that are seen. A parent that is not seen becomes `UNSEEN`.
    number = np.full(len(mirrors) + 2, UNSEEN, dtype=np.intp)
    number[seen], number[ROOT] = np.arange(seen.size), ROOT
    own = np.where((face >= 0) & (number[face] == UNSEEN), ROOT, number[face])
    kept = [mirrors[index] for index in seen]
    return Order(view, kept, crossing[seen], number[parent[seen]], cover, face=own)


def _cut(
    mirrors: Sequence[Mirror], view: View, smallest: float, met_at: Callable[[Mirror], Array]
) -> tuple[list[Mirror], list[Mirror]]:
    """The mirrors, cut where their parent changes; and the pieces that are too small for mirrors.

    One row of echoes may be seen by two ways: the image of a wall in another wall at right angles continues the wall.
    `met_at` gives the `crossing` of a mirror.
    """
    pieces, remains = [[mirror] for mirror in mirrors], list[Mirror]()
    # A piece of a mirror that is itself cut may be the parent: each pass uses the pieces of the one before.
    for _ in range(MOST_CUTS):
        cut = list[tuple[list[Mirror], list[Mirror]]]()
        for i, mirror in enumerate(mirrors):
            go_on()  # the time grows with the number of others: hundreds of mirrors take a minute
            others = chain(*pieces[:i], *pieces[i + 1 :])
            directions, before = _last_before(0, np.stack([met_at(one) for one in (mirror, *others)]))
            whole = not directions.size or np.all(before == before[0])
            cut.append(([mirror], []) if whole else mirror.pieces(view, directions, before, smallest))
        last = pieces
        pieces, remains = [kept for kept, _ in cut], [small for _, rest in cut for small in rest]
        if [[piece.size for piece in own] for own in pieces] == [[piece.size for piece in own] for own in last]:
            break
    return list(chain(*pieces)), remains


def _cover_behind(echoes: Echoes, objects: Mask, crossing: Array, view: View) -> Cover:
    """What those of the echoes that are `objects`, (n,), hide behind the first mirror of each line of sight."""
    nearest = crossing.min(axis=0, initial=np.inf)
    cover = Cover.of(echoes.take(objects & (nearest[echoes.direction] < echoes.range)), view)
    return cover._replace(range=np.where(np.isfinite(nearest), cover.range, np.inf))


def _parents(mirrors: Sequence[Mirror], crossing: Array, cover: Cover, view: View) -> Index:
    """Number of the parent of each mirror, (mirrors,), or `ROOT`; `UNSEEN` for a mirror that objects hide.

    It is the mirror that most of the visible lines of sight meet last before it. `crossing` (mirrors, directions) [m]
    is the range at which lines of sight meet the mirrors.
    """
    shown = crossing.copy()
    for row, mirror in zip(shown, mirrors, strict=True):
        met = np.flatnonzero(np.isfinite(row))
        row[met[~cover.clear(row[met] + view.object_depth(row[met]), met, mirror.strength)]] = np.inf
    before = [_last_before(index, shown)[1] - ROOT for index in range(len(mirrors))]
    return np.array([np.argmax(np.bincount(b)) + ROOT if b.size else UNSEEN for b in before], dtype=np.intp)


def _with_images(parent: Index, mirrors: Sequence[Mirror], crossing: Array, view: ImageView) -> Index:
    """The parents of mirrors, (mirrors,), where what stands at the end of a mirror may be an image in it.

    What a mirror shows goes on a little past its end, where lines of sight miss the mirror: there a part of the array
    still sees it, and the beam of a part is wider. So a row past an end has that mirror as its parent if it is the
    image of a known wall. `crossing` (mirrors, directions) [m] is the range at which lines of sight meet the mirrors.
    """
    parent, met = parent.copy(), np.isfinite(crossing)
    first, last = (np.where(met, view.u, empty).T for empty in (np.inf, -np.inf))
    first, last, nearest = first.min(axis=0), last.max(axis=0), crossing.min(axis=1)
    for index in np.flatnonzero(parent != UNSEEN).tolist():
        mirror, beside = mirrors[index], (parent == parent[index]) & (np.arange(len(mirrors)) != index)
        past = np.maximum(last[index] - last, first - first[index])
        near = beside & (nearest < nearest[index]) & (past <= PAST_CELLS * view.u_cell)
        for other in np.flatnonzero(near).tolist():
            shows, walls = mirrors[other], [mirrors[wall] for wall in np.flatnonzero(beside).tolist() if wall != other]
            straight = isinstance(mirror, LineMirror) and isinstance(shows, LineMirror)
            if straight and is_image(mirror, shows.reflection(mirror.ends), walls, view):
                parent[index] = other
                break
    return parent


def is_image(mirror: Mirror, places: Array, walls: Sequence[Mirror], view: ImageView) -> bool:
    """Whether a mirror whose ends stand at `places` (2, 2) [m] lies on one of the walls, to a resolution cell."""
    along, across = view.extent(mirror.ends, np.stack([mirror.tangents[0], mirror.normal], axis=1)).T
    return any(wall.holds(places, across, along.max()).all() for wall in walls if isinstance(wall, LineMirror))


def vertices_of(leg: Mirror, view: ImageView) -> Array:
    """Those of the known `corners` of the view of which a straight mirror is a leg, (n, 2) [m]."""
    if not isinstance(leg, LineMirror):
        return np.zeros((0, 2))
    near = view.cell_at(leg.center)
    away = np.linalg.norm(view.corners[:, None] - leg.ends, axis=-1).min(axis=1, initial=np.inf)
    return view.corners[(away <= near) | leg.holds(view.corners, near, 0.0)]


def _last_before(index: int, crossing: Array) -> tuple[Index, Index]:
    """Directions that meet mirror `index`, and the mirror that each of them meets last before it; ROOT if none."""
    directions = np.flatnonzero(np.isfinite(crossing[index]))
    ranges = np.where(crossing[:, directions] < crossing[index, directions], crossing[:, directions], -np.inf)
    return directions, np.where(np.isfinite(ranges).any(axis=0), np.argmax(ranges, axis=0), ROOT)
