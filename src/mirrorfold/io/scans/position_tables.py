"""Tables (CSV) of positions: a line for each file of a scan, or a line for each antenna of one file with all pairs.

A table of files has a column ``file`` (a name, or a pattern with ``*`` that fits one file) and the columns
``tx_x, tx_y, tx_z, rx_x, rx_y, rx_z``; or ``x, y, z`` of one antenna that transmits and receives; or
``azimuth, elevation`` of a beam. A table of antennas has a column ``antenna``, with ``tx1, tx2 ... rx1, rx2 ...``, or
with numbers alone if each antenna transmits and receives, and the columns ``x, y, z``. Coordinates that are left out
are zero. A unit is part of the heading, as in ``tx_x_mm`` or ``tx_x [mm]``, or follows each number. Columns with other
headings are left out, with a warning; a heading that looks like that of a place is refused.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mirrorfold.common.units import KINDS, UNITS, mixes_units, parse_quantity, unit_named
from mirrorfold.errors import InputError
from mirrorfold.io.readers.contents import left_out, read_bytes
from mirrorfold.io.readers.lines import LONGEST_CELL, parse_number

COLUMNS_BY_KIND = {
    "pair": ("tx_x", "tx_y", "tx_z", "rx_x", "rx_y", "rx_z"),
    "position": ("x", "y", "z"),
    "beam": ("azimuth", "elevation"),
}
"""Columns by what they describe: the places of a pair, the position of one antenna, or the direction of a beam."""

ANGLES = COLUMNS_BY_KIND["beam"]

FILE_NAMES = ("file", "filename", "file_name", "name", "path")
"""Names of the entry with the file, also in tables of other origin."""

ANTENNA_NAMES = ("antenna", "element", "port", "channel")
"""Headings of the column that names the antenna of a line."""


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


def read_table(path: Path) -> tuple[str, list[FilePosition]]:
    """Read a CSV.

    Returns
    -------
    kind : {"file", "antenna"}
        What a line stands for.
    lines : list of FilePosition
        In a table of antennas, `file` is the name of the antenna.

    Raises
    ------
    InputError
        If the text is no such table; the message tells the line.
    """
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
    headings = [cell.strip().strip('"') for cell in _cells(path, number, heading, delimiter)]
    columns = [_heading(path, number, cell) for cell in headings]
    kind = _kind(f"{path}: line {number}, {heading[:80]!r}", [name for name, _ in columns])
    unknown = [cell[:LONGEST_CELL] for cell, (name, _) in zip(headings, columns, strict=True) if cell and not name]
    if unknown:
        warnings.warn(left_out(path, unknown), stacklevel=4)
    result, rows = [], []
    for number, line in lines[1:]:
        where = f"{path}: line {number}"
        cells = _cells(path, number, line, delimiter)
        if len(cells) != len(columns):
            raise InputError(f"{where}, {line[:80]!r}, has {len(cells)} columns, expected {len(columns)}")
        numbers: dict[str, float] = {}
        label = ""
        for cell, (name, unit), title in zip(cells, columns, headings, strict=True):
            if name == kind:
                label = cell.strip()
            elif name in UNIT_KINDS:
                numbers[name] = _number(cell, f"{where} holds {cell[:40]!r} as {title}", name, unit or 1.0, delimiter)
        if not label:
            raise InputError(f"{where}, {line[:80]!r}, names no {kind}")
        result.append(FilePosition(label, where, numbers))
        rows.append(cells)
    for title, (name, unit), *column in zip(headings, columns, *rows, strict=True):
        if name in UNIT_KINDS and unit is None and mixes_units(column):
            raise InputError(
                f"{path}: the column {title!r} gives some numbers a unit and others none; give all the same, in the "
                f"heading, as in {name}_{'deg' if name in ANGLES else 'mm'}"
            )
    return kind, result


def _number(cell: str, found: str, name: str, unit: float, delimiter: str) -> float:
    """The number in a cell, in SI units; `unit` is the factor of a number without a unit of its own.

    Raises
    ------
    InputError
        If it is no finite number, or its unit is of another kind; the sentence begins with `found`.
    """
    value = parse_number(cell, decimal_comma=delimiter != ",")
    if isinstance(value, float):
        result = unit * value
    else:
        try:
            result = parse_quantity(cell if delimiter == "," else cell.replace(",", "."), UNIT_KINDS[name])
        except InputError:
            result = np.nan
    if not np.isfinite(result):
        raise InputError(f"{found}, expected a number, which may have a unit: {', '.join(KINDS[UNIT_KINDS[name]])}")
    return result


def _kind(where: str, names: Sequence[str]) -> str:
    """What the lines of a table with these columns stand for, "file" or "antenna"; "" are columns not needed."""
    expected = "expected file, tx_x, tx_y ... once each, or, for one file with all pairs, antenna, x, y ..."
    unused = {"", "antenna"} if "file" in names else {""}
    twice = sorted(name for name, count in Counter(names).items() if count > 1 and name not in unused)
    if twice:
        raise InputError(f"{where}, names {', '.join(twice)} twice; {expected}")
    if "file" in names:
        if not set(names) & set(UNIT_KINDS):
            raise InputError(f"{where}, has no column of places that is understood; {expected}")
        return "file"
    if "antenna" not in names:
        raise InputError(f"{where}, has no column 'file'; {expected}")
    if not set(names) & set(COLUMNS_BY_KIND["position"]):
        raise InputError(f"{where}, has no column x, y or z; {expected}")
    return "antenna"


def _cells(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """The cells of a line of a CSV."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{path}: line {number}, {line[:80]!r}, is no line of a CSV ({error})") from None


UNIT_KINDS = {
    name: "angle" if kind == "beam" else "length" for kind, group in COLUMNS_BY_KIND.items() for name in group
}
"""The columns of numbers, and what their unit measures."""

UNIT_AT_END = re.compile(r"[\[(]\s*(\w+)\s*[\])]$|_(mm|cm|um|m|inch|in|degree|deg|radian|rad)$")

LIKE_A_PLACE = re.compile(r"^(tx|rx)|^([xyz]|az|el)([_ \[(]|$)")
"""Beginning of a heading that is probably meant as that of a place or a direction."""


def _heading(path: Path, number: int, cell: str) -> tuple[str, float | None]:
    """Name of a column, empty if it is left out, and the factor of its unit, None if the heading names none."""
    text = cell.lower()[:LONGEST_CELL]
    for name, others in (("file", FILE_NAMES), ("antenna", ANTENNA_NAMES)):
        if text in others:
            return name, None
    match = UNIT_AT_END.search(text)
    said = (match[1] or match[2]) if match else None
    unit = unit_named(said) if said else None
    name = (text[: match.start()] if match else text).strip(" _").replace(" ", "_")
    name = {"az": "azimuth", "el": "elevation"}.get(name, re.sub(r"^([tr]x)([xyz])$", r"\1_\2", name))
    if name not in UNIT_KINDS:
        if LIKE_A_PLACE.match(text) or unit in KINDS["length"] or unit in KINDS["angle"]:
            raise InputError(
                f"{path}: line {number} has the heading {cell[:LONGEST_CELL]!r}, which is not understood; expected one "
                f"of {', '.join(sorted(UNIT_KINDS))}, with a unit such as tx_x_mm; rename it, or leave the column out"
            )
        return "", None
    expected = KINDS[UNIT_KINDS[name]]
    if said and unit not in expected:
        raise InputError(
            f"{path}: line {number} has the heading {cell!r} with the unit {said!r}, expected one of "
            f"{', '.join(expected)}"
        )
    return name, UNITS[unit] if unit else None


ANTENNA = re.compile(r"(?:(?P<side>t|tx|transmitter|r|rx|receiver)(?![a-z]))?[ _-]*(?P<number>\d{1,9})?", re.IGNORECASE)
"""Name of an antenna: what it does, "" for both, and its number."""


def places_of_antennas(path: Path, lines: Sequence[FilePosition]) -> dict[str, Any]:
    """The places of the antennas in a table of antennas, as in the description of a scan.

    Parameters
    ----------
    path : Path
        Of the table, for messages.
    lines : sequence of FilePosition
        In the order of the antennas, or in any order if their names have numbers.

    Returns
    -------
    dict
        The places of `tx` and `rx`, or of `ports` if each antenna transmits and receives.

    Raises
    ------
    InputError
        If the name of an antenna is not understood or given twice, or only transmitters or receivers are there.
    """
    expected = "expected tx1, tx2 ... and rx1, rx2 ..., or numbers alone if each antenna transmits and receives"
    found: dict[str, list[tuple[int, tuple[float, ...]]]] = {}
    numbered = set()
    for line in lines:
        match = ANTENNA.fullmatch(line.file)
        if match is None:
            raise InputError(f"{line.where} names the antenna {line.file[:40]!r}; {expected}")
        side = {"t": "tx", "r": "rx"}.get((match["side"] or "")[:1].lower(), "ports")
        place = tuple(line.numbers.get(axis, 0.0) for axis in COLUMNS_BY_KIND["position"])
        those = found.setdefault(side, [])
        number = int(match["number"]) if match["number"] else len(those)
        numbered.add(match["number"] is not None)
        if any(number == other for other, _ in those):
            raise InputError(f"{line.where} names the antenna {line.file[:40]!r} again; name each antenna once")
        those.append((number, place))
    if len(numbered) > 1 or set(found) not in ({"tx", "rx"}, {"ports"}):
        held = ", ".join(sorted({line.file for line in lines})[:4]) or "no line"
        raise InputError(f"{path}: holds the antennas {held}; {expected}, all with a number or none")
    return {side: {"position": [place for _, place in sorted(those)]} for side, those in found.items()}
