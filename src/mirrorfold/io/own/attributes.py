"""Attributes as netCDF can hold them: lists, objects, booleans and nulls are JSON, texts hold only characters."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from mirrorfold.errors import printable

DEEPEST = 8
"""Lists within lists of an attribute; what goes deeper is a text that only looks like them."""


def storable(value: Any) -> Any:
    """Numbers, texts and arrays of numbers as they are; the rest as JSON, which `decoded` undoes."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.size:
        return value
    return json.dumps(value, default=_plain)


def decoded(value: Any) -> Any:
    """An attribute as it was before `storable`; texts hold only what is printable."""
    if isinstance(value, str) and (value[:1] in ("[", "{") or value in ("true", "false", "null")):
        with suppress(ValueError, RecursionError):  # it is a text that only begins like JSON
            return _with_printable(json.loads(value), DEEPEST)
    return printable(value) if isinstance(value, str) else value


def _with_printable(value: Any, levels: int) -> Any:
    """A value of JSON whose texts hold only what is printable.

    Raises
    ------
    ValueError
        If lists and objects are nested in more than so many levels.
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
    """What JSON has no word for."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    return str(value)
