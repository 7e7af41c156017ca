"""The reference: dividing by what a reflector at a known place returned, frequency by frequency."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.calibration.common_delay import find_common_delay
from mirrorfold.calibration.gate import gate_samples
from mirrorfold.calibration.record import blocks, by_blocks, check_same_axes, checked_pairs, with_samples
from mirrorfold.calibration.reflectors import plate_paths, positions, sphere_paths
from mirrorfold.common.arguments import number, truth
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, wavenumber

WEAKEST_DB = -40.0
"""Reference amplitudes below this level against their median are not divided by: there the instrument is deaf, and
division would only lift noise."""


def normalise_by_reference(
    sweep: xr.Dataset,
    reference: xr.Dataset,
    *,
    at: ArrayLike,
    normal: ArrayLike | None = None,
    per_channel: bool = False,
    gate: float | None = None,
) -> xr.Dataset:
    """The sweep divided by the response of the instrument, as a known reflector shows it.

    The response is ``H(f) = mean over pairs of S_ref exp(+j k d)``, with the path d over the reflector; afterwards the
    reflector would return ``exp(-j k d)``. Delays, gains and dispersion of what all pairs share are gone with it.

    Parameters
    ----------
    sweep, reference : xarray.Dataset
        At the same frequencies; for `per_channel` at the same positions too.
    at : (2,) or (3,) [m]
        Apex of the corner reflector, or a point of the plate.
    normal : (2,) or (3,), optional
        Of a plate; without it the reflector is point-like.
    per_channel : bool, default False
        Divide each pair by its own response, which calibrates the elements too but needs a strong reference.
    gate : float [m], optional
        Keep of the reference what arrives within this range before and behind the reflector, however long the cables
        are; everything by default.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the sweeps do not match, or the reference is silent.
    """
    sweep, reference = checked_pairs(sweep, "sweep", several=True), checked_pairs(reference, "reference")
    per_channel = truth("per_channel", per_channel)
    check_same_axes(sweep, reference, "reference", antennas=per_channel)
    tx, rx = positions(reference)
    length = sphere_paths(tx, rx, at) if normal is None else plate_paths(tx, rx, at, normal)
    samples, k = reference["s"].values, wavenumber(reference)[:, None, None]
    late = 0.0
    if gate is not None:
        gate = number("gate", gate, "m", above=0.0)
        apart = np.linalg.norm(tx[:, None] - rx, axis=-1)
        late = 0.5 * find_common_delay(samples, wavenumber(reference), length, apart)[0]

    def response(some: slice) -> NDArray[np.complexfloating]:
        """Of the pairs of some transmitters."""
        turned = samples[:, some] * np.exp(1j * k * length[some])
        if gate is None:
            return np.asarray(turned)
        return gate_samples(turned, ambiguous_range(reference), late - gate, late + gate)

    parts = blocks(len(tx), samples.nbytes)
    if per_channel:
        level = np.empty(samples.shape, dtype=np.float32)
        for some in parts:
            level[:, some] = np.abs(response(some))
    else:
        common = sum(response(some).sum(axis=(1, 2), keepdims=True) for some in parts) / length.size
        level = np.abs(common)
    floor = 10.0 ** (WEAKEST_DB / 20.0) * float(np.median(level))
    if floor == 0.0:
        raise InputError("reference: is silent in most samples; measure a stronger reflector or more points")
    lost = int(np.count_nonzero(~(level > floor)))
    del level

    def divided(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complexfloating]:
        by = response(some) if per_channel else common
        usable = np.abs(by) > floor
        return np.where(usable, part / np.where(usable, by, 1.0), 0.0)

    s = by_blocks(sweep["s"].values, divided, axis=sweep["s"].get_axis_num("tx"))
    kind = "point-like reflector" if normal is None else "plate"
    ending = f"; {lost} deaf samples of the response left out" if lost else ""
    where = ", ".join(f"{c:g}" for c in np.ravel(at))
    each = "pair by pair" if per_channel else "the same for all pairs"
    return with_samples(sweep, s, f"divided by the response to a {kind} at ({where}) m, {each}{ending}")
