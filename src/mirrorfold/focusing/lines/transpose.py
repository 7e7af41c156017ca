"""From pixels to samples by the fast algorithm of line arrays: its steps in reverse order, transposed and conjugated.

Focusing by `LineArraySector` is a product of matrices, ``I = P C F_r B F_u D s``, from right to left: pairs to lattice
points, Fourier transform to directions, resampling, Fourier transform to ranges, nodes to the polar grid, interpolation
to pixels. The samples of reflectivities x are ``s = D^H F_u^H B^H F_r^H C^H P^H x``, from the same tables. So the two
directions are adjoint to each other to rounding, whatever the tolerance of the tables.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from mirrorfold.common.threads import cpu_count, for_each
from mirrorfold.focusing.lines import transposed_kernels as kernels
from mirrorfold.focusing.lines.sector import LINES_A_BLOCK, SERIAL_PRODUCT, LineArraySector


def sector_samples(sector: LineArraySector, image: NDArray[np.complex64], s: NDArray[np.complex64]) -> None:
    """Add to `s` the samples that the pixels of a sector make.

    Parameters
    ----------
    sector : LineArraySector
    image : (rows, x) complex64 array
        Reflectivities of all pixels; those of other sectors are not used.
    s : (frequencies, ...) complex64 array
        Samples to which they are added, in the order of the sector's samples.
    """
    problem, lattice, design = sector.problem, sector.lattice, sector.design
    frequencies, middle, nodes = problem.k.size, sector.middle, sector.nodes
    data = s.reshape(frequencies, -1)
    lines, rows = design.shape
    # Several threads could write to the same grid point: each thread has a polar grid of its own.
    edges = np.unique(np.linspace(0, len(sector.runs), cpu_count() + 1).astype(int)).tolist()
    grids = np.zeros((len(edges) - 1, lines, rows), dtype=np.complex64)
    beams = np.empty((frequencies, lines, nodes), dtype=np.complex64)

    def from_pixels(part: tuple[int, tuple[int, int]]) -> None:
        number, (start, stop) = part
        kernels.interpolate_transposed(sector.runs[start:stop], sector.pixels, image, sector.taps, grids[number])

    for_each(from_pixels, enumerate(pairwise(edges)))
    polar = grids.sum(axis=0)

    def from_ranges(first: int) -> None:
        part = slice(first, min(first + LINES_A_BLOCK, lines))
        profile = np.zeros((design.range_cells, part.stop - part.start, nodes), dtype=np.complex64)
        kernels.combine_transposed(polar[part], sector.value[part], design.row_first, profile)
        profile = scipy.fft.fft(profile, axis=0, overwrite_x=True)
        beams[middle:, part] = profile[: frequencies - middle]
        beams[:middle, part] = profile[design.range_cells - middle :]

    back = sector.transfer.swapaxes(1, 2)
    most = max(1, SERIAL_PRODUCT // (2 * nodes) ** 2)
    at_point = (np.arange(lattice.points) + lattice.lowest) % design.cells

    def from_directions(first: int) -> None:
        some = slice(first, min(first + sector.block, frequencies))
        count = some.stop - some.start
        spectrum = np.zeros((count, design.cells, nodes), dtype=np.complex64)
        kernels.stretch_transposed(beams[some], sector.cell[some], sector.weight[some], spectrum)
        spectrum = scipy.fft.ifft(spectrum, axis=1, norm="forward", overwrite_x=True)
        columns = np.ascontiguousarray(spectrum[:, at_point]).view(np.float32)
        summed = np.empty((lattice.points, count, 2 * nodes), dtype=np.float32)
        for a in range(0, lattice.points, most):
            np.matmul(columns[:, a : a + most], back[some], out=summed[a : a + most].swapaxes(0, 1))
        gathered = np.empty(count * lattice.tx.size, dtype=np.complex64)
        kernels.collapse_transposed(summed, sector.factor, lattice.first, count, gathered.view(np.float32))
        kernels.gather_transposed(gathered, sector.pair, sector.partner, lattice.folded, lattice.first, data[some])

    for_each(from_ranges, range(0, lines, LINES_A_BLOCK))
    for_each(from_directions, range(0, frequencies, sector.block))
