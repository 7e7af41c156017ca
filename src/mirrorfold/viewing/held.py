"""What a reconstruction that is opened in the live page holds: its settings, and what a new fold would lose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.errors import InputError
from mirrorfold.folding import FoldSettings
from mirrorfold.folding.confident import confident_points, passed_walls
from mirrorfold.tree.half_transparent.transparent import BY_POLARIZATION


def what_is_lost(reconstruction: xr.DataTree) -> str:
    """What gets lost when a reconstruction is folded anew, as a note for the page; empty where nothing does."""
    objects = confident_points(reconstruction)
    told = "decided" in objects and objects["decided"].values[passed_walls(objects)] == BY_POLARIZATION
    if not (count := int(np.count_nonzero(told))):
        return ""
    points = "1 point was" if count == 1 else f"{count} points were"
    return (
        f"{points} told by a second polarization to have passed through a wall. This file holds one polarization: "
        "folded anew, they are taken for reflections. Open the sweep or the image to keep them."
    )


def held_settings(attrs: Mapping[Any, Any], defaults: FoldSettings) -> dict[str, Any]:
    """Every setting of folding as the attributes of a reconstruction record it, else its default.

    Defaults are taken because files of other versions lack some settings, or have values that this version does not
    know.
    """
    held = {}
    for name, rule in FoldSettings.rules().items():
        value: Any = attrs.get(f"fold_{name}")
        value = value.item() if isinstance(value, np.generic) else value
        try:
            rule.check(name, value)
        except InputError:
            value = getattr(defaults, name)
        held[name] = value
    return held
