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
def room(taps):  # type: ignore[no-untyped-def]
    """Arrays for what `locate` finds of a run of pixels: cell, part and phase (2, run), and weights for both `taps`."""
    return (
        np.empty(RUN, np.uint32),
        np.empty((2, RUN), np.float32),
        np.empty((2, RUN), np.float32),
        np.empty((taps[0].shape[0], RUN), np.float32),
        np.empty((taps[1].shape[0], RUN), np.float32),
    )


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def locate(row, start, size, pixels, rows, taps, found):  # type: ignore[no-untyped-def]
    """Of `size` pixels of a row: index of the first tap on the polar grid, weights, exp(2j k_c (r + c (1-u^2) / r)).

    They are written to `found`, see `room`; its parts are the fractional positions between grid points. The `pixels`
    are those of a `LineArraySector`, the polar grid has `rows` in range, and `taps` are the coefficients of the kernels
    in range and in direction. The coordinates r, u and w are those of `Lattice.polar`; where both foci are the centre,
    one distance gives them all.
    """
    x, y, z, centre, frame, foci, planar, per_range, row_first, per_direction, line_first, turns_per_metre, c = pixels
    cell, part, phase, weight_r, weight_w = found
    shift = (1 - taps[1].shape[0] // 2) * rows + 1 - taps[0].shape[0] // 2
    r, u, w = np.empty(size), np.empty(size), np.empty(size)
    apart = False
    for f in range(2):
        for axis in range(3):
            apart = apart or foci[f, axis] != centre[axis]
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
        part[0, p] = a - below_a
        part[1, p] = b - below_b
        cell[p] = np.uint32(np.int32(below_b) * rows + np.int32(below_a) + shift)
        turns = (r[p] + c * (1.0 - u[p] * u[p]) / r[p]) * turns_per_metre
        phase[0, p], phase[1, p] = unit_phasor(turns)
    kernel_weights(taps[0], part[0, :size], weight_r)
    kernel_weights(taps[1], part[1, :size], weight_w)


@lru_cache(maxsize=16)
def interpolator(taps_r: int):  # type: ignore[no-untyped-def]
    """The loop that interpolates with `taps_r` taps in range, a constant for the compiler, which doubles the speed."""

    @njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
    def interpolate(runs, pixels, polar, taps, image):  # type: ignore[no-untyped-def]
        """image[p] += exp(2j k_c (r + c (1 - u^2) / r)) sum_ab w_b(w) w_a(r) polar[b, a], see `locate`.

        The pixels come in runs (row, start, stop) along x.
        """
        rows = polar.shape[1]
        flat = polar.reshape(-1).view(np.float32)
        found = room(taps)
        cell, _, phase, weight_r, weight_w = found
        for n in range(runs.shape[0]):
            row = runs[n, 0]
            for start in range(runs[n, 1], runs[n, 2], RUN):
                size = min(RUN, runs[n, 2] - start)
                locate(row, start, size, pixels, rows, taps, found)
                for p in range(size):
                    re, im = np.float32(0.0), np.float32(0.0)
                    for b in range(weight_w.shape[0]):
                        first = np.uint32(2) * (cell[p] + np.uint32(b * rows))
                        line_re, line_im = np.float32(0.0), np.float32(0.0)
                        for a in range(taps_r):
                            line_re += weight_r[a, p] * flat[first + np.uint32(2 * a)]
                            line_im += weight_r[a, p] * flat[first + np.uint32(2 * a + 1)]
                        re += weight_w[b, p] * line_re
                        im += weight_w[b, p] * line_im
                    image[row, start + p] += complex(
                        re * phase[0, p] - im * phase[1, p], re * phase[1, p] + im * phase[0, p]
                    )

    return interpolate
