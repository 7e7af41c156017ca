"""Echoes that a rough wall makes of walls and bright objects before it, where no mirror image of them is.

A wall that is not quite smooth scatters a little of the wave from each of its places, also square towards another wall
before it. The other wall sends it straight back, and the same place scatters it once more. By a place of the rough wall
at range r0, which is d away from the other wall, an echo stands at r0 + d: nearer than the mirror image of the other
wall, which the same line of sight meets askew, and like an object hidden between the two. A bright object at the
distance d, such as a corner, makes such echoes, too: faint ones all along the wall, and farther than its image.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Fold, fold_of
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS, square_distances, true_ends
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT
from mirrorfold.tree.ordering import Order

SCATTERED = "was scattered by a rough wall on the way to something else and back"

BRIGHT = 0.9
"""What is scattered twice is weaker than what the same wall scatters once: than this quantile of the echoes of its
face, of which a few may be glints."""

OUTSHINES_DB, FADED_DB = 10.0, 30.0
"""A rough wall scatters from all of its places: an echo that is so much stronger than the median of what the image
shows behind them, where they would repeat the same object, is no such echo. Speckle outshines its mean by up to 10 dB,
and faded its mean is up to 20 dB lower. The first number is for echoes beside the object's image, hardly behind it."""

WEAKER_DB, APART_CELLS = -20.0, 2.0
"""What a wall scatters twice is so much weaker than the object that it repeats; and, unless it lies in a row, so many
range cells behind the mirror image of that object, or resolution cells beside it, where it has neighbours."""


def scattered(order: Order, echoes: Echoes) -> Mask:
    """Which echoes behind mirrors may be what these scatter towards other walls or objects and back, (n,).

    Echoes that would pass for a wall of their own are among them. In a volume, none are found.

    Parameters
    ----------
    order : Order
        Of the mirrors, with the `face` of the same echoes.
    echoes : Echoes
    """
    found, sight, view = np.zeros(len(echoes), dtype=bool), order.sight, order.sight.view
    if not isinstance(view, ImageView):
        return found
    shown_by = order.shown_by(echoes)
    flat = {index: true_ends(order.way(index)) for index, wall in enumerate(order.mirrors) if not wall.curved}
    objects = _objects(order, echoes)
    for rough, parent in enumerate(sight.parent):
        face = echoes.amplitude[echoes.visible & (order.face == rough)]
        if not face.size or any(mirror.curved for mirror in order.way(rough)):
            continue
        begin = sight.crossing[rough, echoes.direction]
        own = echoes.visible & (shown_by == rough) & np.isfinite(begin)
        own = np.flatnonzero(own & (echoes.amplitude <= np.quantile(face, BRIGHT)))
        surface = _Surface(view, sight.crossing[rough], fold_of(order.way(int(parent)), view.dimensions))
        seen = echoes.take(own)
        for other, wall in flat.items():
            if other != rough:
                sent_back = _square_to(wall, surface, seen)
                found[own[sent_back & (order.face[own] != other)]] = True
        found[own[_of_objects(*objects, order, rough, surface, seen, order.face[own] == ROOT)]] = True
    return found


class _Surface:
    """A rough wall as the radar sees it.

    Parameters
    ----------
    view : ImageView
    crossing : (nu,) array [m]
        Range at which each direction meets it, infinite where none does.
    fold : callable
        Maps what is seen on it to its true place.
    """

    def __init__(self, view: ImageView, crossing: Array, fold: Fold) -> None:
        self.view, self.crossing = view, crossing
        self.directions = np.flatnonzero(np.isfinite(crossing))
        self.places = fold(view.points(crossing[self.directions], self.directions))

    def of(self, echoes: Echoes) -> Index:
        """Which of the `directions`, each with its place, is that of each echo, (n,)."""
        return np.searchsorted(self.directions, echoes.direction)

    def way(self, echoes: Echoes) -> Array:
        """From the wall to where each echo is seen, (n,) [m]."""
        return np.asarray(echoes.range - self.crossing[echoes.direction])

    def usual(self, way: Array, counts: Mask) -> Array:
        """Median amplitude of what the image shows so far behind places of the wall, (m,); infinite for no places.

        Parameters
        ----------
        way : (directions, m) array [m]
        counts : (directions, m) or (directions, 1) bool array
            The places that count.
        """
        view, half = self.view, round(EXPECTED_CELLS * self.view.range_cell / self.view.dr)
        row = np.rint((self.crossing[self.directions, None] + way - view.range[0]) / view.dr).astype(np.intp)
        rows = row[..., None] + np.arange(-half, half + 1)
        inside = (rows >= 0) & (rows < view.range.size)
        shown = view.amplitude[np.where(inside, rows, 0), self.directions[:, None, None]]
        shown = np.where(counts, np.where(inside, shown, 0.0).max(axis=-1, initial=0.0), np.nan)
        return np.array([np.nanmedian(one) if np.isfinite(one).any() else np.inf for one in shown.T])


def _square_to(wall: Array, rough: _Surface, echoes: Echoes) -> Mask:
    """Which echoes have come as far behind places of a rough wall as it is from a wall before it, (n,).

    Parameters
    ----------
    wall : (2, 2) array [m]
        Its ends.
    rough : _Surface
    echoes : Echoes
    """
    distance, beyond = square_distances(rough.places, wall)
    at, off = rough.of(echoes), EXPECTED_CELLS * rough.view.range_cell
    before = beyond[at] <= rough.view.cell(echoes.range)
    return np.asarray(before & (np.abs(distance[at] - rough.way(echoes)) <= off))


def _of_objects(
    objects: Array, level: Array, order: Order, number: int, rough: _Surface, echoes: Echoes, single: Mask
) -> Mask:
    """Which echoes the rough wall of that number may make of bright objects, (n,).

    These stand at (m, 2) [m] and have amplitudes `level` (m,). Echoes that are `single` (n,) lie in no row.
    """
    view = order.sight.view
    # The way over the wall is shortest where it reflects the object; by all other places the object is seen farther.
    image = _image(order, number, objects)
    nearest, apart = np.linalg.norm(image - view.radar, axis=1), APART_CELLS * view.range_cell
    distance = np.linalg.norm(rough.places[:, None] - objects, axis=2)
    found = np.abs(distance[rough.of(echoes)] - rough.way(echoes)[:, None]) <= EXPECTED_CELLS * view.range_cell
    beside = np.abs(view.in_cells(echoes.position)[:, None, 1] - view.in_cells(image)[:, 1]) >= APART_CELLS
    later = echoes.range[:, None] >= nearest + np.where(single, apart, 0.0)[:, None]
    found &= later | (beside & (echoes.range[:, None] >= nearest))
    found &= echoes.amplitude[:, None] <= 10.0 ** (WEAKER_DB / 20.0) * level
    some = np.flatnonzero(found.any(axis=0))
    far = rough.crossing[rough.directions, None] + distance[:, some] >= nearest[some] + apart
    most = 10.0 ** (np.where(later[:, some], FADED_DB, OUTSHINES_DB) / 20.0) * rough.usual(distance[:, some], far)
    return np.asarray((found[:, some] & (echoes.amplitude[:, None] <= most)).any(axis=1))


def _image(order: Order, mirror: int, places: Array) -> Array:
    """Where the image shows places (n, 2) [m] by way of a flat mirror, (n, 2)."""
    for step in order.way(mirror):
        places = step.reflection.inverse(places)
    return places


def _objects(order: Order, echoes: Echoes) -> tuple[Array, Array]:
    """Places (n, 2) [m] where objects stand, one in each resolution cell of the image, and their amplitudes (n,)."""
    view = order.sight.view
    objects = echoes.take(echoes.visible & echoes.strong & (order.face == ROOT))
    objects = objects.take(view.brightest(objects.position, objects.amplitude))
    through = order.sight.seen_through(objects.range, objects.direction)
    places, levels = [np.empty((0, view.dimensions))], [np.empty(0)]
    for index in np.unique(through[through != NOBODY]):
        seen = objects.take(through == index)
        places.append(fold_of(order.way(int(index)), view.dimensions)(seen.position))
        levels.append(seen.amplitude)
    return np.concatenate(places), np.concatenate(levels)
