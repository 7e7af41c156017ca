"""How far detected mirrors are from the true faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.geometry import segment_normal
from mirrorfold.common.records import Number, Record

Array = NDArray[np.float64]

MIRROR_ANGLE_DEG, MIRROR_OFFSET = 10.0, 0.10
"""A detected mirror is an image of the true face that it agrees with to this angle [degree] and distance [m]: far
more than the errors of a good fit, and less than what lies between the faces of most rooms."""


class MirrorError(Record):
    """A detected mirror against the true surface that it agrees with, if any."""

    surface: str | None
    angle_error_deg: Number
    offset_error_mm: Number
    generation: int
    length_m: float


@dataclass(frozen=True)
class Face:
    """A flat piece of a true surface, in d = 2 or 3 dimensions.

    Attributes
    ----------
    surface : str
        Its name.
    center, normal : (d,) arrays
        Its middle [m], and its unit normal.
    halves : (d - 1, d) array [m]
        From the center to the middle of each edge or end.
    """

    surface: str
    center: Array
    normal: Array
    halves: Array


def mirror_errors(reconstruction: xr.DataTree, faces: list[Face]) -> list[MirrorError]:
    """Every detected mirror, at its true place, with the nearest face that it agrees with."""
    found = reconstruction.children["mirrors"].dataset
    rows = []
    for i in range(found.sizes["mirror"]):
        center, normal, length = _placed(found.isel(mirror=i))
        near = [face for face in faces if _distance(center, normal, face) <= MIRROR_OFFSET]
        best = min(near, key=lambda face: _distance(center, normal, face), default=None)
        rows.append(
            MirrorError(
                surface=best.surface if best else None,
                angle_error_deg=_angle_deg(normal, best.normal) if best else None,
                offset_error_mm=1e3 * abs(float((center - best.center) @ best.normal)) if best else None,
                generation=int(found["generation"].values[i]),
                length_m=length,
            )
        )
    return rows


def _placed(mirror: xr.Dataset) -> tuple[Array, Array, float]:
    """Center [m], unit normal and length [m] of a mirror, folded."""
    if "folded_center_x" in mirror:
        center, normal = (np.array([float(mirror[f"folded_{what}_{axis}"]) for axis in "xyz"]) for what in
                          ("center", "normal"))  # fmt: skip
        corners = np.stack([mirror[f"folded_corner_{axis}"].values for axis in "xyz"], axis=-1)
        return center, normal, float(np.linalg.norm(corners[1] - corners[0]))
    start, end = (np.array([float(mirror[f"folded_{axis}{which}"]) for axis in "xy"]) for which in (0, 1))
    return 0.5 * (start + end), segment_normal(start, end), float(np.linalg.norm(end - start))


def _distance(center: Array, normal: Array, face: Face) -> float:
    """Distance [m] of the middle of a mirror from a face; infinite where they are turned too far against each other."""
    if _angle_deg(normal, face.normal) > MIRROR_ANGLE_DEG:
        return np.inf
    lengths = np.linalg.norm(face.halves, axis=1)
    beyond = np.maximum(np.abs(face.halves @ (center - face.center)) / lengths - lengths, 0.0)
    return float(np.linalg.norm([(center - face.center) @ face.normal, *beyond]))


def _angle_deg(normal: Array, other: Array) -> float:
    """Angle between two planes of unit normals [degree]: by its sine, since a cosine loses small angles to rounding."""
    aside = normal - (normal @ other) * other
    return float(np.degrees(np.arcsin(min(1.0, float(np.linalg.norm(aside))))))
