"""Loop nests of the fast algorithm of line arrays. Each computes one formula; the callers check the shapes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.common.phasor import unit_phasor
from mirrorfold.focusing.lines.interpolation import kernel_weights

RUN = 256
"""Number of pixels that are interpolated together: their weights stay in the first-level cache."""


@njit(nogil=True, error_model="numpy")
def gather(data, pair, partner, folded, first, out):  # type: ignore[no-untyped-def]
    """Sort samples by lattice point: out[first[n] M + m count[n] + p] = S[m, pair] (+ S[m, partner] if folded)."""
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


@njit(makes_arrays=True, nogil=True, error_model="numpy")
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
    """The loop that interpolates with `width` taps, a constant for the compiler."""

    @njit(nogil=True, error_model="numpy", fastmath=True)
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


@njit(nogil=True, error_model="numpy", fastmath=True)
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


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def locate(  # type: ignore[no-untyped-def]
    row, start, size, x, y, z, centre, frame, foci, planar, per_range, row_first, per_direction, line_first,
    turns_per_metre, curvature, rows, shift, cell, part_r, part_w, phase_re, phase_im,
):  # fmt: skip
    """Of `size` pixels of a row: index of the first tap on the polar grid, fractions, exp(2j k_c (r + c (1-u^2) / r)).

    `part_r` and `part_w` are the fractional positions between grid points, c is the `curvature`. The coordinates r, u
    and w are those of `Lattice.polar`; where both foci are the centre, one distance gives them all.
    """
    r, u, w = np.empty(size), np.empty(size), np.empty(size)
    apart = False
    for f in range(2):
        for c in range(3):
            apart = apart or foci[f, c] != centre[c]
    py, pz = y[row % y.size], z[row // y.size]
    dy, dz = py - centre[1], pz - centre[2]
    across = dy * dy + dz * dz
    along = dy * frame[0, 1] + dz * frame[0, 2]
    for p in range(size):
        dx = x[start + p] - centre[0]
        r[p] = np.sqrt(dx * dx + across)
        u[p] = (dx * frame[0, 0] + along) / r[p]
    if planar:
        for p in range(size):
            dx = x[start + p] - centre[0]
            w[p] = np.arctan2(u[p] * r[p], dx * frame[1, 0] + dy * frame[1, 1])
    else:
        for p in range(size):
            w[p] = u[p]
    if apart:
        tx_y, tx_z, rx_y, rx_z = py - foci[0, 1], pz - foci[0, 2], py - foci[1, 1], pz - foci[1, 2]
        tx_across, rx_across = tx_y * tx_y + tx_z * tx_z, rx_y * rx_y + rx_z * rx_z
        for p in range(size):
            tx_x, rx_x = x[start + p] - foci[0, 0], x[start + p] - foci[1, 0]
            r[p] = 0.5 * (np.sqrt(tx_x * tx_x + tx_across) + np.sqrt(rx_x * rx_x + rx_across))
    for p in range(size):
        a = r[p] * per_range - row_first
        b = w[p] * per_direction - line_first
        below_a, below_b = np.floor(a), np.floor(b)
        part_r[p] = a - below_a
        part_w[p] = b - below_b
        cell[p] = np.uint32(np.int32(below_b) * rows + np.int32(below_a) + shift)
        turns = (r[p] + curvature * (1.0 - u[p] * u[p]) / r[p]) * turns_per_metre
        phase_re[p], phase_im[p] = unit_phasor(turns)


@lru_cache(maxsize=16)
def interpolator(taps_r: int):  # type: ignore[no-untyped-def]
    """The loop that interpolates with `taps_r` taps in range, a constant for the compiler, which doubles the speed."""

    @njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
    def interpolate(  # type: ignore[no-untyped-def]
        runs, x, y, z, centre, frame, foci, planar, per_range, row_first, per_direction, line_first, turns_per_metre,
        curvature, polar, range_coefficients, direction_coefficients, image,
    ):  # fmt: skip
        """image[p] += exp(2j k_c (r + curvature (1 - u^2) / r)) sum_ab w_b(w) w_a(r) polar[b, a].

        The pixels come in runs (row, start, stop) along x.
        """
        taps_w, rows = direction_coefficients.shape[0], polar.shape[1]
        flat = polar.reshape(-1).view(np.float32)
        cell = np.empty(RUN, np.uint32)
        part_r, part_w = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
        weight_r, weight_w = np.empty((taps_r, RUN), np.float32), np.empty((taps_w, RUN), np.float32)
        phase_re, phase_im = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
        shift = (1 - taps_w // 2) * rows + 1 - taps_r // 2
        for n in range(runs.shape[0]):
            row = runs[n, 0]
            for start in range(runs[n, 1], runs[n, 2], RUN):
                size = min(RUN, runs[n, 2] - start)
                locate(
                    row, start, size, x, y, z, centre, frame, foci, planar, per_range, row_first, per_direction,
                    line_first, turns_per_metre, curvature, rows, shift, cell, part_r, part_w, phase_re, phase_im,
                )  # fmt: skip
                kernel_weights(range_coefficients, part_r[:size], weight_r)
                kernel_weights(direction_coefficients, part_w[:size], weight_w)
                for p in range(size):
                    re, im = np.float32(0.0), np.float32(0.0)
                    for b in range(taps_w):
                        first = np.uint32(2) * (cell[p] + np.uint32(b * rows))
                        line_re, line_im = np.float32(0.0), np.float32(0.0)
                        for a in range(taps_r):
                            line_re += weight_r[a, p] * flat[first + np.uint32(2 * a)]
                            line_im += weight_r[a, p] * flat[first + np.uint32(2 * a + 1)]
                        re += weight_w[b, p] * line_re
                        im += weight_w[b, p] * line_im
                    image[row, start + p] += complex(
                        re * phase_re[p] - im * phase_im[p], re * phase_im[p] + im * phase_re[p]
                    )

    return interpolate
