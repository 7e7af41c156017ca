"""The positions of the antennas for each file of a scan, from a table (CSV) or a description (TOML or JSON).

A CSV has a column ``file`` (a name, or a pattern with ``*`` that fits one file) and the columns ``tx_x, tx_y, tx_z,
rx_x, rx_y, rx_z``; or ``x, y, z`` of one antenna that transmits and receives; or ``azimuth, elevation`` of a beam.
Coordinates that are left out are zero. A unit is part of the heading, as in ``tx_x_mm`` or ``tx_x [mm]``.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from mirrorfold.common.reading import named_by
from mirrorfold.common.units import KINDS, UNITS, Quantity, unit_named
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.model import Coordinate, Finite, Places, Row, Strict, Unit, in_one_unit
from mirrorfold.io.mapping.quantities import Quantities
from mirrorfold.io.mapping.strict import read_written, validated
from mirrorfold.io.readers import Contents
from mirrorfold.io.readers.contents import read_bytes
from mirrorfold.io.readers.lines import LONGEST_CELL, parse_number

Place = tuple[float, float, float]

COLUMNS_BY_KIND = {
    "pair": ("tx_x", "tx_y", "tx_z", "rx_x", "rx_y", "rx_z"),
    "position": ("x", "y", "z"),
    "beam": ("azimuth", "elevation"),
}
"""Columns by what they describe: the places of a pair, the position of one antenna, or the direction of a beam."""

ANGLES = COLUMNS_BY_KIND["beam"]

INDICES = ("tx", "rx", "position")
"""Placeholders in a pattern of file names that stand for the number of a place."""

FILE_NAMES = ("file", "filename", "file_name", "name", "path")
"""Names of the entry with the file, also in tables of other origin."""

LISTS = ("file", "files", "measurements", "records", "entries")
"""Names of the list of files, also in descriptions of other origin."""


@dataclass(frozen=True)
class FilePosition:
    """A line of a table: one file and the places of its antennas.

    Attributes
    ----------
    file : str
    where : str
        Place of the line, for messages.
    numbers : dict
        Coordinates by the names in `COLUMNS_BY_KIND`, in metres and degrees.
    """

    file: str
    where: str
    numbers: dict[str, float]


Triple = Annotated[list[Finite], Field(min_length=2, max_length=3)]


class Entry(Strict):
    """An entry of a description: one file and the places of its antennas."""

    file: str
    tx: Triple | None = None
    rx: Triple | None = None
    position: Triple | None = None
    unit: Unit | None = None
    azimuth: Annotated[Finite, Quantity("angle")] | None = None
    elevation: Annotated[Finite, Quantity("angle")] | None = None

    @model_validator(mode="before")
    @classmethod
    def _aliases(cls, value: Any) -> Any:
        return in_one_unit(_with_file(value, FILE_NAMES), ("tx", "rx", "position"))


class Scan(Strict):
    """The description of a scan.

    Attributes
    ----------
    file : list of Entry
        Every file with its places. Or instead: `table`, a CSV beside the description; `files`, a pattern of file names
        such as ``"scan_{tx}_{rx}.s2p"``, with the places `tx` and `rx` (or `antenna` for ``{position}``), or with the
        coordinates in the name, as in ``"beam_{azimuth}_{elevation}.s1p"``; `ports`, the antennas of one file with all
        ports; `tx` and `rx` alone, the antennas of one table with all pairs.
    base : {0, 1}
        The number of the first place in file names.
    unit : str
        Unit of the places of `file`, and of lengths in file names.
    parameter : str
    title, instrument, time_convention, wave_speed, scene_center, origin
        As in a mapping file.
    spot_radius, focus_distance : float [m]
        Radius and distance of the focus of a beam that is steered.
    polarization : {"TE", "TM"}
    """

    file: list[Entry] | None = None
    table: str | None = None
    files: str | None = None
    ports: Places | None = None
    tx: Places | None = None
    rx: Places | None = None
    antenna: Places | None = None
    base: Literal[0, 1] = 0
    unit: Unit = "m"
    parameter: str | None = None
    title: str | None = None
    instrument: str | None = None
    time_convention: Literal["exp(+jwt)", "exp(-jwt)"] = "exp(+jwt)"
    wave_speed: Annotated[float, Field(gt=0, allow_inf_nan=False), Quantity("speed")] | None = None
    scene_center: tuple[Coordinate, Coordinate, Coordinate] | None = None
    origin: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    spot_radius: Annotated[float, Field(gt=0, allow_inf_nan=False), Quantity("length")] | None = None
    focus_distance: Annotated[float, Field(ge=0, allow_inf_nan=False), Quantity("length")] | None = None
    polarization: Literal["TE", "TM"] | None = None

    @model_validator(mode="before")
    @classmethod
    def _aliases(cls, value: Any) -> Any:
        if isinstance(value, dict):
            lists = [name for name in LISTS if isinstance(value.get(name), list)]
            if len(lists) == 1:
                return _with_file(value, lists)
        return value

    @model_validator(mode="after")
    def _one_source(self) -> Scan:
        given = [name for name in ("file", "table", "files", "ports") if getattr(self, name) is not None]
        if not given and self.tx is not None and self.rx is not None:
            return self
        if len(given) != 1:
            raise ValueError(f"give one of file, table, files and ports; found {', '.join(given) or 'none'}")
        return self


def _with_file(value: Any, names: Sequence[str]) -> Any:
    """The dict, with its only entry that is called by one of `names` renamed to "file"."""
    if not isinstance(value, dict) or "file" in value:
        return value
    found = [other for other in names if other in value]
    if len(found) != 1:
        return value
    return {("file" if key == found[0] else key): item for key, item in value.items()}


def read_positions(path: Path | dict[str, Any]) -> tuple[Scan, list[FilePosition] | None]:
    """Read the description of a scan, and its lines; None for these where the description does not list the files.

    Raises
    ------
    InputError
        If a line or entry is wrong; the message tells which.
    """
    if isinstance(path, dict) or path.suffix.lower() in (".toml", ".json"):
        content, path = (path, Path("positions")) if isinstance(path, dict) else (read_written(path), path)
        scan = validated(Scan, content, str(path))
        if scan.table is not None:
            with named_by(path, scan.table, "table") as table:
                return scan, _read_table(table)
        if scan.file is not None:
            return scan, [_of_entry(path, n, entry, scan.unit) for n, entry in enumerate(scan.file)]
        return scan, None
    return Scan(table=path.name), _read_table(path)


def _of_entry(path: Path, number: int, entry: Entry, unit_of_all: str) -> FilePosition:
    """The line that an entry of a description stands for."""
    where = f"{path}: file[{number}] ({entry.file})"
    unit = UNITS[entry.unit or unit_of_all]
    numbers: dict[str, float] = {}
    for name in ("tx", "rx", "position"):
        place = getattr(entry, name)
        if place is not None:
            prefix = "" if name == "position" else f"{name}_"
            numbers |= {f"{prefix}{axis}": unit * value for axis, value in zip("xyz", place, strict=False)}
    numbers |= {name: getattr(entry, name) for name in ANGLES if getattr(entry, name) is not None}
    return FilePosition(entry.file, where, numbers)


def _read_table(path: Path) -> list[FilePosition]:
    """The lines of a CSV."""
    try:
        text = read_bytes(path, growth=20.0).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no text ({error.reason}); save the table as CSV in UTF-8") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1)]
    lines = [(number, line) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(f"{path}: holds no lines; expected the headings file, tx_x, tx_y ... and a line for each file")
    number, heading = lines[0]
    delimiter = next((mark for mark in (";", "\t") if mark in heading), ",")
    headings = [cell.strip() for cell in _cells(path, number, heading, delimiter)]
    columns = [_heading(path, number, cell) for cell in headings]
    names = [name for name, _ in columns]
    twice = sorted(name for name, count in Counter(names).items() if count > 1 and name)
    if "file" not in names or twice:
        problem = f"names {', '.join(twice)} twice" if twice else "has no column 'file'"
        raise InputError(f"{path}: line {number}, {heading[:80]!r}, {problem}; expected file, tx_x, tx_y ... once each")
    result = []
    for number, line in lines[1:]:
        cells = _cells(path, number, line, delimiter)
        if len(cells) != len(columns):
            raise InputError(f"{path}: line {number}, {line[:80]!r}, has {len(cells)} columns, expected {len(columns)}")
        numbers: dict[str, float] = {}
        file = ""
        for cell, (name, unit), title in zip(cells, columns, headings, strict=True):
            if name == "file":
                file = cell.strip()
            elif name:
                value = parse_number(cell, decimal_comma=delimiter != ",")
                if not isinstance(value, float) or not np.isfinite(value):
                    raise InputError(f"{path}: line {number} holds {cell[:40]!r} as {title}, expected a number")
                numbers[name] = unit * value
        if not file:
            raise InputError(f"{path}: line {number}, {line[:80]!r}, names no file")
        result.append(FilePosition(file, f"{path}: line {number}", numbers))
    return result


def _cells(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """The cells of a line of a CSV."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{path}: line {number}, {line[:80]!r}, is no line of a CSV ({error})") from None


HEADING = re.compile(r"^([a-z_ ]+?)[ _]*(?:[\[(]\s*(\w+)\s*[\])]|_(mm|cm|um|m|inch|in|degree|deg|radian|rad))?$")


def _heading(path: Path, number: int, cell: str) -> tuple[str, float]:
    """Name of a column, and the factor of its unit; the name is empty for columns that are not needed."""
    text = cell.strip().strip('"').lower()
    if text in FILE_NAMES:
        return "file", 1.0
    match = HEADING.match(text) if len(text) <= LONGEST_CELL else None
    known = {name for group in COLUMNS_BY_KIND.values() for name in group}
    name = match[1].strip().replace(" ", "_") if match else ""
    name = {"az": "azimuth", "el": "elevation"}.get(name, name)
    if match is None or name not in known:
        if re.match(r"^(tx|rx|[xyz]|az|el)([_ \[(]|$)", text):
            raise InputError(
                f"{path}: line {number} has the heading {cell.strip()!r}, which is not understood; expected one of "
                f"{', '.join(sorted(known))}, with a unit such as tx_x_mm"
            )
        return "", 1.0
    said = match[2] or match[3]
    expected = KINDS["angle" if name in ANGLES else "length"]
    unit = unit_named(said) if said else None
    if said and unit not in expected:
        raise InputError(
            f"{path}: line {number} has the heading {cell.strip()!r} with the unit {said!r}, expected one of "
            f"{', '.join(expected)}"
        )
    return name, UNITS[unit] if unit else 1.0


PLACEHOLDER = re.compile(r"\{(\w+)\}")


def match_pattern(path: Path, scan: Scan, names: Sequence[str]) -> list[FilePosition]:
    """The lines of a scan from the names of its files, by the pattern `scan.files`; other files are ignored.

    Raises
    ------
    InputError
        If the pattern is not understood, fits no file, or a number in a file name has no place.
    """
    assert scan.files is not None
    known = {*INDICES, *(name for group in COLUMNS_BY_KIND.values() for name in group)}
    held = PLACEHOLDER.findall(scan.files)
    if not held or not set(held) <= known or len(set(held)) != len(held):
        raise InputError(
            f"{path}: files is {scan.files!r}, expected a pattern with placeholders such as {{tx}} and {{rx}}, each "
            f"once; known are {', '.join(sorted(known))}"
        )
    pieces = PLACEHOLDER.split(scan.files)
    digits = {name: r"\d+" if name in INDICES else r"[-+]?\d+(?:\.\d+)?" for name in held}
    expression = "".join(
        re.escape(piece) if n % 2 == 0 else f"(?P<{piece}>{digits[piece]})" for n, piece in enumerate(pieces)
    )
    pattern = re.compile(expression)
    quantities = Quantities(Contents(path, "table", {}))
    places: dict[str, NDArray[np.float64]] = {}
    for name, given in (("tx", scan.tx), ("rx", scan.rx), ("position", scan.antenna)):
        if given is not None:
            places[name] = quantities.places(given, name)
        elif name in held:
            raise InputError(
                f"{path}: files holds {{{name}}} and {'antenna' if name == 'position' else name} is missing"
            )
    lines = []
    for file in names:
        match = pattern.fullmatch(file)
        if match is None:
            continue
        numbers: dict[str, float] = {}
        for name, text in match.groupdict().items():
            if name not in INDICES:
                numbers[name] = float(text) * (1.0 if name in ANGLES else UNITS[scan.unit])
                continue
            index = int(text[:18]) - scan.base
            if not 0 <= index < len(places[name]):
                raise InputError(
                    f"{path}: the file {file} says number {text} of {name}, and there are {len(places[name])} places, "
                    f"counted from {scan.base}"
                )
            prefix = "" if name == "position" else f"{name}_"
            numbers |= {f"{prefix}{axis}": float(v) for axis, v in zip("xyz", places[name][index], strict=True)}
        lines.append(FilePosition(file, f"{path}: {file}", numbers))
    if not lines:
        raise InputError(f"{path}: none of {len(names)} files fits the pattern {scan.files!r}, not {names[:1]}")
    return lines


def arrangement_of(path: Path, lines: Sequence[FilePosition]) -> tuple[str, NDArray[np.float64]]:
    """What the lines describe, "pair", "position" or "beam", and their coordinates in the order of `COLUMNS_BY_KIND`.

    Raises
    ------
    InputError
        If there is no line, or one has no complete place, or describes something other than the first.
    """
    if not lines:
        raise InputError(f"{path}: names no file; add a line for each")

    def kind(line: FilePosition) -> str:
        sides = {name[:2] for name in line.numbers if name[:3] in ("tx_", "rx_")}
        alone = {name for name in line.numbers if name[:3] not in ("tx_", "rx_")}
        if (sides and alone) or (alone & set(ANGLES) and alone - set(ANGLES)):
            raise InputError(
                f"{line.where}: gives {', '.join(line.numbers)} for {line.file}; keep to tx and rx, or to x, y and z, "
                "or to azimuth and elevation"
            )
        if alone & set(ANGLES):
            return "beam"
        if sides == {"tx", "rx"}:
            return "pair"
        if not sides and line.numbers:
            return "position"
        missing = f"no place of {'rx' if sides == {'tx'} else 'tx'}" if sides else "no place"
        raise InputError(
            f"{line.where}: gives {missing} for {line.file}; expected tx and rx, or x, y and z, or azimuth and "
            "elevation"
        )

    first = kind(lines[0])
    for line in lines:
        if kind(line) != first:
            raise InputError(f"{line.where}: describes a {kind(line)}, and the lines before it a {first}; keep to one")
    return first, np.array([[line.numbers.get(name, 0.0) for name in COLUMNS_BY_KIND[first]] for line in lines])


__all__ = ["FilePosition", "Row", "Scan", "arrangement_of", "match_pattern", "read_positions"]
