"""Mistakes in the sweep of one antenna that moves around a distant scene, recognised by the sharpness of the image.

Waves from far away are nearly flat, and there are no direct waves between antennas, so other tests fail. But along the
antenna's path the range of each echo must change as its phase does. With the frequencies in reversed order the range
changes the wrong way. Conjugated samples show the scene turned about its centre, where its echoes are curved the wrong
way. Either mistake smears the image. So the sweep is focused as it is and with each repair, and the sharpest image
tells. If the path is so short or so distant that nothing smears, there is no finding.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.repairs import conjugate, reverse_frequency
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.focusing import focus, sweep_grid

FEWEST = 16
"""Smallest number of positions, and of frequencies, for a judgement."""

PIXELS = 250
"""Pixels of the image along x and along y; speckle needs no finer sampling than a resolution cell."""

BLOCKS = 5
"""Blocks along x and along y into which the image is cut, so that a single sharp echo does not decide."""

SHARPER = 1.3
"""How many times sharper the best image must be than all others."""

RESAMPLES = 200
"""Random draws of the blocks, with repetition."""

SUREST = 0.99
"""Highest certainty that a finding states."""

SURE_ENOUGH = 0.9
"""Smallest share of these draws in which the best image must be sharper than all others by `SHARPER`."""

REPAIRS = {
    (): lambda sweep: sweep,
    ("conjugated",): conjugate,
    ("frequency-reversed",): reverse_frequency,
    ("conjugated", "frequency-reversed"): lambda sweep: reverse_frequency(conjugate(sweep)),
}
"""Repairs of a sweep by the mistakes that they correct."""

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
"""The sentence and the remedy of a finding, by the name of the mistake."""


def sharpness_findings(sweep: xr.Dataset) -> tuple[list[Finding], bool]:
    """Findings of the mistakes that smear the image, and whether one of the four images stood out.

    `sweep` is that of a moving antenna, ``s(frequency, position)``, with the attribute `scene_center`.
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
    """Sharpness ``mean |I|^4 / (mean |I|^2)^2`` of each block, (blocks,): 2 for speckle, more for few bright echoes."""
    power = np.abs(image).astype(float) ** 2
    rows = (np.array_split(part, BLOCKS, axis=1) for part in np.array_split(power, BLOCKS, axis=0))
    return np.array([np.mean(block**2) / max(np.mean(block) ** 2, 1e-300) for row in rows for block in row])
