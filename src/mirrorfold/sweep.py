"""The Sweep: one raw radar measurement as an `xarray.Dataset`, its checks, what it can resolve, noise.

Variable ``s(frequency, tx, rx)``, complex64, with coordinates ``frequency`` [Hz], ``tx_position(tx, axis)`` and
``rx_position(rx, axis)`` [m]; of one moving antenna that hears only itself ``s(frequency, position)`` with
``antenna_position(position, axis)`` [m]; of a raster scan ``s(frequency, azimuth, elevation)`` with ``azimuth`` and
``elevation`` [degree] and the attr ``origin`` [m]; time convention ``exp(+jwt)``, so that a path of length d
contributes ``exp(-j k d)``.

Optional: the attr ``wave_speed`` [m/s] where it is not that of light; the attr ``scene_center`` [m], around which the
unambiguous range then lies instead of beginning at the antennas; the coordinate ``measured(tx, rx)``, false for pairs
that were not measured, whose samples are zero and therefore missing from every sum.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError

AXES = ("x", "y", "z")
TIME_CONVENTION = "exp(+jwt)"

PAIR_DIMENSIONS = ("frequency", "tx", "rx")

MONOSTATIC_DIMENSIONS = ("frequency", "position")

RASTER_DIMENSIONS = ("frequency", "azimuth", "elevation")

STEP_TOLERANCE = 1e-3
"""Largest deviation of a frequency step from the mean one, as a share of it: at 1000 steps a phase error of a few
degrees at the end of the unambiguous range."""


def make_sweep(
    s: ArrayLike,
    *,
    frequency: ArrayLike,
    tx_position: ArrayLike,
    rx_position: ArrayLike,
    **attrs: Any,
) -> xr.Dataset:
    """A MIMO or synthetic-aperture Sweep.

    Parameters
    ----------
    s : (frequencies, tx, rx) complex array
        Scattering parameter of every pair, time convention ``exp(+jwt)``.
    frequency : (frequencies,) array [Hz]
        In uniform steps.
    tx_position, rx_position : (tx, 3) and (rx, 3) arrays [m]
    **attrs
        What else is known: `title`, `instrument`, `processing` ...

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the result is not a valid sweep.
    """
    try:
        sweep = xr.Dataset(
            {"s": (("frequency", "tx", "rx"), np.asarray(s, dtype=np.complex64))},
            coords={
                "frequency": ("frequency", np.asarray(frequency, dtype=float), {"units": "Hz"}),
                "tx_position": (("tx", "axis"), np.asarray(tx_position, dtype=float), {"units": "m"}),
                "rx_position": (("rx", "axis"), np.asarray(rx_position, dtype=float), {"units": "m"}),
                "axis": list(AXES),
            },
            attrs={"mirrorfold_kind": "sweep", "time_convention": TIME_CONVENTION, **attrs},
        )
    except ValueError as error:
        raise InputError(
            f"sweep: the shapes do not fit together ({error}); expected s(frequency, tx, rx), frequency(frequency), "
            "tx_position(tx, 3) and rx_position(rx, 3)"
        ) from None
    return check_sweep(sweep)


def make_monostatic_sweep(
    s: ArrayLike,
    *,
    frequency: ArrayLike,
    antenna_position: ArrayLike,
    **attrs: Any,
) -> xr.Dataset:
    """The Sweep of one moving antenna that transmits and receives, or of antennas that hear only themselves.

    Parameters
    ----------
    s : (..., frequencies, positions) complex array
        S11 at every position, time convention ``exp(+jwt)``; one dimension before these two is named `frame`.
    frequency : (frequencies,) array [Hz]
        In uniform steps.
    antenna_position : (positions, 3) array [m]
    **attrs
        What else is known: `title`, `wave_speed` [m/s], `scene_center` [m] ...

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the result is not a valid sweep.
    """
    try:
        values = np.asarray(s, dtype=np.complex64)
        sweep = xr.Dataset(
            {"s": (("frame", *MONOSTATIC_DIMENSIONS)[-values.ndim :], values)},
            coords={
                "frequency": ("frequency", np.asarray(frequency, dtype=float), {"units": "Hz"}),
                "antenna_position": (("position", "axis"), np.asarray(antenna_position, dtype=float), {"units": "m"}),
                "axis": list(AXES),
            },
            attrs={"mirrorfold_kind": "sweep", "time_convention": TIME_CONVENTION, **attrs},
        )
    except ValueError as error:
        raise InputError(
            f"sweep: the shapes do not fit together ({error}); expected s(frequency, position), frequency(frequency) "
            "and antenna_position(position, 3)"
        ) from None
    return check_sweep(sweep)


def make_raster_sweep(
    s: ArrayLike,
    *,
    frequency: ArrayLike,
    azimuth: ArrayLike,
    elevation: ArrayLike,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    **attrs: Any,
) -> xr.Dataset:
    """The Sweep of a raster scan.

    Parameters
    ----------
    s : (frequencies, azimuths, elevations) complex array
        S11 of every beam, time convention ``exp(+jwt)``.
    frequency : (frequencies,) array [Hz]
        In uniform steps.
    azimuth, elevation : (azimuths,) and (elevations,) arrays [degree]
        A beam points to ``(sin az cos el, cos az cos el, sin el)``.
    origin : (3,) array [m]
        Where the beams start.
    **attrs
        What else is known: `title`, `spot_radius` and `focus_distance` [m] of the beam ...

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the result is not a valid sweep.
    """
    try:
        sweep = xr.Dataset(
            {"s": (RASTER_DIMENSIONS, np.asarray(s, dtype=np.complex64))},
            coords={
                "frequency": ("frequency", np.asarray(frequency, dtype=float), {"units": "Hz"}),
                "azimuth": ("azimuth", np.asarray(azimuth, dtype=float), {"units": "degree"}),
                "elevation": ("elevation", np.asarray(elevation, dtype=float), {"units": "degree"}),
            },
            attrs={
                "mirrorfold_kind": "sweep",
                "time_convention": TIME_CONVENTION,
                "origin": np.asarray(origin, dtype=float),
                **attrs,
            },
        )
    except ValueError as error:
        raise InputError(
            f"sweep: the shapes do not fit together ({error}); expected s(frequency, azimuth, elevation), "
            "frequency(frequency), azimuth(azimuth) and elevation(elevation)"
        ) from None
    return check_sweep(sweep)


def is_raster(sweep: xr.Dataset) -> bool:
    """Whether a sweep is that of a raster scan."""
    return "s" in sweep and sweep["s"].dims[-3:] == RASTER_DIMENSIONS


def is_monostatic(sweep: xr.Dataset) -> bool:
    """Whether a sweep is that of antennas that hear only themselves."""
    return "s" in sweep and sweep["s"].dims[-2:] == MONOSTATIC_DIMENSIONS


def antenna_positions(sweep: xr.Dataset) -> tuple[Array, Array]:
    """Positions of the transmitters and of the receivers [m], (tx, 3) and (rx, 3); of one moving antenna twice."""
    names = ("antenna_position",) * 2 if "antenna_position" in sweep.variables else ("tx_position", "rx_position")
    tx, rx = (np.asarray(sweep[name].values, dtype=np.float64) for name in names)
    return tx, rx


def wave_speed(sweep: xr.Dataset) -> float:
    """Speed of the waves [m/s]: the attr `wave_speed`, that of light in vacuum without it."""
    return float(sweep.attrs.get("wave_speed", speed_of_light))


def wavenumber(sweep: xr.Dataset) -> NDArray[np.float64]:
    """Wavenumbers [rad/m] at the frequencies, ``2 pi f / c`` with the sweep's own speed of waves."""
    return np.asarray(2.0 * np.pi * sweep["frequency"].values.astype(float) / wave_speed(sweep))


def check_sweep(sweep: xr.Dataset, source: str = "sweep") -> xr.Dataset:
    """The sweep in the project's own convention, or a plain word on what is wrong with it.

    Data of the other time convention, ``exp(-jwt)``, is conjugated.

    Raises
    ------
    InputError
        With the first thing that is missing or wrong; `source` names the file in the message.
    """

    def refuse(message: str) -> InputError:
        return InputError(f"{source}: {message}")

    if not isinstance(sweep, xr.Dataset) or "s" not in sweep:
        raise refuse("holds no variable 's'; expected a sweep with s(frequency, tx, rx)")
    s = sweep["s"]
    raster, monostatic = is_raster(sweep), is_monostatic(sweep)
    places = ("antenna_position",) if monostatic else ("tx_position", "rx_position")
    for name in RASTER_DIMENSIONS if raster else ("frequency", *places):
        if name not in sweep.variables:
            where = "the frequencies [Hz]" if name == "frequency" else "the directions [degree]"
            where = "the antenna positions [m]" if name.endswith("position") else where
            raise refuse(f"has no coordinate {name!r}; add {where} before imaging")
    if not raster and not monostatic and s.dims[-3:] != PAIR_DIMENSIONS:
        raise refuse(
            f"s has dimensions {s.dims}, expected (frequency, tx, rx), (frequency, position) or "
            "(frequency, azimuth, elevation); transpose or rename them"
        )
    if s.size == 0:
        raise refuse(f"s is empty, its shape is {s.shape}; measure at least one frequency and one pair")
    if s.dtype.kind != "c":
        raise refuse(f"s has type {s.dtype}, expected complex numbers; store real and imaginary part as one")
    if raster:
        _check_directions(sweep, refuse)
    else:
        _check_positions(sweep, places, refuse)
    _check_attrs(sweep, refuse)
    frequency = sweep["frequency"].values
    if frequency.dtype.kind not in "fiu" or not np.isfinite(frequency).all() or not (frequency > 0).all():
        raise refuse("frequency holds values that are not positive numbers; give them in hertz")
    if frequency.size > 1:
        step = np.diff(frequency)
        if step.mean() <= 0 or np.abs(step - step.mean()).max() > STEP_TOLERANCE * step.mean():
            raise refuse(
                f"frequency has steps from {step.min():g} to {step.max():g} Hz, expected equal rising steps; "
                "sort them or resample to a uniform grid"
            )
    missing = int(np.count_nonzero(~np.isfinite(s.values)))
    if missing:
        raise refuse(
            f"s holds {missing} samples of {s.size} that are not finite (NaN or infinite); "
            "replace them, for example by zero, or leave out their channels"
        )
    if not np.any(s.values):
        raise refuse("every sample of s is zero; there is nothing to image")
    convention = sweep.attrs.get("time_convention", TIME_CONVENTION)
    if convention == "exp(-jwt)":
        return sweep.assign(s=np.conj(s)).assign_attrs(time_convention=TIME_CONVENTION)
    if convention != TIME_CONVENTION:
        raise refuse(f"time_convention is {convention!r}, expected 'exp(+jwt)' or 'exp(-jwt)'")
    return sweep


def _check_attrs(sweep: xr.Dataset, refuse: Callable[[str], InputError]) -> None:
    """Refuse a wave speed or a centre of the scene that is none."""
    speed = sweep.attrs.get("wave_speed", speed_of_light)
    if not isinstance(speed, (int, float, np.number)) or not 0.0 < float(speed) < np.inf:
        raise refuse(f"attr wave_speed is {speed!r}, expected a positive number of metres per second")
    centre = sweep.attrs.get("scene_center")
    if centre is None:
        return
    try:
        place = np.asarray(centre, dtype=float)
    except (TypeError, ValueError):
        place = np.empty(0)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise refuse(f"attr scene_center is {centre!r}, expected three finite numbers in metres")


def _check_positions(sweep: xr.Dataset, names: tuple[str, ...], refuse: Callable[[str], InputError]) -> None:
    """Refuse antenna positions that are none."""
    for name in names:
        dim = name.removesuffix("_position").replace("antenna", "position")
        if sweep[name].dims != (dim, "axis") or sweep[name].shape[1] != 3:
            raise refuse(
                f"{name} has dimensions {dict(sweep[name].sizes)}, expected ({dim}, axis) with the three axes x, y, z"
            )
        if sweep[name].dtype.kind not in "fiu" or not np.isfinite(sweep[name].values).all():
            raise refuse(f"{name} holds values that are not finite numbers; give every antenna its place in metres")


def _check_directions(sweep: xr.Dataset, refuse: Callable[[str], InputError]) -> None:
    """Refuse beam directions that are none."""
    for name in ("azimuth", "elevation"):
        angle = sweep[name].values
        if sweep[name].dims != (name,) or angle.dtype.kind not in "fiu" or not np.isfinite(angle).all():
            raise refuse(f"{name} holds values that are not finite numbers; give every beam its direction in degrees")
        if np.any(np.diff(angle) <= 0) or np.abs(angle).max(initial=0.0) >= 90.0:
            raise refuse(f"{name} must rise from more than -90 to less than 90 degrees; sort the beams")
    origin = np.asarray(sweep.attrs.get("origin", (0.0, 0.0, 0.0)), dtype=float)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise refuse("attr origin is not a place; give three finite numbers in metres, where the beams start")


def radar_position(sweep: xr.Dataset) -> Array:
    """The mean of the tx and rx positions, or where the beams start, shape (3,) [m]."""
    if is_raster(sweep):
        return np.array(sweep.attrs.get("origin", (0.0, 0.0, 0.0)), dtype=float)
    tx, rx = antenna_positions(sweep)
    return np.asarray(0.5 * (tx.mean(axis=0) + rx.mean(axis=0)))


def frequency_step(sweep: xr.Dataset) -> float:
    """Mean distance of neighbouring frequencies [Hz]; infinite for a single one."""
    frequency = sweep["frequency"].values
    return float((frequency[-1] - frequency[0]) / (frequency.size - 1)) if frequency.size > 1 else float("inf")


def ambiguous_range(sweep: xr.Dataset) -> float:
    """The range [m] at which echoes wrap around to zero, ``c / (2 df)``."""
    return wave_speed(sweep) / (2.0 * frequency_step(sweep))


def range_resolution(sweep: xr.Dataset) -> float:
    """Range resolution [m], ``c / (2 B)`` with the bandwidth B of all samples."""
    return wave_speed(sweep) / (2.0 * frequency_step(sweep) * sweep.sizes["frequency"])


def add_noise(sweep: xr.Dataset, *, snr_db: float, seed: int) -> xr.Dataset:
    """The sweep with white complex Gaussian noise.

    Parameters
    ----------
    sweep : xarray.Dataset
    snr_db : float [dB]
        Mean power of the samples over the power of the noise, per sample, before any focusing.
    seed : int

    Returns
    -------
    xarray.Dataset
        With attr `snr_db`.
    """
    s = sweep["s"].values
    power = float(np.mean(np.abs(s).astype(float) ** 2)) * 10.0 ** (-snr_db / 10.0)
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal((*s.shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    noisy = (s + np.sqrt(power / 2.0).astype(np.float32) * noise).astype(np.complex64)
    return sweep.assign(s=sweep["s"].copy(data=noisy)).assign_attrs(snr_db=float(snr_db), noise_seed=int(seed))
