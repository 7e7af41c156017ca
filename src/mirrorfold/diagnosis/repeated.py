"""Places of a sweep that were measured at one place: a stage that was stuck, or samples that were written twice.

The same numbers at two places were measured once. If a stage is stuck, and measures at each stop, neighbours differ by
noise alone. Antennas that move see a change, though it is small for some stops where they pass the point that a wall
faces. But there it grows to both sides in proportion to the distance, and does not jump.
"""

from __future__ import annotations

from collections import defaultdict
from hashlib import sha256
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.fft import ifft

from mirrorfold.common.windows import hann
from mirrorfold.diagnosis.findings import CERTAIN, PLACES, Finding
from mirrorfold.sweep import antenna_positions, is_raster

JUMP = 30.0
"""How many times larger the power of the difference of two stops must be where the stage moves again than between three
stops or more at one place. Where a wall faces the middle of three stops, it is nine times larger beside them."""

LOUD = 10.0
"""Smallest power of a range bin, relative to that of noise, in which differences are looked at."""

QUIET = 0.25
"""Share of the range bins whose powers are taken to be at most that of noise."""

FEWEST_BINS = 8
"""Smallest number of such bins: with fewer, echoes may cancel each other at some stops."""

CHANCE = 4.0
"""Standard deviations of the noise up to which it is not told from a change. A Hann window correlates the noise of
neighbouring bins, which doubles its variance."""

FEWEST_FREQUENCIES = 32
"""Smallest number of frequencies, with which noise is spread over more bins than echoes."""

ENOUGH_PARTNERS = 20
"""Number of partners of an element that are looked at, where it has more."""

SURE = 0.95
"""Certainty that a stage was stuck, by its noise."""


def repeated_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that samples of one place stand under several; empty where they do not.

    `sweep` is valid, without further dimensions.
    """
    scan = is_raster(sweep)
    places = [sweep[name].values for name in ("azimuth", "elevation")] if scan else antenna_positions(sweep)
    for axis, (name, at) in enumerate(zip(sweep["s"].dims[1:], places, strict=False), 1):
        rows = np.moveaxis(sweep["s"].values, axis, 0)
        rows = rows.reshape(*rows.shape[:2], -1)
        copies = _copies(rows, at, scan)
        if copies:
            example = " and ".join(str(n + 1) for n in copies[0][:2])
            what = (
                f"{sum(len(group) - 1 for group in copies)} of {len(rows)} {PLACES[str(name)]} have the same samples "
                f"as another, to the last bit, as number {example}: they were written twice, or not measured anew."
            )
            remedy = "look for a run that was restarted, or a buffer that was not renewed, and leave the copies out"
            return [Finding("repeated-samples", what, CERTAIN, remedy, by_command=False)]
        stops = None if scan else _stuck(rows, at)
        if stops is not None:
            what = (
                f"{PLACES[str(name)].capitalize()} {stops[0] + 1} to {stops[1] + 1} of {len(rows)} hear the same, and "
                "those beside them do not: the stage was stuck there."
            )
            remedy = "measure again, and check whether the later positions lack the steps that were lost"
            return [Finding("stuck-stage", what, SURE, remedy, by_command=False)]
    return []


def _copies(rows: NDArray[np.complexfloating], places: NDArray[np.float64], scan: bool) -> list[list[int]]:
    """Groups of rows (n, frequencies, partners) with the same samples at different places (n, ...).

    Two rows at the same distance from both ends may be the same without any slip, in a symmetric scene without noise.
    So may rows of a scan that meet nothing.
    """
    alike: dict[bytes, list[int]] = defaultdict(list)
    for n, row in enumerate(rows):
        alike[row[0].tobytes()].append(n)
    groups: dict[bytes, list[int]] = defaultdict(list)
    for n in (n for group in alike.values() if len(group) > 1 for n in group):  # few are hashed as a whole
        if rows[n].any() and not (scan and (rows[n] == rows[n][:, :1]).all()):
            groups[sha256(rows[n].tobytes()).digest()].append(n)
    return [
        group
        for group in groups.values()
        if any(i + k != len(rows) - 1 and (places[i] != places[k]).any() for i, k in pairwise(group))
    ]


def _stuck(rows: NDArray[np.complexfloating], places: NDArray[np.float64]) -> tuple[int, int] | None:
    """The first and the last of three stops or more at one place; None where rows (n, frequencies, partners) move.

    They should be at the places (n, 3) [m]. A change is referred to the square of the step, as that of a small one is.
    """
    count, partners = rows.shape[1:]
    if count < FEWEST_FREQUENCIES or len(rows) < FEWEST_FREQUENCIES:
        return None
    some = np.linspace(0, partners - 1, min(partners, ENOUGH_PARTNERS)).astype(int)
    window = hann(count).astype(rows.real.dtype)  # in the precision of the samples, which is twice as fast
    profile = ifft(rows[:, :, some] * window[:, None], axis=1)
    power = np.mean(np.abs(profile) ** 2, axis=(0, 2))
    least = np.quantile(power, QUIET)
    loud = power > LOUD * least
    if np.count_nonzero(loud) < FEWEST_BINS:
        return None
    change = np.abs(np.diff(profile, axis=0)) ** 2
    noise = float(np.mean(change[:, power <= least])) * float(np.mean(1.0 / power[loud]))
    change = np.mean(change[:, loud] / power[loud, None], axis=(1, 2)) - noise
    change = np.maximum(change, CHANCE * noise / np.sqrt(np.count_nonzero(loud) * some.size))
    step = np.linalg.norm(np.diff(places, axis=0), axis=1)
    change = np.divide(change, step**2, out=np.full(change.size, np.nan), where=step > 0.0)
    for first in range(change.size - 1):
        beside = change[first - 1] if first else np.inf
        last, largest = first, 0.0
        while last < change.size and max(largest, change[last]) * JUMP <= beside:
            largest = max(largest, change[last])
            last += 1
            after = change[last] if last < change.size else np.inf
            if last - first >= 2 and min(beside, after) < np.inf and after >= JUMP * largest:
                return first, last
    return None
