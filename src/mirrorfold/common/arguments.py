"""Checks of arguments, and the sentences that refuse wrong ones: they describe arrays but never print them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from math import isfinite
from numbers import Real
from pathlib import Path
from typing import Any, get_args

from mirrorfold.common.units import QUANTITIES, foreign_unit
from mirrorfold.errors import InputError

LONGEST_NAME = 255
"""Longest name of a file or folder in the usual file systems."""

LONGEST = 60
"""A message shows at most this many characters of a value."""


def described(value: Any) -> str:
    """What a value is, in a few words.

    Examples
    --------
    >>> import numpy as np
    >>> described(np.zeros((2, 3))), described(None), described({}), described("sweep.nc")
    ('an array of shape (2, 3) and type float64', 'None', 'a dict', "the text 'sweep.nc'")
    """
    if value is None:
        return "None"
    if isinstance(value, str | Path):
        return f"the {'text' if isinstance(value, str) else 'path'} {str(value)[:LONGEST]!r}"
    dims, shape, dtype = (getattr(value, name, None) for name in ("dims", "shape", "dtype"))
    if isinstance(shape, tuple) and dtype is not None:
        axes = f" with the dimensions {tuple(dims)}" if isinstance(dims, tuple) else ""
        return f"an array of shape {shape} and type {dtype}{axes}"
    if isinstance(value, bool | int | float | complex):
        return f"the number {repr(value)[:LONGEST]}"
    name = type(value).__name__
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"


def in_message(value: Any) -> str:
    """A value as a message shows it: as Python writes it if that is short, else by a description.

    Examples
    --------
    >>> import numpy as np
    >>> in_message(2.5), in_message(np.zeros((2, 3)))
    ('2.5', 'an array of shape (2, 3) and type float64')
    """
    if getattr(value, "shape", ()):
        return described(value)
    text = repr(value.item() if getattr(value, "shape", None) == () and hasattr(value, "item") else value)
    return text if len(text) <= LONGEST and "\n" not in text and " at 0x" not in text else described(value)


def wrong_kind(name: str, value: Any, expected: str, *, reader: str = "mf.load") -> InputError:
    """The error for an argument of the wrong kind.

    Parameters
    ----------
    name : str
        Name of the argument or of the function.
    value : any
        What was given.
    expected : str
        What was expected, and which function makes it.
    reader : str
        Function that reads such an object from a file. The message names it if a path was given; empty for none.
    """
    hint = f"; read the file with {reader}" if reader and isinstance(value, str | Path) else ""
    return InputError(f"{name}: got {described(value)}, expected {expected}{hint}")


WORDS = {
    "m": "metres", "m^2": "square metres", "Hz": "hertz", "s": "seconds", "degree": "degrees", "dB": "decibels",
    "dBm": "decibels", "dBi": "decibels", "m/s": "metres per second", "B": "bytes",
}  # fmt: skip
"""The names of units in messages."""


def finite(value: Any) -> float | None:
    """A value as a finite number, also from an array without dimensions; None for anything else.

    Examples
    --------
    >>> import numpy as np
    >>> finite(np.float32(0.5)), finite(np.array(2)), finite("2"), finite(True), finite(np.nan)
    (0.5, 2.0, None, None, None)
    """
    if not isinstance(value, Real) and getattr(value, "shape", None) == () and hasattr(value, "item"):
        value = value.item()
    if not isinstance(value, Real) or is_boolean(value):
        return None
    try:
        number = float(value)
    except (OverflowError, TypeError):  # a whole number of hundreds of digits, or a time of NumPy
        return None
    return number if isfinite(number) else None


def is_boolean(value: Any) -> bool:
    """Whether a value is True or False, of Python or of NumPy."""
    numpy = sys.modules.get("numpy")  # NumPy need not be imported here: its values exist only if it is already
    return isinstance(value, bool) or (numpy is not None and isinstance(value, numpy.bool_))


def number(
    name: str, value: Any, unit: str = "", *, above: float | None = None, lowest: float | None = None,
    highest: float | None = None,
) -> float:  # fmt: skip
    """A finite number, also from a text such as "80 mm" if the unit belongs to a known quantity.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : any
    unit : str
        One of `WORDS`, or empty for a pure number.
    above, lowest, highest : float, optional
        Bounds: strictly above `above`, from `lowest` to `highest`.

    Raises
    ------
    InputError
        If the value is no finite number, or out of bounds.

    Examples
    --------
    >>> number("pitch", "0.5 mm", "m"), number("seed", 3)
    (0.0005, 3.0)
    >>> number("pitch", -1, "m", above=0.0)
    Traceback (most recent call last):
    mirrorfold.errors.InputError: pitch is -1, expected a number of metres above 0
    """
    found = finite(value)
    if isinstance(value, str) and unit in QUANTITIES:
        try:
            found = finite(get_args(QUANTITIES[unit])[1].read(value))
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    if (
        found is None
        or (above is not None and found <= above)
        or (lowest is not None and found < lowest)
        or (highest is not None and found > highest)
    ):
        what = f"a number of {WORDS[unit]}" if unit else "a finite number"
        bounds = (("above", above), ("of at least", lowest), ("of at most", highest))
        limits = " and ".join(f"{words} {bound:g}" for words, bound in bounds if bound is not None)
        if lowest is not None and highest is not None:
            limits = f"from {lowest:g} to {highest:g}"
        raise InputError(f"{name} is {in_message(value)}, expected {what} {limits}".rstrip())
    return found


def expect_unit(name: str, value: Any, unit: str) -> None:
    """Refuse numbers that carry along another unit than `unit`, which NumPy would drop.

    Raises
    ------
    InputError
        If the numbers are in another unit.
    """
    other = foreign_unit(value, unit)
    if other is not None:
        raise InputError(f"{name} is in {other[:LONGEST]}, expected {unit}; convert it first")


def whole_number(
    name: str, value: Any, *, lowest: int = 0, highest: int | None = None, what: str = "a whole number"
) -> int:
    """A whole number of at least `lowest`, and at most `highest` if there is such a bound.

    Raises
    ------
    InputError
        If the value is no such number; `what` says what was expected.
    """
    found = finite(value)
    if found is None or not found.is_integer() or found < lowest or (highest is not None and found > highest):
        limits = f"of at least {lowest}" if highest is None else f"from {lowest} to {highest}"
        raise InputError(f"{name} is {in_message(value)}, expected {what} {limits}")
    return int(value)


def path_of(name: str, value: Any, expected: str = "the path of a file") -> Path:
    """An argument as a path.

    Raises
    ------
    InputError
        If the argument is no path, or one that no file can have.
    """
    if isinstance(value, str | os.PathLike):
        path = Path(value)
        if max(map(len, path.parts), default=0) > LONGEST_NAME:
            raise InputError(f"{name}: {described(path)} has a name of more than {LONGEST_NAME} letters; shorten it")
        return path
    raise wrong_kind(name, value, expected)


def one_of(name: str, value: Any, choices: Iterable[str]) -> str:
    """An argument that must be one of several names.

    Raises
    ------
    InputError
        If it is none of them.
    """
    known = list(choices)
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{name} is {in_message(value)}, expected one of {', '.join(known)}")
    return value


def boolean(name: str, value: Any) -> bool:
    """An argument as True or False; 1 and 0 count, too.

    Raises
    ------
    InputError
        If it is neither.
    """
    if not is_boolean(value) and finite(value) not in (0.0, 1.0):
        raise InputError(f"{name} is {in_message(value)}, expected True or False")
    return bool(value)


def listed(name: str, value: Any) -> list[Any]:
    """An argument as a list, from a list or a tuple.

    Raises
    ------
    InputError
        If it is neither.
    """
    if not isinstance(value, list | tuple):
        raise wrong_kind(name, value, "one, or a list of them", reader="")
    return list(value)
