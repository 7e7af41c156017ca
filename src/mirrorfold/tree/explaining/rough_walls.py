"""Echoes that a rough wall scatters towards another wall or a bright object, and back.

A wall that is not quite smooth scatters a little of the wave from each of its places in all directions, also along the
normal of another wall before it. The other wall sends the wave straight back, and the same place scatters it to the
radar. If that place is at range r0 and the distance d away from the other wall, an echo stands in its direction at
r0 + d. That is nearer than the mirror image of the other wall, which the same line of sight meets at a slant: it looks
like an object hidden between the two. A bright object at the distance d, such as a corner, makes such echoes, too:
faint ones behind all places of the wall, farther away than the object's mirror image, and bright ones behind those
places that a leg of the corner looks at squarely.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import ROOT, UNSEEN, Array, Index, Mask
from mirrorfold.detection import Echoes, Fold, ImageView, any_curved
from mirrorfold.tree.explaining.corners import Corners
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS, in_image, square_distances, true_ends
from mirrorfold.tree.ordering import Order

SCATTERED = "was scattered by a rough wall on the way to something else and back"

BRIGHT = 0.9
"""Quantile of the amplitudes of a wall's face that bounds such echoes: what the wall scatters twice is weaker than what
it scatters once. The quantile leaves out a few echoes of the face that may be glints."""

BRIGHTEST_SPECKLE_DB, FADED_DB = 10.0, 30.0
"""Largest level of such an echo over the median of the image where the other places of the wall would repeat the same
object: a rough wall scatters from all of its places alike. `BRIGHTEST_SPECKLE_DB` is for echoes beside the object's
mirror image and hardly behind it: one speckle in a thousand exceeds the median by 10 dB. `FADED_DB` is for all others:
where speckle fades, the median is up to 20 dB lower. A corner has no limit: each of its legs is a mirror for the places
that it faces squarely."""

WEAKER_DB, FROM_IMAGE_CELLS = -20.0, 2.0
"""Largest level of such an echo over that of the object that it repeats; and its least distance from the object's
mirror image, which has echoes of its own around it: in range cells behind the image, unless the echo lies in a row, or
in resolution cells beside it."""


def scattered(order: Order, echoes: Echoes, corners: Corners | None = None) -> Mask:
    """Which echoes behind mirrors these may have scattered towards other walls or objects and back, (n,).

    The `order` of the mirrors is that of the same echoes; those in a row that was taken for a mirror may be among them.
    In a volume there are none. `corners` tells which places (n, 2) [m] of the image show right-angled corners, (n,).
    """
    found, view = np.zeros(len(echoes), dtype=bool), order.view
    if not isinstance(view, ImageView):
        return found
    shown_by = order.shown_by(echoes)
    flat = {index: true_ends(order.way(index)) for index, wall in enumerate(order.mirrors) if not wall.curved}
    objects = _objects(order, echoes)
    for rough, parent in enumerate(order.parent):
        face = echoes.amplitude[echoes.visible & (order.face == rough)]
        if not face.size or any_curved(order.way(rough)):
            continue
        begin = order.crossing[rough, echoes.direction]
        own = echoes.visible & (shown_by == rough) & np.isfinite(begin)
        own = np.flatnonzero(own & (echoes.amplitude <= np.quantile(face, BRIGHT)))
        surface = _Surface(view, order.crossing[rough], order.fold(int(parent)))
        seen = echoes.take(own)
        for other, wall in flat.items():
            if other != rough:
                sent_back = _square_to(wall, surface, seen)
                found[own[sent_back & (order.face[own] != other)]] = True
        found[own[_of_objects(objects, order, rough, surface, seen, order.face[own] == ROOT, corners)]] = True
    return found


class _Surface:
    """A rough wall as the radar sees it.

    Lines of sight meet it at ranges `crossing` (nu,) [m], infinite where they miss it, in its `directions` (m,). The
    map `fold` takes these places from the image to their true `places` (m, 2) [m].
    """

    def __init__(self, view: ImageView, crossing: Array, fold: Fold) -> None:
        self.view, self.crossing = view, crossing
        self.directions = np.flatnonzero(np.isfinite(crossing))
        self.places = fold(view.points(crossing[self.directions], self.directions))

    def of(self, echoes: Echoes) -> Index:
        """Index into `directions` and `places` for the direction of each echo, (n,)."""
        return np.searchsorted(self.directions, echoes.direction)

    def depth_behind(self, echoes: Echoes) -> Array:
        """Distance of each echo behind the wall along its line of sight, (n,) [m]."""
        return echoes.range - self.crossing[echoes.direction]

    def median_amplitude(self, depth: Array, counts: Mask) -> Array:
        """Median amplitude of the image at distances behind places of the wall, (m,); infinite without places.

        The `depth` (directions, m) [m] is along the line of sight of each place; `counts` (directions, m or 1) marks
        the places that count.
        """
        view, half = self.view, round(EXPECTED_CELLS * self.view.range_cell / self.view.dr)
        row = np.rint((self.crossing[self.directions, None] + depth - view.range[0]) / view.dr).astype(np.intp)
        rows = row[..., None] + np.arange(-half, half + 1)
        inside = (rows >= 0) & (rows < view.range.size)
        shown = view.amplitude[np.where(inside, rows, 0), self.directions[:, None, None]]
        shown = np.where(counts, np.where(inside, shown, 0.0).max(axis=-1, initial=0.0), np.nan)
        return np.array([np.nanmedian(one) if np.isfinite(one).any() else np.inf for one in shown.T])


def _square_to(wall: Array, rough: _Surface, echoes: Echoes) -> Mask:
    """Which echoes are as far behind a place of a rough wall as this place is from another `wall`, (n,).

    That wall is given by its ends, (2, 2) [m].
    """
    distance, beyond = square_distances(rough.places, wall)
    at, off = rough.of(echoes), EXPECTED_CELLS * rough.view.range_cell
    before = beyond[at] <= rough.view.cell(echoes.range)
    return before & (np.abs(distance[at] - rough.depth_behind(echoes)) <= off)


def _of_objects(
    objects: tuple[Echoes, Array], order: Order, number: int, rough: _Surface, echoes: Echoes, single: Mask,
    corners: Corners | None,
) -> Mask:  # fmt: skip
    """Which echoes the rough wall of that `number` may make of bright objects, (n,).

    The objects are the result of `_objects`. Echoes that are `single` (n,) lie in no row.
    """
    view, (bright, places) = order.view, objects
    # The path over the wall is shortest where it reflects the object. By all other places the object appears farther.
    image = in_image(order.way(number), places)
    nearest, apart = np.linalg.norm(image - view.radar, axis=1), FROM_IMAGE_CELLS * view.range_cell
    distance = np.linalg.norm(rough.places[:, None] - places, axis=2)
    found = np.abs(distance[rough.of(echoes)] - rough.depth_behind(echoes)[:, None]) <= EXPECTED_CELLS * view.range_cell
    beside = np.abs(view.in_cells(echoes.position)[:, None, 1] - view.in_cells(image)[:, 1]) >= FROM_IMAGE_CELLS
    later = echoes.range[:, None] >= nearest + np.where(single, apart, 0.0)[:, None]
    found &= later | (beside & (echoes.range[:, None] >= nearest))
    found &= echoes.amplitude[:, None] <= ratio_of(WEAKER_DB) * bright.amplitude
    some = np.flatnonzero(found.any(axis=0))
    far = rough.crossing[rough.directions, None] + distance[:, some] >= nearest[some] + apart
    usual = rough.median_amplitude(distance[:, some], far)
    most = ratio_of(np.where(later[:, some], FADED_DB, BRIGHTEST_SPECKLE_DB)) * usual
    faint = echoes.amplitude[:, None] <= most
    legs = np.zeros(some.size, dtype=bool)
    if corners is not None:
        asked = (found[:, some] & ~faint).any(axis=0)
        legs[asked] = corners(bright.position[some[asked]])
    return (found[:, some] & (faint | legs)).any(axis=1)


def _objects(order: Order, echoes: Echoes) -> tuple[Echoes, Array]:
    """The brightest echo of objects in each cell, direct and by way of mirrors; and their true places (m, 2) [m]."""
    view = order.view
    objects = echoes.take(echoes.visible & echoes.strong & (order.face == ROOT))
    objects = objects.take(view.brightest(objects.position, objects.amplitude))
    through = order.through(objects)
    objects, through = objects.take(through != UNSEEN), through[through != UNSEEN]
    places = np.empty_like(objects.position)
    for index in np.unique(through):
        places[through == index] = order.fold(int(index))(objects.position[through == index])
    return objects, places
