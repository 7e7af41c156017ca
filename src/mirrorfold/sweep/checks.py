"""Whether a dataset is a valid sweep, and whether its numbers make sense together."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.arguments import finite, in_message, wrong_kind
from mirrorfold.common.plausible import (
    any_nonzero,
    constant_part,
    extent,
    frequency_unit,
    implausible_array,
    length_unit,
    may_be_sound,
    not_finite,
    pitch,
    radians_for_degrees,
    unplaced,
)
from mirrorfold.common.slabs import POLARIZATIONS
from mirrorfold.common.statistics import without_play
from mirrorfold.common.units import FARTHEST, SLOWEST, other_unit
from mirrorfold.errors import InputError
from mirrorfold.sweep.facts import (
    AXES,
    CONJUGATED,
    MONOSTATIC_DIMENSIONS,
    PAIR_DIMENSIONS,
    RASTER_DIMENSIONS,
    STEP_TOLERANCE,
    TIME_CONVENTION,
    antenna_positions,
    frequency_step,
    is_monostatic,
    is_raster,
    uneven_steps,
    wave_speed,
    without_rounding,
)
from mirrorfold.sweep.polarization import polarizations, with_own_polarization


def check_sweep(sweep: xr.Dataset, source: str = "sweep") -> xr.Dataset:
    """Check a sweep, and return it in the time convention ``exp(+jwt)``.

    Data in the other time convention, ``exp(-jwt)``, is conjugated, and frequencies that rounding has moved get exactly
    equal steps.

    Raises
    ------
    InputError
        If the sweep is not valid. The message tells the first thing that is missing or wrong, and names the sweep as
        `source` says.
    """

    def refuse(message: str) -> InputError:
        return InputError(f"{source}: {message}")

    if not isinstance(sweep, xr.Dataset):
        raise wrong_kind(source, sweep, "a sweep (xarray.Dataset), as mf.load, mf.simulate and mf.make_sweep return")
    if "s" not in sweep:
        raise refuse("holds no variable 's'; expected a sweep with s(frequency, tx, rx)")
    sweep = with_own_polarization(sweep)
    _check_dimensions(sweep, refuse)
    named, said = polarizations(sweep, source), sweep.attrs.get("polarization")
    if said is not None and (named or not isinstance(said, str) or said not in POLARIZATIONS):
        raise refuse(f"attr polarization is {in_message(said)}, expected TE or TM, and none where s has several")
    s = sweep["s"]
    if s.size == 0:
        raise refuse(f"s is empty, its shape is {s.shape}; measure at least one frequency and one pair")
    if s.dtype.kind != "c":
        raise refuse(
            f"s has type {s.dtype}, expected complex numbers; store real and imaginary part as one, and measure the "
            "phase where there are only magnitudes"
        )
    if is_raster(sweep):
        sweep = _directions(sweep, refuse)
    else:
        _check_positions(sweep, refuse)
    _check_attrs(sweep, refuse)
    sweep = _in_equal_steps(sweep, refuse)
    _check_units(sweep, refuse)
    _check_samples(sweep["s"], refuse)
    convention = sweep.attrs.get("time_convention", TIME_CONVENTION)
    if convention == CONJUGATED:
        return sweep.assign(s=np.conj(sweep["s"])).assign_attrs(time_convention=TIME_CONVENTION)
    if convention != TIME_CONVENTION:
        raise refuse(f"time_convention is {in_message(convention)}, expected 'exp(+jwt)' or 'exp(-jwt)'")
    return sweep


Refuse = Callable[[str], InputError]
"""Makes the error of a message, which names the sweep."""


def _places(sweep: xr.Dataset) -> tuple[str, ...]:
    """Names of the coordinates that hold the antenna positions."""
    return ("antenna_position",) if is_monostatic(sweep) else ("tx_position", "rx_position")


def _check_dimensions(sweep: xr.Dataset, refuse: Refuse) -> None:
    """Refuse samples over other dimensions than those of a sweep, and coordinates that lack or are in another unit."""
    s, raster = sweep["s"], is_raster(sweep)
    for dims in (PAIR_DIMENSIONS, RASTER_DIMENSIONS, MONOSTATIC_DIMENSIONS):
        if set(dims) <= set(s.dims) and s.dims[-len(dims) :] != dims:
            wanted = ", ".join(dims)
            raise refuse(
                f"s has dimensions ({', '.join(map(str, s.dims))}), expected ({wanted}) as the last ones; sort them: "
                f"sweep.transpose(..., {', '.join(map(repr, dims))}, 'axis', missing_dims='ignore')"
            )
    for name in RASTER_DIMENSIONS if raster else ("frequency", *_places(sweep)):
        if name not in sweep.variables:
            where = "the frequencies [Hz]" if name == "frequency" else "the directions [degree]"
            where = "the antenna positions [m]" if name.endswith("position") else where
            raise refuse(f"has no coordinate {name!r}; add {where} before imaging")
        expected = {"frequency": "Hz", "azimuth": "degree", "elevation": "degree"}.get(name, "m")
        other = other_unit(sweep[name].attrs.get("units"), expected)
        if other is not None:
            option = {"Hz": "frequency", "degree": "angle"}.get(expected, "position")
            raise refuse(
                f"{name} is in {other}, as its attribute units says, expected {expected}; convert it, or correct the "
                f"attribute (calibrate --{option}-unit {other} converts it)"
            )
    if not raster and not is_monostatic(sweep) and s.dims[-3:] != PAIR_DIMENSIONS:
        raise refuse(
            f"s has dimensions {s.dims}, expected (frequency, tx, rx), (frequency, position) or "
            "(frequency, azimuth, elevation); transpose or rename them"
        )


def _in_equal_steps(sweep: xr.Dataset, refuse: Refuse) -> xr.Dataset:
    """The sweep with frequencies in exactly equal steps; refused if more than rounding makes their steps differ."""
    if sweep["frequency"].dims != ("frequency",):
        raise refuse(f"frequency has dimensions {dict(sweep['frequency'].sizes)}, expected (frequency) alone")
    frequency = sweep["frequency"].values
    if frequency.dtype.kind not in "fiu" or not np.isfinite(frequency).all() or not (frequency > 0).all():
        raise refuse("frequency holds values that are not positive numbers; give them in hertz")
    even = without_rounding(frequency)
    step = np.diff(even.astype(float))
    if step.size and (step.mean() <= 0 or np.abs(step - step.mean()).max() > STEP_TOLERANCE * step.mean()):
        which, remedy = uneven_steps(even.astype(float)), "sort them or resample to a uniform grid"
        if which:
            remedy = f"{which}: leave one out, or measure what is missing"
        elif (step < 0).all():
            remedy = "they fall: turn frequency and s over, frequency[::-1] and s[::-1] (calibrate --sort-frequencies)"
        raise refuse(
            f"frequency has steps from {step.min():g} to {step.max():g} Hz, expected equal rising steps; {remedy}"
        )
    return sweep if even is frequency else sweep.assign_coords(frequency=sweep["frequency"].copy(data=even))


def _check_units(sweep: xr.Dataset, refuse: Refuse) -> None:
    """Refuse frequencies and positions that make no sense together, as in another unit."""
    highest, unit = float(sweep["frequency"].max()), frequency_unit_of(sweep)
    if unit is not None and not _speed_may_follow(sweep):
        raise refuse(
            f"frequencies up to {highest:g} Hz make no sense with {_size(sweep)}; they are probably in {unit}: "
            f"give them in hertz (calibrate --frequency-unit {unit}), or for other waves than light the attr wave_speed"
        )
    what = implausible_array(highest, _length_and_pitch(sweep)[0], wave_speed(sweep))
    if unit is None and what is not None:
        raise refuse(f"{what}; give frequencies in hertz and positions in metres")


def _check_samples(s: xr.DataArray, refuse: Refuse) -> None:
    """Refuse samples that are not finite, all zero, or real or imaginary parts alone."""
    missing = not_finite(s.values)
    if missing:
        raise refuse(
            f"s holds {missing} samples of {s.size} that are not finite (NaN or infinite); "
            "replace them, for example by zero, or leave out their channels"
        )
    if not any_nonzero(s.values):
        raise refuse("every sample of s is zero; there is nothing to image")
    part = constant_part(np.moveaxis(s.values, s.get_axis_num("frequency"), 0))
    if part is not None:
        raise refuse(
            f"s holds {part} alone, the other part of every sample is zero; add it, or the phase: without it nothing "
            "tells where echoes are"
        )


def frequency_unit_of(sweep: xr.Dataset) -> str | None:
    """The unit in which the frequencies probably are, such as "GHz"; None where hertz make sense."""
    length, step = _length_and_pitch(sweep)
    return frequency_unit(float(sweep["frequency"].max()), length, step, wave_speed(sweep))


def _length_and_pitch(sweep: xr.Dataset) -> tuple[float, float]:
    """Extent of the array and distance between neighbouring antennas [m].

    Of a raster scan, both are the diameter of the beam in its focus, zero if unknown.
    """
    if is_raster(sweep):
        width = 2.0 * float(sweep.attrs.get("spot_radius", 0.0))
        return width, width
    places = antenna_positions(sweep)
    return extent(*places), min((step for step in map(pitch, places) if step), default=0.0)


def _speed_may_follow(sweep: xr.Dataset) -> bool:
    """Whether the sweep states no wave speed and may be one of sound, whose speed `focus` takes as an argument too."""
    length, step = _length_and_pitch(sweep)
    return "wave_speed" not in sweep.attrs and may_be_sound(float(sweep["frequency"].max()), length, step)


def check_waves(sweep: xr.Dataset) -> None:
    """Refuse to image a valid sweep whose frequencies make no sense at its wave speed, by default that of light.

    Raises
    ------
    InputError
        If the frequencies make no sense; the message tells the unit that was probably meant.
    """
    unit = frequency_unit_of(sweep)
    if unit is not None:
        source = sweep.encoding.get("source", "sweep")  # its file, if xarray has read it from one
        raise InputError(
            f"{source}: frequencies up to {float(sweep['frequency'].max()):g} Hz make no sense with {_size(sweep)}; "
            f"give the speed of sound as wave_speed, or the frequencies in hertz: they are probably in {unit} "
            f"(calibrate --frequency-unit {unit})"
        )


def _size(sweep: xr.Dataset) -> str:
    """The size of the array, or of the beam, in metres and wavelengths, for messages."""
    length = _length_and_pitch(sweep)[0]
    if not length:
        return f"waves of {wave_speed(sweep):g} m/s, which no instrument sends so slowly"
    wavelengths = length * float(sweep["frequency"].max()) / wave_speed(sweep)
    what = "a beam" if is_raster(sweep) else "an array"
    return f"{what} of {length:.3g} m, {wavelengths:.1g} wavelengths at {wave_speed(sweep):g} m/s"


class UnitDoubt(NamedTuple):
    """What is probably wrong with the numbers of a valid sweep, and the option of `calibrate` that corrects it."""

    name: str
    what: str
    option: str

    @property
    def advice(self) -> str:
        """What to do about it, as a part of a sentence."""
        return f"give them in the right unit, or mirrorfold calibrate SWEEP.nc -o OUT.nc {self.option}"


def unit_doubts(sweep: xr.Dataset) -> list[UnitDoubt]:
    """Find frequencies, positions or angles of a valid sweep that are probably in another unit than expected."""
    wavelength = wave_speed(sweep) / float(sweep["frequency"].max())
    unit = frequency_unit_of(sweep)
    if unit is not None:
        what = (
            f"The frequencies make no sense with {_size(sweep)}: they are probably in {unit}, or the speed of sound is "
            "missing as wave_speed."
        )
        return [UnitDoubt("frequency-unit", what, f"--frequency-unit {unit}")]
    if is_raster(sweep):
        in_radians = radians_for_degrees(sweep["azimuth"].values, sweep["elevation"].values, wavelength)
        return [] if in_radians is None else [UnitDoubt("angle-unit", in_radians, "--angle-unit radian")]
    step = _length_and_pitch(sweep)[1]
    unit = length_unit(step, wavelength) if sweep.attrs.get("scene_center") is None else None
    if unit is None:
        return []
    what = (
        f"Neighbouring antennas stand {step:.3g} m apart, {step / wavelength:.0f} wavelengths: their positions are "
        f"probably in {unit}, not in metres."
    )
    return [UnitDoubt("position-unit", what, f"--position-unit {unit}")]


def place_doubts(sweep: xr.Dataset) -> list[UnitDoubt]:
    """Find positions or angles of a valid sweep that are probably in another unit, also of one side alone."""
    found = [doubt for doubt in unit_doubts(sweep) if doubt.name != "frequency-unit"]
    if found or "rx" not in sweep.dims or sweep.sizes["frequency"] < 2 or sweep.attrs.get("scene_center") is not None:
        return found
    tx, rx = antenna_positions(sweep)
    longest = wave_speed(sweep) / frequency_step(sweep)
    if extent(tx, rx) <= longest:
        return []
    away = max(float(np.linalg.norm(rx - place, axis=1).max()) for place in tx)
    if away <= longest:
        return []
    what = (
        f"Transmitters and receivers stand up to {away:.3g} m apart, but the frequency steps tell delays of no more "
        f"than {longest:.3g} m: their positions are probably in millimetres, not in metres."
    )
    return [UnitDoubt("position-unit", what, "--position-unit mm")]


def _check_attrs(sweep: xr.Dataset, refuse: Refuse) -> None:
    """Refuse a `wave_speed` below `SLOWEST`, a beam of no size, and a `scene_center` or `origin` that is no place."""
    speed = finite(sweep.attrs.get("wave_speed", speed_of_light))
    if speed is None or speed < SLOWEST:
        raise refuse(
            f"attr wave_speed is {in_message(sweep.attrs['wave_speed'])}, expected a number of at least {SLOWEST:g} "
            "metres per second"
        )
    for name, lowest in (("spot_radius", np.finfo(float).tiny), ("focus_distance", 0.0)):
        size = finite(sweep.attrs.get(name, 1.0))
        if size is None or not lowest <= size <= FARTHEST:
            raise refuse(f"attr {name} is {in_message(sweep.attrs[name])}, expected a positive number of metres")
    for name in ("scene_center", "origin"):
        centre = sweep.attrs.get(name)
        try:
            place = np.zeros(3) if centre is None else np.asarray(centre, dtype=float)
        except (TypeError, ValueError, OverflowError):
            place = np.empty(0)
        if place.shape != (3,) or unplaced(place) is not None:
            raise refuse(f"attr {name} is {in_message(centre)}, expected three finite numbers in metres")


def _check_positions(sweep: xr.Dataset, refuse: Refuse) -> None:
    """Refuse antenna positions that are not finite, too far away, or whose columns are not in the order x, y, z."""
    for name in _places(sweep):
        dim = name.removesuffix("_position").replace("antenna", "position")
        if sweep[name].dims != (dim, "axis") or sweep[name].shape[1] != 3:
            raise refuse(
                f"{name} has dimensions {dict(sweep[name].sizes)}, expected ({dim}, axis) with the three axes x, y, z"
            )
        wrong = unplaced(sweep[name].values)
        if wrong is not None:
            raise refuse(f"{name} holds a coordinate that {wrong}; give every antenna its place in metres")
    if "axis" in sweep.variables:
        axes = tuple(map(str, sweep["axis"].values.tolist()))
        if set(axes) == set(AXES) and axes != AXES:
            raise refuse(f"axis is ({', '.join(axes)}), expected (x, y, z); sweep.sel(axis=['x', 'y', 'z']) sorts it")


def _directions(sweep: xr.Dataset, refuse: Refuse) -> xr.Dataset:
    """The scan with beam directions in exactly equal steps where only rounding or play make their steps differ.

    Refused are directions that do not rise, azimuths of a full turn, and elevations beyond -90 to 90 degrees.
    """
    for name in ("azimuth", "elevation"):
        angle = sweep[name].values
        if sweep[name].dims != (name,) or angle.dtype.kind not in "fiu" or not np.isfinite(angle).all():
            raise refuse(f"{name} holds values that are not finite numbers; give every beam its direction in degrees")
        if np.any(np.diff(angle) <= 0):
            raise refuse(f"{name} must rise from beam to beam; sort the beams")
    azimuth, elevation = sweep["azimuth"].values, sweep["elevation"].values
    if azimuth[-1] - azimuth[0] >= 360.0:
        raise refuse(f"azimuth goes from {azimuth[0]:g} to {azimuth[-1]:g}, expected less than a full turn in degrees")
    if elevation[0] <= -90.0 or elevation[-1] >= 90.0:
        raise refuse(
            f"elevation goes from {elevation[0]:g} to {elevation[-1]:g}, expected degrees above the horizon, more than "
            "-90 and less than 90"
        )
    even = {name: without_play(sweep[name].values) for name in ("azimuth", "elevation")}
    changed = {name: sweep[name].copy(data=axis) for name, axis in even.items() if (axis != sweep[name].values).any()}
    return sweep.assign_coords(changed) if changed else sweep
