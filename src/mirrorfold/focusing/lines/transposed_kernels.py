"""Loop nests from pixels to samples. Each is the conjugate transpose of one of `kernels`, which its docstring names."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.focusing.lines.kernels import RUN, locate, room


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def interpolate_transposed(runs, pixels, image, taps, polar):  # type: ignore[no-untyped-def]
    """polar[b, a] += sum_p w_b(w) w_a(r) exp(-2j k_c (r + c (1 - u^2) / r)) image[p]: transposes `interpolate`."""
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
                value = image[row, start + p]
                re = value.real * phase[0, p] + value.imag * phase[1, p]
                im = value.imag * phase[0, p] - value.real * phase[1, p]
                if re == np.float32(0.0) and im == np.float32(0.0):
                    continue  # a sparse image is zero nearly everywhere
                for b in range(weight_w.shape[0]):
                    line_re, line_im = weight_w[b, p] * re, weight_w[b, p] * im
                    first = np.uint32(2) * (cell[p] + np.uint32(b * rows))
                    for a in range(weight_r.shape[0]):
                        flat[first + np.uint32(2 * a)] += weight_r[a, p] * line_re
                        flat[first + np.uint32(2 * a + 1)] += weight_r[a, p] * line_im


@njit(nogil=True, error_model="numpy", fastmath=True)
def combine_transposed(polar, value, row_first, profile):  # type: ignore[no-untyped-def]
    """profile[(row_first + j) mod N, l, q] += conj(value[l, j, q]) polar[l, j]: transposes `combine`."""
    cells, _, nodes = profile.shape
    for line in range(polar.shape[0]):
        for j in range(polar.shape[1]):
            row = (row_first + j) % cells
            p = polar[line, j]
            for q in range(nodes):
                profile[row, line, q] += np.conj(value[line, j, q]) * p


@njit(nogil=True, error_model="numpy", fastmath=True)
def stretch_transposed(beams, cell, weight, spectrum):  # type: ignore[no-untyped-def]
    """spectrum[m, (cell[m, l] + a) mod N, :] += sum_a weight[m, l, a] beams[m, l, :]: transposes `stretcher`."""
    frequencies, cells, columns = spectrum.shape
    for m in range(frequencies):
        for line in range(cell.shape[1]):
            for a in range(weight.shape[2]):
                w = weight[m, line, a]
                n = cell[m, line] + a
                if n >= cells:
                    n -= cells
                for q in range(columns):
                    spectrum[m, n, q] += w * beams[m, line, q]


@njit(nogil=True, error_model="numpy")
def gather_transposed(gathered, pair, partner, folded, first, data):  # type: ignore[no-untyped-def]
    """data[m, pair] += gathered, and data[m, partner] too if folded: transposes `gather`."""
    frequencies = data.shape[0]
    for m in range(frequencies):
        for n in range(first.size - 1):
            start, stop = first[n], first[n + 1]
            base = start * frequencies + m * (stop - start) - start
            for p in range(start, stop):
                data[m, pair[p]] += gathered[base + p]
            if folded:
                for p in range(start, stop):
                    data[m, partner[p]] += gathered[base + p]


@njit(makes_arrays=True, nogil=True, error_model="numpy")
def collapse_transposed(summed, factor, first, frequencies, out):  # type: ignore[no-untyped-def]
    """out[p, m] = sum over the columns c of summed[n, m, c] factor[p, c], as real matrices: transposes `collapse`."""
    for n in range(first.size - 1):
        start, stop = 2 * first[n], 2 * first[n + 1]
        if stop > start:
            block = out[start * frequencies : stop * frequencies].reshape(frequencies, stop - start)
            np.dot(summed[n], factor[start:stop].T, block)
