"""Export of results for other programs as point clouds, files of VTK or floor plans, chosen by the suffix."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from mirrorfold.common.arcs import mirror_curves
from mirrorfold.common.arguments import one_of, wrong_kind
from mirrorfold.common.chains import mirror_chains
from mirrorfold.common.facts import VOLUME
from mirrorfold.errors import InputError
from mirrorfold.folding.confident import with_confident_points
from mirrorfold.folding.frames import pick_frame
from mirrorfold.io import plans
from mirrorfold.io.exports import vtk
from mirrorfold.io.exports.clouds import WRITERS, cloud_file, notes
from mirrorfold.io.files import check_output, written_atomically
from mirrorfold.io.own.checks import check_image, check_reconstruction

PICTURES = (".vti", ".vts")
"""Suffixes of files that can hold images."""

FORMATS = (*WRITERS, *PICTURES, *plans.SUFFIXES)
"""All suffixes of exported files."""


def export(
    obj: xr.DataTree | xr.DataArray,
    path: str | Path,
    *,
    what: Literal["points", "mirrors"] = "points",
    min_confidence: float | None = None,
) -> Path:
    """Write a reconstruction, or an image, to a file for other programs.

    Parameters
    ----------
    obj : xarray.DataTree or xarray.DataArray
        A reconstruction; an image for VTI, or the volume of a raster scan for VTS.
    path : path
        Its suffix tells the format. Folded points: ``.ply``, ``.pcd``, ``.vtp``, ``.csv``, ``.xyz``, see
        `mirrorfold.io.exports.clouds.cloud_file`. Mirrors: ``.vtp``, with walls at their true places (`image` 0) and
        where they appear in the unfolded image (`image` 1). Mirrors and points as a floor plan in layers: ``.dxf``,
        ``.geojson``. Pictures: ``.vti``, for a reconstruction `corrected` and `initial`; ``.vts`` for the volume of a
        raster scan. All lengths are in metres.
    what : {"points", "mirrors"}
        What a VTP file holds.
    min_confidence : float, optional
        Least confidence of points that are written; by default as the reconstruction was folded.

    Returns
    -------
    Path
        The path of the file.

    Raises
    ------
    InputError
        If the suffix is none of these, the format cannot hold the object, or the file cannot be written.
    """
    path = check_export_path(path)
    suffix = path.suffix.lower()
    one_of("what", what, ("points", "mirrors"))
    if what == "mirrors" and suffix != ".vtp":
        raise InputError(f"{path}: what is 'mirrors', which a VTP file alone may hold; give a name that ends in .vtp")
    content: bytes | None = None
    if isinstance(obj, xr.DataArray):
        content = _image_file(check_image(obj), path)
    elif not isinstance(obj, xr.DataTree):
        raise wrong_kind("export", obj, "a reconstruction or an image")
    else:
        obj = with_confident_points(check_reconstruction(obj), min_confidence)
        check_can_hold(path, obj)
        if suffix == ".vti":
            obj = pick_frame(obj)
            pictures = {"corrected": obj.dataset["intensity"], "initial": obj.children["initial"].dataset["initial"]}
            content = vtk.picture_file(pictures)
        elif what == "mirrors":
            content = mirrors_file(obj)
        elif suffix in WRITERS:
            content = cloud_file(obj, suffix)
    with written_atomically(path) as temporary:
        if content is not None:
            temporary.write_bytes(content)
        elif isinstance(obj, xr.DataTree):
            (plans.write_dxf if suffix == ".dxf" else plans.write_geojson)(obj, temporary)
    return path


def check_export_path(path: str | Path, *, inputs: Iterable[str | Path] = ()) -> Path:
    """Check that a file for other programs can be written at a path, and return the path.

    Raises
    ------
    InputError
        If its suffix is none of `FORMATS`, the library for it is absent, or as `mirrorfold.io.files.check_output`.
    """
    path = check_output(path, inputs=inputs)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: ends in {path.suffix!r}, expected one of {', '.join(FORMATS)}")
    if path.suffix.lower() == ".dxf":
        plans.load_ezdxf(path)
    return path


def check_can_hold(path: Path, source: Any) -> None:
    """Check that a file of this suffix can hold a reconstruction.

    Parameters
    ----------
    path : path
    source : xarray.DataTree, xarray.DataArray or xarray.Dataset, optional
        The reconstruction, or the image or sweep that it is made from.

    Raises
    ------
    InputError
        If the file is one of a volume, or of pictures while there are several frames.
    """
    if path.suffix.lower() == ".vts":
        raise InputError(f"{path}: a reconstruction holds no volume of beams; give the image, or a name in .vti")
    if path.suffix.lower() == ".vti" and source is not None:
        pick_frame(source)


def mirrors_file(reconstruction: xr.DataTree) -> bytes:
    """The mirrors of a reconstruction as a VTP file: at their true places, then where they appear in the image.

    They are lines, or faces in three dimensions.
    """
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    size = mirrors.sizes.get("mirror", 0)
    outlines, columns = [], {"mirror": np.tile(np.arange(size), 2), "image": np.repeat([0, 1], size)}
    for prefix in ("folded_", ""):
        if "corner_x" in mirrors:
            outlines += list(np.stack([mirrors[f"{prefix}corner_{axis}"].values for axis in "xyz"], axis=-1))
            continue
        outlines += [np.column_stack([line, np.zeros(len(line))]) for line in mirror_curves(mirrors, prefix)]
    columns |= {name: np.tile(mirrors[name].values, 2) for name in ("parent", "generation", "frame")
                if name in mirrors.variables}  # fmt: skip
    typed = {name: values.astype("<i4") for name, values in columns.items()}
    return vtk.walls_file(
        outlines,
        {**typed, "strength": np.tile(mirrors["strength"].values, 2).astype("<f4")},
        notes(mirror_chains(mirrors)),
        lines="corner_x" not in mirrors,
    )


def _image_file(image: xr.DataArray, path: Path) -> bytes:
    """An image as a VTI file, or the volume of a raster scan as a VTS file."""
    image = pick_frame(image)
    raster = image.dims[-3:] == VOLUME
    if (path.suffix.lower() == ".vts") != raster or path.suffix.lower() not in PICTURES:
        held, expected = ("the volume of a raster scan", ".vts") if raster else ("an image", ".vti")
        raise InputError(f"{path}: cannot hold {held}; give a name that ends in {expected}")
    return vtk.volume_file(image) if raster else vtk.picture_file({"image": image})
