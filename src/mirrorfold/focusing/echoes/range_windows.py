"""Many windows of range in one sweep: the echoes of each, at as few frequencies as tell them from each other.

One transform over frequency turns the samples of all pairs into profiles over delay. What stands in a window of the
profiles, transformed back by itself, has a shorter ambiguous range, so that fewer frequencies hold it::

    p_n = 1/N sum_m a_m S_m exp(j 2 pi m n / N),          bins of the path d_n = 2 pi n / (N dk)
    c_q = N/M sum_n w_n p_n exp(-j 2 pi q n / M),         n over the M bins of the window
    sum_q c_q exp(j (k_0 + q dk N/M) d) = sum_m a_m S_m exp(j k_m d)      for paths d of the window.

The last line holds for what is inside of the window and, after the taper, for what is so far outside that its side
lobes count for nothing. `range_gate` does the same for a single window by a filter over frequency.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, ifft, next_fast_len

from mirrorfold.common.threads import cpu_count
from mirrorfold.common.types import Array

PADDED = 1.1
"""Frequencies of the transform over those of the sweep: a window is as smooth over frequency as it is long, and what it
spreads beyond the end of the band must not come back at the other end."""

FLAT, EDGE = 3.0, 8.0
"""Range cells that a window is longer than asked for on either side: flat, for the main lobe under a Hann taper is two
wide to either side; and falling to zero, where the side lobes are 55 dB down and more."""

WORTHWHILE = 0.5
"""Share of the frequencies that may remain for a window to pay."""


class Window(NamedTuple):
    """Echoes of some ranges: `samples` (frequencies, ...) at wavenumbers `k` [rad/m], and a `taper` to weigh them with.

    `k` and `taper` are of shape (frequencies,).
    """

    k: Array
    samples: NDArray[np.complex64]
    taper: NDArray[np.float32]


class RangeWindows:
    """The samples of a sweep, gated to windows of range.

    Parameters
    ----------
    k : (frequencies,) array [rad/m]
        Wavenumbers, in equal steps.
    samples : (frequencies, ...) array
    taper : (frequencies,) array
        Weights over frequency, small at the ends of the band.
    """

    def __init__(self, k: Array, samples: NDArray[np.complex64], taper: Array) -> None:
        self._k, self._samples, self._taper = k, samples, taper.astype(np.float32)
        self._step = float(k[-1] - k[0]) / max(k.size - 1, 1)
        self._count = next_fast_len(int(np.ceil(PADDED * k.size)))
        self._profile: NDArray[np.complex64] | None = None

    def frequencies(self, shortest: float, longest: float) -> int:
        """Number of frequencies that paths between two lengths [m] need; all where a window does not pay."""
        first, last = self._bins(shortest, longest)
        needed = int(next_fast_len(last - first + 1))
        return needed if needed <= WORTHWHILE * self._k.size else self._k.size

    @property
    def profile_bytes(self) -> float:
        """Memory of the profiles [bytes]."""
        return float(self._samples.nbytes / self._k.size * self._count)

    def transform(self) -> None:
        """Make the profiles that windows are cut from; until then a window holds the whole sweep."""
        taper = self._taper.reshape(-1, *[1] * (self._samples.ndim - 1))
        padded = np.zeros((self._count, *self._samples.shape[1:]), dtype=np.complex64)
        np.multiply(self._samples, taper, out=padded[: self._k.size])
        self._profile = ifft(padded, axis=0, workers=cpu_count(), overwrite_x=True)

    def window(self, shortest: float, longest: float) -> Window:
        """The echoes whose paths are between two lengths [m]; what is far outside of them may be left out."""
        count = self.frequencies(shortest, longest)
        if self._profile is None or count == self._k.size:
            return Window(self._k, self._samples, self._taper)
        first, last = self._bins(shortest, longest)
        bins = np.arange(first, first + count)
        inside = np.minimum(bins - first, last - bins) * self._k.size / (EDGE * self._count)
        weight = np.sin(0.5 * np.pi * np.clip(inside, 0.0, 1.0)) ** 2 * self._count / count
        cut = np.empty((count, *self._samples.shape[1:]), dtype=np.complex64)
        for into, of, share in zip(bins % count, bins % self._count, weight.astype(np.float32), strict=True):
            np.multiply(self._profile[of], share, out=cut[into])
        k = self._k[0] + self._step * self._count / count * np.arange(count)
        return Window(k, fft(cut, axis=0, overwrite_x=True), np.ones(count, dtype=np.float32))

    def _bins(self, shortest: float, longest: float) -> tuple[int, int]:
        """First and last bin of a window, its edges included."""
        scale, beside = self._step * self._count / (2.0 * np.pi), (FLAT + EDGE) * self._count / self._k.size
        return int(np.floor(scale * shortest - beside)), int(np.ceil(scale * longest + beside))
