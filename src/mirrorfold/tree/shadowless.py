"""Things that cast no shadow on the wall behind them, and hide little.

An opaque thing hides the part of a wall that stands behind it. Where the row of echoes of that wall goes on undimmed,
there is none: the echo before it comes from elsewhere, or from something so small that the array looks around it. What
else is seen in its direction may be as good as what is seen beside it, if it is no more of the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.mirror import Mirror
from mirrorfold.detection.view import View
from mirrorfold.tree.lines_of_sight import CLEAR_DB
from mirrorfold.tree.things import things

UNDIMMED_DB = 10.0
"""A wall behind nothing is fainter by less than this than what is usual of it, on the average over a beam: speckle."""

OUTSHINES_DB = 6.0
"""Behind such a thing stands what outshines it by this: the brightest of ten speckles exceeds their median by 5 dB."""

BEFORE = 0.5
"""Of the directions that a thing covers, this share at least must meet the wall to tell."""


def without_shadow(objects: Echoes, mirrors: Sequence[Mirror], view: View) -> Echoes:
    """The objects, those that cast no shadow as weak as they hide, see `Cover`."""
    level = np.where(cast_no_shadow(objects, mirrors, view), 10.0 ** ((OUTSHINES_DB - CLEAR_DB) / 20.0), 1.0)
    return replace(objects, amplitude=level * objects.amplitude)


def cast_no_shadow(objects: Echoes, mirrors: Sequence[Mirror], view: View) -> Mask:
    """Which objects in line of sight stand before mirrors whose echoes go on behind them, brighter than they are, (n,).

    Those of one thing do together or not at all. In a volume, nothing is said.

    Parameters
    ----------
    objects : Echoes
    mirrors : sequence of Mirror
    view : View
    """
    told = np.zeros(len(objects), dtype=bool)
    if not isinstance(view, ImageView) or not len(objects) or not mirrors:
        return told
    crossing = np.stack([mirror.crossing(view) for mirror in mirrors])
    nearest, first = crossing.min(axis=0), crossing.argmin(axis=0)
    met = np.flatnonzero(np.isfinite(nearest))
    shown = np.zeros(nearest.size)
    shown[met] = _brightest(view, nearest[met], met)
    usual = np.array([mirror.strength for mirror in mirrors])[first] * 10.0 ** (-UNDIMMED_DB / 20.0)
    thing = things(view, objects.range, objects.direction)
    row, direction = view.within(objects.position, view.covered_angle)
    for number in np.unique(thing):
        own = thing == number
        covered = np.unique(direction[own[row]])
        depth = float(np.max(objects.range[own] + view.object_depth(objects.range[own])))
        behind = covered[np.isfinite(nearest[covered])]
        if behind.size >= BEFORE * covered.size and (nearest[behind] > depth).all():
            level = np.sqrt(np.mean(shown[behind] ** 2))
            told[own] = level >= max(objects.amplitude[own].max(), usual[behind].mean())
    return told


def _brightest(view: ImageView, range_: Array, direction: Index) -> Array:
    """The largest amplitude within half a range cell of places at ranges (n,) [m] in directions (n,)."""
    at = np.rint((range_ - view.range[0]) / view.dr).astype(np.intp)
    half = round(0.5 * view.range_cell / view.dr)
    rows = np.clip(at + np.arange(-half, half + 1)[:, None], 0, view.range.size - 1)
    return np.asarray(view.amplitude[rows, direction].max(axis=0))
