"""Which curved rows of echoes are mirrors: those behind which the image shows what is behind no opaque object.

A row is a mirror if enough echoes stand behind it, strong enough for how the arc spreads them; if most of them fold to
where an object may stand; and if some show places that are not known otherwise. Of what is seen directly or in flat
mirrors, a convex one shows a coarser picture at best, and multiple scattering behind round objects folds to these.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.detection.finding import find_curved_rows
from mirrorfold.detection.mirrors.mirror import Mirror, faces
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT
from mirrorfold.tree.ordering import Order
from mirrorfold.tree.showing import Evidence, Steps, with_rows

FEWEST_CELLS = 3
"""Resolution cells behind a mirror in which echoes stand, at least: multiple scattering may fill one."""

FEWEST_NEW, NEW_SHARE = 2, 0.23
"""Fewest cells, and least share of the cells behind a mirror, that show what is not known. Behind a pillar that shows
known objects, echoes by way of it and further mirrors, which fold to wrong places, fill fewer. The share was 0.25 and
more behind true mirrors of random scenes, 0.17 at most behind others, and 0.21 behind an arc of full waves."""


def find_curved(found: Found, view: View, steps: Steps) -> tuple[Found, list[Mirror], list[Mirror]]:
    """Steps 2 to 4 once more with the curved mirrors that the image tells, these, and other rows, see `with_rows`."""
    return with_rows(
        found,
        view,
        steps,
        proposed=lambda known, view: candidates(known, view),
        fewest=FEWEST_CELLS,
        tells=shows_new,
    )


def shows_new(seen: Evidence) -> bool:
    """Whether enough of what stands behind a row is new."""
    return seen.new >= max(FEWEST_NEW, NEW_SHARE * seen.cells)


def candidates(found: Found, view: View) -> Sequence[Mirror]:
    """Curved rows, in space round sheets, among the echoes in line of sight, and among those that flat mirrors show.

    Parameters
    ----------
    found : Found
        What is known so far; its flat mirrors may be pieces of a curved one.
    view : View
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
    return find_curved_rows(view, echoes, own)


def without_bent(order: Order) -> list[Mirror] | None:
    """The mirrors without those seen by way of a curved one; None if there are no such."""
    bent = [any(mirror.curved for mirror in order.way(index)[:-1]) for index in range(len(order.mirrors))]
    return [mirror for mirror, is_bent in zip(order.mirrors, bent, strict=True) if not is_bent] if any(bent) else None
