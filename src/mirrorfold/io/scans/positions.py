"""The positions of the antennas for each file of a scan, from a table (CSV) or a description (TOML or JSON)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from mirrorfold.common.reading import named_file
from mirrorfold.common.units import UNITS, Quantity
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.model import Coordinate, Finite, Places, Row, Strict, Unit, in_one_unit
from mirrorfold.io.mapping.quantities import Quantities
from mirrorfold.io.mapping.strict import read_written, validated
from mirrorfold.io.readers import Contents
from mirrorfold.io.scans.position_tables import (
    ANGLES,
    COLUMNS_BY_KIND,
    FILE_NAMES,
    FilePosition,
    places_of_antennas,
    read_table,
)

INDICES = ("tx", "rx", "position")
"""Placeholders in a pattern of file names that stand for the number of a place."""

LISTS = ("file", "files", "measurements", "records", "entries")
"""Names of the list of files, also in descriptions of other origin."""


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
            return scan, _lines_of_files(named_file(path, scan.table, "table"))
        if scan.file is not None:
            return scan, [_of_entry(path, n, entry, scan.unit) for n, entry in enumerate(scan.file)]
        return scan, None
    kind, lines = read_table(path)
    if kind == "antenna":
        return validated(Scan, places_of_antennas(path, lines), str(path)), None
    return Scan(table=path.name), lines


def _lines_of_files(path: Path) -> list[FilePosition]:
    """The lines of a table that a description names."""
    kind, lines = read_table(path)
    if kind == "antenna":
        raise InputError(f"{path}: is a table of antennas; give it by itself, or the antennas in the description")
    return lines


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
