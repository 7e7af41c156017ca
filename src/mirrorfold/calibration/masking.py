"""Bad channels and bad frequencies of a sweep: found in the data; then channels are left out, frequencies filled in."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.fft
import xarray as xr
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.ndimage import median_filter

from mirrorfold.calibration.record import blocks, samples_to_repair, scaled_to_single_precision, with_samples
from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.decibels import power_ratio_of, ratio_of
from mirrorfold.common.statistics import robust_deviation
from mirrorfold.errors import InputError

DEAD_DB = -40.0
"""Largest level of a dead channel relative to the median channel [dB]; echoes and antenna patterns cause no such
differences between the pairs of an array."""

CLIPPED_SHARE = 0.02
"""Smallest share of real and imaginary parts at their largest magnitude for which a channel counts as saturated."""

TONE = 1e-5
"""Largest difference between the moduli of a channel's samples, relative to the largest, at which they are taken for a
single echo without noise: its phases may repeat, and its largest real part with them."""

FEWEST_CLIPPED = 4
"""Smallest number of real and imaginary parts at their largest magnitude in a saturated channel; every channel has one
or two."""

HEAPED = 2.0
"""How many times more frequent the largest magnitude of a saturated channel must be than the next smaller one. In a
weak channel of a coarse converter, too, many samples share the largest value, but even more the next one."""

NOISE_FLATNESS = 0.85
"""Flatness above which an element holds noise alone: median over mean of its range profile, summed over its partners,
the elements of the other side. Noise has a flat profile."""

ECHO_FLATNESS = 0.6
"""Flatness of the median element below which the sweep as a whole holds echoes; otherwise no element is judged."""

FEWEST_PARTNERS = 8
"""Smallest number of partners whose profiles are summed; with fewer, the profile of noise is not flat."""

SPUR_DB = 3.0
"""Smallest deviation of a bad frequency's level from the median of its neighbours [dB]."""

SPUR_DEVIATIONS = 8.0
"""The same in robust standard deviations of the deviations of all frequencies."""

PREDICTED_FROM = 32
"""Number of frequencies on either side of a bad one from which its samples are predicted. Where echoes cancel each
other, as they do at one frequency in all channels of a short array, the prediction is right, and nothing is bad."""

NEIGHBOURS = 11
"""Number of neighbouring frequencies over which this median is taken, the frequency itself included."""

LARGEST_BAD_SHARE = 0.1
"""Largest share of the frequencies that can be bad; where more stand out, the scene causes it."""

FEWEST_CHANNELS = 8
"""Smallest number of channels in which spurs are searched. In a single channel, echoes that cancel each other at some
frequencies look like spurs, in every frame."""

ENOUGH = {"frequencies": 100, "channels": 4000, "predicted": 64, "partners": 16}
"""Largest numbers that are looked at, evenly spread, where there are more: medians are then exact to a tenth of a
decibel, and profiles of noise flat to some percent."""

CHANNEL_DIMENSIONS = ("frequency", "tx", "rx", "position", "azimuth", "elevation")
"""Dimensions of frequencies and channels; along any other, such as `frame`, the same channels are measured again."""


@dataclass(frozen=True, eq=False)
class Bad:
    """Channels and frequencies that should not be used.

    Attributes
    ----------
    dead, saturated, noise, undefined : arrays of bool, one for each channel or beam
        Whether the channel is silent; clipped; without echoes; partly not finite.
    frequencies : (frequencies,) array of bool
        Whether the frequency is a spur or a gap.
    """

    dead: NDArray[np.bool_]
    saturated: NDArray[np.bool_]
    noise: NDArray[np.bool_]
    undefined: NDArray[np.bool_]
    frequencies: NDArray[np.bool_]

    @property
    def channels(self) -> NDArray[np.bool_]:
        """Channels that are bad for any reason."""
        return self.dead | self.saturated | self.noise | self.undefined

    def sentences(self) -> list[str]:
        """What was found, a phrase for each kind of bad channels and for bad frequencies."""
        found = []
        for name, mask in (
            ("silent", self.dead),
            ("saturated", self.saturated),
            ("without any echo", self.noise),
            ("partly not finite (NaN or infinite)", self.undefined),
        ):
            if mask.any():
                found.append(f"{int(mask.sum())} of {mask.size} channels {name}")
        if self.frequencies.any():
            places = ", ".join(map(str, np.flatnonzero(self.frequencies)[:5]))
            more = ", ..." if self.frequencies.sum() > 5 else ""
            found.append(
                f"{int(self.frequencies.sum())} bad frequencies of {self.frequencies.size} (number {places}{more})"
            )
        return found


def find_bad(sweep: xr.Dataset) -> Bad:
    """Find channels and frequencies of a sweep that should not be used.

    Parameters
    ----------
    sweep : xarray.Dataset
        Samples may be NaN or infinite; the sweep need not be valid otherwise.

    Returns
    -------
    Bad
    """
    sweep = samples_to_repair(sweep, "find_bad")
    s = _by_frequency(sweep)
    count = s.shape[0]
    finite = np.isfinite(s)
    gaps = _gaps(finite, _leading(sweep))
    gap = np.asarray(gaps.reshape(count, -1).all(axis=1)) | _dropped(s)
    undefined = ~(finite | gaps).all(axis=0)
    if not finite.all():
        s = np.where(finite, s, 0.0)
    s = scaled_to_single_precision(s)
    some = s[np.flatnonzero(~gap)[_spread(count - np.count_nonzero(gap), ENOUGH["frequencies"])]]
    power = np.median(np.abs(some) ** 2, axis=0) if len(some) else np.zeros(s.shape[1:])
    typical = float(np.median(power[power > 0])) if (power > 0).any() else 0.0
    silent = power <= power_ratio_of(DEAD_DB) * typical
    # A beam of a raster scan that meets nothing is rightly silent.
    dead = np.zeros_like(silent) if "azimuth" in sweep["s"].dims else silent
    frames = math.prod(sweep.sizes[name] for name in sweep["s"].dims if name not in CHANNEL_DIMENSIONS)
    frequencies = gap | _spurs(s, gap, silent) if silent.size >= FEWEST_CHANNELS * frames else gap
    if frequencies.any():
        s = np.where(frequencies.reshape(-1, *[1] * (s.ndim - 1)), 0.0, s)
    (clipped, below), tone = np.zeros((2, *s.shape[1:]), dtype=int), np.zeros(s.shape[1:], dtype=bool)
    for n in range(s.shape[1]):  # one at a time, to save memory
        for part in (np.abs(s[:, n].real), np.abs(s[:, n].imag)):
            largest = part >= part.max(axis=0) * np.asarray(1.0 - 1e-6, part.dtype)
            clipped[n] += np.count_nonzero(largest, axis=0)
            smaller = np.where(largest, 0.0, part)
            below[n] += np.count_nonzero((smaller == smaller.max(axis=0)) & ~largest, axis=0)
        modulus = np.abs(s[~frequencies, n])
        tone[n] = np.ptp(modulus, axis=0) <= TONE * modulus.max(axis=0)
    tone &= clipped < 2 * count  # clipped throughout, all samples have one modulus, too
    saturated = ~silent & ~tone & (clipped >= max(FEWEST_CLIPPED, CLIPPED_SHARE * 2 * count))
    saturated &= clipped > HEAPED * below
    noise = np.zeros(s.shape[1:], dtype=bool)
    if s.ndim == 3 and "tx" in sweep["s"].dims:
        noise = ~silent & ~saturated & _noise_elements(s, ~silent)
    if "measured" in sweep.variables and dead.shape[-sweep["measured"].ndim :] == sweep["measured"].shape:
        dead &= sweep["measured"].values.astype(bool)  # pairs that were not measured are not dead
    return Bad(dead & ~undefined, saturated & ~undefined, noise & ~undefined, undefined, frequencies)


def mask_bad(sweep: xr.Dataset, bad: Bad | None = None) -> xr.Dataset:
    """Set bad channels of a sweep to zero, and fill in bad frequencies from the good ones.

    Channels that are bad in all frames count as not measured from then on, see `mirrorfold.sweep`. A bad frequency is
    predicted by the linear estimate with the least mean square error for echoes with the mean range profile that the
    good frequencies show (Wiener, 1949).

    Parameters
    ----------
    sweep : xarray.Dataset
        Samples may be NaN.
    bad : Bad, optional
        What `find_bad` finds by default.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If no good channel or frequency is left, or `bad` belongs to another sweep.
    """
    if bad is not None and not isinstance(bad, Bad):
        raise wrong_kind("mask_bad", bad, "what find_bad returns", reader="")
    sweep = samples_to_repair(sweep, "mask_bad")
    bad = find_bad(sweep) if bad is None else bad
    if not (~bad.frequencies).any() or bad.channels.all():
        raise InputError("mask_bad: no good channel or frequency is left; measure again")
    axis, leading = sweep["s"].get_axis_num("frequency"), _leading(sweep)
    s = np.array(_by_frequency(sweep))
    if bad.frequencies.shape != s.shape[:1] or bad.dead.shape != s.shape[1:]:
        raise InputError(
            f"mask_bad: bad is that of a sweep of {bad.frequencies.size} frequencies and channels {bad.dead.shape}, "
            f"this one has {len(s)} and {s.shape[1:]}; give what find_bad returns for it"
        )
    s[:, bad.channels] = 0.0
    finite = np.isfinite(s)
    bad_everywhere = bad.frequencies.reshape(-1, *[1] * (s.ndim - 1))
    bad_of_frame = _gaps(finite, leading) | bad_everywhere
    s[~finite] = 0.0
    if (bad_of_frame == bad_everywhere).all():
        s = _filled(s, bad.frequencies) if bad.frequencies.any() else s
    else:
        for frame in np.ndindex(s.shape[1 : 1 + leading]):
            s[:, *frame] = _filled(s[:, *frame], bad_of_frame[:, *frame].ravel())
    step = f"masked: {', '.join(bad.sentences()) or 'nothing bad found'}"
    masked = with_samples(sweep, np.moveaxis(s, 0, axis), step)
    never = bad.channels.all(axis=tuple(range(leading)))
    if "azimuth" in sweep["s"].dims or not never.any():
        return masked
    dims = [name for name in sweep["s"].dims if name != "frequency"][leading:]
    measured = sweep["measured"].values.astype(bool) & ~never if "measured" in sweep.variables else ~never
    return masked.assign_coords(measured=(dims, measured))


def _leading(sweep: xr.Dataset) -> int:
    """Number of dimensions of the samples, such as `frame`, before those of frequencies and channels."""
    of_channels = [name in CHANNEL_DIMENSIONS for name in sweep["s"].dims]
    return of_channels.index(True)


def _gaps(finite: NDArray[np.bool_], leading: int) -> NDArray[np.bool_]:
    """Frequencies at which most channels of a frame are not finite, (frequencies, frames ..., 1 ...).

    Frames in which all frequencies would be gaps have none.
    """
    gaps = np.asarray(finite.mean(axis=tuple(range(1 + leading, finite.ndim)), keepdims=True) < 0.5)
    return gaps & ~gaps.all(axis=0)


def _dropped(s: NDArray[np.complexfloating]) -> NDArray[np.bool_]:
    """Frequencies between others at which all samples (frequencies, ...) are zero, because they were lost.

    At the ends of the band zeros are harmless, and common: those of a window, or those that were appended.
    """
    held = np.asarray(s.reshape(len(s), -1).any(axis=1))
    return np.asarray(~held & (np.cumsum(held) > 0) & (np.cumsum(held[::-1])[::-1] > 0))


def _by_frequency(sweep: xr.Dataset) -> NDArray[np.complexfloating]:
    """Samples with frequency as the first dimension."""
    return np.moveaxis(sweep["s"].values, sweep["s"].get_axis_num("frequency"), 0)


def _spread(count: int, enough: int) -> NDArray[np.int64]:
    """Indices of `count` items, or of `enough` evenly spread ones where there are more."""
    return np.linspace(0, count - 1, min(count, enough)).astype(np.int64)


def _noise_elements(s: NDArray[np.complexfloating], usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Channels (tx, rx) of elements whose range profile is flat, where those of most others are not."""
    if min(s.shape[1:]) < FEWEST_PARTNERS or s.shape[0] < 32:
        return np.zeros(s.shape[1:], dtype=bool)
    s = s[: scipy.fft.prev_fast_len(s.shape[0])]
    found = np.zeros(s.shape[1:], dtype=bool)
    for axis in (1, 2):
        partners = _spread(s.shape[3 - axis], ENOUGH["partners"])
        profile = np.abs(scipy.fft.ifft(s.take(partners, axis=3 - axis), axis=0)) ** 2
        level = profile.mean(axis=0)
        weight = usable.take(partners, axis=2 - axis) & (level > 0)
        total = (profile * (weight / np.where(level > 0, level, 1.0))).sum(axis=3 - axis)
        mean = total.mean(axis=0)
        flatness = np.where(mean > 0, np.median(total, axis=0) / np.where(mean > 0, mean, 1.0), 0.0)
        if np.median(flatness) < ECHO_FLATNESS:
            found |= np.expand_dims(flatness > NOISE_FLATNESS, axis=2 - axis)
    return found


def _spurs(s: NDArray[np.complexfloating], gap: NDArray[np.bool_], silent: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Frequencies whose level, the median over the channels, deviates from that of their neighbours, (frequencies,)."""
    good = np.flatnonzero(~silent)
    if s.shape[0] < 2 * NEIGHBOURS or not good.size or gap.all():
        return np.zeros(s.shape[0], dtype=bool)
    some = good[_spread(good.size, ENOUGH["channels"])]
    power = np.median(np.abs(s.reshape(s.shape[0], -1)[:, some]) ** 2, axis=1)
    smallest = max(1e-12 * float(np.median(power)), np.finfo(float).tiny)
    level = 10.0 * np.log10(np.maximum(power, smallest))
    level[gap] = np.median(level[~gap])
    deviation = np.abs(level - median_filter(level, NEIGHBOURS, mode="nearest"))
    spread = robust_deviation(deviation[~gap])
    found = ~gap & (deviation > max(SPUR_DB, SPUR_DEVIATIONS * spread))
    if found.mean() > LARGEST_BAD_SHARE:
        return np.zeros_like(found)
    few = good[_spread(good.size, ENOUGH["predicted"])]
    least = (1.0 - ratio_of(-SPUR_DB)) ** 2
    confirmed = found.copy()
    for n in np.flatnonzero(found):
        first = max(0, int(n) - PREDICTED_FROM)
        near = slice(first, int(n) + PREDICTED_FROM + 1)
        samples, bad = s.reshape(s.shape[0], -1)[near, few], (found | gap)[near]
        if bad.mean() < 0.5:
            wrong = (_filled(samples, bad) - samples)[n - first]
            confirmed[n] = np.median(np.abs(wrong) ** 2) > least * power_ratio_of(np.median(level[near]))
    return confirmed


def _filled(s: NDArray[np.complexfloating], bad: NDArray[np.bool_]) -> NDArray[np.complexfloating]:
    """Samples (frequencies, ...) with the bad frequencies predicted from the good ones."""
    count = s.shape[0]
    flat = s.reshape(count, -1)
    good = ~bad
    filled = np.where(good[:, None], flat, 0.0)
    for _ in range(FILLING_ROUNDS):
        # The covariance of two frequencies depends only on their distance. Its sums are not divided by their number of
        # terms, which falls with distance, because the covariance matrix would then not be positive semidefinite.
        power = np.zeros(2 * count)
        for some in blocks(flat.shape[1], flat.nbytes):
            power += np.sum(np.abs(np.fft.fft(filled[:, some], 2 * count, axis=0)) ** 2, axis=1)
        covariance = np.fft.ifft(power)[:count]
        matrix = toeplitz(covariance, np.conj(covariance))
        ridge = REGULARISATION * float(covariance[0].real) * np.eye(int(good.sum()))
        predict = np.linalg.solve((matrix[np.ix_(good, good)] + ridge).T, matrix[np.ix_(bad, good)].T).T
        filled[bad] = predict @ flat[good]
    return filled.reshape(s.shape)


FILLING_ROUNDS = 4
"""Number of estimates of the covariance; each uses the samples that were filled in by means of the one before."""

REGULARISATION = 1e-4
"""Power of the noise relative to that of the samples in the prediction; with less, errors of the covariance matter."""
