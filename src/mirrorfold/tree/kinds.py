"""Steps 2 to 4 for mirrors of every kind: flat, curved, short and half-transparent ones.

Flat, opaque walls are found by their own echoes, see `mirrorfold.tree.rounds`. Only the echoes behind a wall show
that it lets waves pass, or that a curved or a short row is a mirror. Such mirrors are proposed one kind after the
other, and steps 2 to 4 are repeated with them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import xarray as xr

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror, View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.curved import find_curved
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.half_transparent.guessed import guess_transparent
from mirrorfold.tree.half_transparent.transparent import find_transparent, with_doubts
from mirrorfold.tree.lines_by_waves import with_lines_by_waves
from mirrorfold.tree.measured import Measured
from mirrorfold.tree.rounds import find_tree
from mirrorfold.tree.short_rows import find_short

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
    """Mirrors of every kind, their order, and the echoes that are seen through each.

    In the published algorithm all mirrors are opaque and flat.

    Parameters
    ----------
    view, echoes, settings, measured
    known, walls : optional
        Given mirrors, used in the place of found ones, see `find_tree`.
    polarizations : mapping of str to DataArray, optional
        Complex images by polarization, "TE" and "TM", by which echoes that passed through walls are found.
    short : bool
        Whether rows that are too short to be mirrors by their own echoes may be mirrors by the echoes behind them.
    """
    full_pass = partial(find_tree, view, settings=settings, measured=measured)
    found, rows, rejected = full_pass(echoes=echoes, known=known, walls=walls), list[Mirror](), list[Mirror]()
    passable = settings.transparent and settings.opaque
    both = polarizations if passable else None
    if both:
        found = find_transparent(found, view, both, echoes, walls=walls, full_pass=partial(full_pass, known=known))
    if known is not None or settings.published:
        return with_doubts(found, view, both) if both else found
    if not found.transparent_walls:
        if settings.curved:
            found, rows, rejected = find_curved(found, view, settings, full_pass)
        if short and isinstance(view, ImageView):
            found, rows = find_short(found, view, settings, full_pass, corners=measured.corners, besides=rows)
        # Short and curved walls are half-transparent as often as other walls.
        if both and rows:
            found = find_transparent(found, view, both, echoes, full_pass=partial(full_pass, besides=rows))
    if passable and not polarizations:
        found = guess_transparent(found, view, echoes, full_pass=partial(full_pass, besides=rows))
    if isinstance(view, ImageView):
        found = with_lines_by_waves(found, view)
    if settings.opaque and not found.transparent_walls:
        found = without_explained(found, view, rejected, measured.corners)
    return with_doubts(found, view, both) if both else found
