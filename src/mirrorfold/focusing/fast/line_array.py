"""The fast algorithm of line arrays on a whole image ("polar").

The image is divided into sectors of range. Each sector that is faster than the exact kernel is imaged by way of a polar
grid of its own (`mirrorfold.focusing.lines`); all other pixels, above all those near the array, by the exact kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.memory import available_memory
from mirrorfold.common.threads import counted, one_thread
from mirrorfold.common.types import Index, Progress
from mirrorfold.focusing.echoes.range_gate import gated, gated_frequencies
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.lines.lattice import Lattice, build_lattice
from mirrorfold.focusing.lines.nodes import Sector, count_nodes
from mirrorfold.focusing.lines.sector import LineArraySector
from mirrorfold.focusing.lines.sector_design import SHARES, SectorDesign
from mirrorfold.focusing.predicting.cost import Cost, exact_cost, sector_cost
from mirrorfold.focusing.problem import Problem, UnsuitedError

SECTOR_EDGES = (1.5, 3.0, 6.0)
"""Ranges, in lengths of the array, at which a new sector begins; the exact kernel images all pixels nearer than the
first."""

FILTER_SHARE = 0.25
"""Share of the tolerance for the range gate that filters the samples for the near pixels."""

FEW = 8
"""Up to so many transmitters (or receivers) may be imaged one by one: then only the others need to stand on a line."""

LAYOUT_PIXELS = 80
"""Pixels along each axis, at most, that stand for all pixels while a plan is laid out."""

BYTES_A_PAIR = 200
MEMORY_SHARE = 0.5
"""Memory [bytes] for sorting one pair, and the largest share of the free memory that all pairs may take."""


@dataclass(frozen=True, eq=False)
class Part:
    """Some of the antennas, with the sectors that are faster than the exact kernel.

    Attributes
    ----------
    problem : Problem
        The problem with these antennas alone.
    tx, rx : int arrays
        Indices of these antennas.
    lattice : Lattice
    fast : tuple of int
        Sectors, each by the index of the edge at which it begins.
    """

    problem: Problem
    tx: Index
    rx: Index
    lattice: Lattice
    fast: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Layout:
    """The parts into which a problem is divided, and their predicted cost."""

    parts: tuple[Part, ...]
    cost: Cost


CostFunction = Callable[[Problem, float, float, int | None], Cost]
"""Cost of another algorithm, from the problem, the number of pixels, the tolerance, and the number of frequencies that
a range gate leaves (None without one)."""


def lay_out(problem: Problem, tolerance: float, remaining_cost: CostFunction | None = None, frames: int = 1) -> Layout:
    """The cheapest division of a problem into antennas and sectors, in some hundredths of a second.

    Parameters
    ----------
    problem : Problem
    tolerance : float
    remaining_cost : callable, optional
        Cost of the algorithm for the remaining pixels, by default the exact kernel; a sector that would cost more is
        left to this algorithm.
    frames : int, default 1
        Number of images that will be made: a sector must save the time of its tables over all of them.

    Raises
    ------
    UnsuitedError
        If no sector is faster than the exact kernel.
    """
    remaining_cost = remaining_cost or exact_cost
    if problem.pairs * BYTES_A_PAIR > MEMORY_SHARE * available_memory():
        raise UnsuitedError("the tables of so many pairs do not fit into memory")
    every = np.arange(len(problem.tx)), np.arange(len(problem.rx))
    divisions = [[every]]
    if not problem.monostatic and 2 <= min(map(len, every)) <= FEW:
        tx, rx = every
        divisions.append([(tx[[i]], rx) for i in tx] if len(tx) <= len(rx) else [(tx, rx[[k]]) for k in rx])
    layouts, reason = [], ""
    for division in divisions:
        try:
            parts, costs = zip(
                *(_part(problem, tx, rx, tolerance, remaining_cost, frames) for tx, rx in division), strict=True
            )
            layouts.append(Layout(parts, sum(costs, Cost())))
        except UnsuitedError as error:
            reason = str(error)
    if not layouts:
        raise UnsuitedError(reason)
    return min(layouts, key=lambda layout: layout.cost.processor_seconds(frames))


def _part(
    problem: Problem, tx: Index, rx: Index, tolerance: float, remaining_cost: CostFunction, frames: int
) -> tuple[Part, Cost]:
    """Some antennas with the sectors that cost less than the algorithm for remaining pixels, and the cost of all."""
    if max(tx.size, rx.size) < 3:
        raise UnsuitedError("two antennas make no line")
    problem = problem.of(tx, rx)
    lattice = build_lattice(problem)
    axes = [axis[_sample_indices(axis.size)] for axis in (problem.x, problem.y, problem.z)]
    coarse = problem.on(*axes)
    edges = _edges(problem, lattice)
    label, spans = _sectors(coarse, lattice, edges)
    pixels = np.bincount(label.ravel(), minlength=len(edges)) * (problem.pixels / coarse.pixels)
    fast: list[int] = []
    total, near, reason = Cost(), float(pixels[0]), "all pixels are too near"
    for n in range(1, len(edges) - 1):
        if not pixels[n]:
            continue
        try:
            design = SectorDesign(problem, lattice, spans[n], tolerance)
            nodes = count_nodes(problem, lattice, design.sector, SHARES["nodes"] * tolerance)
            cost = sector_cost(problem, lattice, design, nodes, pixels[n])
            other_cost = remaining_cost(problem, pixels[n], tolerance, None)
            if cost.processor_seconds(frames) > other_cost.processor_seconds(frames):
                raise UnsuitedError(f"{nodes} nodes are so many that the exact kernel is as fast")
            total, fast = total + cost, [*fast, n]
        except UnsuitedError as error:
            near, reason = near + pixels[n], str(error)
    if not fast:
        raise UnsuitedError(reason)
    if near:
        label[~np.isin(label, fast)] = 0
        z, y, x = _box(label.reshape(coarse.shape) == 0) or (slice(None),) * 3
        box = coarse.on(coarse.x[x], coarse.y[y], coarse.z[z])
        total = total + remaining_cost(problem, near, tolerance, gated_frequencies(box, FILTER_SHARE * tolerance))
    return Part(problem, tx, rx, lattice, tuple(fast)), total


class LineArrayPlan:
    """The fast algorithm of a line array on a whole image, by way of one polar grid for each sector of range.

    Parameters
    ----------
    problem : Problem
    tolerance : float
    layout : Layout, optional
        The layout of this problem; by default it is made.

    Raises
    ------
    UnsuitedError
        If the antennas do not stand on a line, or no sector has few enough nodes.
    """

    algorithm = "polar"

    def __init__(self, problem: Problem, tolerance: float, layout: Layout | None = None) -> None:
        self.problem, self.tolerance = problem, tolerance
        with one_thread():
            self.parts = [_PartPlan(part, tolerance) for part in (layout or self.lay_out(problem, tolerance)).parts]

    lay_out = staticmethod(lay_out)

    @property
    def nbytes(self) -> int:
        """Memory of the tables [bytes]."""
        return sum(sector.nbytes for sector in self.sectors)

    @property
    def sectors(self) -> list[LineArraySector]:
        """The sectors of all parts."""
        return [sector for part in self.parts for sector in part.sectors]

    def __call__(self, s: NDArray[np.complex64], progress: Progress | None = None) -> NDArray[np.complex64]:
        """Image (z, y, x) of one frame."""
        image = np.zeros(self.problem.shape, dtype=np.complex64)
        step = counted(progress, len(self.sectors) + len(self.parts))
        for part in self.parts:
            part(s, image, step)
        return image


class _PartPlan:
    """The sectors of some of the antennas with their tables, and the exact kernel on their near pixels."""

    def __init__(self, part: Part, tolerance: float) -> None:
        problem, lattice = part.problem, part.lattice
        self.part, self.tolerance = part, tolerance
        label, spans = _sectors(problem, lattice, _edges(problem, lattice))
        for n in set(range(len(spans))).difference(part.fast):
            label[label == n] = 0
        self.sectors: list[LineArraySector] = []
        for n in part.fast:
            runs = _runs(label, n)
            if not len(runs):
                continue
            try:
                design = SectorDesign(problem, lattice, spans[n], tolerance)
                self.sectors.append(LineArraySector(problem, lattice, design, runs, tolerance))
            except UnsuitedError:
                label[label == n] = 0
        if not self.sectors:
            raise UnsuitedError("no sector has few enough nodes")
        near = label.reshape(problem.shape) == 0
        self.box = _box(near)
        self.near = None if self.box is None else near[self.box]

    def __call__(self, s: NDArray[np.complex64], image: NDArray[np.complex64], step: Callable[[], None]) -> None:
        """Add the image by these antennas to `image` (z, y, x)."""
        part, problem = self.part, self.part.problem
        if problem.data_shape != s.shape:
            s = np.ascontiguousarray(s[:, part.tx[:, None], part.rx[None, :]])
        for sector in self.sectors:
            sector(s, image.reshape(-1, problem.x.size))
            step()
        if self.box is not None:
            z, y, x = self.box
            box, near = gated(problem.on(problem.x[x], problem.y[y], problem.z[z]), s, FILTER_SHARE * self.tolerance)
            image[self.box] += focus_exact(box, near, self.tolerance, where=self.near)
        step()


def _sample_indices(count: int) -> Index:
    """At most LAYOUT_PIXELS indices below `count`, evenly chosen, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, LAYOUT_PIXELS)).round().astype(np.intp))


def _edges(problem: Problem, lattice: Lattice) -> list[float]:
    """Ranges [m] at which sectors begin, first that of the near pixels (zero); and the end of the last sector."""
    length = lattice.length(problem)
    return [0.0, *(length * edge for edge in SECTOR_EDGES), float("inf")]


def _sectors(problem: Problem, lattice: Lattice, edges: list[float]) -> tuple[NDArray[np.int8], list[Sector]]:
    """Index of the sector of every pixel, (rows, x), and the extent of each sector."""
    rows = problem.z.size * problem.y.size
    label = np.empty((rows, problem.x.size), dtype=np.int8)
    spans = [Sector(np.inf, 0.0, np.inf, -np.inf) for _ in edges]
    for row in range(rows):
        r, w = lattice.polar(problem.x, problem.y[row % problem.y.size], problem.z[row // problem.y.size])
        first, last = np.searchsorted(edges, (r.min(), r.max()), side="right") - 1
        label[row] = last
        for n in range(last - 1, first - 1, -1):
            label[row, r < edges[n + 1]] = n
        for n in (last,) if first == last else np.unique(label[row]):
            mine = slice(None) if first == last else label[row] == n
            a, b, c, d = spans[n]
            r_mine, w_mine = r[mine], w[mine]
            spans[n] = Sector(min(a, r_mine.min()), max(b, r_mine.max()), min(c, w_mine.min()), max(d, w_mine.max()))
    return label, spans


def _runs(label: NDArray[np.int8], n: int) -> NDArray[np.int64]:
    """Runs (row, start, stop) of pixels with label n."""
    mine = np.zeros((label.shape[0], label.shape[1] + 2), dtype=np.int8)
    mine[:, 1:-1] = label == n
    change = np.diff(mine, axis=1)
    row, start = np.nonzero(change == 1)
    _, stop = np.nonzero(change == -1)
    return np.stack([row, start, stop], axis=1).astype(np.int64)


def _box(mask: NDArray[np.bool_]) -> tuple[slice, slice, slice] | None:
    """The smallest box (z, y, x) that holds all true pixels."""
    if not mask.any():
        return None
    ends = [np.flatnonzero(mask.any(axis=tuple(a for a in range(3) if a != axis))) for axis in range(3)]
    z, y, x = (slice(int(end[0]), int(end[-1]) + 1) for end in ends)
    return z, y, x
