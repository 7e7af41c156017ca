"""Images, points and mirrors as layers of napari, which finds this file by its manifest, `napari.yaml`.

Layers are placed in metres, with the axes (y, x) of the floor plan or (z, y, x) in space; a recording has its frames
before them. Nothing of napari is imported here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.arcs import mirror_curves
from mirrorfold.common.decibels import COLOURS, decibels
from mirrorfold.common.facts import VOLUME, VOXELS
from mirrorfold.common.statistics import mean_step
from mirrorfold.errors import InputError
from mirrorfold.focusing.scans.gridding import plan_view
from mirrorfold.folding.confident import confident_points
from mirrorfold.io import load

Layer = tuple[Any, dict[str, Any], str]
"""Data, keywords and kind of a layer, as napari wants it from a reader."""

FLOOR_DB = -40.0
"""Level of the weakest pixels that are shown."""

COLUMNS = ("amplitude", "confidence", "bounces", "chain", "surface", "frame")
"""What is told of each point, where the file holds it."""


def get_reader(path: str | list[str]) -> Callable[[str | list[str]], list[Layer]] | None:
    """The reader of a file, or None where it is not for us: what napari calls first.

    Parameters
    ----------
    path : str or list of str
        Of one file, or of several that are opened as one, which are not for us.
    """
    if not isinstance(path, str) or Path(path).suffix.lower() != ".nc":
        return None
    try:
        held = load(path)
    except InputError:
        return None
    return read if isinstance(held, xr.DataArray | xr.DataTree) else None


def read(path: str | list[str]) -> list[Layer]:
    """The layers of an image or a reconstruction.

    Parameters
    ----------
    path : str

    Returns
    -------
    list of (data, keywords, kind)
        Of an image one layer; of a reconstruction the initial picture, hidden, the corrected one, the points with their
        features, and the mirrors at their true places.

    Raises
    ------
    InputError
        If the file holds neither.
    """
    held = load(str(path))
    if isinstance(held, xr.DataArray):
        if held.dims[-3:] == VOLUME:
            held = plan_view(held)
        return [_picture(held, str(held.attrs.get("title") or "image"))]
    if not isinstance(held, xr.DataTree):
        raise InputError(f"{path}: is no image and no reconstruction, expected one of them")
    initial = _picture(held.children["initial"].dataset["initial"], "initial image", visible=False)
    corrected = _picture(held.dataset["intensity"], "corrected")
    pixel = float(np.diff(held.dataset["x"].values[:2])[0])
    return [initial, corrected, _mirrors(held, pixel), _points(held, pixel)]


def _picture(image: xr.DataArray, name: str, *, visible: bool = True) -> Layer:
    """Levels of a picture [dB], placed in metres."""
    space = [axis for axis in image.dims if axis in VOXELS]
    axes = [image[axis].values.astype(float) for axis in space]
    before = image.ndim - len(space)
    keywords: dict[str, Any] = {
        "name": name,
        "scale": [1.0] * before + [mean_step(axis) or 1.0 for axis in axes],
        "translate": [0.0] * before + [float(axis[0]) for axis in axes],
        "colormap": "gray_r",
        "contrast_limits": (FLOOR_DB, 0.0),
        "visible": visible,
        "metadata": dict(image.attrs),
    }
    return decibels(np.nan_to_num(np.abs(image.values)).astype(float), FLOOR_DB), keywords, "image"


def _points(held: xr.DataTree, pixel: float) -> Layer:
    objects = confident_points(held)
    axes = [axis for axis in "zyx" if axis in objects.variables]
    bounces = objects["bounces"].values
    keywords = {
        "name": "points",
        "features": {name: objects[name].values for name in COLUMNS if name in objects.variables},
        "face_color": [COLOURS[int(count) % len(COLOURS)] for count in bounces],
        "border_width": 0.0,
        "size": 2.0 * pixel,
    }
    places = np.stack([objects[axis].values for axis in axes], axis=-1).astype(float)
    if "frame" in objects.variables:
        places = np.column_stack([objects["frame"].values, places])
    return places, keywords, "points"


def _mirrors(held: xr.DataTree, pixel: float) -> Layer:
    mirrors = held.children["mirrors"].to_dataset(inherit=False)
    volume = "folded_corner_x" in mirrors
    if volume:
        outlines = list(np.stack([mirrors[f"folded_corner_{axis}"].values for axis in "zyx"], axis=-1).astype(float))
    else:
        outlines = [line[:, ::-1].astype(float) for line in mirror_curves(mirrors, "folded_")]
    if "frame" in mirrors.variables:
        outlines = [np.insert(outline, 0, frame, axis=1)
                    for outline, frame in zip(outlines, mirrors["frame"].values, strict=True)]  # fmt: skip
    generation = mirrors["generation"].values
    keywords = {
        "name": "mirrors",
        "shape_type": "polygon" if volume else "path",
        "features": {name: mirrors[name].values for name in ("generation", "parent", "strength")},
        "edge_color": [COLOURS[(int(number) - 1) % len(COLOURS)] for number in generation],
        "face_color": "transparent",
        "edge_width": pixel,
    }
    return outlines, keywords, "shapes"
