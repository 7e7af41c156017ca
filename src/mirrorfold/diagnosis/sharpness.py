"""Mistakes of an antenna that moves far around a scene, told by how sharp the image is.

From afar all waves are nearly flat, and one antenna hears no other. But over the angle of its path each echo must move
in range as its phase says. Frequencies in the opposite order let it move the wrong way; conjugated samples show the
scene turned about its centre, whose echoes then bend the wrong way. Either smears the image. Where the path is so short
or so far that nothing smears, nothing is said.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.repairs import conjugate, reverse_frequency
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.focusing import focus, sweep_grid

FEWEST = 16
"""Positions and frequencies."""

PIXELS = 250
"""Each way, of the image that is looked at: speckle needs no finer sampling than a resolution cell."""

BLOCKS = 5
"""Each way, into which the image is cut: the sharpest of echoes shall not speak for all."""

SHARPER = 1.3
"""How much sharper a repaired sweep must be."""

RESAMPLES = 200
SUREST = 0.99
SURE_ENOUGH = 0.9
"""Share of random draws of the blocks in which the same repair is that much sharper than all others."""

REPAIRS = {
    (): lambda sweep: sweep,
    ("conjugated",): conjugate,
    ("frequency-reversed",): reverse_frequency,
    ("conjugated", "frequency-reversed"): lambda sweep: reverse_frequency(conjugate(sweep)),
}

WHAT = {
    "conjugated": (
        "The image gets sharp when the samples are conjugated: they have the other time convention, or I and Q are "
        "exchanged.",
        "--conjugate",
    ),
    "frequency-reversed": (
        "The image gets sharp when the frequencies are turned around: the samples are stored from the highest to the "
        "lowest.",
        "--reverse-frequency",
    ),
}


def sharpness_findings(sweep: xr.Dataset) -> tuple[list[Finding], bool]:
    """The mistakes that smear the image of a moving antenna, and whether any of the four images stood out.

    Of a sweep ``s(frequency, position)`` with the attribute `scene_center`.
    """
    if min(sweep["s"].shape[-2:]) < FEWEST:
        return [], False
    first = sweep.isel(dict.fromkeys(sweep["s"].dims[:-2], 0))
    if not np.any(first["s"].values):
        return [], False
    x, y = (np.linspace(axis[0], axis[-1], PIXELS) for axis in sweep_grid(first))
    images = (focus(repair(first), x=x, y=y, tolerance=1e-2).values for repair in REPAIRS.values())
    blocks = np.log([_sharpness(image) for image in images])
    draws = np.random.default_rng(0).integers(0, blocks.shape[1], (RESAMPLES, blocks.shape[1]))
    level = np.exp(blocks[:, draws].mean(axis=2))  # (repairs, draws)
    best = int(blocks.mean(axis=1).argmax())
    others = np.delete(level, best, axis=0).max(axis=0)
    sure = float(np.mean(level[best] > SHARPER * others))
    if sure < SURE_ENOUGH:
        return [], False
    made = tuple(REPAIRS)[best]
    return [Finding(name, WHAT[name][0], min(SUREST, sure), WHAT[name][1]) for name in made], True


def _sharpness(image: NDArray[np.complex64]) -> NDArray[np.float64]:
    """``mean |I|^4 / (mean |I|^2)^2`` in each block: 2 for speckle, more for few bright echoes."""
    power = np.abs(image).astype(float) ** 2
    rows = (np.array_split(part, BLOCKS, axis=1) for part in np.array_split(power, BLOCKS, axis=0))
    return np.array([np.mean(block**2) / max(np.mean(block) ** 2, 1e-300) for row in rows for block in row])
