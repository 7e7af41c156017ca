"""Text tables: CSV with complex numbers as ``a+bi``, in two columns, or as magnitude and phase, and the CSV exports of
network analysers (Rohde & Schwarz, Keysight and others).

`lines` tells where the numbers begin. Columns of words whose headings are not understood are left out.
"""

from __future__ import annotations

import re
import warnings
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.decibels import ratio_of
from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader, pair_tables
from mirrorfold.io.readers.contents import Contents, Spectra, Variable, read_bytes
from mirrorfold.io.readers.lines import LONGEST_CELL, UTF_16, begun, number_in, parse_number, split
from mirrorfold.io.readers.phases import phase_unit

GROWTH = 30.0
"""Memory that the numbers of a text file take while they are read, as a multiple of its size."""

SUFFIXES = (".csv", ".txt")

HEAD_BYTES = 1 << 16
"""Number of first bytes of a table in which its headings are looked for."""

UNITS = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9, "thz": 1e12}

FREQUENCY = re.compile(
    r"^\W*(?:f|freq|frequency|frequencies|stimulus)\.?\s*(?:[\[(/_]?\s*([kmgt]?hz)\s*[\])]?)?\W*$", re.IGNORECASE
)

KINDS = (
    ("db", r"db|log\s*mag|dbmag"),
    ("radian", r"rad(ians?)?"),
    ("degree", r"deg(rees?)?"),
    ("phase", r"ang(le)?|phase|uphase"),
    ("real", r"s?re(al)?"),
    ("imaginary", r"s?im(ag(inary)?)?"),
    ("magnitude", r"mag(nitude)?|lin(ear)?(\s*mag)?|abs|amplitude"),
)
"""What a column holds, by patterns of its heading, in the order in which they are tried: ``S21 Log Mag(dB)`` is in
decibels. A phase is in degrees unless the heading names radians, or its values cover a circle of 2 pi."""

HALVES = {
    "real": "real parts", "imaginary": "imaginary parts", "magnitude": "magnitudes", "db": "magnitudes",
    "degree": "phases", "radian": "phases", "phase": "phases",
}  # fmt: skip
"""What a column of each kind holds, in words."""

PARAMETER = re.compile(
    r"(?<![a-z])tx[\s_]*(?P<tx>\d+)[\s_,]*rx[\s_]*(?P<rx>\d+)|(?<![a-z])rx[\s_]*(?P<to>\d+)[\s_,]*tx[\s_]*(?P<of>\d+)|"
    r"S\s*[_\[(]?\s*(?:(\d+)\s*[,_]\s*(\d+)|(\d)(\d)(?!\d))[\])]?",
    re.IGNORECASE,
)
"""A pair in a heading: ``tx12_rx3`` or ``rx3_tx12``, or ``S_3_12``, which was received by 3 from 12."""

WORD = r"(?<![a-z])(?:{})(?![a-z])"


@dataclass(frozen=True)
class Table:
    """A table of numbers with headings.

    Attributes
    ----------
    headings : list of str
        Empty if there is not one for each column.
    values : (rows, columns) array
        Real, or complex if one of the cells is.
    words : list of str
        Headings of the columns that hold no numbers and are left out.
    """

    headings: list[str]
    values: NDArray
    words: list[str]


def read(path: Path) -> Contents:
    """Read a text table: a variable ``table``, one for each column with a heading, and those of a table of pairs."""
    table = read_table(path)
    spectra, unknown, halves = _spectra(path, table)
    table_sweep = pair_tables.sweep_of_wide_table(spectra) if spectra is not None else None
    if spectra is not None and table_sweep is None and len(spectra.parameters) == 1:
        samples = next(iter(spectra.parameters.values()))
        table_sweep = pair_tables.sweep_of_long_table(path, table.headings, table.values, spectra.frequency, samples)
        spectra = None if table_sweep is not None else spectra
    variables = {} if table_sweep is None else dict(table_sweep.variables)
    variables.setdefault("table", Variable.of(table.values))
    for n, heading in enumerate(table.headings):
        variables.setdefault(heading, Variable.of(table.values[:, n]))
    attrs = {
        "unknown headings": [*table.words, *(heading for heading in unknown if not pair_tables.is_known(heading))],
        "halves": halves,
    }
    mapping = None if table_sweep is None else table_sweep.mapping
    return Contents(path, READER.name, variables, attrs, spectra=spectra, mapping=mapping)


def read_table(path: Path) -> Table:
    """Read the numbers of a text table.

    Raises
    ------
    InputError
        If a line holds something else, or has another number of columns; the message tells the line.
    """
    lines, headings, cells, delimiter = begun(path, read_bytes(path, growth=GROWTH))
    words = {
        n for n, name in enumerate(headings) if number_in(cells[n], delimiter) is None and not _is_understood(name)
    }
    rows: list[list[complex]] = []
    is_complex, decimal_comma = False, delimiter != ","
    for number, line in lines:
        found = split(line, delimiter)
        if len(found) != len(cells):
            raise InputError(f"{path}: line {number} has {len(found)} columns, expected {len(cells)} as before")
        values = []
        for cell in [cell for n, cell in enumerate(found) if n not in words] if words else found:
            value = parse_number(cell, decimal_comma=decimal_comma)
            if value is None:
                raise InputError(f"{path}: line {number} holds {cell[:40]!r}, expected a number")
            is_complex = is_complex or isinstance(value, complex)
            values.append(value)
        rows.append(values)
    return Table(
        [name for n, name in enumerate(headings) if n not in words],
        np.array(rows, complex if is_complex else float),
        [headings[n] for n in sorted(words)],
    )


def headings_of(path: Path) -> list[str]:
    """The headings of a text table, from its first bytes; empty if it has none, or cannot be read as a table."""
    with suppress(InputError, OSError):
        if path.suffix.lower() in SUFFIXES:
            with path.open("rb") as file:
                return begun(path, file.read(HEAD_BYTES)).headings
    return []


def _is_understood(heading: str) -> bool:
    """Whether a heading names a frequency, a part of a sample, an antenna or a place."""
    text = heading[:LONGEST_CELL]
    known = FREQUENCY.match(text) or PARAMETER.search(text) or pair_tables.is_known(text)
    return bool(known or _kind(text)[0] is not None)


def _spectra(path: Path, table: Table) -> tuple[Spectra | None, list[str], dict[str, str]]:
    """The spectra of a table whose headings name a frequency and columns that make complex numbers.

    Returns
    -------
    spectra : Spectra or None
    unknown : list of str
        Headings that are not understood.
    halves : dict
        For each column that is half a complex number, such as a magnitude without phase: by heading, what it holds.

    Raises
    ------
    InputError
        If the frequencies are complex, or two columns hold the same pair of antennas.
    """
    short = [(n, heading) for n, heading in enumerate(table.headings) if len(heading) <= LONGEST_CELL]
    found = [(n, match) for n, heading in short if (match := FREQUENCY.match(heading))]
    if not found:
        return None, table.headings, {}
    at, match = found[0]
    if np.iscomplexobj(table.values) and np.any(table.values[:, at].imag):
        raise InputError(f"{path}: the frequencies are complex; put them into a column of their own")
    frequency = table.values[:, at].real * UNITS[(match[1] or "hz").lower()]
    others = {
        n: heading
        for n, heading in enumerate(table.headings)
        if n != at and (not pair_tables.is_known(heading) or table.values[:, n].imag.any())
    }
    taken = {n: heading for n, heading in others.items() if _is_complex(heading, table.values[:, n])}
    if taken and np.iscomplexobj(table.values):
        columns: dict[str, int] = {}
        for n, heading in taken.items():
            if columns.setdefault(_name(heading), n) != n:
                raise _twice(path, table.headings[columns[_name(heading)]], heading)
        unknown = [heading for n, heading in others.items() if n not in taken]
        return Spectra(frequency, {name: table.values[:, n] for name, n in columns.items()}), unknown, {}
    parts: dict[str, dict[str, NDArray[np.float64]]] = {}
    unknown = []
    whose: dict[tuple[str, str], str] = {}
    for n, heading in others.items():
        kind, name = _kind(heading)
        if kind is not None and whose.get((name, kind)) == heading and PARAMETER.search(heading):
            raise _twice(path, heading, heading)
        if kind is None or kind in parts.get(name, {}):
            unknown.append(heading)
            continue
        parts.setdefault(name, {})[kind] = table.values[:, n]
        whose[name, kind] = heading
    phases = {name: columns["phase"] for name, columns in parts.items() if "phase" in columns}
    unit = usual_phase_unit(path, np.concatenate([*phases.values()])) if phases else "degree"  # one for all columns
    made = {name: _complex(columns, unit) for name, columns in parts.items()}
    halves = {heading: HALVES[kind] for (name, kind), heading in whose.items() if made[name] is None}
    complete = {name: values for name, values in made.items() if values is not None}
    return (Spectra(frequency, complete, phases) if complete else None), unknown, halves


def _twice(path: Path, first: str, second: str) -> InputError:
    """The error for two columns of one pair of antennas, or of one scattering parameter."""
    return InputError(f"{path}: the columns {first!r} and {second!r} hold the same pair; rename one, or leave it out")


def _is_complex(heading: str, values: NDArray) -> bool:
    """Whether a column holds complex samples: by its values, or in a dead channel by its heading, such as S_1_2."""
    return bool(values.imag.any()) or (PARAMETER.search(heading[:LONGEST_CELL]) is not None and not _kind(heading)[0])


def _kind(heading: str) -> tuple[str | None, str]:
    """The kind of a column, one of `KINDS` or None, and the name of its parameter."""
    if len(heading) > LONGEST_CELL:
        return None, heading
    for kind, words in KINDS:
        pattern = re.compile(WORD.format(words), re.IGNORECASE)
        if pattern.search(heading):
            rest = heading
            for _, others in KINDS:
                rest = re.sub(WORD.format(others), " ", rest, flags=re.IGNORECASE)
            return kind, _name(rest)
    return None, heading


def _name(text: str) -> str:
    """The parameter that a heading names, such as "S21", else the words that are left of the heading."""
    match = PARAMETER.search(text)
    if match:
        out, into = (int(part) for part in match.groups() if part)
        if match["tx"]:
            out, into = into, out
        return f"S{out}{into}" if max(out, into) < 10 else f"S{out},{into}"
    return re.sub(r"[^A-Za-z0-9]+", " ", text).strip() or "s"


def usual_phase_unit(path: Path, phase: NDArray[np.float64]) -> str:
    """The unit of phases whose heading names none: degrees, or with a warning radians."""
    if phase_unit("", phase) != "radian":
        return "degree"
    warnings.warn(
        f"{path}: the phases are taken for radians, as all lie within a circle of 2 pi; if they are degrees, say so in "
        "the heading, as in phase_deg",
        stacklevel=2,
    )
    return "radian"


def _complex(columns: dict[str, NDArray[np.float64]], unit: str) -> NDArray[np.complex128] | None:
    """Complex samples from columns by kind; None where these are not both parts of complex numbers.

    `unit` is that of phases whose heading names none.
    """
    if "phase" in columns:
        columns = {**columns, unit: columns["phase"]}
    if {"real", "imaginary"} <= set(columns):
        return np.asarray(columns["real"] + 1j * columns["imaginary"])
    angle = columns.get("radian", np.radians(columns["degree"]) if "degree" in columns else None)
    size = columns.get("magnitude", ratio_of(columns["db"]) if "db" in columns else None)
    return None if angle is None or size is None else np.asarray(size * np.exp(1j * angle))


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is text."""
    return b"\0" not in head or head.startswith(UTF_16)


READER = Reader("table", "text tables: complex CSV, and the CSV of network analysers", recognises, read, SUFFIXES)
