"""From variables and their mapping to a sweep in the project's own convention."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError
from mirrorfold.io.mapping import Mapping, Samples, Values
from mirrorfold.io.quantities import Quantities
from mirrorfold.io.readers import Contents
from mirrorfold.io.readers.contents import check_memory
from mirrorfold.io.spectral import STEP_TOLERANCE, from_range, from_time
from mirrorfold.sweep import AXES, TIME_CONVENTION, check_sweep

Array = NDArray[np.floating]

LOWEST_RADIO_FREQUENCY = 1e5
"""No radar sweeps below this [Hz]: the unit is another one."""

LEADING = ("polarization", "frame")

ARRANGEMENTS = (("tx", "rx"), ("pair",), ("position",), ("azimuth", "elevation"), ("beam",))
"""What the axes beside frequency may be."""


def assemble(contents: Contents, mapping: Mapping) -> xr.Dataset:
    """The sweep that a mapping makes of the content of a file.

    Raises
    ------
    InputError
        If a variable is missing, or counts, shapes or units do not fit together.
    """
    quantities = Quantities(contents)
    s, dims = _samples(quantities, mapping.s)
    speed = _wave_speed(quantities, mapping)
    try:
        frequency, s, dims = _to_frequency(quantities, mapping, s, dims, speed)
    except InputError as error:
        raise error if str(contents.path) in str(error) else quantities.fail(str(error)) from None
    frequency, s = _rising(quantities, frequency, s, dims)
    if mapping.time_convention == "exp(-jwt)":
        s = s.conj()
    if np.size(speed) == 1 and speed == speed_of_light and frequency[-1] < LOWEST_RADIO_FREQUENCY:
        raise quantities.fail(
            f"the frequencies run from {frequency[0]:g} to {frequency[-1]:g} Hz, where no radar works; "
            'say their unit, for example unit = "GHz", or the wave_speed of sound'
        )
    attrs = _attrs(mapping, contents, speed)
    if mapping.antenna is not None and set(dims) <= {"frequency", *LEADING}:  # a single place needs no axis in the file
        s, dims = s[..., None], [*dims, "position"]
    arrangement = tuple(name for name in dims if name != "frequency" and name not in LEADING)
    if sorted(arrangement) not in [sorted(known) for known in ARRANGEMENTS]:
        raise quantities.fail(
            f"the samples have the axes {', '.join(dims)}; beside frequency, frame and polarization expected tx and "
            "rx, or pair, or position, or azimuth and elevation, or beam; select one index of every other axis"
        )
    order = [*(name for name in LEADING if name in dims), "frequency"]
    order += next(known for known in ARRANGEMENTS if sorted(known) == sorted(arrangement))
    s = np.transpose(s, [dims.index(name) for name in order])
    build = {"pair": _pairs, "tx": _matrix, "position": _moving, "azimuth": _raster, "beam": _beams}[
        order[order.index("frequency") + 1]
    ]
    sweep = build(quantities, mapping, frequency, s, order, speed, attrs)
    return check_sweep(sweep, source=str(contents.path))


def join(sweeps: Sequence[xr.Dataset], along: str, names: Sequence[str]) -> xr.Dataset:
    """Several sweeps of the same frequencies in one, along ``position`` or ``frame``.

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
        fixed = ("tx_position", "rx_position", "antenna_position", "azimuth", "elevation")
        for place in fixed if along == "frame" else ():
            if place in first.variables and not np.array_equal(first[place], sweep[place]):
                raise InputError(f"{name}: has another {place} than {names[0]}; import it by itself")
    if along == "frame":
        sweeps = [sweep if "frame" in sweep["s"].dims else sweep.expand_dims(frame=1) for sweep in sweeps]
        sweeps = [sweep.reset_coords(drop=False) for sweep in sweeps]
    joined = xr.concat(
        list(sweeps), dim=along, data_vars="minimal", coords="minimal", compat="override", join="override",
        combine_attrs="override",
    )  # fmt: skip
    names_of = [name for name in ("antenna_position", "tx_position", "rx_position", "measured") if name in joined]
    return check_sweep(joined.set_coords(names_of))


def _samples(quantities: Quantities, samples: Samples) -> tuple[NDArray, list[str]]:
    """Complex or real samples with the names of their axes, selected."""
    contents = quantities.contents
    if samples.variable is not None:
        parts = [contents.array(samples.variable)]
        name = samples.variable
    else:
        names = [getattr(samples, key) for key in ("real", "imaginary", "magnitude", "phase")]
        names = [key for key in names if key is not None]
        parts = [np.asarray(contents.array(key)) for key in names]
        name = " and ".join(names)
        if parts[0].shape != parts[1].shape:
            raise quantities.fail(f"{name} have the shapes {parts[0].shape} and {parts[1].shape}, expected equal ones")
    if any(part.dtype.kind not in "fciu" for part in parts):
        raise quantities.fail(f"{name} has type {parts[0].dtype}, expected numbers")
    dims = list(samples.dims)
    parts = [_shaped(quantities, part, samples, name) for part in parts]
    parts = [_squeezed(quantities, part, dims, name) for part in parts]
    check_memory(contents.path, 3.0 * 16 * parts[0].size, name)
    s = parts[0]
    if samples.real is not None:
        s = parts[0] + 1j * parts[1]
    elif samples.magnitude is not None:
        size = 10.0 ** (parts[0] / 20.0) if samples.magnitude_unit == "dB" else parts[0]
        s = size * np.exp(1j * (np.radians(parts[1]) if samples.phase_unit == "degree" else parts[1]))
    if "re_im" in dims:
        at = dims.index("re_im")
        if s.shape[at] != 2:
            raise quantities.fail(f"{name} has length {s.shape[at]} along 're_im', expected 2")
        s = np.take(s, 0, axis=at) + 1j * np.take(s, 1, axis=at)
        dims.remove("re_im")
    for axis, chosen in samples.select.items():
        if axis not in dims:
            raise quantities.fail(f"select names the axis {axis!r}, and the axes are {', '.join(dims)}")
        at = dims.index(axis)
        wanted = np.atleast_1d(chosen)
        if wanted.size == 0 or wanted.min() < -s.shape[at] or wanted.max() >= s.shape[at]:
            raise quantities.fail(f"select asks for {chosen} of the axis {axis!r}, which has length {s.shape[at]}")
        s = np.take(s, chosen, axis=at)
        if isinstance(chosen, int):
            dims.remove(axis)
    if s.size == 0:
        raise quantities.fail(f"{name} is empty, its shape is {parts[0].shape}; measure it again")
    return s, dims


def _shaped(quantities: Quantities, values: NDArray, samples: Samples, name: str) -> NDArray:
    """The array without the columns to skip, in the shape that is asked for."""
    if samples.skip:
        if values.ndim != 2 or values.shape[1] <= samples.skip:
            raise quantities.fail(f"{name} has the shape {values.shape}, of which {samples.skip} columns are skipped")
        values = values[:, samples.skip :]
    if samples.shape is None:
        return values
    try:
        return values.reshape(samples.shape)
    except ValueError:
        raise quantities.fail(f"{name} has the shape {values.shape}, which makes no {samples.shape}") from None


def _squeezed(quantities: Quantities, values: NDArray, dims: list[str], name: str) -> NDArray:
    """The array with as many axes as it has names, where only axes of length one are in the way."""
    shape = [length for length in values.shape if length != 1]
    if values.ndim == len(dims):
        return values
    if len(shape) <= len(dims) < values.ndim:
        spare = values.ndim - len(dims)
        at = [n for n, length in enumerate(values.shape) if length == 1][-spare:]
        return np.squeeze(values, axis=tuple(at))
    raise quantities.fail(f"{name} has the shape {values.shape}, expected the {len(dims)} axes {', '.join(dims)}")


def _wave_speed(quantities: Quantities, mapping: Mapping) -> float:
    if mapping.relative_permittivity is not None:
        return speed_of_light / float(np.sqrt(mapping.relative_permittivity))
    if mapping.wave_speed is None:
        return speed_of_light
    speed = quantities.row(mapping.wave_speed, "wave_speed", "speed")
    if speed.size != 1 or not speed[0] > 0.0:
        raise quantities.fail(f"wave_speed is {speed[:5].tolist()}, expected one positive number of metres per second")
    return float(speed[0])


def _to_frequency(
    quantities: Quantities, mapping: Mapping, s: NDArray, dims: list[str], speed: float
) -> tuple[Array, NDArray, list[str]]:
    """Frequencies, and the samples with `frequency` among their axes."""
    axis = next(name for name in ("frequency", "time", "range") if name in dims)
    at = dims.index(axis)
    if axis == "range":
        assert mapping.range is not None
        given: dict[str, Any] = mapping.range.model_dump(exclude={"carrier"}, exclude_none=True)
        if "start" in given:
            given["points"] = s.shape[at]
        values = quantities.row(Values(**given), "range", "length")
    else:
        row = mapping.time if axis == "time" else mapping.frequency
        assert row is not None
        values = quantities.row(row, axis, axis)
    if values.size != s.shape[at]:
        raise quantities.fail(
            f"the samples have length {s.shape[at]} along {axis!r} (shape {s.shape}, axes {', '.join(dims)}) and there "
            f"are {values.size} values of {axis}; correct the order of dims, or the {axis}"
        )
    dims = ["frequency" if name == axis else name for name in dims]
    if axis == "frequency":
        if mapping.band is not None:
            keep = (values >= mapping.band[0]) & (values <= mapping.band[1])
            if not keep.any():
                raise quantities.fail(f"the band {list(mapping.band)} Hz holds none of the frequencies")
            values, s = values[keep], np.compress(keep, s, axis=at)
        return values, s.astype(np.complex128, copy=False) if not np.iscomplexobj(s) else s, dims
    last = np.moveaxis(s, at, -1)
    if axis == "time":
        frequency, spectra = from_time(last, values, mapping.band)
    else:
        assert mapping.range is not None
        frequency, spectra = from_range(last, values, mapping.range.carrier, speed, mapping.band)
    return frequency, np.moveaxis(spectra, -1, at), dims


def _rising(quantities: Quantities, frequency: Array, s: NDArray, dims: list[str]) -> tuple[Array, NDArray]:
    """Rising frequencies in exactly equal steps, where they are so but for the rounding of the file."""
    at = dims.index("frequency")
    if frequency.size > 1 and np.all(np.diff(frequency) < 0):
        frequency, s = frequency[::-1], np.flip(s, at)
    if frequency.size > 1:
        step = np.diff(frequency)
        if step.mean() <= 0 or np.abs(step - step.mean()).max() > STEP_TOLERANCE * step.mean():
            worst = int(np.abs(step - step.mean()).argmax())
            raise quantities.fail(
                f"the frequencies are not in equal rising steps: after number {worst}, {frequency[worst]:.10g} Hz, the "
                f"step is {step[worst]:g} Hz, on average {step.mean():g} Hz; sort or resample them"
            )
        frequency = np.linspace(frequency[0], frequency[-1], frequency.size)
    if not frequency[0] > 0:
        raise quantities.fail(f"the frequencies begin at {frequency[0]:g} Hz, expected positive ones; set a band")
    return frequency, s


def _attrs(mapping: Mapping, contents: Contents, speed: float) -> dict[str, Any]:
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


def _dataset(
    frequency: Array, s: NDArray, order: list[str], coords: dict[str, Any], attrs: dict[str, Any]
) -> xr.Dataset:
    coords = {"frequency": ("frequency", frequency, {"units": "Hz"}), **coords}
    if any(name.endswith("_position") for name in coords):
        coords["axis"] = list(AXES)
    return xr.Dataset({"s": (tuple(order), s.astype(np.complex64))}, coords=coords, attrs=attrs)


def _counted(quantities: Quantities, found: int, expected: int, name: str, axis: str) -> None:
    if found != expected:
        raise quantities.fail(f"there are {found} places of {name} and {expected} samples along {axis!r}; correct one")


def _matrix(
    quantities: Quantities, mapping: Mapping, frequency: Array, s: NDArray, order: list[str], speed: float,
    attrs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    tx, rx = _arrays(quantities, mapping)
    for places, axis, length in ((tx, "tx", s.shape[-2]), (rx, "rx", s.shape[-1])):
        _counted(quantities, len(places), length, axis, axis)
    return _dataset(frequency, s, order, _pair_coords(tx, rx), attrs)


def _arrays(quantities: Quantities, mapping: Mapping) -> tuple[Array, Array]:
    tx, rx = mapping.tx or mapping.elements, mapping.rx or mapping.elements
    assert tx is not None
    assert rx is not None
    return quantities.places(tx, "tx"), quantities.places(rx, "rx")


def _pair_coords(tx: Array, rx: Array) -> dict[str, Any]:
    return {
        "tx_position": (("tx", "axis"), tx, {"units": "m"}),
        "rx_position": (("rx", "axis"), rx, {"units": "m"}),
    }


def _pairs(
    quantities: Quantities, mapping: Mapping, frequency: Array, s: NDArray, order: list[str], speed: float,
    attrs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    """A full matrix from a list of channels; pairs that were not measured are zero, and marked."""
    assert mapping.pairs is not None
    tx, rx = _arrays(quantities, mapping)
    index = []
    for row, places, name in ((mapping.pairs.tx, tx, "tx"), (mapping.pairs.rx, rx, "rx")):
        numbers = quantities.row(row, f"pairs.{name}", "number")
        _counted(quantities, numbers.size, s.shape[-1], f"pairs.{name}", "pair")
        whole = np.rint(numbers).astype(int) - mapping.pairs.base
        bad = np.flatnonzero((whole < 0) | (whole >= len(places)) | (np.rint(numbers) != numbers))
        if bad.size:
            first, last = mapping.pairs.base, mapping.pairs.base + len(places) - 1
            raise quantities.fail(
                f"pairs.{name} holds {numbers[bad[0]]:g} as number {bad[0]}, expected whole numbers from {first} to "
                f"{last}; correct it, or the base"
            )
        index.append(whole)
    full, measured = fill_matrix(
        quantities, s, index[0], index[1], (len(tx), len(rx)), reciprocal=mapping.reciprocal and len(tx) == len(rx)
    )
    coords = _pair_coords(tx, rx)
    if not measured.all():
        coords["measured"] = (("tx", "rx"), measured)
    return _dataset(frequency, full, [*order[:-1], "tx", "rx"], coords, attrs)


def fill_matrix(
    quantities: Quantities,
    s: NDArray,
    tx: NDArray[np.integer],
    rx: NDArray[np.integer],
    shape: tuple[int, int],
    *,
    reciprocal: bool,
) -> tuple[NDArray, NDArray[np.bool_]]:
    """Samples (..., pairs) as (..., tx, rx), zero where nothing was measured, and what was measured."""
    numbers, counts = np.unique(tx * shape[1] + rx, return_counts=True)
    if (counts > 1).any():
        twice = divmod(int(numbers[counts > 1][0]), shape[1])
        raise quantities.fail(f"the pair of tx {twice[0]} and rx {twice[1]} (from zero) stands there twice; keep one")
    check_memory(quantities.contents.path, 16.0 * s.size / s.shape[-1] * shape[0] * shape[1], "its full matrix")
    full = np.zeros((*s.shape[:-1], *shape), dtype=np.complex64)
    measured = np.zeros(shape, dtype=bool)
    if reciprocal:
        full[..., rx, tx] = s
        measured[rx, tx] = True
    full[..., tx, rx] = s
    measured[tx, rx] = True
    return full, measured


def _moving(
    quantities: Quantities, mapping: Mapping, frequency: Array, s: NDArray, order: list[str], speed: float,
    attrs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    """One moving antenna; pulses that were referred to a range get their true delay back."""
    assert mapping.antenna is not None
    antenna = quantities.places(mapping.antenna, "antenna")
    _counted(quantities, len(antenna), s.shape[-1], "antenna", "position")
    if mapping.compensation is not None:
        reference = quantities.row(mapping.compensation.range, "compensation.range", "length")
        _counted(quantities, reference.size, s.shape[-1], "compensation.range", "position")
        s = s * np.exp(-4j * np.pi / speed * frequency[:, None] * reference)
        attrs["processing"].append("motion compensation to a reference range undone")
    coords = {"antenna_position": (("position", "axis"), antenna, {"units": "m"})}
    return _dataset(frequency, s, order, coords, attrs)


def _raster(
    quantities: Quantities, mapping: Mapping, frequency: Array, s: NDArray, order: list[str], speed: float,
    attrs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    coords = {}
    for at, name in ((-2, "azimuth"), (-1, "elevation")):
        row = getattr(mapping, name)
        angle = quantities.row(row, name, "angle")
        _counted(quantities, angle.size, s.shape[at], name, name)
        if angle.size > 1 and np.all(np.diff(angle) < 0):
            angle, s = angle[::-1], np.flip(s, at)
        coords[name] = (name, angle, {"units": "degree"})
    return _dataset(frequency, s, order, coords, attrs | {"origin": np.array(mapping.origin)})


def _beams(
    quantities: Quantities, mapping: Mapping, frequency: Array, s: NDArray, order: list[str], speed: float,
    attrs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    assert mapping.azimuth is not None
    assert mapping.elevation is not None
    angles = [quantities.row(row, name, "angle") for name, row in
              (("azimuth", mapping.azimuth), ("elevation", mapping.elevation))]  # fmt: skip
    for angle, name in zip(angles, ("azimuth", "elevation"), strict=True):
        _counted(quantities, angle.size, s.shape[-1], name, "beam")
    azimuth, elevation, full = grid_beams(quantities, s, angles[0], angles[1])
    coords = {"azimuth": ("azimuth", azimuth, {"units": "degree"})}
    coords["elevation"] = ("elevation", elevation, {"units": "degree"})
    order = [*order[:-1], "azimuth", "elevation"]
    return _dataset(frequency, full, order, coords, attrs | {"origin": np.array(mapping.origin)})


def grid_beams(quantities: Quantities, s: NDArray, azimuth: Array, elevation: Array) -> tuple[Array, Array, NDArray]:
    """Samples (..., beams) as (..., azimuth, elevation), with the angles [degree] of the grid.

    Raises
    ------
    InputError
        If the beams are not the points of a grid, each once.
    """
    columns, ix = np.unique(azimuth.round(ANGLE_DIGITS), return_inverse=True)
    rows, iy = np.unique(elevation.round(ANGLE_DIGITS), return_inverse=True)
    number = ix * rows.size + iy
    if np.unique(number).size != number.size:
        twice = int(np.flatnonzero(np.bincount(number) > 1)[0])
        raise quantities.fail(
            f"the beam at azimuth {columns[twice // rows.size]:g} and elevation {rows[twice % rows.size]:g} degrees "
            "stands there twice; keep one"
        )
    if number.size != columns.size * rows.size:
        raise quantities.fail(
            f"there are {number.size} beams with {columns.size} azimuths and {rows.size} elevations, expected all "
            f"{columns.size * rows.size}; measure the missing ones, or leave out incomplete rows"
        )
    full = np.empty((*s.shape[:-1], columns.size, rows.size), dtype=np.complex64)
    full[..., ix, iy] = s
    return columns, rows, full


ANGLE_DIGITS = 6
"""Angles that agree to so many digits after the point [degree] are one."""
