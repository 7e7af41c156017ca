"""Recordings: joins the Reconstructions of all frames into one, and picks one frame of it again.

In the Reconstruction of a recording, the pictures have a leading dimension `frame`, the tables of points and mirrors
have a column `frame`, and `parent` is a row of the table of all frames. The pictures share one grid, and are NaN where
the grid of a frame alone ends. Attributes that are the same in all frames become its attributes; the others stand, as
JSON, in the variable `attributes(frame)`. A table has the columns of all frames: on curved mirrors, for example, if one
frame has such a mirror; the columns that a frame alone lacks are named among its attributes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, MutableMapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar, cast

import numpy as np
import xarray as xr

from mirrorfold.common.arguments import finite, in_message, wrong_kind
from mirrorfold.common.reading import parsed
from mirrorfold.common.types import Array, Progress
from mirrorfold.errors import InputError

Framed = TypeVar("Framed", xr.Dataset, xr.DataArray, xr.DataTree)

PICTURES = {"/": ("intensity",), "/initial": ("initial", "phase")}
"""Names of the pictures of a Reconstruction, by group; not every Reconstruction has a phase."""

TABLES = (("objects", "point"), ("mirrors", "mirror"))
"""Group and dimension of each table of a Reconstruction."""

LACKING = "lacking"
"""Name, among the attributes of a frame, of the columns that its tables lack, by group."""

NEUTRAL = {"curvature": 0.0, "growth": 1.0}
"""What columns hold for a frame that lacks them: its mirrors are flat, and widen no cell. Other numbers are NaN, and
texts are empty."""


def frame_count(obj: Any) -> int | None:
    """Number of frames of a sweep, an image or a Reconstruction; None for one that is no recording."""
    held = obj.dataset if isinstance(obj, xr.DataTree) else obj
    if isinstance(held, xr.Dataset):
        held = held.get("intensity" if isinstance(obj, xr.DataTree) else "s")
    return int(held.sizes["frame"]) if isinstance(held, xr.DataArray) and "frame" in held.dims else None


def pick_frame(obj: Framed, frame: int | None = None) -> Framed:
    """One frame of a recording, as it would be alone.

    Parameters
    ----------
    obj : xarray.Dataset, xarray.DataArray or xarray.DataTree
        A sweep, an image or a Reconstruction.
    frame : int, optional
        Number of the frame, from 0. May be left out if there is only one.

    Returns
    -------
    The same kind of object, without the dimension `frame`; the object itself if it is no recording.

    Raises
    ------
    InputError
        If there is no such frame, or there are several and none is named.
    """
    if not isinstance(obj, xr.Dataset | xr.DataArray | xr.DataTree):
        raise wrong_kind("pick_frame", obj, "a sweep, an image or a reconstruction")
    number = _asked(frame, frame_count(obj))
    if number is None:
        return obj
    return _frame_of(obj, number) if isinstance(obj, xr.DataTree) else obj.isel(frame=number)


def _asked(frame: int | None, count: int | None) -> int | None:
    """The number of the frame that is asked for, of so many; None for an object that is no recording."""
    number = finite(frame)
    if count is None and (frame is None or number == 0):
        return None
    if frame is None and count == 1:
        return 0
    if count is None or number is None or not number.is_integer() or not 0 <= number < count:
        found = "no frames" if count is None else f"{count} frames, numbered from 0 to {count - 1}"
        remedy = "choose one with --frame N, in Python with mf.pick_frame(x, N)" if count else "leave --frame out"
        asked = "a frame is needed" if frame is None else f"frame is {in_message(frame)}"
        raise InputError(f"{asked}, but there are {found}; {remedy}")
    return int(number)


def _frame_of(recording: xr.DataTree, number: int) -> xr.DataTree:
    """One frame of the Reconstruction of a recording."""
    attributes = recording.dataset.get("attributes")
    place, remedy = f"reconstruction: the attributes of frame {number}", "reconstruct again"
    own = {} if attributes is None else parsed(str(attributes.values[number]), "JSON", place, remedy)
    lacking = own.pop(LACKING, {}) if isinstance(own, dict) else None
    if not isinstance(lacking, dict):
        raise InputError(f"{place} are no JSON object of values by their names; {remedy}")
    nodes: dict[str, xr.Dataset] = {}
    for path, names in PICTURES.items():
        held = _node(recording, path)
        pictures = held[[name for name in names if name in held]].isel(frame=number)
        part = pictures.dropna("y", how="all").dropna("x", how="all")
        nodes[path] = part.drop_vars([key for key in part.coords if key not in part.dims])
    nodes["/"].attrs = {**recording.attrs, **own}
    for group, dimension in TABLES:
        table = recording.children[group].to_dataset(inherit=False)
        chosen = np.flatnonzero(table["frame"].values == number)
        first = int(chosen[0]) if chosen.size else 0
        table = table.isel({dimension: chosen}).drop_vars(["frame", *lacking.get(group, [])], errors="ignore")
        nodes[f"/{group}"] = _moved(table, -first)
    return xr.DataTree.from_dict(nodes)


def named_frame(obj: Framed, frame: int | None = None) -> Framed:
    """As `pick_frame`, with the number of the frame in the title of what is picked by its number."""
    picked = pick_frame(obj, frame)
    if frame is not None and frame_count(obj) is not None:
        picked.attrs = {**picked.attrs, "title": f"{picked.attrs.get('title', '')} frame {frame}".strip()}
    return picked


def _moved(table: xr.Dataset, by: int) -> xr.Dataset:
    """A table with the row numbers in its column `parent`, if it has one, raised by `by`; -1, for no parent, stays."""
    if "parent" not in table:
        return table
    parent = table["parent"]
    return table.assign(parent=parent.copy(data=np.where(parent < 0, parent, parent + by).astype(parent.dtype)))


def each_frame(
    recording: xr.Dataset | xr.DataArray | xr.DataTree,
    work: Callable[..., xr.DataTree],
    finished: MutableMapping[int, xr.DataTree] | None,
    progress: Progress | None,
    **beside: Any,
) -> xr.DataTree:
    """The Reconstruction of a recording (a sweep, an image or a Reconstruction with frames), made frame by frame.

    The function `work` makes that of one frame, from this frame of the recording and of each object `beside` it, by
    name. If frames are to be kept in `finished`, each is stored there as soon as it is done, and taken from there if it
    is there already. Coordinates over the frames, such as `time`, are kept.
    """
    count = frame_count(recording)
    if not count:
        raise InputError("the recording has no frame; give one or more")
    kept = {} if finished is None else finished
    for number in range(count):
        if number not in kept:
            others = {name: None if held is None else pick_frame(held, number) for name, held in beside.items()}
            try:
                kept[number] = work(pick_frame(cast(Any, recording), number), **others)
            except InputError as error:
                raise InputError(f"frame {number}: {error}") from None
        if progress is not None:
            progress(number + 1, count)
    held = recording.dataset if isinstance(recording, xr.DataTree) else recording
    coords = {str(name): value.variable for name, value in held.coords.items() if value.dims == ("frame",)}
    return join_frames([kept[number] for number in range(count)], coords)


def check_finished(finished: Any) -> None:
    """Refuse what can keep no frames, also where there is no recording: anything but None, a mutable mapping, or a dict
    of reconstructions.
    """
    if not isinstance(finished, MutableMapping | None):
        raise wrong_kind("finished", finished, "a dict for the frames of a recording that are done", reader="")
    for number, kept in finished.items() if isinstance(finished, dict) else ():
        if not isinstance(kept, xr.DataTree):
            raise wrong_kind(f"finished: frame {number}", kept, "its reconstruction (xarray.DataTree)")


def join_frames(parts: Sequence[xr.DataTree], coords: dict[str, xr.Variable]) -> xr.DataTree:
    """All frames, at least one, as one Reconstruction; `coords` are their coordinates over the dimension `frame`."""
    texts = [{name: json.dumps(value, default=lambda held: held.tolist()) for name, value in part.attrs.items()}
            for part in parts]  # fmt: skip
    shared = {name for name, text in texts[0].items() if all(one.get(name) == text for one in texts)}
    own = [{name: json.loads(text) for name, text in one.items() if name not in shared} for one in texts]
    axes = {name: _joined([part.dataset[name].values for part in parts]) for name in ("y", "x")}
    nodes: dict[str, xr.Dataset] = {}
    for path, names in PICTURES.items():
        held = [name for name in names if all(name in _node(part, path) for part in parts)]
        pictures = [_on(_node(part, path)[held], axes) for part in parts]
        nodes[path] = xr.concat(pictures, "frame", combine_attrs="override")
    for group, dimension in TABLES:
        alone = [part.children[group].to_dataset(inherit=False) for part in parts]
        columns = {name: table[name] for table in reversed(alone) for name in table.variables}
        tables, before = [], 0
        for number, table in enumerate(alone):
            lacking = [name for name in columns if name not in table.variables]
            if lacking:
                own[number].setdefault(LACKING, {})[group] = lacking
            size = table.sizes.get(dimension, 0)
            frame = (dimension, np.full(size, number, dtype=np.int32))
            neutral = {name: _neutral(columns[name], size) for name in lacking}
            tables.append(_moved(table, before).assign(neutral).assign_coords(frame=frame))
            before += size
        nodes[f"/{group}"] = xr.concat(tables, dimension, combine_attrs="override")
    attributes = np.array([json.dumps(one) for one in own], dtype=str)
    nodes["/"] = nodes["/"].assign_coords(coords).assign(attributes=("frame", attributes))
    nodes["/"].attrs = {name: value for name, value in parts[0].attrs.items() if name in shared}
    return xr.DataTree.from_dict(nodes)


def _neutral(column: xr.DataArray, size: int) -> xr.Variable:
    """A column of a table like `column`, with `size` rows, that tells nothing."""
    unknown: Any = {"f": np.nan, "U": "", "O": ""}.get(column.dtype.kind, 0)
    value = NEUTRAL.get(str(column.name), unknown)
    return xr.Variable(column.dims, np.full((size, *column.shape[1:]), value, dtype=column.dtype), column.attrs)


def _node(tree: xr.DataTree, path: str) -> xr.Dataset:
    """The dataset of one group of a tree, with the coordinates that it inherits from its parent."""
    return (tree if path == "/" else tree.children[path.strip("/")]).to_dataset()


def _on(pictures: xr.Dataset, axes: dict[str, Array]) -> xr.Dataset:
    """Pictures on a larger grid, NaN where they have no pixels; pixels move by half a step of the grid at most."""
    for name, axis in axes.items():
        pictures = pictures.reindex({name: axis}, method="nearest", tolerance=0.5 * _step(axis))
    return pictures


def _joined(axes: list[Array]) -> Array:
    """One axis in equal steps that covers all the given axes, in the largest of their steps.

    Frames of one image have equal steps; their coordinates are then kept, to the last bit. The plan view of a very
    large volume may have coarser steps than the others; the coordinates are then new.
    """
    step = max(map(_step, axes))
    values = np.unique(np.concatenate(axes))
    if min(map(_step, axes)) < (1.0 - 1e-6) * step:
        return values[0] + step * np.arange(int(np.ceil((values[-1] - values[0]) / step)) + 1)
    values = values[np.diff(values, prepend=-np.inf) > 0.5 * step]
    between = [np.linspace(a, b, max(round((b - a) / step), 1), endpoint=False) for a, b in pairwise(values)]
    return np.concatenate([*between, values[-1:]])


def _step(axis: Array) -> float:
    """Mean step of an axis, in its unit; one for a single value."""
    return float(np.diff(axis).mean()) if axis.size > 1 else 1.0
