"""The fast path of line arrays on a whole image: sectors of range, and nearer pixels by the exact kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Progress
from mirrorfold.focusing.exact import focus_exact
from mirrorfold.focusing.lattice import Lattice, across, build_lattice, line_of, natural_pitch
from mirrorfold.focusing.line_sector import LineArraySector
from mirrorfold.focusing.nodes import Sector, UnsuitedError
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.range_gate import gated

SECTOR_EDGES = (1.5, 3.0, 6.0)
"""Ranges, in lengths of the array, at which a new sector begins; nearer than the first the exact kernel is used."""

FEWEST_PAIR_PIXELS = 1.5e8
"""A sector with fewer pairs times pixels than this is left to the exact kernel, unless it is the largest."""

FILTER_SHARE = 0.25
"""Share of the tolerance for the filter that prepares the data for near pixels."""

OFF_LINE_TOLERANCE = 1e-7
"""Distance [m] of antennas from their line that has no effect on the image: 1e-3 rad at 1 THz."""

LARGEST_DEVIATION = 0.5
"""Distance of antennas from their line, in wavelengths, up to which the fast path is tried."""


class LineArrayPlan:
    """The fast path of a line array on a whole image, through one polar grid for each sector of range.

    Raises
    ------
    UnsuitedError
        If the antennas do not stand on a line, or no sector has few enough nodes.
    """

    algorithm = "polar"

    def __init__(self, problem: Problem, tolerance: float) -> None:
        if not on_a_line(problem):
            raise UnsuitedError("the antennas do not stand on a line")
        self.problem = problem
        _, axis, _ = line_of(problem)
        lattice = build_lattice(problem, natural_pitch(problem, axis))
        self.lattice = lattice
        _, upward = across(lattice)
        height = float(np.array([problem.x[0], problem.y[0], problem.z[0]]) @ upward - lattice.centre @ upward)
        length = np.ptp(np.concatenate([problem.tx, problem.rx]) @ axis)
        edges = [0.0, *(length * e for e in SECTOR_EDGES), float("inf")]
        label, span = _sectors(problem, lattice, edges)
        # A sector of few pixels is not worth its tables.
        sizes = np.bincount(label.ravel(), minlength=len(edges))[1:]
        small = 1 + np.flatnonzero((sizes * lattice.tx.size < FEWEST_PAIR_PIXELS) & (sizes < sizes.max()))
        label[np.isin(label, small)] = 0
        self.sectors: list[LineArraySector] = []
        for n in range(1, len(edges) - 1):
            runs = _runs(label, n)
            if not len(runs):
                continue
            try:
                self.sectors.append(LineArraySector(problem, lattice, Sector(*span[n]), height, runs, tolerance))
            except UnsuitedError:
                label[label == n] = 0
        if not self.sectors:
            raise UnsuitedError("no sector has few enough nodes")
        self.near_box = _box(label.reshape(problem.shape) == 0)
        self.near = label.reshape(problem.shape) == 0 if self.near_box is not None else None
        self.tolerance = tolerance

    @property
    def nbytes(self) -> int:
        """Memory of the tables [bytes]."""
        return sum(sector.nbytes for sector in self.sectors)

    def __call__(self, s: NDArray[np.complex64], progress: Progress | None = None) -> NDArray[np.complex64]:
        """Image (z, y, x) of one frame."""
        problem = self.problem
        image = np.zeros(problem.shape, dtype=np.complex64)
        parts = len(self.sectors) + 1
        for n, sector in enumerate(self.sectors):
            sector(s, image.reshape(-1, problem.x.size))
            if progress is not None:
                progress(n + 1, parts)
        if self.near_box is not None and self.near is not None:
            z, y, x = self.near_box
            box, wanted = problem.on(problem.x[x], problem.y[y], problem.z[z]), self.near[self.near_box]
            box, near = gated(box, s, FILTER_SHARE * self.tolerance)
            image[self.near_box] += focus_exact(box, near, self.tolerance, where=wanted)
        if progress is not None:
            progress(parts, parts)
        return image


def _sectors(
    problem: Problem, lattice: Lattice, edges: list[float]
) -> tuple[NDArray[np.int8], list[tuple[float, float, float, float]]]:
    """Sector of every pixel, (rows, x), and the extent (near, far, lowest u, highest u) of each."""
    rows = problem.z.size * problem.y.size
    label = np.empty((rows, problem.x.size), dtype=np.int8)
    span = [(np.inf, 0.0, np.inf, -np.inf) for _ in edges]
    dx = problem.x - lattice.centre[0]
    for row in range(rows):
        dy = problem.y[row % problem.y.size] - lattice.centre[1]
        dz = problem.z[row // problem.y.size] - lattice.centre[2]
        r = np.sqrt(dx * dx + (dy * dy + dz * dz))
        u = (dx * lattice.axis[0] + (dy * lattice.axis[1] + dz * lattice.axis[2])) / np.maximum(r, 1e-12)
        first, last = np.searchsorted(edges, (r.min(), r.max()), side="right") - 1
        label[row] = last
        for n in range(last - 1, first - 1, -1):
            label[row, r < edges[n + 1]] = n
        for n in (last,) if first == last else np.unique(label[row]):
            mine = slice(None) if first == last else label[row] == n
            a, b, c, d = span[n]
            span[n] = (min(a, r[mine].min()), max(b, r[mine].max()), min(c, u[mine].min()), max(d, u[mine].max()))
    return label, span


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
    return (
        slice(int(ends[0][0]), int(ends[0][-1]) + 1),
        slice(int(ends[1][0]), int(ends[1][-1]) + 1),
        slice(int(ends[2][0]), int(ends[2][-1]) + 1),
    )


def on_a_line(problem: Problem) -> bool:
    """Whether the antennas stand on a line, and the pixels where the fast path can see them."""
    if (problem.monostatic and len(problem.tx) < 3) or max(len(problem.tx), len(problem.rx)) < 3:
        return False
    centre, axis, off = line_of(problem)
    if np.ptp(np.concatenate([problem.tx, problem.rx]) @ axis) == 0.0 or natural_pitch(problem, axis) == 0.0:
        return False
    if off < OFF_LINE_TOLERANCE:
        return True
    wavelength = 2.0 * np.pi / float(problem.k[-1])
    if off > LARGEST_DEVIATION * wavelength or problem.z.size > 1 or abs(axis[2]) > 1e-9:
        return False
    # Antennas off the line tell its two sides apart: all pixels must be on the one ahead.
    forward = np.array([-axis[1], axis[0], 0.0]) * np.sign(axis[0] if abs(axis[1]) <= 0.9 else -axis[1])
    corners = np.array([[x, y, problem.z[0]] for x in problem.x[[0, -1]] for y in problem.y[[0, -1]]])
    return bool(((corners - centre) @ forward > 0.0).all())
