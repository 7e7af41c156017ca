"""The points of a reconstruction that count."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.common.types import Mask
from mirrorfold.errors import InputError
from mirrorfold.folding.settings import FoldSettings


def shown_points(reconstruction: xr.DataTree, min_confidence: float | None = None) -> xr.Dataset:
    """Points of at least that confidence, by default the one set for folding: these are drawn, scored and exported.

    Of files of earlier versions, whose confidence is no probability, all points count unless one is asked for.

    Raises
    ------
    InputError
        If the confidence is no number from 0 to 1, or the points have none.
    """
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    if min_confidence is None:
        min_confidence = float(reconstruction.attrs.get("fold_min_confidence", 0.0))
    else:
        FoldSettings.rules()["min_confidence"].check("min_confidence", min_confidence)
    if min_confidence > 0.0 and "confidence" not in objects:
        raise InputError("reconstruction: its points have no confidence; leave min_confidence out")
    return objects.isel(point=objects["confidence"].values >= min_confidence) if min_confidence > 0.0 else objects


def passed_walls(objects: xr.Dataset) -> Mask:
    """Which points of a table were seen through a half-transparent wall, and stand where they are seen, (n,)."""
    if "wall" not in objects:
        return np.zeros(objects.sizes.get("point", 0), dtype=bool)
    return np.asarray(objects["wall"].values.astype(str) != "")


def confident(reconstruction: xr.DataTree, min_confidence: float | None = None) -> xr.DataTree:
    """A reconstruction with the points of `shown_points` alone."""
    kept = reconstruction.copy()
    kept["/objects"] = xr.DataTree(shown_points(reconstruction, min_confidence))
    return kept
