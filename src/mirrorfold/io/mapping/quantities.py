"""Reads the numbers that a mapping names, in SI units: rows, columns of tables, positions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mirrorfold.common.reading import check_file, named_file
from mirrorfold.common.types import Array
from mirrorfold.common.units import KINDS, UNITS
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.model import Places, Values
from mirrorfold.io.mapping.names import BEFORE_UNIT, unit_of_name
from mirrorfold.io.readers import Contents, read_contents
from mirrorfold.io.readers.contents import check_memory

STEP_BYTES = 40.0
"""Memory that each point of a row of equal steps takes while it is made and checked [bytes]."""


@dataclass
class Quantities:
    """The numbers of one file, and of the tables beside it.

    Attributes
    ----------
    contents : Contents
    tables : dict
        Tables that were read already, by their names.
    """

    contents: Contents
    tables: dict[str, Contents] = field(default_factory=dict)

    def fail(self, message: str) -> InputError:
        """An error about this file."""
        return InputError(f"{self.contents.path}: {message}")

    def row(
        self, values: Values, name: str, kind: str, samples: int | None = None, *, of_places: bool = False
    ) -> Array:
        """A row of numbers in the SI unit of its kind (degrees for angles); `samples` is their number along its axis.

        With `of_places`, the unit that the variable names itself is left to `places`.

        Raises
        ------
        InputError
            If it is missing, is no row of finite numbers, has a unit of another kind, or is to be made with another
            number of points than there are samples.
        """
        if samples is not None and values.points not in (None, samples):
            raise self.fail(
                f"{name} has {values.points} points, and there are {samples} samples along its axis; correct one"
            )
        if values.unit is not None and values.unit not in KINDS[kind]:
            expected = f"one of {', '.join(KINDS[kind])}" if KINDS[kind] else "none"
            raise self.fail(f"{name} has the unit {values.unit!r}, expected {expected}")
        if values.variable is not None:
            found = np.asarray(self.contents.array(values.variable))
        elif values.file is not None:
            found = self.column(values.file, values.column)
        elif values.values is not None:
            found = np.array(values.values)
        else:
            found = self._steps(values)
        if found.dtype.kind not in "fiub" or max(found.shape, default=1) != found.size:
            raise self.fail(f"{name} has type {found.dtype} and shape {found.shape}, expected a row of real numbers")
        unit = values.unit
        if unit is None and values.variable is not None and kind in BEFORE_UNIT and not of_places:
            unit = self._named_unit(values.variable, kind)
        result = found.astype(float).ravel() * (UNITS[unit] if unit else 1.0)
        if not np.isfinite(result).all():
            at = int(np.flatnonzero(~np.isfinite(result))[0])
            raise self.fail(f"{name} holds values that are not finite, the first as number {at}; correct the file")
        return result

    def _named_unit(self, variable: str, kind: str) -> str | None:
        """The unit that a variable names itself, by its attribute or the end of its name; None if it does not."""
        said = str(self.contents.variables[variable].attrs.get("units", ""))
        return unit_of_name(variable.rpartition(".")[2], kind, said)

    def _steps(self, values: Values) -> Array:
        """A row of equal steps."""
        assert values.start is not None
        assert values.points is not None
        check_memory(self.contents.path, STEP_BYTES * values.points, "a row of its mapping")
        if values.step is not None:
            return np.asarray(values.start + values.step * np.arange(values.points))
        assert values.stop is not None
        return np.linspace(values.start, values.stop, values.points)

    def column(self, file: str, column: int | str) -> Array:
        """One column of a table beside the file."""
        table = self.table(file)
        if isinstance(column, str):
            found: Array = np.asarray(table.array(column))
            return found
        values = np.asarray(table.array("table"))
        if not -values.shape[1] <= column < values.shape[1]:
            raise InputError(f"{table.path}: has {values.shape[1]} columns, no column {column} (they count from zero)")
        return np.asarray(values[:, column])

    def table(self, file: str) -> Contents:
        """A table beside the file, read once."""
        if file not in self.tables:
            path = named_file(self.contents.path, file, "file")
            self.tables[file] = read_contents(check_file(path, "copy the table there"), "table")
        return self.tables[file]

    def places(self, places: Places, name: str, samples: int | None = None) -> Array:
        """Positions [m], shape (n, 3); for `samples` see `row`.

        Raises
        ------
        InputError
            If they are missing, or are no list of places.
        """
        if places.unit is not None and places.unit not in KINDS["length"]:
            raise self.fail(f"{name} has the unit {places.unit!r}, expected one of {', '.join(KINDS['length'])}")
        if places.position is None and places.file is None:
            rows = [
                np.zeros(1) if row is None else self.row(row, f"{name}.{axis}", "length", samples, of_places=True)
                for axis, row in zip("xyz", (places.x, places.y, places.z), strict=True)
            ]
            sizes = {row.size for row in rows if row.size != 1}
            if len(sizes) > 1:
                said = ", ".join(f"{axis} {row.size}" for axis, row in zip("xyz", rows, strict=True))
                raise self.fail(f"{name} has coordinates of different lengths: {said}")
            scaled = [
                row * (1.0 if given is not None and given.unit else self._metres(places, given and given.variable))
                for row, given in zip(rows, (places.x, places.y, places.z), strict=True)
            ]
            return np.stack(np.broadcast_arrays(*scaled), axis=-1)
        if places.file is not None:
            raw = np.asarray(self.table(places.file).array("table"))
        elif isinstance(places.position, str):
            raw = np.asarray(self.contents.array(places.position))
        else:
            try:
                raw = np.array(places.position, dtype=float)
            except ValueError:
                raise self.fail(f"{name}.position holds places with different numbers of coordinates") from None
        width = len(places.axes)
        written = isinstance(places.position, list) and raw.shape[1:] == (2,)  # three places of two coordinates
        if raw.ndim == 2 and raw.shape[1] != width and raw.shape[0] == width and not written:
            raw = raw.T
        if raw.ndim == 1 and raw.size == width:
            raw = raw[None]
        if raw.ndim != 2 or raw.shape[1] not in (2, 3) or raw.shape[1] > width or raw.dtype.kind not in "fiu":
            raise self.fail(
                f"{name} has type {raw.dtype} and shape {raw.shape}, expected (n, {width}) with the axes {places.axes}"
            )
        result = np.zeros((len(raw), 3))
        for column, axis in enumerate(places.axes[: raw.shape[1]]):
            result[:, "xyz".index(axis[-1])] = raw[:, column] * (-1.0 if axis[0] == "-" else 1.0)
        if not np.isfinite(result).all():
            at = int(np.flatnonzero(~np.isfinite(result).all(axis=1))[0])
            raise self.fail(f"{name} holds places that are not finite, the first as number {at}; correct the file")
        return result * self._metres(places, places.position)

    def _metres(self, places: Places, variable: Any) -> float:
        """The factor of the unit of places, for coordinates from a variable or from elsewhere."""
        named = self._named_unit(variable, "length") if isinstance(variable, str) else None
        return UNITS[places.unit or named or "m"]
