"""Step 6 of the algorithm: what has arrived at the root is the corrected scene, a Reconstruction."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold import __version__
from mirrorfold.detection.finding import example_mirror
from mirrorfold.detection.mirror import Mirror
from mirrorfold.folding.pictures import Grid, pictures
from mirrorfold.folding.points import Points
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree

FOLDED_ERRORS = "folded_angle_error", "folded_offset_error"
"""Names of a mirror's standard errors at its true place, which hold those of the mirrors on its way."""


def collect(
    image: xr.DataArray, found: Found, points: Points, settings: FoldSettings, *, grid: Grid | None = None
) -> xr.DataTree:
    """The folded scene with its origins, as a Reconstruction.

    Parameters
    ----------
    image : DataArray
        The unfolded image or volume.
    found, points, settings
        What the steps before returned, and what they were told.
    grid : tuple of 1D arrays [m], optional
        Pixel coordinates (x, y) of the pictures, and of a volume z. By default that of the image, grown where something
        folds to outside of it, or one around all points of a volume.

    Returns
    -------
    xarray.DataTree
        ``/``: `intensity`; ``/initial``: `initial`; ``/objects`` and ``/mirrors``.
    """
    sight, tree, axes = found.sight, found.tree, "xyz"[: found.sight.view.dimensions]
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "reconstruction",
        "mirrorfold_version": __version__,
        **{f"radar_{axis}": float(place) for axis, place in zip(axes, sight.view.radar, strict=True)},
        **{f"fold_{name}": value for name, value in asdict(settings).items()},
        "threshold": found.echoes.threshold,
        "reference": found.echoes.reference,
        **{f"mixed_{axis}": found.mixed[:, i] for i, axis in enumerate(axes)},
        **{f"image_{name}": value for name, value in image.attrs.items() if name != "mirrorfold_kind"},
        "remark": "" if tree.mirrors else "no mirror was found; the scene is shown unfolded",
    }
    if "title" in image.attrs:
        attrs["title"] = image.attrs["title"]
    (x, y), intensity, initial, what = pictures(image, found, points, settings.wall_margin or 0.0, grid)
    axes_of = {"y": ("y", y, {"units": "m", "long_name": "range"}),
               "x": ("x", x, {"units": "m", "long_name": "cross-range"})}  # fmt: skip
    drawn, before = (xr.Dataset({name: (("y", "x"), picture, {"long_name": what})}, axes_of)
                     for name, picture in (("intensity", intensity), ("initial", initial)))  # fmt: skip
    tables = {"/objects": _objects(points), "/mirrors": _mirrors(tree)}
    return xr.DataTree.from_dict({"/": drawn.assign_attrs(attrs), "/initial": before} | tables)


def _objects(points: Points) -> xr.Dataset:
    """The points as a table."""
    axes = "xyz"[: points.position.shape[1]]
    data: dict[str, Any] = {
        axis + suffix: ("point", place, {"units": "m", "long_name": text})
        for suffix, places, text in (("", points.position, "folded position"),
                                     ("_initial", points.initial, "position before folding"))
        for axis, place in zip(axes, places.T, strict=True)
    }  # fmt: skip
    confidence = "share of power above what had to be exceeded, times the filled share of each mirror on the way"
    data |= {
        "amplitude": ("point", points.amplitude.astype(np.float32)),
        "bounces": ("point", points.bounces, {"long_name": "mirrors on the way, 0 = line of sight"}),
        "chain": ("point", points.chain, {"long_name": "indices of the mirrors from the root"}),
        "surface": ("point", points.surface, {"long_name": "object, or face of a mirror"}),
        "confidence": ("point", points.confidence.astype(np.float32), {"long_name": confidence}),
    }
    # As coordinates of their own, those of the points take precedence over the images' axes of the same names.
    return xr.Dataset(data).set_coords(list(axes))


def _mirrors(tree: MirrorTree) -> xr.Dataset:
    """Every mirror in the unfolded image and at its true place."""
    folds, errors = tree.folds(), tree.errors()
    units = {"strength": "1", "angle_error": "degree", "offset_error": "m", "fill": "1", "depth": "m",
             **dict(zip(FOLDED_ERRORS, ("degree", "m"), strict=True))}  # fmt: skip
    nodes = [(node, node.line) for node in tree.walk() if node.line is not None]
    index = {(): -1} | {node.chain: i for i, (node, _) in enumerate(nodes)}

    def row(node: MirrorTree, mirror: Mirror) -> dict[str, Any]:
        parent = node.chain[:-1]
        true = {f"folded_{name}": value for name, value in mirror.columns(folds[parent]).items()}
        place = {"parent": np.int32(index[parent]), "generation": np.int32(node.generation)}
        own = {name: getattr(mirror, name, 0.0) for name in units}
        own |= dict(zip(FOLDED_ERRORS, errors.get(node.chain, (0.0, 0.0)), strict=True))
        own["chain"] = "/".join(map(str, node.chain))
        return mirror.columns(folds[()]) | true | place | own

    rows = [row(node, mirror) for node, mirror in nodes]
    size = len(rows)
    if not rows:  # the columns stay, with nothing in them
        rows.append(row(tree, example_mirror(tree.objects.position.shape[1])))
    data: dict[str, Any] = {}
    for name in rows[0]:
        values = np.array([row[name] for row in rows])[:size]
        dims = ("mirror", "corner")[: values.ndim]
        length = {} if values.dtype.kind in "iU" else {"units": units.get(name, "1" if "normal" in name else "m")}
        data[name] = (dims, values, length)
    return xr.Dataset(data)
