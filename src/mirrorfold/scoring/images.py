"""How close a reconstruction comes to the truth.

Accuracy asks of every reconstructed point how far the nearest true surface is, completeness asks of every piece of
true surface that could be seen at all whether a point lies near it. Points are thinned to one per cell first, so that
a dense blob counts once.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import cross2, crossing, reflect, segment_normal
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene, load_scene
from mirrorfold.scenes.surfaces import Surface

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CELL = 0.01
"""Points are thinned to cells of this size [m]."""

TRUTH_SPACING = 0.002
"""True surfaces are sampled this densely [m]."""

NEAR, WIDE, INVENTED = 0.02, 0.05, 0.10
"""Distances [m]: a good point, a fair point, and beyond which a point is invented."""

MIRROR_ANGLE_DEG, MIRROR_OFFSET = 10.0, 0.10
"""A detected mirror is an image of the true straight piece that it agrees with to this angle and distance [m]."""

SMALLEST_COSINE = 0.17
"""Surfaces are taken to be visible up to 80 degrees from their normal."""

SHORTEST_MIRROR = 0.15
"""Straight pieces of the truth shorter than this [m] are not counted on to show anything by reflection."""

BOUNCES = 3
"""Reflections that a line of sight may take to a piece of truth that counts as reachable."""


def score(
    reconstruction: xr.DataTree, scene: Scene | Scene3D | str | Path, *, bounces: int = BOUNCES
) -> dict[str, Any]:
    """Distances between a reconstruction and the true scene.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene, Scene3D or path of a scene file
    bounces : int
        Largest number of reflections by which a piece of truth counts as reachable.

    Returns
    -------
    dict
        `mirrors`: a list with `surface` (name of the true one or None), `angle_error_deg`, `offset_error_mm`,
        `generation` and `length_m` for every detected mirror, at its true place. For all points: `points`,
        `accuracy_m` (mean distance from the nearest true surface), `precision_2cm`, `precision_5cm`,
        `completeness_2cm`, `completeness_5cm` (share of the reachable truth within that distance of a point),
        `f_score_2cm`, `f_score_5cm`, `chamfer_m` (mean of both mean distances), `invented_fraction` (points further
        than 10 cm from any truth), `reachable_m` (length of reachable truth). `hidden`: the same keys for points seen
        by way of mirrors, and for surfaces of which nothing is in line of sight. What is undefined, such as the
        accuracy of no points, is None.

    Raises
    ------
    InputError
        If the first argument is not a reconstruction.
    """
    if not isinstance(reconstruction, xr.DataTree) or "objects" not in reconstruction.children:
        raise InputError("reconstruction: holds no group 'objects'; expected what `fold` or `reconstruct` returns")
    scene = load_scene(scene) if isinstance(scene, str | Path) else scene
    flat = "z" not in reconstruction.children["objects"].variables
    if flat != isinstance(scene, Scene):
        held, given = (2, 3) if flat else (3, 2)
        raise InputError(f"reconstruction: has {held} dimensions and the scene {given}; score it against its own scene")
    if not isinstance(scene, Scene):
        from mirrorfold.scoring.volumes import score_volume

        return score_volume(reconstruction, scene, bounces=bounces)
    objects = reconstruction.children["objects"].dataset
    points = np.stack([objects["x"].values, objects["y"].values], axis=-1)
    by_mirror = objects["bounces"].values > 0
    truth, normals, owner = _truth(scene)
    direct, reachable = visible_truth(scene, truth, normals, bounces=bounces)
    in_sight = {int(i) for i in np.unique(owner[direct])}
    hidden = ~np.isin(owner, list(in_sight))
    result: dict[str, Any] = {"mirrors": _mirrors(reconstruction, scene)}
    result |= _compare(points, truth, truth[reachable])
    result["hidden"] = {
        "mirrors": [row for row in result["mirrors"] if row["generation"] > 1],
        **_compare(points[by_mirror], truth, truth[reachable & hidden]),
        "surfaces": [surface.name for i, surface in enumerate(scene.surface) if i not in in_sight],
    }
    return result


def thin(points: Array, cell: float = CELL) -> Array:
    """The mean of the points in each occupied cell of a square grid, (m, 2) [m]."""
    if not len(points):
        return points.reshape(0, 2)
    _, which, counts = np.unique(
        np.floor(points / cell).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    which = which.ravel()
    return np.stack([np.bincount(which, weights=column) / counts for column in points.T], axis=-1)


def _compare(points: Array, truth: Array, reachable: Array) -> dict[str, Any]:
    """All the figures for one set of points; None where they are undefined."""
    points = thin(points)
    to_truth = cKDTree(truth).query(points)[0] if len(truth) and len(points) else np.full(len(points), np.inf)
    to_points = cKDTree(points).query(reachable)[0] if len(points) else np.full(len(reachable), np.inf)

    def share(distances: Array, limit: float) -> float | None:
        return float(np.mean(distances <= limit)) if len(distances) else None

    def mean(distances: Array) -> float | None:
        return float(np.mean(distances)) if len(distances) and np.isfinite(distances).all() else None

    result: dict[str, Any] = {"points": len(points), "accuracy_m": mean(to_truth)}
    for name, limit in (("2cm", NEAR), ("5cm", WIDE)):
        precision, completeness = share(to_truth, limit), share(to_points, limit)
        result[f"precision_{name}"] = precision
        result[f"completeness_{name}"] = completeness
        result[f"f_score_{name}"] = None
        if completeness is not None:
            both = (precision or 0.0) + completeness
            result[f"f_score_{name}"] = 2.0 * (precision or 0.0) * completeness / both if both else 0.0
    one_way, other_way = mean(to_truth), mean(to_points)
    result["chamfer_m"] = None if one_way is None or other_way is None else 0.5 * (one_way + other_way)
    result["invented_fraction"] = 1.0 - (share(to_truth, INVENTED) or 0.0) if len(points) else 0.0
    result["reachable_m"] = len(reachable) * TRUTH_SPACING
    return result


def _truth(scene: Scene) -> tuple[Array, Array, NDArray[np.intp]]:
    """Points on the true surfaces, their normals, and the number of the surface of each."""
    if not scene.surface:
        return np.empty((0, 2)), np.empty((0, 2)), np.empty(0, dtype=np.intp)
    parts = [surface.sample(TRUTH_SPACING)[:2] for surface in scene.surface]
    owner = np.repeat(np.arange(len(parts)), [len(points) for points, _ in parts])
    return np.concatenate([p for p, _ in parts]), np.concatenate([n for _, n in parts]), owner


def _facets(surface: Surface, spacing: float) -> Array:
    """Straight pieces of a surface, (n, 2, 2) [m]."""
    return np.concatenate([np.stack([piece[:-1], piece[1:]], axis=1) for piece in surface.pieces(spacing)])


def visible_truth(scene: Scene, truth: Array, normals: Array, *, bounces: int = BOUNCES) -> tuple[Mask, Mask]:
    """Which points of the truth the middle of the array can see: directly, and by way of mirrors.

    Lines of sight are those of geometrical optics: by the radar's images in chains of straight pieces, with every
    reflection on the piece itself and nothing in the way; no further than the ambiguous range.

    Parameters
    ----------
    scene : Scene
    truth, normals : (n, 2) arrays [m]
        Points on the surfaces and their normals.
    bounces : int

    Returns
    -------
    direct, reachable : (n,) bool arrays
        The second includes the first.
    """
    facets = [_facets(surface, 0.01) for surface in scene.surface]
    blockers = np.concatenate(facets) if facets else np.empty((0, 2, 2))
    straight = [f for surface, f in zip(scene.surface, facets, strict=True) if surface.kind in ("segment", "polyline")]
    mirrors = np.concatenate(straight) if straight else np.empty((0, 2, 2))
    mirrors = mirrors[np.linalg.norm(mirrors[:, 1] - mirrors[:, 0], axis=1) >= SHORTEST_MIRROR]
    radar = 0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))[:2]
    limit = speed_of_light * (scene.band.points - 1) / (2.0 * (scene.band.stop - scene.band.start))
    direct = _seen(radar, [], truth, normals, blockers, limit)
    reachable = direct.copy()
    # Chains of mirrors, each with the radar's images so far: a chain grows only while its last mirror can be seen.
    chains: list[tuple[list[int], list[Array]]] = [([], [radar])]
    for _ in range(bounces):
        longer = []
        for chain, images in chains:
            for index, (start, end) in enumerate(mirrors):
                if chain and chain[-1] == index:
                    continue
                image = reflect(images[-1], start, segment_normal(start, end))
                new = ([*chain, index], [*images, image])
                path = [(images[i], mirrors[m]) for i, m in enumerate(chain)]
                probe = start + np.linspace(0.01, 0.99, 25)[:, None] * (end - start)
                normal = np.tile(segment_normal(start, end), (25, 1))
                if not _seen(images[-1], path, probe, normal, blockers, limit, grazing=True).any():
                    continue
                longer.append(new)
                open_ = ~reachable
                path = [(images[i], mirrors[m]) for i, m in enumerate(new[0])]
                reachable[open_] |= _seen(image, path, truth[open_], normals[open_], blockers, limit)
        chains = longer
    return direct, reachable


def _seen(
    image: Array, path: list[tuple[Array, Array]], points: Array, normals: Array, blockers: Array, limit: float,
    grazing: bool = False,
) -> Mask:  # fmt: skip
    """Whether points are seen from the radar's `image` in a chain of mirrors.

    `path` lists, from the radar on, the image before each mirror and the mirror (2, 2). The way back is walked from
    the point: to its reflection in the last mirror, and so on to the radar.
    """
    seen = np.linalg.norm(points - image, axis=1) <= limit
    target = points
    source = image
    sight = (points - image) / np.maximum(np.linalg.norm(points - image, axis=1), 1e-9)[:, None]
    if not grazing:
        seen &= np.abs(np.sum(sight * normals, axis=1)) >= SMALLEST_COSINE
    for before, (start, end) in reversed(path):
        along_ray, along_mirror = crossing(source, target, start, end)
        # The virtual radar stands behind its mirror, the target in front of it.
        seen &= (along_ray > 0.0) & (along_ray < 1.0 - 1e-9) & (along_mirror >= 0.0) & (along_mirror <= 1.0)
        bounce = start + np.clip(np.nan_to_num(along_mirror), 0.0, 1.0)[:, None] * (end - start)
        side = cross2(end - start, before - start) * cross2(end - start, target - start)
        seen &= side > 0.0
        seen[seen] &= _free(bounce[seen], target[seen], blockers)
        target, source = bounce, before
    seen[seen] &= _free(np.broadcast_to(source, target.shape)[seen], target[seen], blockers)
    return np.asarray(seen)


def _free(origin: Array, target: Array, blockers: Array) -> Mask:
    """Whether nothing stands between origins and targets (n, 2), apart from what they lie on."""
    free = np.ones(len(target), dtype=bool)
    # Within a tenth of a millimetre of its ends a ray may touch the surfaces that it comes from and goes to.
    length = np.maximum(np.linalg.norm(target - origin, axis=1), 1e-9)
    slack = 1e-4 / length
    for start, end in blockers:
        along_ray, along_segment = crossing(origin, target, start, end)
        free &= ~((along_ray > slack) & (along_ray < 1.0 - slack) & (along_segment >= 0.0) & (along_segment <= 1.0))
    return free


def _mirrors(reconstruction: xr.DataTree, scene: Scene) -> list[dict[str, Any]]:
    """Every detected mirror with the true straight piece that it agrees with, if any."""
    found = reconstruction.children["mirrors"].dataset
    true = [
        (surface.name, facet)
        for surface in scene.surface
        if surface.kind in ("segment", "polyline")
        for facet in _facets(surface, 1.0)
    ]
    rows = []
    for i in range(found.sizes["mirror"]):
        start, end = (np.array([found[f"folded_{axis}{end}"].values[i] for axis in "xy"]) for end in (0, 1))
        best: dict[str, Any] = {"surface": None, "angle_error_deg": None, "offset_error_mm": None}
        nearest = np.inf
        for name, (a, b) in true:
            middle = 0.5 * (start + end)
            direction = (b - a) / np.linalg.norm(b - a)
            angle = float(
                np.degrees(np.arcsin(np.clip(abs(cross2(direction, end - start)) / np.linalg.norm(end - start), 0, 1)))
            )
            along = float((middle - a) @ direction)
            beyond = max(-along, along - float(np.linalg.norm(b - a)), 0.0)
            offset = abs(float(cross2(direction, middle - a)))
            distance = float(np.hypot(offset, beyond))
            if angle <= MIRROR_ANGLE_DEG and distance <= min(MIRROR_OFFSET, nearest):
                nearest = distance
                best = {"surface": name, "angle_error_deg": angle, "offset_error_mm": 1e3 * offset}
        best["generation"] = int(found["generation"].values[i])
        best["length_m"] = float(np.linalg.norm(end - start))
        rows.append(best)
    return rows
