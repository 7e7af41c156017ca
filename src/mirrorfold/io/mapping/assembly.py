"""Makes a sweep, in the project's own convention, of the variables of a file and their mapping."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError
from mirrorfold.io.mapping.arrangements import ARRANGEMENTS, LEADING, ArrangedSamples
from mirrorfold.io.mapping.model import Mapping
from mirrorfold.io.mapping.quantities import Quantities
from mirrorfold.io.mapping.samples import rising, samples_of, to_frequency
from mirrorfold.io.readers import Contents
from mirrorfold.sweep import TIME_CONVENTION, check_sweep, frequency_unit_of, unit_doubts, wave_speed


def assemble(contents: Contents, mapping: Mapping) -> xr.Dataset:
    """Make the sweep that a mapping describes from the contents of a file.

    Raises
    ------
    InputError
        If a variable is missing, or counts, shapes or units do not fit together.
    """
    quantities = Quantities(contents)
    s, dims = samples_of(quantities, mapping.s)
    speed = _wave_speed(quantities, mapping)
    try:
        frequency, s, dims = to_frequency(quantities, mapping, s, dims, speed)
    except InputError as error:
        raise error if str(contents.path) in str(error) else quantities.fail(str(error)) from None
    frequency, s = rising(quantities, frequency, s, dims)
    if mapping.time_convention == "exp(-jwt)":
        s = s.conj()
    attrs = _attrs(mapping, contents, speed)
    if mapping.antenna is not None and set(dims) <= {"frequency", *LEADING}:  # a single place needs no axis in the file
        s, dims = s[..., None], [*dims, "position"]
    beside = sorted(name for name in dims if name != "frequency" and name not in LEADING)
    arrangement = next((axes for axes in ARRANGEMENTS if sorted(axes) == beside), None)
    if arrangement is None:
        raise quantities.fail(
            f"the samples have the axes {', '.join(dims)}; beside frequency, frame and polarization expected tx and "
            "rx, or pair, or position, or azimuth and elevation, or beam; select one index of every other axis"
        )
    order = [*(name for name in LEADING if name in dims), "frequency", *arrangement]
    s = np.transpose(s, [dims.index(name) for name in order])
    sweep = ARRANGEMENTS[arrangement](ArrangedSamples(quantities, mapping, frequency, s, order, speed, attrs))
    _check_unit(quantities, mapping, sweep)
    checked = check_sweep(sweep, source=str(contents.path))
    for doubt in unit_doubts(checked):
        warnings.warn(f"{doubt.what} Remedy: {doubt.advice}", stacklevel=4)
    return checked


def _check_unit(quantities: Quantities, mapping: Mapping, sweep: xr.Dataset) -> None:
    """Refuse frequencies, or the times from which they were made, that are probably in another unit than is stated."""
    meant = frequency_unit_of(sweep)
    if meant is None:
        return
    frequency = sweep["frequency"].values
    what = f"the frequencies run from {frequency[0]:g} to {frequency[-1]:g} Hz, where no such array works"
    if mapping.time is not None:
        meant = {"GHz": "ns", "MHz": "us", "THz": "ps", "kHz": "ms"}[meant]
        raise quantities.fail(f'{what}; the times are probably in {meant}: say [time] unit = "{meant}"')
    said = f'say their unit, probably [frequency] unit = "{meant}"'
    if quantities.contents.reader == "table" and mapping.frequency and mapping.frequency.variable == "frequency":
        said = f"say their unit in the heading of their column, probably freq_{meant}"
    raise quantities.fail(f"{what}; {said}, or the wave_speed of sound")


def join(sweeps: Sequence[xr.Dataset], along: str, names: Sequence[str]) -> xr.Dataset:
    """Join several sweeps with the same frequencies to one, along ``position`` or ``frame``.

    Raises
    ------
    InputError
        If they do not fit together; `names` are those of the files.
    """
    first = sweeps[0]
    for sweep, name in zip(sweeps[1:], names[1:], strict=True):
        if sweep["frequency"].shape != first["frequency"].shape or not np.allclose(
            sweep["frequency"].values, first["frequency"].values, rtol=1e-9
        ):
            raise InputError(f"{name}: has other frequencies than {names[0]}; import it by itself")
        if sweep["s"].dims[-2:] != first["s"].dims[-2:] or (along == "position") != ("position" in sweep["s"].dims):
            raise InputError(f"{name}: has the dimensions {sweep['s'].dims}, which cannot be joined along {along!r}")
        if wave_speed(sweep) != wave_speed(first):
            raise InputError(f"{name}: has another wave_speed than {names[0]}; import it by itself")
        fixed = ("tx_position", "rx_position", "antenna_position", "azimuth", "elevation")
        for place in fixed if along == "frame" else ():
            if place in first.variables and not np.array_equal(first[place], sweep[place]):
                raise InputError(f"{name}: has another {place} than {names[0]}; import it by itself")
        measured = [np.asarray(one["measured"]) if "measured" in one.coords else np.True_ for one in (first, sweep)]
        if not np.array_equal(measured[0], measured[1]):
            raise InputError(f"{name}: lacks other pairs than {names[0]}; import it by itself")
    if along == "frame":
        sweeps = [sweep if "frame" in sweep["s"].dims else sweep.expand_dims(frame=1) for sweep in sweeps]
        sweeps = [sweep.reset_coords(drop=False) for sweep in sweeps]
    joined = xr.concat(
        list(sweeps), dim=along, data_vars="minimal", coords="minimal", compat="override", join="override",
        combine_attrs="override",
    )  # fmt: skip
    names_of = [name for name in ("antenna_position", "tx_position", "rx_position", "measured") if name in joined]
    return check_sweep(joined.set_coords(names_of))


def _wave_speed(quantities: Quantities, mapping: Mapping) -> float:
    """Speed of the waves [m/s], that of light in vacuum by default."""
    if mapping.relative_permittivity is not None:
        return speed_of_light / float(np.sqrt(mapping.relative_permittivity))
    if mapping.wave_speed is None:
        return speed_of_light
    speed = quantities.row(mapping.wave_speed, "wave_speed", "speed")
    if speed.size != 1 or not speed[0] > 0.0:
        raise quantities.fail(f"wave_speed is {speed[:5].tolist()}, expected one positive number of metres per second")
    return float(speed[0])


def _attrs(mapping: Mapping, contents: Contents, speed: float) -> dict[str, Any]:
    """Attributes of the sweep, from the mapping and the file."""
    attrs: dict[str, Any] = {"mirrorfold_kind": "sweep", "time_convention": TIME_CONVENTION}
    for name in ("title", "instrument", "description"):
        value = getattr(mapping, name)
        if value is not None:
            attrs[name] = value
    if speed != speed_of_light:
        attrs["wave_speed"] = speed
    if mapping.scene_center is not None:
        attrs["scene_center"] = np.array(mapping.scene_center)
    attrs["source"] = contents.path.name
    attrs["processing"] = [f"imported by the reader {contents.reader!r}"]
    return attrs
