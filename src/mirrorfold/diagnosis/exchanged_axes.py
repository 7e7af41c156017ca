"""Axes of equal length that were named the wrong way round: frequencies for antennas.

Where antennas transmit and receive, each pair is heard the same both ways (reciprocity), so that the samples are
symmetric in two of their three axes; the third one is the frequency. Elsewhere the waves tell: echoes add up in phase,
to a sharp image, for one order alone. Transmitters that were taken for receivers are found likewise, see `mistakes`.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.repairs import swap_axes
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.diagnosis.physics import IN_PHASE, in_phase
from mirrorfold.diagnosis.wavefronts import wavefronts
from mirrorfold.sweep import antenna_positions
from mirrorfold.sweep.pairs import on_a_line, pairs_of

FEWEST = 8
"""Samples along an axis, below which nothing is judged."""

SYMMETRIC, DIFFERENT = 0.1, 0.5
"""Largest relative difference from the transpose that reciprocity leaves, and the least of axes that are no pair."""

CLEARER = 2.0
"""How much better echoes must add up in the other order; in simulated scenes the right one was 3 to 90 times better."""

SURE_BY_RECIPROCITY, SURE_BY_WAVES = 0.98, 0.95


def axis_findings(sweep: xr.Dataset) -> list[Finding]:
    """Whether the frequencies of a valid sweep of pairs, or of one moving antenna, stand for antennas."""
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
    """The axis that holds the frequencies, empty where it is the right one; None where reciprocity does not tell."""
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
    """The axis with which frequency has to be exchanged for echoes to be waves, empty for none; how sure that is."""
    orders = [sweep, *(swap_axes(sweep, ("frequency", name)) for name in equal)]
    waves = [wavefronts(on_a_line(pairs_of(order)), exchange=False) for order in orders]
    fits = [0.0 if found is None else in_phase(found) for found in waves]
    best = int(np.argmax(fits))
    if best == 0 or fits[best] < IN_PHASE or fits[best] < CLEARER * fits[0]:
        return "", 0.0
    return equal[best - 1], SURE_BY_WAVES
