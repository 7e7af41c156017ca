"""CITI files (``.cti``, ``.citi``), the common instrument transfer and interchange format of network analysers.

Source: Keysight Technologies, "CITIfile Data Format and Keywords" (Advanced Design System, Using Circuit Simulators).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.decibels import ratio_of
from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Spectra, Variable, read_bytes

GROWTH = 20.0
"""Memory that the numbers of a text file take while they are read, as a multiple of its size."""

SUFFIXES = (".cti", ".citi")


@dataclass
class _Package:
    """One package of a CITI file: independent variables, and data over all of them."""

    sizes: dict[str, int] = field(default_factory=dict)
    values: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    formats: dict[str, str] = field(default_factory=dict)
    data: dict[str, NDArray[np.complex128]] = field(default_factory=dict)


def read(path: Path) -> Contents:
    """Read all packages of a CITI file; the names of the second and later packages end in ``#`` and their number."""
    text = read_bytes(path, growth=GROWTH).decode("latin-1")
    packages = [package for package in _packages(path, enumerate(text.splitlines(), 1), len(text)) if package.data]
    if not packages:
        raise InputError(f"{path}: holds no data, only keywords; export it again")
    variables: dict[str, Variable] = {}
    for number, package in enumerate(packages, 1):
        tail = "" if number == 1 else f"#{number}"
        for name, values in package.values.items():
            variables[name + tail] = Variable.of(values, (name,), {"units": "Hz"} if _is_frequency(name) else {})
        for name, data in package.data.items():
            variables[name + tail] = Variable.of(data, tuple(package.sizes))
    first = packages[0]
    spectra = None
    if len(first.sizes) == 1 and _is_frequency(next(iter(first.sizes))):
        frequency = first.values[next(iter(first.sizes))]
        spectra = Spectra(frequency, {_parameter(name): values for name, values in first.data.items()})
    return Contents(path, READER.name, variables, spectra=spectra)


def _is_frequency(name: str) -> bool:
    """Whether an independent variable is the frequency, by its name."""
    return name.upper().startswith("FREQ")


def _parameter(name: str) -> str:
    """``S21`` from ``S[2,1]``, and ``S10,1`` from ``S[10,1]``."""
    match = re.fullmatch(r"S\[(\d+),(\d+)\]", name.strip(), re.IGNORECASE)
    if match is None:
        return name
    comma = "" if len(match[1] + match[2]) == 2 else ","
    return f"S{match[1]}{comma}{match[2]}"


def _packages(path: Path, lines: Iterator[tuple[int, str]], most: int) -> Iterator[_Package]:
    """The packages one after the other; one with more samples than `most`, the letters of the file, is refused."""
    package = _Package()
    for number, line in lines:
        words = line.split()
        keyword = words[0].upper() if words else ""
        if keyword == "CITIFILE":
            yield package
            package = _Package()
        elif keyword == "VAR":
            if len(words) < 3 or not words[-1].isdigit() or int(words[-1]) < 1:
                raise _wrong(path, number, line, "VAR NAME FORMAT COUNT")
            package.sizes[words[1]] = int(words[-1][:20])
            if prod(package.sizes.values()) > most:
                raise InputError(f"{path}: line {number}, {line.strip()[:60]!r}, announces more than the file holds")
        elif keyword == "DATA":
            if len(words) < 3 or words[2].upper() not in FORMATS:
                raise _wrong(path, number, line, f"DATA NAME FORMAT with a format of {', '.join(FORMATS)}")
            package.formats[words[1]] = words[2].upper()
        elif keyword in ("VAR_LIST_BEGIN", "SEG_LIST_BEGIN"):
            name = next((name for name in package.sizes if name not in package.values), None)
            if name is None:
                raise _wrong(path, number, line, "a list for a VAR that has none yet")
            package.values[name] = _axis(path, lines, number, package.sizes[name])
        elif keyword == "BEGIN":
            waiting = [name for name in package.formats if name not in package.data]
            if not waiting:
                raise _wrong(path, number, line, "data for a DATA that has none yet")
            shape = tuple(package.sizes.values())
            rows = _rows(path, lines, number, "END", prod(shape))
            package.data[waiting[0]] = FORMATS[package.formats[waiting[0]]](rows).reshape(shape)
    for name, size in package.sizes.items():
        package.values.setdefault(name, np.arange(1.0, size + 1.0) if package.data else np.empty(0))
    yield package


def _axis(path: Path, lines: Iterator[tuple[int, str]], start: int, size: int) -> NDArray[np.float64]:
    """The values of an independent variable, given as a list or as segments of equal steps."""
    values: list[NDArray[np.float64]] = []
    for number, line in lines:
        words = line.split()
        keyword = words[0].upper() if words else ""
        if keyword in ("VAR_LIST_END", "SEG_LIST_END"):
            found = np.concatenate(values) if values else np.empty(0)
            if found.size != size:
                raise InputError(f"{path}: the list from line {start} holds {found.size} values, expected {size}")
            return found
        try:
            if keyword == "SEG":
                first, last, count = float(words[1]), float(words[2]), int(words[3])
                if not 0 < count <= size:
                    raise ValueError
                values.append(np.linspace(first, last, count))
            elif words:
                values.append(np.array([float(words[0])]))
        except (ValueError, IndexError):
            raise _wrong(path, number, line, "a value, or SEG START STOP COUNT within the announced size") from None
    raise InputError(f"{path}: ends within the list from line {start}; the file is cut off")


def _rows(path: Path, lines: Iterator[tuple[int, str]], start: int, end: str, size: int) -> NDArray[np.float64]:
    """Pairs of numbers up to the line `end`, (size, 2); a missing second number is zero."""
    rows: list[tuple[float, float]] = []
    for number, line in lines:
        text = line.strip()
        if text.upper() == end:
            if len(rows) != size:
                raise InputError(f"{path}: the data from line {start} has {len(rows)} rows, expected {size}")
            return np.array(rows)
        if not text:
            continue
        try:
            numbers = [float(word) for word in text.replace(",", " ").split()]
            if len(numbers) not in (1, 2):
                raise ValueError
        except ValueError:
            raise _wrong(path, number, line, "two numbers") from None
        rows.append((numbers[0], numbers[1] if len(numbers) == 2 else 0.0))
    raise InputError(f"{path}: ends within the data from line {start}; the file is cut off")


def _polar(rows: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex numbers from magnitudes and angles [degree], (n, 2)."""
    return np.asarray(rows[:, 0] * np.exp(1j * np.radians(rows[:, 1])))


def _polar_db(rows: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex numbers from levels [dB] and angles [degree], (n, 2)."""
    return _polar(np.stack([ratio_of(rows[:, 0]), rows[:, 1]], axis=-1))


FORMATS = {
    "RI": lambda rows: rows[:, 0] + 1j * rows[:, 1],
    "MAGANGLE": _polar,
    "MAG": _polar,
    "DBANGLE": _polar_db,
    "DB": _polar_db,
}
"""Conversion of two numbers to a complex number, by format; angles are in degrees."""


def _wrong(path: Path, number: int, line: str, expected: str) -> InputError:
    """The error for a line that is not as expected."""
    return InputError(f"{path}: line {number} is {line.strip()[:60]!r}, expected {expected}")


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file begins like CITI."""
    if head.lstrip()[:8].upper() == b"CITIFILE":
        return True
    if path.suffix.lower() in SUFFIXES:
        raise InputError(f"{path}: ends in {path.suffix} and does not begin with CITIFILE; export it again")
    return False


READER = Reader("citi", "CITI files", recognises, read, SUFFIXES)
