"""Steps 2 to 4 for mirrors of every kind: those told by their own echoes first, then those told by what they show.

Flat, opaque walls are found by their own echoes, see `mirrorfold.tree.rounds`. That a wall lets waves pass, that a
curved or a short row of echoes is a mirror, is told by what stands behind it; then steps 2 to 4 are done once more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import xarray as xr

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import find_echoes, remembering
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.curved import find_curved
from mirrorfold.tree.explaining.doubted import without_doubted
from mirrorfold.tree.half_transparent.guessed import guess_transparent
from mirrorfold.tree.half_transparent.transparent import find_transparent
from mirrorfold.tree.measured import Measured
from mirrorfold.tree.rounds import find_tree
from mirrorfold.tree.short_rows import find_short
from mirrorfold.tree.showing import Steps

if TYPE_CHECKING:
    from mirrorfold.folding.settings import FoldSettings


def find_every_kind(
    view: View,
    echoes: Echoes,
    settings: FoldSettings,
    *,
    measured: Measured,
    known: Array | None = None,
    walls: Mask | None = None,
    polarizations: Mapping[str, xr.DataArray] | None = None,
    short: bool = True,
) -> Found:
    """Mirrors of every kind, their order, and the echoes seen through each.

    Parameters
    ----------
    view : View
    echoes : Echoes
    settings : FoldSettings
        By the published algorithm all mirrors are opaque and flat.
    measured : Measured
    known, walls : optional
        Mirrors in the place of those found, see `find_tree`.
    polarizations : mapping of str to DataArray, optional
        Complex images by polarization, "TE" and "TM", which tell what passed through walls.
    short : bool
        Whether mirrors may be shorter than those that their own echoes tell.
    """
    find = remembering()
    again = partial(find_tree, view, settings=settings, measured=measured, find=find)
    found, rows, bent = again(echoes=echoes, known=known, walls=walls), list[Mirror](), list[Mirror]()
    passable = settings.transparent and settings.opaque
    both = polarizations if passable else None
    if both:
        found = find_transparent(found, view, both, echoes, again=partial(again, known=known))
    if known is not None or settings.published:
        return found
    if not found.windows:
        steps = Steps(
            heard=partial(find_echoes, view, threshold_db=settings.threshold_db),
            glance=partial(find_tree, view, settings=replace(settings, copies=False), find=find),
            again=again,
        )
        if settings.curved:
            found, rows, bent = find_curved(found, view, steps)
        if short and isinstance(view, ImageView):
            shortest = settings.minimum_length or 0.0
            found, rows, _ = find_short(found, view, steps, minimum_length=shortest, besides=rows)
        # Short and curved walls are half-transparent as often as others.
        if both and rows:
            found = find_transparent(found, view, both, echoes, again=partial(again, besides=rows))
    if passable and not polarizations:
        found = guess_transparent(found, view, echoes, again=partial(again, besides=rows))
    return found if found.windows or not settings.opaque else without_doubted(found, view, bent)
