"""Names that say another kind of file than what is written under them: by the readers and writers that there are."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from mirrorfold.errors import InputError

PICTURES = (".png", ".pdf", ".svg")
"""Of figures."""

OTHERS = (".html", ".htm", ".jpg", ".jpeg", ".tif", ".tiff", ".gif", ".json", ".toml", ".zip", ".stl", ".obj")
"""Of pages, photographs, descriptions, archives and meshes."""

NETCDF = "a netCDF file is written, expected .nc"
"""What is said of such a name where a sweep, an image or a reconstruction is saved."""


def check_suffix(path: str | Path, what: str) -> None:
    """Refuse to write a netCDF file, or a folder, under a name that says another kind of file.

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
    """Suffixes of all other kinds; netCDF-4 files are HDF5 and may say so."""
    from mirrorfold.io.exports.results import FORMATS
    from mirrorfold.io.readers import readers

    found = {*PICTURES, *OTHERS, *FORMATS}
    with suppress(InputError):  # a reader of another package that cannot be loaded is no reason to write nothing
        found |= {suffix for reader in readers().values() for suffix in reader.suffixes}
        found -= set(readers()["hdf5"].suffixes)
    return found
