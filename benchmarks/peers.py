"""The total focusing method as other packages compute it: range-compressed pairs, linear interpolation, every pixel.

A reimplementation of the usual delay-and-sum kernel: one loop over pixels, one over pairs of antennas, with delays and
phases from look-up tables for each pixel and element. It serves for comparisons, in place of packages that cannot be
installed.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange


def range_compressed(s, taper, frequency, samples):
    """Traces (pairs, samples) at baseband over the unambiguous delay, and the carrier [Hz] that was removed."""
    middle = frequency.size // 2
    spectrum = np.zeros((s.shape[1] * s.shape[2], samples), np.complex64)
    data = (s * taper[:, None, None]).reshape(frequency.size, -1).T
    spectrum[:, : frequency.size - middle] = data[:, middle:]
    spectrum[:, samples - middle :] = data[:, :middle]
    return np.fft.ifft(spectrum, axis=1, norm="forward").astype(np.complex64), frequency[middle]


@njit(parallel=True, fastmath=True, error_model="numpy")
def delay_and_sum_baseband(profile, tx, rx, tx_delay, rx_delay, tx_phase, rx_phase, per_second, out):
    """``out[p]``: sum over pairs of the trace at the pair's delay, linearly interpolated, times the carrier's phase."""
    samples = profile.shape[1]
    for p in prange(out.size):
        total = np.complex64(0.0)
        for n in range(tx.size):
            position = (tx_delay[p, tx[n]] + rx_delay[p, rx[n]]) * per_second
            below = int(position)
            part = np.float32(position - below)
            value = profile[n, below % samples] * (np.float32(1.0) - part) + profile[n, (below + 1) % samples] * part
            total += value * tx_phase[p, tx[n]] * rx_phase[p, rx[n]]
        out[p] = total
