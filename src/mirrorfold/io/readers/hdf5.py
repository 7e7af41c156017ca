"""HDF5 files of any origin: MATLAB 7.3, netCDF-4, and whatever instruments write.

Links to other files, and data that lie in other files, are refused: a file may only show what is in it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Variable, check_expansion, nbytes

SIGNATURE = b"\x89HDF\r\n\x1a\n"

MOST_OBJECTS = 100_000
"""Groups and arrays in one file; a file with more is damaged or made to keep the reader busy."""

COMPLEX_FIELDS = (("real", "imag"), ("r", "i"), ("re", "im"))
"""Names that complex numbers have as compounds: of MATLAB 7.3, of h5py and h5netcdf, and others."""

TEXT_BYTES = 1 << 20
"""Longer texts are not read."""


def read(path: Path) -> Contents:
    """All arrays of an HDF5 file, read when they are asked for; groups are joined by dots.

    Arrays of MATLAB 7.3 files, which lie in the other order on disk, have their axes as MATLAB shows them.
    """
    matlab = path.open("rb").read(19) == b"MATLAB 7.3 MAT-file"
    variables: dict[str, Variable] = {}
    with h5py.File(path, "r") as file:
        for name, dataset in datasets(path, file):
            variable = _variable(path, name, dataset, matlab=matlab or "MATLAB_class" in dataset.attrs)
            if variable is not None:
                variables[name.replace("/", ".")] = variable
        attrs = {str(name): _attr(file.attrs, name) for name in file.attrs}
    if not variables:
        raise InputError(f"{path}: holds no array of numbers; save the measured variables into it")
    return Contents(path, READER.name, variables, {name: value for name, value in attrs.items() if value is not None})


def datasets(path: Path, file: h5py.File) -> list[tuple[str, h5py.Dataset]]:
    """All arrays of a file with their names, each once.

    Raises
    ------
    InputError
        If the file refers to other files, or holds too many objects.
    """
    links: list[str] = []

    def note(name: bytes, info: Any) -> int | None:
        if info.type not in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT):
            raise InputError(
                f"{path}: its entry {_text(name)!r} is a link to another file; copy the data into one file"
            )
        links.append(_text(name))
        return 1 if len(links) > MOST_OBJECTS else None

    file.id.links.visit(note, info=True)
    if len(links) > MOST_OBJECTS:
        raise InputError(f"{path}: holds more than {MOST_OBJECTS} objects; split it, or export what was measured")
    found = []
    for name in links:
        if file.get(name, getlink=True).__class__ is not h5py.HardLink:
            continue
        item = file[name]
        if isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise InputError(f"{path}: the values of {name!r} lie in another file; copy the data into one file")
            found.append((name, item))
    return found


def _text(name: bytes | str) -> str:
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else name


def _variable(path: Path, name: str, dataset: h5py.Dataset, *, matlab: bool) -> Variable | None:
    """A variable that opens the file again when it is read; None for what holds no numbers or text."""
    shape = dataset.shape
    if shape is None or name.startswith("#"):  # an empty array, or what MATLAB keeps for itself
        return None
    dtype = dataset.dtype
    attrs = {str(key): _attr(dataset.attrs, key) for key in dataset.attrs if str(key) in ("units", "unit", "long_name")}
    text = h5py.check_string_dtype(dtype)
    if text is not None:
        if shape != ():
            return None
        return Variable((), np.dtype("U"), _loader(path, name, lambda found: np.array(_text(found[()]))), (), attrs)
    fields = complex_fields(dtype)
    if fields is None and dtype.kind not in "fciub":
        return None
    if matlab and dataset.attrs.get("MATLAB_empty", 0):
        return None
    stored = max(dataset.id.get_storage_size(), 1)

    def load(found: h5py.Dataset) -> NDArray:
        check_expansion(path, stored, nbytes(shape, dtype.itemsize), f"its variable {name!r}")
        values = np.asarray(found[()])
        if fields is not None:
            values = to_complex(values, fields)
        return values.T if matlab else values

    if fields is not None:
        dtype = np.dtype(np.complex64 if dtype[fields[0]].itemsize <= 4 else np.complex128)
    dims = _dims(dataset)
    return Variable(
        shape[::-1] if matlab else shape, dtype, _loader(path, name, load), dims[::-1] if matlab else dims, attrs
    )


def _loader(path: Path, name: str, load: Callable[[h5py.Dataset], NDArray]) -> Callable[[], NDArray]:
    def opened() -> NDArray:
        with h5py.File(path, "r") as file:
            return load(file[name])

    return opened


def complex_fields(dtype: np.dtype) -> tuple[str, str] | None:
    """The names of real and imaginary part of a compound type that stands for complex numbers."""
    for real, imaginary in COMPLEX_FIELDS:
        if (
            dtype.names is not None
            and set(dtype.names) == {real, imaginary}
            and all(dtype[name].kind in "fiu" and dtype[name].shape == () for name in (real, imaginary))
        ):
            return real, imaginary
    return None


def to_complex(values: NDArray, fields: tuple[str, str]) -> NDArray:
    """Complex numbers from a structured array."""
    single = values.dtype[fields[0]].itemsize <= 4
    result = np.empty(values.shape, np.complex64 if single else np.complex128)
    result.real, result.imag = values[fields[0]], values[fields[1]]
    return result


def _dims(dataset: h5py.Dataset) -> tuple[str, ...]:
    """Names of the axes where netCDF-4 has left them."""
    names = []
    for axis in dataset.dims:
        scales = axis.values()
        names.append(str(scales[0].name).rpartition("/")[2] if scales else axis.label)
    return tuple(names) if all(names) else ()


def _attr(attrs: Any, name: str) -> str | float | None:
    """An attribute that is a short text or a number."""
    try:
        value = attrs[name]
    except Exception:  # an attribute of a type that h5py does not know says nothing
        return None
    value = value.item() if isinstance(value, np.ndarray | np.generic) and np.size(value) == 1 else value
    if isinstance(value, bytes | str):
        return _text(value)[:TEXT_BYTES]
    return float(value) if isinstance(value, int | float) else None


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file has the signature of HDF5, at its beginning or after a block of the user's."""
    if head[:8] == SIGNATURE or any(head[at : at + 8] == SIGNATURE for at in (512, 1024, 2048)):
        return True
    if path.suffix.lower() in (".h5", ".hdf5", ".he5") or head[:19] == b"MATLAB 7.3 MAT-file":
        raise InputError(f"{path}: seems to be HDF5 by its name or header and is not; copy it again")
    return False


READER = Reader("hdf5", "HDF5, netCDF-4 and MATLAB 7.3", recognises, read)
