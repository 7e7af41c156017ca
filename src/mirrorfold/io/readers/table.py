"""Text tables: CSV with complex numbers as ``a+bi``, in two columns, or as magnitude and phase, and the CSV exports of
network analysers (Rohde & Schwarz, Keysight and others).

Columns are separated by commas, semicolons, tabs, bars or blanks; with semicolons, tabs or bars, numbers may have
decimal commas. Lines that begin with one of ``# ! % //`` are comments; the last line of words before the numbers holds
the headings, or if none does, the last comment. Columns of words whose headings are not understood are left out.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader, pair_tables
from mirrorfold.io.readers.contents import Contents, Spectra, Variable, read_bytes
from mirrorfold.io.readers.phases import phase_unit

GROWTH = 30.0
"""Memory that the numbers of a text file take while they are read, as a multiple of its size."""

SUFFIXES = (".csv", ".txt")

COMMENTS = ("#", "!", "%", "//")

UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of texts in UTF-16, as Windows writes them."""

FEWEST_NUMBERS = 2
"""Least count of numbers in a line that begins with words."""

FRAMES = ("BEGIN", "END")
"""First words of the lines before and after the data of Keysight's analysers."""

NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf(?:inity)?)"
REAL = re.compile(NUMBER, re.IGNORECASE)
UNIT_IN_FRONT = re.compile(rf"({NUMBER})([+-])[ijIJ]\*?({NUMBER})", re.IGNORECASE)

LONGEST_CELL = 200
"""Largest number of letters of a number, or of a heading that is searched for its meaning; the time for this grows with
the square of the length."""

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

PARAMETER = re.compile(r"S\s*[_\[(]?\s*(?:(\d+)\s*[,_]\s*(\d+)|(\d)(\d)(?!\d))[\])]?", re.IGNORECASE)

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
    raw = read_bytes(path, growth=GROWTH)
    wide = raw.startswith(UTF_16)
    if b"\0" in raw and not wide:
        raise InputError(f"{path}: holds binary data, expected a text table; give the file its true name")
    text = raw.decode("utf-16" if wide else "utf-8-sig", "replace")
    every = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(number, line) for number, line in every if not line.startswith(COMMENTS) and not _is_frame(line)]
    first = next((n for n, (_, line) in enumerate(lines) if _begins_with_number(line)), None)
    for n in range(1, len(lines)) if first is None else range(max(first - 1, 1), first):
        if _holds_words(lines[n - 1][1], lines[n][1]):
            first = n
            break
    if first is None:
        raise InputError(f"{path}: holds no line of numbers; export the samples as a table")
    delimiter = _delimiter(lines[first][1])
    cells = split(lines[first][1], delimiter)
    before = [lines[first - 1][1]] if first else []
    before += [line.lstrip("#!%/ ") for number, line in every if number < lines[first][0]][-1:]
    named = [[heading.strip("\"' ") for heading in _headings(line, delimiter)] for line in before]
    headings = next((names for names in named if len(names) == len(cells) > _numbers(names)), [])
    words = {n for n, name in enumerate(headings) if _number(cells[n], delimiter) is None and not _is_understood(name)}
    rows: list[list[complex]] = []
    is_complex, decimal_comma = False, delimiter != ","
    for number, line in lines[first:]:
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


def _is_frame(line: str) -> bool:
    """Whether a line is one of those before and after the data of Keysight's analysers."""
    return line.split(None, 1)[0].upper().rstrip(",;") in FRAMES


def _begins_with_number(line: str) -> bool:
    """Whether the first two cells of a line are numbers."""
    delimiter = _delimiter(line)
    return all(_number(cell, delimiter) is not None for cell in split(line, delimiter)[:2])


def _holds_words(headings: str, line: str) -> bool:
    """Whether a line holds numbers beside words, under a line with a heading for each column."""
    delimiter = _delimiter(line)
    cells = split(line, delimiter)
    names = _headings(headings, delimiter)
    return len(names) == len(cells) and _numbers(cells, delimiter) >= FEWEST_NUMBERS > _numbers(names)


def _is_understood(heading: str) -> bool:
    """Whether a heading names a frequency, a part of a sample, an antenna or a place."""
    text = heading[:LONGEST_CELL]
    known = FREQUENCY.match(text) or PARAMETER.search(text) or pair_tables.is_known(text)
    return bool(known or _kind(text)[0] is not None)


def _numbers(cells: list[str], delimiter: str = ",") -> int:
    """How many cells hold a number."""
    return sum(_number(cell, delimiter) is not None for cell in cells)


def _number(cell: str, delimiter: str = ",") -> float | complex | None:
    """The number in a cell, whose decimal mark may be a comma unless commas separate the cells."""
    return parse_number(cell, decimal_comma=delimiter != ",")


def _delimiter(line: str) -> str:
    """The mark that separates the columns of a line; a blank for any white space."""
    return next((mark for mark in (";", "\t", "|", ",") if mark in line), " ")


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line; a mark at its end is ignored."""
    if delimiter == " ":
        return line.split()
    return [cell.strip().strip('"') for cell in line.rstrip(delimiter + " ").split(delimiter)]


def _headings(line: str, delimiter: str) -> list[str]:
    """The cells of a line of headings; marks within parentheses, as in ``S(2,1)``, separate no cells."""
    if delimiter == " ":
        return line.split()
    line = line.rstrip(delimiter + " ")
    pieces, end, inside = [], len(line), False
    for at in range(len(line) - 1, -1, -1):
        if line[at] in "()[]":
            inside = line[at] in ")]"
        elif line[at] == delimiter and not inside:
            pieces.append(line[at + 1 : end])
            end = at
    return [piece.strip().strip('"') for piece in (line[:end], *reversed(pieces))]


def parse_number(cell: str, *, decimal_comma: bool = False) -> float | complex | None:
    """A real or complex number, as Python, MATLAB and others write it; None for anything else.

    Examples
    --------
    >>> parse_number("-0.25-4e-3i"), parse_number("(1+2j)"), parse_number("1.5"), parse_number("1+j2")
    ((-0.25-0.004j), (1+2j), 1.5, (1+2j))
    """
    text = cell.replace(" ", "").strip("()")
    if len(text) > LONGEST_CELL:
        return None
    if decimal_comma:
        text = text.replace(",", ".")
    if REAL.fullmatch(text):
        return float(text)
    in_front = UNIT_IN_FRONT.fullmatch(text)
    if in_front:
        text = f"{in_front[1]}{in_front[2]}{in_front[3]}j"
    if text.isascii() and text[-1:] in ("i", "j", "I", "J") and "_" not in text:
        try:
            return complex(text[:-1].rstrip("*") + "j")
        except ValueError:
            return None
    return None


def _spectra(path: Path, table: Table) -> tuple[Spectra | None, list[str], dict[str, str]]:
    """The spectra of a table whose headings name a frequency and columns that make complex numbers.

    Returns
    -------
    spectra : Spectra or None
    unknown : list of str
        Headings that are not understood.
    halves : dict
        For each column that is half a complex number, such as a magnitude without phase: by heading, what it holds.
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
        unknown = [heading for n, heading in others.items() if n not in taken]
        return Spectra(frequency, {_name(heading): table.values[:, n] for n, heading in taken.items()}), unknown, {}
    parts: dict[str, dict[str, NDArray[np.float64]]] = {}
    unknown = []
    whose: dict[tuple[str, str], str] = {}
    for n, heading in others.items():
        kind, name = _kind(heading)
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
    size = columns.get("magnitude", 10.0 ** (columns["db"] / 20.0) if "db" in columns else None)
    return None if angle is None or size is None else np.asarray(size * np.exp(1j * angle))


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is text."""
    return b"\0" not in head or head.startswith(UTF_16)


READER = Reader("table", "text tables: complex CSV, and the CSV of network analysers", recognises, read, SUFFIXES)
