"""Loop nests from pixels to samples. Each is the conjugate transpose of one of `kernels`, which its docstring names."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.focusing.lines.interpolation import kernel_weights
from mirrorfold.focusing.lines.kernels import RUN, locate


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def interpolate_transposed(  # type: ignore[no-untyped-def]
    runs, x, y, z, centre, frame, foci, planar, per_range, row_first, per_direction, line_first, turns_per_metre,
    curvature, image, range_coefficients, direction_coefficients, polar,
):  # fmt: skip
    """polar[b, a] += sum_p w_b(w) w_a(r) exp(-2j k_c (r + curvature (1 - u^2) / r)) image[p].

    Transposes `interpolate`.
    """
    taps_r, taps_w = range_coefficients.shape[0], direction_coefficients.shape[0]
    rows = polar.shape[1]
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
                value = image[row, start + p]
                re = value.real * phase_re[p] + value.imag * phase_im[p]
                im = value.imag * phase_re[p] - value.real * phase_im[p]
                if re == np.float32(0.0) and im == np.float32(0.0):
                    continue  # a sparse image is zero nearly everywhere
                for b in range(taps_w):
                    line_re, line_im = weight_w[b, p] * re, weight_w[b, p] * im
                    first = np.uint32(2) * (cell[p] + np.uint32(b * rows))
                    for a in range(taps_r):
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
