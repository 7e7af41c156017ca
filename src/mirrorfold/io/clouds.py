"""Point clouds for other programs: PLY, PCD and VTP files of a reconstruction's points."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.files import check_output, written_whole
from mirrorfold.io.netcdf import check_reconstruction

Columns = dict[str, NDArray]

COLOURS = np.array([[0, 158, 115], [230, 159, 0], [204, 121, 167], [86, 180, 233], [213, 94, 0], [0, 114, 178]])
"""Red, green and blue by number of bounces, as in the pictures (Okabe and Ito, 2008)."""


def export(reconstruction: xr.DataTree, path: str | Path) -> Path:
    """Write the points of a reconstruction, folded, to a file that other programs read.

    Every point has its position x, y, z [m] (z is zero in a floor plan), `amplitude`, `bounces`, `confidence`, `mirror`
    (1 on the face of a mirror, 0 on an object) and, in PLY files, a colour by its number of bounces.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    path : path
        Its suffix says the format: ``.ply``, ``.pcd`` or ``.vtp``.

    Raises
    ------
    InputError
        If the suffix is none of these, or nothing can be written there.
    """
    path = check_cloud_path(path)
    objects = check_reconstruction(reconstruction).children["objects"].to_dataset(inherit=False)
    size = objects.sizes.get("point", 0)
    columns: Columns = {
        name: np.asarray(objects[name].values, dtype="<f4") if name in objects.variables else np.zeros(size, "<f4")
        for name in ("x", "y", "z", "amplitude", "confidence")
    }
    columns["bounces"] = objects["bounces"].values.astype("<i4")
    surface = objects["surface"].values if "surface" in objects else np.full(size, "object")
    columns["mirror"] = (surface == "mirror").astype("<i4")
    with written_whole(path) as temporary:
        temporary.write_bytes(WRITERS[path.suffix.lower()](columns))
    return path


def check_cloud_path(path: str | Path) -> Path:
    """The path, if a point cloud can be written there.

    Raises
    ------
    InputError
        If its suffix names no format that is known, or its directory cannot be written to.
    """
    path = check_output(path)
    if path.suffix.lower() not in WRITERS:
        raise InputError(f"{path}: ends in {path.suffix!r}, expected one of {', '.join(WRITERS)}")
    return path


def _table(columns: Columns) -> bytes:
    """All points one after the other, packed."""
    size = len(columns["x"])
    table = np.empty(size, dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table.tobytes()


def _ply(columns: Columns) -> bytes:
    colour = COLOURS[np.minimum(columns["bounces"], len(COLOURS) - 1)].astype("u1")
    columns = columns | {name: colour[:, i] for i, name in enumerate(("red", "green", "blue"))}
    kinds = {"f": "float", "i": "int", "u": "uchar"}
    lines = ["ply", "format binary_little_endian 1.0", "comment points folded by mirrorfold, metres, z up"]
    lines.append(f"element vertex {len(columns['x'])}")
    lines += [f"property {kinds[column.dtype.kind]} {name}" for name, column in columns.items()]
    return "\n".join([*lines, "end_header", ""]).encode() + _table(columns)


def _pcd(columns: Columns) -> bytes:
    columns = {("intensity" if name == "amplitude" else name): column for name, column in columns.items()}
    size = len(columns["x"])
    lines = [
        "# .PCD v0.7 - points folded by mirrorfold, metres, z up",
        "VERSION 0.7",
        "FIELDS " + " ".join(columns),
        "SIZE " + " ".join(str(column.itemsize) for column in columns.values()),
        "TYPE " + " ".join(column.dtype.kind.upper() for column in columns.values()),
        "COUNT " + " ".join("1" for _ in columns),
        f"WIDTH {size}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {size}",
        "DATA binary",
        "",
    ]
    return "\n".join(lines).encode() + _table(columns)


def _vtp(columns: Columns) -> bytes:
    size = len(columns["x"])
    points = np.stack([columns.pop(axis) for axis in "xyz"], axis=-1)
    kinds = {"<f4": "Float32", "<i4": "Int32", "<i8": "Int64"}

    def array(name: str, values: NDArray, components: int = 1) -> str:
        raw = np.ascontiguousarray(values).tobytes()
        text = base64.b64encode(np.uint32(len(raw)).tobytes() + raw).decode()
        kind = kinds[values.dtype.str]
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="binary">'
        return f"{head}{text}</DataArray>"

    each = np.arange(size, dtype="<i8")
    parts = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian" header_type="UInt32"><PolyData>',
        f'<Piece NumberOfPoints="{size}" NumberOfVerts="{size}" NumberOfLines="0" NumberOfStrips="0"'
        ' NumberOfPolys="0">',
        f"<PointData>{''.join(array(name, column) for name, column in columns.items())}</PointData>",
        f"<Points>{array('Points', points, 3)}</Points>",
        f"<Verts>{array('connectivity', each)}{array('offsets', each + 1)}</Verts>",
        "</Piece></PolyData></VTKFile>",
        "",
    ]
    return "\n".join(parts).encode()


WRITERS: dict[str, Callable[[Columns], bytes]] = {".ply": _ply, ".pcd": _pcd, ".vtp": _vtp}
"""The formats, by suffix."""
