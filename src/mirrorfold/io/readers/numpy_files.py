"""NumPy files, ``.npy`` and ``.npz``, without pickled objects, which could run any program."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Variable, check_expansion, nbytes, read_bytes
from mirrorfold.io.readers.hdf5 import complex_fields, to_complex

ZIP, NPY = b"PK\x03\x04", b"\x93NUMPY"

MOST_MEMBERS = 10_000

HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""Functions that read the header, by version of the format."""

SUFFIXES = (".npy", ".npz")


def read(path: Path) -> Contents:
    """Read the array of an ``.npy`` file, named ``array``, or all arrays of an ``.npz`` file."""
    raw = read_bytes(path, growth=2.0)
    if raw.startswith(NPY):
        return Contents(path, READER.name, _variables("array", _array(path, "array", io.BytesIO(raw), len(raw))))
    variables: dict[str, Variable] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            members = archive.infolist()
            if len(members) > MOST_MEMBERS:
                raise InputError(f"{path}: holds {len(members)} files, expected the arrays of one measurement")
            check_expansion(path, len(raw), sum(member.file_size for member in members))
            for member in members:
                name = member.filename.removesuffix(".npy")
                if member.filename.endswith(".npy"):
                    with archive.open(member) as file:
                        variables |= _variables(name, _array(path, name, file, member.file_size))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{path}: is damaged or no .npz file ({str(error)[:100]!r}); save it again") from None
    if not variables:
        raise InputError(f"{path}: holds no NumPy arrays; write it with numpy.savez")
    return Contents(path, READER.name, variables)


def _array(path: Path, name: str, file: IO[bytes], size: int) -> NDArray:
    """The array of a file of at most `size` bytes, its header included."""
    try:
        version = npy.read_magic(file)
        if version not in HEADERS:
            raise InputError(f"{path}: {name!r} is of NumPy's format {version}, expected 1.0 or 2.0; save it again")
        shape, fortran, dtype = HEADERS[version](file)
    except (ValueError, SyntaxError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: the header of {name!r} cannot be read ({str(error)[:100]}); save it again") from None
    if dtype.hasobject:
        raise InputError(
            f"{path}: {name!r} holds pickled Python objects, which are never loaded; save plain arrays of numbers"
        )
    if dtype.itemsize == 0 or min(shape, default=0) < 0:
        raise InputError(f"{path}: {name!r} has type {dtype} and shape {shape}, expected an array of numbers")
    expected = nbytes(shape, dtype.itemsize)
    if expected > size:
        raise InputError(f"{path}: {name!r} announces {expected} bytes and the file holds {size}; copy it again")
    raw = file.read(expected)
    if len(raw) < expected:
        raise InputError(f"{path}: {name!r} is cut off after {len(raw)} of {expected} bytes; copy it again")
    values: NDArray = np.frombuffer(raw, dtype).reshape(shape, order="F" if fortran else "C")
    return values


def _variables(name: str, values: NDArray) -> dict[str, Variable]:
    """An array as one variable; a structured array as one variable for each field."""
    fields = complex_fields(values.dtype)
    if fields is not None:
        values = to_complex(values, fields)
    if values.dtype.names is None:
        return {name: Variable.of(values)} if values.dtype.kind in "fciubU" else {}
    return {
        f"{name}.{field}": Variable.of(values[field])
        for field in values.dtype.names
        if values.dtype[field].base.kind in "fciub"
    }


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file begins like a NumPy or zip file."""
    if head.startswith((ZIP, NPY)):
        return True
    if path.suffix.lower() in SUFFIXES:
        raise InputError(f"{path}: ends in {path.suffix} and is no NumPy file; save it again with numpy.save or savez")
    return False


READER = Reader("numpy", "NumPy .npy and .npz", recognises, read, SUFFIXES)
