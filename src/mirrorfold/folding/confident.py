"""The points of a reconstruction that are confident enough to be drawn, scored and exported."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.common.types import Mask
from mirrorfold.errors import InputError
from mirrorfold.folding.settings import FoldSettings


def confident_points(reconstruction: xr.DataTree, min_confidence: float | None = None) -> xr.Dataset:
    """Points of at least `min_confidence`, by default that of the fold settings: they are drawn, scored and exported.

    In files of earlier versions, the confidence is no probability: by default, all their points count.

    Raises
    ------
    InputError
        If the confidence is no number from 0 to 1, or the points have none, or the table is none of points.
    """
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    if "point" not in objects.sizes:
        raise InputError(
            f"reconstruction: the group /objects has the dimensions {', '.join(map(str, objects.sizes)) or 'none'}, "
            "expected 'point'; rename them, or fold again"
        )
    if min_confidence is None:
        min_confidence = float(reconstruction.attrs.get("fold_min_confidence", 0.0))
    else:
        FoldSettings.rules()["min_confidence"].check("min_confidence", min_confidence)
    if min_confidence > 0.0 and "confidence" not in objects:
        raise InputError("reconstruction: its points have no confidence; leave min_confidence out")
    return objects.isel(point=objects["confidence"].values >= min_confidence) if min_confidence > 0.0 else objects


def passed_walls(objects: xr.Dataset) -> Mask:
    """Which points passed through a half-transparent wall, and so stand where the image shows them, (n,)."""
    if "wall" not in objects:
        return np.zeros(objects.sizes.get("point", 0), dtype=bool)
    return objects["wall"].values.astype(str) != ""


def with_confident_points(reconstruction: xr.DataTree, min_confidence: float | None = None) -> xr.DataTree:
    """A copy of the reconstruction that holds only its `confident_points`."""
    kept = reconstruction.copy()
    kept["/objects"] = xr.DataTree(confident_points(reconstruction, min_confidence))
    return kept
