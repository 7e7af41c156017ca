"""The total focusing method for any geometry: range-compressed pairs, summed pixel by pixel.

For a pair (i, k) the sum over frequency is a function of one variable, the path length d = R_i + R_k::

    sum_m a[m] S[m,i,k] exp(+j k_m d) = exp(+j k_c d) Q_ik(d),

with Q_ik band-limited (k_c is the middle wavenumber). Q_ik is tabulated on N cells per ambiguous path length as a
cubic polynomial per cell, whose coefficients follow from the Jacobi-Anger expansion
``exp(j w u / 2) = sum_q eps_q j^q J_q(w/2) T_q(u)``, |u| <= 1, truncated after q = 3 and summed over frequency by FFT.
The truncation error is known in closed form (`interpolation_error`), so N follows from the tolerance.
The remaining sum over pairs has one phase per antenna and pixel::

    I(p) = sum_i w_i E_i(p) sum_k v_k E_k(p) Q_ik(R_i + R_k),    E(p) = exp(+j k_c R(p)).
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray
from scipy.special import jv

from mirrorfold.common.threads import Progress, for_each
from mirrorfold.errors import InputError
from mirrorfold.focusing.problem import Problem

Tables = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]
"""Of the antennas on one tile: reference path [cells], path less that, real and imaginary part of the phase factor."""

TERMS = 4
"""Coefficients of the polynomial in each cell: a cubic."""

OVERSAMPLING = (2, 4, 8, 16)
"""Cells per Nyquist cell to choose from; the finest reaches the rounding error of single precision."""

TILE_PIXELS = 512
"""Pixels of a tile: the tables of all antennas on one tile stay in the second-level cache."""

TABLE_BYTES = 128 * 2**20
"""Memory for the range-compressed pairs that are held at once."""

MONOSTATIC_BLOCK = 64
"""Positions of one moving antenna that are range-compressed together."""

ROUNDING = 2e-6
"""Relative error of the single-precision sums, phases and tables, measured against the float64 sum."""


def interpolation_error(taper: NDArray[np.complex128], cells: int) -> float:
    """Relative root-mean-square error of the tabulated profiles on white data.

    Parameters
    ----------
    taper : (frequencies,) array
    cells : int
        Table cells per ambiguous path length.

    Returns
    -------
    float
        ``sqrt(sum |a e|^2 / sum |a|^2)`` with ``e_m^2 = sum_{q>3} 2 J_q(w_m/2)^2``, the part of
        ``exp(j w_m u / 2)`` that a cubic cannot follow.
    """
    w = 2.0 * pi * (np.arange(taper.size) - taper.size // 2) / cells
    missing = sum(2.0 * jv(q, w / 2.0) ** 2 for q in range(TERMS, TERMS + 6))
    power = np.abs(taper) ** 2
    return float(np.sqrt(np.sum(power * missing) / np.sum(power)))


def table_cells(taper: NDArray[np.complex128], tolerance: float) -> int:
    """Cells per ambiguous path length that keep the interpolation error under half the tolerance."""
    for oversampling in OVERSAMPLING:
        cells = scipy.fft.next_fast_len(oversampling * taper.size)
        if interpolation_error(taper, cells) <= 0.5 * tolerance:
            break
    return int(cells)


def _spectral_weights(taper: NDArray[np.complex128], cells: int) -> NDArray[np.complex64]:
    """Factors (TERMS, frequencies) that turn data into the spectra of the cubic's coefficients, powers of u."""
    w = 2.0 * pi * (np.arange(taper.size) - taper.size // 2) / cells
    t = [(1.0 if q == 0 else 2.0) * 1j**q * jv(q, w / 2.0) for q in range(TERMS)]
    monomial = np.stack([t[0] - t[2], t[1] - 3.0 * t[3], 2.0 * t[2], 4.0 * t[3]])
    return (monomial * (taper * np.exp(0.5j * w))).astype(np.complex64)


@njit(cache=True, nogil=True, error_model="numpy")
def _unfold_spectrum(data, weight, spectrum):  # type: ignore[no-untyped-def]
    """spectrum[k, q, (m - M//2) mod N] = weight[q, m] data[m, k]."""
    frequencies, elements = data.shape
    terms, cells = spectrum.shape[1], spectrum.shape[2]
    middle = frequencies // 2
    spectrum[:] = 0.0
    for k in range(elements):
        for q in range(terms):
            for m in range(frequencies):
                spectrum[k, q, (m - middle) % cells] = weight[q, m] * data[m, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _lay_out(profile, table):  # type: ignore[no-untyped-def]
    """table[k, n, q] = profile[k, q, n mod N]: the coefficients of one cell side by side, and a margin that wraps."""
    elements, terms, cells = profile.shape
    for k in range(elements):
        for n in range(table.shape[1]):
            for q in range(terms):
                table[k, n, q] = profile[k, q, n % cells]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def unit_phasor(turns):  # type: ignore[no-untyped-def]
    """Cosine and sine of ``2 pi turns``: reduced in float64, then Taylor series of the half angle in float32 (6e-8)."""
    half = np.float32(np.pi) * np.float32(turns - np.floor(turns + 0.5))
    h2 = half * half
    s = half * (
        np.float32(1.0)
        + h2
        * (
            np.float32(-1.0 / 6)
            + h2
            * (
                np.float32(1.0 / 120)
                + h2 * (np.float32(-1.0 / 5040) + h2 * (np.float32(1.0 / 362880) - h2 * np.float32(1.0 / 39916800)))
            )
        )
    )
    c = np.float32(1.0) + h2 * (
        np.float32(-1.0 / 2)
        + h2
        * (
            np.float32(1.0 / 24)
            + h2
            * (
                np.float32(-1.0 / 720)
                + h2 * (np.float32(1.0 / 40320) + h2 * (np.float32(-1.0 / 3628800) + h2 * np.float32(1.0 / 479001600)))
            )
        )
    )
    return np.float32(1.0) - np.float32(2.0) * s * s, np.float32(2.0) * s * c


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _tile_tables(x, y, z, element, per_metre, wavenumber, reference, delay, re, im):  # type: ignore[no-untyped-def]
    """For each antenna and pixel: path in table cells less `reference`, and exp(j k_c R)."""
    per_turn = wavenumber / (2.0 * np.pi)
    for e in range(element.shape[0]):
        ex, ey, ez = element[e]
        for p in range(x.size):
            r = np.sqrt((x[p] - ex) ** 2 + (y[p] - ey) ** 2 + (z[p] - ez) ** 2)
            delay[e, p] = r * per_metre - reference[e]
            re[e, p], im[e, p] = unit_phasor(r * per_turn)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _sum_pairs(  # type: ignore[no-untyped-def]
    table, first, offset, tx_delay, rx_delay, rx_re, rx_im, sum_re, sum_im
):
    """sum[p] = sum_k E_k(p) Q_k(tx_delay[p] + rx_delay[k, p] + offset[k]) for one transmitter.

    `table[k]` holds eight numbers a cell: real and imaginary part of the four coefficients of a cubic in u.
    """
    one, two = np.float32(1.0), np.float32(2.0)
    for k in range(rx_delay.shape[0]):
        q = table[k]
        start = np.uint32(first[k])
        shift = offset[k]
        for p in range(tx_delay.size):
            d = tx_delay[p] + rx_delay[k, p] + shift
            cell = np.int32(d)
            u = two * (d - np.float32(cell)) - one
            n = (start + np.uint32(cell)) * np.uint32(8)
            re = q[n] + u * (q[n + np.uint32(2)] + u * (q[n + np.uint32(4)] + u * q[n + np.uint32(6)]))
            im = q[n + np.uint32(1)] + u * (q[n + np.uint32(3)] + u * (q[n + np.uint32(5)] + u * q[n + np.uint32(7)]))
            sum_re[p] += re * rx_re[k, p] - im * rx_im[k, p]
            sum_im[p] += re * rx_im[k, p] + im * rx_re[k, p]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _sum_transmitters(  # type: ignore[no-untyped-def]
    table, start, tx_index, folded, cells, margin,
    tx_reference, tx_delay, tx_re, tx_im, rx_reference, rx_delay, rx_re, rx_im, out,
):  # fmt: skip
    """out[p] += sum_i E_i(p) sum_k E_k(p) Q_ik(R_i + R_k) for the transmitters `tx_index`; k >= i where folded."""
    receivers, pixels = rx_delay.shape
    first, offset = np.empty(receivers, np.int64), np.empty(receivers, np.float32)
    sum_re, sum_im = np.empty(pixels, np.float32), np.empty(pixels, np.float32)
    for n in range(tx_index.size):
        i = tx_index[n]
        low = i if folded else 0
        for k in range(low, receivers):
            base = tx_reference[i] + rx_reference[k]
            base -= cells * np.floor(base / cells)
            whole = int(base)
            # One margin below the centre's cell keeps every index positive; the table's own margin wraps above.
            first[k] = (whole - margin + cells) % cells
            offset[k] = base - whole + margin
        sum_re[:] = np.float32(0.0)
        sum_im[:] = np.float32(0.0)
        _sum_pairs(
            table[start[n] : start[n] + receivers - low], first[low:], offset[low:],
            tx_delay[i], rx_delay[low:], rx_re[low:], rx_im[low:], sum_re, sum_im,
        )  # fmt: skip
        for p in range(pixels):
            out[p] += complex(
                sum_re[p] * tx_re[i, p] - sum_im[p] * tx_im[i, p], sum_re[p] * tx_im[i, p] + sum_im[p] * tx_re[i, p]
            )


def _tiles(problem: Problem, widest: float) -> list[tuple[slice, slice, slice]]:
    """Boxes (z, y, x) of at most TILE_PIXELS pixels whose diagonal stays under `widest` [m] where it can."""
    axes = (problem.z, problem.y, problem.x)
    sizes = [1, 1, 1]
    limit = widest / np.sqrt(3.0)
    for axis, share in ((2, 32), (1, 16), (0, 1), (1, TILE_PIXELS), (2, TILE_PIXELS), (0, TILE_PIXELS)):
        n = axes[axis].size
        pitch = abs(axes[axis][-1] - axes[axis][0]) / max(n - 1, 1)
        fits = n if pitch == 0.0 else max(1, int(min(limit / pitch, n)))
        room = TILE_PIXELS // int(np.prod([s for i, s in enumerate(sizes) if i != axis]))
        sizes[axis] = max(sizes[axis], min(n, share, fits, room))
    starts = [range(0, a.size, s) for a, s in zip(axes, sizes, strict=True)]
    return [
        (slice(iz, iz + sizes[0]), slice(iy, iy + sizes[1]), slice(ix, ix + sizes[2]))
        for iz in starts[0]
        for iy in starts[1]
        for ix in starts[2]
    ]


def _pair_data(problem: Problem, s: NDArray[np.complex64], i: int, folded: bool) -> NDArray[np.complex64]:
    """Weighted data (frequencies, receivers) of transmitter i; folded, with that of the swapped pairs k > i added."""
    tx, rx = problem.tx_weight, problem.rx_weight
    if not folded:
        return np.asarray(s[:, i, :] * (tx[i] * rx)).astype(np.complex64)
    data = s[:, i, i:] * (tx[i] * rx[i:]) + s[:, i:, i] * (rx[i] * tx[i:])
    data[:, 0] *= 0.5
    return np.asarray(data).astype(np.complex64)


def focus_exact(
    problem: Problem,
    s: NDArray[np.complex64],
    tolerance: float = 1e-5,
    progress: Progress | None = None,
    where: NDArray[np.bool_] | None = None,
) -> NDArray[np.complex64]:
    """Image (z, y, x) of one frame by the sum over all pairs and pixels.

    Parameters
    ----------
    problem : Problem
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) complex64 array
    tolerance : float
        Largest relative root-mean-square error on white data; single precision ends at about 2e-6.
    progress : callable, optional
    where : (z, y, x) bool array, optional
        Pixels that are wanted, all by default; the others stay zero.

    Raises
    ------
    InputError
        If the tolerance is finer than single precision allows.
    """
    if tolerance < ROUNDING:
        raise InputError(
            f"tolerance is {tolerance:g}, finer than the {ROUNDING:g} that single-precision images can hold; "
            "ask for a larger one"
        )
    cells = table_cells(problem.taper, tolerance)
    weight = _spectral_weights(problem.taper, cells)
    step = float(problem.k[-1] - problem.k[0]) / max(problem.k.size - 1, 1)
    period = 2.0 * pi / step if step > 0.0 else float("inf")
    per_metre = cells / period
    middle = float(problem.k[problem.k.size // 2])
    # A pixel's path differs from that of its tile's centre by at most the tile's diagonal.
    tiles = _tiles(problem, 0.25 * period)
    if where is not None:
        tiles = [tile for tile in tiles if where[tile].any()]
    widest = max(_diagonal(problem, tile) for tile in tiles)
    margin = int(np.ceil(widest * per_metre)) + 4
    folded = problem.coincident and not problem.monostatic
    # One moving antenna: every position is a receiver of twice the path, and the transmitter is no distance away.
    whole_rows = 1 if problem.monostatic else len(problem.tx)
    columns = [len(problem.rx) - i if folded else len(problem.rx) for i in range(whole_rows)]
    per_pair = (cells + 2 * margin) * TERMS * 8
    most = max(1, TABLE_BYTES // per_pair)
    chunks = _monostatic_chunks(columns[0], most) if problem.monostatic else _chunks(columns, most)
    total = np.zeros(problem.shape, dtype=np.complex64)
    done = 0

    def one_more() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, len(chunks) * len(tiles))

    for chunk in chunks:
        counts = [len(chunk)] if problem.monostatic else [columns[i] for i in chunk]
        start = np.concatenate([[0], np.cumsum(counts)])
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
            _unfold_spectrum(np.ascontiguousarray(data), weight, spectrum)
            _lay_out(scipy.fft.ifft(spectrum, axis=-1, norm="forward", overwrite_x=True), rows)

        def image_tile(
            tile: tuple[slice, slice, slice],
            table: NDArray[np.complex64] = table,
            chunk: range = chunk,
            start: Any = start,
        ) -> None:
            flat = table.view(np.float32).reshape(len(table), -1)
            mine = np.ones(total[tile].shape, dtype=bool) if where is None else where[tile]
            total[tile][mine] += _focus_tile(
                problem, tile, mine, flat, chunk, start, folded, per_metre, middle, cells, margin
            )

        for_each(compress, range(0, len(chunk), MONOSTATIC_BLOCK if problem.monostatic else 1))
        for_each(image_tile, tiles, one_more)
    return total


def _chunks(columns: list[int], most: int) -> list[range]:
    """Consecutive transmitters whose pairs together stay under `most`, at least one at a time."""
    chunks, start, held = [], 0, 0
    for i, count in enumerate(columns):
        if i > start and held + count > most:
            chunks.append(range(start, i))
            start, held = i, 0
        held += count
    return [*chunks, range(start, len(columns))]


def _monostatic_chunks(positions: int, most: int) -> list[range]:
    """Consecutive positions, at most `most` at a time."""
    return [range(a, min(a + most, positions)) for a in range(0, positions, most)]


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
    per_metre: float,
    middle: float,
    cells: int,
    margin: int,
) -> NDArray[np.complex64]:
    """The sum over the chunk's transmitters and all receivers (or its positions) on a tile's wanted pixels."""
    z, y, x = problem.z[tile[0]], problem.y[tile[1]], problem.x[tile[2]]
    centre = 0.5 * np.array([x[0] + x[-1], y[0] + y[-1], z[0] + z[-1]])
    pixel_z, pixel_y, pixel_x = (axis[wanted] for axis in np.meshgrid(z, y, x, indexing="ij"))
    count = pixel_x.size

    def tabulate(element: NDArray[np.float64], ways: float) -> Tables:
        reference = np.linalg.norm(element - centre, axis=1) * (ways * per_metre)
        delay, re, im = (np.empty((len(element), count), dtype=np.float32) for _ in range(3))
        _tile_tables(pixel_x, pixel_y, pixel_z, element, ways * per_metre, ways * middle, reference, delay, re, im)
        return reference, delay, re, im

    if problem.monostatic:
        receiver = tabulate(problem.rx[chunk.start : chunk.stop], 2.0)
        nothing = np.zeros((1, count), dtype=np.float32)
        transmitter: Tables = (np.zeros(1), nothing, nothing + np.float32(1.0), nothing)
        index = np.zeros(1, dtype=np.int64)
    else:
        receiver = tabulate(problem.rx, 1.0)
        transmitter = receiver if folded else tabulate(problem.tx, 1.0)
        index = np.arange(chunk.start, chunk.stop)
    out = np.zeros(count, dtype=np.complex64)
    _sum_transmitters(table, start, index, folded, cells, margin, *transmitter, *receiver, out)
    return out


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _sum_frequency(data, tx_re, tx_im, rx_re, rx_im, out):  # type: ignore[no-untyped-def]
    """out[p] = sum_i tx[p, i] sum_k data[i, k] rx[p, k] in float64."""
    transmitters, receivers = data.shape
    row_re, row_im = np.empty(receivers), np.empty(receivers)
    out[:] = 0.0
    for i in range(transmitters):
        for k in range(receivers):
            row_re[k], row_im[k] = data[i, k].real, data[i, k].imag
        for p in range(out.size):
            re, im = 0.0, 0.0
            for k in range(receivers):
                re += row_re[k] * rx_re[p, k] - row_im[k] * rx_im[p, k]
                im += row_re[k] * rx_im[p, k] + row_im[k] * rx_re[p, k]
            out[p] += complex(re * tx_re[p, i] - im * tx_im[p, i], re * tx_im[p, i] + im * tx_re[p, i])


@njit(cache=True, nogil=True, error_model="numpy")
def _sum_positions(data, weight, taper, k, path):  # type: ignore[no-untyped-def]
    """sum_m taper[m] sum_i data[m, i] weight[i] exp(j k[m] path[i]) in float64."""
    total = 0.0 + 0.0j
    for m in range(k.size):
        at_one = 0.0 + 0.0j
        for i in range(path.size):
            at_one += data[m, i] * weight[i] * np.exp(1j * k[m] * path[i])
        total += taper[m] * at_one
    return total


def direct_sum(problem: Problem, s: NDArray[np.complexfloating], points: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The focusing sum in float64, term by term, at points (n, 3) [m]: the reference of every other path."""
    tx_range = np.linalg.norm(points[:, None, :] - problem.tx[None, :, :], axis=-1)
    rx_range = np.linalg.norm(points[:, None, :] - problem.rx[None, :, :], axis=-1)
    if problem.monostatic:
        total = np.empty(len(points), dtype=np.complex128)
        weight = (problem.tx_weight * problem.rx_weight).astype(np.complex128)
        taper, path = problem.taper.astype(np.complex128), tx_range + rx_range

        def one_point(p: int) -> None:
            total[p] = _sum_positions(s, weight, taper, problem.k, path[p])

        for_each(one_point, range(len(points)))
        return total
    terms = np.zeros((problem.k.size, len(points)), dtype=np.complex128)

    def one_frequency(m: int) -> None:
        tx = np.exp(1j * problem.k[m] * tx_range)
        rx = (tx if problem.coincident else np.exp(1j * problem.k[m] * rx_range)) * problem.rx_weight
        tx = tx * problem.tx_weight
        tx_re, tx_im = np.ascontiguousarray(tx.real), np.ascontiguousarray(tx.imag)
        rx_re, rx_im = np.ascontiguousarray(rx.real), np.ascontiguousarray(rx.imag)
        _sum_frequency(s[m], tx_re, tx_im, rx_re, rx_im, terms[m])

    for_each(one_frequency, range(problem.k.size))
    return problem.taper @ terms
