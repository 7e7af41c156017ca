"""Checks that a file's suffix does not belong to another format than the one written, by all known formats."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from mirrorfold.errors import InputError

PICTURES = (".png", ".pdf", ".svg")
"""Suffixes of figures."""

OTHERS = (".html", ".htm", ".jpg", ".jpeg", ".tif", ".tiff", ".gif", ".json", ".toml", ".zip", ".stl", ".obj")
"""Suffixes of pages, photographs, descriptions, archives and meshes."""

NETCDF = "a netCDF file is written, expected .nc"
"""Text for `check_suffix` where a sweep, an image or a reconstruction is saved."""


def check_suffix(path: str | Path, what: str) -> None:
    """Refuse to write a netCDF file, or a folder, under a name whose suffix belongs to another format.

    Parameters
    ----------
    path : path
    what : str
        What is written, and what its name should be, for the message.

    Raises
    ------
    InputError
    """
    suffix = Path(path).suffix.lower()
    if suffix and suffix != ".nc" and suffix in _foreign():
        raise InputError(f"{path}: has the suffix {Path(path).suffix!r}, and {what}; rename it")


def _foreign() -> set[str]:
    """Suffixes of all other formats; those of HDF5 are allowed, because netCDF-4 files are HDF5."""
    from mirrorfold.io.exports.results import FORMATS
    from mirrorfold.io.readers import readers

    found = {*PICTURES, *OTHERS, *FORMATS}
    with suppress(InputError):  # a reader of another package that cannot be loaded is no reason to write nothing
        found |= {suffix for reader in readers().values() for suffix in reader.suffixes}
        found -= set(readers()["hdf5"].suffixes)
    return found
