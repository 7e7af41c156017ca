"""Many windows of range in one sweep: the echoes of each window, at as few frequencies as it needs.

One transform over frequency turns the samples of all pairs into profiles over path length. A window cut out of the
profiles and transformed back by itself needs a shorter ambiguous range, and so fewer frequencies::

    p_n = 1/N sum_m a_m S_m exp(j 2 pi m n / N),          bins of the path d_n = 2 pi n / (N dk)
    c_q = N/M sum_n w_n p_n exp(-j 2 pi q n / M),         n over the M bins of the window
    sum_q c_q exp(j (k_0 + q dk N/M) d) = sum_m a_m S_m exp(j k_m d)      for paths d of the window.

The last line holds for echoes inside of the window; echoes far outside of it are left out, with side lobes that the
taper makes negligible. `range_gate` does the same for a single window by a filter over frequency.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, ifft, next_fast_len

from mirrorfold.common.statistics import mean_step
from mirrorfold.common.threads import cpu_count
from mirrorfold.common.types import Array

PADDED = 1.1
"""Length of the transform over the number of frequencies. To cut out a window spreads the samples over frequency; what
spreads beyond one end of the band must not wrap around to the other end."""

FLAT, EDGE = 3.0, 8.0
"""Range cells by which a window is longer than asked for, on either side: a flat part, since the main lobe under a Hann
taper is two cells wide to either side, then an edge that falls to zero, where side lobes are at least 55 dB down."""

WORTHWHILE = 0.5
"""A window is cut out only if it needs at most this share of the frequencies."""


class Window(NamedTuple):
    """Echoes from some ranges: `samples` (frequencies, ...) at wavenumbers `k` [rad/m], and their weights `taper`.

    `k` and `taper` are of shape (frequencies,).
    """

    k: Array
    samples: NDArray[np.complex64]
    taper: NDArray[np.float32]


class RangeWindows:
    """Cuts windows of range out of the samples of a sweep.

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
        self._step = mean_step(k)
        self._count = next_fast_len(int(np.ceil(PADDED * k.size)))
        self._profile: NDArray[np.complex64] | None = None

    def frequencies(self, shortest: float, longest: float) -> int:
        """Number of frequencies that paths between two lengths [m] need; all, where a window does not pay."""
        first, last = self._bins(shortest, longest)
        needed = int(next_fast_len(last - first + 1))
        return needed if needed <= WORTHWHILE * self._k.size else self._k.size

    @property
    def profile_bytes(self) -> float:
        """Memory of the profiles [bytes]."""
        return float(self._samples.nbytes / self._k.size * self._count)

    def transform(self) -> None:
        """Make the profiles from which windows are cut, once; before this call, `window` returns the whole sweep."""
        if self._profile is not None:
            return
        taper = self._taper.reshape(-1, *[1] * (self._samples.ndim - 1))
        padded = np.zeros((self._count, *self._samples.shape[1:]), dtype=np.complex64)
        np.multiply(self._samples, taper, out=padded[: self._k.size])
        self._profile = ifft(padded, axis=0, workers=cpu_count(), overwrite_x=True)

    def window(self, shortest: float, longest: float) -> Window:
        """The echoes with paths between two lengths [m]; echoes with far shorter or longer paths may be left out."""
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
        """First and last bin of the profiles in a window, its flat parts and edges included."""
        scale, beside = self._step * self._count / (2.0 * np.pi), (FLAT + EDGE) * self._count / self._k.size
        return int(np.floor(scale * shortest - beside)), int(np.ceil(scale * longest + beside))
