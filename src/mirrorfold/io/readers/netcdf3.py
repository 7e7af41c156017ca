"""netCDF files of the classic formats, by way of SciPy; netCDF-4 files are HDF5."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Variable, read_bytes, unit_attribute

RECORDS_AT = 4
"""Byte of the header at which the number of records is stored."""

MOST_READ = 2
"""Largest number of times that the bytes of a file are read; where it is exceeded, variables share the same bytes."""

STREAMING = b"\xff\xff\xff\xff"
"""Number of records of a file that was not closed."""


class _ReadOnce(io.BytesIO):
    """The bytes of a file, which may not be read again and again, for one variable after the other."""

    def __init__(self, path: Path, raw: bytes) -> None:
        super().__init__(raw)
        self._path, self._left = path, MOST_READ * len(raw)

    def read(self, size: int | None = -1) -> bytes:
        """The next `size` bytes."""
        found = super().read(size)
        self._left -= len(found)
        if self._left < 0:
            raise InputError(f"{self._path}: is damaged: its variables share the same bytes; copy or export it again")
        return found


def read(path: Path) -> Contents:
    """Read all arrays of a classic netCDF file."""
    from scipy.io import netcdf_file

    raw = read_bytes(path, growth=3.0)
    if raw[RECORDS_AT : RECORDS_AT + 4] == STREAMING:
        raise InputError(f"{path}: was not closed when it was written; its number of records is missing")
    # Read from memory, because reads beyond its end are cut off before anything is allocated.
    with netcdf_file(_ReadOnce(path, raw), "r", mmap=False) as file:
        variables = {
            str(name): Variable.of(
                np.array(found.data, dtype=found.data.dtype.newbyteorder("=")),
                tuple(map(str, found.dimensions)),
                {"units": _text(found._attributes.get(unit_attribute(found._attributes), ""))},
            )
            for name, found in file.variables.items()
            if found.data.dtype.kind in "fiu"
        }
        attrs = {str(name): _text(value) for name, value in file._attributes.items() if isinstance(value, bytes)}
    if not variables:
        raise InputError(f"{path}: holds no array of numbers; save the measured variables into it")
    return Contents(path, READER.name, variables, attrs)


def _text(value: bytes | str) -> str:
    """An attribute that may be bytes in UTF-8 as text."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file begins like classic netCDF."""
    if head[:3] == b"CDF" and head[3:4] in (b"\x01", b"\x02"):
        return True
    if head[:3] == b"CDF" and head[3:4] == b"\x05":
        raise InputError(f"{path}: is netCDF of the 64-bit data format; convert it: nccopy -k netCDF-4 IN OUT")
    if path.suffix.lower() in (".nc", ".cdf", ".nc4") and not head.startswith((b"\x89HDF", b"CDF")):
        raise InputError(f"{path}: ends in {path.suffix} and is no netCDF file; copy it again, or give its true name")
    return False


READER = Reader("netcdf3", "netCDF of the classic formats", recognises, read)
