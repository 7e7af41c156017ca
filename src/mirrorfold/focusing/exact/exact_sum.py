"""The total focusing method for any geometry, the exact kernel: range-compressed pairs, summed pixel by pixel.

The sum over frequency is done once for each pair: it gives the range profile ``Q_ik`` of the pair, a table over path
length (see `range_tables`). A pixel then needs one value of each table, and one phase for each antenna::

    I(p) = sum_i w_i E_i(p) sum_k v_k E_k(p) Q_ik(R_i + R_k),    E(p) = exp(+j k_c R(p)).

The weights w and v are multiplied into the samples beforehand. Pixels are summed in tiles, and path lengths are counted
from the centre of the tile, so that single precision suffices. Where transmitters and receivers stand at the same
places, the pairs (i, k) and (k, i) have the same path: their samples are added first ("folded"), and pairs with k >= i
remain.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from mirrorfold.common.threads import counted, for_each
from mirrorfold.common.types import Progress
from mirrorfold.focusing.exact.kernels import sum_transmitters, tile_tables
from mirrorfold.focusing.exact.range_tables import (
    TERMS,
    interleave_coefficients,
    spectral_weights,
    table_cells,
    unfold_spectrum,
)
from mirrorfold.focusing.problem import Problem

Tables = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]
"""Tables of some antennas on one tile of pixels: path to the centre of the tile (antennas,) [table cells]; path to each
pixel less this one [table cells], real part and imaginary part of E, (antennas, pixels)."""

TILE_PIXELS = 512
"""Pixels of a tile, at most: the tables of all antennas on one tile then stay in the second-level cache."""

TABLE_BYTES = 128 * 2**20
"""Memory [bytes] for the range-compressed pairs that are held at once."""

MONOSTATIC_BLOCK, MONOSTATIC_PIXELS = 64, 2048
"""Positions of one moving antenna that are range-compressed, and summed on a tile, together; and pixels of a tile, at
most. Each position's tables are used once, so those of few positions need to be held, and a tile may be larger."""


def tile_pixels(problem: Problem) -> int:
    """Pixels of a tile, at most."""
    return MONOSTATIC_PIXELS if problem.monostatic else TILE_PIXELS


def _tiles(problem: Problem, largest_diagonal: float) -> list[tuple[slice, slice, slice]]:
    """Boxes (z, y, x) of few pixels that cover the image, with no larger diagonal [m] than this if possible."""
    axes = (problem.z, problem.y, problem.x)
    most = tile_pixels(problem)
    sizes = [1, 1, 1]
    limit = largest_diagonal / np.sqrt(3.0)
    # First 32 x 16 pixels along x and y, `TILE_PIXELS`; then as many more along y, x and z as there is room for.
    for axis, share in ((2, 32), (1, 16), (0, 1), (1, most), (2, most), (0, most)):
        n = axes[axis].size
        pitch = abs(axes[axis][-1] - axes[axis][0]) / max(n - 1, 1)
        fits = n if pitch == 0.0 else max(1, int(min(limit / pitch, n)))
        room = most // int(np.prod([s for i, s in enumerate(sizes) if i != axis]))
        sizes[axis] = max(sizes[axis], min(n, share, fits, room))
    starts = [range(0, a.size, s) for a, s in zip(axes, sizes, strict=True)]
    return [
        (slice(iz, iz + sizes[0]), slice(iy, iy + sizes[1]), slice(ix, ix + sizes[2]))
        for iz in starts[0]
        for iy in starts[1]
        for ix in starts[2]
    ]


def _pair_data(problem: Problem, s: NDArray[np.complex64], i: int, folded: bool) -> NDArray[np.complex64]:
    """Weighted samples (frequencies, receivers) of transmitter i.

    If folded, those of the receivers k >= i, with the samples of the swapped pairs (k, i) added.
    """
    tx, rx = problem.tx_weight, problem.rx_weight
    if not folded:
        return np.asarray(s[:, i, :] * (tx[i] * rx)).astype(np.complex64)
    data = s[:, i, i:] * (tx[i] * rx[i:]) + s[:, i:, i] * (rx[i] * tx[i:])
    data[:, 0] *= 0.5  # the pair (i, i) was added to itself
    return np.asarray(data).astype(np.complex64)


def focus_exact(
    problem: Problem,
    s: NDArray[np.complex64],
    tolerance: float,
    progress: Progress | None = None,
    where: NDArray[np.bool_] | None = None,
) -> NDArray[np.complex64]:
    """Image (z, y, x) of one frame by the sum over all pairs and pixels.

    Parameters
    ----------
    problem : Problem
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) complex64 array
    tolerance : float
        Largest relative root-mean-square error on white data; below `FINEST_TOLERANCE` it counts as that.
    progress : callable, optional
    where : (z, y, x) bool array, optional
        True at the pixels to compute, by default all; the others stay zero.
    """
    if not problem.monostatic and len(problem.tx) > len(problem.rx):
        # Paths are reciprocal; the inner loop, which runs over the receivers, should be the longer of the two.
        problem, s = problem.reversed(), s.swapaxes(1, 2)
    cells = table_cells(problem.taper, tolerance)
    weight = spectral_weights(problem.taper, cells)
    step = problem.wavenumber_step
    ambiguous_path = 2.0 * np.pi / step if step > 0.0 else float("inf")
    cells_per_metre = cells / ambiguous_path
    middle = problem.middle_wavenumber
    # A pixel's path differs from that of its tile's centre by at most the tile's diagonal.
    tiles = _tiles(problem, 0.25 * ambiguous_path)
    if where is not None:
        tiles = [tile for tile in tiles if where[tile].any()]
    largest_diagonal = max(_diagonal(problem, tile) for tile in tiles)
    margin = int(np.ceil(largest_diagonal * cells_per_metre)) + 4
    folded = problem.coincident and not problem.monostatic
    # Number of pairs of each transmitter, or of each position of one moving antenna.
    pairs_of = [1 if problem.monostatic else len(problem.rx) - folded * i for i in range(len(problem.tx))]
    per_pair = (cells + 2 * margin) * TERMS * 8
    most = max(1, TABLE_BYTES // per_pair)
    chunks = _chunks(pairs_of, most)
    total = np.zeros(problem.shape, dtype=np.complex64)
    one_more = counted(progress, len(chunks) * len(tiles))
    for chunk in chunks:
        start = np.concatenate([[0], np.cumsum([pairs_of[i] for i in chunk])])
        table = np.empty((int(start[-1]), cells + 2 * margin, TERMS), dtype=np.complex64)

        def compress(n: int, table: NDArray[np.complex64] = table, chunk: range = chunk, start: Any = start) -> None:
            if problem.monostatic:
                part = slice(chunk[n], chunk[min(n + MONOSTATIC_BLOCK, len(chunk)) - 1] + 1)
                data = (s[:, part] * (problem.tx_weight * problem.rx_weight)[part]).astype(np.complex64)
                rows = table[n : n + data.shape[1]]
            else:
                data = _pair_data(problem, s, chunk[n], folded)
                rows = table[start[n] : start[n + 1]]
            spectrum = np.empty((data.shape[1], TERMS, cells), dtype=np.complex64)
            unfold_spectrum(np.ascontiguousarray(data), weight, spectrum)
            interleave_coefficients(scipy.fft.ifft(spectrum, axis=-1, norm="forward", overwrite_x=True), rows)

        def image_tile(
            tile: tuple[slice, slice, slice],
            table: NDArray[np.complex64] = table,
            chunk: range = chunk,
            start: Any = start,
        ) -> None:
            flat = table.view(np.float32).reshape(len(table), -1)
            selected = np.ones(total[tile].shape, dtype=bool) if where is None else where[tile]
            total[tile][selected] += _focus_tile(
                problem, tile, selected, flat, chunk, start, folded, cells_per_metre, middle, cells, margin
            )

        for_each(compress, range(0, len(chunk), MONOSTATIC_BLOCK if problem.monostatic else 1))
        for_each(image_tile, tiles, one_more)
    return total


def _chunks(pairs_of: list[int], most: int) -> list[range]:
    """Runs of consecutive transmitters (or positions) with at most `most` pairs together, or a single transmitter."""
    chunks, start, held = [], 0, 0
    for i, count in enumerate(pairs_of):
        if i > start and held + count > most:
            chunks.append(range(start, i))
            start, held = i, 0
        held += count
    return [*chunks, range(start, len(pairs_of))]


def _diagonal(problem: Problem, tile: tuple[slice, slice, slice]) -> float:
    """Length [m] of a tile's diagonal."""
    spans = [np.ptp(axis[part]) for axis, part in zip((problem.z, problem.y, problem.x), tile, strict=True)]
    return float(np.linalg.norm(spans))


def _focus_tile(
    problem: Problem,
    tile: tuple[slice, slice, slice],
    wanted: NDArray[np.bool_],
    table: NDArray[np.float32],
    chunk: range,
    start: NDArray[np.int64],
    folded: bool,
    cells_per_metre: float,
    middle: float,
    cells: int,
    margin: int,
) -> NDArray[np.complex64]:
    """The sum over the chunk's transmitters and all receivers (or its positions), on the wanted pixels of a tile."""
    z, y, x = problem.z[tile[0]], problem.y[tile[1]], problem.x[tile[2]]
    centre = 0.5 * np.array([x[0] + x[-1], y[0] + y[-1], z[0] + z[-1]])
    pixel_z, pixel_y, pixel_x = (axis[wanted] for axis in np.meshgrid(z, y, x, indexing="ij"))
    count = pixel_x.size

    def tabulate(element: NDArray[np.float64], ways: float) -> Tables:
        reference = np.linalg.norm(element - centre, axis=1) * (ways * cells_per_metre)
        delay, re, im = (np.empty((len(element), count), dtype=np.float32) for _ in range(3))
        tile_tables(pixel_x, pixel_y, pixel_z, element, ways * cells_per_metre, ways * middle, reference, delay, re, im)
        return reference, delay, re, im

    out = np.zeros(count, dtype=np.complex64)
    if problem.monostatic:
        # Each position acts as a receiver with twice its path; the transmitter has path zero and phase factor one.
        nothing = np.zeros((1, count), dtype=np.float32)
        transmitter: Tables = (np.zeros(1), nothing, nothing + np.float32(1.0), nothing)
        alone = np.zeros(1, dtype=np.int64)
        for n in range(0, len(chunk), MONOSTATIC_BLOCK):
            block = chunk[n : n + MONOSTATIC_BLOCK]
            receiver = tabulate(problem.rx[block.start : block.stop], 2.0)
            sum_transmitters(table[n:], alone, alone, False, cells, margin, *transmitter, *receiver, out)
        return out
    receiver = tabulate(problem.rx, 1.0)
    transmitter = receiver if folded else tabulate(problem.tx, 1.0)
    index = np.arange(chunk.start, chunk.stop)
    sum_transmitters(table, start, index, folded, cells, margin, *transmitter, *receiver, out)
    return out
