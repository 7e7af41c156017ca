"""Whether the range axis of a raster scan is reversed.

All beams of a scanner start at one place, so there is no wavefront across an array to look at. Two other tests tell
whether range runs forward:

* Walls are flat in the image only if it does. With a reversed range axis, a plane bulges by twice its sagitta over the
  scan.
* Leakage inside the instrument, which is the same in all beams, arrives before any echo. If it stands at the end of the
  ambiguous range, the range axis is reversed.

How far neighbouring beams see the same speckle tells nothing of range: for a focused aperture that turns about its
middle, it is the same angle at all ranges.

Conjugated samples and reversed frequencies give the same image of a scan, range for range, so either repair will do.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.statistics import in_equal_steps
from mirrorfold.common.windows import hann
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.search.planes import find_planes
from mirrorfold.detection.views.volume_view import VolumeView, to_volume_view
from mirrorfold.detection.volume_echoes import find_runs
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.focusing.scans.imaging import amplitude_of_scan
from mirrorfold.focusing.scans.range_profiles import beams_of
from mirrorfold.focusing.settings import FocusSettings

LEAKAGE_SHARE = 0.25
"""Share of the range axis, at either end, in which leakage is searched."""

LEAKAGE_RATIO = 10.0
"""Ratio of powers that shows leakage. In the range profile that all beams have in common, the stronger end must exceed
the other end by this ratio, and the typical level of the profile too."""

ALIKE = 0.9
"""Least share of the power in the range bin of the leakage that is the same in all beams. It is 0.98 to 1 for leakage,
and up to 0.1 for a wall that is square to the middle one of all beams within 4 degrees."""

WALL_CELLS = 10.0
"""Smallest width and height of a wall, in resolution cells; random echoes are not flat over so many by chance."""

STRAIGHT_DEG = 0.3
"""Largest standard error of a wall's direction [degree]. Planes found by chance in a cloud of echoes have errors of 0.5
to 1 degree."""

WALLS_RATIO = 3.0
"""How many times more beams must meet walls with range running one way than with range running the other way."""

FLATTER = 1.5
"""How many times flatter a wall must be than the same echoes with range running the other way. Walls of random scenes
are 1.7 to 20 times flatter. Pieces of a wall that bulges, which pass for flat ones where the beam is out of focus, are
4 times less flat."""

SURE_BY_WALLS, SURE_BY_LEAKAGE = 0.99, 0.95
"""Certainty of a finding by each test."""


def scan_findings(sweep: xr.Dataset) -> tuple[list[Finding], dict[str, bool]]:
    """The finding that the range axis of a valid raster scan is reversed, and what could be judged.

    The two results are those of `mirrorfold.diagnosis.diagnose`. Walls decide where there are any, otherwise leakage.
    """
    s = sweep["s"].values.reshape(-1, *sweep["s"].shape[-3:])[0]
    if s.shape[0] < 32 or s.shape[1] * s.shape[2] < 9:
        return [], {"waves": False, "exchange": False}
    by_walls, by_leakage = _by_walls(sweep), _by_leakage(s)
    judged = {"waves": bool(by_walls or by_leakage), "exchange": False}
    if (by_walls or by_leakage) >= 0:
        return [], judged
    if by_walls:
        why, sure = "Surfaces are flat only with range running the other way", SURE_BY_WALLS
    else:
        why, sure = "What leaks inside the instrument arrives last", SURE_BY_LEAKAGE
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
    return float(
        sum(
            one.fill * np.count_nonzero(one.beams)
            for one in planes
            if one.angle_error <= STRAIGHT_DEG and _flatness(one, echoes, view) >= FLATTER
        )
    )


def _flatness(wall: PlaneMirror, echoes: Echoes, view: VolumeView) -> float:
    """How many times farther from a plane the echoes of a wall are with range running the other way.

    In the direction u, a plane ``n . x = d`` has the range r of ``1 / r = n . u / d``, which is fitted to the echoes.
    """
    _, meets, reach = wall.near(view, echoes)
    own = echoes.take(meets & (np.abs(wall.beside(echoes.position)) <= reach))
    sight = view.sight[own.direction]
    deviation = []
    for range_ in (own.range, view.range.size * view.dr - own.range):
        inverse = 1.0 / np.maximum(range_, view.dr)
        plane = np.linalg.lstsq(sight, inverse, rcond=None)[0]
        deviation.append(float(np.linalg.norm((inverse - sight @ plane) / inverse**2)))
    return deviation[1] / max(deviation[0], np.finfo(float).tiny)


def _by_leakage(s: NDArray[np.complexfloating]) -> int:
    """+1 where leakage arrives early, -1 where it arrives late, 0 where there is none.

    The samples `s` are (frequencies, azimuths, elevations).
    """
    count, taper = s.shape[0], hann(s.shape[0])
    middle = np.median(s.real, axis=(1, 2)) + 1j * np.median(s.imag, axis=(1, 2))
    common = np.abs(np.fft.ifft(middle * taper)) ** 2
    ends = max(int(LEAKAGE_SHARE * count), 4)
    early, late = int(np.argmax(common[:ends])), count - ends + int(np.argmax(common[-ends:]))
    strong, weak = (early, late) if common[early] > common[late] else (late, early)
    if common[strong] < LEAKAGE_RATIO * max(common[weak], np.median(common)):
        return 0
    turns = np.exp(2j * np.pi * strong / count * np.arange(count))
    beams = np.tensordot((taper * turns).astype(s.dtype), s, axes=1)
    power = float(np.mean(np.abs(beams) ** 2))
    if not abs(np.mean(beams)) ** 2 > ALIKE * power:
        return 0
    return 1 if strong == early else -1
