"""Things that cast no shadow on the wall behind them, and hide little.

An opaque thing hides the part of a wall that stands behind it. Where the row of echoes of that wall goes on undimmed,
there is none: the echo before it comes from elsewhere, or from something so small that the array looks around it. Then
what is clearly brighter than it stands behind it, as it might beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.lines_of_sight import CLEAR_DB
from mirrorfold.tree.things import things

UNDIMMED_DB = 10.0
"""Where nothing stands before a wall, its mean power over a beam is no farther below its usual level: speckle."""

OUTSHINES_DB = 6.0
"""Behind such a thing stands what outshines it by this: the brightest of ten speckles exceeds their median by 5 dB."""

BEFORE = 0.5
"""Of the directions that a thing covers, this share at least must meet the wall to tell."""

SEEN_PAST = 0.5
"""More than this share of a wall must be seen past all things for it to tell."""


def without_shadow(objects: Echoes, mirrors: Sequence[Mirror], crossing: Array, view: View) -> Echoes:
    """The objects with the amplitudes by which they hide what is behind them: less for those that cast no shadow.

    Parameters
    ----------
    objects, mirrors, crossing, view
        See `cast_no_shadow`.
    """
    level = np.where(cast_no_shadow(objects, mirrors, crossing, view), 10.0 ** ((OUTSHINES_DB - CLEAR_DB) / 20.0), 1.0)
    return replace(objects, amplitude=level * objects.amplitude)


def cast_no_shadow(objects: Echoes, mirrors: Sequence[Mirror], crossing: Array, view: View) -> Mask:
    """Which objects in line of sight stand before mirrors whose echoes go on behind them, brighter than they are, (n,).

    Those of one thing do together or not at all. A mirror tells if the most of it is seen past all objects: else it may
    be what these reflect, as a wall does that is seen edge-on. In a volume, nothing is said.

    Parameters
    ----------
    objects : Echoes
    mirrors : sequence of Mirror
    crossing : (mirrors, directions) array [m]
        Range at which each line of sight meets each mirror, infinite where it passes it by.
    view : View
    """
    if not isinstance(view, ImageView) or not len(objects) or not mirrors:
        return np.zeros(len(objects), dtype=bool)
    thing = things(view, objects.range, objects.direction)
    back = objects.range + view.object_depth(objects.range)
    brightest, depth = np.zeros((2, int(thing.max()) + 1))
    np.maximum.at(brightest, thing, objects.amplitude)
    np.maximum.at(depth, thing, back)
    row, direction = view.within(objects.position, view.covered_angle)
    covering, covered = np.unique([thing[row], direction], axis=1)
    hidden_from = np.full(len(view.sight), np.finfo(float).max)  # range in each direction [m]
    np.minimum.at(hidden_from, direction, back[row])
    past = np.count_nonzero(crossing <= hidden_from, axis=1)
    tells = past > SEEN_PAST * np.count_nonzero(np.isfinite(crossing), axis=1)
    crossing = np.where(tells[:, None], crossing, np.inf)
    nearest, first = crossing.min(axis=0)[covered], crossing.argmin(axis=0)[covered]
    met = np.isfinite(nearest)
    shown = np.zeros(met.size)
    shown[met] = view.power_at(nearest[met], view.u[covered[met]])
    usual = np.array([mirror.strength for mirror in mirrors])[first] * 10.0 ** (-UNDIMMED_DB / 20.0)

    def of_thing(values: Array) -> Array:
        """Their sum over the directions that each thing covers, (things,)."""
        return np.bincount(covering, weights=values, minlength=len(depth)).astype(float)

    meets = of_thing(met)
    told = (meets >= BEFORE * of_thing(np.ones(met.size))) & (of_thing(met & (nearest <= depth[covering])) == 0.0)
    told &= of_thing(shown) >= np.maximum(meets * brightest**2, of_thing(met * usual**2))
    return np.asarray(told[thing])
