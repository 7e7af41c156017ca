"""Facts about a sweep: its resolution, the levels of signal and noise, echoes that wrap around, and mistakes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import gammaincinv

from mirrorfold.calibration.record import single_precision_scale
from mirrorfold.common.arguments import boolean
from mirrorfold.common.decibels import power_decibel, power_ratio_of
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.common.types import Array
from mirrorfold.common.units import length_text
from mirrorfold.common.windows import hann
from mirrorfold.describing.contents import Sized
from mirrorfold.describing.resolution import Arrays, Scan, resolution, scan_resolution
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.errors import InputError
from mirrorfold.sweep import (
    AXES_REMEDY,
    antenna_positions,
    check_sweep,
    is_monostatic,
    is_raster,
    misaligned_axis,
    wave_speed,
)

QUIET_SHARE = 0.1
"""Share of the bins of the range profile, the quietest, that are taken to hold noise alone."""

END_SHARE = 0.1
"""Share of the range profile, at its end, in which strong echoes suggest that later ones have wrapped around."""

END_LEVEL_DB = -30.0
"""Smallest level of such an echo relative to the strongest echo [dB]; weaker ones wrap around without harm."""

END_OVER_NOISE = 10.0
"""Smallest power of such an echo relative to that of the noise; weaker ones may be peaks of the noise."""

SIDE_LOBES = 3
"""Number of bins at the end of the range profile that the Hann window fills with leakage from range zero; they are not
looked at."""

RECIPROCITY_DB = -40.0
"""Largest power of the difference between a sweep and its transpose that a calibrated instrument should leave, relative
to the mean power of a sample [dB]."""

RECIPROCITY_OVER_NOISE = 4.0
"""Smallest power of this difference, relative to the noise of a sample, that is remarked. Noise alone gives 1 on
average, and hardly ever 4."""


class FindingFacts(Record):
    """A mistake that the data show."""

    name: str
    what: str = fact("what was found, one sentence")
    sure: float = fact(ge=0, le=1)
    fix: str = fact("the command that puts it right, or advice")


class Levels(Record):
    """Levels of the samples of a sweep."""

    power_db: Number = fact("[dB]")
    snr_db: Number = fact("[dB]")
    noise_floor_db: Number = fact("[dB]")
    dynamic_range_db: Number = fact("[dB]")


class ArrayLevels(Levels):
    """Levels of the samples of two arrays."""

    range_end_db: Number = fact("what arrives near the ambiguous range, against the strongest")
    reciprocity_db: Number = fact(
        "difference from the transpose, where antennas transmit and receive [dB]", default=LEFT_OUT
    )


class Verdict(Record):
    """What is wrong with a sweep that can be used."""

    remarks: list[str] = fact("sentences on what looks wrong")
    valid: bool = True
    judged: dict[str, bool] | None = fact("which mistakes the data suffice to look for", default=LEFT_OUT)
    findings: list[FindingFacts] = field(default_factory=list)
    files: list[str] = fact("what was written", default=LEFT_OUT)


class ArraySweepFacts(Verdict, ArrayLevels, Arrays, Sized):
    """A sweep of two arrays, or of one moving antenna."""

    kind: Literal["sweep"]


class RasterSweepFacts(Verdict, Levels, Scan, Sized):
    """A sweep of a raster scanner."""

    kind: Literal["sweep"]


class BrokenSweepFacts(Sized):
    """A sweep that cannot be used, but repaired; the exit code is 2."""

    kind: Literal["sweep"]
    valid: Literal[False]
    remarks: list[str] = fact("sentences on what looks wrong")
    findings: list[FindingFacts]


SweepFacts = ArraySweepFacts | RasterSweepFacts | BrokenSweepFacts
"""The kinds of facts that `mirrorfold.info` returns for a sweep."""


def describe_sweep(sweep: xr.Dataset, path: str, *, diagnose: bool) -> SweepFacts:
    """Facts about a sweep, with its mistakes if `diagnose`; also about one that is not valid, if a repair is known.

    Parameters
    ----------
    sweep : xarray.Dataset
    path : str
        Path of its file, for the commands that correct mistakes.
    diagnose : bool

    Raises
    ------
    InputError
        If the sweep is not valid, and no repair is known.
    """
    try:
        valid = check_sweep(sweep, source=path)
    except InputError as error:
        return _broken(sweep, path, error)
    scale = single_precision_scale(valid["s"].values)
    s = valid["s"]
    scaled = valid if scale == 1.0 else valid.assign(s=s.copy(data=s.values / s.values.real.dtype.type(scale)))
    level_db = 20.0 * float(np.log10(scale))
    facts = _raster(scaled, level_db) if is_raster(scaled) else _arrays(scaled, level_db)
    if not boolean("diagnose", diagnose):
        return facts
    from mirrorfold.diagnosis import diagnose as find_mistakes

    found, judged = find_mistakes(valid)
    return facts.but(remarks=facts.remarks + _sentences(found, path), judged=judged, findings=_findings(found, path))


def _broken(sweep: xr.Dataset, path: str, error: InputError) -> BrokenSweepFacts:
    """Facts about a sweep that is not valid, but whose samples or frequencies can be repaired.

    Raises
    ------
    InputError
        `error` itself, if no repair is known.
    """
    from mirrorfold.diagnosis import sample_findings

    if "s" not in sweep or sweep["s"].dtype.kind != "c" or "frequency" not in sweep["s"].dims or not sweep["s"].size:
        raise error
    found = sample_findings(sweep)
    if not found:
        raise error
    # What the error says with the option of a remedy is not said again, but for the command.
    said = [
        f"the command is: {one.command(path)}" if one.by_command and one.remedy in str(error) else sentence
        for one, sentence in zip(found, _sentences(found, path), strict=True)
    ]
    return BrokenSweepFacts(
        **_contents(sweep), valid=False, remarks=[str(error), *said], findings=_findings(found, path)
    )


def _contents(sweep: xr.Dataset) -> dict[str, Any]:
    """Kind, title and dimensions of a sweep."""
    return {
        "kind": "sweep",
        "title": str(sweep.attrs.get("title", "")),
        "dimensions": {str(name): int(size) for name, size in zip(sweep["s"].dims, sweep["s"].shape, strict=True)},
    }


def _findings(found: list[Finding], path: str) -> list[FindingFacts]:
    """Findings as facts, with the commands that correct them."""
    return [FindingFacts(name=f.name, what=f.what, sure=f.sure, fix=f.command(path)) for f in found]


def _sentences(found: list[Finding], path: str) -> list[str]:
    """Findings as remarks, with the commands that correct them."""
    return [f"{f.sentence()} Remedy: {f.command(path)}" for f in found]


def _raster(sweep: xr.Dataset, level_db: float) -> RasterSweepFacts:
    """Facts about a valid sweep of a raster scan, whose samples were stronger by a level [dB]."""
    known = "spot_radius" in sweep.attrs and "focus_distance" in sweep.attrs
    beam = (float(sweep.attrs["spot_radius"]), float(sweep.attrs["focus_distance"])) if known else None
    axes = [sweep[name].values.astype(float) for name in ("frequency", "azimuth", "elevation")]
    facts, remarks = scan_resolution(axes[0], axes[1], axes[2], beam, wave_speed(sweep))
    s = sweep["s"].values.reshape((-1, *sweep["s"].shape[-3:]))
    # Leakage inside the instrument is the same in all beams, and removed with their mean.
    s = s - s.mean(axis=(2, 3), keepdims=True)
    power = _mean_power(part for frame in s for part in frame)
    profile = _range_profile(s)
    levels = _levels(power, profile, _noise_power(profile, pairs=s.size // profile.size), level_db)
    return RasterSweepFacts(**_contents(sweep), **facts, **levels, remarks=remarks)


def _arrays(sweep: xr.Dataset, level_db: float) -> ArraySweepFacts:
    """Facts about a valid sweep of two arrays, or of one antenna, whose samples were stronger by a level [dB]."""
    tx_position, rx_position = antenna_positions(sweep)
    ranges = None
    if sweep.attrs.get("scene_center") is not None:
        radar = 0.5 * (tx_position.mean(axis=0) + rx_position.mean(axis=0))
        ranges = [float(np.linalg.norm(np.asarray(sweep.attrs["scene_center"], dtype=float) - radar))]
    frequency = sweep["frequency"].values.astype(float)
    facts, remarks = resolution(
        frequency, tx_position, rx_position, wave_speed(sweep), ranges, monostatic=is_monostatic(sweep)
    )
    along = misaligned_axis(sweep)
    if along is not None:
        remarks.append(
            f"All antennas stand along {along}, expected x, across the range: in the floor plan before them they tell "
            f"ranges and hardly a direction; {AXES_REMEDY}."
        )
    s = sweep["s"].values[..., None] if is_monostatic(sweep) else sweep["s"].values
    s = s.reshape((-1, *s.shape[-3:]))
    power = _mean_power(part for frame in s for part in frame)
    profile = _range_profile(s)
    noise = _noise_power(profile, pairs=s.size // profile.size)
    range_end, wrapped = _range_end(profile, noise / power * profile.mean() if power > 0 else 0.0)
    if wrapped and facts.ambiguous_range_m is not None:
        remarks.append(
            f"Echoes in the last part of the unambiguous range, {length_text(facts.ambiguous_range_m)}, are only "
            f"{abs(range_end or 0.0):.0f} dB below the strongest: later ones have probably wrapped around and stand at "
            "wrong places, or were cut off with the end of traces over time; measure with smaller frequency steps, or "
            "longer traces."
        )
    reciprocity: Any = LEFT_OUT
    if not is_monostatic(sweep) and np.array_equal(tx_position, rx_position):
        difference = _change_by_exchange(sweep, s)
        reciprocity = power_decibel(difference / power)
        if difference > RECIPROCITY_OVER_NOISE * noise and difference > power_ratio_of(RECIPROCITY_DB) * power:
            remarks.append(
                "Exchanging transmitter and receiver changes the samples by more than the noise "
                f"({reciprocity + 0.0:.0f} dB of their power): the sweep is not reciprocal; "
                "check the calibration, the positions, and that nothing moved."
            )
    return ArraySweepFacts(
        **_contents(sweep),
        **facts,
        **_levels(power, profile, noise, level_db),
        range_end_db=range_end,
        reciprocity_db=reciprocity,
        remarks=remarks,
    )


def _range_end(profile: Array, noise: float) -> tuple[float | None, bool]:
    """Level [dB] of the strongest echo near the ambiguous range, against the strongest; whether later ones wrap around.

    `noise` is the mean power of the noise in a bin of the range profile (n,).
    """
    end = profile[int((1.0 - END_SHARE) * profile.size) : profile.size - SIDE_LOBES]
    level = power_decibel(end.max() / profile.max()) if end.size and profile.max() > 0 else None
    return level, level is not None and level > END_LEVEL_DB and bool(end.max() > END_OVER_NOISE * noise)


def _change_by_exchange(sweep: xr.Dataset, s: NDArray[np.complex64]) -> float:
    """Half the mean power of the difference between samples (frames, frequencies, n, n) and their transpose.

    It is that of the noise where the sweep is reciprocal; pairs that were measured only one way count as zero.
    """
    measured = sweep["measured"].values.astype(bool) if "measured" in sweep.variables else np.ones(s.shape[2:], bool)
    both_ways = (measured & measured.T).astype(np.float32)
    return _mean_power((part - part.T) * both_ways for frame in s for part in frame) / 2.0


def _levels(power: float, profile: Array, noise: float, level_db: float) -> Levels:
    """Mean power and noise of a sample, and how far the strongest range bin stands above the floor of the profile.

    Both were measured on samples that are weaker than those of the sweep by `level_db` [dB].
    """
    mean_db, noise_db = power_decibel(power), power_decibel(noise)
    floor = float(np.quantile(profile, QUIET_SHARE))
    return Levels(
        power_db=None if mean_db is None else mean_db + level_db,
        snr_db=power_decibel((power - noise) / noise) if 0.0 < noise < power else None,
        noise_floor_db=None if noise_db is None else noise_db + level_db,
        dynamic_range_db=power_decibel(float(profile.max()) / floor) if floor > 0 else None,
    )


def _mean_power(parts: Iterable[NDArray[np.complex64]]) -> float:
    """Mean power of samples, one frequency at a time, because copies of a whole sweep cost more than the arithmetic."""
    energy, size = 0.0, 0
    for part in parts:
        energy, size = energy + float(np.vdot(part, part).real), size + part.size
    return energy / size


def _range_profile(s: NDArray[np.complex64]) -> Array:
    """Mean power over all pairs in each range bin, Hann window over frequency, shape (frequencies,)."""
    window = hann(s.shape[1]).astype(np.float32)
    profile = np.zeros(s.shape[1])
    for tx in range(s.shape[2]):
        profile += np.sum(np.abs(np.fft.ifft(s[:, :, tx] * window[:, None], axis=1)) ** 2, axis=(0, 2), dtype=float)
    return profile * s.shape[1] ** 2 / np.sum(window**2, dtype=float) * s.shape[1] / s.size


def _noise_power(profile: Array, *, pairs: int) -> float:
    """Upper bound of the noise power of a sample, from the quietest part of the range profile.

    If this part holds white noise alone, its mean power over n pairs follows a gamma distribution of shape n, which
    tells by which factor the quantile lies below the mean.
    """
    below_mean = gammaincinv(pairs, QUIET_SHARE) / pairs
    return float(max(np.quantile(profile, QUIET_SHARE) / below_mean, np.finfo(np.float32).eps ** 2 * profile.max()))
