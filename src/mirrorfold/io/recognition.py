"""What the variables of a file probably are: by their names, sizes and values."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.plausible import length_unit, pitch
from mirrorfold.common.units import UNITS
from mirrorfold.io.names import (
    AZIMUTH,
    CHANNELS,
    COORDINATE,
    ELEVATION,
    FREQUENCY,
    IMAGINARY,
    MAGNITUDE,
    PHASE,
    PLACES,
    REAL,
    RECEIVE,
    REFERENCE,
    RX_COORDINATE,
    SPEED,
    START,
    STOP,
    TIME,
    TRANSMIT,
    TX_COORDINATE,
    unit_of_name,
)
from mirrorfold.io.proposal import BESIDE, LISTED, Finding, Guess, plain, source
from mirrorfold.io.readers import Contents, Variable
from mirrorfold.io.spectral import STEP_TOLERANCE

LARGEST_LOOKED_AT = 1 << 20
"""Rows of numbers with more values are not looked into."""

LARGEST_PITCH = 100.0
"""Antennas farther apart than so many units are not given in mm or cm: an aeroplane's are in metres."""

GIGAHERTZ_BELOW = 3e3
"""Frequencies that all lie below this are given in GHz, if they are those of a radar."""


class Search:
    """The search for samples, axes and places, one after the other; each takes what it needs off the list."""

    def __init__(self, contents: Contents, guess: Guess) -> None:
        self.contents, self.guess = contents, guess
        self.free = {
            name: variable
            for name, variable in contents.variables.items()
            if variable.dtype.kind in "fciub" and prod(variable.shape) > 0
        }

    def run(self) -> None:
        """Fill in the guess."""
        samples = self._samples()
        if samples is None:
            self.guess.missing.append(
                "no array of samples was recognised; write a table [s] with variable = ... and dims = [...]"
            )
            return
        shape = [length for length in samples.shape if length > 1] or [1]
        dims = list(samples.dims) if len(samples.dims) == len(samples.shape) else [""] * len(shape)
        known = {"frequency", "time", "range", "tx", "rx", "position", "azimuth", "elevation", "frame", "polarization"}
        dims = [name if name in known else "" for name in dims] if len(dims) == len(shape) else [""] * len(shape)
        self._spectral(shape, dims)
        self._channels(shape, dims)
        self._extras(shape, dims)
        for at, name in enumerate(dims):
            if not name:
                dims[at] = f"axis{at}"
                self.guess.missing.append(
                    f"the axis {at} of the samples (length {shape[at]}) was not recognised; name it in dims and say "
                    "where its places or angles are"
                )
        self.guess.entries["s"]["dims"] = dims
        self.guess.entries = {"time_convention": "exp(+jwt)", "s": self.guess.entries.pop("s"), **self.guess.entries}
        self._found("the time convention exp(+jwt)", 2, "the file does not say; `mirrorfold info` tests it on the data")

    def _found(self, what: str, level: int, why: str) -> None:
        self.guess.findings.append(Finding(plain(what), LISTED[level], why))

    def _samples(self) -> Variable | None:
        """Complex samples, or two parts of them, or the largest real array."""
        complexes = {name: v for name, v in self.free.items() if v.dtype.kind == "c"}
        if "s" in complexes and complexes["s"].dims:  # the reader knows the axes
            complexes = {"s": complexes["s"]}
        if complexes:
            name = max(complexes, key=lambda key: prod(complexes[key].shape))
            self._found(f"the samples are {name!r} {complexes[name].shape}", 0 if len(complexes) == 1 else 1,
                        "the largest complex array")  # fmt: skip
            self.guess.entries["s"] = {"variable": name, "dims": []}
            return self.free.pop(name)
        for real in [name for name in self.free if REAL.search(name)]:
            for imaginary in [name for name in self.free if IMAGINARY.search(name)]:
                if self.free[real].shape == self.free[imaginary].shape and prod(self.free[real].shape) > 1:
                    self._found(f"the samples are {real!r} + j {imaginary!r}", 1, "names and equal shapes")
                    self.guess.entries["s"] = {"real": real, "imaginary": imaginary, "dims": []}
                    self.free.pop(imaginary)
                    return self.free.pop(real)
        for size in [name for name in self.free if MAGNITUDE.search(_last(name))]:
            for angle in [name for name in self.free if PHASE.search(_last(name))]:
                if self.free[size].shape == self.free[angle].shape and prod(self.free[size].shape) > 1:
                    return self._polar(size, angle)
        reals = {name: v for name, v in self.free.items() if sum(n > 1 for n in v.shape) >= 2 and v.dtype.kind in "fiu"}
        if not reals:
            return None
        name = max(reals, key=lambda key: prod(reals[key].shape))
        if self._rows(FREQUENCY, [n for n in reals[name].shape if n > 1]) and not self._rows(TIME, reals[name].shape):
            self.guess.missing.append(
                f"{name!r} holds real numbers against frequency, magnitudes or one part alone: name the other part or "
                "the phase in [s]; without it nothing tells where echoes are"
            )
        self._found(f"the samples are {name!r} {reals[name].shape}", 1, "the largest array; real, so time traces")
        self.guess.entries["s"] = {"variable": name, "dims": []}
        return self.free.pop(name)

    def _polar(self, size: str, angle: str) -> Variable:
        """Magnitudes and phases, with their units by name and value."""
        values, turns = (np.asarray(self.contents.array(name), dtype=float) for name in (size, angle))
        decibel = "db" in _last(size) or bool(np.nanmin(values) < 0.0)
        degrees = "deg" in _last(angle) or bool(np.nanmax(np.abs(turns)) > 2.0 * np.pi + 0.01)
        units = {"magnitude_unit": "dB" if decibel else "linear", "phase_unit": "degree" if degrees else "radian"}
        said = f"{'dB' if decibel else 'linear'}, {units['phase_unit']}"
        self._found(f"the samples are magnitude {size!r} and phase {angle!r}, {said}", 1, "names, shapes and values")
        self.guess.entries["s"] = {"magnitude": size, "phase": angle, **units, "dims": []}
        self.free.pop(angle)
        return self.free.pop(size)

    def _rows(self, pattern: re.Pattern[str], lengths: Iterable[int]) -> list[tuple[str, NDArray]]:
        """Rows of finite numbers whose name fits, of one of the lengths."""
        found = []
        for name, variable in self.free.items():
            size = prod(variable.shape)
            if size != max(variable.shape, default=1) or size > LARGEST_LOOKED_AT or size not in set(lengths):
                continue
            if variable.dtype.kind in "fiu" and pattern.search(_last(name)):
                values = np.asarray(self.contents.array(name), dtype=float).ravel()
                if np.isfinite(values).all():
                    found.append((name, values))
        return found

    def _spectral(self, shape: list[int], dims: list[str]) -> None:
        """The axis of frequency or time."""
        is_real = "variable" in self.guess.entries["s"] and self._is_real()
        for kind, pattern in (("time", TIME), ("frequency", FREQUENCY)) if is_real else (("frequency", FREQUENCY),):
            for name, values in self._rows(pattern, [n for n in shape if n > 1]):
                step = np.diff(values)
                if np.abs(step - step.mean()).max() > STEP_TOLERANCE * abs(step.mean()):
                    continue
                at = dims.index(kind) if kind in dims else shape.index(values.size)
                dims[at] = kind
                unit = self._unit(kind, name, values)
                self._found(f"axis {at} is {kind}, {name!r} in {unit}", 0, "name, length and equal steps")
                if kind not in self.contents.variables[self.guess.entries["s"].get("variable", name)].dims:
                    self._cannot_know(
                        shape, at, *(n for n, size in enumerate(shape) if size == values.size and n != at)
                    )
                said = source(name)
                self.guess.entries[kind] = {"variable": name} if said == name else said
                self.guess.entries[kind] |= {"unit": unit}
                self.free.pop(name)
                return
        kind = "time" if is_real else "frequency"
        if kind in dims:
            dims[dims.index(kind)] = ""
        at = int(np.argmax(shape))
        dims[at] = kind
        self._found(f"axis {at} is {kind}", 2, "the longest one")
        ends = [self._rows(pattern, [1]) for pattern in (START, STOP)]
        if kind == "frequency" and all(ends) and 0 < ends[0][0][1][0] < ends[1][0][1][0]:
            names, limits = [row[0][0] for row in ends], [float(row[0][1][0]) for row in ends]
            unit = self._unit(kind, names[1], np.array(limits))
            self.guess.entries[kind] = {"start": limits[0], "stop": limits[1], "points": shape[at], "unit": unit}
            self._found(f"the band is {limits[0]:g} to {limits[1]:g} {unit}, {names[0]!r} and {names[1]!r}", 1, "names")
        elif kind == "time":
            self.guess.missing.append(
                'give the times in a table [time]: start = 0.0, step = ..., points = ..., unit = "s"'
            )
        else:
            self.guess.missing.append(
                'give the band in a table [frequency]: start = ..., stop = ..., points = ..., unit = "GHz"'
            )

    def _cannot_know(self, shape: list[int], *axes: int) -> None:
        """Say of axes of equal length that they may be exchanged."""
        if len(axes) > 1 and len({shape[at] for at in axes}) == 1:
            listed = " and ".join(map(str, axes))
            self._found(
                f"which of the axes {listed} is which cannot be known", 2,
                f"all have length {shape[axes[0]]}, and the order in the file was taken; `mirrorfold info` tests the "
                "others on the data",
            )  # fmt: skip

    def _is_real(self) -> bool:
        name = self.guess.entries["s"]["variable"]
        return self.contents.variables[name].dtype.kind != "c"

    def _unit(self, kind: str, name: str, values: NDArray) -> str:
        """The unit of a row, by the file, by its name, or by its size."""
        unit = unit_of_name(_last(name), kind, str(self.contents.variables[name].attrs.get("units", "")))
        if unit is not None:
            return unit
        if kind == "frequency":
            return "GHz" if np.abs(values).max() < GIGAHERTZ_BELOW else "Hz"
        return "s"

    def _channels(self, shape: list[int], dims: list[str]) -> None:
        """The axes of antennas: pairs, transmitters and receivers, or positions."""
        open_ = [at for at, name in enumerate(dims) if name in ("", "tx", "rx", "position")]
        if len(open_) == 1:
            at = open_[0]
            if self._pairs(shape[at]):
                dims[at] = "pair"
            elif self._places("antenna", PLACES, shape[at]) or self._places("antenna", None, shape[at]):
                dims[at] = "position"
                self._found(f"axis {at} is the position of one moving antenna", 1, "places of the same number")
            return
        if len(open_) < 2 or self._directions(shape, dims, open_):
            return
        first, second = open_[-2:]
        for order in ((first, second), (second, first)):
            if self._places("tx", TRANSMIT, shape[order[0]]) and self._places("rx", RECEIVE, shape[order[1]]):
                dims[order[0]], dims[order[1]] = "tx", "rx"
                self._found(f"axis {order[0]} is tx and axis {order[1]} rx", 0, "names and lengths of the places")
                self._cannot_know(shape, order[0], order[1])
                return
            for name in ("tx", "rx"):
                self.guess.entries.pop(name, None)
        if len({shape[first], shape[second]}) == 1 and self._places("elements", PLACES, shape[first]):
            dims[first], dims[second] = "tx", "rx"
            self._found(f"the axes {first} and {second} are tx and rx", 1, "as many places as elements; order assumed")
            self._cannot_know(shape, first, second)

    def _directions(self, shape: list[int], dims: list[str], open_: list[int]) -> bool:
        """The axes of a raster scan."""
        for first, second in (open_[-2:], open_[-2:][::-1]):
            rows = [self._rows(AZIMUTH, [shape[first]]), self._rows(ELEVATION, [shape[second]])]
            if all(rows):
                for at, name, row in ((first, "azimuth", rows[0][0]), (second, "elevation", rows[1][0])):
                    small = bool(np.abs(row[1]).max() <= 0.5 * np.pi) and np.ptp(row[1]) < 0.5 * np.pi
                    unit = "radian" if "rad" in _last(row[0]) or (small and "deg" not in _last(row[0])) else "degree"
                    dims[at] = name
                    self.guess.entries[name] = {"variable": row[0], "unit": unit}
                    self._found(f"axis {at} is {name}, {row[0]!r} in {unit}", 1, "name, length and size of the values")
                return True
        return False

    def _pairs(self, count: int) -> bool:
        """Two rows of whole numbers that say the antennas of each channel."""
        found: dict[str, str] = {}
        columns = [name for name, _ in self._rows(CHANNELS, [count]) if name.count(BESIDE) == 2]
        for n, (side, pattern) in enumerate((("tx", TRANSMIT), ("rx", RECEIVE))):
            rows = self._rows(pattern, [count]) or [
                (name, np.asarray(self.contents.array(name))) for name in columns[n:]
            ]
            for name, values in rows:
                if np.array_equal(values, np.rint(values)) and values.min() >= 0 and name not in found.values():
                    found[side] = name
                    break
        if len(found) < 2:
            return False
        numbers = [np.asarray(self.contents.array(name), dtype=float) for name in found.values()]
        base = 0 if min(float(row.min()) for row in numbers) == 0.0 else 1
        elements = int(max(row.max() for row in numbers)) + 1 - base
        if not (self._places("elements", PLACES, elements) or self._places("elements", None, elements)):
            return False
        self.guess.entries["pairs"] = {**{side: source(name) for side, name in found.items()}, "base": base}
        self._found(f"channels are pairs of {elements} elements, {found['tx']!r} and {found['rx']!r}", 0,
                    f"whole numbers from {base}")  # fmt: skip
        half = bool(np.all(numbers[0] <= numbers[1]) or np.all(numbers[0] >= numbers[1]))
        if half:
            self.guess.entries["reciprocal"] = True
            self._found("the other half of the matrix is the same", 1, "only one order of each pair is there")
        return True

    def _places(self, entry: str, pattern: re.Pattern[str] | None, count: int) -> bool:
        """Positions as one array, or as coordinates one by one."""
        for name, variable in self.free.items():
            lengths = [n for n in variable.shape if n > 1]
            fits = sorted(lengths) in (sorted((count, 3)), sorted((count, 2))) and variable.dtype.kind in "fiu"
            if fits and pattern is not None and pattern.search(name.lower()):
                unit = self._length_unit(name)
                said = source(name)
                self.guess.entries[entry] = {"position": name} if said == name else {"file": said["file"]}
                self.guess.entries[entry] |= {"unit": unit}
                self._found(f"{name!r} {variable.shape} are the places of {entry}, in {unit}", 1, "name and shape")
                return True
        coordinates: dict[str, Any] = {}
        form = {"tx": TX_COORDINATE, "rx": RX_COORDINATE}.get(entry, COORDINATE)
        for name, variable in self.free.items():
            match = form.match(_last(name))
            size = prod(variable.shape)
            if match and size == max(variable.shape, default=1) == count and variable.dtype.kind in "fiu":
                coordinates.setdefault(next(axis for axis in match.groups() if axis), name)
        if "x" not in coordinates:
            return self._steps(entry, count)
        unit = self._length_unit(coordinates["x"], list(coordinates.values()))
        self.guess.entries[entry] = {**coordinates, "unit": unit}
        self._found(f"{', '.join(map(repr, coordinates.values()))} are the places of {entry}, in {unit}", 1,
                    "names and lengths")  # fmt: skip
        return True

    def _steps(self, entry: str, count: int) -> bool:
        """Places in equal steps, of which single numbers say the first one and the distance."""
        side = entry if entry in ("tx", "rx") else ""
        scalars = {name: variable for name, variable in self.free.items() if prod(variable.shape) == 1}

        def number(form: str) -> tuple[str, float] | None:
            own = rf"^{side}_?(?:{form})(?:_?m{{1,2}})?$|^(?:{form})_?{side}(?:_?m{{1,2}})?$"
            for pattern in (own, rf"^(?:{form})(?:_?m{{1,2}})?$"):
                for name, variable in scalars.items():
                    if variable.dtype.kind in "fiu" and re.match(pattern, _last(name)):
                        return name, float(np.asarray(self.contents.array(name)).ravel()[0])
            return None

        step, elements = number(r"d_?x|x?_?(?:step|pitch|spacing)"), number(r"n|num|count|number|elements")
        if step is None or step[1] == 0.0 or (elements is not None and elements[1] != count):
            return False
        start = number(r"x_?(?:0|start|min|first)")
        first = start[1] if start is not None else -0.5 * (count - 1) * step[1]
        unit = self._length_unit(step[0])
        row = {"start": first, "step": step[1], "points": count, "unit": unit}
        self.guess.entries[entry] = {"x": row}
        named = [step[0]] + ([start[0]] if start is not None else [])
        for axis in "yz":
            fixed = number(rf"{axis}_?0?")
            if fixed is not None:
                self.guess.entries[entry][axis] = {"values": [fixed[1]], "unit": unit}
                named.append(fixed[0])
        self._found(
            f"the places of {entry} are {first:g} + n {step[1]:g} {unit} along x, from {', '.join(map(repr, named))}",
            1 if start is not None else 2,
            "names of single numbers" if start is not None else "names; nothing says the first one, so around zero",
        )
        return True

    def _length_unit(self, name: str, coordinates: list[str] | None = None) -> str:
        """The unit of places: by the file, by the name, or by their distance in wavelengths."""
        said = unit_of_name(_last(name), "length", str(self.contents.variables[name].attrs.get("units", "")))
        if said is not None:
            return said
        frequency = self.guess.entries.get("frequency", {})
        if "unit" not in frequency or not ({"variable", "stop"} & set(frequency)):
            return "m"
        top = frequency.get("stop") or np.max(np.asarray(self.contents.array(frequency["variable"]), dtype=float))
        rows = [np.asarray(self.contents.array(row), dtype=float) for row in coordinates or [name]]
        if rows[0].size == 1:  # a step
            rows = [np.array([0.0, rows[0].item()])]
            coordinates = [name]
        places = np.unique(np.stack([row.ravel() for row in rows], -1) if coordinates else _tall(rows[0]), axis=0)
        highest = float(top) * UNITS[frequency["unit"]]
        if len(places) < 2 or not np.isfinite(places).all() or not highest > 0.0:
            return "m"
        apart, wavelength = pitch(places), speed_of_light / highest
        meant = length_unit(apart, wavelength) if apart < LARGEST_PITCH else None
        if meant is None:
            return "m"
        self._found(
            f"{name!r} is in {meant}", 2, f"in metres neighbours were {apart / wavelength:.0f} wavelengths apart"
        )
        return meant

    def _extras(self, shape: list[int], dims: list[str]) -> None:
        """Reference ranges of pulses, and the speed of the waves."""
        if "position" in dims:
            for name, values in self._rows(REFERENCE, [shape[dims.index("position")]]):
                if values.min() > 0:
                    self.guess.entries["compensation"] = {"range": name}
                    self.guess.entries["scene_center"] = [0.0, 0.0, 0.0]
                    self._found(f"pulses are referred to the ranges {name!r}", 1, "name and length")
        for name, values in self._rows(SPEED, [1]):
            if 100.0 < values[0] < 3e8:
                self.guess.entries["wave_speed"] = name
                self._found(f"waves travel at {values[0]:g} m/s, {name!r}", 1, "name and value")


def _last(name: str) -> str:
    """The last part of a name, or the file it stands in, in lower case."""
    if name.startswith(BESIDE):
        return name.split(BESIDE)[1].rpartition(".")[0].lower()
    return name.rpartition(".")[2].lower()


def _tall(values: NDArray) -> NDArray:
    """Places as rows."""
    values = np.squeeze(values)
    return values.T if values.ndim == 2 and values.shape[0] <= 3 < values.shape[1] else np.atleast_2d(values)
