"""What a calibration takes of the memory: the sweeps that it holds, and the largest step."""

from __future__ import annotations

import xarray as xr

from mirrorfold.calibration.autofocus import GUIDES, TOLERANCE, guide_grid
from mirrorfold.calibration.masking import ENOUGH
from mirrorfold.calibration.record import BLOCK_BYTES
from mirrorfold.common.forecasts import GIGABYTE, Parts, fullest

BLOCK_ARRAYS, REFERENCE_ARRAYS = 3.0, 6.0
"""Times a block of samples that a step takes to work on it: in double precision, which is twice its size, with phases
and a quotient where it is divided by a reference."""


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
    """What a calibration holds at once where it holds most, by name [bytes].

    Parameters
    ----------
    sweep : xarray.Dataset
        The one to calibrate; all others are taken to be as large.
    changed : bool
        Whether any other step makes new samples.
    background, reference : bool
        Whether there are such sweeps.
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
    """What an image of the guide stars takes [bytes], the samples included."""
    from mirrorfold.focusing import choose_algorithm

    x, y = guide_grid(sweep)
    return choose_algorithm(sweep, x=x, y=y, tolerance=TOLERANCE).memory_gb * GIGABYTE
