"""The mirrors and points of a reconstruction."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.describing.contents import Sized
from mirrorfold.folding.frames import frame_count
from mirrorfold.folding.shown import shown_points


class MirrorFacts(Record):
    """A mirror at its true place."""

    mirror: int
    parent: int = fact("the mirror it was seen through, -1 for none")
    generation: int
    start_m: list[float] = fact(min_length=2, max_length=3)
    end_m: list[float] = fact(min_length=2, max_length=3)
    strength: Number
    frame: int = fact("of a recording", default=LEFT_OUT)


class ReconstructionFacts(Sized):
    """A reconstruction."""

    kind: Literal["reconstruction"]
    points: int = fact("of objects and on the faces of mirrors, of those that are not doubted")
    points_on_mirrors: int = fact("those on the faces of mirrors")
    points_by_bounces: dict[str, int]
    left_out: int = fact(
        "echoes where nothing stands: by mixed paths, from beyond the ambiguous range, or copies of others"
    )
    doubted: int = fact("points of less than the least confidence, which are not drawn, scored or exported")
    points_by_frame: list[int] = fact("of a recording", default=LEFT_OUT)
    mirrors: list[MirrorFacts]
    remarks: list[str] = fact("sentences on what looks wrong")
    files: list[str] = fact("what was written", default=LEFT_OUT)


def describe_reconstruction(reconstruction: xr.DataTree) -> ReconstructionFacts:
    """What a valid reconstruction holds."""
    every, objects = reconstruction.children["objects"].to_dataset(inherit=False), shown_points(reconstruction)
    left_out = int(np.size(reconstruction.attrs.get("mixed_x", ())))  # as files of earlier versions tell
    doubted = every.sizes.get("point", 0) - objects.sizes.get("point", 0)
    if "explanation" in every:
        left_out, explained_here = (int(np.count_nonzero(of["explanation"] != "")) for of in (every, objects))
        doubted -= left_out - explained_here
    bounces, counts = np.unique(objects["bounces"].values, return_counts=True)
    mirrors = mirror_table(reconstruction)
    remarks = []
    if said := str(reconstruction.attrs.get("remark", "" if mirrors else "no mirror was found; the image is unfolded")):
        remarks.append(f"{said[0].upper()}{said[1:]}.")
    if not objects.sizes.get("point", 0):
        remarks.append("No object was found.")
    recording: dict[str, Any] = {}
    if (frames := frame_count(reconstruction)) is not None:
        recording = {"points_by_frame": np.bincount(objects["frame"].values, minlength=frames).tolist()}
    return ReconstructionFacts(
        kind="reconstruction",
        title=str(reconstruction.attrs.get("title", "")),
        dimensions={str(name): int(size) for name, size in reconstruction.dataset["intensity"].sizes.items()},
        points=int(objects.sizes.get("point", 0)),
        points_on_mirrors=int(on_mirrors(objects).sum()),
        points_by_bounces={str(int(bounce)): int(count) for bounce, count in zip(bounces, counts, strict=True)},
        left_out=left_out,
        doubted=doubted,
        mirrors=mirrors,
        remarks=remarks,
        **recording,
    )


def on_mirrors(objects: xr.Dataset) -> NDArray[np.bool_]:
    """Which points are faces of mirrors, (n,); all others are those of objects. Old files do not tell."""
    if "surface" not in objects:
        return np.zeros(objects.sizes.get("point", 0), dtype=bool)
    return np.asarray(objects["surface"].values == "mirror")


def mirror_table(reconstruction: xr.DataTree) -> list[MirrorFacts]:
    """The mirrors of a reconstruction in two or three dimensions, in the order of the file."""
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
            **({"frame": int(mirror["frame"])} if "frame" in mirror.coords else {}),
        )
        for index in range(mirrors.sizes.get("mirror", 0))
        for mirror in [mirrors.isel(mirror=index)]
    ]
