"""Sweeps whose frequency axis was exchanged with an antenna axis of the same length.

Where the same antennas transmit and receive, a pair gives the same samples in both directions (reciprocity). The
samples are then symmetric in the two antenna axes, and the third axis is the frequency. Otherwise each order of the
axes is tried: echoes add up in phase only in the right one. For transmitters taken for receivers see `mistakes`.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.repairs import swap_axes
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.diagnosis.wavefronts import IN_PHASE, in_phase, wavefronts
from mirrorfold.sweep import antenna_positions
from mirrorfold.sweep.pairs import on_a_line, pairs_of

FEWEST = 8
"""Smallest number of frequencies for a judgement."""

SYMMETRIC, DIFFERENT = 0.1, 0.5
"""Bounds on the rms difference between the samples and their transpose, divided by sqrt(2) times their rms: at most
the first where the two transposed axes are those of the antennas, at least the second where they are not."""

CLEARER = 2.0
"""How many times more coherent the echoes must be after the exchange. In simulated scenes the right order of the axes
was 3 to 90 times more coherent."""

SURE_BY_RECIPROCITY, SURE_BY_WAVES = 0.98, 0.95
"""Certainty of a finding by either test."""


def axis_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that the frequency axis was exchanged with an antenna axis of the same length; empty otherwise.

    `sweep` is a valid sweep of pairs, or of one moving antenna.
    """
    first = sweep.isel(dict.fromkeys(sweep["s"].dims[: -3 if "rx" in sweep["s"].dims else -2], 0))
    s = first["s"].transpose("frequency", ...)
    equal = [str(name) for name in s.dims[1:] if s.sizes[name] == s.shape[0]]
    if not equal or s.shape[0] < FEWEST or not np.any(s.values):
        return []
    found = _by_reciprocity(first, s.values) if len(equal) == 2 else None
    name, sure = found if found is not None else _by_waves(first, equal)
    if not name:
        return []
    why = "Each pair is heard the same both ways" if found is not None else "Echoes add up to a sharp image"
    what = f"{why} only when the axes frequency and {name} are exchanged: both have length {s.shape[0]}."
    return [Finding("axes-exchanged", what, sure, f"--swap-axes frequency,{name}")]


def _by_reciprocity(sweep: xr.Dataset, s: NDArray[np.complexfloating]) -> tuple[str, float] | None:
    """The axis, "tx" or "rx", that holds the frequencies, by reciprocity, and how sure that is.

    The name is empty where the axes are right. None where antennas do not both transmit and receive, or the symmetry is
    not clear.
    """
    tx, rx = antenna_positions(sweep)
    if not np.allclose(tx, rx):
        return None
    power = float(np.mean(np.abs(s) ** 2))
    difference = {
        name: float(np.sqrt(np.mean(np.abs(s - s.swapaxes(*pair)) ** 2) / (2.0 * power)))
        for name, pair in (("", (1, 2)), ("tx", (0, 2)), ("rx", (0, 1)))
    }
    best = min(difference, key=difference.__getitem__)
    others = [value for name, value in difference.items() if name != best]
    if difference[best] > SYMMETRIC or min(others) < DIFFERENT:
        return None
    return best, SURE_BY_RECIPROCITY


def _by_waves(sweep: xr.Dataset, equal: list[str]) -> tuple[str, float]:
    """The axis with which frequency has to be exchanged for echoes to add up in phase, and how sure that is.

    The name is empty where no exchange is clearly better.
    """
    orders = [sweep, *(swap_axes(sweep, ("frequency", name)) for name in equal)]
    waves = [wavefronts(on_a_line(pairs_of(order)), exchange=False) for order in orders]
    fits = [0.0 if found is None else in_phase(found) for found in waves]
    best = int(np.argmax(fits))
    if best == 0 or fits[best] < IN_PHASE or fits[best] < CLEARER * fits[0]:
        return "", 0.0
    return equal[best - 1], SURE_BY_WAVES
