"""Every line of sight of the radar: which mirrors it meets, by way of which mirror it sees on, where objects end it.

In the unfolded image a line of sight is a straight ray from the radar. Walking outward along it, each mirror that is
crossed opens a view by way of that mirror; the first object ends the view, because objects are opaque: what the image
shows behind an object is multiple scattering.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mirrorfold.common.decibels import power_ratio_of, ratio_of
from mirrorfold.common.kernels import njit
from mirrorfold.common.types import ROOT, UNSEEN, Array, Chain, Index, Mask
from mirrorfold.detection import Echoes, Fold, ImageView, Mirror, View, fold_of
from mirrorfold.detection.echoes import brightest_of
from mirrorfold.detection.views.view import in_pieces
from mirrorfold.tree.grouping import object_numbers

CLEAR_DB = 20.0
"""An echo is no multiple scattering of the objects in front of it if it is stronger than each of them by this many
decibels. Multiple scattering is weaker than the object that scatters, but speckle fades the object's own echo by up to
20 dB. The glint of a corner is 40 dB stronger than the edge of its own leg, and so stays."""

POINT_CELLS = 4
"""An object that fills at most so many resolution cells, two by two, is a point to the radar: a wave that goes by way
of it and of something else spreads twice, and is weaker than its own echo."""

OUTSHINES_DB = 6.0
"""An echo that exceeds the median of speckle by this many decibels is no speckle: the brightest of ten speckles exceeds
their median by 6 dB on average."""

OPEN_CELLS = 3.0
"""The radar's direct view counts as empty up to this many resolution cells before and beside each echo in it. Nearer
places may be part of the same object, which may show the radar its edge directly, and its face only in a mirror."""

ITSELF_CELLS = 1.5
"""An echo that folds to a place this close to the antennas is the radar itself; in resolution cells at the echo's place
in the image."""


class Cover(NamedTuple):
    """What objects hide: along each line of sight, the amplitude that an echo must exceed to be seen.

    Weaker echoes may be multiple scattering of the objects in front of them. Along each of the n lines of sight there
    are steps: from `range` to `until` (depth, n), the nearest first, that amplitude is at least `level` (depth, n).
    Where a line of sight has fewer than `depth` steps, the ranges of the remaining ones are infinite. All ranges in
    metres.
    """

    range: Array
    until: Array
    level: Array

    @classmethod
    def nothing(cls, directions: int) -> Cover:
        """The cover without objects, for so many directions: nothing is hidden."""
        return cls(*np.empty((3, 0, directions)))

    @classmethod
    def of(cls, objects: Echoes, view: View, levels: Array | None = None) -> Cover:
        """What objects hide, up to `levels` (n,), or else up to their `hiding_levels`.

        In the directions that it covers, an object hides all that is farther behind it than an object is deep
        (`View.object_depth`), unless that is stronger than its level. Beyond its shadow (`shadow_ends`) it hides
        nothing.
        """
        row, direction = view.within(objects.position, view.covered_angle)
        begin = (objects.range + view.object_depth(objects.range))[row]
        level = (hiding_levels(objects, view) if levels is None else levels)[row]
        until = shadow_ends(objects, view)[row]
        table = _steps(direction, begin, until, level, view)
        # A step counts only if its level exceeds those of all nearer steps that never end.
        lasting = np.maximum.accumulate(np.where(np.isinf(table.until), table.level, 0.0), axis=0)
        before = np.vstack([np.zeros((1, len(view.sight))), lasting])[: len(lasting)]
        which = np.nonzero((table.range < table.until) & (table.level > before))
        return _steps(which[1], table.range[which], table.until[which], table.level[which], view)

    def clear(self, range_: Array, direction: Index, amplitude: Array | float) -> Mask:
        """Whether no object hides echoes at these ranges [m], in these directions, of these amplitudes."""
        hidden = np.zeros(range_.shape)
        for step, until, level in zip(*self, strict=True):
            within = (step[direction] <= range_) & (range_ < until[direction])
            hidden = np.maximum(hidden, np.where(within, level[direction], 0.0))
        return amplitude > hidden


def hiding_levels(objects: Echoes, view: View) -> Array:
    """Amplitude up to which echoes behind each echo of an object may be multiple scattering of that object, (n,).

    It is the amplitude of the echo, raised by `CLEAR_DB`; for an object as small as a point (`POINT_CELLS`) at most
    ``B / sqrt(f)``, with B the amplitude of its brightest echo. That is more than its mean amplitude M, but for rare
    fades: with the probability ``(1 - exp(-f))^k``, all of its k cells have speckle below ``sqrt(f) M``. The fade f is
    as rare for k cells as `CLEAR_DB` for one, one in a hundred: 10 dB for two cells, 6 dB for three, 4 dB for four.
    """
    own = ratio_of(CLEAR_DB) * objects.amplitude
    number = object_numbers(view, objects)
    brightest = brightest_of(number, objects.amplitude)
    filled = np.unique(np.column_stack([number, np.rint(view.in_cells(objects.position))]), axis=0)[:, 0]
    cells = np.bincount(filled.astype(np.intp), minlength=brightest.size)
    rare = -np.expm1(-power_ratio_of(-CLEAR_DB))
    faded = -np.log1p(-(rare ** (1.0 / cells)))
    mean = np.where(cells <= POINT_CELLS, brightest / np.sqrt(faded), np.inf)
    return np.minimum(own, mean[number])


def shadow_ends(objects: Echoes, view: View) -> Array:
    """Range [m] from which on the array looks around the object that each echo belongs to, (n,).

    The elements of an array look past an object on different sides of it. Of an array of length L across the line of
    sight, an object of width w at the range r hides ``w / (1 - r / range)`` from a place behind it: less than half of
    the array from the range ``r / (1 - 2 w / L)`` on, with L the shorter of both arrays. Infinite for wider objects,
    for one moving antenna, in a volume, and where the array is not known.
    """
    if not isinstance(view, ImageView) or not np.isfinite(view.wavelength):
        return np.full(len(objects), np.inf)
    number = object_numbers(view, objects)
    count, u = int(number.max(initial=-1)) + 1, view.u[objects.direction]
    range_, first, last = np.zeros(count), np.full(count, np.inf), np.full(count, -np.inf)
    np.maximum.at(range_, number, objects.range)
    np.minimum.at(first, number, u)
    np.maximum.at(last, number, u)
    slant = 1.0 - np.square(0.5 * (first + last))  # cosine of the angle off broadside, squared
    half = 0.5 * slant * view.wavelength * min(view.aperture_tx, view.aperture_rx)
    width = range_ * (last - first + 2.0 * view.covered_angle)
    return np.divide(range_ * half, half - width, out=np.full(count, np.inf), where=width < half)[number]


def _steps(direction: Index, begin: Array, until: Array, level: Array, view: View) -> Cover:
    """Sort steps from ranges `begin` to `until` [m] by direction, the nearest first."""
    directions = len(view.sight)
    order = np.lexsort([begin, direction])
    direction = direction[order]
    rank = np.arange(direction.size) - np.searchsorted(direction, np.arange(directions))[direction]
    depth = int(rank.max(initial=-1)) + 1
    never = np.full((depth, directions), np.inf)
    table = Cover(never, never.copy(), np.zeros((depth, directions)))
    for values, row in zip((begin, until, level), table, strict=True):
        row[rank, direction] = values[order]
    return table


@dataclass(frozen=True, eq=False)
class LinesOfSight:
    """All lines of sight of the radar, by direction.

    Attributes
    ----------
    view : View
    mirrors : sequence of Mirror
        The mirrors that are seen, each by way of one mirror only. Numbers of mirrors are those of this list.
    crossing : (mirrors, n) array [m]
        Range at which each line of sight meets each mirror; infinite where it misses the mirror.
    parent : (mirrors,) array of int
        Number of the mirror through which each mirror is seen, `ROOT`, or `UNSEEN`.
    cover : Cover
        What objects hide.
    empty_up_to : (n,) array [m]
        Range up to which the radar's direct view is empty in each direction; an empty array if that is not known.
    """

    view: View
    mirrors: Sequence[Mirror]
    crossing: Array
    parent: Index
    cover: Cover
    empty_up_to: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def unfolded(cls, view: View) -> LinesOfSight:
        """The lines of sight of a scene without mirrors, in which nothing is hidden."""
        nothing = np.empty((0, len(view.sight)))
        return cls(view, (), nothing, np.empty(0, dtype=np.intp), Cover.nothing(len(view.sight)))

    @cached_property
    def parent_of(self) -> Index:
        """`parent` with two more entries, so that the numbers `UNSEEN` and `ROOT` are their own parents."""
        return np.append(self.parent, [UNSEEN, ROOT])

    @cached_property
    def chain(self) -> tuple[Chain, ...]:
        """Chain of each mirror in the tree; empty for those that are not in the tree, because a parent is not seen."""
        chains: dict[int, Chain] = {ROOT: ()}
        waiting = [ROOT]
        for index in waiting:
            below = np.flatnonzero(self.parent == index).tolist()
            chains |= {child: (*chains[index], i) for i, child in enumerate(below)}
            waiting += below
        return tuple(chains.get(index, ()) for index in range(len(self.parent)))

    def way(self, index: int) -> tuple[Mirror, ...]:
        """The mirrors by way of which the radar looks into mirror `index`, this one last; none for `ROOT`."""
        return (*self.way(int(self.parent[index])), self.mirrors[index]) if index >= 0 else ()

    @cached_property
    def ways(self) -> dict[int, tuple[Mirror, ...]]:
        """The `way` to each mirror in the tree, by number."""
        return {index: self.way(index) for index, chain in enumerate(self.chain) if chain}

    def fold(self, index: int) -> Fold:
        """The map from the image to the true places of what is seen by way of mirror `index`, or directly (`ROOT`)."""
        return fold_of(self.way(index), self.view.dimensions)

    @cached_property
    def passages(self) -> tuple[Array, Index]:
        """Ranges [m] at which each line of sight meets mirrors, the nearest first, (depth, n); and the number of the
        mirror by way of which it sees on, before the first crossing and after each, (depth + 1, n).

        After a crossing the line of sight sees by way of that mirror only if it saw by way of the mirror's parent
        before; otherwise by way of `UNSEEN`.
        """
        depth = int(np.isfinite(self.crossing).sum(axis=0).max(initial=0))
        order = np.argsort(self.crossing, axis=0)[:depth]
        crossing = np.take_along_axis(self.crossing, order, axis=0)
        through = np.full((depth + 1, self.crossing.shape[1]), ROOT, dtype=np.intp)
        for i, mirror in enumerate(order):
            through[i + 1] = np.where(through[i] == self.parent[mirror], mirror, UNSEEN)
        return crossing, through

    def seen_through(self, range_: Array, direction: Index) -> Index:
        """Number of the mirror through which points at ranges [m] in directions are seen, or ROOT or UNSEEN, (n,)."""
        crossing, through = self.passages
        passed = np.sum([ranges[direction] < range_ for ranges in crossing], axis=0, dtype=np.intp)
        return through[passed, direction]

    def through(self, echoes: Echoes) -> Index:
        """Number of the mirror through which each of the echoes is seen, or ROOT or UNSEEN, (n,)."""
        return self.seen_through(echoes.range, echoes.direction)

    def clear(self, echoes: Echoes) -> Mask:
        """Which echoes no object hides, (n,)."""
        return self.cover.clear(echoes.range, echoes.direction, echoes.amplitude)

    def undecided(self, echoes: Echoes) -> Mask:
        """Which echoes are so near to the edge of a mirror that they may be seen in it or past it, (n,).

        A beam also shows what stands beside its axis, up to its radius. Near an edge, it shows an object in the mirror
        and one past the edge alike, and speckle decides which of its neighbours are brighter. In images, whose echoes
        are the brightest of their surroundings, no echo is undecided.
        """
        strays = self.view.strays(echoes.range)
        if not strays.any():
            return np.zeros(len(echoes), dtype=bool)
        row, beside = self.view.within(self.view.points(echoes.range, echoes.direction), strays)
        own = self.seen_through(echoes.range, echoes.direction)
        others = self.seen_through(echoes.range[row], beside) != own[row]
        return np.bincount(row, weights=others, minlength=len(echoes)) > 0.0

    def contradicted(self, echoes: Echoes, fold: Fold) -> Mask:
        """Which echoes at the edge of a mirror would fold to where the radar's direct view is empty, (n,).

        A beam at the edge of a mirror reaches over it, and also shows what is beside the mirror: such echoes were not
        seen by way of the mirror. `fold` maps the echoes to their true places, if the mirror shows them.
        """
        mirror = self.through(echoes)
        sides = self.view.beside(echoes.range, echoes.direction)
        at_edge = np.logical_or.reduce([self.seen_through(echoes.range, side) != mirror for side in sides])
        return at_edge & self.seen_empty(fold(echoes.position))

    def seen_empty(self, places: Array) -> Mask:
        """Which true places (n, d) [m] the radar's direct view shows to be empty, (n,); none if that is not known."""
        if not self.empty_up_to.size:
            return np.zeros(len(places), dtype=bool)
        range_, direction, inside = self.view.locate(places)
        return inside & (range_ < self.empty_up_to[direction])

    def open_ranges(self, echoes: Echoes) -> Array:
        """Range up to which the radar's direct view is empty in each direction, (n,) [m]; 0 where it does not look."""
        nearest = self.crossing.min(axis=0, initial=np.inf)
        met = np.flatnonzero(np.isfinite(nearest))
        direct = echoes.take(self.through(echoes) == ROOT)
        points = np.concatenate([direct.position, self.view.points(nearest[met], met)])
        range_ = np.concatenate([direct.range, nearest[met]])
        empty = np.where(self.view.looks_at(echoes), self.view.range[-1], 0.0)
        margin = OPEN_CELLS * self.view.cell(range_)
        aside, begin = np.maximum(margin / range_, self.view.steps.mean()), range_ - margin
        for some in in_pieces(len(points)):
            row, direction = self.view.within(points[some], aside[some])
            np.minimum.at(empty, direction, begin[some][row])
        return empty


def images_of_radar(view: View, echoes: Echoes, fold: Fold) -> Mask:
    """Which echoes fold to the place of the antennas, (n,): they are images of the radar itself in a mirror.

    In a mirror that faces it, the radar sees itself at twice the distance of the mirror: where the antennas sit on the
    surface of a body, that surface sends the wave that returns from the mirror back once more.
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
def hidden_at(begin, until, level, distance, direction):  # type: ignore[no-untyped-def]
    """The amplitude that an echo at one point must exceed to be seen, see `Cover`."""
    hidden = 0.0
    for k in range(begin.shape[0]):
        if begin[k, direction] > distance:
            break
        if distance < until[k, direction]:
            hidden = max(hidden, level[k, direction])
    return hidden
