"""Loop nests of the fast path. Each is one formula; shapes are checked by the callers."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit

from mirrorfold.focusing.interpolation import kernel_weights
from mirrorfold.focusing.phasor import unit_phasor

RUN = 256
"""Pixels interpolated together: their weights stay in the first-level cache."""


@njit(cache=True, nogil=True, error_model="numpy")
def gather(data, pair, partner, folded, first, out):  # type: ignore[no-untyped-def]
    """Data of each lattice point side by side: out[first[n] M + m count[n] + p] = S[m, pair] + S[m, partner]."""
    frequencies = data.shape[0]
    for m in range(frequencies):
        for n in range(first.size - 1):
            start, stop = first[n], first[n + 1]
            base = start * frequencies + m * (stop - start) - start
            if folded:
                for p in range(start, stop):
                    out[base + p] = data[m, pair[p]] + data[m, partner[p]]
            else:
                for p in range(start, stop):
                    out[base + p] = data[m, pair[p]]


@njit(cache=True, nogil=True, error_model="numpy")
def collapse(gathered, factor, first, frequencies, out):  # type: ignore[no-untyped-def]
    """out[n, m, :] = sum over the pairs p of lattice point n of gathered[p, m] factor[p, :], as real matrices."""
    for n in range(first.size - 1):
        start, stop = 2 * first[n], 2 * first[n + 1]
        if stop > start:
            block = gathered[start * frequencies : stop * frequencies].reshape(frequencies, stop - start)
            np.dot(block, factor[start:stop], out[n])
        else:
            out[n] = np.float32(0.0)


@lru_cache(maxsize=16)
def stretcher(width: int):  # type: ignore[no-untyped-def]
    """The kernel that resamples with `width` taps, a constant to the compiler."""

    @njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
    def stretch(spectrum, cell, weight, out):  # type: ignore[no-untyped-def]
        """out[m, l, :] = sum_a weight[m, l, a] spectrum[m, (cell[m, l] + a) mod N, :]."""
        frequencies, cells, columns = spectrum.shape
        for m in range(frequencies):
            for line in range(cell.shape[1]):
                first = cell[m, line]
                for a in range(width):
                    w = weight[m, line, a]
                    n = first + a
                    if n >= cells:
                        n -= cells
                    if a == 0:
                        for q in range(columns):
                            out[m, line, q] = w * spectrum[m, n, q]
                    else:
                        for q in range(columns):
                            out[m, line, q] += w * spectrum[m, n, q]

    return stretch


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def combine(profile, value, row_first, out):  # type: ignore[no-untyped-def]
    """out[l, j] = sum_q value[l, j, q] profile[(row_first + j) mod N, l, q]."""
    cells, _, nodes = profile.shape
    for line in range(out.shape[0]):
        for j in range(out.shape[1]):
            row = (row_first + j) % cells
            re = np.float32(0.0)
            im = np.float32(0.0)
            for q in range(nodes):
                v = value[line, j, q]
                f = profile[row, line, q]
                re += v.real * f.real - v.imag * f.imag
                im += v.real * f.imag + v.imag * f.real
            out[line, j] = complex(re, im)


def _tap_sum(taps_r: int):  # type: ignore[no-untyped-def]
    """The sum over taps with their number in range a constant to the compiler, which doubles its speed."""

    @njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
    def tap_sum(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im):  # type: ignore[no-untyped-def]
        """sum[p] = sum_b weight_u[b, p] sum_a weight_r[a, p] polar[cell[p] + b rows + a]."""
        for p in range(size):
            re, im = np.float32(0.0), np.float32(0.0)
            for b in range(weight_u.shape[0]):
                first = np.uint32(2) * (cell[p] + np.uint32(b * rows))
                line_re, line_im = np.float32(0.0), np.float32(0.0)
                for a in range(taps_r):
                    line_re += weight_r[a, p] * flat[first + np.uint32(2 * a)]
                    line_im += weight_r[a, p] * flat[first + np.uint32(2 * a + 1)]
                re += weight_u[b, p] * line_re
                im += weight_u[b, p] * line_im
            sum_re[p], sum_im[p] = re, im

    return tap_sum


_sum_2, _sum_4, _sum_6, _sum_8, _sum_10, _sum_12 = (_tap_sum(taps) for taps in (2, 4, 6, 8, 10, 12))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def interpolate(  # type: ignore[no-untyped-def]
    runs, x, y, z, centre, axis, per_range, row_first, per_cosine, line_first, turns_per_metre, curvature,
    polar, range_coefficients, cosine_coefficients, image,
):  # fmt: skip
    """image[p] = exp(2j k_c (r + curvature (1 - u^2) / r)) sum_ab w_b(u) w_a(r) polar[b, a].

    The pixels come in runs (row, start, stop) along x.
    """
    taps_r, taps_u = range_coefficients.shape[0], cosine_coefficients.shape[0]
    rows = polar.shape[1]
    flat = polar.reshape(-1).view(np.float32)
    cell = np.empty(RUN, np.uint32)
    part_r, part_u = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    weight_r, weight_u = np.empty((taps_r, RUN), np.float32), np.empty((taps_u, RUN), np.float32)
    phase_re, phase_im = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    sum_re, sum_im = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    shift = (1 - taps_u // 2) * rows + 1 - taps_r // 2
    for n in range(runs.shape[0]):
        row = runs[n, 0]
        dy = y[row % y.size] - centre[1]
        dz = z[row // y.size] - centre[2]
        across = dy * dy + dz * dz
        along = dy * axis[1] + dz * axis[2]
        for start in range(runs[n, 1], runs[n, 2], RUN):
            size = min(RUN, runs[n, 2] - start)
            for p in range(size):
                dx = x[start + p] - centre[0]
                r = np.sqrt(dx * dx + across)
                a = r * per_range - row_first
                u = (dx * axis[0] + along) / r
                b = u * per_cosine - line_first
                below_a, below_b = np.floor(a), np.floor(b)
                part_r[p] = a - below_a
                part_u[p] = b - below_b
                cell[p] = np.uint32(np.int32(below_b) * rows + np.int32(below_a) + shift)
                phase_re[p], phase_im[p] = unit_phasor((r + curvature * (1.0 - u * u) / r) * turns_per_metre)
            kernel_weights(range_coefficients, part_r[:size], weight_r)
            kernel_weights(cosine_coefficients, part_u[:size], weight_u)
            if taps_r == 2:
                _sum_2(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im)
            elif taps_r == 4:
                _sum_4(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im)
            elif taps_r == 6:
                _sum_6(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im)
            elif taps_r == 8:
                _sum_8(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im)
            elif taps_r == 10:
                _sum_10(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im)
            else:
                _sum_12(cell, weight_r, weight_u, flat, rows, size, sum_re, sum_im)
            for p in range(size):
                image[row, start + p] = complex(
                    sum_re[p] * phase_re[p] - sum_im[p] * phase_im[p],
                    sum_re[p] * phase_im[p] + sum_im[p] * phase_re[p],
                )
