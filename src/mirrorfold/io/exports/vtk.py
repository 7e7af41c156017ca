"""Files of VTK, for ParaView and others: points and walls (VTP), pictures and voxels (VTI), volumes of beams (VTS).

The XML formats need only a header and base64, so no library is used. Source: "VTK XML Formats",
https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.beams import beam_direction
from mirrorfold.common.facts import VOLUME, radar_place
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep.polarization import picked, polarizations

TYPES = {"<f4": "Float32", "<f8": "Float64", "<i4": "Int32", "<i8": "Int64"}

ROUNDING = 1e-5
"""Largest rounding error of exported places [m], a hundredth of a wavelength at 300 GHz. Single precision, which every
program reads, keeps to it up to a hundred metres and more from the origin; beyond, places have double precision."""

HEADER_LIMIT = 2**32
"""Size of an array from which on its length does not fit into the 4 bytes of the header [bytes]."""

Columns = Mapping[str, NDArray]


def places(values: NDArray) -> NDArray:
    """Coordinates [m] in single precision, or in double precision where single precision would move them."""
    single = np.asarray(values, dtype="<f4")
    with np.errstate(invalid="ignore"):
        moved = np.abs(single - np.asarray(values, dtype="<f8")) > ROUNDING
    return np.asarray(values, dtype="<f8") if moved.any() else single


def points_file(points: NDArray, columns: Columns, notes: Sequence[str] = ()) -> bytes:
    """A VTP file of points (n, 3) [m] with columns of values (n,), and comments."""
    each = np.arange(len(points), dtype="<i8")
    cells = f"<Verts>{_array('connectivity', each)}{_array('offsets', each + 1)}</Verts>"
    return _poly_data(points, f"<PointData>{_arrays(columns)}</PointData>", cells, notes, verts=len(points))


def walls_file(
    outlines: Sequence[Array], columns: Columns, notes: Sequence[str] = (), *, lines: bool | None = None
) -> bytes:
    """A VTP file of walls, lines or faces (n, 3) [m], with columns of one value for each wall, and comments.

    By default they are lines if all have two points, otherwise faces.
    """
    corners = places(np.concatenate([np.empty((0, 3)), *outlines]))
    each = np.arange(len(corners), dtype="<i8")
    ends = np.cumsum([len(outline) for outline in outlines]).astype("<i8")
    flat = all(len(outline) == 2 for outline in outlines) if lines is None else lines
    kind = "Lines" if flat else "Polys"
    cells = f"<CellData>{_arrays(columns)}</CellData>"
    placed = f"<{kind}>{_array('connectivity', each)}{_array('offsets', ends)}</{kind}>"
    count = {"lines": len(outlines)} if flat else {"polys": len(outlines)}
    return _poly_data(corners, cells, placed, notes, **count)


def picture_file(pictures: Mapping[str, xr.DataArray]) -> bytes:
    """A VTI file of pictures (y, x) or voxels (z, y, x) on one grid, in metres."""
    first = next(iter(pictures.values()))
    shape, start, step = [], [], []
    for name in "xyz":
        axis = np.atleast_1d(first[name].values.astype(float)) if name in first.coords else np.zeros(1)
        axis = axis if name in first.dims else axis[:1]
        shape.append(axis.size)
        start.append(axis[0])
        step.append((axis[-1] - axis[0]) / (axis.size - 1) if axis.size > 1 else 1.0)
    extent = " ".join(f"0 {size - 1}" for size in shape)
    grid = f'WholeExtent="{extent}" Origin="{_numbers(start)}" Spacing="{_numbers(step)}"'
    columns = {name: values for title, picture in pictures.items() for name, values in _parts(title, picture).items()}
    piece = f'<Piece Extent="{extent}"><PointData>{_arrays(columns)}</PointData></Piece>'
    return _file("ImageData", grid, piece, columns.values())


def volume_file(volume: xr.DataArray) -> bytes:
    """A VTS file of the volume (range, azimuth, elevation) of a raster scan, with every voxel at its place [m]."""
    range_, azimuth, elevation = (volume[name].values.astype(float) for name in VOLUME)
    origin = radar_place(volume.attrs)
    sight = beam_direction(azimuth[:, None], elevation)
    points = places((origin + range_[:, None, None, None] * sight).reshape(-1, 3))
    extent = f"0 {elevation.size - 1} 0 {azimuth.size - 1} 0 {range_.size - 1}"
    columns = _parts("image", volume)
    piece = f'<Piece Extent="{extent}"><PointData>{_arrays(columns)}</PointData><Points>'
    piece += f"{_array('Points', points)}</Points></Piece>"
    return _file("StructuredGrid", f'WholeExtent="{extent}"', piece, [*columns.values(), points])


def _parts(title: str, picture: xr.DataArray) -> dict[str, NDArray]:
    """Columns of a picture: the amplitude and, if it is complex, the phase [rad]; separate for each polarization."""
    if "polarization" in picture.dims:
        each = {f"{title}_{name}": picked(picture, name) for name in polarizations(picture, "image")}
        return {name: values for label, one in each.items() for name, values in _parts(label, one).items()}
    values = picture.values.ravel()
    if values.dtype.kind != "c":
        return {title: values.astype("<f4")}
    return {f"{title}_amplitude": np.abs(values).astype("<f4"), f"{title}_phase": np.angle(values).astype("<f4")}


def _poly_data(points: NDArray, data: str, cells: str, notes: Sequence[str], **counts: int) -> bytes:
    """A VTP file of points [m], with XML of their data and cells, comments, and the number of cells of each kind."""
    numbers = [f'NumberOf{kind.title()}="{counts.get(kind, 0)}"' for kind in ("verts", "lines", "strips", "polys")]
    piece = "".join(f"<!-- {note} -->\n" for note in notes)
    piece += f'<Piece NumberOfPoints="{len(points)}" {" ".join(numbers)}>{data}'
    piece += f"<Points>{_array('Points', points)}</Points>{cells}</Piece>"
    return _file("PolyData", "", piece, [points])


def _file(kind: str, grid: str, content: str, arrays: Iterable[NDArray]) -> bytes:
    """A whole file of VTK.

    Raises
    ------
    InputError
        If an array is too large for the format's usual header.
    """
    if any(values.nbytes >= HEADER_LIMIT for values in arrays):
        raise InputError("export: an array has more than 4 GiB; take fewer pixels")
    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="{kind}" version="0.1" byte_order="LittleEndian" header_type="UInt32">',
        f"<{kind} {grid}>".replace(" >", ">"),
        content,
        f"</{kind}></VTKFile>",
        "",
    ]
    return "\n".join(lines).encode()


def _arrays(columns: Columns) -> str:
    """Columns as XML."""
    return "".join(_array(name, column) for name, column in columns.items())


def _array(name: str, values: NDArray) -> str:
    """An array as XML: its length in bytes and its numbers, in base64."""
    raw = np.ascontiguousarray(values).tobytes()
    text = base64.b64encode(np.uint32(len(raw)).tobytes() + raw).decode()
    components = values.shape[1] if values.ndim > 1 else 1
    head = f'type="{TYPES[values.dtype.str]}" Name="{escape(name)}" NumberOfComponents="{components}" format="binary"'
    return f"<DataArray {head}>{text}</DataArray>"


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
