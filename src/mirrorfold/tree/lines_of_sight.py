"""Every line of sight of the radar: the mirrors that it meets, what it shows behind each, and where objects end it.

In the unfolded image a line of sight is a straight ray from the radar. Walking outward along it, each mirror that is
crossed opens a view by way of that mirror; the first object ends the view, because objects are opaque: what the image
shows behind an object is multiple scattering.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Fold
from mirrorfold.detection.views.view import View, in_pieces

CLEAR_DB = 20.0
"""An echo this much stronger than all objects in front of it stands there all the same: speckle fades by up to 20 dB,
and multiple scattering is weaker than what scatters, but the glint of a corner outshines the edge of its own leg by
40 dB."""

OUTSHINES_DB = 6.0
"""An echo this much stronger than speckle is none: the brightest of ten speckles exceeds their median by 5 dB."""

OPEN_CELLS = 3.0
"""The radar's own view is taken to be open up to this many resolution cells before and beside each echo in it: an
object that shows its edge may show its face by way of a mirror only."""

ITSELF_CELLS = 1.5
"""What folds this close to the antennas, in the resolution cells of where it stood, is the radar itself."""

ROOT = -1
"""In the place of a mirror's number: seen directly."""

NOBODY = -2
"""In the place of a mirror's number: neither seen directly nor by way of any mirror."""


class Cover(NamedTuple):
    """What objects hide: along each line of sight, the amplitude that an echo must exceed to be more than an object's
    multiple scattering.

    It rises in steps along each line of sight, at `range` (depth, n) [m], the nearest first, to `level` (depth, n).
    Where a line of sight has fewer steps, the ranges of the others are infinite.
    """

    range: Array
    level: Array

    @classmethod
    def nothing(cls, directions: int) -> Cover:
        """No object hides anything."""
        return cls(np.empty((0, directions)), np.empty((0, directions)))

    @classmethod
    def of(cls, objects: Echoes, view: View) -> Cover:
        """What objects hide: in the directions that each covers, all behind its own depth that is not much stronger."""
        row, direction = view.within(objects.position, view.covered_angle)
        begin = (objects.range + view.object_depth(objects.range))[row]
        level = 10.0 ** (CLEAR_DB / 20.0) * objects.amplitude[row]
        table = _steps(direction, begin, level, view)
        # Of several objects along a line of sight only those matter that are stronger than all before them.
        which = np.nonzero(np.diff(table.level, axis=0, prepend=0.0) > 0.0)
        return _steps(which[1], table.range[which], table.level[which], view)

    def clear(self, range_: Array, direction: Index, amplitude: Array | float) -> Mask:
        """Whether echoes of that amplitude are more than multiple scattering of the objects in front of them."""
        hidden = np.zeros(range_.shape)
        for step, level in zip(self.range, self.level, strict=True):
            hidden = np.where(step[direction] <= range_, level[direction], hidden)
        return np.asarray(amplitude > hidden)


def _steps(direction: Index, begin: Array, level: Array, view: View) -> Cover:
    """A table of the steps along each line of sight, from the nearest, with the highest level up to there."""
    directions = len(view.sight)
    order = np.lexsort([begin, direction])
    direction = direction[order]
    rank = np.arange(direction.size) - np.searchsorted(direction, np.arange(directions))[direction]
    depth = int(rank.max(initial=-1)) + 1
    table = Cover(np.full((depth, directions), np.inf), np.zeros((depth, directions)))
    table.range[rank, direction] = begin[order]
    table.level[rank, direction] = level[order]
    np.maximum.accumulate(table.level, axis=0, out=table.level)
    return table


@dataclass(frozen=True, eq=False)
class LinesOfSight:
    """Every line of sight of the radar, by direction.

    Attributes
    ----------
    view : View
    crossing : (mirrors, n) array [m]
        Range at which the line of sight meets each mirror; infinite where it passes it by.
    parent : (mirrors,) array of int
        The mirror through which each is seen, `ROOT`, or `NOBODY`.
    cover : Cover
        What objects hide.
    chain : tuple of tuple of int
        Chain of each mirror's node in the tree; empty for mirrors that are not in it.
    open : (n,) array [m]
        Up to this range the radar itself looks into each direction and sees nothing; empty if that is not known.
    """

    view: View
    crossing: Array
    parent: Index
    cover: Cover
    chain: tuple[Chain, ...] = ()
    open: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def unfolded(cls, view: View) -> LinesOfSight:
        """Those of a scene without mirrors, in which nothing is hidden."""
        nothing = np.empty((0, len(view.sight)))
        return cls(view, nothing, np.empty(0, dtype=np.intp), Cover.nothing(len(view.sight)))

    @cached_property
    def passages(self) -> tuple[Array, Index]:
        """Crossings along every line of sight from the nearest outward, (depth, n), and the mirror by way of which it
        shows what follows: before the first of them and after each, (depth + 1, n).

        A crossing opens the view by way of a mirror only where the view by way of its parent is open.
        """
        depth = int(np.isfinite(self.crossing).sum(axis=0).max(initial=0))
        order = np.argsort(self.crossing, axis=0)[:depth]
        crossing = np.take_along_axis(self.crossing, order, axis=0)
        through = np.full((depth + 1, self.crossing.shape[1]), ROOT, dtype=np.intp)
        for i, mirror in enumerate(order):
            through[i + 1] = np.where(through[i] == self.parent[mirror], mirror, NOBODY)
        return crossing, through

    def seen_through(self, range_: Array, direction: Index) -> Index:
        """The mirror through which points at that range [m] and direction are seen: its number, ROOT or NOBODY."""
        crossing, through = self.passages
        passed = np.sum([ranges[direction] < range_ for ranges in crossing], axis=0, dtype=np.intp)
        return np.asarray(through[passed, direction])

    def clear(self, echoes: Echoes) -> Mask:
        """Which echoes no object hides, (n,)."""
        return self.cover.clear(echoes.range, echoes.direction, echoes.amplitude)

    def contradicted(self, echoes: Echoes, fold: Fold) -> Mask:
        """Which echoes at the edge of what their mirror shows would stand where the radar itself sees nothing, (n,).

        A beam that reaches over the edge shows what is beside it, too. `fold` maps to where the echoes would stand.
        """
        if not self.open.size:
            return np.zeros(len(echoes), dtype=bool)
        range_, direction, inside = self.view.locate(fold(echoes.position))
        empty = inside & (range_ < self.open[direction])
        mirror = self.seen_through(echoes.range, echoes.direction)
        sides = self.view.beside(echoes.range, echoes.direction)
        return empty & np.logical_or.reduce([self.seen_through(echoes.range, side) != mirror for side in sides])

    def open_ranges(self, echoes: Echoes) -> Array:
        """Range up to which each direction of the radar's own view is empty, (n,) [m]; zero where it does not look."""
        nearest = self.crossing.min(axis=0, initial=np.inf)
        met = np.flatnonzero(np.isfinite(nearest))
        direct = echoes.take(self.seen_through(echoes.range, echoes.direction) == ROOT)
        points = np.concatenate([direct.position, self.view.points(nearest[met], met)])
        range_ = np.concatenate([direct.range, nearest[met]])
        empty = np.where(self.view.looks_at(echoes), self.view.range[-1], 0.0)
        margin = OPEN_CELLS * self.view.cell(range_)
        aside, begin = np.maximum(margin / range_, self.view.steps.mean()), range_ - margin
        for some in in_pieces(len(points)):
            row, direction = self.view.within(points[some], aside[some])
            np.minimum.at(empty, direction, begin[some][row])
        return empty


def itself(view: View, echoes: Echoes, fold: Fold) -> Mask:
    """Which echoes, folded, stand on the antennas, (n,).

    In a mirror that faces it, the radar sees itself, at twice the distance of the mirror: where the antennas sit on the
    surface of a body, that surface sends the echo of the opposite one back again.
    """
    return view.on_radar(fold(echoes.position), ITSELF_CELLS * view.cell(echoes.range))


@njit(nogil=True, error_model="numpy")
def through_at(crossing, through, distance, direction):  # type: ignore[no-untyped-def]
    """`LinesOfSight.seen_through` for one point."""
    passed = 0
    for k in range(crossing.shape[0]):
        passed += crossing[k, direction] < distance
    return through[passed, direction]


@njit(nogil=True, error_model="numpy")
def hidden_at(begin, level, distance, direction):  # type: ignore[no-untyped-def]
    """The amplitude that one point must exceed to be seen, see `Cover`."""
    hidden = 0.0
    for k in range(begin.shape[0]):
        if begin[k, direction] > distance:
            break
        hidden = level[k, direction]
    return hidden
