"""Errors of detected mirrors: how far each is from the face of a true surface that it agrees with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mirrorfold.common.arcs import arc_through, circle_through, mirror_places
from mirrorfold.common.facts import recorded_radar
from mirrorfold.common.geometry import segment_normal
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.common.types import Array

MIRROR_ANGLE_DEG, MIRROR_OFFSET = 10.0, 0.10
"""A detected mirror belongs to a true face that it agrees with to this angle [degree] and distance [m]: far more than
the errors of a good fit, and less than the differences between the faces of most rooms. Both follow from rooms, not
from the radar: a mirror that a coarse radar misplaces by more agrees with no face."""


class MirrorError(Record):
    """Errors of a detected mirror against the true surface that it agrees with, if there is one."""

    surface: str | None
    angle_error_deg: Number
    offset_error_mm: Number
    generation: int
    length_m: float = fact("along the arc of a curved one")
    curvature_error: Number = fact("of a curved mirror, as a share of the true curvature", default=LEFT_OUT)
    permittivity_error: Number = fact("of a half-transparent wall, as a share of the true one", default=LEFT_OUT)
    thickness_error: Number = fact("of a half-transparent wall, as a share of the true one", default=LEFT_OUT)


@dataclass(frozen=True)
class Face:
    """A flat piece of the true surface of that name, in d = 2 or 3 dimensions.

    It has a `center` (d,) [m] and a unit `normal` (d,); the `halves` (d - 1, d) [m] lead from the center to one end of
    the face, or in space to the middle of two adjacent edges. It is `one_sided` if it is the face of a slab, which can
    be detected only from the side to which the normal points.
    """

    surface: str
    center: Array
    normal: Array
    halves: Array
    one_sided: bool = False


def mirror_errors(
    reconstruction: xr.DataTree,
    faces: list[Face],
    curves: Sequence[tuple[str, Array]] = (),
    panes: Mapping[str, tuple[float, float]] | None = None,
) -> list[MirrorError]:
    """Errors of every detected mirror at its true place against the nearest face that it agrees with.

    A curved mirror is compared with the nearest of the true `curves`, names and points (n, 2) [m], if one is near; a
    half-transparent wall with the permittivity and thickness [m] of the true ones, `panes` by name.
    """
    found = reconstruction.children["mirrors"].to_dataset(inherit=False)
    places = mirror_places(found, "folded_") if curves and "curvature" in found else []
    radar = recorded_radar(reconstruction.attrs)
    rows, panes = [], panes or {}
    for i in range(found.sizes["mirror"]):
        generation = int(found["generation"].values[i])
        curved_row = _curved_error(places[i], curves, generation) if places else None
        if curved_row is not None:
            rows.append(curved_row)
            continue
        center, normal, length = _placed(found.isel(mirror=i))
        parent = int(found["parent"].values[i]) if "parent" in found else -1
        seen_from = radar[: center.size] if parent < 0 else _placed(found.isel(mirror=parent))[0]
        near = [
            face
            for face in faces
            if _distance(center, normal, face) <= MIRROR_OFFSET
            and (not face.one_sided or (seen_from - face.center) @ face.normal > 0.0)
        ]
        best = min(near, key=lambda face: _distance(center, normal, face), default=None)
        rows.append(
            MirrorError(
                surface=best.surface if best else None,
                angle_error_deg=_angle_deg(normal, best.normal) if best else None,
                offset_error_mm=1e3 * abs(float((center - best.center) @ best.normal)) if best else None,
                generation=generation,
                length_m=length,
                **(_pane_errors(found.isel(mirror=i), panes[best.surface]) if best and best.surface in panes else {}),
            )
        )
    return rows


def _pane_errors(mirror: xr.Dataset, true: tuple[float, float]) -> dict[str, float]:
    """Errors of a wall's measured permittivity and thickness, as shares of the `true` ones; empty if not measured."""
    names = "permittivity", "thickness"
    if not all(name in mirror and np.isfinite(mirror[name]) for name in names):
        return {}
    return {f"{name}_error": abs(float(mirror[name]) / own - 1.0) for name, own in zip(names, true, strict=True)}


def _curved_error(place: Array, curves: Sequence[tuple[str, Array]], generation: int) -> MirrorError | None:
    """Errors of an arc, given by three points (3, 2) [m], against the nearest true curve.

    None if no curve agrees, and for a line. The true curvature is that of the circle through the three places of the
    curve that are nearest to the start, middle and end of the arc.
    """
    if len(place) != 3:
        return None
    every = [_nearest(place, points) for _, points in curves]
    away = [float(np.linalg.norm(place[1] - nearest[1])) for nearest in every]
    best = int(np.argmin(away))
    if away[best] > MIRROR_OFFSET:
        return None
    there = every[best]
    (middle, true_middle), (radius, true_radius) = circle_through(*np.stack([place, there], axis=1))
    angle = _angle_deg((place[1] - middle) / radius, (there[1] - true_middle) / true_radius)
    if not np.isfinite(true_radius) or angle > MIRROR_ANGLE_DEG:
        return None
    # If the arc is bent the other way, its error is the sum of both curvatures.
    ratio = true_radius / radius * (1.0 if (place[1] - middle) @ (there[1] - true_middle) > 0.0 else -1.0)
    return MirrorError(
        surface=curves[best][0],
        angle_error_deg=angle,
        offset_error_mm=1e3 * away[best],
        generation=generation,
        length_m=float(np.linalg.norm(np.diff(arc_through(*place), axis=0), axis=1).sum()),
        curvature_error=abs(ratio - 1.0),
    )


def _nearest(places: Array, points: Array) -> Array:
    """The point nearest to each of the places (n, 2) [m] on the polyline through points (m, 2) [m], (n, 2)."""
    start, way = points[:-1], np.diff(points, axis=0)
    along = np.sum((places[:, None] - start) * way, axis=-1) / np.sum(way * way, axis=-1)
    on_it = start + np.clip(along, 0.0, 1.0)[..., None] * way
    chosen = np.argmin(np.linalg.norm(places[:, None] - on_it, axis=-1), axis=1)
    return on_it[np.arange(len(places)), chosen]


def _placed(mirror: xr.Dataset) -> tuple[Array, Array, float]:
    """Center [m], unit normal and length [m] of a mirror at its true place."""
    if "folded_center_x" in mirror:
        center, normal = (np.array([float(mirror[f"folded_{what}_{axis}"]) for axis in "xyz"]) for what in
                          ("center", "normal"))  # fmt: skip
        corners = np.stack([mirror[f"folded_corner_{axis}"].values for axis in "xyz"], axis=-1)
        return center, normal, float(np.linalg.norm(corners[1] - corners[0]))
    start, end = (np.array([float(mirror[f"folded_{axis}{which}"]) for axis in "xy"]) for which in (0, 1))
    return 0.5 * (start + end), segment_normal(start, end), float(np.linalg.norm(end - start))


def _distance(center: Array, normal: Array, face: Face) -> float:
    """Distance [m] of the middle of a mirror from a face; infinite if they differ by more than `MIRROR_ANGLE_DEG`."""
    if _angle_deg(normal, face.normal) > MIRROR_ANGLE_DEG:
        return np.inf
    lengths = np.linalg.norm(face.halves, axis=1)
    beyond = np.maximum(np.abs(face.halves @ (center - face.center)) / lengths - lengths, 0.0)
    return float(np.linalg.norm([(center - face.center) @ face.normal, *beyond]))


def _angle_deg(normal: Array, other: Array) -> float:
    """Angle [degree] between planes of unit normals, from its sine: the cosine loses small angles to rounding."""
    aside = normal - (normal @ other) * other
    return float(np.degrees(np.arcsin(min(1.0, float(np.linalg.norm(aside))))))
