"""Chips and small arrays whose antennas stand in another order than the file says, or at another pitch.

With a few antennas, most range bins hold one echo, which is a plane wave: over all pairs the samples of its bin have
the phase ``k u (x_i + x_k)``, with one sine u of its direction. With receivers in the opposite order, two antennas
exchanged, or the pitch of one side doubled against the other, no direction fits, but one does once the positions are
put right. So each of these slips is tried, and that which fits all loud bins much better than the stated positions is
named. What no plane wave tells apart is named together: transmitters in the opposite order make the mirror image of
receivers in the opposite order, and both in it a correct sweep of the mirrored scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.sweep.pairs import Pairs

CHANNELS = 12, 64
"""Smallest and largest number of pairs of a small array: with fewer, elements with phases of their own may happen to
fit a slip."""

ON_A_LINE = 0.125
"""Largest distance of antennas from their line, in wavelengths; a vertical one would need a second angle."""

SHORT = 1.0
"""Largest extent of both arrays together, times the bandwidth over the wave speed: in a larger one echoes move from bin
to bin."""

FLAT = 0.5
"""Largest phase [rad] at the ends of the arrays that is due to the curvature of waves, or to the distance between both
arrays; nearer echoes are left out."""

LOUD = 30.0
"""Smallest power of a range bin, relative to that of noise."""

QUIET = 0.25
"""Share of the range bins whose powers are taken to be at most that of noise."""

FEWEST_BINS, FEWEST_FREQUENCIES = 4, 32
"""Smallest number of peaks of the range profile, and of frequencies, for a judgement."""

DIRECTIONS = 8
"""Number of sines that are tried for each direction that the array tells apart."""

UNEXPLAINED = 0.02
"""Share of the power of a bin that is taken to fit no wave, in addition to what is measured; see `mistakes`."""

WELL, BETTER = 2.0, 0.5
"""Smallest mean of ``-ln(1 - coherence)`` of the bins at the right positions, and smallest gain over the stated ones.
Elements with random phases reached 1.7 in the best of all slips."""

CLEAR = 0.25
"""Smallest difference of this mean to that of any other slip."""

SURE = 0.95
"""Certainty of a finding."""


class Slip(NamedTuple):
    """Positions that may be the right ones, along the array, of transmitters and of receivers.

    Slips of the same `kind` are not told apart by plane waves.
    """

    kind: str
    tx: Array
    rx: Array


def few_antenna_findings(pairs: Pairs) -> list[Finding]:
    """The finding that the antennas of a small array stand in another order, or at another pitch, than is stated."""
    count = len(pairs.tx) * len(pairs.rx)
    if not CHANNELS[0] <= count <= CHANNELS[1] or len(pairs.tx_of) != count or len(pairs.s) < FEWEST_FREQUENCIES:
        return []
    apart = float(np.linalg.norm(pairs.tx.mean(axis=0) - pairs.rx.mean(axis=0)))
    tx, rx = (places - places.mean(axis=0) for places in (pairs.tx, pairs.rx))
    across = np.concatenate([tx, rx]) @ pairs.axes[1:].T
    if not pairs.s.any(axis=0).all() or np.abs(across).max(initial=0.0) > ON_A_LINE * pairs.wavelength:
        return []
    tx, rx = tx @ pairs.axes[0], rx @ pairs.axes[0]
    band = float(np.ptp(pairs.wavenumber))
    if (np.ptp(tx) + np.ptp(rx)) * band > SHORT * 2.0 * np.pi:
        return []
    centre = float(pairs.wavenumber.mean())
    half = 0.5 * max(np.ptp(tx), np.ptp(rx))
    loud = _loud(pairs, farther_than=centre * half * (0.5 * half + apart) / FLAT)
    if loud.shape[0] < FEWEST_BINS:
        return []
    stated, best = _fit(loud, Slip("", tx, rx), centre), dict[str, float]()
    for slip in _slips(tx, rx):
        best[slip.kind] = max(_fit(loud, slip, centre), best.get(slip.kind, 0.0))
    kind = max(best, key=best.__getitem__)
    others = max((fit for other, fit in best.items() if other != kind), default=0.0)
    if best[kind] < max(WELL, stated + BETTER, others + CLEAR):
        return []
    what = f"Each echo is a plane wave only if {kind}: the positions in the file are not those of the antennas."
    return [Finding("antenna-order", what, SURE, "import the sweep again with these positions", by_command=False)]


def _slips(tx: Array, rx: Array) -> Iterator[Slip]:
    """The slips that are tried, by the positions of transmitters and receivers along the array."""
    turned = "the receivers, or the transmitters, stand in the opposite order"
    yield Slip(turned, tx, rx[::-1])
    for doubled, name in (((2.0, 1.0), "transmitters"), ((1.0, 2.0), "receivers")):
        kind = f"the {name} stand twice as far apart, or the others half as far"
        yield Slip(kind, doubled[0] * tx, doubled[1] * rx)
        yield Slip(kind, tx / doubled[1], rx / doubled[0])
    for side, (name, places) in enumerate((("transmitters", tx), ("receivers", rx))):
        for i, k in combinations(range(places.size), 2):
            order = np.arange(places.size)
            order[[i, k]] = order[[k, i]]
            swapped = places[order]
            kind = turned if np.allclose(swapped, places[::-1]) else f"{name} {i + 1} and {k + 1} are exchanged"
            yield Slip(kind, tx if side else swapped, swapped if side else rx)


def _loud(pairs: Pairs, *, farther_than: float) -> NDArray[np.complex128]:
    """The peaks of the range profile beyond a range [m], (peaks, pairs), each of unit power."""
    count = len(pairs.s)
    profile = np.fft.ifft(pairs.s * hann(count)[:, None], axis=0)
    power = np.mean(np.abs(profile) ** 2, axis=1)
    peak = (power >= np.roll(power, 1)) & (power >= np.roll(power, -1)) & (power > LOUD * np.quantile(power, QUIET))
    peak &= np.pi / float(np.ptp(pairs.wavenumber)) * np.arange(count) > farther_than
    found = profile[peak]
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _fit(loud: NDArray[np.complex128], slip: Slip, wavenumber: float) -> float:
    """Mean of ``-ln(1 - coherence)`` over the bins (bins, pairs), each in the direction that fits it best."""
    x = np.add.outer(slip.tx, slip.rx).ravel()
    u = np.linspace(-1.0, 1.0, int(DIRECTIONS * (2.0 + wavenumber * np.ptp(x) / np.pi)))
    coherent = np.abs(loud @ np.exp(-1j * wavenumber * np.outer(x, u))) ** 2 / x.size
    return float(np.mean(-np.log(1.0 - np.minimum(coherent.max(axis=1), 1.0) + UNEXPLAINED)))
