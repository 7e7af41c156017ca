"""Echoes of objects that cast no shadow on the wall behind them, and so hide little.

An opaque object hides the part of a wall that stands behind it. If the wall's row of echoes goes on undimmed there, no
such object stands before the wall: the echo before it comes from elsewhere, or from an object so small that the array
looks around it. Such an echo hides only echoes that are not clearly brighter than itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror, View
from mirrorfold.detection.echoes import brightest_of
from mirrorfold.tree.grouping import object_numbers
from mirrorfold.tree.lines_of_sight import OUTSHINES_DB, hiding_levels

UNDIMMED_DB = 10.0
"""Largest drop of a wall's mean power over a beam below its usual level that speckle alone makes, without an object."""

BEFORE = 0.5
"""Least share of the directions that an object covers in which a wall must stand behind it to test its shadow."""

SEEN_PAST = 0.5
"""A wall can test the shadows of objects if more than this share of it is seen past all of them."""


def levels_behind(objects: Echoes, mirrors: Sequence[Mirror], crossing: Array, view: View) -> Array:
    """Amplitude up to which echoes behind each echo of objects may be multiple scattering of them, (n,).

    These are the `hiding_levels`; of objects that `cast_no_shadow`, at most `OUTSHINES_DB` over the echo itself.
    """
    shadowless = cast_no_shadow(objects, mirrors, crossing, view)
    outshone = np.where(shadowless, ratio_of(OUTSHINES_DB) * objects.amplitude, np.inf)
    return np.minimum(hiding_levels(objects, view), outshone)


def cast_no_shadow(objects: Echoes, mirrors: Sequence[Mirror], crossing: Array, view: View) -> Mask:
    """Which objects in line of sight stand before mirrors whose echoes go on behind them, brighter than theirs, (n,).

    The answer is the same for all echoes of one object. A mirror counts only if most of it is seen past all objects:
    otherwise it may be an image that these reflect, as behind a wall that is seen edge-on. In a volume, none.
    `crossing` (mirrors, directions) [m] is the range at which each line of sight meets each mirror, infinite where it
    misses the mirror.
    """
    if not isinstance(view, ImageView) or not len(objects) or not mirrors:
        return np.zeros(len(objects), dtype=bool)
    number = object_numbers(view, objects)
    back = objects.range + view.object_depth(objects.range)
    brightest = brightest_of(number, objects.amplitude)
    depth = np.zeros(brightest.size)
    np.maximum.at(depth, number, back)
    row, direction = view.within(objects.position, view.covered_angle)
    covering, covered = np.unique([number[row], direction], axis=1)
    hidden_from = np.full(len(view.sight), np.finfo(float).max)  # range in each direction [m]
    np.minimum.at(hidden_from, direction, back[row])
    past = np.count_nonzero(crossing <= hidden_from, axis=1)
    is_test = past > SEEN_PAST * np.count_nonzero(np.isfinite(crossing), axis=1)
    crossing = np.where(is_test[:, None], crossing, np.inf)
    nearest, first = crossing.min(axis=0)[covered], crossing.argmin(axis=0)[covered]
    met = np.isfinite(nearest)
    shown = np.zeros(met.size)
    shown[met] = view.power_at(nearest[met], view.u[covered[met]])
    usual = np.array([mirror.strength for mirror in mirrors])[first] * ratio_of(-UNDIMMED_DB)

    def summed(values: Array) -> Array:
        """Sum of the values over the directions that each object covers, (objects,)."""
        return np.bincount(covering, weights=values, minlength=len(depth)).astype(float)

    meets = summed(met)
    casts_none = (meets >= BEFORE * summed(np.ones(met.size))) & (summed(met & (nearest <= depth[covering])) == 0.0)
    casts_none &= summed(shown) >= np.maximum(meets * brightest**2, summed(met * usual**2))
    return casts_none[number]
