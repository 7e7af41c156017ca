"""One sector of the image of a line array: from pairs to the lattice, to a polar grid, and to pixels.

With the nodes q of the sector (see `nodes`), the image at range r and direction w, u its cosine to the lattice, is::

    I(r, w) = sum_m a[m] exp(2 j k_m r) sum_q V_q(r, w) sum_q' W_q'q(k_m) sum_s exp(-2 j k_m X_s u) D_q'(s, m),
    D_q'(s, m) = sum over the pairs (i, k) at lattice point s of  w_i v_k S[m, i, k] exp(j k_q' E(i, k; p_q')).

`LineArraySector.__call__` computes this from right to left: D by a matrix product for each lattice point, and the sum
over s by a Fourier transform whose result is interpolated to the directions u at each frequency (`to_directions`); the
sum over m by a second transform (`to_ranges`); and the pixels by interpolation on the polar grid (`to_pixels`).
"""

from __future__ import annotations

from math import ceil, pi

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from mirrorfold.common.threads import Buffers, cpu_count, for_each
from mirrorfold.common.types import Array
from mirrorfold.focusing.lines import kernels
from mirrorfold.focusing.lines.interpolation import weights_at
from mirrorfold.focusing.lines.lattice import Lattice
from mirrorfold.focusing.lines.nodes import Nodes, chebyshev_matrix, find_nodes, remainder
from mirrorfold.focusing.lines.sector_design import SHARES, SectorDesign
from mirrorfold.focusing.problem import Problem

FREQUENCIES_A_BLOCK = 26
LINES_A_BLOCK = 16
RUNS_A_BLOCK = 48
"""Numbers of frequencies (at most), lines of equal direction, and runs of pixels that a thread works on at a time."""

SERIAL_PRODUCT = 250_000
"""Multiplications of a matrix product up to which OpenBLAS stays on the calling thread. Larger products would start
threads of their own, which compete with ours for the cores."""

CACHE_BYTES = 512 * 2**10
"""Part of the second-level cache [bytes] for the Fourier transforms of a few frequencies."""


class LineArraySector:
    """One sector with all its tables. A call adds the image by the antennas to the pixels of this sector only.

    Parameters
    ----------
    problem : Problem
    lattice : Lattice
    design : SectorDesign
    runs : (n, 3) int array
        Pixels of the sector, in runs: row (z, y), index of the first x, index of the last x plus one.
    tolerance : float

    Raises
    ------
    UnsuitedError
        If the sector has too many nodes.
    """

    def __init__(
        self, problem: Problem, lattice: Lattice, design: SectorDesign, runs: NDArray[np.int64], tolerance: float
    ) -> None:
        self.problem, self.lattice, self.design, self.runs = problem, lattice, design, runs
        k = problem.k
        middle = k.size // 2
        self.middle = middle
        # Pixels and polar grid: arguments of `interpolate` and its transpose.
        self.pixels = (
            *(problem.x, problem.y, problem.z, lattice.centre, lattice.frame, lattice.foci, lattice.planar),
            *(design.per_range, design.row_first, design.per_direction, design.line_first),
            *(float(k[middle]) / pi, 0.5 * design.curvature),
        )
        self.taps = design.range_kernel.coefficients, design.direction_kernel.coefficients
        nodes = find_nodes(problem, lattice, design.sector, SHARES["nodes"] * tolerance, design.slopes)
        self.nodes = nodes.range.size
        self.predicted_error = float(np.hypot(nodes.error, design.interpolation_error))
        # The tables, in the order of the steps of a call.
        u, _ = lattice.direction(design.directions)
        position = (k * lattice.pitch * design.cells / pi)[:, None] * u[None, :]
        first_tap, self.weight = weights_at(design.stretch_kernel, position)
        self.cell = (first_tap % design.cells).astype(np.int32)
        all_pairs = np.arange(lattice.tx.size)
        remainders = remainder(problem, lattice, all_pairs, nodes.range, nodes.direction)
        omega = 2.0 * pi / design.cells * lattice.point_of_pair / lattice.pitch
        prefilter = design.stretch_kernel.factor_at(omega)
        factor = np.exp(1j * nodes.wavenumber * remainders) * (lattice.weight * prefilter)[:, None]
        self.factor = _as_real(factor)
        self.transfer = _as_real(nodes.transfer * problem.taper[:, None, None])
        self.value = self._values(nodes, u)
        receivers = len(problem.rx)
        if problem.monostatic:
            self.pair, self.partner = lattice.tx, lattice.tx
        else:
            self.pair, self.partner = lattice.tx * receivers + lattice.rx, lattice.rx * receivers + lattice.tx
        self._make_buffers()

    def _values(self, nodes: Nodes, u: Array) -> NDArray[np.complex64]:
        """V_q(r, w) at all lines, with cosines `u` (lines,), and rows of the polar grid, (lines, rows, nodes)."""
        design, k = self.design, self.problem.k
        at_w, at_r = design.directions, np.maximum(design.ranges, design.sector.near)
        n_r, n_w, _ = nodes.value.shape
        to_r = chebyshev_matrix(nodes.inverse_low, nodes.inverse_high, n_r, 1.0 / at_r)
        to_w = chebyshev_matrix(float(at_w[0]), float(at_w[-1]), n_w, at_w)
        inner = np.tensordot(nodes.value, to_r, axes=(0, 1)).transpose(0, 2, 1)  # (w node, row, node)
        inner = np.ascontiguousarray(inner, dtype=np.complex64).reshape(n_w, -1).view(np.float32)
        found = np.empty((*design.shape, self.nodes), dtype=np.complex64)
        to_w = to_w.astype(np.float32)
        turns = float(k[self.middle]) * design.curvature / (2.0 * pi)

        def tabulate(first: int) -> None:
            part = slice(first, min(first + LINES_A_BLOCK, len(found)))
            value = found[part]
            np.matmul(to_w[part], inner, out=value.reshape(len(value), -1).view(np.float32))
            value *= np.exp(-2j * pi * turns * (1.0 - u[part, None] ** 2) / at_r)[..., None].astype(np.complex64)

        for_each(tabulate, range(0, len(found), LINES_A_BLOCK))
        return found

    def _make_buffers(self) -> None:
        """Buffers of the steps of a call, and the number of frequencies that one step takes at a time."""
        problem, lattice, design = self.problem, self.lattice, self.design
        frequencies, lines = problem.k.size, design.shape[0]
        # Equal blocks of frequencies, a few for each core, with products so small that BLAS keeps each on one core.
        longest = 2 * int(np.diff(lattice.first).max())
        most = max(1, min(FREQUENCIES_A_BLOCK, SERIAL_PRODUCT // (longest * 2 * self.nodes)))
        blocks = 2 * cpu_count() * ceil(frequencies / (2 * cpu_count() * most))
        self.block = ceil(frequencies / blocks)
        self._gathered = Buffers((self.block * lattice.tx.size,))
        self._summed = Buffers((lattice.points * self.block * 2 * self.nodes,), np.float32)
        at_once = min(self.block, max(1, CACHE_BYTES // (8 * design.cells * self.nodes)))
        self._spectrum = Buffers((at_once, design.cells, self.nodes))
        self._beams = Buffers((frequencies, lines, self.nodes))
        self._profile = Buffers((design.range_cells, LINES_A_BLOCK, self.nodes))
        self._polar = Buffers(design.shape)

    @property
    def nbytes(self) -> int:
        """Memory of the tables [bytes]."""
        tables = (self.factor, self.transfer, self.value, self.pair, self.partner, self.runs, self.weight)
        return sum(table.nbytes for table in tables)

    def __call__(self, s: NDArray[np.complex64], image: NDArray[np.complex64]) -> None:
        """Add the image of samples `s` (frequencies, ...) to the sector's pixels of `image` (rows, x)."""
        problem, lattice, design = self.problem, self.lattice, self.design
        frequencies = problem.k.size
        data = s.reshape(frequencies, -1)
        lines, _ = design.shape
        zero = -lattice.lowest
        limit = max(1, SERIAL_PRODUCT // (2 * self.nodes) ** 2)
        row_parts = [(a, b) for low, high in ((0, zero), (zero, lattice.points)) for a, b in _parts(low, high, limit)]

        def to_directions(first: int) -> None:
            part = slice(first, min(first + self.block, frequencies))
            count = part.stop - part.start
            with self._gathered.one() as gathered, self._summed.one() as summed, self._spectrum.one() as buffer:
                gathered = gathered[: count * lattice.tx.size]
                size = (lattice.points, count, 2 * self.nodes)
                summed = summed[: lattice.points * count * 2 * self.nodes].reshape(size)
                kernels.gather(data[part], self.pair, self.partner, lattice.folded, lattice.first, gathered)
                kernels.collapse(gathered.view(np.float32), self.factor, lattice.first, count, summed)
                columns = summed.transpose(1, 0, 2)
                for low, high in _parts(0, count, len(buffer)):
                    some = slice(first + low, first + high)
                    spectrum = buffer[: high - low]
                    real = spectrum.view(np.float32)
                    spectrum[:, lattice.points - zero : design.cells - zero] = 0.0
                    for a, b in row_parts:
                        to = (a - zero) % design.cells
                        np.matmul(columns[low:high, a:b], self.transfer[some], out=real[:, to : to + b - a])
                    spectrum = scipy.fft.fft(spectrum, axis=1, overwrite_x=True)
                    kernels.stretcher(design.stretch_kernel.width)(
                        spectrum.view(np.float32), self.cell[some], self.weight[some], beams.view(np.float32)[some]
                    )

        def to_ranges(first: int) -> None:
            part = slice(first, min(first + LINES_A_BLOCK, lines))
            with self._profile.one() as profile:
                profile = profile[:, : part.stop - part.start]
                profile[: frequencies - self.middle] = beams[self.middle :, part]
                profile[frequencies - self.middle : design.range_cells - self.middle] = 0.0
                profile[design.range_cells - self.middle :] = beams[: self.middle, part]
                profile = scipy.fft.ifft(profile, axis=0, norm="forward", overwrite_x=True)
                kernels.combine(profile, self.value[part], design.row_first, polar[part])

        def to_pixels(first: int) -> None:
            runs = self.runs[first : first + RUNS_A_BLOCK]
            kernels.interpolator(len(self.taps[0]))(runs, self.pixels, polar, self.taps, image)

        with self._beams.one() as beams, self._polar.one() as polar:
            for_each(to_directions, range(0, frequencies, self.block))
            for_each(to_ranges, range(0, lines, LINES_A_BLOCK))
            for_each(to_pixels, range(0, len(self.runs), RUNS_A_BLOCK))


def _as_real(matrix: NDArray[np.complex128]) -> NDArray[np.float32]:
    """The real matrix (..., 2n, 2m) that acts on interleaved real and imaginary parts as the complex one (..., n, m).

    Real products are faster than complex ones, and stay on the calling thread up to larger sizes.
    """
    real = np.empty((*matrix.shape[:-2], 2 * matrix.shape[-2], 2 * matrix.shape[-1]), dtype=np.float32)
    real[..., 0::2, 0::2] = real[..., 1::2, 1::2] = matrix.real
    real[..., 0::2, 1::2] = matrix.imag
    real[..., 1::2, 0::2] = -matrix.imag
    return real


def _parts(low: int, high: int, most: int) -> list[tuple[int, int]]:
    """The interval [low, high) cut into parts of length `most` or less."""
    return [(a, min(a + most, high)) for a in range(low, high, most)]
