"""Steps 2 to 4 in turn: mirrors, their order, and what can be seen at all depend on each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.common.stopping import go_on
from mirrorfold.common.types import Array, Mask, Names
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import Finder, find_mirrors
from mirrorfold.detection.mirrors.curved import on_rows
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import ITSELF, Found, assign_echoes, radar_itself
from mirrorfold.tree.completion import completed
from mirrorfold.tree.curved import without_bent
from mirrorfold.tree.explaining.copies import COPY, copies
from mirrorfold.tree.explaining.directions import NEAREST_LENGTHS
from mirrorfold.tree.explaining.half_shadows import Hems
from mirrorfold.tree.explaining.late_walls import from_late_walls
from mirrorfold.tree.explaining.misplaced import LATE, MIXED
from mirrorfold.tree.explaining.rough_walls import SCATTERED, scattered
from mirrorfold.tree.explaining.short_cuts import SHORT_CUT, short_cuts
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT
from mirrorfold.tree.measured import Measured
from mirrorfold.tree.ordering import Order, order_mirrors

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings

MAXIMUM_ROUNDS = 8
"""Mirrors and what is visible usually agree after two or three rounds."""


def find_tree(
    view: View,
    echoes: Echoes,
    settings: FoldSettings,
    *,
    known: Array | None = None,
    walls: Mask | None = None,
    measured: Measured | None = None,
    besides: Sequence[Mirror] = (),
    find: Finder = find_mirrors,
) -> Found:
    """Steps 2 to 4: mirrors, their order, and the echoes seen through each.

    Parameters
    ----------
    view : View
    echoes : Echoes
        As `find_echoes` returns them.
    settings : FoldSettings
    known : array, optional
        Mirrors in the place of those found, see `find_mirrors`.
    walls : (n,) bool array, optional
        With known mirrors: which echoes are those of walls.
    measured : Measured, optional
        What the sweep tells. What stands behind an echo from elsewhere comes into view when that is left out, and is
        tested in its turn.
    besides : sequence of Mirror
        Mirrors besides those that are found, see `mirrorfold.tree.showing`.
    find : callable
        Step 2: `find_mirrors`, or another function with its arguments.
    """
    measured = measured or Measured()
    agree = partial(agreed, settings=settings, known=known, besides=besides, find=find)
    account, hems = _Account(echoes), Hems.nothing()
    repeated = settings.copies and (known is None or len(known) > 0)  # without any mirror all stays as it is seen
    while True:
        go_on()
        echoes = account.echoes
        order, seen = agree(view, echoes, walls=walls, hems=hems)
        if measured.beside is not None and not (told := measured.beside(order, seen)).same(hems):
            hems = told
            order, seen = agree(view, echoes, walls=walls, hems=hems)
        tree, sight = assign_echoes(order, seen, opaque=settings.opaque)
        clear = sight.clear(echoes)
        if repeated:
            account.put(clear & copies(order, seen), COPY)
        twice = clear & scattered(order, seen) if settings.rough_walls else np.zeros_like(clear)
        if settings.rough_walls:
            # Scattered echoes that pass for a wall go at once: nothing is seen by way of that wall.
            account.put(twice & (order.face != ROOT), SCATTERED)
            account.put(clear & short_cuts(order, seen), SHORT_CUT)
            account.put(clear & (order.face == ROOT) & from_late_walls(order, seen), LATE)
        if measured.explain is not None:
            account.ask(measured.explain, clear)
        searched = known is None and not settings.published
        blurs = searched and measured.share is not None and account.blur(measured.share, clear & (order.face >= 0))
        if account.stays.all() and not blurs:
            break
        walls = None if walls is None else walls[account.stays]
        account.leave_out()
        if searched and isinstance(view, ImageView):
            view = view.knowing(account.elsewhere(NEAREST_LENGTHS * view.glint))
    # Neither what was scattered twice nor the radar's own image is an object, but each hides what is behind it.
    if twice.any():
        account.put(twice, SCATTERED)
        order = replace(order, face=np.where(twice, NOBODY, order.face))
        tree, sight = assign_echoes(order, seen, opaque=settings.opaque)
    if settings.opaque:
        account.put(radar_itself(tree, sight, seen), ITSELF)
    return Found(seen, tree, sight, *account.explained())


OWN_SHARE = 0.5
"""Share of the energy of an echo that must have come back the way it went: with less, most of it is from elsewhere."""


class _Account:
    """Which echoes come from where they are seen, and what accounts for the others.

    Attributes
    ----------
    echoes : Echoes
        Those that have not been left out.
    """

    def __init__(self, echoes: Echoes) -> None:
        self._every = self.echoes = echoes
        self._index, self._trusted = np.arange(len(echoes)), np.zeros(len(echoes), dtype=bool)
        self._why = np.full(len(echoes), "", dtype=object)
        self._blurs = np.zeros(len(echoes), dtype=bool)

    @property
    def stays(self) -> Mask:
        """Which of the `echoes` nothing else accounts for, (n,)."""
        return np.asarray(self._why[self._index] == "")

    def put(self, which: Mask, why: str | Names) -> None:
        """Say what accounts for some of the `echoes`."""
        self._why[self._index[which]] = why

    def ask(self, explain: Callable[[Echoes], Names], clear: Mask) -> None:
        """Have the `echoes` explained that are in `clear` sight, (n,), each once."""
        new = ~self._trusted & clear & self.stays
        if new.any():
            self.put(new, explain(self.echoes.take(new)))
        self._trusted |= new

    def leave_out(self) -> None:
        """Go on without those that something accounts for."""
        stays = self.stays
        self._index, self._trusted, self.echoes = self._index[stays], self._trusted[stays], self.echoes.take(stays)

    def blur(self, share: Callable[[Array, Array], Array], which: Mask) -> bool:
        """Ask of some of the `echoes` that stay, (n,), whether most of their energy came back by another way than it
        went: where walls show them, their place says little of the wall. Returns whether any does that did not before.
        """
        asked = self._index[which & self.stays & ~self._blurs[self._index]]
        blurs = asked[share(self._every.position[asked], self._every.amplitude[asked]) < OWN_SHARE]
        self._blurs[blurs] = True
        return bool(blurs.size)

    def elsewhere(self, nearest: float) -> Array:
        """Where the image shows echoes that came back by another way than they went, (m, d) [m].

        Directions do not tell that of echoes nearer than `nearest` [m].
        """
        return self._every.position[(self._blurs | (self._why == MIXED)) & (self._every.range >= nearest)]

    def explained(self) -> tuple[Echoes, Names]:
        """All that something accounts for, and what does."""
        told = self._why != ""
        return self._every.take(told), self._why[told].astype(str)


def agreed(
    view: View,
    echoes: Echoes,
    settings: FoldSettings,
    known: Array | None = None,
    walls: Mask | None = None,
    besides: Sequence[Mirror] = (),
    hems: Hems | None = None,
    find: Finder = find_mirrors,
) -> tuple[Order, Echoes]:
    """Mirrors and their order in turn, until both agree with what is visible.

    Mirrors that only multiple scattering holds up vanish when its echoes turn out to be hidden by objects.
    """
    hems = Hems.nothing() if hems is None else hems
    for _ in range(MAXIMUM_ROUNDS):
        tested, length = not settings.published, settings.minimum_length
        rows = echoes.take(~on_rows(besides, view, echoes)) if besides else echoes
        mirrors = find(view, rows, minimum_length=length, tested=tested, known=known)
        mirrors = hems.on(mirrors, view)
        order = order_mirrors([*mirrors, *besides], view, echoes, settings, walls)
        if (
            known is None and settings.opaque and (own := order.itself()).any()
        ):  # the antennas are opaque, but no mirror of the scene
            mirrors = [mirror for mirror, itself in zip(order.mirrors, own, strict=True) if not itself]
            order = order_mirrors(mirrors, view, echoes, settings, walls)
        if known is None and tested and settings.opaque and isinstance(view, ImageView):
            more = hems.on(completed(mirrors, order, view, echoes, settings, find), view)
            if len(more) > len(mirrors) or any(one is not other for one, other in zip(more, mirrors, strict=True)):
                order = order_mirrors([*more, *besides], view, echoes, settings, walls)
        # What a curved mirror shows of a flat one is not straight.
        if known is None and tested and settings.opaque and (kept := without_bent(order)):
            order = order_mirrors(kept, view, echoes, settings, walls)
        seen = order.seen(echoes) if settings.opaque else echoes
        if np.array_equal(seen.visible, echoes.visible) and np.array_equal(seen.strong, echoes.strong):
            break
        echoes = seen
    return order, seen
