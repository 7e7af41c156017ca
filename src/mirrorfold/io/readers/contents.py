"""What a reader returns, named arrays, and the checks that keep hostile files from filling the memory.

Before anything is allocated, sizes are read from headers, and compared with the size of the file and the free memory.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common import memory
from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.reading import check_file, names_outside
from mirrorfold.errors import InputError

HARMLESS_BYTES = 64 << 20
"""Size to which any file may expand [bytes]."""

LARGEST_EXPANSION = 200.0
"""Largest factor by which a file may expand beyond `HARMLESS_BYTES`. Measured samples compress by less than ten, zip
bombs by a thousand (the limit of the deflate algorithm is 1032)."""

MEMORY_SHARE = 0.5
"""Share of the free memory that the content of one file may take."""


@dataclass(frozen=True)
class Variable:
    """An array in a file, which is read when it is needed.

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
    load : callable
        Returns the array.
    dims : tuple of str
        Names of its axes, where the file tells them.
    attrs : dict
        Its attributes in the file, such as `units`.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    load: Callable[[], NDArray]
    dims: tuple[str, ...] = ()
    attrs: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def of(array: NDArray, dims: tuple[str, ...] = (), attrs: Mapping[str, Any] | None = None) -> Variable:
        """A variable whose array is in memory already."""
        return Variable(array.shape, array.dtype, lambda: array, dims, attrs or {})


@dataclass(frozen=True)
class Spectra:
    """Scattering parameters over frequency, as a network analyser writes them.

    Attributes
    ----------
    frequency : (frequencies,) array [Hz]
    parameters : dict of (frequencies,) complex arrays
        Scattering parameters by name, such as ``"S21"``.
    bare_phases : dict of (frequencies,) arrays
        By parameter, the phases whose unit only their values told: those of all files of a scan tell it better.
    """

    frequency: NDArray[np.float64]
    parameters: Mapping[str, NDArray[np.complex128]]
    bare_phases: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


@dataclass(frozen=True)
class Contents:
    """Everything a reader has found in a file.

    Attributes
    ----------
    path : Path
    reader : str
        Name of the reader.
    variables : dict of Variable
        Variables by name; the names of structures or groups and their fields are joined by dots.
    attrs : dict
        Attributes of the file.
    spectra : Spectra, optional
        Scattering parameters, in files of a network analyser.
    mapping : dict, optional
        The content of a mapping file for the variables, where the format tells what they mean.
    """

    path: Path
    reader: str
    variables: Mapping[str, Variable]
    attrs: Mapping[str, Any] = field(default_factory=dict)
    spectra: Spectra | None = None
    mapping: Mapping[str, Any] | None = None

    def not_understood(self) -> str:
        """Which headings of a table are not understood, or lack the other part of samples, in words; else empty."""
        unknown, halves = self.attrs.get("unknown headings") or [], self.attrs.get("halves") or {}
        said = [f"holds the headings {listed(map(repr, unknown))}, which are not understood"] if unknown else []
        said += [f"holds {what} alone, {heading!r}, without the other part" for heading, what in halves.items()][:1]
        return ", and ".join(said)

    def warn_of_columns(self) -> None:
        """Warn of the columns of a table that are not understood, and so left out."""
        unknown = [*self.attrs.get("unknown headings", ()), *self.attrs.get("halves", ())]
        if unknown:
            warnings.warn(left_out(self.path, unknown), stacklevel=5)

    def array(self, name: str) -> NDArray:
        """The values of a variable.

        Raises
        ------
        InputError
            If there is none of this name, or it is too large for the memory.
        """
        if not isinstance(name, str):
            raise wrong_kind("variable", name, f"one of: {listed(self.variables) or 'none'}")
        if name not in self.variables:
            raise InputError(
                f"{self.path}: holds no variable {name[:LONGEST_NAME]!r}; it holds {listed(self.variables) or 'none'}"
            )
        variable = self.variables[name]
        check_memory(self.path, nbytes(variable.shape, variable.dtype.itemsize), f"its variable {name!r}")
        try:
            return variable.load()
        except InputError:
            raise
        except Exception as error:  # libraries report damage by exceptions of many types
            raise damaged(self.path, error) from None


LISTED = 12
"""Largest number of names that a message lists."""

LONGEST_NAME = 40
"""Largest number of characters of each."""


def listed(names: Iterable[str]) -> str:
    """The first few names, for a message that has to fit on one screen.

    Examples
    --------
    >>> listed(["a", "b"]), listed(f"S{n}" for n in range(1600))
    ('a, b', 'S0, S1, S2, S3, S4, S5, S6, S7, S8, S9, S10, S11 and 1588 more')
    """
    held = [name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..." for name in names]
    more = f" and {len(held) - LISTED} more" if len(held) > LISTED else ""
    return ", ".join(held[:LISTED]) + more


def left_out(path: Path, headings: Iterable[str]) -> str:
    """What a warning says of the columns of a table that are not understood, and so left out."""
    which = "some columns" if names_outside() else f"the columns {listed(map(repr, headings))}"
    return f"{path}: {which} are not understood and left out"


def unit_attribute(names: Iterable[str]) -> str | None:
    """The name of the attribute that tells the unit of an array: "units", else "unit", whatever the capitals.

    Examples
    --------
    >>> unit_attribute(["unit", "Units", "scale"]), unit_attribute(["UNIT"]), unit_attribute(["scale"])
    ('Units', 'UNIT', None)
    """
    found = {name.lower(): name for name in sorted(names)}  # small letters come last, and count first
    return found.get("units", found.get("unit"))


def nbytes(shape: tuple[int, ...], itemsize: int) -> int:
    """Size of an array [bytes], as a Python integer, which does not overflow."""
    size = int(itemsize)
    for length in shape:
        size *= int(length)
    return size


def check_memory(path: Path, size: float, what: str = "its content") -> None:
    """Refuse content of `size` bytes that does not fit into the free memory.

    Raises
    ------
    InputError
    """
    if size < memory.UNASKED_BYTES:  # a scan may consist of thousands of small files
        return
    free = MEMORY_SHARE * memory.available_memory()
    if size > free:
        raise InputError(
            f"{path}: {what} would take {size / 2**30:.3g} GiB of memory and {free / 2**30:.3g} GiB may be used; "
            "the file is damaged, or has to be split"
        )


def check_expansion(path: Path, stored: float, size: float, what: str = "its content") -> None:
    """Refuse content that expands too much from `stored` to `size` bytes, or does not fit into the memory.

    Raises
    ------
    InputError
    """
    if size > max(HARMLESS_BYTES, LARGEST_EXPANSION * stored):
        raise InputError(
            f"{path}: {what} would expand from {stored:.0f} bytes to {size:.3g}, which no measurement does; "
            "the file is damaged or made to fill the memory"
        )
    check_memory(path, size, what)


def read_bytes(path: Path, *, growth: float = 1.0) -> bytes:
    """Read all bytes of a file whose content takes `growth` times its size in memory.

    Raises
    ------
    InputError
        If the file is empty, cannot be read, or does not fit into the memory.
    """
    check_file(path, "check the path, and give a file")
    try:
        size = path.stat().st_size
        if size == 0:
            raise InputError(f"{path}: is empty; measure or copy it again")
        check_memory(path, growth * size)
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from None


def damaged(path: Path, error: BaseException) -> InputError:
    """An error that a library has raised for a damaged file, as an `InputError` of one sentence."""
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return InputError(f"{path}: is damaged or not of the format it seems to be ({reason}); copy or export it again")
