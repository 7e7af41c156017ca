"""Steps 2 to 4 in turn, until they agree.

Mirrors are found among visible echoes only, but which echoes are visible follows from the mirrors. So mirrors are found
and ordered again and again, each time with the echoes that the last order left visible. Then echoes at whose place no
object stands are taken out, and the steps are repeated without them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.stopping import go_on
from mirrorfold.common.types import UNSEEN, Array, Index, Mask, Names
from mirrorfold.detection import Echoes, ImageView, Mirror, View
from mirrorfold.detection.finding import find_mirrors
from mirrorfold.detection.mirrors.curved import on_rows
from mirrorfold.detection.search.coherent import doubtful_rows
from mirrorfold.tree.assignment import AT_EDGE, ITSELF, Found, assign_echoes, at_edges, radar_itself
from mirrorfold.tree.completion import completed
from mirrorfold.tree.explaining.copies import COPY, copies
from mirrorfold.tree.explaining.corners import row_crossings
from mirrorfold.tree.explaining.directions import NEAREST_LENGTHS
from mirrorfold.tree.explaining.half_shadows import Overhangs
from mirrorfold.tree.explaining.lobes import LOBE
from mirrorfold.tree.explaining.misplaced import LATE, MIXED
from mirrorfold.tree.explaining.rough_walls import SCATTERED, scattered
from mirrorfold.tree.explaining.short_cuts import SHORT_CUT, short_cuts
from mirrorfold.tree.measured import Measured
from mirrorfold.tree.ordering import Order, order_mirrors, without_bent

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

MAXIMUM_ROUNDS = 8
"""At most so many rounds: mirrors and visible echoes usually agree after two or three."""


SCATTERED_SHARE = 0.5
"""Least share of a row's echoes that rough walls may have scattered where the row is no mirror. With less, the mirror
is true, and only crosses the places where such echoes would be."""


def find_tree(
    view: View,
    echoes: Echoes,
    settings: FoldSettings,
    *,
    known: Array | None = None,
    walls: Mask | None = None,
    measured: Measured | None = None,
    besides: Sequence[Mirror] = (),
    earlier: Found | None = None,
) -> Found:
    """Steps 2 to 4: the mirrors, their order, and the echoes that are seen through each.

    Parameters
    ----------
    view : View
    echoes : Echoes
        As `find_echoes` returns them.
    settings : FoldSettings
    known : array, optional
        Mirrors that the user gives; then none are searched for. See `find_mirrors`.
    walls : (n,) bool array, optional
        With given mirrors: which echoes are those of walls.
    measured : Measured, optional
        Tests by the sweep. When an echo fails a test and is left out, the echoes behind it become visible and are
        tested in their turn.
    besides : sequence of Mirror
        Curved and short mirrors, used besides those that are found; see `mirrorfold.tree.evidence`.
    earlier : Found, optional
        A result for the same image with other mirrors. The reasons `BY_SWEEP` against its echoes hold here, too.
    """
    measured, searched = measured or Measured(), known is None and not settings.published
    if known is not None and not len(known):  # where an empty list of mirrors is given, the image stays as it is
        settings = replace(settings, copies=False)
    find = partial(found_and_ordered, settings=settings, known=known, besides=besides)
    reasons, overhangs = _Reasons(echoes), Overhangs()
    if earlier is not None:
        reasons.recall(earlier, besides)
        view = _informed(view, reasons)
    while True:
        go_on()
        echoes = reasons.echoes
        order, seen = agreed(partial(find, view=view, walls=walls, overhangs=overhangs), echoes, settings)
        if measured.overhangs is not None and not (new := measured.overhangs(order, seen)).same(overhangs):
            overhangs = new
            order, seen = agreed(partial(find, view=view, walls=walls, overhangs=overhangs), echoes, settings)
        if searched and isinstance(view, ImageView) and len(rows := doubtful_rows(order.mirrors, view)):
            view = view.knowing(doubtful=np.concatenate([view.doubtful, rows]))
            continue
        clear = order.clear(echoes)
        rescattered = _note_causes(reasons, order, seen, clear, settings, measured)
        blurs, corners = False, np.zeros((0, 2))
        if searched:
            share = measured.confocal_share
            blurs = share is not None and reasons.blur(share, clear & (order.face >= 0))
            corners = _new_corners(order.mirrors, view, measured)
        if reasons.stays.all() and not blurs and not len(corners):
            break
        walls = None if walls is None else walls[reasons.stays]
        reasons.leave_out()
        if searched:
            view = _informed(view, reasons, corners)
    if searched and settings.opaque:
        seen = shown_at_last(order, echoes, seen, settings)
    # In the rounds, echoes that rough walls scattered hide what is behind them. Only now are they taken out.
    reasons.note(rescattered, SCATTERED)
    order = replace(order, face=np.where(rescattered, UNSEEN, order.face))
    tree, sight = assign_echoes(order, seen, opaque=settings.opaque)
    if settings.opaque:
        reasons.note(radar_itself(sight, seen), ITSELF)
        reasons.note(at_edges(order, seen), AT_EDGE)
    return Found(seen, tree, sight, *reasons.explained())


def _note_causes(
    reasons: _Reasons, order: Order, seen: Echoes, clear: Mask, settings: FoldSettings, measured: Measured
) -> Mask:
    """Test all echoes in `clear` sight, (n,), and note the reasons why no object stands at the place of some.

    Returns which echoes rough walls may have scattered, (n,). They hide what is behind them, and stay until all rounds
    are done. But if most echoes of a mirror's row are such, these are noted at once: there is no mirror.
    """
    rescattered = np.zeros_like(clear)
    if settings.copies:
        reasons.note(clear & copies(order, seen), COPY)
    if settings.rough_walls:
        rescattered = clear & scattered(order, seen, measured.corners)
        reasons.note(rescattered & _of_rows(order.face, rescattered), SCATTERED)
        reasons.note(clear & short_cuts(order, seen), SHORT_CUT)
    if measured.explain is not None:
        reasons.test(measured.explain, clear, order.flattened(seen))
    return rescattered


def _of_rows(face: Index, marked: Mask) -> Mask:
    """Which echoes lie on mirrors, numbered by `face` (n,), of whose rows `SCATTERED_SHARE` is `marked`, (n,)."""
    rows = [row for row in np.unique(face[face >= 0]) if marked[face == row].mean() >= SCATTERED_SHARE]
    return np.isin(face, rows)


def _new_corners(mirrors: Sequence[Mirror], view: View, measured: Measured) -> Array:
    """Vertices of right-angled corners that are not among the `corners` of the view yet, (c, 2) [m].

    The sweep is asked at all places of the image where a corner may be; without the sweep there are none.
    """
    if measured.corners is None or not isinstance(view, ImageView):
        return np.zeros((0, 2))
    asked = row_crossings(mirrors)
    asked = asked[~view.near_corner(asked)]
    return asked[measured.corners(asked)]


def _informed(view: View, reasons: _Reasons, corners: Sequence[Array] | Array = ()) -> View:
    """The view of an image with its misplaced echoes so far, and with further `corners` (c, 2) [m].

    The view of a volume knows neither, and is returned as it is.
    """
    if not isinstance(view, ImageView):
        return view
    misplaced = reasons.misplaced(NEAREST_LENGTHS * view.glint)
    return view.knowing(misplaced=misplaced, corners=np.concatenate([view.corners, np.reshape(corners, (-1, 2))]))


BY_SWEEP = (LOBE, LATE, MIXED)
"""Reasons that follow from the sweep alone: they hold whatever mirrors are found."""

OWN_SHARE = 0.5
"""Least share of an echo's energy that came back the way it went: with less, most of it is from mixed paths."""


class _Reasons:
    """The `echoes` that are left so far, and the reason why no object stands at the place of each, if there is one."""

    def __init__(self, echoes: Echoes) -> None:
        self._every = self.echoes = echoes
        self._index, self._tested = np.arange(len(echoes)), np.zeros(len(echoes), dtype=bool)
        self._reason = np.full(len(echoes), "", dtype=object)
        self._blurs = np.zeros(len(echoes), dtype=bool)

    @property
    def stays(self) -> Mask:
        """Which of the `echoes` have no reason against them, (n,)."""
        return self._reason[self._index] == ""

    def note(self, which: Mask, why: str | Names) -> None:
        """Note the reason against some of the `echoes`, marked by `which` (n,)."""
        self._reason[self._index[which]] = why

    def test(self, explain: Callable[[Echoes], Names], clear: Mask, flattened: Mask) -> None:
        """Test each of the `echoes` in `clear` sight, (n,), once, and note the reasons that `explain` returns.

        Concave mirrors flatten the waves of some echoes, `flattened` (n,), as a long way does: these are never late.
        """
        new = ~self._tested & clear & self.stays
        if new.any():
            why = explain(self.echoes.take(new))
            self.note(new, np.where((why == LATE) & flattened[new], "", why))
        self._tested |= new

    def recall(self, earlier: Found, besides: Sequence[Mirror]) -> None:
        """Leave out the echoes that an earlier result has left out for a reason `BY_SWEEP`.

        Where concave mirrors are used `besides`, late echoes are tested again: see `Order.flattened`.
        """
        still = [why for why in BY_SWEEP if why != LATE or all(mirror.curvature >= 0.0 for mirror in besides)]
        holds = np.isin(earlier.explanation, still)
        if holds.any():
            away, nearest = cKDTree(earlier.explained.position[holds]).query(self.echoes.position)
            self.note(away == 0.0, earlier.explanation[holds][nearest[away == 0.0]])
            self.leave_out()

    def leave_out(self) -> None:
        """Take out of `echoes` those with a reason against them."""
        stays = self.stays
        self._index, self._tested, self.echoes = self._index[stays], self._tested[stays], self.echoes.take(stays)

    def blur(self, share: Callable[[Array, Array], Array], which: Mask) -> bool:
        """Find echoes on walls, `which` (n,), that mostly came back by another way than they went.

        Such echoes blur a wall: their places say little of where it is. `share` measures the energy that came back the
        way it went, see `Measured`. Returns whether new ones are found.
        """
        asked = self._index[which & self.stays & ~self._blurs[self._index]]
        blurs = asked[share(self._every.position[asked], self._every.amplitude[asked]) < OWN_SHARE]
        self._blurs[blurs] = True
        return bool(blurs.size)

    def misplaced(self, nearest: float) -> Array:
        """Places in the image of echoes that came back by another way than they went, (m, d) [m].

        Echoes nearer than `nearest` [m] are not among them, for there the test by directions is not reliable.
        """
        return self._every.position[(self._blurs | (self._reason == MIXED)) & (self._every.range >= nearest)]

    def explained(self) -> tuple[Echoes, Names]:
        """All echoes with a reason against them, and the reasons."""
        explained = self._reason != ""
        return self._every.take(explained), self._reason[explained].astype(str)


def agreed(ordered: Callable[[Echoes], Order], echoes: Echoes, settings: FoldSettings) -> tuple[Order, Echoes]:
    """Order mirrors with the echoes that the last order left visible and strong, until these no longer change.

    A mirror that was found in multiple scattering vanishes when its echoes turn out to be hidden by objects.
    """
    for _ in range(MAXIMUM_ROUNDS):
        order = ordered(echoes)
        seen = order.seen(echoes) if settings.opaque else echoes
        if np.array_equal(seen.visible, echoes.visible) and np.array_equal(seen.strong, echoes.strong):
            break
        echoes = seen
    return order, seen


def found_and_ordered(
    echoes: Echoes,
    *,
    view: View,
    settings: FoldSettings,
    known: Array | None = None,
    walls: Mask | None = None,
    besides: Sequence[Mirror] = (),
    overhangs: Overhangs | None = None,
) -> Order:
    """Steps 2 and 3, each once; for the arguments see `find_tree`."""
    overhangs = overhangs or Overhangs()
    ordered = partial(order_mirrors, view=view, echoes=echoes, settings=settings, walls=walls)
    rows = echoes.take(~on_rows(besides, view, echoes))
    shortest, tested = settings.minimum_length, not settings.published
    mirrors = find_mirrors(view, rows, minimum_length=shortest, tested=tested, known=known)
    mirrors, rest = overhangs.on(mirrors, view), list(besides)
    order = ordered([*mirrors, *rest])
    if known is not None or not settings.opaque:
        return order
    # Images of the radar's own antennas are no mirrors of the scene, nor are images of a wall by way of both legs of a
    # corner.
    if (images := order.images_of_radar() | order.images_in_corners()).any():
        # The order's mirrors are those of both lists, some of them cut.
        mirrors, rest = [mirror for mirror, image in zip(order.mirrors, images, strict=True) if not image], []
        order = ordered(mirrors)
    if settings.published:
        return order
    if isinstance(view, ImageView):
        more = overhangs.on(completed(mirrors, order, view, echoes, settings.minimum_length or 0.0), view)
        if len(more) > len(mirrors) or any(one is not other for one, other in zip(more, mirrors, strict=True)):
            order = ordered([*more, *rest])
    return without_bent(order, ordered)


def shown_at_last(order: Order, echoes: Echoes, seen: Echoes, settings: FoldSettings) -> Echoes:
    """The echoes `seen` after the last round, and those that were hidden in an earlier round but are not any more.

    In the first rounds, a part of a wall that is not found yet passes for an object and hides what the wall shows, and
    hidden echoes stay hidden. So the mirrors of the last order are ordered once more among all `echoes`, as if nothing
    had been hidden: what is visible then, is visible. Echoes that any round found strong count as objects.
    """
    echoes = replace(echoes, strong=echoes.strong | seen.strong)
    anew = order_mirrors(order.mirrors, order.view, echoes, settings).seen(echoes)
    new = anew.visible & ~seen.visible
    marks = {name: np.where(new, getattr(anew, name), getattr(seen, name)) for name in ("visible", "strong", "limit")}
    return replace(seen, **marks)


def ordered_again(view: View, echoes: Echoes, mirrors: Sequence[Mirror], settings: FoldSettings) -> Found:
    """Steps 3 and 4 with known mirrors, until the visible echoes no longer change; no echo is tested."""

    def ordered(echoes: Echoes) -> Order:
        order_of = partial(order_mirrors, view=view, echoes=echoes, settings=settings)
        return without_bent(order_of(mirrors), order_of)

    order, seen = agreed(ordered, echoes, settings)
    return Found(seen, *assign_echoes(order, seen, opaque=settings.opaque), *_Reasons(seen).explained())
