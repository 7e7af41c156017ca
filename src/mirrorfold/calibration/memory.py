"""Forecast of the memory that a calibration takes: the sweeps that it holds, and its largest step."""

from __future__ import annotations

import xarray as xr

from mirrorfold.calibration.autofocus import GUIDES, TOLERANCE, guide_grid
from mirrorfold.calibration.masking import ENOUGH
from mirrorfold.calibration.record import BLOCK_BYTES
from mirrorfold.common.forecasts import GIGABYTE, Parts, fullest

BLOCK_ARRAYS, REFERENCE_ARRAYS = 3.0, 6.0
"""Memory that a step takes to work on a block of samples, relative to the block: the samples in double precision, twice
their size, and their phases; more where they are divided by a reference."""


def calibration_parts(
    sweep: xr.Dataset,
    *,
    changed: bool = False,
    background: bool = False,
    reference: bool = False,
    per_channel: bool = False,
    spheres: int = 0,
    mask: bool = False,
    autofocus: bool = False,
) -> Parts:
    """Memory that a calibration takes in its largest step: the parts that it holds at once, by name [bytes].

    Parameters
    ----------
    sweep : xarray.Dataset
        The sweep to calibrate; all others are taken to be as large.
    changed : bool
        Whether any step other than those below makes new samples.
    background, reference : bool
        Whether there is a sweep of the background, of a reference.
    per_channel : bool
        Whether each pair is divided by its own response.
    spheres : int
        How many sweeps of a sphere there are.
    mask, autofocus : bool
        Whether these steps are asked for.
    """
    samples = 8.0 * sweep["s"].size
    held: Parts = {"sweep": samples}
    held |= {name: samples for name, given in (("background", background), ("reference", reference)) if given}
    block = {"a block of samples": (REFERENCE_ARRAYS if reference else BLOCK_ARRAYS) * min(BLOCK_BYTES, samples)}
    step = held | block
    if changed or background or reference or mask or spheres or autofocus:
        step["sweep after a step"] = samples
    stages = [step]
    if per_channel:
        stages.append(held | block | {"levels of the reference, and their median": samples})
    if mask:
        pairs = samples / sweep.sizes["frequency"]
        looked_at = {"frequencies looked at": 3.0 * pairs * min(ENOUGH["frequencies"], sweep.sizes["frequency"])}
        stages.append(held | {"sweep after a step": samples, "bad frequencies filled in, if any": samples} | looked_at)
    if spheres:
        spheres_held = held | {"spheres": spheres * samples}
        stages += [spheres_held | block | {"aligned echoes": 2.0 * samples}, step | {"spheres": spheres * samples}]
    if autofocus:
        stages.append(held | {"best and next sweep": 2.0 * samples, "image": _imaging(sweep) - samples})
        pairs = samples / 8.0 / sweep.sizes["frequency"]
        stages.append(held | {"best sweep": samples, "guide stars": GUIDES * 16.0 * pairs})
    return fullest(*stages)


def _imaging(sweep: xr.Dataset) -> float:
    """Memory for focusing the image of the guide stars [bytes], the samples included."""
    from mirrorfold.focusing import choose_algorithm

    x, y = guide_grid(sweep)
    return choose_algorithm(sweep, x=x, y=y, tolerance=TOLERANCE).memory_gb * GIGABYTE
