"""The process that opens HDF5 files first, so that a damaged file that crashes or blocks the library harms only it.

A question is a JSON object in one line of its input: ``{"path": ..., "name": ...}`` asks for an array, without a name
for a list of the content, ``{"path": ..., "netcdf": true}`` whether the file may be opened as netCDF. The answer is a
JSON object in one line of its output, followed by the bytes of the array.
"""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from typing import Any

import h5py
import numpy as np

from mirrorfold.io.readers.contents import nbytes, unit_attribute
from mirrorfold.io.readers.hdf5_varying import Budget, RefusedError, varies

MOST_OBJECTS = 100_000
"""Largest number of groups and arrays in a file; one with more is damaged, or made to keep the reader busy."""

TEXT_BYTES = 1 << 20
"""Largest number of characters that are kept of a text."""

SMALL_BYTES = 1 << 20
"""Largest size of arrays that are read to see whether the library survives it [bytes]."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""How the attribute NAME of an array begins that stands for the length of a netCDF dimension and holds only zeros
(netCDF-4, "Interoperability with HDF5")."""


def survey(path: str) -> dict[str, Any]:
    """The content of a file: its arrays with shape, type, names of axes and size on disk, and its attributes."""
    with open(path, "rb") as raw:
        matlab = raw.read(19) == b"MATLAB 7.3 MAT-file"
    found, budget = [], Budget(os.path.getsize(path))
    with h5py.File(path, "r") as file:
        for name in own_links(file):
            if file.id.links.get_info(_stored(name)).type != h5py.h5l.TYPE_HARD:
                continue
            item = _item(file, name)
            if not isinstance(item, h5py.Dataset):
                continue
            check_own_values(name, item)
            budget.check_block(name, item)
            described = _described(name, item, budget)
            if described is not None:
                found.append(described)
        attrs = {str(name): _attr(file.attrs, name, budget) for name in file.attrs}
    attrs = {name: value for name, value in attrs.items() if value is not None}
    return {"matlab": matlab, "arrays": found, "attrs": attrs}


def check_netcdf(path: str) -> int:
    """Read everything that a reader of netCDF files reads, small arrays included, to see whether the library survives.

    Returns
    -------
    int [bytes]
        Memory that the texts and rows of variable length take.

    Raises
    ------
    RefusedError
        If the file refers to other files, its groups are no tree, so that a walk through them might never end, or its
        texts or the blocks of its arrays would fill the memory.
    """
    budget = Budget(os.path.getsize(path))
    with h5py.File(path, "r") as file:
        _touch_attrs(file, budget)
        groups = {h5py.h5o.get_info(file.id).addr}
        for name in own_links(file):
            if not _is_utf8(name):
                mended = name.encode("utf-8", "replace").decode()
                raise RefusedError(f"the name of its entry {mended!r} is no UTF-8, which netCDF demands; rename it")
            item = None
            with suppress(Exception):
                item = file[name]
            if isinstance(item, h5py.Group):
                place = h5py.h5o.get_info(item.id).addr
                if place in groups:
                    raise RefusedError(f"its group {name!r} is there under another name too; copy its data")
                groups.add(place)
                _touch_attrs(item, budget)
            if isinstance(item, h5py.Dataset):
                check_own_values(name, item)
                budget.check_block(name, item)
                _touch_attrs(item, budget)
                try:
                    _touch(name, item, budget)
                except RefusedError:
                    raise
                except Exception:  # reported when the array is read
                    continue
    return budget.taken


def own_links(file: h5py.File) -> list[str]:
    """The names of all links in a file; bytes that are no UTF-8 become surrogates.

    Raises
    ------
    RefusedError
        If a link leads to another file, or there are too many.
    """
    links: list[str] = []
    foreign: list[str] = []

    def note(name: bytes, info: Any) -> None:  # called from within the library: it must neither raise nor stop
        own = info.type in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT)
        (links if own else foreign).append(name.decode("utf-8", "surrogateescape"))

    file.id.links.visit(note, info=True)
    if foreign:
        raise RefusedError(f"its entry {foreign[0]!r} is a link to another file; copy the data into one file")
    if len(links) > MOST_OBJECTS:
        raise RefusedError(f"holds more than {MOST_OBJECTS} objects; split it, or export what was measured")
    return links


def _stored(name: str) -> bytes:
    """The bytes of a name, as they are in the file."""
    return name.encode("utf-8", "surrogateescape")


def _is_utf8(name: str) -> bool:
    """Whether a name is UTF-8 in the file: it has no surrogates, into which `own_links` turns other bytes."""
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def _item(file: h5py.File, name: str) -> Any:
    """A group or an array by its name; for names that are no UTF-8, which h5py does not find, only an array."""
    if _is_utf8(name):
        return file[name]
    found = h5py.h5o.open(file.id, _stored(name))
    return h5py.Dataset(found) if isinstance(found, h5py.h5d.DatasetID) else None


def check_own_values(name: str, dataset: h5py.Dataset) -> None:
    """Refuse an array whose values are in another file, which could be any file that the user may read.

    Raises
    ------
    RefusedError
        If so; the message tells the name of the array.
    """
    if dataset.external or dataset.is_virtual:
        raise RefusedError(f"the values of {name!r} lie in another file; copy the data into one file")


def _touch_attrs(item: h5py.Group | h5py.Dataset, budget: Budget) -> None:
    """Read the attributes of a group or an array."""
    names: list[str] = []
    with suppress(Exception):
        names += item.attrs
    for name in names:
        _attr(item.attrs, name, budget)


def _touch(name: str, dataset: h5py.Dataset, budget: Budget) -> None:
    """Read the values of an array if it is small, or if only reading tells how large they are."""
    if dataset.size is None:
        return
    if varies(dataset.dtype):
        budget.read(name, dataset)
    elif dataset.size * dataset.dtype.itemsize <= SMALL_BYTES:
        dataset[()]
    elif dataset.chunks is not None:
        dataset.id.get_num_chunks()


def _described(name: str, dataset: h5py.Dataset, budget: Budget) -> dict[str, Any] | None:
    """Facts about an array, or its text; None for one that holds neither numbers nor text."""
    shape, dtype = dataset.shape, dataset.dtype
    if shape is None or name.startswith("#"):  # no values, or internal to MATLAB
        return None
    entry: dict[str, Any] = {"name": name, "shape": list(map(int, shape)), "matlab": "MATLAB_class" in dataset.attrs}
    if h5py.check_string_dtype(dtype) is not None:
        text = _text(dataset[()])[:TEXT_BYTES] if shape == () else None
        return None if text is None else entry | {"text": text}
    if dtype.names is None and dtype.kind not in "fciub":
        return None
    if dtype.hasobject or dtype.itemsize == 0 or _attr(dataset.attrs, "MATLAB_empty", budget):
        return None
    if str(_attr(dataset.attrs, "NAME", budget)).startswith(NO_VARIABLE):
        return None
    said = unit_attribute(map(str, dataset.attrs))
    attrs = {} if said is None else {"units": _attr(dataset.attrs, said, budget)}
    dims = []
    for axis in dataset.dims:
        scales = axis.values()
        dims.append(str(scales[0].name).rpartition("/")[2] if scales else axis.label)
    descr = np.lib.format.dtype_to_descr(np.dtype(dtype))
    stored = int(dataset.id.get_storage_size())
    return entry | {"descr": descr, "stored": stored, "dims": dims if all(dims) else [], "attrs": attrs}


def _text(name: bytes | str) -> str:
    """A text that may be bytes in UTF-8."""
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)


def _attr(attrs: Any, name: str, budget: Budget) -> str | float | None:
    """An attribute that is a text or a number; None for any other.

    Raises
    ------
    RefusedError
        If it takes too much memory.
    """
    try:
        value = budget.attribute(attrs, name)
    except (
        LookupError,
        OSError,
        RuntimeError,
        TypeError,
        ValueError,
    ):  # of a type that h5py does not know
        return None
    value = value.item() if isinstance(value, np.ndarray | np.generic) and np.size(value) == 1 else value
    if isinstance(value, bytes | str):
        return _text(value)[:TEXT_BYTES]
    return float(value) if isinstance(value, int | float) else None


def serve() -> None:
    """Answer questions until the input ends."""
    questions, answers = sys.stdin.buffer, sys.stdout.buffer
    for line in questions:
        asked, body = json.loads(line), np.empty(0, np.uint8)
        try:
            if "netcdf" in asked:
                answer: dict[str, Any] = {"varying": check_netcdf(asked["path"])}
            elif "name" not in asked:
                answer = survey(asked["path"])
            else:
                with h5py.File(asked["path"], "r") as file:
                    values = np.ascontiguousarray(_item(file, asked["name"])[()])
                body = values.reshape(-1).view(np.uint8)
                answer = {"bytes": nbytes(values.shape, values.dtype.itemsize)}
        except RefusedError as refusal:
            answer = {"refused": str(refusal)}
        except Exception as error:  # h5py reports damage by exceptions of many types
            answer, body = {"damaged": " ".join(str(error).split())[:200] or type(error).__name__}, body[:0]
        answers.write(json.dumps(answer).encode() + b"\n")
        answers.write(body.data)
        answers.flush()


if __name__ == "__main__":
    serve()
