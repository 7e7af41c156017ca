"""Readers of measured data: one for each file format, found by the first bytes of a file.

To add one, write a module here with ``READER = Reader(name, description, recognises, read)``, like `citi`, and add its
name to `OWN`; `read` returns `Contents` (`contents`). Other packages add readers by entry points of the group
``mirrorfold.readers``, each of which names a `Reader`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from mirrorfold.common.arguments import one_of
from mirrorfold.common.reading import check_file, read_head
from mirrorfold.errors import InputError, printable
from mirrorfold.io.readers.contents import Contents, Spectra, Variable, damaged

ENTRY_POINT_GROUP = "mirrorfold.readers"

HEAD_BYTES = 4096
"""Number of the first bytes of a file that `Reader.recognises` receives."""


@dataclass(frozen=True)
class Reader:
    """A file format.

    Attributes
    ----------
    name : str
        Name by which users choose it.
    description : str
        One line.
    recognises : callable
        Called with the path and the first bytes of a file; returns whether the file is of this format.
    read : callable
        Called with the path; returns the `Contents`.
    suffixes : tuple of str
        Usual suffixes of such files, in lower case: `mirrorfold.load` reads files with them, and files of other formats
        are not saved under them.
    """

    name: str
    description: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Path], Contents]
    suffixes: tuple[str, ...] = ()


OWN = ("acconeer", "touchstone", "matlab", "hdf5", "netcdf3", "numpy_files", "citi", "cloud", "table")
"""Modules with a `READER`, in the order in which they are asked to recognise a file: special before general ones."""


@cache
def readers() -> dict[str, Reader]:
    """All readers by name, those of other packages first.

    Raises
    ------
    InputError
        If an entry point cannot be loaded or is no reader.
    """
    found: dict[str, Reader] = {}
    for point in entry_points(group=ENTRY_POINT_GROUP):
        try:
            reader = point.load()
        except Exception as error:  # other packages may raise anything
            raise InputError(f"the reader {point.name!r} of {point.value} cannot be loaded ({error})") from None
        if not isinstance(reader, Reader):
            raise InputError(f"the reader {point.name!r} of {point.value} is a {type(reader).__name__}, not a Reader")
        found[reader.name] = reader
    for module in OWN:
        reader = importlib.import_module(f"{__name__}.{module}").READER
        found.setdefault(reader.name, reader)
    return found


def recognise(path: Path) -> Reader:
    """Find the reader of a file, by its first bytes and its name.

    Raises
    ------
    InputError
        If there is no such file, it is empty, or no reader recognises it.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a directory; give the files in it, or the folder with --positions")
    check_file(path, "check the path, and give a file")
    head = read_head(path, HEAD_BYTES)
    if not head:
        raise InputError(f"{path}: is empty; measure or copy it again")
    for reader in readers().values():
        try:
            if reader.recognises(path, head):
                return reader
        except InputError:
            raise
        except Exception as error:  # readers of other packages may raise anything
            raise damaged(path, error) from None
    names = ", ".join(readers())
    raise InputError(f"{path}: is of no format that is known ({names}); export it as one of these")


def read_contents(path: str | Path, reader: str | None = None) -> Contents:
    """Read the contents of a file.

    Parameters
    ----------
    path : path
    reader : str, optional
        Name of the reader; by default it is recognised.

    Raises
    ------
    InputError
        If the file cannot be read. No other error is raised, whatever the file contains.
    """
    path = Path(path)
    chosen = recognise(path)
    if reader is not None:
        chosen = readers()[one_of("reader", reader, readers())]
    try:
        return _with_printable_names(chosen.read(path))
    except InputError:
        raise
    except Exception as error:  # libraries report damage by exceptions of many types
        raise damaged(path, error) from None


def _with_printable_names(contents: Contents) -> Contents:
    """The contents with printable names of variables: other characters are replaced, and names stay distinct."""
    named: dict[str, Variable] = {}
    for name, variable in contents.variables.items():
        clean = printable(name)
        while clean in named:
            clean += "_"
        named[clean] = variable
    return replace(contents, variables=named)


__all__ = ["Contents", "Reader", "Spectra", "Variable", "read_contents", "readers", "recognise"]
