"""Point clouds for other programs: PLY, PCD, VTP, CSV and XYZ files of a reconstruction's points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common import decibels
from mirrorfold.common.chains import mirror_chains
from mirrorfold.io.exports.vtk import places, points_file

Columns = dict[str, NDArray]

COLOURS = np.array([list(bytes.fromhex(colour[1:])) for colour in decibels.COLOURS], dtype="u1")
"""Red, green and blue by number of bounces, as in the pictures."""


def cloud_file(reconstruction: xr.DataTree, suffix: str) -> bytes:
    """The folded points of a reconstruction as the content of a file for other programs.

    Every point has its position x, y, z [m] (z is zero in a floor plan), `amplitude`, `confidence`, `bounces`,
    `mirror` (1 on the face of a mirror, 0 on an object), `interpolated` (1 in a gap between echoes), `chain`, in a
    recording `frame`, and in PLY files a colour by its number of bounces. `chain` is the number, in the table of
    mirrors, of the last mirror of the point's chain, -1 in line of sight; comments (PLY, PCD, XYZ, VTP) name the whole
    chains. With half-transparent walls there are `passed`, the probability that the point was seen through a wall, NaN
    where this was not tested, and `wall`, the number of the wall, -1 where the point was not seen through one.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    suffix : str
        One of `WRITERS`.
    """
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    size = objects.sizes.get("point", 0)
    held = {name: objects[name].values for name in (*"xyz", "amplitude", "confidence") if name in objects.variables}
    position = places(np.stack([held.get(axis, np.zeros(size)) for axis in "xyz"], axis=-1))
    columns: Columns = dict(zip("xyz", position.T, strict=True))
    columns |= {name: np.asarray(held.get(name, np.zeros(size)), dtype="<f4") for name in ("amplitude", "confidence")}
    columns["bounces"] = objects["bounces"].values.astype("<i4")
    surface = objects["surface"].values if "surface" in objects else np.full(size, "object")
    columns["mirror"] = (surface == "mirror").astype("<i4")
    between = objects["interpolated"].values if "interpolated" in objects else np.zeros(size)
    columns["interpolated"] = between.astype("<i4")
    chains = mirror_chains(mirrors)
    frames = [table["frame"].values if "frame" in table.variables else np.zeros(count, dtype=int)
              for table, count in ((mirrors, len(chains)), (objects, size))]  # fmt: skip
    number = {key: i for i, key in enumerate(zip(frames[0].tolist(), chains, strict=True))}
    for name in ("chain", "wall"):
        if name in objects:
            seen = zip(frames[1].tolist(), objects[name].values.astype(str).tolist(), strict=True)
            columns[name] = np.array([number.get(key, -1) for key in seen], dtype="<i4")
    if "passed" in objects:
        columns["passed"] = objects["passed"].values.astype("<f4")
    if "frame" in objects.variables:
        columns["frame"] = frames[1].astype("<i4")
    return WRITERS[suffix](columns, chains)


def _table(columns: Columns) -> bytes:
    """The bytes of all points, one after the other, without gaps."""
    size = len(columns["x"])
    table = np.empty(size, dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table.tobytes()


def _ply(columns: Columns, chains: list[str]) -> bytes:
    """A PLY file of points."""
    colour = COLOURS[columns["bounces"] % len(COLOURS)]
    columns = columns | {name: colour[:, i] for i, name in enumerate(("red", "green", "blue"))}
    kinds = {"<f4": "float", "<f8": "double", "<i4": "int", "|u1": "uchar"}
    lines = ["ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in notes(chains))]
    lines.append(f"element vertex {len(columns['x'])}")
    lines += [f"property {kinds[column.dtype.str]} {name}" for name, column in columns.items()]
    return "\n".join([*lines, "end_header", ""]).encode() + _table(columns)


def _pcd(columns: Columns, chains: list[str]) -> bytes:
    """A PCD file of points, where the amplitude is called intensity."""
    columns = {("intensity" if name == "amplitude" else name): column for name, column in columns.items()}
    size = len(columns["x"])
    lines = [
        "# .PCD v0.7",
        *(f"# {line}" for line in notes(chains)),
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


def _vtp(columns: Columns, chains: list[str]) -> bytes:
    points = np.stack([columns[axis] for axis in "xyz"], axis=-1)
    return points_file(points, {name: column for name, column in columns.items() if name not in "xyz"}, notes(chains))


def _csv(columns: Columns, chains: list[str]) -> bytes:
    return _text(columns, ",").encode()


def _xyz(columns: Columns, chains: list[str]) -> bytes:
    return "".join(["# ", *(f"{line}\n# " for line in notes(chains)), _text(columns, " ")]).encode()


def _text(columns: Columns, separator: str) -> str:
    """The points as text: a line of headings, then a line for each point."""
    digits = {"<f4": ".7g", "<f8": ".12g"}
    written = [
        [format(one, digits[column.dtype.str]) for one in column] if column.dtype.kind == "f" else column.tolist()
        for column in columns.values()
    ]
    rows = zip(*written, strict=True)
    lines = [separator.join(columns), *(separator.join(map(str, row)) for row in rows)]
    return "\n".join([*lines, ""])


def notes(chains: list[str]) -> list[str]:
    """Comments in a file of points: the units, and what the numbers of chains mean."""
    ways = (f"chain {number} is by way of mirrors {name}" for number, name in enumerate(chains))
    return ["points folded by mirrorfold, metres, z up", *ways]


WRITERS: dict[str, Callable[[Columns, list[str]], bytes]] = {
    ".ply": _ply, ".pcd": _pcd, ".vtp": _vtp, ".csv": _csv, ".xyz": _xyz
}  # fmt: skip
"""Function that makes a file of points, by suffix."""
