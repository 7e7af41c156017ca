"""The fit behind `elements`: delays and gains of single elements, from the samples of all pairs, to micrometres.

The known path over a reflector and the common delay are removed from all samples. What is left in pair (i, k) is the
delay ``t_i + r_k``. First the delay of each pair is searched, and medians over the pairs give first values of t and r.
Then transmitters and receivers are refined in turn: for each element, the samples of its pairs are added up, and the
delay is taken at which the sum over frequency is strongest. Pairs that do not fit count less. Finally the phase at the
carrier refines the delays, if the elements' phases agree.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mirrorfold.calibration.record import blocks
from mirrorfold.common.statistics import robust_deviation
from mirrorfold.common.types import Array, Complex
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError

STEPS_PER_CELL = 16
"""Steps per resolution cell of the path, ``c / B``, in the search for a delay. The parabola through the best three is
then exact to a few micrometres, and Newton's method does the rest."""

ITERATIONS = 8
"""Alternations between transmitters and receivers; each reduces the error by an order of magnitude."""

SEARCHES = 3
"""Number of the first alternations, which search for delays over an interval; the later ones only refine them."""

MISFIT = 3.0
"""Pairs whose misfit exceeds this many robust standard deviations count less, by the square of the excess (Huber and
Ronchetti, Robust Statistics, 2009, with a redescending tail)."""

LARGEST_EXCESS = 1e6
"""Largest excess that lowers the weight of a pair; with it, a pair practically does not count."""

LEAST_RELATIVE_STRENGTH = 0.25
"""An element is valid if the strength of the reflector's echo, its median over the pairs of the element, exceeds this
share of the median over all elements."""

DETECTION = 20.0
NOISE_PER_ELEMENT = 3.5
"""Smallest power of the reflector's echo, added up over all pairs and frequencies, relative to what random phases would
give: `DETECTION`, plus `NOISE_PER_ELEMENT` for each element. Noise alone, with delays and gains of 6 to 82 elements
fitted to it at the best of up to 1001 common delays, reached 2.6 for each element above the first in 235 draws."""

LARGEST_PHASE_SPREAD = 0.7
"""Largest standard deviation of the elements' carrier phases [rad] at which these are taken for the effect of small
delays, so that they refine the delays. It is a tenth of a wavelength, well below the half at which phases become
ambiguous."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Delays [m] and complex gains of all elements, from one sweep of the reflector at one place; see `fit_delays`.

    `tx_valid` and `rx_valid` say which elements received its echo, and `residual` [m] is the root mean square of what
    the delays leave unexplained. A delay turns the phase of the echo by `carrier` [rad/m].
    """

    tx_delay: Array
    rx_delay: Array
    tx_gain: Complex
    rx_gain: Complex
    tx_valid: NDArray[np.bool_]
    rx_valid: NDArray[np.bool_]
    residual: float
    carrier: float

    @property
    def common(self) -> float:
        """Delay that all pairs share [m]: the mean over the valid transmitters plus that over the valid receivers."""
        return float(self.tx_delay[self.tx_valid].mean() + self.rx_delay[self.rx_valid].mean())

    def later(self, common: float) -> Fit:
        """The same fit with a common delay [m] added to all pairs, half of it to each side."""
        return replace(self, tx_delay=self.tx_delay + 0.5 * common, rx_delay=self.rx_delay + 0.5 * common)


def fit_delays(s: NDArray[np.complexfloating], k: Array, length: Array, *, largest_error: float) -> Fit:
    """Fit the model ``S[m, i, k] = a[m] g_i h_k exp(-j k_m (d_ik + t_i + r_k))`` to samples.

    The delays t, r [m] and the complex gains g, h belong to the transmitters i and the receivers k.

    Parameters
    ----------
    s : (frequencies, tx, rx) complex array
    k : (frequencies,) array [rad/m]
        Wavenumbers.
    length : (tx, rx) array [m]
        The paths d over the reflector, a delay common to all pairs included.
    largest_error : float [m]
        Largest magnitude of t and of r.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If the reflector's echo does not show.
    """
    taper = hann(k.size)[:, None, None]
    # The path over the reflector is removed, so that its echo stands at a delay near zero in every pair.
    aligned = np.empty(s.shape, dtype=np.complex128)
    for some in blocks(k.size, aligned.nbytes):
        aligned[some] = taper[some] * s[some] * np.exp(1j * k[some, None, None] * length)
    offset = k - k.mean()
    cell = 2.0 * np.pi / (k[-1] - k[0])
    delay, _ = _best_delay(aligned, offset, 2.0 * largest_error, cell)
    echo = np.zeros(s.shape[1:], dtype=np.complex128)
    for some in blocks(k.size, aligned.nbytes):
        echo += np.einsum("mik,mik->ik", aligned[some], np.exp(1j * offset[some, None, None] * delay))
    strength = np.abs(echo)
    tx_delay, rx_delay = _median_polish(delay, strength > 0)
    weight = _pair_weights(delay - tx_delay[:, None] - rx_delay, strength)
    tx_gain, rx_gain = np.ones(s.shape[1], complex), np.ones(s.shape[2], complex)
    for iteration in range(ITERATIONS):
        reach = max(0.5 * cell, largest_error) if iteration < SEARCHES else 0.0
        # Least squares: divided by the power of the weights, or an element of little weight would seem too weak.
        own = _summed(aligned, k, np.zeros_like(tx_delay), rx_delay, weight * np.conj(rx_gain), axis=2)
        own /= weight @ np.abs(rx_gain) ** 2
        tx_delay, tx_gain = _element(own, k, offset, tx_delay, reach, cell)
        own = _summed(aligned, k, tx_delay, np.zeros_like(rx_delay), weight * np.conj(tx_gain)[:, None], axis=1)
        own /= np.abs(tx_gain) ** 2 @ weight
        rx_delay, rx_gain = _element(own, k, offset, rx_delay, reach, cell)
        left = _summed(aligned, k, tx_delay, rx_delay, axis=0)
        if iteration >= SEARCHES:
            weight = _coherence_weights(left, tx_gain[:, None] * rx_gain)
    _check_detected(left, float(np.vdot(aligned, aligned).real), tx_gain, rx_gain)
    tx_valid, rx_valid = _sees_reflector(np.abs(left), axis=1), _sees_reflector(np.abs(left), axis=0)
    # A delay turns the phase of the echo by its mean wavenumber, which is not mid-band for a transducer's narrow pulse.
    spectrum = (own * np.exp(1j * k[:, None] * rx_delay)) @ np.conj(rx_gain)
    centre = float(np.real(k @ spectrum / spectrum.sum()))
    tx_delay, tx_gain = _refine_by_carrier(tx_delay, tx_gain, tx_valid, centre)
    rx_delay, rx_gain = _refine_by_carrier(rx_delay, rx_gain, rx_valid, centre)
    pairs = tx_valid[:, None] & rx_valid
    model = np.exp(1j * np.angle(tx_gain)[:, None] + 1j * np.angle(rx_gain))
    left = _summed(aligned, k, tx_delay, rx_delay, axis=0) * np.conj(model)
    common = np.angle(np.exp(1j * np.angle(left[pairs])).sum())
    misfit = np.angle(left[pairs] * np.exp(-1j * common)) / centre
    share = 0.5 * (tx_delay[tx_valid].mean() - rx_delay[rx_valid].mean())
    return Fit(
        tx_delay - share,
        rx_delay + share,
        tx_gain / np.median(np.abs(tx_gain[tx_valid])),
        rx_gain / np.median(np.abs(rx_gain[rx_valid])),
        tx_valid,
        rx_valid,
        float(np.sqrt(np.mean(misfit**2))),
        centre,
    )


def _summed(
    aligned: Complex, k: Array, tx_delay: Array, rx_delay: Array, weight: Complex | Array | float = 1.0, *, axis: int
) -> Complex:
    """The samples with the elements' delays removed, times a weight (tx, rx), summed over one axis, block by block."""
    parts = []
    for some in blocks(k.size, aligned.nbytes):
        turned = _delays_removed(aligned[some], k[some], tx_delay, rx_delay)
        turned *= weight
        parts.append(turned.sum(axis=axis))
    return np.sum(parts, axis=0) if axis == 0 else np.concatenate(parts)


def _delays_removed(aligned: Complex, k: Array, tx_delay: Array, rx_delay: Array) -> Complex:
    """The samples with the elements' delays removed, (frequencies, tx, rx)."""
    turned = aligned * np.exp(1j * k[:, None] * tx_delay)[:, :, None]
    turned *= np.exp(1j * k[:, None] * rx_delay)[:, None, :]
    return turned


def _best_delay(samples: Complex, offset: Array, reach: float, cell: float) -> tuple[Array, Array]:
    """Delays [m] within +-reach at which samples (frequencies, ...) add up to the largest sum, and its magnitude."""
    steps = max(int(np.ceil(reach / cell * STEPS_PER_CELL)), 2)
    search = np.linspace(-reach, reach, 2 * steps + 1)
    shape, samples = samples.shape[1:], samples.reshape(offset.size, -1)
    sums = np.empty((search.size, samples.shape[1]))
    for some in blocks(samples.shape[1], samples.nbytes):
        sums[:, some] = np.abs(np.exp(1j * search[:, None] * offset) @ samples[:, some])
    best = np.clip(sums.argmax(axis=0), 1, search.size - 2)
    low, middle, high = (sums[best + step, np.arange(sums.shape[1])] for step in (-1, 0, 1))
    bend = low - 2.0 * middle + high
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0, 0.5 * (low - high) / bend, 0.0)
    delay = search[best] + np.clip(shift, -1.0, 1.0) * (search[1] - search[0])
    return delay.reshape(shape), middle.reshape(shape)


def _element(
    samples: Complex, k: Array, offset: Array, delay: Array, reach: float, cell: float
) -> tuple[Array, Complex]:
    """Delays t [m] and gains g for which ``g exp(-j k t)`` fits samples (frequencies, elements) best.

    They are searched within +-reach [m] of the known `delay` (elements,), then refined by Newton's method. The gains
    are relative to the median magnitude.
    """
    if reach > 0:
        change, _ = _best_delay(samples * np.exp(1j * k[:, None] * delay), offset, reach, cell)
        delay = delay + change
    for _ in range(3):  # Newton's method on |sum|^2, whose maximum is a parabola within a fraction of a cell
        turned = samples * np.exp(1j * k[:, None] * delay)
        sum0, sum1 = turned.sum(axis=0), (1j * offset[:, None] * turned).sum(axis=0)
        sum2 = -((offset**2)[:, None] * turned).sum(axis=0)
        slope = 2.0 * np.real(np.conj(sum0) * sum1)
        curvature = 2.0 * (np.abs(sum1) ** 2 + np.real(np.conj(sum0) * sum2))
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(curvature < 0, -slope / curvature, 0.0)
        delay = delay + np.clip(step, -0.25 * cell, 0.25 * cell)
    gain = (samples * np.exp(1j * k[:, None] * delay)).sum(axis=0)
    typical = np.median(np.abs(gain))
    return delay, gain / typical if typical > 0 else np.ones_like(gain)


def _median_polish(delay: Array, usable: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Delays t (tx,) and r (rx,) whose sums fit most delays (tx, rx) of pairs: the median polish.

    Pairs that are not `usable` do not count (Tukey, Exploratory Data Analysis, 1977, chapter 11).
    """
    left = np.where(usable, delay, np.nan)
    tx_delay, rx_delay = np.zeros(delay.shape[0]), np.zeros(delay.shape[1])
    for _ in range(ITERATIONS):
        for axis, found in ((1, tx_delay), (0, rx_delay)):
            empty = np.isnan(left).all(axis=axis)
            middle = np.nanmedian(np.where(np.expand_dims(empty, axis), 0.0, left), axis=axis)
            found += middle
            left = left - np.expand_dims(middle, axis)
    return tx_delay, rx_delay


def _pair_weights(misfit: Array, strength: Array) -> Array:
    """Weights of the pairs by the misfit of their delays; practically zero for silent pairs; (tx, rx)."""
    usable = strength > 0
    if not usable.any():
        raise InputError("the sweep is silent at the reflector's range; check its place")
    scale = robust_deviation(misfit[usable]) + np.finfo(float).tiny
    excess = np.clip(np.abs(misfit) / (MISFIT * scale), 1.0, LARGEST_EXCESS)
    return np.where(usable, 1.0 / excess**2, 1.0 / LARGEST_EXCESS**2)


def _coherence_weights(left: Complex, gain: Complex) -> Array:
    """Weights of the pairs (tx, rx) by how far their sums over frequency, `left`, deviate from the model, `gain`.

    The ratio of both is the same for all pairs that fit; its deviation from the median ratio counts.
    """
    expected = np.abs(gain)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(expected > 0, left / gain, 0.0)
    middle = np.median(ratio.real) + 1j * np.median(ratio.imag)
    misfit = np.abs(ratio - middle)
    scale = robust_deviation(misfit) + np.finfo(float).tiny
    excess = np.clip(misfit / (MISFIT * scale), 1.0, LARGEST_EXCESS)
    return np.asarray(1.0 / excess**2)


def _sees_reflector(strength: Array, axis: int) -> NDArray[np.bool_]:
    """Which elements see the reflector: the median strength over their pairs is not far below that of the others.

    The median is taken over the axis of the other side's elements.
    """
    own = np.median(strength, axis=axis)
    return np.asarray(own > LEAST_RELATIVE_STRENGTH * np.median(own))


def _check_detected(left: Complex, power: float, tx_gain: Complex, rx_gain: Complex) -> None:
    """Refuse a sweep whose echoes, summed over frequency to `left` (tx, rx), do not add up in phase.

    Their gain of power, over the `power` of all samples, is compared with `DETECTION` and `NOISE_PER_ELEMENT`; random
    phases have a gain of one.
    """
    in_phase = left * np.exp(-1j * (np.angle(tx_gain)[:, None] + np.angle(rx_gain)))
    gain = float(np.abs(in_phase.sum()) ** 2) / power if power > 0 else 0.0
    if gain < DETECTION + NOISE_PER_ELEMENT * sum(left.shape):
        raise InputError(
            "the reflector is not heard: the echoes of the elements do not add up at its place; "
            "check the place, subtract the background, or give no cable length, which the reflector tells"
        )


def _refine_by_carrier(delay: Array, gain: Complex, valid: NDArray[np.bool_], centre: float) -> tuple[Array, Complex]:
    """Refine the delays [m] by the gains' phases at the carrier, where the phases of the elements agree.

    The refined delays contain the phases, and the gains become real. Where the phases do not agree, both stay as they
    are, but for the phase that all gains have in common, which belongs to the reflector and is removed either way.
    """
    common = np.angle(np.exp(1j * np.angle(gain[valid])).sum())
    phase = np.angle(gain * np.exp(-1j * common))
    for _ in range(3):  # a few outliers shift the circular mean, but not the median
        middle = float(np.median(phase[valid]))
        phase, common = np.angle(np.exp(1j * (phase - middle))), common + middle
    spread = robust_deviation(phase[valid])
    if spread > LARGEST_PHASE_SPREAD:
        return delay, gain * np.exp(-1j * common)
    phase -= float(phase[valid].mean())  # the mean delay stays: the phase does not tell it
    return delay - phase / centre, np.abs(gain).astype(complex)
