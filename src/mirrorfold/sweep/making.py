"""Sweeps made from arrays and checked; noise added to a sweep."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.common.arguments import number, whole_number, wrong_kind
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.noise import complex_noise
from mirrorfold.errors import InputError
from mirrorfold.sweep.checks import check_sweep, unit_doubts
from mirrorfold.sweep.facts import (
    AXES,
    MONOSTATIC_DIMENSIONS,
    PAIR_DIMENSIONS,
    RASTER_DIMENSIONS,
    TIME_CONVENTION,
    without_rounding,
)
from mirrorfold.sweep.samples import complex_samples, real_numbers

Coordinates = dict[str, tuple[tuple[str, ...], ArrayLike, str]]
"""Coordinates of a sweep: by name, the dimensions, the values and the unit of each."""


def make_sweep(
    s: ArrayLike,
    *,
    frequency: ArrayLike,
    tx_position: ArrayLike,
    rx_position: ArrayLike,
    time: ArrayLike | None = None,
    polarization: str | Sequence[str] | None = None,
    **attrs: Any,
) -> xr.Dataset:
    """Make the Sweep of pairs of antennas, of a MIMO array or a synthetic aperture.

    Parameters
    ----------
    s : (frequencies, tx, rx), (frames, ...) or (polarizations, ...) complex array
        Scattering parameter of every pair, time convention ``exp(+jwt)``. A recording has a first dimension for its
        frames, a radar with two polarizations one for these.
    frequency : (frequencies,) array [Hz]
        In uniform steps.
    tx_position, rx_position : (tx, 3) and (rx, 3) arrays [m]
    time : (frames,) array [s], optional
        When each frame was measured.
    polarization : str or sequence of str, optional
        "TE", E along the vertical axis, or "TM", E in the floor plan. Where `s` has several polarizations: their names,
        in the order of `s`.
    **attrs
        What else is known: `title`, `instrument`, `processing`, `wave_speed` [m/s] ...

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the result is not a valid sweep.

    Warns
    -----
    UserWarning
        If frequencies or positions seem to be in another unit than hertz and metres.
    """
    coords: Coordinates = {
        "frequency": (("frequency",), frequency, "Hz"),
        "tx_position": (("tx", "axis"), tx_position, "m"),
        "rx_position": (("rx", "axis"), rx_position, "m"),
    }
    if polarization is not None and not isinstance(polarization, Sequence):
        raise wrong_kind("polarization", polarization, "TE, TM, or both in the order of s")
    names = None if polarization is None or isinstance(polarization, str) else [str(name) for name in polarization]
    if isinstance(polarization, str):
        attrs = {**attrs, "polarization": polarization}
    return _made(PAIR_DIMENSIONS, s, coords, time, attrs, names)


def make_monostatic_sweep(
    s: ArrayLike,
    *,
    frequency: ArrayLike,
    antenna_position: ArrayLike,
    time: ArrayLike | None = None,
    **attrs: Any,
) -> xr.Dataset:
    """Make the Sweep of one moving antenna that transmits and receives, or of antennas that receive only themselves.

    Parameters
    ----------
    s : (frequencies, positions) or (frames, frequencies, positions) complex array
        S11 at every position, time convention ``exp(+jwt)``.
    frequency : (frequencies,) array [Hz]
        In uniform steps.
    antenna_position : (positions, 3) array [m]
    time : (frames,) array [s], optional
        When each frame was measured.
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
    coords: Coordinates = {
        "frequency": (("frequency",), frequency, "Hz"),
        "antenna_position": (("position", "axis"), antenna_position, "m"),
    }
    return _made(MONOSTATIC_DIMENSIONS, s, coords, time, attrs)


def make_raster_sweep(
    s: ArrayLike,
    *,
    frequency: ArrayLike,
    azimuth: ArrayLike,
    elevation: ArrayLike,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    time: ArrayLike | None = None,
    **attrs: Any,
) -> xr.Dataset:
    """Make the Sweep of a raster scan.

    Parameters
    ----------
    s : (frequencies, azimuths, elevations) or (frames, frequencies, azimuths, elevations) complex array
        S11 of every beam, time convention ``exp(+jwt)``.
    frequency : (frequencies,) array [Hz]
        In uniform steps.
    azimuth, elevation : (azimuths,) and (elevations,) arrays [degree]
        A beam points to ``(sin az cos el, cos az cos el, sin el)``.
    origin : (3,) array [m]
        Where the beams start.
    time : (frames,) array [s], optional
        When each frame was measured.
    **attrs
        What else is known: `title`, `spot_radius` and `focus_distance` [m] of the beam, as numbers or as "17 mm" ...

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the result is not a valid sweep.
    """
    coords: Coordinates = {
        "frequency": (("frequency",), frequency, "Hz"),
        "azimuth": (("azimuth",), azimuth, "degree"),
        "elevation": (("elevation",), elevation, "degree"),
    }
    return _made(RASTER_DIMENSIONS, s, coords, time, {"origin": real_numbers("sweep: origin", origin, "m"), **attrs})


WRITTEN = {"spot_radius": "m", "focus_distance": "m", "wave_speed": "m/s"}
"""Attributes that may be written with a unit, and their own unit."""


def _made(
    dims: tuple[str, ...],
    s: ArrayLike,
    coords: Coordinates,
    time: ArrayLike | None,
    attrs: dict[str, Any],
    polarization: Sequence[str] | None = None,
) -> xr.Dataset:
    """A checked sweep of samples and coordinates with units.

    Where the samples have one dimension more than `dims`, it comes first: `polarization` where polarizations are named,
    otherwise `frame`.
    """
    written = {name: unit for name, unit in WRITTEN.items() if isinstance(attrs.get(name), str)}
    attrs = attrs | {name: number(f"sweep: {name}", attrs[name], unit) for name, unit in written.items()}
    if time is not None:
        coords["time"] = (("frame",), time, "s")
    values = complex_samples("sweep: s", s, dims)
    variables = {
        name: (axes, real_numbers(f"sweep: {name}", given, unit), {"units": unit})
        for name, (axes, given, unit) in coords.items()
    }
    if getattr(coords["frequency"][1], "dtype", None) == np.float32:
        axes, frequency, unit = variables["frequency"]
        variables["frequency"] = axes, without_rounding(frequency.astype(np.float32)).astype(float), unit
    expected = ", ".join(f"{name}({', '.join(axes).replace('axis', '3')})" for name, (axes, _, _) in coords.items())
    found = ", ".join(f"{name} {variable[1].shape}" for name, variable in variables.items())
    more = "of frames before these for a recording" if polarization is None else "of polarizations before these"
    refusal = InputError(
        f"sweep: the shapes do not fit together, s {values.shape}, {found}; expected s({', '.join(dims)}), with a "
        f"dimension {more}, and {expected}"
    )
    if values.ndim - len(dims) not in ((0, 1) if time is None and polarization is None else (1,)):
        raise refusal
    with np.errstate(over="ignore"):
        single = values.astype(np.complex64)
    if not np.isfinite(single).all() and np.isfinite(values).all():
        raise InputError(
            f"sweep: s reaches {np.abs(values).max():.3g}, more than single precision holds; divide all by one number"
        )
    try:
        leading = "frame" if polarization is None else "polarization"
        if polarization is not None:
            variables["polarization"] = (("polarization",), np.array(list(polarization)), {})
        sweep = xr.Dataset(
            {"s": ((leading, *dims)[-values.ndim :], single)},
            coords=variables | ({} if dims == RASTER_DIMENSIONS else {"axis": list(AXES)}),
            attrs={"mirrorfold_kind": "sweep", "time_convention": TIME_CONVENTION, **attrs},
        )
    except ValueError:
        raise refusal from None
    checked = check_sweep(sweep)
    for doubt in unit_doubts(checked):
        warnings.warn(f"{doubt.what} Remedy: {doubt.advice}", stacklevel=3)
    return checked


def add_noise(sweep: xr.Dataset, *, snr_db: float, seed: int) -> xr.Dataset:
    """Add white complex Gaussian noise to the samples of all pairs that were measured.

    Parameters
    ----------
    sweep : xarray.Dataset
    snr_db : float [dB]
        Mean power of the measured samples over the power of the noise, per sample, before any focusing.
    seed : int

    Returns
    -------
    xarray.Dataset
        With the attrs `snr_db` and `noise_seed`.

    Raises
    ------
    InputError
        If the sweep is not valid, `snr_db` is no number or so low that the noise overflows, or `seed` no whole number.
    """
    sweep = check_sweep(sweep)
    snr_db, seed = number("snr_db", snr_db, "dB"), whole_number("seed", seed)
    s = sweep["s"].values
    # Part by part, because the magnitudes in double precision would take as much memory as the samples.
    power = sum(float(np.sum(np.abs(part).astype(float) ** 2)) for part in s) / s.size * power_ratio_of(-snr_db)
    measured = sweep["measured"].values if "measured" in sweep else np.ones(1, dtype=bool)
    power /= max(float(measured.mean()), 1.0 / s.size)
    noise = complex_noise(np.random.default_rng(seed), *s.shape)
    if not power < 1e-4 * float(np.finfo(np.float32).max) ** 2:
        raise InputError(
            f"snr_db is {snr_db:g}: such noise is larger than single precision holds; give a larger number"
        )
    noise *= np.sqrt(power / 2.0).astype(np.float32)
    noise *= measured
    noise += s
    noisy = noise.astype(np.complex64, copy=False)
    return sweep.assign(s=sweep["s"].copy(data=noisy)).assign_attrs(snr_db=snr_db, noise_seed=seed)
