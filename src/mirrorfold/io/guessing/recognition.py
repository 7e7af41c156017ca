"""Recognises samples, axes and antennas among the variables of a file, by their names, sizes and values."""

from __future__ import annotations

from math import prod
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.units import UNITS
from mirrorfold.io.guessing.place_search import PlaceSearch, last_part
from mirrorfold.io.guessing.proposal import source
from mirrorfold.io.mapping.names import (
    AZIMUTH,
    COUNT,
    ELEVATION,
    FREQUENCY,
    IMAGINARY,
    MAGNITUDE,
    PHASE,
    PLACES,
    REAL,
    RECEIVE,
    REFERENCE,
    SPEED,
    START,
    STEP,
    STOP,
    TIME,
    TRANSMIT,
)
from mirrorfold.io.mapping.spectral import STEP_TOLERANCE
from mirrorfold.io.readers import Variable
from mirrorfold.io.readers.phases import phase_unit

GIGAHERTZ_BELOW = 3e3
"""Numbers below which frequencies without a unit are taken to be in GHz, as a radar has none so low in Hz."""


class Search(PlaceSearch):
    """The search for samples, then axes, then places; recognised variables are removed from the list."""

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
        self._parts(shape, dims)
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

    def _samples(self) -> Variable | None:
        """Find the samples: a complex variable, two variables with their parts, or the largest real array.

        Returns one of the variables, whose shape and dimensions are those of the samples; None where none is found.
        """
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
        for size in [name for name in self.free if MAGNITUDE.search(last_part(name))]:
            for angle in [name for name in self.free if PHASE.search(last_part(name))]:
                if self.free[size].shape == self.free[angle].shape and prod(self.free[size].shape) > 1:
                    return self._polar(size, angle)
        reals = {name: v for name, v in self.free.items() if sum(n > 1 for n in v.shape) >= 2 and v.dtype.kind in "fiu"}
        if not reals:
            return None
        name = max(reals, key=lambda key: prod(reals[key].shape))
        lengths = [n for n in reals[name].shape if n > 1]
        over_frequency = bool(self._rows(FREQUENCY, lengths)) and not self._rows(TIME, lengths)
        if over_frequency and 2 not in (lengths[0], lengths[-1]):
            self.guess.missing.append(
                f"{name!r} holds real numbers against frequency: say beat = true in [s] if they are the beat signal of "
                "a chirp from a mixer without I and Q; if they are magnitudes or one part alone, name the other part "
                "or the phase: without it nothing tells where echoes are"
            )
        why = "the largest array" if over_frequency else "the largest array; real, so time traces"
        self._found(f"the samples are {name!r} {reals[name].shape}", 1, why)
        self.guess.entries["s"] = {"variable": name, "dims": []}
        return self.free.pop(name)

    def _polar(self, size: str, angle: str) -> Variable:
        """Take two variables as magnitude and phase of the samples, with units by name and values."""
        values, turns = (np.asarray(self.contents.array(name), dtype=float) for name in (size, angle))
        decibel = "db" in last_part(size) or bool(np.nanmin(values) < 0.0)
        told = phase_unit(last_part(angle), turns)
        units = {"magnitude_unit": "dB" if decibel else "linear", "phase_unit": told or "radian"}
        said = f"{'dB' if decibel else 'linear'}, {units['phase_unit']}"
        self._found(f"the samples are magnitude {size!r} and phase {angle!r}, {said}", 1 if told else 2,
                    "names, shapes and values" if told else "names and shapes")  # fmt: skip
        self.guess.entries["s"] = {"magnitude": size, "phase": angle, **units, "dims": []}
        self.free.pop(angle)
        return self.free.pop(size)

    def _parts(self, shape: list[int], dims: list[str]) -> None:
        """Find the axis of real and imaginary parts, if the samples are real numbers over frequency."""
        if "variable" not in self.guess.entries["s"] or not self._is_real():
            return
        at = next((at for at in (len(shape) - 1, 0) if shape[at] == 2 and not dims[at]), None)
        if at is not None and self._rows(FREQUENCY, shape) and not self._rows(TIME, shape):
            dims[at] = "re_im"
            self._found(f"axis {at} holds real and imaginary parts", 1, "length two, of real numbers against frequency")

    def _spectral(self, shape: list[int], dims: list[str]) -> None:
        """Find the axis of frequency or time, and its values."""
        is_real = "variable" in self.guess.entries["s"] and self._is_real() and "re_im" not in dims
        for kind, pattern in (("time", TIME), ("frequency", FREQUENCY)) if is_real else (("frequency", FREQUENCY),):
            for name, values in self._rows(pattern, [n for n in shape if n > 1]):
                step = np.diff(values)
                if np.abs(step - step.mean()).max() > STEP_TOLERANCE * abs(step.mean()):
                    continue
                at = dims.index(kind) if kind in dims else shape.index(values.size)
                dims[at] = kind
                unit = self._unit(kind, name, values)
                held = self.contents.variables[self.guess.entries["s"].get("variable", name)].dims
                alike = [at] if kind in held else [n for n, size in enumerate(shape) if size == values.size]
                self._found(f"axis {at} is {kind}, {name!r} in {unit}", 0 if len(alike) == 1 else 2,
                            "name, length and equal steps")  # fmt: skip
                self._cannot_know(shape, *alike)
                said = source(name)
                self.guess.entries[kind] = {"variable": name} if said == name else said
                self.guess.entries[kind] |= {"unit": unit}
                self.free.pop(name)
                return
        kind = "time" if is_real else "frequency"
        if kind in dims:
            dims[dims.index(kind)] = ""
        counts = [int(row[0]) for _, row in self._rows(COUNT, [1]) if row[0] in shape and kind == "frequency"]
        at = shape.index(counts[0]) if counts else int(np.argmax(shape))
        dims[at] = kind
        self._found(f"axis {at} is {kind}", 1 if counts else 2, "its length" if counts else "the longest one")
        if kind == "frequency" and self._band(shape[at]):
            return
        if kind == "time":
            self.guess.missing.append(
                'give the times in a table [time]: start = 0.0, step = ..., points = ..., unit = "s"'
            )
        else:
            self.guess.missing.append(
                'give the band in a table [frequency]: start = ..., stop = ..., points = ..., unit = "GHz"'
            )

    def _band(self, points: int) -> bool:
        """Look for the band as single numbers, its start and its stop or its step; whether it succeeded."""
        starts = sorted(self._rows(START, [1]), key=itemgetter(0))[:1]
        for end, pattern in (("stop", STOP), ("step", STEP)):
            others = [row for row in self._rows(pattern, [1]) for start in starts if row[0] != start[0]]
            if not others:
                continue
            both = [starts[0], max(others, key=itemgetter(0))]
            names, values = [name for name, _ in both], [float(row[0]) for _, row in both]
            named = [self._said_unit("frequency", name) for name in names]
            unit = named[0] or self._unit("frequency", names[1], np.array(values))
            values[1] = float(f"{values[1] * UNITS[named[1] or unit] / UNITS[unit]:.12g}")
            if values[0] > 0.0 and values[1] > (values[0] if end == "stop" else 0.0):
                self.guess.entries["frequency"] = {"start": values[0], end: values[1], "points": points, "unit": unit}
                said = f"to {values[1]:g}" if end == "stop" else f"+ n {values[1]:g}"
                self._found(f"the band is {values[0]:g} {said} {unit}, {names[0]!r} and {names[1]!r}", 1, "names")
                return True
        return False

    def _cannot_know(self, shape: list[int], *axes: int) -> None:
        """Note that axes of equal length may be exchanged."""
        if len(axes) > 1 and len({shape[at] for at in axes}) == 1:
            listed = " and ".join(map(str, axes))
            self._found(
                f"which of the axes {listed} is which cannot be known", 2,
                f"all have length {shape[axes[0]]}, and the order in the file was taken; `mirrorfold info` tests the "
                "others on the data",
            )  # fmt: skip

    def _is_real(self) -> bool:
        """Whether the variable with the samples holds real numbers."""
        name = self.guess.entries["s"]["variable"]
        return self.contents.variables[name].dtype.kind != "c"

    def _unit(self, kind: str, name: str, values: NDArray) -> str:
        """The unit of frequencies or times, by the variable's attribute, by its name, or by its values."""
        said = self._said_unit(kind, name)
        if said is not None:
            return said
        if kind == "frequency":
            return "GHz" if np.abs(values).max() < GIGAHERTZ_BELOW else "Hz"
        return "s"

    def _channels(self, shape: list[int], dims: list[str]) -> None:
        """Find the axes of antennas: pairs, transmitters and receivers, or positions; or those of a raster scan."""
        open_ = [at for at, name in enumerate(dims) if name in ("", "tx", "rx", "position")]
        if len(open_) == 1:
            at = open_[0]
            if self._pairs(shape[at]) or self._one_fixed(shape[at]):
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
                alike = shape[first] == shape[second]
                self._found(f"axis {order[0]} is tx and axis {order[1]} rx", 2 if alike else 0,
                            "names and lengths of the places")  # fmt: skip
                self._cannot_know(shape, *order)
                return
            for name in ("tx", "rx"):
                self.guess.entries.pop(name, None)
        if len({shape[first], shape[second]}) == 1 and self._places("elements", PLACES, shape[first]):
            dims[first], dims[second] = "tx", "rx"
            self._found(f"the axes {first} and {second} are tx and rx", 1, "as many places as elements; order assumed")
            self._cannot_know(shape, first, second)

    def _directions(self, shape: list[int], dims: list[str], open_: list[int]) -> bool:
        """Find the axes of a raster scan, azimuth and elevation; whether it succeeded."""
        for first, second in (open_[-2:], open_[-2:][::-1]):
            rows = [self._rows(AZIMUTH, [shape[first]]), self._rows(ELEVATION, [shape[second]])]
            if all(rows):
                for at, name, row in ((first, "azimuth", rows[0][0]), (second, "elevation", rows[1][0])):
                    small = bool(np.abs(row[1]).max() <= 0.5 * np.pi) and np.ptp(row[1]) < 0.5 * np.pi
                    unit = (
                        "radian"
                        if "rad" in last_part(row[0]) or (small and "deg" not in last_part(row[0]))
                        else "degree"
                    )
                    dims[at] = name
                    self.guess.entries[name] = {"variable": row[0], "unit": unit}
                    self._found(f"axis {at} is {name}, {row[0]!r} in {unit}", 1, "name, length and size of the values")
                return True
        return False

    def _extras(self, shape: list[int], dims: list[str]) -> None:
        """Find the reference ranges of pulses, and the speed of the waves."""
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
