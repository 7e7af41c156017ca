"""What files of others, and damaged ones, put in the place of texts, settings and tables of a reconstruction."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.arguments import shown
from mirrorfold.common.plausible import unplaced
from mirrorfold.errors import InputError

TEXTS = ("title", "instrument", "description", "remark", "command", "preset", "time_convention")
"""Attributes that are texts."""

PLACES = re.compile(r"(folded_)?(corner_)?[xyz]([01]|_initial)?")
"""Names of coordinates in the tables of a reconstruction."""

COUNTS = {"bounces": 0, "generation": 0, "parent": -1}
"""Columns of whole numbers, and the smallest that each may hold."""

MOST_BOUNCES = 1000
"""More of them are a mistake: every bounce costs some decibels."""


def conform_attrs(attrs: dict[Any, Any]) -> None:
    """Make texts of attributes that are texts, and drop settings of folding that none can be, in place."""
    for name, value in list(attrs.items()):
        if name in TEXTS and not isinstance(value, str):
            attrs[name] = "" if value is None or isinstance(value, float) or not np.size(value) else str(value)
        elif name == "processing" and not isinstance(value, str | list):
            attrs[name] = [] if value is None or not np.size(value) else [str(value)]
    if any(str(name).startswith("fold_") for name in attrs):
        _drop_wrong_settings(attrs)


def _drop_wrong_settings(attrs: dict[Any, Any]) -> None:
    """Leave out what a setting cannot be, as where another version had no such setting."""
    from mirrorfold.folding import FoldSettings

    for name, rule in FoldSettings.rules().items():
        value = attrs.get(f"fold_{name}")
        if value is None:
            continue
        try:
            rule.check(name, value.item() if isinstance(value, np.generic) else value)
        except InputError:
            del attrs[f"fold_{name}"]


def check_radar(attrs: Mapping[Any, Any], source: str) -> None:
    """Refuse a place of the radar that is none.

    Raises
    ------
    InputError
    """
    for name in ("radar_x", "radar_y", "radar_z"):
        value = attrs.get(name, 0.0)
        if isinstance(value, bool) or np.ndim(value) or unplaced(np.asarray(value)) is not None:
            raise InputError(f"{source}: attr {name} is {shown(value)}, expected a number of metres")


def check_tables(nodes: Mapping[str, xr.DataTree], columns: Mapping[str, Mapping[str, Any]], source: str) -> None:
    """Refuse places that are none, and columns of numbers that hold something else.

    Parameters
    ----------
    nodes : dict
        The groups of a reconstruction by their paths.
    columns : dict
        Names of the columns of each group.
    source : str
        Names the file in the message.

    Raises
    ------
    InputError
    """
    for group in ("/objects", "/mirrors"):
        for name, column in nodes[group].to_dataset(inherit=False).variables.items():
            wrong = _wrong(str(name), column.values, name in columns[group])
            if wrong is not None:
                raise InputError(f"{source}: {name!r} in the group {group} holds a value that {wrong}; fold again")


def _wrong(name: str, values: Any, known: bool) -> str | None:
    """What is wrong with a column; None where nothing is."""
    if PLACES.fullmatch(name):
        return unplaced(values)
    if not known or name == "chain":
        return None
    if values.dtype.kind not in "fiu":
        return "is no real number"
    if name == "amplitude" and not np.isfinite(values).all():
        return "is not finite"
    if name in COUNTS:
        least, most = COUNTS[name], len(values) if name == "parent" else MOST_BOUNCES
        if not ((values >= least) & (values <= most) & (values % 1 == 0)).all():
            return f"is no whole number from {least} to {most}"
    return None
