"""Whether I and Q of a receiver are out of balance, from the mirror images of echoes in range.

If the gains of both channels differ, or their phases by other than 90 degrees, the samples are

    s = x + b conj(x)

in place of x, with a constant b. Conjugation reverses time, so an echo at the range r has an image at ``R - r``, with
the ambiguous range R: it seems to have wrapped around. In the range profiles P of all channels, ``P(-r)`` is then
``b conj(P(r))``, with one b for all ranges and channels. Echoes that have truly wrapped around have phases of their
own.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.fft import ifft

from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.windows import hann
from mirrorfold.diagnosis.findings import Finding

LEAST = 0.01
"""Smallest b that is reported: images 40 dB below their echoes lie below what is folded."""

LARGEST = 0.5
"""Largest b that is taken for an imbalance: of a gain three times that of the other channel."""

BINS = (8, 16, 32)
"""Numbers of the strongest range bins that are looked at: fewer where few echoes stand out of the noise."""

ALIKE, AGREED = 0.3, 0.6
"""Largest deviation of the b of a range bin, as a share of b, and least share of the bins that must be within. One of
random phase is so close by chance in a twentieth of all cases, and five of eight in one of a hundred thousand."""

APART = 4
"""Number of bins from one to the next, from range zero and from half of the ambiguous range, where the main lobe of the
Hann window would hold an echo and its image."""

ENOUGH_CHANNELS, FEWEST_CHANNELS = 1000, 8
"""Largest number of channels that is looked at, and smallest that tells."""

FLOOR_DB = -100.0
"""Level against the strongest range bin under which a bin holds rounding errors of single precision [dB]."""

SURE = 0.95
"""Certainty of a finding."""


def imbalance_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that each echo of a valid sweep has an image at the mirrored range; empty where it has none."""
    s = sweep["s"].values
    s = s.reshape(len(s), -1)
    some = np.linspace(0, s.shape[1] - 1, min(s.shape[1], ENOUGH_CHANNELS)).astype(int)
    if len(s) < 2 * APART * (BINS[0] + 2) or some.size < FEWEST_CHANNELS:
        return []
    b = _balance(s[:, some].astype(complex))
    if b is None or not LEAST <= abs(b) <= LARGEST:
        return []
    what = (
        f"Every echo has an image at the mirrored range, {-20.0 * np.log10(abs(b)):.0f} dB weaker, as if it had "
        "wrapped around: I and Q are out of balance, in gain or in phase."
    )
    factor = f"({b.real:.4f}{b.imag:+.4f}j)"
    remedy = f"balance the receiver, or take the images off in Python: sweep['s'] = s - {factor} * s.conj()"
    return [Finding("iq-imbalance", what, SURE, remedy, by_command=False)]


def _balance(s: NDArray[np.complex128]) -> complex | None:
    """The b of ``s = x + b conj(x)`` in samples (frequencies, channels); None where the bins agree on none."""
    count = len(s)
    profile = ifft(s * hann(count)[:, None], axis=0)
    near = np.arange(APART, count // 2 - APART)
    power = np.sum(np.abs(profile) ** 2, axis=1)
    at = np.where(power[near] >= power[-near], near, -near)  # of an echo and its image, the stronger is the echo
    least = float(power.max()) * power_ratio_of(FLOOR_DB)
    chosen: list[int] = []
    for n in at[np.argsort(power[at])[::-1]]:
        if len(chosen) < BINS[-1] and all(abs(abs(n) - abs(other)) >= APART for other in chosen) and power[n] > least:
            chosen.append(int(n))
    each = np.sum(profile[chosen] * profile[-np.array(chosen, int)], axis=1) / power[chosen]
    for size in BINS:
        if size <= each.size:
            b = complex(np.median(each[:size].real), np.median(each[:size].imag))
            agree = np.abs(each[:size] - b) <= ALIKE * abs(b)
            if np.mean(agree) >= AGREED:
                return complex(np.average(each[:size][agree], weights=power[chosen[:size]][agree]))
    return None
