"""Search for the positions of the antennas in a file: as arrays, as coordinates one by one, or in equal steps."""

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
from mirrorfold.io.guessing.proposal import CERTAINTIES, OTHER_FILE_MARK, Finding, Guess, plain, source
from mirrorfold.io.mapping.names import (
    CHANNELS,
    COORDINATE,
    LENGTH_UNIT,
    PLACES,
    RECEIVE,
    RX_COORDINATE,
    TRANSMIT,
    TX_COORDINATE,
    unit_of_name,
)
from mirrorfold.io.readers import Contents

LARGEST_LOOKED_AT = 1 << 20
"""Largest number of values of a row of numbers that is looked at; also the largest size of a table beside a table
[bytes]."""

LARGEST_PITCH = 100.0
"""Distance between antennas, in the numbers of the file, from which on their unit cannot be mm or cm; positions of an
aeroplane, for example, are in metres."""


class PlaceSearch:
    """Search for places among the variables of a file that are not recognised as something else yet.

    `free` holds these variables by name; what is found goes into the guess.
    """

    def __init__(self, contents: Contents, guess: Guess) -> None:
        self.contents, self.guess = contents, guess
        self.free = {
            name: variable
            for name, variable in contents.variables.items()
            if variable.dtype.kind in "fciub" and prod(variable.shape) > 0
        }

    def _found(self, what: str, level: int, why: str) -> None:
        """Note a finding; `level` is the index of its certainty in `CERTAINTIES`."""
        self.guess.findings.append(Finding(plain(what), CERTAINTIES[level], why))

    def _rows(self, pattern: re.Pattern[str], lengths: Iterable[int]) -> list[tuple[str, NDArray]]:
        """Rows of finite numbers whose names fit a pattern, and whose lengths are among `lengths`, with their names."""
        found = []
        for name, variable in self.free.items():
            size = prod(variable.shape)
            if size != max(variable.shape, default=1) or size > LARGEST_LOOKED_AT or size not in set(lengths):
                continue
            if variable.dtype.kind in "fiu" and pattern.search(last_part(name)):
                values = np.asarray(self.contents.array(name), dtype=float).ravel()
                if np.isfinite(values).all():
                    found.append((name, values))
        return found

    def _pairs(self, count: int) -> bool:
        """Look for two rows of whole numbers, the antennas of each of `count` channels; whether it succeeded."""
        found: dict[str, str] = {}
        columns = [name for name, _ in self._rows(CHANNELS, [count]) if name.count(OTHER_FILE_MARK) == 2]
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
        counts = [int(row.max()) + 1 - base for row in numbers]
        whose = self._places_of_pairs(*counts)
        if not whose:
            return False
        self.guess.entries["pairs"] = {**{side: source(name) for side, name in found.items()}, "base": base}
        self._found(f"channels are pairs of {whose}, {found['tx']!r} and {found['rx']!r}",
                    int("elements" in self.guess.entries), f"whole numbers from {base}")  # fmt: skip
        half = bool(np.all(numbers[0] <= numbers[1]) or np.all(numbers[0] >= numbers[1]))
        if half and "elements" in self.guess.entries:
            self.guess.entries["reciprocal"] = True
            self._found("the other half of the matrix is the same", 1, "only one order of each pair is there")
        return True

    def _one_fixed(self, count: int) -> bool:
        """Look for `count` antennas that receive from one transmitter, or send to one receiver; whether there are."""
        sides = (("rx", RECEIVE), ("tx", TRANSMIT))
        for (many, pattern), (one, its_pattern) in (sides, sides[::-1]):
            kept = len(self.guess.findings)
            if self._places(many, pattern, count, own=True) and self._places(one, its_pattern, 1, own=True):
                numbers = {many: {"values": list(range(count))}, one: {"values": [0] * count}}
                self.guess.entries["pairs"] = {**numbers, "base": 0}
                self._found(f"channels are pairs of one {one} and {count} {many}", 1, "names and numbers of the places")
                return True
            self._forget(kept)
        return False

    def _places_of_pairs(self, transmitters: int, receivers: int) -> str:
        """Look for the places of the antennas of channels: two arrays, or elements that transmit and receive.

        Returns what the numbers of the channels count, in words; empty where no places were found.
        """
        elements = max(transmitters, receivers)
        kept = len(self.guess.findings)
        known = [
            any(self._places(side, pattern, count, own=True) for count in dict.fromkeys((used, elements)))
            for side, pattern, used in (("tx", TRANSMIT, transmitters), ("rx", RECEIVE, receivers))
        ]
        if all(known):
            return f"{transmitters} transmitters and {receivers} receivers"
        self._forget(kept)
        if any(known) and transmitters != receivers:
            lacking = "rx" if known[0] else "tx"
            self.guess.missing.append(f"the places of {lacking} were not recognised; write tables [tx] and [rx]")
            return ""
        if self._places("elements", PLACES, elements) or self._places("elements", None, elements):
            return f"{elements} elements"
        return ""

    def _forget(self, kept: int) -> None:
        """Drop the findings after the first `kept`, and the places of transmitters and receivers.

        This is done where only one of both was found.
        """
        del self.guess.findings[kept:]
        for side in ("tx", "rx"):
            self.guess.entries.pop(side, None)

    def _places(self, entry: str, pattern: re.Pattern[str] | None, count: int, *, own: bool = False) -> bool:
        """Look for `count` positions as one array, or as coordinates one by one; whether it succeeded.

        With `own`, equal steps count only if their names contain the side, tx or rx.
        """
        for name, variable in self.free.items():
            lengths = [n for n in variable.shape if n > 1]
            expected = [sorted(n for n in (count, axes) if n > 1) for axes in (3, 2)]
            fits = sorted(lengths) in expected and variable.dtype.kind in "fiu"
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
            match = form.match(last_part(name))
            size = prod(variable.shape)
            if match and size == max(variable.shape, default=1) == count and variable.dtype.kind in "fiu":
                coordinates.setdefault(next(axis for axis in match.groups() if axis), name)
        if "x" not in coordinates:
            return self._steps(entry, count, own=own)
        unit = self._length_unit(coordinates["x"], list(coordinates.values()))
        self.guess.entries[entry] = {**coordinates, "unit": unit}
        for axis, name in coordinates.items():
            named = self._named_unit(name)
            if named not in (None, unit):
                self.guess.entries[entry][axis] = {"variable": name, "unit": named}
        self._found(f"{', '.join(map(repr, coordinates.values()))} are the places of {entry}, in {unit}", 1,
                    "names and lengths")  # fmt: skip
        return True

    def _steps(self, entry: str, count: int, *, own: bool) -> bool:
        """Look for places in equal steps along x, given by the first place and the pitch; whether it succeeded."""
        side = entry if entry in ("tx", "rx") else ""
        scalars = {name: variable for name, variable in self.free.items() if prod(variable.shape) == 1}

        def number(form: str, *, own: bool = False) -> tuple[str, float] | None:
            mine = rf"^{side}_?(?:{form}){LENGTH_UNIT}$|^(?:{form})_?{side}{LENGTH_UNIT}$"
            for pattern in (mine,) if own else (mine, rf"^(?:{form}){LENGTH_UNIT}$"):
                for name, variable in scalars.items():
                    if variable.dtype.kind in "fiu" and re.match(pattern, last_part(name)):
                        return name, float(np.asarray(self.contents.array(name)).ravel()[0])
            return None

        step, elements = number(r"d_?x|x?_?(?:step|pitch|spacing)", own=own), number(r"n|num|count|number|elements")
        if step is None or step[1] == 0.0 or (elements is not None and elements[1] != count):
            return False
        unit = self._length_unit(step[0])
        start = (number("start|min|first", own=True) if side else None) or number(r"x_?(?:0|start|min|first)", own=own)
        first = -0.5 * (count - 1) * step[1]
        if start is not None:
            first = float(f"{start[1] * UNITS[self._named_unit(start[0]) or unit] / UNITS[unit]:.12g}")
        self.guess.entries[entry] = {"x": {"start": first, "step": step[1], "points": count, "unit": unit}}
        named = [step[0]] + ([start[0]] if start is not None else [])
        for axis in "yz":
            fixed = number(rf"{axis}_?0?") or (number("height", own=True) if side and axis == "z" else None)
            if fixed is not None:
                self.guess.entries[entry][axis] = {"values": [fixed[1]], "unit": self._named_unit(fixed[0]) or unit}
                named.append(fixed[0])
        self._found(
            f"the places of {entry} are {first:g} + n {step[1]:g} {unit} along x, from {', '.join(map(repr, named))}",
            1 if start is not None else 2,
            "names of single numbers" if start is not None else "names; nothing says the first one, so around zero",
        )
        unused = [name for name in scalars if side and last_part(name).startswith(side) and self._named_unit(name)]
        for name in unused:
            if name not in named:
                self._found(f"{name!r} is not used", 2, f"a length of {entry} whose meaning is not known")
        return True

    def _named_unit(self, name: str) -> str | None:
        """The unit of length of a variable, by its attribute or its name; None where neither tells it."""
        return self._said_unit("length", name)

    def _said_unit(self, kind: str, name: str) -> str | None:
        """The unit of a variable, by its attribute or its name; None where neither tells it."""
        return unit_of_name(last_part(name), kind, str(self.contents.variables[name].attrs.get("units", "")))

    def _length_unit(self, name: str, coordinates: list[str] | None = None) -> str:
        """The unit of places: by the variable's attribute, by its name, or by their distances in wavelengths."""
        said = self._named_unit(name)
        if said is not None:
            return said
        sides = [self.guess.entries[side] for side in ("tx", "rx") if side in self.guess.entries]
        usual = str(sides[0].get("unit", "m")) if sides else "m"  # as the places of the other side
        frequency = self.guess.entries.get("frequency", {})
        if "unit" not in frequency or not ({"variable", "start"} & set(frequency)):
            return usual
        if "start" in frequency:
            top = frequency.get("stop") or frequency["start"] + frequency["step"] * (frequency["points"] - 1)
        else:
            top = np.max(np.asarray(self.contents.array(frequency["variable"]), dtype=float))
        rows = [np.asarray(self.contents.array(row), dtype=float) for row in coordinates or [name]]
        if rows[0].size == 1:  # a step
            rows = [np.array([0.0, rows[0].item()])]
            coordinates = [name]
        places = np.unique(np.stack([row.ravel() for row in rows], -1) if coordinates else _tall(rows[0]), axis=0)
        highest = float(top) * UNITS[frequency["unit"]]
        if len(places) < 2 or not np.isfinite(places).all() or not highest > 0.0:
            return usual
        apart, wavelength = pitch(places), speed_of_light / highest
        meant = length_unit(apart, wavelength) if apart < LARGEST_PITCH else None
        if meant is None:
            return "m"
        self._found(
            f"{name!r} is in {meant}", 2, f"in metres neighbours were {apart / wavelength:.0f} wavelengths apart"
        )
        return meant


def last_part(name: str) -> str:
    """The last part of a variable's name, or the name of the file beside that holds it, in lower case."""
    if name.startswith(OTHER_FILE_MARK):
        return name.split(OTHER_FILE_MARK)[1].rpartition(".")[0].lower()
    return name.rpartition(".")[2].lower()


def _tall(values: NDArray) -> NDArray:
    """Places with one row for each, (n, 1 to 3), also where the file has one column for each."""
    values = np.squeeze(values)
    return values.T if values.ndim == 2 and values.shape[0] <= 3 < values.shape[1] else np.atleast_2d(values)
