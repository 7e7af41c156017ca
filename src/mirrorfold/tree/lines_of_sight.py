"""Step 3: every line of sight of the radar, the worlds that mirrors open along it, and what ends it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mirrorfold.detection.image_echoes import Echoes
from mirrorfold.detection.image_view import SAMPLES_PER_CELL, PolarImage

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

OPAQUE_CELLS = 2.5
"""Depth of an object in range cells: what lies further behind its first echo is multiple scattering."""

COVERED_CELLS = 0.75
"""Directions to either side of an object, in resolution cells, that it hides: there its beam has fallen by 14 dB. Up to
the nulls, at a whole cell, small things would hide each other's halves."""

OPEN_MARGIN = 0.1
"""The radar's own view is taken to be open up to this distance [m] before and beside each echo in it: an object that
shows its edge may show its face by way of a mirror only."""

EDGE_COLUMNS = 2 * SAMPLES_PER_CELL
"""Directions this far from the edge of what a mirror shows: the main lobe of a beam there reaches over the edge."""

CLEAR_DB = 20.0
"""An echo this much stronger than all objects in front of it is a thing: speckle fades by up to 20 dB, and multiple
scattering is weaker than what scatters, but the glint of a corner outshines the edge of its own leg by 40 dB."""

NOBODY = -2

ROOT = -1


@dataclass(frozen=True, eq=False)
class Views:
    """Every line of sight of the radar, by direction.

    Attributes
    ----------
    u : (nu,) array
    crossing : (mirrors, nu) array [m]
        Range at which the line of sight meets each mirror; infinite where it passes it by.
    parent : (mirrors,) array
        The mirror through which each is seen, or ROOT.
    chain : tuple of tuple of int
        Chain of each mirror's node in the tree; empty for mirrors that are not in it.
    range : (nr,) array [m]
    barrier : (nr, nu) array
        Amplitude that an echo must exceed to be a thing; zero where no object stands in front.
    open : (nu,) array [m]
        Range up to which the radar would see a thing itself, and sees none; empty where that was not looked at.
    """

    u: Array
    crossing: Array
    parent: Index
    range: Array
    barrier: Array
    chain: tuple[tuple[int, ...], ...] = ()
    open: Array = field(default_factory=lambda: np.zeros(0))

    def column(self, u: Array) -> Index:
        """Index of the direction nearest to u."""
        return np.clip(np.rint((u - self.u[0]) / (self.u[1] - self.u[0])).astype(np.intp), 0, self.u.size - 1)

    def clear(self, range_: Array, column: Index, amplitude: Array | float) -> Mask:
        """Whether an echo of that amplitude is a thing, and not multiple scattering of an object in front of it."""
        step = self.range[1] - self.range[0]
        row = np.clip(((range_ - self.range[0]) / step).astype(np.intp), 0, self.range.size - 1)
        return np.asarray(amplitude > self.barrier[row, column])

    @cached_property
    def _worlds(self) -> tuple[Array, Index]:
        """Crossings of every line of sight from the nearest outward, (depth, nu), and what is seen after each.

        A crossing opens a mirror's world only where its parent's is open.
        """
        depth = int(np.isfinite(self.crossing).sum(axis=0).max(initial=0))
        order = np.argsort(self.crossing, axis=0)[:depth]
        opened = np.full((depth + 1, self.u.size), ROOT, dtype=np.intp)
        for i, mirror in enumerate(order):
            opened[i + 1] = np.where(opened[i] == self.parent[mirror], mirror, NOBODY)
        return np.take_along_axis(self.crossing, order, axis=0), opened

    def contradicted(self, range_: Array, column: Index, true_range: Array, true_u: Array) -> Mask:
        """Whether echoes at the edge of what their mirror shows would stand where the radar itself sees nothing.

        A beam that straddles the edge shows what is beside it, too. `true_range` and `true_u` (NaN: behind the radar)
        tell where the echoes would stand.
        """
        if not self.open.size:
            return np.zeros(range_.shape, dtype=bool)
        inside = np.abs(true_u) <= self.u[-1]
        at = self.column(np.where(inside, true_u, 0.0))
        empty = inside & (true_range >= self.range[0]) & (true_range < self.open[at])
        world = self.seen_through(range_, column)
        sides = (np.clip(column + step, 0, self.u.size - 1) for step in (-EDGE_COLUMNS, EDGE_COLUMNS))
        return empty & np.logical_or.reduce([self.seen_through(range_, side) != world for side in sides])

    def seen_through(self, range_: Array, column: Index) -> Index:
        """The mirror through which a point at that range and direction is seen: ROOT, NOBODY or its number."""
        crossing, opened = self._worlds
        passed = np.zeros(range_.shape, dtype=np.intp)
        for ranges in crossing:
            passed += ranges[column] < range_
        return np.asarray(opened[passed, column])

    def region(self, mirror: int) -> Array:
        """Outline (n, 2) of all that may be seen through a mirror: range [m] and u."""
        columns = np.flatnonzero(np.isfinite(self.crossing[mirror]))
        half = 0.5 * (self.u[1] - self.u[0])
        edges = [
            np.stack(np.broadcast_arrays(range_, self.u[columns] + side), axis=-1)
            for range_ in (self.crossing[mirror, columns], self.range[-1])
            for side in (-half, half)
        ]
        return np.concatenate(edges)


def barrier_of(objects: Echoes, polar: PolarImage) -> Array:
    """Amplitude that echoes must exceed for the objects in front of them, (nr, nu).

    An object covers the directions up to `COVERED_CELLS` beside it, and begins to hide what is behind it at
    `OPAQUE_CELLS` range cells. It hides what is not much stronger than itself.
    """
    barrier = np.zeros_like(polar.amplitude)
    row = np.ceil((objects.range + OPAQUE_CELLS * polar.range_cell - polar.range[0]) / polar.dr).astype(np.intp)
    first = np.searchsorted(polar.u, objects.u - COVERED_CELLS * polar.u_cell)
    last = np.searchsorted(polar.u, objects.u + COVERED_CELLS * polar.u_cell)
    for i in np.flatnonzero(row < polar.range.size):
        cells = barrier[row[i], first[i] : last[i]]
        np.maximum(cells, 10.0 ** (CLEAR_DB / 20.0) * objects.amplitude[i], out=cells)
    return np.maximum.accumulate(barrier, axis=0)


def open_range(views: Views, echoes: Echoes, polar: PolarImage) -> Array:
    """Range up to which each direction of the radar's own view is empty, (nu,) [m].

    The radar looks at least as far aside as the echo that is farthest from broadside; beyond, its antennas may be deaf.
    """
    nearest = views.crossing.min(axis=0, initial=np.inf)
    met = np.isfinite(nearest)
    direct = views.seen_through(echoes.range, views.column(echoes.u)) == ROOT
    range_ = np.concatenate([echoes.range[direct], nearest[met]])
    u = np.concatenate([echoes.u[direct], views.u[met]])
    field_of_view = np.abs(echoes.u[echoes.strong]).max(initial=0.0)
    empty = np.where(np.abs(views.u) <= field_of_view, polar.range[-1], 0.0)
    aside = np.maximum(OPEN_MARGIN / range_, polar.u_cell)
    first, last = np.searchsorted(views.u, u - aside), np.searchsorted(views.u, u + aside)
    for i in range(range_.size):
        part = empty[first[i] : last[i]]
        np.minimum(part, range_[i] - OPEN_MARGIN, out=part)
    return empty
