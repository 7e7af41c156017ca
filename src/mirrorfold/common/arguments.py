"""Arguments of the wrong kind, in one sentence that never prints an array."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mirrorfold.errors import InputError

LONGEST = 60
"""Characters of a value that a message shows."""


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


def shown(value: Any) -> str:
    """A value as a message shows it: as Python writes it where that is short, else what it is.

    Examples
    --------
    >>> import numpy as np
    >>> shown(2.5), shown(np.zeros((2, 3)))
    ('2.5', 'an array of shape (2, 3) and type float64')
    """
    if getattr(value, "shape", ()):
        return described(value)
    text = repr(value)
    return text if len(text) <= LONGEST and "\n" not in text and " at 0x" not in text else described(value)


def wrong_kind(name: str, value: Any, expected: str) -> InputError:
    """The error for an argument that is of another kind.

    Parameters
    ----------
    name : str
        Of the argument or of the function.
    value : any
        What was given.
    expected : str
        What was expected, and where it comes from.
    """
    hint = "; read the file with mf.load" if isinstance(value, str | Path) else ""
    return InputError(f"{name}: got {described(value)}, expected {expected}{hint}")
