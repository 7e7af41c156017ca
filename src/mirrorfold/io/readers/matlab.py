"""MATLAB files of versions 5 to 7, the format that ``save`` writes by default.

It has a parser of its own, because sizes must be checked before anything is allocated. The parser reads numbers
(complex too), texts, structures and cells, and skips objects and functions, which are never executed. Source:
MathWorks, "MAT-File Format", R2021b, chapter 1. Files of version 7.3 are HDF5.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.arguments import in_message
from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Variable, check_expansion, read_bytes

HEADER_BYTES = 128
DEEPEST = 32
"""Largest number of levels of nested structures; no measurement needs more."""

MATRIX, COMPRESSED = 14, 15
"""Types of elements that hold an array, and a compressed element."""

STORAGE = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
    16: "u1", 17: "u2", 18: "u4",
}  # fmt: skip
"""Types in which values are stored, by the type of the element; the last three are UTF-8, UTF-16 and UTF-32."""

CELL, STRUCT, TEXT = 1, 2, 4
"""Classes of arrays that hold no numbers."""

NUMERIC = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
"""Types of arrays by the number of their class."""

COMPLEX_FLAG = 0x08

LONGEST_TEXT = 1 << 20
"""Largest number of letters that are kept of a text."""

OBJECT_BYTES = 800
"""Memory that a variable takes in addition to its name and its values [bytes]."""


@dataclass
class _Found:
    """The variables of a file of `stored` bytes, and the memory that they take [bytes]."""

    path: Path
    stored: int
    variables: dict[str, Variable] = field(default_factory=dict)
    taken: int = 0

    def make_room(self, name: str, size: int) -> None:
        """Count a variable of `size` bytes before it is made, and refuse a file that would fill the memory."""
        self.taken += OBJECT_BYTES + len(name) + size
        check_expansion(self.path, self.stored, self.taken, "the names and values of its variables")


@dataclass
class _Stream:
    """Bytes with a reading position."""

    path: Path
    data: memoryview
    order: str
    at: int = 0

    def left(self) -> int:
        """Number of bytes that are left."""
        return len(self.data) - self.at

    def fail(self, what: str) -> InputError:
        """An error about damage at the reading position."""
        return InputError(f"{self.path}: is damaged: {what} near byte {self.at}; copy or export it again")

    def take(self, size: int) -> memoryview:
        """The next `size` bytes."""
        if size > self.left():
            raise self.fail(f"{size} bytes are announced and {self.left()} are left")
        part = self.data[self.at : self.at + size]
        self.at += size
        return part

    def element(self) -> tuple[int, memoryview]:
        """Type and bytes of the next element."""
        first = int(np.frombuffer(self.take(4), self.order + "u4")[0])
        if first >> 16:  # a small element holds its bytes in the place of the size
            kind, size = first & 0xFFFF, first >> 16
            if size > 4:
                raise self.fail(f"a small element claims {size} bytes")
            return kind, self.take(4)[:size]
        size = int(np.frombuffer(self.take(4), self.order + "u4")[0])
        part = self.take(size)
        if first != COMPRESSED:
            self.at = min(self.at + (-size) % 8, len(self.data))
        return first, part

    def numbers(self) -> NDArray:
        """The next element as an array of numbers."""
        kind, part = self.element()
        if kind not in STORAGE:
            raise self.fail(f"an element of type {kind} stands where numbers belong")
        dtype = np.dtype(self.order + STORAGE[kind])
        if len(part) % dtype.itemsize:
            raise self.fail(f"{len(part)} bytes are no whole number of {dtype.name} values")
        return np.frombuffer(part, dtype)


def read(path: Path) -> Contents:
    """Read all variables of a MATLAB file of version 5 to 7; fields of structures are named ``data.field``."""
    raw = read_bytes(path)
    if len(raw) < HEADER_BYTES + 8:
        raise InputError(f"{path}: is cut off after {len(raw)} bytes, within the header; copy it again")
    order = "<" if raw[126:128] == b"IM" else ">"
    stream = _Stream(path, memoryview(raw), order, HEADER_BYTES)
    found = _Found(path, len(raw))
    expanded = 0
    while stream.left() >= 8:
        kind, part = stream.element()
        if kind == COMPRESSED:
            body = _inflate(path, part, order, expanded, len(raw))
            expanded += len(body)
            kind, part = _Stream(path, memoryview(body), order).element()
        if kind == MATRIX:
            _matrix(_Stream(path, part, order), "", found, 0)
    if not found.variables:
        raise InputError(f"{path}: holds no array of numbers; save the measured variables into it")
    return Contents(path, READER.name, found.variables, {"header": bytes(raw[:116]).decode("latin-1").strip(" \0")})


def _inflate(path: Path, part: memoryview, order: str, before: int, stored: int) -> bytes:
    """The content of a compressed element, read up to the size that its header announces.

    `before` is the size of what was expanded before, `stored` that of the file.
    """
    unpacker = zlib.decompressobj()
    try:
        head = unpacker.decompress(part, 8)
        if len(head) < 8:
            raise InputError(f"{path}: is damaged: a compressed variable is cut off; copy it again")
        size = int(np.frombuffer(head, order + "u4")[1])
        check_expansion(path, stored, before + size, "a compressed variable")
        return head + unpacker.decompress(unpacker.unconsumed_tail, max(size, 1))
    except zlib.error as error:
        raise InputError(f"{path}: is damaged: a compressed variable cannot be read ({error}); copy it again") from None


def _matrix(stream: _Stream, name: str, found: _Found, depth: int) -> None:
    """Add an array, or the content of a structure or cell, to the variables that were found."""
    if depth > DEEPEST:
        raise stream.fail(f"structures are nested deeper than {DEEPEST}")
    if not stream.left():  # an empty field of a structure
        return
    flags = stream.numbers()
    if flags.size < 1:
        raise stream.fail("an array has no flags")
    number, is_complex = int(flags[0]) & 0xFF, bool((int(flags[0]) >> 8) & COMPLEX_FLAG)
    if number not in NUMERIC and number not in (CELL, STRUCT, TEXT):
        return
    shape = tuple(map(int, stream.numbers()))
    if min(shape, default=0) < 0:
        raise stream.fail(f"an array has the shape {shape}")
    own = bytes(stream.element()[1]).decode("latin-1")
    name = name or own
    if number in (CELL, STRUCT):
        _compound(stream, name, number, shape, found, depth)
        return
    if number == TEXT:
        codes = stream.numbers()[:LONGEST_TEXT]
        found.make_room(name, 4 * codes.size)
        text = "".join(map(chr, codes.tolist())) if codes.dtype.kind == "u" and codes.itemsize < 4 else ""
        found.variables[name] = Variable.of(np.array(text))
        return
    parts = [stream.numbers() for _ in range(2 if is_complex else 1)]
    if any(part.size != prod(shape) for part in parts):
        raise stream.fail(f"{in_message(name)} has the shape {shape} and {parts[0].size} values")
    kind = np.dtype(NUMERIC[number])
    if is_complex:
        kind = np.dtype(np.complex64 if kind == np.float32 else np.complex128)
    found.make_room(name, prod(shape) * kind.itemsize)
    if is_complex:
        values = np.empty(prod(shape), kind)
        values.real, values.imag = parts
    else:
        values = parts[0].astype(kind)
    found.variables[name] = Variable.of(values.reshape(shape, order="F"))


def _compound(stream: _Stream, name: str, number: int, shape: tuple[int, ...], found: _Found, depth: int) -> None:
    """Add the content of a structure or a cell array to the variables; several elements are numbered from zero."""
    fields = [""]
    if number == STRUCT:
        length = stream.numbers()
        if length.size != 1 or not 0 < int(length[0]) <= stream.left():
            raise stream.fail(f"the field names of {in_message(name)} have no length")
        raw = bytes(stream.element()[1])
        width = int(length[0])
        fields = ["." + raw[at : at + width].split(b"\0")[0].decode("latin-1") for at in range(0, len(raw), width)]
    count = prod(shape)
    if count * len(fields) * 8 > stream.left():  # every element takes eight bytes at least
        raise stream.fail(f"{in_message(name)} announces {count} elements")
    numbered = number == CELL or count != 1
    for index in range(count):
        for suffix in fields:
            kind, part = stream.element()
            if kind != MATRIX:
                raise stream.fail(f"an element of {in_message(name)} is no array")
            label = f"{name}[{index}]{suffix}" if numbered else f"{name}{suffix}"
            _matrix(_Stream(stream.path, part, stream.order), label, found, depth + 1)


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file begins like a MATLAB file of version 5; other files named .mat are refused."""
    if head[:19] == b"MATLAB 7.3 MAT-file":
        return False
    if len(head) >= HEADER_BYTES and head[126:128] in (b"IM", b"MI"):
        return True
    if path.suffix.lower() == ".mat" and not head.startswith(b"\x89HDF"):
        raise InputError(
            f"{path}: ends in .mat and is no MATLAB file of version 5 to 7.3; save it again, or give it its true name"
        )
    return False


READER = Reader("matlab", "MATLAB files of version 5 to 7", recognises, read, (".mat",))
