"""Images and point clouds that other tools have made, as images to fold."""

from __future__ import annotations

import re
import warnings
from itertools import permutations
from math import prod
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arguments import boolean, in_message, number, path_of
from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array
from mirrorfold.common.units import KINDS, unit_named
from mirrorfold.errors import InputError
from mirrorfold.io.own.checks import check_image
from mirrorfold.io.readers import Contents, cloud, read_contents, table
from mirrorfold.io.readers.contents import check_memory

AXIS_NAMES = {
    "x": ("x", "xs", "x_axis", "xaxis", "xgrid", "xvec", "x_m", "cross_range", "crossrange", "azimuth_m"),
    "y": ("y", "ys", "y_axis", "yaxis", "ygrid", "yvec", "y_m", "range", "r", "depth", "downrange"),
    "z": ("z", "zs", "z_axis", "zaxis", "zgrid", "zvec", "z_m", "height", "elevation_m"),
}
"""Names of variables that hold the coordinates of pixels, in lower case, by axis. Of fields in structures, such as
``a.x``, the last part counts."""

IMAGE_NAMES = ("image", "img", "im", "intensity", "amplitude", "magnitude", "i", "p", "data", "array")

AMPLITUDE_NAMES = ("amplitude", "intensity", "magnitude", "power_db", "reflectivity", "value", "i", "scalar_intensity")
"""Names of the variable with the amplitudes of points, in the order of preference."""

DECIBEL = re.compile(r"[ _(\[]*db[)\]]?$")
"""End of the name of amplitudes in dB, in lower case."""

NO_AMPLITUDES = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "rgb", "table")
"""Other columns of clouds, which are no amplitudes."""

LARGEST_CLOUD_IMAGE = 2_000_000
"""Largest number of pixels into which a cloud is gridded, unless `cell` asks for a finer grid."""

MARGIN_CELLS = 8
"""Empty cells around the points of a cloud, so that the border of the image cuts nothing off."""

SAMPLED_POINTS = 20_000
"""Approximate number of points of a large cloud from which the distance between neighbours is estimated."""


def import_image(
    path: str | Path,
    *,
    image: str | None = None,
    x: str | None = None,
    y: str | None = None,
    z: str | None = None,
    order: str | None = None,
    unit: str = "m",
    decibel: bool = False,
    cell: float | None = None,
    radar: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> xr.DataArray:
    """Read an image, or a point cloud that is gridded to an image, from a file of another tool.

    Parameters
    ----------
    path : path
        NumPy, MATLAB, HDF5 or netCDF file with an image and the coordinates of its pixels; or a point cloud: PLY, PCD,
        or CSV with headings x, y (, z) and amplitude.
    image, x, y, z : str, optional
        Names of the variables; by default they are recognised by name and size.
    order : str, optional
        Order of the axes of the image in the file, such as ``"xy"`` or ``"zyx"``; by default as the sizes tell, else
        ``"yx"`` or ``"zyx"``.
    unit : str
        Unit of the coordinates, such as m, cm, mm, where the file itself names none.
    decibel : bool
        Whether the amplitudes are in dB.
    cell : float [m], optional
        Width of the cells into which a cloud is gridded; by default the distance between neighbouring points.
    radar : (x, y, z) [m]
        Position of the radar.

    Returns
    -------
    xarray.DataArray
        (y, x) or (z, y, x). A cloud becomes a plan view (y, x) with a spot for each point; where spots overlap, the
        largest amplitude counts.

    Raises
    ------
    InputError
        If there is no image, or none with known coordinates.
    """
    where, decibel = place(radar, "radar"), boolean("decibel", decibel)
    cell = None if cell is None else number("cell", cell, "m", above=0.0)
    path = path_of("import_image", path)
    contents = read_contents(path)
    scale = KINDS["length"].get(unit_named(unit) or "") if isinstance(unit, str) else None
    if scale is None:
        raise InputError(f"{path}: unit is {in_message(unit)}, expected one of {', '.join(KINDS['length'])}")
    variable = contents.variables.get(image) if isinstance(image, str) else None
    of_points = image is None or (variable is not None and len(variable.shape) == 1)
    if contents.reader == "cloud" or (contents.reader == "table" and _named(contents, "x", 1) and of_points):
        found = _gridded(contents, "x" if x is None else x, "y" if y is None else y, image, scale, cell, decibel)
    else:
        if cell is not None:
            raise InputError(f"{path}: holds no point cloud, and cell is the grid of one; leave it out")
        found = _image(contents, image, {"x": x, "y": y, "z": z}, order, scale, decibel)
    found.attrs["radar_position"] = where
    found.attrs["source"] = path.name
    return check_image(found, source=str(path))


def is_cloud(path: Path) -> bool:
    """Whether a file is a point cloud: by its suffix, or as a text table by headings x, y and that of an amplitude.

    A table with frequencies is none: it holds samples, at places x, y.
    """
    if path.suffix.lower() in cloud.SUFFIXES:
        return True
    # A pipe would be waited for; reading the data refuses it.
    headings = [heading.lower() for heading in table.headings_of(path)] if path.is_file() else []
    amplitudes = {DECIBEL.sub("", heading) for heading in headings} & set(AMPLITUDE_NAMES)
    return {"x", "y"} <= set(headings) and bool(amplitudes) and not any(map(table.FREQUENCY.match, headings))


def _last(name: str) -> str:
    """The last part of a name, in lower case."""
    return name.rpartition(".")[2].lower()


def _named(contents: Contents, axis: str, ndim: int) -> str | None:
    """Name of the variable that is called like the coordinates along an axis, with at most `ndim` dimensions."""
    for wanted in AXIS_NAMES[axis]:
        for name, variable in contents.variables.items():
            if _last(name) == wanted and len([n for n in variable.shape if n != 1]) <= ndim:
                return name
    return None


def _image(
    contents: Contents,
    name: str | None,
    axes: dict[str, str | None],
    order: str | None,
    scale: float,
    decibel: bool,
) -> xr.DataArray:
    """The image of a file with its coordinates, (y, x) or (z, y, x)."""
    name = _largest(contents) if name is None else name
    values = np.squeeze(np.asarray(contents.array(name)))
    if values.ndim not in (2, 3) or values.dtype.kind not in "fciu":
        raise InputError(
            f"{contents.path}: {name!r} has type {values.dtype} and shape {values.shape}, expected an image of two or "
            "three axes; name it with --image"
        )
    wanted = "yx" if values.ndim == 2 else "zyx"
    coordinates: dict[str, Array] = {}
    for axis in wanted:
        chosen = axes[axis]
        if chosen is None:
            chosen = _named(contents, axis, 1) or _named(contents, axis, values.ndim)
        if (
            chosen is None
            and values.ndim == 3
            and {"range", "azimuth", "elevation"} <= {*map(_last, contents.variables)}
        ):
            raise InputError(
                f"{contents.path}: {name!r} {values.shape} seems to be a volume of range, azimuth and elevation; make "
                "it an xarray.DataArray with these dimensions [m, degree] in Python, and write it by mf.save"
            )
        if chosen is None:
            raise InputError(
                f"{contents.path}: does not say the {axis} of the pixels of {name!r} {values.shape}; save a variable "
                f"{axis!r} too, or name it with --{axis}"
            )
        coordinate = _coordinate(contents, chosen, axis)
        said = unit_named(str(contents.variables[chosen].attrs.get("units", ""))) or ""
        coordinates[axis] = coordinate * KINDS["length"].get(said, scale)
    dims = contents.variables[name].dims
    order = order if order is not None else ("".join(dims) if sorted(dims) == sorted(wanted) else None)
    order = order if order is not None else _order(values.shape, coordinates, wanted)
    if not isinstance(order, str) or sorted(order) != sorted(wanted):
        raise InputError(f"order is {in_message(order)}, expected the letters of {wanted!r}")
    for axis, length in zip(order, values.shape, strict=True):
        if coordinates[axis].size != length:
            said = ", ".join(f"{axis} {coordinate.size}" for axis, coordinate in coordinates.items())
            raise InputError(
                f"{contents.path}: {name!r} has the shape {values.shape}, and the coordinates the lengths {said}; they "
                f"do not fit as ({', '.join(order)})"
            )
    found = xr.DataArray(_amplitudes(contents, values, decibel), dims=list(order), coords=coordinates, name="image")
    found = found.transpose(*wanted)
    for axis in wanted:
        if found[axis].size > 1 and found[axis].values[0] > found[axis].values[-1]:
            found = found.isel({axis: slice(None, None, -1)})
    return found.assign_coords({axis: _exact(found[axis].values) for axis in wanted})


def _exact(values: Array) -> Array:
    """The coordinates, with exactly equal steps if they differ from such only by rounding to single precision."""
    even = np.linspace(values[0], values[-1], values.size)
    step = float(even[1] - even[0]) if values.size > 1 else 0.0
    return even if values.size > 1 and np.abs(even - values).max() < ROUNDING * abs(step) else values


ROUNDING = 0.02
"""Largest deviation of a coordinate from equal steps that counts as rounding, as a share of the step."""


def _largest(contents: Contents) -> str:
    """Name of the image: a variable with a name of `IMAGE_NAMES`, else the largest array of two or three axes."""
    sizes = {
        name: int(np.prod(variable.shape))
        for name, variable in contents.variables.items()
        if sum(length > 1 for length in variable.shape) in (2, 3) and variable.dtype.kind in "fciu"
    }
    candidates = [name for name in sizes if all(_last(name) not in known for known in AXIS_NAMES.values())]
    if not candidates:
        raise InputError(f"{contents.path}: holds no image: no array of two or three axes; name it with --image")
    named = [name for wanted in IMAGE_NAMES for name in candidates if _last(name) == wanted]
    return named[0] if named else max(candidates, key=lambda name: sizes[name])


def _coordinate(contents: Contents, name: str, axis: str) -> Array:
    """Coordinates of the pixels along an axis, also where the file repeats them over a mesh."""
    raw = contents.array(name)
    if raw.dtype.kind not in "fiu":
        raise InputError(f"{contents.path}: {name!r} has type {raw.dtype}, expected coordinates")
    values = np.squeeze(np.asarray(raw, dtype=float))
    if values.ndim <= 1:
        return np.atleast_1d(values)
    for at in range(values.ndim):
        others = tuple(n for n in range(values.ndim) if n != at)
        if np.ptp(values, axis=others).max() == 0.0:
            return np.asarray(np.moveaxis(values, at, 0).reshape(values.shape[at], -1)[:, 0])
    raise InputError(f"{contents.path}: {name!r} varies along several axes, expected the {axis} of a regular grid")


def _order(shape: tuple[int, ...], coordinates: dict[str, Array], wanted: str) -> str:
    """The order of axes that fits the sizes; the usual one, `wanted`, where it fits or none does."""
    fitting = [
        "".join(order)
        for order in permutations(wanted)
        if all(coordinates[axis].size == length for axis, length in zip(order, shape, strict=True))
    ]
    return wanted if wanted in fitting or not fitting else fitting[0]


def _amplitudes(contents: Contents, values: NDArray, decibel: bool) -> NDArray:
    """Complex or linear amplitudes in single precision; `decibel` tells whether `values` are in dB."""
    if np.iscomplexobj(values):
        if decibel:
            raise InputError(f"{contents.path}: its amplitudes are complex and cannot be in dB")
        return values.astype(np.complex64)
    real = values.astype(np.float32)
    if decibel:
        return np.asarray(ratio_of(np.maximum(real, FLOOR_DB)), dtype=np.float32)
    if real.size and float(np.nanmin(real)) < 0.0:
        raise InputError(
            f"{contents.path}: its amplitudes reach down to {float(np.nanmin(real)):g}; if they are in dB say so with "
            "--decibel, else save complex samples or their absolute value"
        )
    return real


FLOOR_DB = -300.0
"""Lowest amplitude [dB]; lower ones, minus infinity included, are replaced by it."""


def _gridded(
    contents: Contents, x: str, y: str, amplitude: str | None, scale: float, cell: float | None, decibel: bool
) -> xr.DataArray:
    """The plan view of a point cloud: in each cell the largest amplitude, spread to spots."""
    known = {name.lower(): name for name in contents.variables}
    for column in (x, y):
        if column.lower() not in known:
            raise InputError(f"{contents.path}: its points have no {column!r}, but {', '.join(contents.variables)}")
    points = np.stack([np.asarray(contents.array(known[column.lower()]), dtype=float) for column in (x, y)], axis=-1)
    points *= scale
    named = {DECIBEL.sub("", lower): column for lower, column in known.items()} | known
    name = next((named[wanted] for wanted in AMPLITUDE_NAMES if wanted in named), None)
    name = name if amplitude is None else amplitude
    values = np.ones(len(points), np.float32)
    others = [column for lower, column in known.items() if lower not in {x.lower(), y.lower(), *NO_AMPLITUDES}]
    if name is None and others:
        warnings.warn(
            f"{contents.path}: none of {', '.join(others)} is known to be the amplitude, and all points count alike; "
            "`mirrorfold import --image NAME` names it, in Python image",
            stacklevel=3,
        )
    if name is not None:
        decibel = decibel or bool(DECIBEL.search(name.lower()))
        values = _amplitudes(contents, np.asarray(contents.array(name)), decibel).astype(np.float32)
    finite = np.isfinite(points).all(axis=1) & np.isfinite(values)
    points, values = points[finite], values[finite]
    if len(points) < 2:
        raise InputError(
            f"{contents.path}: holds {len(points)} points with finite coordinates, expected a cloud of them"
        )
    extent = np.ptp(points, axis=0)
    if not float(extent.max()) < LARGEST_EXTENT:
        raise InputError(
            f"{contents.path}: its points reach over {extent.max():g} m; correct their unit, or the outliers"
        )
    if cell is None:
        cell = max(_spacing(points), FINEST_SHARE * float(extent.max()))
        while cell > 0.0 and prod(_cells(extent, cell)) > LARGEST_CLOUD_IMAGE:
            cell *= GROWTH
    if not (0.0 < cell < np.inf and float(extent.max()) / cell < 1.0 / FINEST_SHARE**2):
        raise InputError(f"{contents.path}: cell is {cell}, expected a width above zero [m]; the points may coincide")
    counts = _cells(extent, cell)
    check_memory(contents.path, GRID_BYTES * prod(counts), f"a grid of {counts[0]} x {counts[1]} cells")
    origin = points.min(axis=0) - MARGIN_CELLS * cell
    at = np.minimum(((points - origin) / cell + 0.5).astype(np.int64), np.array(counts) - 1)
    grid = np.zeros((counts[1], counts[0]), dtype=np.float32)
    np.maximum.at(grid, (at[:, 1], at[:, 0]), values)
    grid = _spread(grid)
    axes = {axis: origin[n] + cell * np.arange(counts[n]) for n, axis in enumerate("xy")}
    return xr.DataArray(grid, dims=("y", "x"), coords={"y": axes["y"], "x": axes["x"]}, name="image")


LARGEST_EXTENT = 1e6
"""Extent of a cloud from which on its unit must be wrong, or it has outliers [m]; no radar maps so far."""

FINEST_SHARE = 1e-6
"""Smallest width of cells, as a share of the extent of the points."""


def _cells(extent: Array, cell: float) -> tuple[int, int]:
    """Number of cells along x and y."""
    along, across = (int(length / cell) + 1 + 2 * MARGIN_CELLS for length in extent.tolist())
    return along, across


GROWTH = 1.3
"""Factor by which cells are enlarged repeatedly, until they are not too many."""

GRID_BYTES = 32.0
"""Memory for each cell while points are spread to spots [bytes]."""


def _spread(grid: NDArray[np.float32]) -> NDArray[np.float32]:
    """The grid with a Gaussian spot in place of each point; where several overlap, the largest amplitude counts.

    An image by a radar has no detail finer than its resolution cell, and the search for mirrors relies on that.
    """
    for axis in (0, 1):
        spread = grid.copy()
        for shift in range(1, REACH_CELLS + 1):
            weight = np.float32(np.exp(-((shift / SPOT_CELLS) ** 2)))
            for by in (-shift, shift):
                np.maximum(spread, weight * np.roll(grid, by, axis=axis), out=spread)
        grid = spread
    return grid


SPOT_CELLS = 1.5
"""Radius of the spot of a point, at 1/e of its amplitude, in cells, so that neighbouring points merge to a line."""

REACH_CELLS = 4
"""Radius at which spots are cut off, in cells: at 1e-3 of their amplitude, and within the empty cells around the
points."""


def _spacing(points: Array) -> float:
    """Median distance [m] of a point from its nearest neighbour."""
    distinct = np.unique(points, axis=0)
    some = distinct[:: max(1, len(distinct) // SAMPLED_POINTS)]
    from scipy.spatial import cKDTree

    return float(np.median(cKDTree(distinct).query(some, k=2)[0][:, 1])) if len(distinct) > 1 else 0.0
