"""Damage to files: to the bytes of any file, to the words of texts, to arrays and attributes of HDF5 files."""

from __future__ import annotations

import io
import re
import struct
from contextlib import suppress

import h5py
import numpy as np

SPECIAL = [
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\0",
    b"\x80\0\0\0",
    b"\xff" * 8,
    b"\0" * 8,
]
NUMBERS = [b"-1", b"0", b"1e999", b"nan", b"99999999999999999999", b"4294967296", b"1e-320", b"x", b"", b"1_0", b"0x10"]


def damaged_bytes(raw: bytes, others: list[bytes], rng: np.random.Generator) -> bytes:
    """The file with a few mistakes."""
    data = bytearray(raw)
    if rng.random() < 0.02:  # time that grows with the square of a length shows only if the length is large
        at, piece = (
            int(rng.integers(0, len(data) + 1)),
            bytes(rng.choice([b"9", b"_", b" ", b"a", b"(", b",", b"-", b"\n", b"[", b"0x"])),
        )
        data[at:at] = piece * int(rng.integers(1, 60_000))
    for _ in range(int(rng.integers(1, 5))):
        if not data:
            break
        kind, at = int(rng.integers(0, 12)), int(rng.integers(0, len(data)))
        length = int(rng.integers(1, 33))
        if kind <= 1:
            data[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 2:
            data[at] = int(rng.integers(0, 256))
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            del data[at : at + length]
        elif kind == 5:
            data[at:at] = data[at : at + length]
        elif kind == 6:
            special = SPECIAL[int(rng.integers(0, len(SPECIAL)))]
            data[at : at + len(special)] = special
        elif kind == 7:
            data[at:at] = rng.bytes(length)
        elif kind == 8:
            data[at : at + 4] = struct.pack("<I", int(rng.integers(0, 1 << 32)))
        elif kind == 9:
            other = others[int(rng.integers(0, len(others)))]
            start = int(rng.integers(0, len(other)))
            data[at : at + length] = other[start : start + length]
        elif kind == 10:
            digits = [n for n in range(at, min(at + 200, len(data))) if 48 <= data[n] <= 57]
            if digits:
                end = digits[0]
                while end < len(data) and 48 <= data[end] <= 57:
                    end += 1
                data[digits[0] : end] = NUMBERS[int(rng.integers(0, len(NUMBERS)))]
        else:
            data += data[at : at + length]
    return bytes(data)


WORDS = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-308",
    "5e-324",
    "-0.0",
    "0",
    "-1",
    "1",
    "2",
    "1e9",
    "1e12",
    "99999999999",
    "9" * 400,
    "9" * 5000,
    "0x10",
    "1_000",
    "true",
    "false",
    "null",
    '""',
    '"x"',
    '"300 GHz"',
    '"3 m"',
    "[]",
    "{}",
    "[[]]",
    "[0, 0]",
    "[0.0, 0.0, 0.0]",
    "[1e308, 1e308]",
    "[nan, 1]",
    '["a"]',
    "{a = 1}",
    '{"a": 1}',
    "[" * 300,
    "[" * 2000 + "]" * 2000,
    '"' + "x" * 3000 + '"',
    '"\\u0000"',
    '"\\ud800"',
    '"../../etc/passwd"',
    '"/dev/zero"',
    "1979-05-27T07:32:00Z",
    "\x00",
    "\x7f",
    "\ufeff",
]
"""Words that may replace a value, and must do no harm."""

TOKEN = re.compile(r'"(?:[^"\\\n]|\\.)*"|[-+]?\d[\w.+-]*|\w+|\s+|.', re.DOTALL)
"""The tokens of TOML, JSON and HTTP: texts, numbers, words, spaces, signs."""


def damaged_text(text: str, others: list[str], rng: np.random.Generator) -> str:
    """The text with a few mistakes: values, words or lines are exchanged, doubled, moved or removed."""
    for _ in range(int(rng.integers(1, 4))):
        kind = int(rng.integers(0, 10))
        if kind <= 5:
            tokens = TOKEN.findall(text)
            places = [n for n, token in enumerate(tokens) if not token.isspace()]
            if not places:
                return text
            # Most mistakes are made in values, that is in numbers and texts.
            values = [n for n in places if tokens[n][0] in '"-+.0123456789']
            at = int(rng.choice(values if kind <= 3 and values else places))
            if kind <= 1:
                tokens[at] = WORDS[int(rng.integers(len(WORDS)))]
            elif kind <= 3:  # a token of the same text, or of another text
                found = TOKEN.findall(others[int(rng.integers(len(others)))] if kind == 3 else text) or [""]
                tokens[at] = found[int(rng.integers(len(found)))]
            elif kind == 4:
                tokens[at] = ""
            else:
                end = min(len(tokens), at + int(rng.integers(1, 12)))
                tokens[at:at] = tokens[at:end] * int(rng.choice([1, 2, 30]))
            text = "".join(tokens)
            continue
        lines = text.splitlines(keepends=True)
        if not lines:
            return text
        at = int(rng.integers(len(lines)))
        if kind == 6:
            del lines[at : at + int(rng.integers(1, 4))]
        elif kind == 7:
            lines.insert(int(rng.integers(len(lines) + 1)), lines[at])
        elif kind == 8:
            other = others[int(rng.integers(len(others)))].splitlines(keepends=True)
            start = int(rng.integers(len(other))) if other else 0
            lines[at:at] = other[start : start + int(rng.integers(1, 8))]
        else:
            other_at = int(rng.integers(len(lines)))
            lines[at], lines[other_at] = lines[other_at], lines[at]
        text = "".join(lines)
    return text


NUMBERS_IN_ARRAYS = [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e30, -1.0, 0.0, 1e-308, 1e9, 0.5, 2**31, -(2**63), 7.0]

ATTRIBUTES = [
    h5py.Empty("f"),
    np.arange(2),
    np.nan,
    np.inf,
    -1,
    0,
    2**62,
    1e308,
    "",
    "x",
    "null",
    "[]",
    "{}",
    "[1]",
    '{"a": 1}',
    "true",
    "[" * 3000,
    "y" * 5000,
    np.bytes_(b"\xff\xfe"),
    1 + 1j,
    np.zeros(0),
    np.zeros((2, 2, 2)),
    "sweep",
    "image",
    "reconstruction",
    True,
]
"""Values for attributes."""


def damaged_hdf5(raw: bytes, rng: np.random.Generator) -> bytes:
    """The file with a few mistakes in its arrays, groups or attributes; it is still proper HDF5."""
    file = io.BytesIO(raw)
    with h5py.File(file, "a") as content:
        for _ in range(int(rng.integers(1, 4))):
            arrays: list[str] = []
            content.visititems(
                lambda name, item, to=arrays: to.append(name) if isinstance(item, h5py.Dataset) else None
            )
            groups: list[str] = ["/"]
            content.visititems(lambda name, item, to=groups: to.append(name) if isinstance(item, h5py.Group) else None)
            if not arrays:
                break
            with suppress(Exception):  # not everything can be done to every array
                _damage(content, str(rng.choice(arrays)), str(rng.choice(groups)), arrays, rng)
    return file.getvalue()


def _damage(content: h5py.File, name: str, group: str, arrays: list[str], rng: np.random.Generator) -> None:
    """Make one mistake in an open file."""
    kind, item = int(rng.integers(0, 12)), content[name]
    if kind <= 3:  # some of its numbers, or all of them
        values = item[...]
        number = NUMBERS_IN_ARRAYS[int(rng.integers(len(NUMBERS_IN_ARRAYS)))]
        if values.ndim == 0 or kind == 0:
            values = np.full_like(values, number)
        elif kind == 3:
            values = np.sort(values, axis=0)[:: -1 if rng.random() < 0.5 else 1]
        else:
            places = rng.integers(0, max(values.size, 1), 3 if kind == 1 else 1)
            values.reshape(-1)[places] = number if rng.random() < 0.7 else values.reshape(-1)[places[::-1]]
        item[...] = values
    elif kind <= 7:  # its type or its shape
        values = item[...]
        if kind == 4:
            values = values.astype(str(rng.choice(["i1", "u8", "f2", "f4", "c8", "c16", "?", "S3"])))
        elif kind == 5:
            values = values[: int(rng.integers(0, max(len(values), 1)))]
        elif kind == 6:
            values = np.concatenate([values, values])
        else:
            values = values.T if rng.random() < 0.5 else values[..., None]
        scales = [[scale.name for scale in axis.values()] for axis in item.dims]
        attributes = {key: item.attrs[key] for key in item.attrs if not key.isupper() and not key.startswith("_")}
        del content[name]
        new = content.create_dataset(name, data=values)
        for key, value in attributes.items():
            new.attrs[key] = value
        for axis, names in enumerate(scales[: new.ndim]):
            for scale in names:
                new.dims[axis].attach_scale(content[scale])
    elif kind == 8:
        del content[name if rng.random() < 0.8 else group]
    elif kind == 9:
        other = str(rng.choice(arrays))
        content.move(name, f"{name}.kept")
        content.move(other, name) if other != name else content.move(f"{name}.kept", f"{name}2")
    else:
        owner = content if rng.random() < 0.6 else item if rng.random() < 0.5 else content[group]
        names = [key for key in owner.attrs if not key.isupper() and not key.startswith("_")] or ["units"]
        value = ATTRIBUTES[int(rng.integers(len(ATTRIBUTES)))]
        key = str(rng.choice(names))
        if rng.random() < 0.2:
            del owner.attrs[key]
        else:
            owner.attrs[key] = value
