"""Point clouds of other tools, PLY (text or binary) and PCD (text or binary): positions and properties of points.

Sources: G. Turk, "The PLY Polygon File Format" (1994); R. B. Rusu and S. Cousins, "3D is here: Point Cloud Library
(PCL)", IEEE International Conference on Robotics and Automation, 2011.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Variable, read_bytes

PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip

HEADER_BYTES = 1 << 16
"""Largest size of a header [bytes]."""

SUFFIXES = (".ply", ".pcd")


def read(path: Path) -> Contents:
    """Read the points of a cloud, as one variable for each property: ``x``, ``y``, ``z`` ..."""
    raw = read_bytes(path, growth=8.0)
    columns = _ply(path, raw) if raw.startswith(b"ply") else _pcd(path, raw)
    if not {"x", "y"} <= set(columns):
        raise InputError(f"{path}: its points have {', '.join(columns) or 'nothing'}, expected x and y at least")
    return Contents(path, READER.name, {name: Variable.of(values) for name, values in columns.items()})


def _header(path: Path, raw: bytes, end: bytes) -> tuple[list[list[str]], bytes]:
    """The words of each line of the header, and the bytes that follow the header."""
    match = re.search(rb"^" + end + rb"[^\n]*\n", raw[:HEADER_BYTES], re.MULTILINE)
    if match is None:
        raise InputError(f"{path}: has no line {end.decode()!r}; the file is cut off within its header")
    text = raw[: match.end()].decode("latin-1")
    return [line.split() for line in text.splitlines() if line.split()], raw[match.end() :]


def _ply(path: Path, raw: bytes) -> dict[str, NDArray]:
    """The properties of the points of a PLY file."""
    lines, body = _header(path, raw, b"end_header")
    form, count, fields, elements = "", -1, [], []
    for words in lines:
        if words[0] == "format" and len(words) > 1:
            form = words[1]
        elif words[0] == "element":
            elements.append(words[1] if len(words) > 1 else "")
            if elements[-1] == "vertex":
                count = _count(path, words[2] if len(words) > 2 else "")
        elif words[0] == "property" and elements[-1:] == ["vertex"]:
            if len(words) != 3 or words[1] not in PLY_TYPES:
                raise InputError(f"{path}: the property {' '.join(words[1:])!r} of its points is not understood")
            fields.append((words[2], PLY_TYPES[words[1]]))
    if count < 0 or elements[:1] != ["vertex"]:
        raise InputError(f"{path}: its first element is {elements[:1]}, expected the vertices of a point cloud")
    orders = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
    if form not in orders:
        raise InputError(f"{path}: its format is {form!r}, expected one of {', '.join(orders)}")
    return _columns(path, body, count, fields, orders[form])


def _pcd(path: Path, raw: bytes) -> dict[str, NDArray]:
    """The fields of the points of a PCD file."""
    lines, body = _header(path, raw, b"DATA")
    said = {words[0].upper(): words[1:] for words in lines}
    names, sizes, kinds = (said.get(name, []) for name in ("FIELDS", "SIZE", "TYPE"))
    counts = said.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(kinds) == len(counts) or set(counts) != {"1"}:
        raise InputError(f"{path}: FIELDS, SIZE, TYPE and COUNT do not fit together; write the cloud again")
    fields = [(name, f"{kind.lower()}{size}") for name, kind, size in zip(names, kinds, sizes, strict=True)]
    if any(kind not in PLY_TYPES.values() and kind not in ("i8", "u8") for _, kind in fields):
        raise InputError(f"{path}: SIZE and TYPE name an unknown type; write the cloud again")
    count = _count(path, " ".join(said.get("POINTS", said.get("WIDTH", []))))
    form = " ".join(said["DATA"]).lower()
    if form not in ("ascii", "binary"):
        raise InputError(f"{path}: its data is {form!r}, expected ascii or binary; write it without compression")
    return _columns(path, body, count, fields, "" if form == "ascii" else "<")


def _count(path: Path, word: str) -> int:
    """The announced number of points."""
    if not word.isascii() or not word.isdigit() or len(word) > 18:
        raise InputError(f"{path}: announces {word[:40]!r} points, expected a number")
    return int(word)


def _columns(path: Path, body: bytes, count: int, fields: list[tuple[str, str]], order: str) -> dict[str, NDArray]:
    """One array for each field, given by name and type; `order` is the byte order, empty for text."""
    if len(dict(fields)) != len(fields):
        raise InputError(f"{path}: two properties of its points have the same name; write the cloud again")
    if not order:
        words = body.split(None, count * len(fields))[: count * len(fields)] if count <= len(body) else []
        if len(words) < count * len(fields) or (count > len(body)):
            raise InputError(f"{path}: announces {count} points and holds fewer; the file is cut off")
        try:
            table = np.array(list(map(float, words))).reshape(count, len(fields))
        except ValueError:
            raise InputError(f"{path}: holds something that is no number among its points; write it again") from None
        return {name: table[:, n] for n, (name, _) in enumerate(fields)}
    dtype = np.dtype([(name, order + kind) for name, kind in fields])
    if count * dtype.itemsize > len(body):
        raise InputError(f"{path}: announces {count} points and holds {len(body)} bytes; the file is cut off")
    values = np.frombuffer(body, dtype, count)
    return {name: values[name].astype(float) for name, _ in fields}


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file begins like a point cloud."""
    if head.startswith((b"ply\n", b"ply\r\n")) or re.search(rb"^VERSION\s+\.?\d", head[:1000], re.MULTILINE):
        return head.startswith(b"ply") or b"FIELDS" in head
    if path.suffix.lower() in SUFFIXES:
        raise InputError(f"{path}: ends in {path.suffix} and does not begin like a point cloud; write it again")
    return False


READER = Reader("cloud", "point clouds: PLY and PCD", recognises, read, SUFFIXES)
