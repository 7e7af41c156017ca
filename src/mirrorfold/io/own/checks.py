"""Checks of what images and reconstructions must hold, because files may be damaged or come from other programs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.arguments import in_message, wrong_kind
from mirrorfold.common.facts import VOLUME, VOXELS, check_facts, check_unit
from mirrorfold.common.plausible import not_finite, unplaced
from mirrorfold.errors import InputError
from mirrorfold.sweep import STEP_TOLERANCE

TEXTS = ("title", "instrument", "description", "remark", "command", "preset", "time_convention")
"""Attributes that are texts."""

PLACES = re.compile(r"(folded_)?(corner_)?[xyz]([01]|_initial)?")
"""Names of the columns with coordinates in the tables of a reconstruction."""

NUMBERS = re.compile(
    r"(folded_)?((center|normal|axis)_)?[xyz]m?|(\w+_)?error|frame|amplitude|bounces|confidence|confocal|interpolated|"
    r"growth|passed|parent|generation|strength|fill|depth|curvature|permittivity|thickness|beyond_(start|end)"
)
"""Names of all other columns of numbers in these tables; some are NaN where they have no meaning."""

CURVATURE_COLUMNS = re.compile(r"curvature|(folded_)?[xyz]m")
"""Columns that describe the arc of a curved mirror; for straight mirrors they may be NaN."""

TEXT_COLUMNS = {"caustic", "chain", "decided", "explanation", "surface", "wall"}
"""Columns of texts."""

ROWS = {"/objects": "point", "/mirrors": "mirror"}
"""The dimension of each table of a reconstruction."""

COLUMN_GROUPS = {
    "/objects": (("z", "z_initial"), ("passed", "wall")),
    "/mirrors": (
        ("curvature", "xm", "ym", "folded_xm", "folded_ym"),
        tuple(f"{folded}z{end}" for folded in ("", "folded_") for end in "01"),
        tuple(f"{folded}corner_{axis}" for folded in ("", "folded_") for axis in "xyz"),
    ),
}
"""Groups of columns in each table: a table has all columns of a group, or none."""

COUNTS = {"bounces": 0, "generation": 0, "parent": -1}
"""Columns of whole numbers, and the smallest value of each."""

MOST_BOUNCES = 1000
"""Largest number of bounces of a chain; more must be a mistake, as every bounce costs some decibels."""


IMAGE_DIMENSIONS = (VOXELS, ("y", "x"), VOLUME)
"""Dimensions of a single image; dimensions before them, such as `frame`, count several images."""


def conform_attrs(attrs: dict[Any, Any]) -> None:
    """Make texts of attributes that must be texts, and remove settings of folding with invalid values, in place."""
    for name, value in list(attrs.items()):
        if name in TEXTS and not isinstance(value, str):
            attrs[name] = "" if value is None or isinstance(value, float) or not np.size(value) else str(value)
        elif name == "processing" and not isinstance(value, str | list):
            attrs[name] = [] if value is None or not np.size(value) else [str(value)]
    if any(str(name).startswith("fold_") for name in attrs):
        _drop_wrong_settings(attrs)


def _drop_wrong_settings(attrs: dict[Any, Any]) -> None:
    """Remove settings with values that this version does not allow."""
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
    """Refuse a position of the radar that is no valid number of metres.

    Raises
    ------
    InputError
    """
    for name in ("radar_x", "radar_y", "radar_z"):
        value = attrs.get(name, 0.0)
        if isinstance(value, bool) or np.ndim(value) or unplaced(np.asarray(value)) is not None:
            raise InputError(f"{source}: attr {name} is {in_message(value)}, expected a number of metres")


def check_tables(nodes: Mapping[str, xr.DataTree], source: str) -> None:
    """Refuse tables that lack some of their columns, invalid places, and columns without the numbers or texts expected.

    Parameters
    ----------
    nodes : dict
        The groups of a reconstruction by their paths.
    source : str
        Name of the file in the message.

    Raises
    ------
    InputError
    """
    for group, row in ROWS.items():
        held = nodes[group].to_dataset(inherit=False)
        for names in COLUMN_GROUPS[group]:
            there = [name for name in names if name in held.variables]
            if there and len(there) < len(names):
                missing = next(name for name in names if name not in there)
                raise InputError(
                    f"{source}: {missing!r} is missing from the group {group}, which has {there[0]!r}; fold again"
                )
        bent = np.nan_to_num(held["curvature"].values) != 0.0 if _has_numbers(held, "curvature") else slice(0)
        for name, column in held.variables.items():
            expected = (row, "corner") if "corner_" in str(name) else (row,)
            ours = name in TEXT_COLUMNS or PLACES.fullmatch(str(name)) or NUMBERS.fullmatch(str(name))
            if ours and column.dims != expected:
                where = f"{source}: {name!r} in the group {group}"
                raise InputError(f"{where} has dimensions {column.dims}, expected {expected}; fold again")
            wrong = _wrong(str(name), column.values)
            if wrong is None and CURVATURE_COLUMNS.fullmatch(str(name)):
                wrong = unplaced(column.values[bent])
            if wrong is not None:
                raise InputError(f"{source}: {name!r} in the group {group} holds a value that {wrong}; fold again")


def _has_numbers(held: xr.Dataset, name: str) -> bool:
    """Whether a table has a column of floating-point numbers with this name."""
    return name in held.variables and held[name].dtype.kind == "f" and held[name].ndim == 1


def _wrong(name: str, values: Any) -> str | None:
    """What is wrong with the values of a column, in words; None where nothing is."""
    if PLACES.fullmatch(name):
        return unplaced(values)
    if name in TEXT_COLUMNS:
        return None if all(isinstance(value, str) for value in values.flat) else "is no text"
    if not NUMBERS.fullmatch(name):
        return None
    if values.dtype.kind not in "fiu" and not (name == "interpolated" and values.dtype.kind == "b"):
        return "is no real number"
    if name == "amplitude" and not np.isfinite(values).all():
        return "is not finite"
    if name in COUNTS:
        least, most = COUNTS[name], len(values) - 1 if name == "parent" else MOST_BOUNCES
        if not ((values >= least) & (values <= most) & (values % 1 == 0)).all():
            return f"is no whole number from {least} to {most}"
        if name == "parent" and _circles(values):
            return "leads from a mirror to itself"
    return None


def _circles(parent: Any) -> bool:
    """Whether a mirror is its own parent, or the parent of one of its parents. `parent` (n,) is -1 for the radar."""
    above = parent = np.asarray(parent, dtype=np.intp)
    for _ in range(len(parent).bit_length()):  # twice as many generations up in each turn
        above = np.where(above >= 0, above[above], -1)
    return bool((above >= 0).any())


def check_image(image: xr.DataArray, source: str = "image") -> xr.DataArray:
    """Check an image, and return it with the name ``image``.

    Raises
    ------
    InputError
        If the image is not valid. The message tells the first thing that is missing or wrong, and names the file as
        `source` says.
    """
    if not isinstance(image, xr.DataArray):
        raise wrong_kind(source, image, "an image (xarray.DataArray) with coordinates, as focus returns")
    if not image_axes(image):
        expected = "an image with (y, x), (z, y, x) or (range, azimuth, elevation)"
        raise InputError(f"{source}: has dimensions {image.dims}, expected {expected}")
    if image.dtype.kind not in "fc":
        raise InputError(f"{source}: has type {image.dtype}, expected real or complex floating-point amplitudes")
    if image.dtype.kind == "c" and image.dtype.itemsize > np.dtype(np.complex128).itemsize:
        raise InputError(
            f"{source}: has type {image.dtype}, which netCDF does not hold; take image.astype('complex64')"
        )
    if image.size == 0:
        raise InputError(f"{source}: is empty, its shape is {image.shape}; an image needs at least one pixel")
    _check_axes(image, source)
    missing = not_finite(image.values)
    if missing:
        raise InputError(
            f"{source}: {missing} pixels of {image.size} are not finite (NaN or infinite); "
            "replace them, for example by zero"
        )
    check_facts(image.attrs, source)
    return image.rename("image").assign_attrs(mirrorfold_kind="image")


def _check_axes(image: xr.DataArray, source: str) -> None:
    """Refuse an image whose pixels have no coordinates, or no equal steps.

    Raises
    ------
    InputError
    """
    axes = image_axes(image)
    plane = "z" in image.coords and axes == ("y", "x")
    if plane and (image["z"].ndim or unplaced(image["z"].values) is not None):
        raise InputError(
            f"{source}: z is {in_message(image['z'].values)}, expected the one height of the plane in metres"
        )
    for name in axes:
        if name not in image.coords:
            raise InputError(f"{source}: has no coordinate {name!r}; add the place of each pixel along it")
        check_unit(image[name], source)
        values = image[name].values
        wrong = unplaced(values)
        if wrong is not None:
            raise InputError(f"{source}: coordinate {name!r} holds a value that {wrong}; give metres, or degrees")
        step = np.diff(values)
        if step.size and (step.min() <= 0 or np.ptp(step) > 2 * STEP_TOLERANCE * step.mean()):
            raise InputError(
                f"{source}: coordinate {name!r} has steps from {step.min():g} to {step.max():g}, "
                "expected equal rising steps; sort it or resample to a uniform grid"
            )


def image_axes(image: xr.DataArray) -> tuple[str, ...]:
    """The dimensions of a single image, without those that count images; empty where it is no image."""
    return next((axes for axes in IMAGE_DIMENSIONS if image.dims[-len(axes) :] == axes), ())


def check_reconstruction(reconstruction: xr.DataTree, source: str = "reconstruction") -> xr.DataTree:
    """Check a reconstruction, and return it.

    The places of the objects, and the frames of tables, are made coordinates where they are variables. As variables
    they would be hidden by the coordinates of the pixels, which groups inherit from the root.

    Raises
    ------
    InputError
        If the reconstruction is not valid. The message tells the first thing that is missing or wrong, and names the
        file as `source` says.
    """
    if not isinstance(reconstruction, xr.DataTree):
        raise wrong_kind(source, reconstruction, "a reconstruction (xarray.DataTree), as fold and reconstruct return")
    kind = reconstruction.attrs.get("mirrorfold_kind")
    if kind != "reconstruction":
        raise InputError(
            f"{source}: mirrorfold_kind is {in_message(kind)}, expected 'reconstruction'; give the result of fold"
        )
    nodes = {node.path: node for node in reconstruction.subtree}
    recording = "frame" in reconstruction.dims
    for group, names in RECONSTRUCTION.items():
        if group not in nodes:
            raise InputError(f"{source}: the group {group} is missing from the reconstruction; fold the image again")
        held = nodes[group].to_dataset(inherit=False)
        if recording and group in ("/objects", "/mirrors"):
            names = {**names, "frame": next(iter(names.values()))}
        for name, dimensions in names.items():
            if name not in held.variables:
                raise InputError(f"{source}: {name!r} is missing from the group {group}; fold the image again")
            leading = ("frame",) if recording and dimensions == ("y", "x") else ()
            if held[name].dims != (*leading, *dimensions):
                raise InputError(
                    f"{source}: {name!r} in the group {group} has dimensions {held[name].dims}, expected {dimensions}"
                )
    for group, name in (("/", "intensity"), ("/initial", "initial"), ("/initial", "phase")):
        if name not in (held := nodes[group].to_dataset()):
            continue
        picture = held[name]
        if picture.dtype.kind not in "fiu":
            raise InputError(f"{source}: {name!r} has type {picture.dtype}, expected real amplitudes; fold again")
        _check_axes(picture, f"{source}: {name}")
    check_radar(reconstruction.attrs, source)
    check_facts(reconstruction.attrs, source, "image_")
    check_tables(nodes, source)
    for group, hidden in (("/objects", {"x", "y", "frame"}), ("/mirrors", {"frame"})):
        table = nodes[group].to_dataset(inherit=False)
        if hidden & set(table.data_vars):
            reconstruction = reconstruction.copy()
            reconstruction[group] = xr.DataTree(table.set_coords(list(hidden & set(table.data_vars))))
    return reconstruction


RECONSTRUCTION: dict[str, dict[str, tuple[str, ...]]] = {
    "/": {"intensity": ("y", "x")},
    "/initial": {"initial": ("y", "x")},
    "/objects": dict.fromkeys(
        ("x", "y", "x_initial", "y_initial", "amplitude", "bounces", "chain", "confidence"), ("point",)
    ),
    "/mirrors": dict.fromkeys(
        (
            *("x0", "y0", "x1", "y1", "folded_x0", "folded_y0", "folded_x1", "folded_y1"),
            *("parent", "generation", "strength"),
        ),
        ("mirror",),
    ),
}
"""The variables that a reconstruction of a plan view must hold: the dimensions of each, by group."""
