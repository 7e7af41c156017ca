"""Division of a sweep by the response of the instrument, measured with a reflector at a known place."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.calibration.common_delay import find_common_delay
from mirrorfold.calibration.gate import gate_samples
from mirrorfold.calibration.record import (
    FACTORS,
    blocks,
    by_blocks,
    check_same_axes,
    check_same_steps,
    checked_pairs,
    scaled_to_single_precision,
    with_samples,
)
from mirrorfold.calibration.reflectors import check_reach, plate_paths, positions, sphere_paths
from mirrorfold.common.arguments import boolean, number
from mirrorfold.common.decibels import ratio_of
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, wavenumber

WEAKEST_DB = -40.0
"""Lowest amplitude of the reference, relative to its median [dB], by which samples are divided. Where it is lower, the
instrument is practically insensitive, and division would only amplify noise; samples there become zero."""


def normalise_by_reference(
    sweep: xr.Dataset,
    reference: xr.Dataset,
    *,
    at: ArrayLike,
    normal: ArrayLike | None = None,
    per_channel: bool = False,
    gate: float | None = None,
) -> xr.Dataset:
    """Divide a sweep by the response of the instrument, measured with a known reflector.

    The response is ``H(f) = mean over pairs of S_ref exp(+j k d)``, with the path d over the reflector. After the
    division, the reflector returns ``exp(-j k d)``: the delay, gain and dispersion that all pairs share are removed.

    Parameters
    ----------
    sweep, reference : xarray.Dataset
        The sweep to calibrate and that of the reflector, at the same frequencies; with `per_channel` also at the same
        positions.
    at : (2,) or (3,) [m]
        Apex of the corner reflector, or a point of the plate.
    normal : (2,) or (3,), optional
        Normal of the plate; without it the reflector is point-like.
    per_channel : bool, default False
        Divide each pair by its own response, which calibrates the elements too but needs a strong reference.
    gate : float [m], optional
        Keep only that part of the reference whose range differs from that of the reflector by at most this, however
        long the cables are; by default all of it.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the sweeps differ in frequencies or in steps of calibration, the reference is silent, or the reflector is out
        of reach.
    """
    sweep, reference = checked_pairs(sweep, "sweep", several=True), checked_pairs(reference, "reference")
    per_channel = boolean("per_channel", per_channel)
    check_same_axes(sweep, reference, "reference", antennas=per_channel)
    check_same_steps(sweep, reference, "reference", FACTORS)
    tx, rx = positions(reference)
    check_reach(at, reference)
    length = sphere_paths(tx, rx, at) if normal is None else plate_paths(tx, rx, at, normal)
    samples, k = reference["s"].values, wavenumber(reference)[:, None, None]
    late = 0.0
    if gate is not None:
        gate = number("gate", gate, "m", above=0.0)
        direct_length = np.linalg.norm(tx[:, None] - rx, axis=-1)
        scaled = scaled_to_single_precision(samples)
        late = 0.5 * find_common_delay(scaled, wavenumber(reference), length, direct_length)[0]

    def response(some: slice) -> NDArray[np.complexfloating]:
        """Response (frequencies, tx, rx) of the pairs of some transmitters: the reference with the paths removed."""
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
    floor = ratio_of(WEAKEST_DB) * float(np.median(level))
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
