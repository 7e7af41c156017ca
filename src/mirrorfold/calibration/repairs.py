"""Repairs of classic mistakes in a sweep: conjugated samples, wrong orders, wrong units, the delay of cables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.calibration.record import by_blocks, checked_pairs, recorded, with_samples
from mirrorfold.common.arguments import in_message, number, wrong_kind
from mirrorfold.common.plausible import LONG_ENOUGH, extent
from mirrorfold.common.units import KINDS, unit_named
from mirrorfold.errors import InputError
from mirrorfold.sweep import antenna_positions, check_sweep, is_raster, wave_speed


def conjugate(sweep: xr.Dataset) -> xr.Dataset:
    """Conjugate every sample of a sweep, for data recorded with the time convention ``exp(-jwt)``.

    Parameters
    ----------
    sweep : xarray.Dataset

    Returns
    -------
    xarray.Dataset
    """
    sweep = check_sweep(sweep, source="conjugate")
    return with_samples(sweep, np.conj(sweep["s"].values), "conjugated")


def swap_iq(sweep: xr.Dataset) -> xr.Dataset:
    """Exchange the in-phase and quadrature parts of the samples, ``I + jQ -> Q + jI``.

    This is conjugation times j, and a constant phase makes no difference in images.
    """
    sweep = check_sweep(sweep, source="swap_iq")
    s = sweep["s"].values
    return with_samples(sweep, by_blocks(s, lambda part, _: part.imag + 1j * part.real), "I and Q exchanged")


def reverse_frequency(sweep: xr.Dataset) -> xr.Dataset:
    """Reverse the samples along frequency, but not the frequencies, for data stored from the highest frequency down."""
    sweep = check_sweep(sweep, source="reverse_frequency")
    s = np.flip(sweep["s"].values, axis=sweep["s"].get_axis_num("frequency"))
    return with_samples(sweep, s, "order of the frequencies reversed")


def sort_frequencies(sweep: xr.Dataset) -> xr.Dataset:
    """Sort the frequencies of a sweep, with their samples, in rising order; it need not be valid otherwise.

    Raises
    ------
    InputError
        If the sweep has no frequencies.
    """
    _expect_sweep(sweep, "sort_frequencies")
    if "frequency" not in sweep.variables or sweep["frequency"].dims != ("frequency",):
        raise InputError("sort_frequencies: the sweep has no coordinate 'frequency'; add the frequencies [Hz]")
    order = np.argsort(sweep["frequency"].values, kind="stable")
    return recorded(sweep.isel(frequency=order), "frequencies sorted")


def scale_positions(sweep: xr.Dataset, unit: str) -> xr.Dataset:
    """Convert antenna positions that were given in another unit to metres.

    Parameters
    ----------
    sweep : xarray.Dataset
    unit : {"mm", "cm", "um", "inch", "m"}
        The unit of the positions as they are; any unit of length of `mirrorfold.common.units`.

    Raises
    ------
    InputError
        If the array would then be too short to tell directions, so that its positions are in metres already.
    """
    scale = _factor("length", unit)
    _expect_sweep(sweep, "scale_positions")
    names = [name for name in ("tx_position", "rx_position", "antenna_position") if name in sweep.variables]
    sweep = sweep.assign_coords({name: sweep[name].assign_attrs(units="m") for name in names})
    sweep = check_sweep(sweep, source="scale_positions")
    if is_raster(sweep):
        raise InputError("scale_positions: a raster scan has no antenna positions; leave the position unit out")
    scaled = {
        name: (sweep[name].dims, sweep[name].values * scale, {**sweep[name].attrs, "units": "m"}) for name in names
    }
    length, wavelength = extent(*antenna_positions(sweep)), wave_speed(sweep) / float(sweep["frequency"].max())
    if scale * length < LONG_ENOUGH * wavelength <= length:
        raise InputError(
            f"scale_positions: in {unit} the array of {length:.3g} m would be {scale * length / wavelength:.1g} "
            "wavelengths long, which tells no directions; its positions are in metres already, leave the unit out"
        )
    return recorded(sweep.assign_coords(scaled), f"positions taken for {unit}")


def scale_frequencies(sweep: xr.Dataset, unit: str) -> xr.Dataset:
    """Convert frequencies that were given in another unit to hertz; the sweep need not be valid otherwise.

    Parameters
    ----------
    sweep : xarray.Dataset
    unit : {"kHz", "MHz", "GHz", "THz"}
        The unit of the frequencies as they are.

    Raises
    ------
    InputError
        If `unit` is no unit of frequency, or the sweep has no frequencies.
    """
    _expect_sweep(sweep, "scale_frequencies")
    if "frequency" not in sweep.variables:
        raise InputError("scale_frequencies: the sweep has no coordinate 'frequency'; add the frequencies [Hz]")
    _check_numbers(sweep, "frequency", "scale_frequencies")
    values = sweep["frequency"].values * _factor("frequency", unit)
    scaled = sweep.assign_coords(frequency=("frequency", values, {**sweep["frequency"].attrs, "units": "Hz"}))
    return recorded(scaled, f"frequencies taken for {unit}")


def scale_angles(sweep: xr.Dataset, unit: str) -> xr.Dataset:
    """Convert the directions of a raster scan that were given in another unit to degrees.

    Parameters
    ----------
    sweep : xarray.Dataset
    unit : {"radian", "mrad", "degree"}
        The unit of azimuth and elevation as they are.

    Raises
    ------
    InputError
        If `unit` is no unit of angles, the sweep is no raster scan, or the converted directions are not valid.
    """
    if not is_raster(sweep):
        raise InputError("scale_angles: expected a raster scan, s(frequency, azimuth, elevation); leave the unit out")
    for name in ("azimuth", "elevation"):
        _check_numbers(sweep, name, "scale_angles")
    factor = _factor("angle", unit)
    scaled = {
        name: (name, sweep[name].values * factor, {**sweep[name].attrs, "units": "degree"})
        for name in ("azimuth", "elevation")
    }
    return recorded(check_sweep(sweep.assign_coords(scaled), source="scale_angles"), f"directions taken for {unit}")


def _expect_sweep(sweep: xr.Dataset, source: str) -> None:
    """Refuse what is no `xarray.Dataset`; a sweep that is to be repaired need not be valid otherwise."""
    if not isinstance(sweep, xr.Dataset):
        raise wrong_kind(source, sweep, "a sweep (xarray.Dataset)")


def _check_numbers(sweep: xr.Dataset, name: str, source: str) -> None:
    """Refuse a coordinate that does not consist of numbers along its own dimension.

    Raises
    ------
    InputError
    """
    given = sweep[name]
    if given.dims != (name,) or given.dtype.kind not in "fiu":
        found = f"type {given.dtype} and dimensions {given.dims}"
        raise InputError(f"{source}: {name} has {found}, expected numbers along {name!r}; correct the file")


def swap_axes(sweep: xr.Dataset, axes: Sequence[str]) -> xr.Dataset:
    """Exchange two axes of the samples whose names were interchanged; the sweep need not be valid otherwise.

    Parameters
    ----------
    sweep : xarray.Dataset
    axes : two str
        Dimensions of `s` of equal length, such as ``("frequency", "tx")``.

    Raises
    ------
    InputError
        If there are no samples, they lack one of these dimensions, or the dimensions differ in length.
    """
    _expect_sweep(sweep, "swap_axes")
    if "s" not in sweep:
        raise InputError("swap_axes: holds no variable 's'; expected a sweep with s(frequency, tx, rx)")
    s = sweep["s"]
    if not isinstance(axes, list | tuple) or not all(isinstance(name, str) for name in axes):
        raise wrong_kind("swap_axes", axes, "two names of dimensions, such as ('tx', 'rx')", reader="")
    if len(set(axes)) != 2 or len(axes) != 2 or not set(axes) <= set(s.dims) or s.sizes[axes[0]] != s.sizes[axes[1]]:
        raise InputError(
            f"swap_axes: {', '.join(axes)} are not two dimensions of equal length of s "
            f"{dict(s.sizes)}; axes of different lengths are never exchanged"
        )
    at = [s.get_axis_num(name) for name in axes]
    turned = s.copy(data=np.ascontiguousarray(np.swapaxes(s.values, at[0], at[1])))
    return recorded(sweep.assign(s=turned), f"axes {axes[0]} and {axes[1]} of the samples exchanged")


def _factor(kind: str, unit: str) -> float:
    """The factor by which a number in a unit has to be multiplied to be in the basic unit of its kind.

    Raises
    ------
    InputError
        If `unit` is no unit of this kind.
    """
    factor = KINDS[kind].get(unit_named(unit) or "") if isinstance(unit, str) else None
    if factor is None:
        raise InputError(f"{kind} unit is {in_message(unit)}, expected one of: {', '.join(KINDS[kind])}")
    return factor


def swap_tx_rx(sweep: xr.Dataset) -> xr.Dataset:
    """Exchange the positions of transmitters and receivers, and leave the samples as they are.

    Raises
    ------
    InputError
        If the numbers of transmitters and receivers differ.
    """
    sweep = checked_pairs(sweep, "swap_tx_rx", several=True)
    tx, rx = sweep["tx_position"], sweep["rx_position"]
    if tx.shape != rx.shape:
        raise InputError(
            f"swap_tx_rx: there are {tx.shape[0]} transmitters and {rx.shape[0]} receivers, so that their positions "
            "cannot be exchanged; transpose s in the file instead"
        )
    swapped = {
        "tx_position": (tx.dims, rx.values.copy(), tx.attrs),
        "rx_position": (rx.dims, tx.values.copy(), rx.attrs),
    }
    return recorded(sweep.assign_coords(swapped), "positions of tx and rx exchanged")


def remove_cable(sweep: xr.Dataset, length: float) -> xr.Dataset:
    """Remove the delay of cables from a sweep: ``S exp(+j k L)``.

    Parameters
    ----------
    sweep : xarray.Dataset
    length : float [m]
        Electrical length L, as of light in vacuum, of all cables from the generator to the receiver together, beyond
        what earlier steps have removed. Echoes move nearer by half of it, or less if the waves in the scene are slower
        than light. A negative length moves them away.
    """
    length = number("cable length", length, "m")
    sweep = check_sweep(sweep, source="remove_cable")
    axis = sweep["s"].get_axis_num("frequency")
    k = 2.0 * np.pi * sweep["frequency"].values / speed_of_light
    turn = np.exp(1j * k * length).reshape([-1] + [1] * (sweep["s"].ndim - axis - 1))
    turned = by_blocks(sweep["s"].values, lambda part, some: part * turn[some], axis)
    return with_samples(sweep, turned, f"cable of {length:.6g} m removed")
