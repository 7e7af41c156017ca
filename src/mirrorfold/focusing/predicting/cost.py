"""Predicted cost of focusing: time and memory, from the counts of its loops and the speed of the machine.

Every formula counts the steps of one algorithm, in the order of its file, and multiplies each count by the seconds that
`machine` has measured for such a step. All cores share the work, except for building a plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.threads import cpu_count
from mirrorfold.focusing.exact.accuracy import TEST_PIXELS
from mirrorfold.focusing.exact.exact_sum import TABLE_BYTES, tile_pixels
from mirrorfold.focusing.exact.pair_sums import PIXELS_A_BLOCK
from mirrorfold.focusing.exact.range_tables import TERMS, table_cells
from mirrorfold.focusing.lines.lattice import Lattice
from mirrorfold.focusing.lines.nodes import (
    CANDIDATES,
    CANDIDATES_A_RADIAN,
    END_SAMPLES,
    EQUATIONS,
    PAIR_SAMPLES,
    PAIRS_A_RADIAN,
    SPARE_EQUATIONS,
    table_size,
)
from mirrorfold.focusing.lines.sector_design import SectorDesign
from mirrorfold.focusing.predicting.machine import machine
from mirrorfold.focusing.problem import Problem

NUMBERS_A_PATH = 2.5
"""Time of NumPy for the path of a pair by way of a pixel, and its phase factor, over that of a complex exponential."""

PASSES = 1.7
"""Time of building a plan over that of its arithmetic alone: NumPy goes through memory many times."""

FROM_MEMORY = 1.2
"""Time of sorting, transforming and resampling a whole sweep over that of pieces that stay in the caches, as timed."""

REFINED = 60.0
"""With so many nodes, the table of V is made twice on average: the more nodes, the more often the first table is too
coarse."""

CALL = 2e-3
"""Time of a step beside its loops, in Python and for starting threads [s]."""

TILE_CALL = 1.3e-4
"""Time of a tile of the exact kernel beside its loops [s]: as much as its sum over a hundred pairs."""


@dataclass(frozen=True)
class Cost:
    """Processor time and memory.

    Attributes
    ----------
    building : float [s]
        Time of building the plan, on one core.
    frame : float [s]
        Processor time of each image, of all cores together.
    nbytes : float
        Memory of tables and buffers [bytes].
    """

    building: float = 0.0
    frame: float = 0.0
    nbytes: float = 0.0

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.building + other.building, self.frame + other.frame, self.nbytes + other.nbytes)

    def seconds(self, frames: int = 1) -> float:
        """Elapsed time [s] of building the plan and imaging `frames` frames, where all cores are idle."""
        return self.building + frames * self.frame / cpu_count()

    def processor_seconds(self, frames: int = 1) -> float:
        """Processor time [s] of the same, of all cores together."""
        return self.building + frames * self.frame


def exact_cost(problem: Problem, pixels: float, tolerance: float, frequencies: int | None = None) -> Cost:
    """Cost of the exact kernel on a number of pixels; `frequencies` is the number that a range gate leaves, if used."""
    taper = problem.taper if frequencies is None else np.ones(frequencies, dtype=np.complex128)
    cells = exact_cells(taper, tolerance)
    folded = problem.coincident and not problem.monostatic
    pairs = (problem.pairs + len(problem.tx)) / 2 if folded else problem.pairs
    chunks = ceil(pairs * cells * TERMS * 8 / TABLE_BYTES)
    tables = problem.antennas * (1 if problem.monostatic else chunks)
    memory = TABLE_BYTES if chunks > 1 else pairs * cells * TERMS * 8
    calls = chunks * pixels / tile_pixels(problem) * TILE_CALL
    return Cost(0.0, exact_seconds(cells, pairs, tables, pixels) + calls, memory)


def pair_sums_cost(problem: Problem, pixels: float, tolerance: float, frequencies: int | None = None) -> Cost:
    """Cost of the matrix products of `pair_sums` on a number of pixels: for any tolerance, and without a range gate."""
    speed = machine()
    each = 4.0 * problem.pairs * speed.multiply + problem.antennas * speed.table
    return Cost(0.0, CALL + problem.k.size * pixels * each, 8.0 * problem.antennas * PIXELS_A_BLOCK * cpu_count())


def exact_seconds(cells: int, pairs: float, antennas: float, pixels: float) -> float:
    """Processor time [s] of the exact kernel: range tables of the pairs, tables of the antennas on the pixels, sum."""
    speed = machine()
    return CALL + pairs * cells * TERMS * speed.compress + pixels * (antennas * speed.table + pairs * speed.pair_pixel)


def exact_cells(taper: NDArray[np.complex128], tolerance: float) -> int:
    """Cells of a pair's table, `table_cells` with a cache: every block of a divided array needs them again."""
    return _cells(taper.tobytes(), tolerance)


@lru_cache(maxsize=64)
def _cells(taper: bytes, tolerance: float) -> int:
    """Cells of a pair's table."""
    return table_cells(np.frombuffer(taper, dtype=np.complex128), tolerance)


def sector_cost(problem: Problem, lattice: Lattice, design: SectorDesign, nodes: int, pixels: float) -> Cost:
    """Cost of one sector of a line array, with `nodes` nodes and `pixels` pixels."""
    speed = machine()
    frequencies, pairs = problem.k.size, lattice.tx.size
    lines, rows = design.shape
    taps = design.stretch_kernel.width
    gather = frequencies * pairs * (2 if lattice.folded else 1) * speed.gather
    products = frequencies * 4 * nodes * (pairs * speed.collapse + lattice.points * nodes * speed.multiply)
    transforms = (
        nodes
        * speed.fourier
        * (frequencies * design.cells * log2(design.cells) + lines * design.range_cells * log2(design.range_cells))
    )
    stretch = frequencies * lines * nodes * (taps + 1) * speed.stretch
    combine = lines * rows * nodes * speed.combine
    final = pixels * (speed.pixel + design.range_kernel.width * design.direction_kernel.width * speed.tap)
    if lattice.planar:
        final += pixels * speed.number
    frame = CALL + FROM_MEMORY * (gather + transforms + stretch + combine) + products + final
    return Cost(_building(problem, lattice, design, nodes, pixels), frame, _nbytes(problem, lattice, design, nodes))


def _building(problem: Problem, lattice: Lattice, design: SectorDesign, nodes: int, pixels: float) -> float:
    """Time [s] of making the tables of a sector."""
    speed = machine()
    lines, rows = design.shape
    phase = problem.middle_wavenumber * design.curvature / design.sector.near
    samples = PAIR_SAMPLES + PAIRS_A_RADIAN * phase + END_SAMPLES**2
    candidates = CANDIDATES + CANDIDATES_A_RADIAN * phase
    pivoting = samples * candidates * (NUMBERS_A_PATH * speed.number + nodes * speed.combine)
    n_r, n_w = table_size(problem, design.sector, design.slopes)
    values = (
        (1.0 + nodes / REFINED)
        * n_r
        * n_w
        * (EQUATIONS * nodes + SPARE_EQUATIONS)
        * (NUMBERS_A_PATH * speed.number + nodes * 4 * speed.multiply)
    )
    table = lines * rows * nodes * (2 * n_w * speed.multiply + speed.stretch)
    weights = problem.k.size * lines * design.stretch_kernel.width * 10 * speed.stretch / 4
    factors = lattice.tx.size * nodes * NUMBERS_A_PATH * speed.number
    return 10 * CALL + PASSES * (pivoting + values + table + weights + factors + pixels * speed.number)


def _nbytes(problem: Problem, lattice: Lattice, design: SectorDesign, nodes: int) -> float:
    """Memory [bytes] of a sector's tables and buffers."""
    lines, rows = design.shape
    frequencies = problem.k.size
    tables = 8 * lines * rows * nodes + 16 * nodes * (lattice.tx.size + frequencies * nodes)
    tables += frequencies * lines * (4 * design.stretch_kernel.width + 4)
    return tables + 8 * (frequencies * lines * nodes + lines * rows + 16 * cpu_count() * design.range_cells * nodes)


def proof_cost(problem: Problem) -> Cost:
    """Cost of comparing an image with the direct sum on random pixels."""
    speed = machine()
    pairs = problem.pairs * problem.k.size * TEST_PIXELS * 0.5 * speed.stretch
    phases = problem.antennas * problem.k.size * TEST_PIXELS * 2.0 * speed.number
    return Cost(0.0, CALL + pairs + phases + 0.5 * problem.pixels * speed.number, 40 * problem.pixels)
