"""The project's own files: netCDF-4 by way of h5netcdf, with complex numbers stored natively.

The attribute ``mirrorfold_kind`` tells what a file holds. A file without it that has a variable ``s`` counts as a
sweep. An image, a `DataArray` in memory, is the variable ``image`` on disk.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr

from mirrorfold.common.arguments import in_message
from mirrorfold.common.phases import PHASE_STEP, PHASES
from mirrorfold.common.reading import check_file, read_head
from mirrorfold.common.signals import held_signals
from mirrorfold.errors import InputError
from mirrorfold.io.files import check_room, written_atomically
from mirrorfold.io.own.attributes import decoded, storable
from mirrorfold.io.own.checks import check_image, check_reconstruction, conform_attrs
from mirrorfold.io.own.steady import SteadyFile
from mirrorfold.io.readers import readers
from mirrorfold.io.readers.contents import check_expansion, nbytes
from mirrorfold.io.readers.hdf5 import check_netcdf
from mirrorfold.io.readers.hdf5_process import own_links
from mirrorfold.sweep import check_sweep

GEOMETRY = ("frequency", "tx_position", "rx_position", "antenna_position")
"""Variables of a sweep's file that suffice to plan its focusing."""

REMEDY = "give a netCDF-4 file written by mirrorfold, or a sweep with a variable s(frequency, tx, rx)"

ENGINE: Any = "h5netcdf"


def is_foreign(path: Path) -> bool:
    """Whether a file is of another tool, by its suffix or its first bytes.

    A netCDF-4 file is our own if it has the attribute ``mirrorfold_kind``, samples ``s`` or an ``image``; it is of
    another tool if it has none of these but an array.
    """
    suffix = path.suffix.lower()
    if suffix != ".nc" and any(suffix in reader.suffixes for reader in readers().values()):
        return True
    if read_head(path, 3) == b"CDF":
        return True
    if suffix != ".nc" or not h5py.is_hdf5(path):
        return False
    check_netcdf(path)
    try:
        with h5py.File(path, "r") as content:
            if "mirrorfold_kind" in content.attrs or {"s", "image"} & set(content):
                return False
            return any(isinstance(item, h5py.Dataset) and len(item.shape or ()) >= 2 for item in content.values())
    except Exception:  # damaged, which `read` reports in words
        return False


def read(path: Path) -> xr.Dataset | xr.DataArray | xr.DataTree:
    """Read a sweep, an image or a reconstruction from a netCDF-4 file, checked and in memory.

    Raises
    ------
    InputError
        If the file is missing, damaged, or holds something else.
    """
    content = _content(path)
    kind = content.attrs.get("mirrorfold_kind")
    if kind is None:  # written by xarray's own `to_netcdf`, or by another tool
        kind = "sweep" if "s" in content else "image" if "image" in content else None
    if isinstance(kind, str):  # and no array, which damage may leave
        if kind == "sweep":
            return check_sweep(content.to_dataset(), source=str(path))
        if kind == "image":
            return check_image(_as_image(content.to_dataset(), str(path)), source=str(path))
        if kind == "reconstruction":
            return check_reconstruction(content, source=str(path))
    found = (
        f"mirrorfold_kind is {in_message(kind)}"
        if kind is not None
        else f"holds the variables {list(content.data_vars)}"
    )
    raise InputError(f"{path}: {found}, expected a sweep, an image or a reconstruction; {REMEDY}")


def read_geometry(path: Path) -> xr.Dataset:
    """Read frequencies, positions and attributes of a sweep's file, without its samples, and unchecked.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    return _content(path, only=GEOMETRY).to_dataset()


def read_unchecked(path: Path) -> xr.Dataset:
    """Read the root group of a netCDF-4 file, unchecked, to find out what is wrong with it.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    return _content(path).to_dataset()


def _content(path: Path, only: Collection[str] | None = None) -> xr.DataTree:
    """The groups of a file, in memory; with `only`, the variables of the root with these names.

    Raises
    ------
    InputError
        If the file is missing or damaged, or its content would fill the memory.
    """
    _check_is_hdf5(path)
    check_netcdf(path)
    try:
        _check_sizes(path, only)
        content = _read_groups(path, only)
        for node in content.subtree:
            _ = node.to_dataset().sizes  # fails where dimensions contradict each other, which opening does not
    except InputError:
        raise
    except Exception as error:  # h5py reports damage by exceptions of many types, RuntimeError and KeyError included
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is damaged or not netCDF-4 ({reason}); {REMEDY}") from None
    for node in content.subtree:
        strange = [name for name, variable in node.dataset.variables.items() if not _is_storable(variable)]
        if strange:
            names = ", ".join(map(in_message, strange))
            warnings.warn(f"{path}: {names} holds neither numbers nor texts, and is left out", stacklevel=2)
            node.dataset = node.to_dataset(inherit=False).drop_vars(strange)
        node.attrs = {name: decoded(value) for name, value in node.attrs.items()}
        conform_attrs(node.attrs)
    return content


def write(obj: xr.Dataset | xr.DataArray | xr.DataTree, path: Path) -> Path:
    """Write a sweep, an image or a reconstruction to a netCDF-4 file, and return its path.

    Raises
    ------
    InputError
        If the object is not valid, or the file cannot be written.
    OSError
        If the disk is full or fails; an older file stays as it was.
    """
    if isinstance(obj, xr.DataTree):
        content = check_reconstruction(obj)
    elif isinstance(obj, xr.DataArray):
        image = check_image(obj)
        content = xr.DataTree(image.to_dataset(name="image").assign_attrs(mirrorfold_kind="image"))
    else:
        content = xr.DataTree(check_sweep(obj).assign_attrs(mirrorfold_kind="sweep"))
    strange = [name for node in content.subtree for name, one in node.variables.items() if not _is_storable(one)]
    if strange:
        raise InputError(f"{path}: netCDF holds numbers and texts, and {in_message(strange[0])} is neither; drop it")
    content = xr.DataTree.from_dict({node.path: _storable(node.to_dataset(inherit=False)) for node in content.subtree})
    encoding = {node.path: _encoding(node.to_dataset(inherit=False)) for node in content.subtree}
    with written_atomically(path) as temporary:
        check_room(temporary, _least_size(content))
        with held_signals(), SteadyFile(temporary) as file:
            content.to_netcdf(file, engine=ENGINE, encoding=encoding)
    return path


def _least_size(content: xr.DataTree) -> int:
    """Lower bound of the file's size: the bytes of complex arrays, which are not compressed, as others are."""
    return sum(
        variable.nbytes
        for node in content.subtree
        for variable in node.to_dataset(inherit=False).variables.values()
        if variable.dtype.kind == "c"
    )


def _check_is_hdf5(path: Path) -> None:
    """Refuse a path with no readable file, or with one that is not HDF5, the format on which netCDF-4 is based."""
    check_file(path, "give the path of a netCDF file")
    read_head(path, 1)
    if not h5py.is_hdf5(path):
        raise InputError(f"{path}: is not a netCDF-4 file; {REMEDY}")


def _check_sizes(path: Path, only: Collection[str] | None) -> None:
    """Refuse content that would not fit into the memory, or that the file is too small to hold, before it is read.

    Raises
    ------
    InputError
        The message tells the size of the content, and what is available.
    """
    with h5py.File(path) as file:  # by its links: an array that is there under several names is read for each of them
        items = (file.get(name) for name in own_links(file) if only is None or name in only)
        size = sum(nbytes(item.shape or (), item.dtype.itemsize) for item in items if isinstance(item, h5py.Dataset))
    check_expansion(path, path.stat().st_size, size)


def _read_groups(path: Path, only: Collection[str] | None) -> xr.DataTree:
    """The root of a file, with its groups if it is a reconstruction, in memory."""
    with h5py.File(path) as file:  # fails here, as h5netcdf would print on stderr
        kind = dict(file.attrs).get("mirrorfold_kind")
    if only is None and isinstance(kind, str) and kind == "reconstruction":
        with xr.open_datatree(path, engine=ENGINE, phony_dims="access") as tree:
            return xr.DataTree.from_dict({node.path: node.to_dataset(inherit=False).load() for node in tree.subtree})
    with xr.open_dataset(path, engine=ENGINE, phony_dims="access") as root:
        return xr.DataTree((root if only is None else root[[name for name in root.variables if name in only]]).load())


def _as_image(content: xr.Dataset, source: str) -> xr.DataArray:
    """The image of an image file as a `DataArray`, with all attributes."""
    if "image" not in content:
        raise InputError(f"{source}: holds no variable 'image'; {REMEDY}")
    image = content["image"]
    return image.assign_attrs({**content.attrs, **image.attrs})


def _storable(content: xr.Dataset) -> xr.Dataset:
    """A copy whose attributes netCDF can hold, and without the encodings of another file."""
    content = content.drop_encoding()
    content.attrs = {name: storable(value) for name, value in content.attrs.items()}
    for variable in content.variables.values():
        variable.attrs = {name: storable(value) for name, value in variable.attrs.items()}
    return content


def _is_storable(variable: xr.Variable) -> bool:
    """Whether netCDF can hold the values of a variable: numbers, texts, times, but no records or references."""
    if variable.dtype.kind == "O":
        return all(isinstance(value, str | bytes) for value in variable.values.flat)
    return variable.dtype.kind in "biufSUMm" or variable.dtype in (np.complex64, np.complex128)


def _encoding(content: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Encodings of the variables: checksums for large arrays, and compression except for noisy complex samples."""
    encoding: dict[str, dict[str, Any]] = {}
    for name, variable in content.variables.items():
        if variable.size < SMALL or variable.dtype.kind not in "fciu":
            continue
        slab = math.prod(variable.shape[1:]) * variable.dtype.itemsize
        slabs = min(max(1, CHUNK_BYTES // slab), variable.shape[0])
        encoding[str(name)] = {"fletcher32": True, "chunksizes": (slabs, *variable.shape[1:])}
        if variable.dtype.kind != "c":
            encoding[str(name)] |= {"zlib": True, "complevel": 1, "shuffle": True}
        if name == "phase":
            encoding[str(name)] |= {"dtype": "uint8", "scale_factor": PHASE_STEP, "_FillValue": PHASES}
    return encoding


SMALL = 1000
"""Smallest number of values of an array that is stored with checksums and compression."""

CHUNK_BYTES = 1 << 20
"""Size of the blocks in which large arrays are stored, of whole rows each [bytes]."""
