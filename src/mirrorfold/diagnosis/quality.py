"""Mistakes in the samples and the axes of a sweep that can be recognised whatever the scene is."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.masking import Bad, find_bad
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.plausible import any_nonzero, constant_part, not_finite
from mirrorfold.diagnosis.findings import CERTAIN, Finding
from mirrorfold.sweep import STEP_TOLERANCE, frequency_unit_of, uneven_steps, without_rounding

MASK = "--mask"
"""Option of `mirrorfold calibrate` that masks bad channels and fills in bad frequencies."""

AGAIN = "no channel is good, so none can be masked; measure again, saturated channels with less power or gain"
"""Advice where `MASK` would leave nothing."""

SURE_BY_LEVEL = 0.95
"""Certainty that channels are saturated or hold noise, and that frequencies are bad: scenes hardly ever cause it."""

SURE_OF_UNIT = 0.95
"""Certainty that frequencies are in another unit; the other explanation is that the wave speed was not stated."""

FEWEST_PHASES, ENOUGH_PHASES = 1000, 100_000
"""Smallest number of samples whose phases tell their unit; largest number that is looked at."""

FILLED, EVEN = 0.98, 0.8
"""Share of an interval up to which phases reach, and least share of the deviation that even ones have: those of a few
strong echoes are uneven."""

FEWEST_TIMES, FEWEST_CHANNELS, ENOUGH_CHANNELS = 32, 64, 400
"""Smallest numbers of frequencies and channels that tell time from frequency; largest number that is looked at."""

SPARSE, FULL = 0.45, 0.9
"""Largest share of the samples that single echoes fill, and smallest share of its band that the spectrum fills. In
random sweeps of twelve kinds of radars these shares were 0.3 and 0.9 over time, 0.5 and 0.4 over frequency."""

ROUGH = 0.25
"""Smallest rms second difference of the logarithm of the power, where the samples are echoes over time. The band of a
transducer, 40 dB down at its ends, has 0.07 in 32 frequencies."""

ROUGH_BY_CHANCE = 6.0
"""The same times the root of the number of channels. Speckle has ``sqrt(6)``."""

FEWEST_SILENT, SILENT_SHARE = 8, 0.02
"""Smallest number of frequencies at an end of the band, and smallest share of all, that are named when silent: windows
and rounded ends of a band make fewer."""

SILENT_DB = -6.0
"""Largest level of all silent frequencies against each of the `FEWEST_SILENT` beside them [dB]. At the end of a window
or of a transducer's band the level falls by 2 dB from one frequency to the next."""


def sample_findings(sweep: xr.Dataset) -> list[Finding]:
    """Find samples that are missing, dead, clipped, noise, without phase or over time, and frequencies that are silent,
    or have wrong steps or units.

    Parameters
    ----------
    sweep : xarray.Dataset
        With a complex variable s; need not be valid otherwise.
    """
    kind = _constant_findings(sweep) or _phase_findings(sweep) or _phase_unit_findings(sweep) or _domain_findings(sweep)
    return [
        *_unit_findings(sweep),
        *(kind or [*_bad_findings(find_bad(sweep), sweep), *_silent_findings(sweep)]),
        *_step_findings(sweep),
    ]


def _constant_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that no sample differs from those at other frequencies, as where a parameter was not measured."""
    s = sweep["s"]
    if "frequency" not in s.dims or s.sizes["frequency"] < FEWEST_TIMES or not any_nonzero(s.values):
        return []
    first, *others = np.moveaxis(s.values, s.get_axis_num("frequency"), 0)
    if any((other != first).any() for other in others):
        return []
    what = "The samples of each channel are the same at all frequencies: they hold no echo."
    remedy = "import the parameter (--parameter) or the variable that was measured"
    return [Finding("constant", what, CERTAIN, remedy, by_command=False)]


def _phase_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that the samples are magnitudes, real parts or imaginary parts alone, and so have no phase."""
    s = sweep["s"]
    part = constant_part(np.moveaxis(s.values, s.get_axis_num("frequency"), 0)) if "frequency" in s.dims else None
    if part is None:
        return []
    what = f"The samples are {part} alone: the other part of every one is zero, and nothing tells where echoes are."
    remedy = "import real and imaginary part, or magnitude and phase; measure the phase where it was not stored"
    return [Finding("no-phase", what, CERTAIN, remedy, by_command=False)]


def _phase_unit_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that phases in radians were taken for degrees: all lie within pi degrees of zero, and fill these."""
    s = sweep["s"].values.ravel()
    s = s[:: max(1, s.size // ENOUGH_PHASES)]
    if s.size < FEWEST_PHASES or not np.isfinite(s).all():
        return []
    phase = np.angle(s[s != 0.0], deg=True)
    if not phase.size or not FILLED * np.pi <= np.abs(phase).max() <= np.pi * (1.0 + 1e-3):
        return []
    if abs(float(np.std(phase)) * np.sqrt(3.0) / np.pi - 1.0) > 1.0 - EVEN:
        return []
    what = "The phases of all samples lie within 3.14 degrees of zero, and fill these: they are radians, not degrees."
    return [Finding("phase-unit", what, CERTAIN, "import them with phase_unit = 'radian'", by_command=False)]


def _domain_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that the samples are echoes over time, not over frequency.

    Over time the power of all channels is that of single echoes, and its spectrum fills the band. Over frequency it is
    the other way round; a transducer of a narrow band passes power that changes smoothly from sample to sample.
    """
    s = sweep["s"]
    if "frequency" not in s.dims or s.sizes["frequency"] < FEWEST_TIMES:
        return []
    values = np.moveaxis(s.values, s.get_axis_num("frequency"), 0).reshape(s.sizes["frequency"], -1)
    if values.shape[1] < FEWEST_CHANNELS:
        return []
    some = np.linspace(0, values.shape[1] - 1, min(values.shape[1], ENOUGH_CHANNELS)).astype(int)
    values = values[:, some].astype(complex)
    if not np.isfinite(values).all():
        return []
    power = np.mean(np.abs(values) ** 2, axis=1)
    spectrum = np.mean(np.abs(np.fft.ifft(values, axis=0)) ** 2, axis=1)
    if not power.all() or _filled_share(power) > SPARSE or _filled_share(spectrum) < FULL:
        return []
    if np.sqrt(np.mean(np.diff(np.log(power), n=2) ** 2)) < max(ROUGH, ROUGH_BY_CHANCE / np.sqrt(values.shape[1])):
        return []
    what = "The samples are single echoes with silence between them: they stand over time, not over frequency."
    remedy = "import them with a mapping that names this axis time, or transform them, s = np.fft.fft(s, axis=0)"
    return [Finding("time-domain", what, SURE_OF_UNIT, remedy, by_command=False)]


def _filled_share(power: NDArray[np.float64]) -> float:
    """Share of the bins that hold the power (bins,): exp(entropy) over their number, 1 where it is equal in all."""
    share = power / power.sum()
    return float(np.exp(-np.sum(share * np.log(np.maximum(share, np.finfo(float).tiny))))) / power.size


def _unit_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that the frequencies are far too low for the array, and so probably in another unit."""
    try:
        unit = frequency_unit_of(sweep)
    except (KeyError, ValueError, TypeError):  # no positions or no frequencies to compare
        return []
    if unit is None:
        return []
    highest = float(sweep["frequency"].max())
    what = f"The frequencies, up to {highest:g} Hz, are far too low for the array: they are probably in {unit}."
    return [Finding("frequency-unit", what, SURE_OF_UNIT, f"--frequency-unit {unit}")]


def _bad_findings(bad: Bad, sweep: xr.Dataset) -> list[Finding]:
    """One finding for each kind of bad channels or frequencies, as `find_bad` found them."""
    missing = not_finite(sweep["s"].values)
    channels = bad.dead.size
    remedy, by_command = (AGAIN, False) if bad.channels.all() else (MASK, True)
    found = []
    if missing:
        what = f"{missing} samples of {sweep['s'].size} are not finite (NaN or infinite)."
        found.append(Finding("nan", what, CERTAIN, remedy, by_command))
    if bad.dead.any():
        what = f"{int(bad.dead.sum())} of {channels} channels are silent."
        found.append(Finding("dead-channels", what, CERTAIN, remedy, by_command))
    if bad.saturated.any():
        what = f"{int(bad.saturated.sum())} of {channels} channels are saturated: many samples have one largest value."
        found.append(Finding("saturated-channels", what, SURE_BY_LEVEL, remedy, by_command))
    if bad.noise.any():
        what = f"{int(bad.noise.sum())} of {channels} channels hold noise and no echo, unlike the others."
        found.append(Finding("noise-channels", what, SURE_BY_LEVEL, remedy, by_command))
    spurs = bad.frequencies
    if spurs.any():
        frequency = sweep["frequency"].values
        places = ", ".join(f"{frequency[n] / 1e9:.6g}" for n in np.flatnonzero(spurs)[:3])
        more = ", ..." if spurs.sum() > 3 else ""
        what = f"{int(spurs.sum())} of {spurs.size} frequencies stand out of their neighbours ({places}{more} GHz)."
        found.append(Finding("bad-frequencies", what, SURE_BY_LEVEL, remedy, by_command))
    return found


def _silent_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that an end of the band holds no echoes: the level drops from one frequency to the next, for good."""
    s = sweep["s"]
    if "frequency" not in s.dims or "frequency" not in sweep.variables:
        return []
    values = np.moveaxis(s.values, s.get_axis_num("frequency"), 0).reshape(s.sizes["frequency"], -1)
    some = np.flatnonzero(values.any(axis=0))
    some = some[:: max(1, some.size // ENOUGH_CHANNELS)]
    if not some.size or not np.isfinite(values[:, some]).all():
        return []
    power = np.median(np.abs(values[:, some].astype(complex)) ** 2, axis=1)
    first, last = _silent(power), power.size - _silent(power[::-1])
    if first == 0 and last == power.size:
        return []
    frequency = sweep["frequency"].values
    ends = [f"below {frequency[first] / 1e9:.6g} GHz"] if first else []
    ends += [f"above {frequency[last - 1] / 1e9:.6g} GHz"] if last < power.size else []
    what = (
        f"{power.size - (last - first)} of {power.size} frequencies, {' and '.join(ends)}, hold no echo: the source "
        "dropped out there, or zeros were appended. The band that resolves ranges is narrower than it seems."
    )
    remedy = f"measure again, or leave them out in Python: sweep.isel(frequency=slice({first}, {last}))"
    return [Finding("silent-frequencies", what, CERTAIN, remedy, by_command=False)]


def _silent(power: NDArray[np.float64]) -> int:
    """Number of silent frequencies at the beginning of a band, by the powers of all (frequencies,)."""
    for n in range(power.size - FEWEST_SILENT, max(FEWEST_SILENT, int(SILENT_SHARE * power.size)) - 1, -1):
        if power[:n].max() < power_ratio_of(SILENT_DB) * power[n : n + FEWEST_SILENT].min():
            return n
    return 0


def _step_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that frequencies fall, are not sorted, or do not have equal steps."""
    given = sweep["frequency"].values if "frequency" in sweep.variables else np.empty(0)
    frequency = np.asarray(without_rounding(given), dtype=float)
    if frequency.size < 2 or not np.isfinite(frequency).all():
        return []
    step = np.diff(frequency)
    if (step < 0).all():
        what = "The frequencies fall from sample to sample."
        return [Finding("falling-frequencies", what, CERTAIN, "--sort-frequencies")]
    if not _equal(step):
        if _equal(np.diff(np.sort(frequency))):
            what = "The frequencies are in no order; sorted, their steps are equal."
            return [Finding("non-uniform-steps", what, CERTAIN, "--sort-frequencies")]
        which = uneven_steps(frequency)
        what = f"The frequency steps are not equal: {which or f'they range from {step.min():g} to {step.max():g} Hz'}."
        remedy = "resample the sweep to equal steps, or leave out the frequencies that break them"
        return [Finding("non-uniform-steps", what, CERTAIN, remedy, by_command=False)]
    return []


def _equal(step: NDArray[np.float64]) -> bool:
    """Whether the frequency steps [Hz] are the same, to `STEP_TOLERANCE`, and their mean is positive."""
    return bool(step.mean() > 0 and np.abs(step - step.mean()).max() <= STEP_TOLERANCE * step.mean())
