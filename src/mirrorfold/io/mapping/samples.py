"""Makes samples over rising frequencies of the variables of a file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.decibels import ratio_of
from mirrorfold.io.mapping.model import Mapping, Samples, Values
from mirrorfold.io.mapping.quantities import Quantities
from mirrorfold.io.mapping.spectral import STEP_TOLERANCE, from_beat, from_range, from_time
from mirrorfold.io.readers.contents import check_memory

Array = NDArray[np.floating]


def samples_of(quantities: Quantities, samples: Samples) -> tuple[NDArray, list[str]]:
    """Samples, complex or real, and the names of their axes, after `shape`, `skip` and `select` are applied.

    Raises
    ------
    InputError
        If a variable is missing or no array of numbers, or shapes do not fit the axes.
    """
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
        size = ratio_of(parts[0]) if samples.magnitude_unit == "dB" else parts[0]
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
    """The array without the columns to skip, in the shape of the mapping."""
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
    """The array without axes of length one, where it has more axes than names."""
    shape = [length for length in values.shape if length != 1]
    if values.ndim == len(dims):
        return values
    if len(shape) <= len(dims) < values.ndim:
        spare = values.ndim - len(dims)
        at = [n for n, length in enumerate(values.shape) if length == 1][-spare:]
        return np.squeeze(values, axis=tuple(at))
    raise quantities.fail(f"{name} has the shape {values.shape}, expected the {len(dims)} axes {', '.join(dims)}")


def to_frequency(
    quantities: Quantities, mapping: Mapping, s: NDArray, dims: list[str], speed: float
) -> tuple[Array, NDArray, list[str]]:
    """Frequencies [Hz], the samples over them, and the names of their axes; samples over time or range are transformed.

    Raises
    ------
    InputError
        If the samples and the values of their axis differ in number, or the band holds no frequency.
    """
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
        values = quantities.row(row, axis, axis, s.shape[at])
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
        if mapping.s.beat:
            if np.iscomplexobj(s):
                raise quantities.fail("the samples are complex, and beat in [s] is for real ones; leave it out")
            frequency, spectra = from_beat(np.moveaxis(s, at, -1), values)
            # A real signal has no time convention: whichever the mapping names, waves must come out right.
            spectra = spectra.conj() if mapping.time_convention == "exp(-jwt)" else spectra
            return frequency, np.moveaxis(spectra, -1, at), dims
        if not np.iscomplexobj(s):
            raise quantities.fail(
                "the samples are real numbers against frequency; say beat = true in [s] if they are the beat signal of "
                "a chirp from a mixer without I and Q; if they are magnitudes or one part alone, name real and "
                "imaginary, or magnitude and phase, or measure the phase: without it nothing tells where echoes are"
            )
        return values, s, dims
    last = np.moveaxis(s, at, -1)
    if axis == "time":
        frequency, spectra = from_time(last, values, mapping.band)
    else:
        assert mapping.range is not None
        frequency, spectra = from_range(last, values, mapping.range.carrier, speed, mapping.band)
    return frequency, np.moveaxis(spectra, -1, at), dims


def rising(quantities: Quantities, frequency: Array, s: NDArray, dims: list[str]) -> tuple[Array, NDArray]:
    """Frequencies [Hz] and samples with frequencies rising in exactly equal steps, free of the file's rounding.

    Raises
    ------
    InputError
        If the steps are not equal, or the frequencies not positive.
    """
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
