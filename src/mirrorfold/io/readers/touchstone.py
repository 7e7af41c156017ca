"""Touchstone files (``.s1p``, ``.s2p``, ... ``.ts``) of versions 1 and 2.

A scan consists of thousands of small files, so the numbers of version 1 have a fast parser here; scikit-rf reads
version 2 and parameters other than S. Source: IBIS Open Forum, "Touchstone File Format Specification", versions 1.1
(2002) and 2.0 (2009).
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.decibels import ratio_of
from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Spectra, Variable, read_bytes

SUFFIXES = (".s1p", ".s2p", ".s3p", ".s4p", ".ts")
"""The usual suffixes; files of more ports are recognised by `SUFFIX`."""

SUFFIX = re.compile(r"\.(?:s(\d{1,3})p|ts)$", re.IGNORECASE)

UNITS = {"HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "GHZ": 1e9}

FORMATS = ("MA", "DB", "RI")

PARAMETERS = ("S", "Y", "Z", "G", "H")

NOISE_COLUMNS = 5
"""Numbers in each row of the noise data that may follow the samples of a two-port."""

GROWTH = 20.0
"""Memory that the numbers of a text file take while they are read, as a multiple of its size."""


def read(path: Path) -> Contents:
    """Read all scattering parameters of a Touchstone file, named ``S11``, ``S21`` ..."""
    spectra = read_spectra(path)
    variables = {"frequency": Variable.of(spectra.frequency, ("frequency",), {"units": "Hz"})}
    variables |= {name: Variable.of(values, ("frequency",)) for name, values in spectra.parameters.items()}
    return Contents(path, READER.name, variables, spectra=spectra)


def read_spectra(path: Path) -> Spectra:
    """Read the frequencies and scattering parameters of a Touchstone file.

    Raises
    ------
    InputError
        If it is damaged, does not fit the number of ports in its name, or needs scikit-rf, which is missing.
    """
    raw = read_bytes(path, growth=GROWTH)
    match = SUFFIX.search(path.name)
    unit, parameter, form, start = _options(path, raw)
    if start < 0 or parameter != "S" or match is None or match[1] is None:
        return _by_library(path, raw)
    ports = int(match[1])
    block = raw[start:]
    if b"!" in block or b"#" in block:
        block = re.sub(rb"[!#][^\r\n]*", b"", block)
    try:
        values = np.array(list(map(float, block.split())))
    except ValueError:
        raise _bad_number(path, raw) from None
    return _spectra(path, values, ports, UNITS[unit], form)


def _options(path: Path, raw: bytes) -> tuple[str, str, str, int]:
    """Unit, parameter and format from the option line, and the byte at which the numbers begin; -1 for version 2."""
    unit, parameter, form, at = "GHZ", "S", "MA", 0
    while at < len(raw):
        end = raw.find(b"\n", at)
        end = len(raw) if end < 0 else end + 1
        line = raw[at:end].split(b"!")[0].strip()
        if line.startswith(b"#"):
            words = line[1:].decode("latin-1").upper().split()
            while words:
                word = words.pop(0)
                if word in UNITS:
                    unit = word
                elif word in FORMATS:
                    form = word
                elif word in PARAMETERS:
                    parameter = word
                elif word == "R" and words:
                    words.pop(0)
                else:
                    raise InputError(f"{path}: the option line {line.decode('latin-1')!r} holds an unknown {word!r}")
            return unit, parameter, form, end
        if line.startswith(b"["):
            return unit, parameter, form, -1
        if line:
            return unit, parameter, form, at
        at = end
    raise InputError(f"{path}: holds no samples, only comments; export it again")


def _bad_number(path: Path, raw: bytes) -> InputError:
    """The error for the first word that is no number, with its line."""
    for number, line in enumerate(raw.decode("latin-1").splitlines(), 1):
        for word in re.split(r"[!#]", line)[0].split():
            try:
                float(word)
            except ValueError:
                return InputError(f"{path}: line {number} holds {word[:40]!r}, expected a number; export it again")
    return InputError(f"{path}: holds something that is no number; export it again")


def _spectra(path: Path, values: NDArray[np.float64], ports: int, unit: float, form: str) -> Spectra:
    """Spectra from all numbers in turn: each frequency is followed by the samples of all pairs of ports."""
    columns = 1 + 2 * ports**2
    rows = values.size // columns if ports else 0
    rest = values.size - rows * columns
    if ports == 2 and rows:
        # Noise data begins where the frequency falls.
        falls = np.flatnonzero(np.diff(values[: rows * columns : columns]) <= 0)
        if falls.size:
            rows = int(falls[0]) + 1
        noise = values[rows * columns :]
        rest = noise.size % NOISE_COLUMNS or int(noise.size > 0 and noise[0] > values[(rows - 1) * columns])
        if falls.size and (rest or (np.diff(noise[::NOISE_COLUMNS]) <= 0).any()):
            raise InputError(
                f"{path}: its frequencies do not rise: {values[(rows - 1) * columns]:g} is followed by {noise[0]:g}; "
                "export it again, with rising frequencies"
            )
    if rest or not rows:
        raise InputError(
            f"{path}: holds {values.size} numbers, expected a multiple of {columns} for {ports} ports; "
            "the file is cut off, or its name says another number of ports"
        )
    table = values[: rows * columns].reshape(rows, columns)
    first, second = table[:, 1::2], table[:, 2::2]
    if form == "RI":
        s = first + 1j * second
    else:
        s = (first if form == "MA" else ratio_of(first)) * np.exp(1j * np.radians(second))
    # The specification orders the samples of two-ports by columns, of all others by rows.
    order = [(i, j) for i in range(ports) for j in range(ports)]
    if ports == 2:
        order = [(0, 0), (1, 0), (0, 1), (1, 1)]
    return Spectra(table[:, 0] * unit, {parameter_name(i, j, ports): s[:, n] for n, (i, j) in enumerate(order)})


def parameter_name(out: int, into: int, ports: int) -> str:
    """Name of a parameter, such as ``"S21"``, from two ports counted from zero; with a comma for ten ports or more."""
    return f"S{out + 1}{into + 1}" if ports < 10 else f"S{out + 1},{into + 1}"


def _by_library(path: Path, raw: bytes) -> Spectra:
    """Spectra of a file that the fast parser cannot read, by way of scikit-rf."""
    text = raw.decode("latin-1")
    ports = re.search(r"\[number of ports\]\s*(\d+)", text, re.IGNORECASE)
    points = re.search(r"\[number of frequencies\]\s*(\d+)", text, re.IGNORECASE)
    if ports and points:
        # A matrix may be given by one of its triangles; each number takes at least two characters.
        needed = 2 * int(ports[1]) * (int(ports[1]) + 1) * int(points[1])
        if needed > len(raw):
            raise InputError(
                f"{path}: announces {points[1]} frequencies of {ports[1]} ports, more than its {len(raw)} bytes hold; "
                "the file is cut off"
            )
    try:
        from skrf.io.touchstone import Touchstone
    except ImportError:
        raise InputError(
            f"{path}: is a Touchstone file of version 2 or of other parameters than S, which needs scikit-rf; install "
            "with: pip install 'mirrorfold[touchstone]'"
        ) from None
    import warnings

    file = io.StringIO(text)
    file.name = path.name
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = Touchstone(file)
        frequency, s = found.get_sparameter_arrays()
    frequency, s = np.asarray(frequency, dtype=float), np.asarray(s, dtype=complex)
    if frequency.ndim != 1 or not frequency.size or s.shape[:1] != frequency.shape or s.ndim != 3:
        raise InputError(f"{path}: holds no samples that can be read; export it as version 1")
    count = s.shape[1]
    names = {parameter_name(i, j, count): s[:, i, j] for i in range(count) for j in range(count)}
    return Spectra(frequency, names)


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is named like Touchstone."""
    if SUFFIX.search(path.name) is None:
        return False
    if b"\0" in head:
        raise InputError(f"{path}: is named like a Touchstone file and holds binary data; give it its true name")
    return True


READER = Reader("touchstone", "Touchstone .s1p, .s2p, ... and .ts", recognises, read, SUFFIXES)
