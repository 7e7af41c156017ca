"""Loop nests of the exact kernel. Each computes one formula; the callers check the shapes.

Path lengths are counted in cells of the range tables, from the path to the centre of a tile of pixels: the differences
are small enough for single precision. E(p) = exp(j k_c R(p)) with the middle wavenumber k_c.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.kernels import njit
from mirrorfold.common.phasor import unit_phasor


@njit(nogil=True, error_model="numpy", fastmath=True)
def tile_tables(x, y, z, element, per_metre, wavenumber, reference, delay, re, im):  # type: ignore[no-untyped-def]
    """For each antenna and pixel: path R [table cells] less `reference` (to the tile's centre), and exp(j k_c R)."""
    per_turn = wavenumber / (2.0 * np.pi)
    for e in range(element.shape[0]):
        ex, ey, ez = element[e]
        for p in range(x.size):
            r = np.sqrt((x[p] - ex) ** 2 + (y[p] - ey) ** 2 + (z[p] - ez) ** 2)
            delay[e, p] = r * per_metre - reference[e]
            re[e, p], im[e, p] = unit_phasor(r * per_turn)


@njit(nogil=True, error_model="numpy", fastmath=True)
def sum_pairs(  # type: ignore[no-untyped-def]
    table, first, offset, tx_delay, rx_delay, rx_re, rx_im, sum_re, sum_im
):
    """sum[p] += sum_k E_k(p) Q_k(tx_delay[p] + rx_delay[k, p] + offset[k]) for one transmitter, over the receivers k.

    Q_k is a cubic in u in each cell of path length, u running from -1 to 1 over the cell. `table[k]` holds eight
    numbers per cell: real and imaginary part of its four coefficients. Paths are counted from cell ``first[k]``.
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


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def sum_transmitters(  # type: ignore[no-untyped-def]
    table, start, tx_index, folded, cells, margin,
    tx_reference, tx_delay, tx_re, tx_im, rx_reference, rx_delay, rx_re, rx_im, out,
):  # fmt: skip
    """out[p] += sum_i E_i(p) sum_k E_k(p) Q_ik(R_i + R_k), i in `tx_index`; only the receivers k >= i if folded."""
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
            # Cells count from one margin below that of the tile's centre, so that no index is negative. The table goes
            # on for twice the margin beyond its N cells, so that none is too large.
            first[k] = (whole - margin + cells) % cells
            offset[k] = base - whole + margin
        sum_re[:] = np.float32(0.0)
        sum_im[:] = np.float32(0.0)
        sum_pairs(
            table[start[n] : start[n] + receivers - low], first[low:], offset[low:],
            tx_delay[i], rx_delay[low:], rx_re[low:], rx_im[low:], sum_re, sum_im,
        )  # fmt: skip
        for p in range(pixels):
            out[p] += complex(
                sum_re[p] * tx_re[i, p] - sum_im[p] * tx_im[i, p], sum_re[p] * tx_im[i, p] + sum_im[p] * tx_re[i, p]
            )
