"""Attributes as netCDF can hold them: lists, dicts, booleans and None become JSON, texts only printable characters."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from mirrorfold.errors import printable

DEEPEST = 8
"""Largest number of levels of nested lists in an attribute; a text with more only looks like JSON."""


def storable(value: Any) -> Any:
    """An attribute as netCDF can hold it: numbers, texts and arrays of numbers as they are, all else as JSON.

    `decoded` is the inverse.
    """
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.size:
        return value
    return json.dumps(value, default=_plain)


def decoded(value: Any) -> Any:
    """An attribute as it was before `storable`, with only printable characters in texts."""
    if isinstance(value, str) and (value[:1] in ("[", "{") or value in ("true", "false", "null")):
        with suppress(ValueError, RecursionError):  # a text that only begins like JSON
            return _with_printable(json.loads(value), DEEPEST)
    return printable(value) if isinstance(value, str) else value


def _with_printable(value: Any, levels: int) -> Any:
    """A value of JSON with only printable characters in its texts.

    Raises
    ------
    ValueError
        If lists and objects are nested in more than `levels` levels.
    """
    if isinstance(value, str):
        return printable(value)
    if not isinstance(value, list | dict):
        return value
    if levels == 0:
        raise ValueError("nested too deeply")
    if isinstance(value, list):
        return [_with_printable(item, levels - 1) for item in value]
    return {printable(name): _with_printable(item, levels - 1) for name, item in value.items()}


def _plain(value: Any) -> Any:
    """A value that JSON cannot hold, as one that it can: numbers and arrays of NumPy, mappings, and others as text."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    return str(value)
