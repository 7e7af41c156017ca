"""Transforms time traces and range profiles to spectra, in the time convention ``exp(+jwt)``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert

from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.errors import InputError

Array = NDArray[np.floating]

STEP_TOLERANCE = 1e-3
"""Largest deviation of a step from the mean step, as a share of the mean."""

OCCUPIED_DB = -30.0
"""Level of the mean spectrum, relative to its strongest frequency [dB], below which the occupied band ends."""


def from_time(s: NDArray, time: Array, band: tuple[float, float] | None) -> tuple[Array, NDArray]:
    """Spectra of time traces: ``S(f) = sum_n s(t_n) exp(-j 2 pi f t_n)``.

    Parameters
    ----------
    s : (..., times) array
        Real traces, or analytic signals.
    time : (times,) array [s]
        In equal steps.
    band : (lower, upper) [Hz], optional
        Band to keep; by default the one that the signal occupies.

    Returns
    -------
    frequency : (frequencies,) array [Hz]
    spectra : (..., frequencies) complex array

    Raises
    ------
    InputError
        If the times are not in equal rising steps, or the band holds no frequency.
    """
    step = equal_steps(time, "time")
    count = time.size
    if np.iscomplexobj(s):
        frequency = np.fft.fftfreq(count, step)
        spectra = np.fft.fft(s, axis=-1)
        positive = frequency > 0.0
        frequency, spectra = frequency[positive], spectra[..., positive]
    else:
        frequency, spectra = np.fft.rfftfreq(count, step)[1:], np.fft.rfft(s, axis=-1)[..., 1:]
    keep = _kept(frequency, spectra, band)
    frequency, spectra = frequency[keep], spectra[..., keep]
    return frequency, spectra * np.exp(-2j * np.pi * frequency * time[0])


def from_beat(s: NDArray, frequency: Array) -> tuple[Array, NDArray]:
    """Complex samples of real beat signals, ``x(f) = Re S(f)``, in which no echo is later than half of ``1 / df``.

    Echoes of S have positive delays, those of its conjugate negative ones: S is the conjugate of the analytic signal of
    x (Marple, IEEE Trans. Signal Process. 47, 2600-2603, 1999). Every other frequency tells its delays.

    Parameters
    ----------
    s : (..., frequencies) real array
    frequency : (frequencies,) array [Hz]
        In equal steps, rising or falling.

    Returns
    -------
    frequency : (frequencies / 2,) array [Hz]
        Rising.
    samples : (..., frequencies / 2) complex array
    """
    if frequency[-1] < frequency[0]:
        s, frequency = s[..., ::-1], frequency[::-1]
    return frequency[::2], hilbert(s, axis=-1).conj()[..., ::2]


def from_range(
    s: NDArray, distance: Array, carrier: float, wave_speed: float, band: tuple[float, float] | None
) -> tuple[Array, NDArray]:
    """Spectra of complex range profiles: ``S(f) = sum_n s(r_n) exp(-j 2 pi (f - f_c) 2 r_n / c)``.

    An echo at the range R with the phase ``exp(-j 2 k_c R)`` becomes ``exp(-j 2 k R)`` times the spectrum of the pulse.

    Parameters
    ----------
    s : (..., ranges) complex array
    distance : (ranges,) array [m]
        In equal steps.
    carrier : float [Hz]
        Carrier from which the samples were mixed down.
    wave_speed : float [m/s]
    band : (lower, upper) [Hz], optional
        Band to keep; by default the one that the pulses occupy.

    Returns
    -------
    frequency : (frequencies,) array [Hz]
    spectra : (..., frequencies) complex array

    Raises
    ------
    InputError
        If the ranges are not in equal rising steps, or the band holds no frequency.
    """
    step = equal_steps(distance, "range")
    count = distance.size
    offset = (np.arange(count) - count // 2) * wave_speed / (2.0 * step * count)
    delay = 2.0 * distance[0] / wave_speed
    spectra = np.fft.fftshift(np.fft.fft(s, axis=-1), axes=-1) * np.exp(-2j * np.pi * offset * delay)
    frequency = carrier + offset
    keep = _kept(frequency, spectra, band)
    return frequency[keep], spectra[..., keep]


def equal_steps(values: Array, name: str) -> float:
    """The mean step of a row of values in equal rising steps.

    Raises
    ------
    InputError
        If the steps are not equal or not rising.
    """
    if values.size < 2:
        raise InputError(f"{name} has {values.size} values, expected two at least")
    step = np.diff(values)
    mean = float(step.mean())
    if not mean > 0.0 or np.abs(step - mean).max() > STEP_TOLERANCE * mean:
        raise InputError(
            f"{name} has steps from {step.min():g} to {step.max():g}, expected equal rising steps; resample it"
        )
    return mean


def _kept(frequency: Array, spectra: NDArray, band: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Which frequencies are within the band, or in the one that the signal occupies around its strongest frequency."""
    if band is not None:
        keep = (frequency >= band[0]) & (frequency <= band[1])
        if not keep.any():
            raise InputError(
                f"the band from {band[0]:g} to {band[1]:g} Hz holds none of the frequencies, which run from "
                f"{frequency[0]:g} to {frequency[-1]:g} Hz"
            )
        return np.asarray(keep)
    power = np.mean(np.abs(spectra.reshape(-1, frequency.size)) ** 2, axis=0) * (frequency > 0.0)
    peak = int(power.argmax())
    weak = np.flatnonzero(power < power_ratio_of(OCCUPIED_DB) * power[peak])
    lower = int(weak[weak < peak].max(initial=-1)) + 1
    upper = int(weak[weak > peak].min(initial=frequency.size))
    keep = np.zeros(frequency.size, dtype=bool)
    keep[lower:upper] = True
    return keep
