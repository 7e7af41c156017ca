"""Pixels where a scene is: those of a default grid reach to the ambiguous range and far to both sides."""

from __future__ import annotations

from typing import Any

import xarray as xr

from mirrorfold.common.types import Array
from mirrorfold.focusing.grid import default_grid

Limits = tuple[float, float]


def pixels_within(sweep: xr.Dataset, x: Limits, y: Limits) -> dict[str, Any]:
    """The pixels of the default grid between two x and two y [m], as arguments of `mirrorfold.focus`.

    The limits must hold the scene with all its ghosts. Then the rest of the default grid shows nothing.
    """
    every_x, every_y = default_grid(sweep["frequency"].values, sweep["tx_position"].values, sweep["rx_position"].values)
    return {"x": _between(every_x, x), "y": _between(every_y, y)}


def _between(axis: Array, limits: Limits) -> Array:
    """The pixels of an axis that lie between two limits [m]."""
    return axis[(axis >= limits[0]) & (axis <= limits[1])]
