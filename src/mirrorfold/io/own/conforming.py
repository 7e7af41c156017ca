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

ROWS = {"/objects": "point", "/mirrors": "mirror"}
"""The dimension of each table of a reconstruction."""

TOGETHER = {
    "/objects": (("z", "z_initial"),),
    "/mirrors": (
        tuple(f"{folded}z{end}" for folded in ("", "folded_") for end in "01"),
        tuple(f"{folded}corner_{axis}" for folded in ("", "folded_") for axis in "xyz"),
    ),
}
"""Columns of volumes: a table has all of a group, or none."""

MEASURED = {
    "wave_speed": 1.0,
    **dict.fromkeys(("frequency_start", "frequency_stop"), 1e-3),
    **dict.fromkeys(("range_resolution", "ambiguous_range", "spot_radius", "focus_distance"), 1e-9),
    **dict.fromkeys(("tx_aperture", "rx_aperture", "frequency_points"), 0.0),
}
"""Attributes that are numbers, and less than any radar or sonar has of each [m/s, Hz, m, 1]."""

ENDLESS = ("range_resolution", "ambiguous_range")
"""Attributes that may be infinite, as of a sweep with a single frequency."""

DIRECTED = ("radar_position", "array_direction")
"""Attributes that are a place or a direction."""

COUNTS = {"bounces": 0, "generation": 0, "parent": -1}
"""Columns of whole numbers, and the smallest that each may hold."""

MOST_BOUNCES = 1000
"""A chain of more bounces is a mistake: every bounce costs some decibels."""


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


def check_facts(attrs: Mapping[Any, Any], source: str, prefix: str = "") -> None:
    """Refuse facts of the measurement that none can be, in the attributes of an image or of a reconstruction.

    Parameters
    ----------
    attrs : dict
    source : str
        Names the file in the message.
    prefix : str
        What the names begin with: a reconstruction calls those of its image ``image_...``.

    Raises
    ------
    InputError
    """
    for name, least in MEASURED.items():
        value = attrs.get(f"{prefix}{name}")
        if value is None:
            continue
        values = np.asarray(value)
        number = values.ndim == 0 and values.dtype.kind in "fiu"
        if not number or not values >= least or (np.isinf(values) and name not in ENDLESS):
            what = f"attr {prefix}{name} is {shown(value)}, expected a number of at least {least:g}"
            raise InputError(f"{source}: {what}; write it in SI units, or leave it out")
    for name in DIRECTED:
        value = attrs.get(f"{prefix}{name}")
        if value is None:
            continue
        values = np.asarray(value)
        if values.shape not in ((2,), (3,)) or values.dtype.kind not in "fiu" or unplaced(values) is not None:
            raise InputError(f"{source}: attr {prefix}{name} is {shown(value)}, expected two or three numbers")
        if name == "array_direction" and not np.linalg.norm(values[:2]) > 0.0:
            raise InputError(f"{source}: attr {prefix}{name} is {shown(value)}, expected a direction in the plane")
    start, stop = (attrs.get(f"{prefix}frequency_{end}") for end in ("start", "stop"))
    several = (attrs.get(f"{prefix}frequency_points") or 0) > 1
    if start is not None and stop is not None and (start > stop or (several and start == stop)):
        raise InputError(f"{source}: attr {prefix}frequency_stop is {shown(stop)}, expected more than {shown(start)}")


def check_tables(nodes: Mapping[str, xr.DataTree], columns: Mapping[str, Mapping[str, Any]], source: str) -> None:
    """Refuse tables that lack some of their columns, places that are none, and columns that hold no numbers.

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
    for group, row in ROWS.items():
        held = nodes[group].to_dataset(inherit=False)
        for names in TOGETHER[group]:
            there = [name for name in names if name in held.variables]
            if there and len(there) < len(names):
                missing = next(name for name in names if name not in there)
                raise InputError(
                    f"{source}: {missing!r} is missing from the group {group}, which has {there[0]!r}; fold again"
                )
        for name, column in held.variables.items():
            expected = (row, "corner") if "corner_" in str(name) else (row,)
            if PLACES.fullmatch(str(name)) and column.dims != expected:
                where = f"{source}: {name!r} in the group {group}"
                raise InputError(f"{where} has dimensions {column.dims}, expected {expected}; fold again")
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
