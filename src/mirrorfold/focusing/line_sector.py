"""One sector of the image of a line array: from pairs to a lattice, from the lattice to a polar grid, and to pixels.

With the nodes of the sector (see `nodes`), the image at range r and cosine u is::

    I(r, u) = sum_m a[m] exp(2 j k_m r) sum_q V_q(r, u) sum_q' W_q'q(k_m) sum_s exp(-2 j k_m X_s u) D_q'(s, m),
    D_q'(s, m) = sum over the pairs at lattice point s of  w v S[m, pair] exp(j k_c E(pair; p_q')).

`LineArraySector.__call__` computes it from right to left: D by a matrix product for each lattice point (`to_cosines`),
the sum over s by a Fourier transform that is interpolated to the wanted u, the sum over m by another one (`to_ranges`),
and the pixels by interpolation between the points of the polar grid (`to_pixels`).
"""

from __future__ import annotations

from math import ceil, floor, pi

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from mirrorfold.common.threads import Buffers, cpu_count, for_each
from mirrorfold.focusing import line_kernels as kernels
from mirrorfold.focusing.interpolation import taper_kernel, triangular_kernel, weights_at
from mirrorfold.focusing.lattice import Lattice
from mirrorfold.focusing.nodes import Sector, chebyshev_matrix, find_nodes, remainder, spreads, warp
from mirrorfold.focusing.problem import Problem

FREQUENCIES_A_BLOCK = 26
LINES_A_BLOCK = 16
RUNS_A_BLOCK = 48
"""Frequencies (at most), lines of equal cosine, and runs of pixels that one thread works on at a time."""

SERIAL_PRODUCT = 250_000
"""Multiplications up to which OpenBLAS computes a product on the calling thread; more would fight for the cores."""

CACHE_BYTES = 512 * 2**10
"""Of the second-level cache, for the Fourier transforms of a few frequencies."""

STRETCH_OVERSAMPLING = 2.0
"""Of the first Fourier transform, from lattice points to cosines at each wavenumber."""

POLAR_OVERSAMPLING = 2.0
"""Of the polar grid, both ways: the spectrum of a sector is a little wider than that of its nodes."""

NEAREST_GUARD = 0.25
"""The polar grid's guard reaches nearer than the nearest pixel by no more than this share of its range."""

COSINE_GUARD = 0.05
"""The polar grid's guard in cosine, roughly."""

SHARES = {"nodes": 0.5, "stretch": 0.2, "range": 0.4, "cosine": 0.4}
"""How the tolerance is shared out; errors of different sources add as squares."""


class LineArraySector:
    """The fast path on one sector, with all its tables. Calling it writes the pixels of the sector and nothing else.

    Parameters
    ----------
    problem : Problem
    lattice : Lattice
    sector : Sector
    height : float [m]
        Offset of the pixels across the image plane; only antennas off the line see it.
    runs : (n, 3) int array
        Pixels of the sector: row (z, y), first x, last x + 1.
    tolerance : float
    """

    def __init__(
        self,
        problem: Problem,
        lattice: Lattice,
        sector: Sector,
        height: float,
        runs: NDArray[np.int64],
        tolerance: float,
    ) -> None:
        self.problem, self.lattice, self.runs = problem, lattice, runs
        k = problem.k
        middle = k.size // 2
        self.middle = middle
        # How finely the polar grid must be sampled: the lattice and the band, and what the rest of the path adds.
        self.curvature = lattice.curvature(problem)
        # The kernels' taps reach beyond the sector: the slopes there count too.
        reach = Sector(
            (1.0 - NEAREST_GUARD) * sector.near, sector.far, sector.u_low - COSINE_GUARD, sector.u_high + COSINE_GUARD
        )
        slope_r, slope_u = spreads(problem, lattice, reach, height, self.curvature)
        width_u = 2.0 * float(k[-1]) * lattice.half_length + float(k[-1]) * slope_u
        width_r = float(k[-1] - k[0]) + float(k[-1]) * slope_r
        self.cosine_kernel = _pick(
            lambda width: triangular_kernel(width, POLAR_OVERSAMPLING, False), SHARES["cosine"] * tolerance
        )
        self.range_kernel = _pick(
            lambda width: taper_kernel(width, POLAR_OVERSAMPLING, problem.taper), SHARES["range"] * tolerance
        )
        # Rows of the period in range, the ambiguous range; a single frequency has none but the sector's end.
        step = float(k[-1] - k[0]) / (k.size - 1) if k.size > 1 else pi / (2.0 * sector.far)
        guard_u, guard_r = self.cosine_kernel.width // 2 + 1, self.range_kernel.width // 2 + 1
        self.per_cosine = max(POLAR_OVERSAMPLING * width_u / pi, guard_u / (4.0 * COSINE_GUARD))
        # Guard rows must not reach nearer than the slopes allow for.
        finest = pi / step * guard_r / (NEAREST_GUARD * sector.near)
        self.range_cells = scipy.fft.next_fast_len(ceil(max(POLAR_OVERSAMPLING * width_r / step, finest, k.size)))
        self.per_range = self.range_cells * step / pi
        self.line_first = floor(sector.u_low * self.per_cosine) - guard_u
        lines = ceil(sector.u_high * self.per_cosine) + guard_u + 1 - self.line_first
        self.row_first = floor(sector.near * self.per_range) - guard_r
        rows = ceil(sector.far * self.per_range) + guard_r + 1 - self.row_first
        self.shape = (lines, rows)
        at_u = (self.line_first + np.arange(lines)) / self.per_cosine
        at_r = np.maximum((self.row_first + np.arange(rows)) / self.per_range, 0.5 * sector.near)
        nodes = find_nodes(
            problem,
            lattice,
            Sector(float(at_r[0]), float(at_r[-1]), float(at_u[0]), float(at_u[-1])),
            height,
            SHARES["nodes"] * tolerance,
        )
        self.nodes = nodes.range.size
        # Lattice to cosines: position in the Fourier grid is k h u / pi * cells.
        self.cells = scipy.fft.next_fast_len(ceil(STRETCH_OVERSAMPLING * (2 * _reach(lattice) + 1)))
        self.stretch_kernel = _pick(
            lambda width: triangular_kernel(width, STRETCH_OVERSAMPLING, True), SHARES["stretch"] * tolerance
        )
        scale = k * lattice.pitch * self.cells / (pi * self.per_cosine)
        self.predicted_error = float(
            np.sqrt(
                nodes.error**2 + self.stretch_kernel.error**2 + self.cosine_kernel.error**2 + self.range_kernel.error**2
            )
        )
        # The tables, as the steps of a call need them.
        position = scale[:, None] * (self.line_first + np.arange(lines))[None, :]
        first_tap, self.weight = weights_at(self.stretch_kernel, position)
        self.cell = (first_tap % self.cells).astype(np.int32)
        every = np.arange(lattice.tx.size)
        rest = remainder(problem, lattice, every, nodes.range, nodes.cosine, height)
        omega = 2.0 * pi / self.cells * lattice.point_of_pair / lattice.pitch
        prefilter = self.stretch_kernel.factor_at(omega)
        factor = np.exp(1j * float(k[middle]) * rest) * (lattice.weight * prefilter)[:, None]
        self.factor = _as_real(factor)
        self.transfer = _as_real(nodes.transfer * problem.taper[:, None, None])
        n_r, n_u, _ = nodes.value.shape
        to_r = chebyshev_matrix(nodes.inverse_low, nodes.inverse_high, n_r, 1.0 / at_r)
        warped = warp(at_u, nodes.off_line)
        to_u = chebyshev_matrix(float(warped[0]), float(warped[-1]), n_u, warped)
        inner = np.tensordot(nodes.value, to_r, axes=(0, 1)).transpose(0, 2, 1)  # (u node, row, node)
        inner = np.ascontiguousarray(inner, dtype=np.complex64).reshape(n_u, -1).view(np.float32)
        self.value = np.empty((lines, rows, self.nodes), dtype=np.complex64)
        np.matmul(to_u.astype(np.float32), inner, out=self.value.reshape(lines, -1).view(np.float32))
        turns = float(k[middle]) * self.curvature / (2.0 * pi)

        def bend(line: int) -> None:
            self.value[line] *= np.exp(-2j * pi * turns * (1.0 - at_u[line] ** 2) / at_r)[:, None].astype(np.complex64)

        for_each(bend, range(lines))
        second = len(problem.rx)
        if problem.monostatic:
            self.pair, self.partner = lattice.tx, lattice.tx
        else:
            self.pair, self.partner = lattice.tx * second + lattice.rx, lattice.rx * second + lattice.tx

        # Blocks of frequencies as equal as can be, a few for each core, and products that BLAS keeps on one core.
        longest = 2 * int(np.diff(lattice.first).max())
        most = max(1, min(FREQUENCIES_A_BLOCK, SERIAL_PRODUCT // (longest * 2 * self.nodes)))
        blocks = 2 * cpu_count() * ceil(k.size / (2 * cpu_count() * most))
        self.block = ceil(k.size / blocks)
        self._gathered = Buffers((self.block * lattice.tx.size,))
        self._summed = Buffers((lattice.points * self.block * 2 * self.nodes,), np.float32)
        few = min(self.block, max(1, CACHE_BYTES // (8 * self.cells * self.nodes)))
        self._spectrum = Buffers((few, self.cells, self.nodes))
        self._beams = Buffers((k.size, lines, self.nodes))
        self._profile = Buffers((self.range_cells, LINES_A_BLOCK, self.nodes))
        self._polar = Buffers((lines, rows))

    @property
    def nbytes(self) -> int:
        """Memory of the tables [bytes]."""
        tables = (self.factor, self.transfer, self.value, self.pair, self.partner, self.runs, self.weight)
        return sum(table.nbytes for table in tables)

    def __call__(self, s: NDArray[np.complex64], image: NDArray[np.complex64]) -> None:
        """Focus data (frequencies, ...) on the sector's pixels of `image`, (rows, x)."""
        problem, lattice = self.problem, self.lattice
        frequencies = problem.k.size
        data = s.reshape(frequencies, -1)
        lines, _ = self.shape
        zero = -lattice.lowest
        limit = max(1, SERIAL_PRODUCT // (2 * self.nodes) ** 2)
        row_parts = [(a, b) for low, high in ((0, zero), (zero, lattice.points)) for a, b in _parts(low, high, limit)]

        def to_cosines(first: int) -> None:
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
                    spectrum[:, lattice.points - zero : self.cells - zero] = 0.0
                    for a, b in row_parts:
                        to = (a - zero) % self.cells
                        np.matmul(columns[low:high, a:b], self.transfer[some], out=real[:, to : to + b - a])
                    spectrum = scipy.fft.fft(spectrum, axis=1, overwrite_x=True)
                    kernels.stretcher(self.stretch_kernel.width)(
                        spectrum.view(np.float32), self.cell[some], self.weight[some], beams.view(np.float32)[some]
                    )

        def to_ranges(first: int) -> None:
            part = slice(first, min(first + LINES_A_BLOCK, lines))
            with self._profile.one() as profile:
                profile = profile[:, : part.stop - part.start]
                profile[: frequencies - self.middle] = beams[self.middle :, part]
                profile[frequencies - self.middle : self.range_cells - self.middle] = 0.0
                profile[self.range_cells - self.middle :] = beams[: self.middle, part]
                profile = scipy.fft.ifft(profile, axis=0, norm="forward", overwrite_x=True)
                kernels.combine(profile, self.value[part], self.row_first, polar[part])

        def to_pixels(first: int) -> None:
            kernels.interpolate(
                self.runs[first : first + RUNS_A_BLOCK],
                problem.x,
                problem.y,
                problem.z,
                lattice.centre,
                lattice.axis,
                self.per_range,
                self.row_first,
                self.per_cosine,
                self.line_first,
                float(problem.k[self.middle]) / pi,
                0.5 * self.curvature,
                polar,
                self.range_kernel.coefficients,
                self.cosine_kernel.coefficients,
                image,
            )

        with self._beams.one() as beams, self._polar.one() as polar:
            for_each(to_cosines, range(0, frequencies, self.block))
            for_each(to_ranges, range(0, lines, LINES_A_BLOCK))
            for_each(to_pixels, range(0, len(self.runs), RUNS_A_BLOCK))


def _as_real(matrix: NDArray[np.complex128]) -> NDArray[np.float32]:
    """The real matrix (..., 2n, 2m) that acts on interleaved real and imaginary parts as a complex one (..., n, m).

    Real products are faster than complex ones, and stay on the calling thread up to larger sizes.
    """
    real = np.empty((*matrix.shape[:-2], 2 * matrix.shape[-2], 2 * matrix.shape[-1]), dtype=np.float32)
    real[..., 0::2, 0::2] = real[..., 1::2, 1::2] = matrix.real
    real[..., 0::2, 1::2] = matrix.imag
    real[..., 1::2, 0::2] = -matrix.imag
    return real


def _parts(low: int, high: int, most: int) -> list[tuple[int, int]]:
    """The interval cut into parts of at most `most`."""
    return [(a, min(a + most, high)) for a in range(low, high, most)]


def _reach(lattice: Lattice) -> int:
    """Largest lattice index, either way."""
    return max(-lattice.lowest, lattice.lowest + lattice.points - 1, 1)


def _pick(make, tolerance: float):  # type: ignore[no-untyped-def]
    """The shortest kernel whose error stays under the tolerance, else the longest."""
    for width in (2, 4, 6, 8, 10, 12):
        kernel = make(width)
        if kernel.error <= tolerance:
            break
    return kernel
