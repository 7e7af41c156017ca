"""Whether the range axis of a raster scan is reversed, and whether echoes come from beyond the ambiguous range.

All beams of a scanner start at one place, so there is no wavefront across an array to look at. Three other tests tell
whether range runs forward:

* Walls are flat in the image only if it does. With a reversed range axis, a plane bulges by twice its sagitta over the
  scan.
* Leakage inside the instrument, which is the same in all beams, arrives before any echo. If it stands at the end of the
  ambiguous range, the range axis is reversed.
* A focused beam is wider, in angle, near the radar than in its focus. How far neighbouring beams see the same speckle
  tells this width at each range.

The width of the beam also tells which echoes have wrapped around: they are seen in a beam as narrow as it is one
ambiguous range farther away.

Conjugated samples and reversed frequencies give the same image of a scan, range for range, so either repair will do.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.fft import ifft

from mirrorfold.common.beams import beam_radius
from mirrorfold.common.statistics import in_equal_steps
from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.detection.search.planes import find_planes
from mirrorfold.detection.views.volume_view import to_volume_view
from mirrorfold.detection.volume_echoes import find_runs
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.focusing.scans.imaging import amplitude_of_scan
from mirrorfold.focusing.scans.range_profiles import beams_of
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import ambiguous_range, wave_speed

LEAKAGE_SHARE = 0.25
"""Share of the range axis, at either end, in which leakage is searched."""

LEAKAGE_RATIO = 10.0
"""Ratio of powers that shows leakage. In the range profile that all beams have in common, the stronger end must exceed
the other end by this ratio, and the typical level of the profile too."""

ABOVE_NOISE = 10.0
"""Smallest power, relative to the noise, of the range bins in which neighbouring beams are compared."""

FEWEST_CELLS = 30
"""Smallest number of range bins with echoes for a judgement by the beam's width."""

MARGIN = 0.15
"""Smallest difference that decides between the mean squared misfits of the log widths for range running forward and
backward, as a share of the larger misfit."""

WALL_CELLS = 10.0
"""Smallest width and height of a wall, in resolution cells; random echoes are not flat over so many by chance."""

STRAIGHT_DEG = 0.3
"""Largest standard error of a wall's direction [degree]. Planes found by chance in a cloud of echoes have errors of 0.5
to 1 degree."""

WALLS_RATIO = 3.0
"""How many times more beams must meet walls with range running one way than with range running the other way."""

FITS, MISFITS = 0.15, 0.3
"""Logarithm of the ratio of the widths of two beams up to which they agree, and from which on they do not."""

FEWEST_WRAPPED = 8
"""Least number of range bins whose beam is that of one ambiguous range later: in scans without such echoes none is."""

SURE_OF_WRAPPED = 0.95
"""Certainty that echoes with such a beam have wrapped around."""

SURE_BY_WALLS, SURE_BY_LEAKAGE, SURE_BY_BEAM, SURE_BY_BOTH = 0.99, 0.95, 0.9, 0.99
"""Certainty of a finding by each test alone, and by leakage and beam width together."""


def scan_findings(sweep: xr.Dataset) -> tuple[list[Finding], dict[str, bool]]:
    """The findings on the ranges of a valid raster scan, reversed or too short, and what could be judged.

    The two results are those of `mirrorfold.diagnosis.diagnose`. Walls decide where there are any, otherwise leakage
    and the beam width.
    """
    s = sweep["s"].values.reshape(-1, *sweep["s"].shape[-3:])[0]
    if s.shape[0] < 32 or s.shape[1] * s.shape[2] < 9:
        return [], {"waves": False, "exchange": False}
    taper = hann(s.shape[0])[:, None, None].astype(np.float32)
    leakage = np.median(s.real, axis=(1, 2)) + 1j * np.median(s.imag, axis=(1, 2))
    misfits, power = _misfits(_profile(s, leakage, taper), sweep)
    if wrapped := _wrapped(misfits, sweep):
        return wrapped, {"waves": True, "exchange": False}
    by_walls, by_beam = _by_walls(sweep), _by_beam(misfits, power)
    by_leakage = _by_leakage(np.abs(np.fft.ifft(leakage * taper[:, 0, 0])) ** 2, s)
    judged = {"waves": bool(by_walls or by_leakage or by_beam), "exchange": False}
    # Out of focus, pieces of a bulging wall pass for flat ones: walls alone do not contradict the beam.
    if (by_walls or by_leakage + by_beam) >= 0 or by_walls * by_beam < 0:
        return [], judged
    if by_walls:
        why, sure = "Surfaces are flat only with range running the other way", SURE_BY_WALLS
    elif by_leakage:
        why = "What leaks inside the instrument arrives last"
        sure = SURE_BY_BOTH if by_beam else SURE_BY_LEAKAGE
    else:
        why, sure = "The beam is narrow where it should be wide", SURE_BY_BEAM
    what = (
        f"{why}: the range axis runs backwards, the samples are conjugated (or I and Q exchanged) or stored from the "
        "highest frequency to the lowest; images of a scan cannot tell which, and either repair does."
    )
    return [Finding("range-reversed", what, sure, "--conjugate")], judged


def _by_walls(sweep: xr.Dataset) -> int:
    """+1 where walls are flat in the sweep as it is, -1 where they are flat with the range axis reversed, else 0.

    Walls are sought among beams in equal steps.
    """
    first = sweep.isel(dict.fromkeys(sweep["s"].dims[:-3], 0))
    equal = all(in_equal_steps(sweep[name].values) for name in ("azimuth", "elevation"))
    if not equal or min(first["s"].shape) < 4 or not np.any(first["s"].values):
        return 0
    amplitude = amplitude_of_scan(first, FocusSettings(), None)
    forward = _beams_on_walls(amplitude)
    # Conjugated samples move the amplitude from range r to -r, which is R - r with the ambiguous range R.
    for beams in beams_of(amplitude):  # of one azimuth after the other, in place
        beams[:, 1:] = beams[:, :0:-1]
    backward = _beams_on_walls(amplitude)
    if max(forward, backward) <= WALLS_RATIO * min(forward, backward):
        return 0
    return 1 if forward > backward else -1


def _beams_on_walls(amplitude: xr.DataArray) -> float:
    """Number of beams that meet straight walls in a volume (range, azimuth, elevation), gaps in the walls left out."""
    view = to_volume_view(amplitude)
    echoes = find_runs(view)
    planes = find_planes(echoes, view, minimum_length=WALL_CELLS * float(view.cell(echoes.range_up_to(0.5))))
    return float(sum(one.fill * np.count_nonzero(one.beams) for one in planes if one.angle_error <= STRAIGHT_DEG))


def _by_leakage(common: Array, s: NDArray[np.complexfloating]) -> int:
    """+1 where leakage arrives early, -1 where it arrives late, 0 where there is none.

    `common` (ranges,) is the power of the range profile that all beams have in common, `s` the samples.
    """
    count = common.size
    ends = max(int(LEAKAGE_SHARE * count), 4)
    early, late = float(common[:ends].max()), float(common[-ends:].max())
    # Power that the median over the beams leaves of independent echoes: it falls with the number of beams.
    own = float(np.mean(np.abs(s) ** 2)) / count / (s.shape[1] * s.shape[2])
    typical = max(float(np.median(common)), own)
    stronger, weaker = max(early, late), min(early, late)
    if stronger < LEAKAGE_RATIO * weaker or stronger < LEAKAGE_RATIO * typical:
        return 0
    return 1 if early > late else -1


def _profile(
    s: NDArray[np.complexfloating], leakage: NDArray[np.complexfloating], taper: NDArray[np.floating]
) -> NDArray[np.complexfloating]:
    """Range profiles of samples (frequencies, azimuths, elevations), less the leakage that is common to all beams.

    The leakage is (frequencies,), the taper (frequencies, 1, 1). No more than one array of this size is made.
    """
    profile = s - leakage[:, None, None]
    profile *= taper
    return np.asarray(ifft(profile, axis=0, overwrite_x=True))


def _misfits(profile: NDArray[np.complexfloating], sweep: xr.Dataset) -> tuple[Array, Array]:
    """Logarithm of the beam's angular width at each range bin over the width that is expected there, (3, bins).

    It is expected at three ranges: as the bins say, with the range axis reversed, and one ambiguous range farther away.
    NaN where the width is not known. Also the power of the bins, (bins,).
    """
    count, farthest = profile.shape[0], ambiguous_range(sweep)
    power = np.mean(np.abs(profile) ** 2, axis=(1, 2))
    width = np.full(count, np.nan)
    if not {"spot_radius", "focus_distance"} <= set(sweep.attrs):
        return np.full((3, count), np.nan), power
    for cell in np.flatnonzero(power > ABOVE_NOISE * np.quantile(power, 0.1)):
        width[cell] = _angular_width(profile[cell], sweep)
    range_ = np.arange(count) * farthest / count
    place = np.maximum([range_, farthest - range_, range_ + farthest], 1e-3)
    radius = beam_radius(
        place,
        spot_radius=float(sweep.attrs["spot_radius"]),
        focus_distance=float(sweep.attrs["focus_distance"]),
        wavelength=wave_speed(sweep) / float(sweep["frequency"].values.mean()),
    )
    return np.asarray(np.log(width) - np.log(radius / place)), power


def _wrapped(misfits: Array, sweep: xr.Dataset) -> list[Finding]:
    """The finding that echoes come from beyond the ambiguous range, where the beam says so in enough range bins.

    `misfits` (3, bins) are those of `_misfits`. A bin counts if its beam is too narrow for its own range, and right for
    one ambiguous range farther away. In a scan with reversed ranges, more bins fit the reversed axis.
    """
    too_narrow = misfits[0] < -MISFITS
    late, backwards = (int(np.count_nonzero(too_narrow & (np.abs(misfits[which]) < FITS))) for which in (2, 1))
    if late < FEWEST_WRAPPED or late <= backwards:
        return []
    farthest = ambiguous_range(sweep)
    what = (
        f"At {late} of {np.count_nonzero(np.isfinite(misfits[0]))} ranges the beam is as narrow as {farthest:.3g} m "
        f"farther away: these echoes come from beyond the ambiguous range of {farthest:.3g} m, and are shown too near."
    )
    remedy = "measure again in finer frequency steps, half as large or less"
    return [Finding("wrapped-echoes", what, SURE_OF_WRAPPED, remedy, by_command=False)]


def _by_beam(misfits: Array, power: Array) -> int:
    """+1 where the beam's width over range fits the range axis as it is, -1 where it fits the reversed one, else 0.

    `misfits` (3, bins) and `power` (bins,) are those of `_misfits`.
    """
    usable = np.isfinite(misfits[0]) & np.isfinite(misfits[1])
    if usable.sum() < FEWEST_CELLS:
        return 0
    # The ratio of correlation width to beam width is an unknown constant, the same for both: its log is subtracted.
    weight = power[usable] ** 0.25
    spread = []
    for one in misfits[:2]:
        centred = np.clip(one[usable] - np.median(one[usable]), -1.0, 1.0)
        spread.append(float(np.average(centred**2, weights=weight)))
    if abs(spread[0] - spread[1]) < MARGIN * max(spread):
        return 0
    return 1 if spread[0] < spread[1] else -1


def _angular_width(cell: NDArray[np.complexfloating], sweep: xr.Dataset) -> float:
    """Angle [rad] over which neighbouring beams see the same speckle, from their correlation one step apart.

    The correlation is taken for ``exp(-(step / width)^2)``; `cell` (azimuth, elevation) is one range bin. NaN where the
    correlation is too close to 0 or 1, or the steps are unequal.
    """
    widths = []
    for axis, name in enumerate(("azimuth", "elevation")):
        if cell.shape[axis] < 3 or not in_equal_steps(sweep[name].values):
            continue
        step = np.radians(float(np.diff(sweep[name].values).mean()))
        a = np.take(cell, range(cell.shape[axis] - 1), axis=axis)
        b = np.take(cell, range(1, cell.shape[axis]), axis=axis)
        norm = float(np.linalg.norm(a) * np.linalg.norm(b))
        correlation = float(np.abs(np.vdot(a, b))) / norm if norm > 0 else 0.0
        if 0.02 < correlation < 0.9999:
            widths.append(step / np.sqrt(-np.log(correlation)))
    return float(np.mean(widths)) if widths else float("nan")
