"""Sums of echoes of arbitrary delays over a band of equally spaced frequencies, by a nonuniform FFT.

Computed is ``S[b, m] = sum_e W(b, e) a_e exp(-2 pi j m x_e)`` for beam b and frequency m, with the delay ``x_e`` of
echo e in units of the unambiguous delay, and its weight W in the beam. Each echo is spread over the six nearest points
of a delay grid twice as fine as the band needs, with the exponential-of-semicircle kernel (Barnett, Magland and af
Klinteberg, SIAM J. Sci. Comput. 41, 2019). After one FFT the transform of the kernel is divided out. The error is below
1e-5 of the sum of the amplitudes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, next_fast_len

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array

Complex64 = NDArray[np.complex64]

TAPS = 6
SHAPE = 2.30 * TAPS
"""Width of the kernel in grid points, and its shape parameter for a grid twice as fine (ibid., section 3)."""


class DelayGrid:
    """A delay grid for `points` frequencies.

    Attributes
    ----------
    size : int
        Number of grid points over the unambiguous delay.
    center : int
        Index of the frequency to whose phase the echoes' amplitudes refer: the middle of the band, around which the
        transform of the kernel is flattest.
    """

    def __init__(self, points: int) -> None:
        self.points = points
        self.size = int(next_fast_len(max(2 * points, 2 * TAPS)))
        self.center = points // 2
        order = np.arange(points) - self.center
        node, weight = np.polynomial.legendre.leggauss(64)
        kernel = np.exp(SHAPE * (np.sqrt(1.0 - node**2) - 1.0)) * weight
        transform = 0.5 * TAPS * np.cos(np.outer(np.pi * TAPS * order / self.size, node)) @ kernel
        self._scale = (1.0 / transform).astype(np.float32)
        self._order = order % self.size

    def to_band(self, grid: Complex64, out: Complex64) -> None:
        """Transform a delay grid (n, size), which is overwritten, to samples (n, points) over the band, in `out`."""
        spectrum = fft(grid, axis=1, overwrite_x=True)
        below = self.center
        np.multiply(spectrum[:, self.size - below :], self._scale[:below], out=out[:, :below])
        np.multiply(spectrum[:, : self.points - below], self._scale[below:], out=out[:, below:])


@njit(makes_arrays=True, nogil=True, fastmath=True, error_model="numpy")
def spread_echoes(
    direction: Array, range_: Array, width: Array, narrow: Array, across: Array, delay: Array, amplitude: Complex64,
    first: NDArray[np.int64], last: NDArray[np.int64], beam: Array, grid: Complex64,
) -> None:  # fmt: skip
    """Spread echoes over the delay grid: ``grid[b, l] += a_e exp(-2 rho^2 / w_e^2) phi(l - x_e)``.

    Here ``rho = r_e |d_e x beam_b|`` is the distance of echo e, in the direction d, from the axis of beam b, and phi
    the kernel. This holds where the response of the beam has the same width in all directions. Otherwise w is its
    radius along the unit vector `across`, and the radius n orthogonal to it, `narrow`, adds
    ``-2 (1/n^2 - 1/w^2) (r_e (d_e x beam_b) . across_e)^2`` to the exponent.

    Echo e is added to the beams first[e]..last[e]; `delay` (n,) is in grid steps.
    """
    size = grid.shape[1]
    tap = np.empty(TAPS, dtype=np.float32)
    for e in range(range_.size):
        start = int(np.ceil(delay[e] - 0.5 * TAPS))
        for t in range(TAPS):
            z = (start + t - delay[e]) / (0.5 * TAPS)
            tap[t] = np.exp(SHAPE * (np.sqrt(max(1.0 - z * z, 0.0)) - 1.0))
        scale = 2.0 * (range_[e] / width[e]) ** 2
        more = 2.0 * (range_[e] / narrow[e]) ** 2 - scale
        for b in range(first[e], last[e] + 1):
            x = direction[e, 1] * beam[b, 2] - direction[e, 2] * beam[b, 1]
            y = direction[e, 2] * beam[b, 0] - direction[e, 0] * beam[b, 2]
            z = direction[e, 0] * beam[b, 1] - direction[e, 1] * beam[b, 0]
            aside = x * across[e, 0] + y * across[e, 1] + z * across[e, 2]
            value = amplitude[e] * np.float32(np.exp(-scale * (x * x + y * y + z * z) - more * aside * aside))
            for t in range(TAPS):
                at = start + t
                while at >= size:
                    at -= size
                while at < 0:
                    at += size
                grid[b, at] += value * tap[t]
