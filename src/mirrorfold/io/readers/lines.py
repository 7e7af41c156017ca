"""The lines of text tables: marks between cells, headings, comments, encodings and numbers.

Columns are separated by commas, semicolons, tabs, bars or blanks; with semicolons, tabs or bars, numbers may have
decimal commas. Lines that begin with one of ``# ! % //`` are comments; the last line of words before the numbers holds
the headings, or if none does, the last comment. Headings may be separated by another mark than the numbers.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from mirrorfold.errors import InputError

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


class Begun(NamedTuple):
    """Where the numbers of a text table begin.

    Attributes
    ----------
    lines : list of (int, str)
        The lines that hold numbers, with their number in the file.
    headings : list of str
        Empty if there is not one for each column.
    cells : list of str
        Those of the first line.
    delimiter : str
        The mark that separates the columns; a blank for any white space.
    """

    lines: list[tuple[int, str]]
    headings: list[str]
    cells: list[str]
    delimiter: str


def begun(path: Path, raw: bytes) -> Begun:
    """Find where the numbers of a text table begin.

    Raises
    ------
    InputError
        If no line holds numbers.
    """
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
    # np.savetxt writes its header as it is given, often with other marks than those of the numbers.
    marks = dict.fromkeys([delimiter, *map(_delimiter, before), " "])
    named = [[name.strip("\"' ,;") for name in _headings(line, mark)] for mark in marks for line in before]
    headings = next((names for names in named if len(names) == len(cells) > _numbers(names)), [])
    return Begun(lines[first:], headings, cells, delimiter)


def _is_frame(line: str) -> bool:
    """Whether a line is one of those before and after the data of Keysight's analysers."""
    return line.split(None, 1)[0].upper().rstrip(",;") in FRAMES


def _begins_with_number(line: str) -> bool:
    """Whether the first two cells of a line are numbers."""
    delimiter = _delimiter(line)
    return all(number_in(cell, delimiter) is not None for cell in split(line, delimiter)[:2])


def _holds_words(headings: str, line: str) -> bool:
    """Whether a line holds numbers beside words, under a line with a heading for each column."""
    delimiter = _delimiter(line)
    cells = split(line, delimiter)
    names = _headings(headings, delimiter)
    return len(names) == len(cells) and _numbers(cells, delimiter) >= FEWEST_NUMBERS > _numbers(names)


def _numbers(cells: list[str], delimiter: str = ",") -> int:
    """How many cells hold a number."""
    return sum(number_in(cell, delimiter) is not None for cell in cells)


def number_in(cell: str, delimiter: str = ",") -> float | complex | None:
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
