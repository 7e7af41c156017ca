"""Facts about the mirrors and points of a reconstruction."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.describing.contents import Sized
from mirrorfold.folding.confident import confident_points, passed_walls
from mirrorfold.folding.frames import frame_count


class MirrorFacts(Record):
    """A mirror at its true place."""

    mirror: int
    parent: int = fact("the mirror it was seen through, -1 for none")
    generation: int
    start_m: list[float] = fact(min_length=2, max_length=3)
    end_m: list[float] = fact(min_length=2, max_length=3)
    strength: Number
    radius_m: Number = fact("of a curved mirror, negative for a concave one", default=LEFT_OUT)
    radius_error_m: Number = fact("standard error", default=LEFT_OUT)
    permittivity: Number = fact("of a wall that lets waves through", default=LEFT_OUT)
    permittivity_error: Number = fact("standard error", default=LEFT_OUT)
    thickness_m: Number = fact("of a wall that lets waves through", default=LEFT_OUT)
    thickness_error_m: Number = fact("standard error", default=LEFT_OUT)
    frame: int = fact("of a recording", default=LEFT_OUT)


class ReconstructionFacts(Sized):
    """A reconstruction."""

    kind: Literal["reconstruction"]
    points: int = fact("of objects and on the faces of mirrors, of those that are not doubted")
    points_on_mirrors: int = fact("those on the faces of mirrors")
    points_by_bounces: dict[str, int]
    points_through_walls: int = fact("those seen through a half-transparent wall, which stay there", default=LEFT_OUT)
    left_out: int = fact(
        "echoes where nothing stands: by mixed paths, from beyond the ambiguous range, or copies of others"
    )
    doubted: int = fact("points of less than the least confidence, which are not drawn, scored or exported")
    points_by_frame: list[int] = fact("of a recording", default=LEFT_OUT)
    mirrors: list[MirrorFacts]
    remarks: list[str] = fact("sentences on what looks wrong")
    files: list[str] = fact("what was written", default=LEFT_OUT)


def describe_reconstruction(reconstruction: xr.DataTree) -> ReconstructionFacts:
    """Facts about a valid reconstruction: its points, mirrors, and remarks on what looks wrong."""
    every, objects = reconstruction.children["objects"].to_dataset(inherit=False), confident_points(reconstruction)
    left_out = int(np.size(reconstruction.attrs.get("mixed_x", ())))  # in files of earlier versions
    doubted = every.sizes.get("point", 0) - objects.sizes.get("point", 0)
    if "explanation" in every:
        left_out, explained_here = (int(np.count_nonzero(of["explanation"] != "")) for of in (every, objects))
        doubted -= left_out - explained_here
    bounces, counts = np.unique(objects["bounces"].values, return_counts=True)
    more: dict[str, Any] = {}
    if "wall" in objects:
        more["points_through_walls"] = int(passed_walls(objects).sum())
    if (frames := frame_count(reconstruction)) is not None:
        more["points_by_frame"] = np.bincount(objects["frame"].values, minlength=frames).tolist()
    return ReconstructionFacts(
        kind="reconstruction",
        title=str(reconstruction.attrs.get("title", "")),
        dimensions={str(name): int(size) for name, size in reconstruction.dataset["intensity"].sizes.items()},
        points=int(objects.sizes.get("point", 0)),
        points_on_mirrors=int(on_mirrors(objects).sum()),
        points_by_bounces={str(int(bounce)): int(count) for bounce, count in zip(bounces, counts, strict=True)},
        left_out=left_out,
        doubted=doubted,
        mirrors=mirror_table(reconstruction),
        remarks=remarks_on(reconstruction),
        **more,
    )


def remarks_on(reconstruction: xr.DataTree) -> list[str]:
    """Sentences on what looks wrong in a reconstruction, such as that nothing was found."""
    found = reconstruction.children["mirrors"].to_dataset(inherit=False).sizes.get("mirror", 0)
    said = str(reconstruction.attrs.get("remark", "" if found else "no mirror was found; the image is unfolded"))
    remarks = [f"{said[0].upper()}{said[1:]}."] if said else []
    return remarks if confident_points(reconstruction).sizes.get("point", 0) else [*remarks, "No object was found."]


def on_mirrors(objects: xr.Dataset) -> NDArray[np.bool_]:
    """Which points lie on the faces of mirrors, (n,); all others are objects.

    In files of earlier versions, which do not tell this, all points are objects.
    """
    if "surface" not in objects:
        return np.zeros(objects.sizes.get("point", 0), dtype=bool)
    return np.asarray(objects["surface"].values == "mirror")


def mirror_table(reconstruction: xr.DataTree) -> list[MirrorFacts]:
    """Facts about each mirror of a reconstruction, in two or three dimensions, in the order of the file."""
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    axes = "xyz" if "folded_z0" in mirrors else "xy"
    return [
        MirrorFacts(
            mirror=index,
            parent=int(mirror["parent"]),
            generation=int(mirror["generation"]),
            start_m=[float(mirror[f"folded_{axis}0"]) for axis in axes],
            end_m=[float(mirror[f"folded_{axis}1"]) for axis in axes],
            strength=float(mirror["strength"]),
            **_own_facts(mirror),
        )
        for index in range(mirrors.sizes.get("mirror", 0))
        for mirror in [mirrors.isel(mirror=index)]
    ]


PANE = {"permittivity": "permittivity", "permittivity_error": "permittivity_error",
        "thickness": "thickness_m", "thickness_error": "thickness_error_m"}  # fmt: skip
"""Columns of the table of mirrors that describe half-transparent walls, and their names in `MirrorFacts`."""


def _own_facts(mirror: xr.Dataset) -> dict[str, Any]:
    """Facts that only some mirrors have: frame, radius, and permittivity and thickness of half-transparent walls."""
    found: dict[str, Any] = {"frame": int(mirror["frame"])} if "frame" in mirror.coords else {}
    radius, error = radius_of(mirror)
    if radius is not None:
        found |= {"radius_m": radius, "radius_error_m": error}
    pane = {fact: float(mirror[name]) for name, fact in PANE.items() if name in mirror}
    if np.isfinite(pane.get("permittivity", np.nan)):
        found |= {fact: value if np.isfinite(value) else None for fact, value in pane.items()}
    return found


def radius_of(mirror: xr.Dataset) -> tuple[float | None, float | None]:
    """Radius [m] of a mirror, negative where it is concave, and its standard error [m].

    `mirror` is a row of the table of mirrors. Both are None for flat mirrors; the error is None where it is unknown.
    """
    curvature = float(mirror["curvature"]) if "curvature" in mirror else 0.0
    if curvature == 0.0 or not np.isfinite(curvature):
        return None, None
    error = float(mirror["curvature_error"]) / curvature**2 if "curvature_error" in mirror else np.nan
    return 1.0 / curvature, error if error > 0.0 else None  # unknown for mirrors that the user gave
