"""How close a folded volume comes to the true three-dimensional scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

from mirrorfold.common.beams import beam_angles, beam_direction
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.scenes.solids import Patch, Scene3D
from mirrorfold.simulation.raster.chains import World, build_world, find_chains, walk_back
from mirrorfold.simulation.raster.meshes import Solid, solids
from mirrorfold.simulation.raster.speckle import image_frame, sample

TRUTH_SPACING = 0.005
"""Mean distance of the samples of the true surfaces [m]; between them the surface counts as flat."""

NEAR, COVERED, WIDE, INVENTED, FALSE = 0.02, 0.03, 0.05, 0.10, 0.15
"""Distances [m]: a good point, a covered piece of truth, a fair point, an invented and a false one."""

SMALLEST_COSINE = 0.17
"""Surfaces are taken to be visible up to 80 degrees from their normal."""

MIRROR_ANGLE_DEG, MIRROR_OFFSET = 10.0, 0.10
"""A detected mirror is an image of the true face that it agrees with to this angle and distance [m]."""

RING, GUARD = 0.10, 0.02
"""A patch is compared with what surrounds it up to the first distance, without the beam that straddles its edge [m]."""

FAN = 81


def score_volume(reconstruction: xr.DataTree, scene: Scene3D, *, bounces: int = 3) -> dict[str, Any]:
    """Distances between a folded volume and the true scene.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene3D
    bounces : int
        Largest number of reflections by which a piece of truth counts as reachable.

    Returns
    -------
    dict
        As in two dimensions (see `mirrorfold.score`), with areas `reachable_m2` in place of lengths; besides
        `completeness_3cm` and `false_fraction` (points further than 15 cm from any truth). `surfaces`: the same for the
        points nearest to each surface out of sight; `patches`: contrast of each patch to its surroundings,
        `contrast_db`.
    """
    objects = reconstruction.children["objects"].dataset
    points = np.stack([objects[letter].values for letter in "xyz"], axis=-1)
    by_mirror = objects["bounces"].values > 0
    parts = solids(scene)
    place, normals, owner = _truth(scene, parts)
    direct, reachable = visible_truth(scene, parts, place, normals, bounces=bounces)
    tree = cKDTree(place) if len(place) else None
    distance, nearest = _distances(points, tree, place, normals)
    names = [surface.name for surface in scene.surface]
    seen = {int(i) for i in np.unique(owner[direct])}
    hidden = np.array([i not in seen for i in range(len(names))])
    result: dict[str, Any] = {"mirrors": _mirrors(reconstruction, scene, parts)}
    result |= _figures(points, distance, place[reachable])
    is_hidden = hidden[owner] if len(owner) else np.zeros(0, dtype=bool)
    result["hidden"] = {
        "mirrors": [row for row in result["mirrors"] if row["generation"] > 1],
        **_figures(points[by_mirror], distance[by_mirror], place[reachable & is_hidden]),
        "surfaces": [name for i, name in enumerate(names) if hidden[i] and not isinstance(scene.surface[i], Patch)],
    }
    nearest_owner = owner[nearest] if len(owner) else np.zeros(len(points), dtype=int)
    result["surfaces"] = {}
    for solid in parts:
        at = solid.surface
        mine = by_mirror & (nearest_owner == at)
        if hidden[at]:
            result["surfaces"][names[at]] = _figures(points[mine], distance[mine], place[reachable & (owner == at)])
    amplitude = objects["amplitude"].values
    result["patches"] = {
        surface.name: {"contrast_db": patch_contrast(scene, surface, points[by_mirror], amplitude[by_mirror])}
        for surface in scene.surface
        if isinstance(surface, Patch)
    }
    return result


def _truth(scene: Scene3D, parts: list[Solid]) -> tuple[Array, Array, Index]:
    """Samples of all surfaces, their outward normals, and whose they are."""
    found = []
    for solid in parts:
        for side in solid.quads or (None,):
            place, normals, _ = sample(solid, side, TRUTH_SPACING, np.random.default_rng(0))
            found.append((place, normals, np.full(len(place), solid.surface)))
    if not found:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64)
    place, normals, owner = (np.concatenate(column) for column in zip(*found, strict=True))
    return place, normals, owner


def _distances(points: Array, tree: cKDTree | None, place: Array, normals: Array) -> tuple[Array, Index]:
    """Distance [m] of points from the truth, and its nearest sample; between samples the surface is flat."""
    if tree is None or not len(points):
        return np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
    distance, nearest = tree.query(points)
    across = np.abs(np.einsum("nd,nd->n", points - place[nearest], normals[nearest]))
    aside = np.sqrt(np.maximum(distance**2 - across**2, 0.0))
    return np.hypot(across, np.maximum(aside - TRUTH_SPACING, 0.0)), nearest


def _figures(points: Array, distance: Array, reachable: Array) -> dict[str, Any]:
    """All the figures for one set of points; None where they are undefined."""
    to_points = cKDTree(points).query(reachable)[0] if len(points) else np.full(len(reachable), np.inf)

    def share(values: Array, limit: float) -> float | None:
        return float(np.mean(values <= limit)) if len(values) else None

    def mean(values: Array) -> float | None:
        return float(np.mean(values)) if len(values) and np.isfinite(values).all() else None

    result: dict[str, Any] = {"points": len(points), "accuracy_m": mean(distance)}
    for name, limit in (("2cm", NEAR), ("5cm", WIDE)):
        precision, completeness = share(distance, limit), share(to_points, limit)
        result[f"precision_{name}"] = precision
        result[f"completeness_{name}"] = completeness
        both = (precision or 0.0) + (completeness or 0.0)
        result[f"f_score_{name}"] = (
            None if completeness is None else 2.0 * (precision or 0.0) * completeness / both if both else 0.0
        )
    result["completeness_3cm"] = share(to_points, COVERED)
    one_way, other_way = mean(distance), mean(to_points)
    result["chamfer_m"] = None if one_way is None or other_way is None else 0.5 * (one_way + other_way)
    result["invented_fraction"] = 1.0 - (share(distance, INVENTED) or 0.0) if len(points) else 0.0
    result["false_fraction"] = 1.0 - (share(distance, FALSE) or 0.0) if len(points) else 0.0
    result["reachable_m2"] = len(reachable) * TRUTH_SPACING**2
    return result


def visible_truth(
    scene: Scene3D, parts: list[Solid], place: Array, normals: Array, *, bounces: int
) -> tuple[Mask, Mask]:
    """Which samples of the truth the scan can see: directly, and by way of mirrors too, each (n,) bool."""
    direct = np.zeros(len(place), dtype=bool)
    reachable = direct.copy()
    if not parts:
        return direct, reachable
    world: World = build_world(parts)
    origin = np.array(scene.scanner.origin)
    frequency = 0.5 * (scene.band.start + scene.band.stop)
    limit = speed_of_light * (scene.band.points - 1) / (2.0 * (scene.band.stop - scene.band.start))
    azimuth, elevation = scene.scanner.angles
    fan = beam_direction(
        np.linspace(azimuth[0], azimuth[-1], FAN)[:, None], np.linspace(elevation[0], elevation[-1], FAN)
    )
    for chain in find_chains(scene, world, origin, fan.reshape(-1, 3), bounces=bounces, frequency=frequency):
        to_image = image_frame(world.quads, chain)
        sight = to_image.inverse(origin) - place
        distance = np.linalg.norm(sight, axis=1)
        az, el = beam_angles(to_image(place) - origin)
        inside = (az >= azimuth[0]) & (az <= azimuth[-1]) & (el >= elevation[0]) & (el <= elevation[-1])
        facing = np.einsum("nd,nd->n", sight, normals) >= SMALLEST_COSINE * distance
        which = np.flatnonzero(inside & facing & (distance <= limit) & ~reachable)
        seen, _ = walk_back(scene, world, origin, chain, place[which], frequency=frequency)
        reachable[which[seen]] = True
        if not chain:
            direct[which[seen]] = True
    return direct, reachable


def patch_contrast(scene: Scene3D, patch: Patch, points: Array, amplitude: Array) -> float | None:
    """Mean power of the points on a patch over that of the points around it [dB]; None without any.

    The scene need not hold the patch: the control without it is judged in the same region.
    """
    below = next(surface for surface in scene.surface if surface.name == patch.on)
    solid = next(s for s in solids(scene) if scene.surface[s.surface].name == patch.on)
    back = below.frame.inverse
    place, normals = (
        np.concatenate(column)
        for column in zip(
            *(sample(solid, side, TRUTH_SPACING, np.random.default_rng(0))[:2] for side in solid.quads or (None,)),
            strict=True,
        )
    )
    if not len(points):
        return None
    covered = patch.covers(back(place), normals @ back.linear.T)
    on_patch, off_patch = cKDTree(place[covered]), cKDTree(place[~covered])
    inside, outside = on_patch.query(points)[0], off_patch.query(points)[0]
    on = (inside < NEAR) & (outside > 0.5 * GUARD)
    around = (inside > GUARD) & (inside < RING) & (outside < NEAR)
    if not on.any() or not around.any():
        return None
    power = amplitude.astype(float) ** 2
    return float(10.0 * np.log10(power[on].mean() / power[around].mean()))


def _mirrors(reconstruction: xr.DataTree, scene: Scene3D, parts: list[Solid]) -> list[dict[str, Any]]:
    """Every detected mirror with the true face that it agrees with, if any."""
    found = reconstruction.children["mirrors"].dataset
    faces = [(scene.surface[solid.surface].name, quad) for solid in parts for quad in solid.quads]
    rows = []
    for i in range(found.sizes["mirror"]):
        center, normal = (np.array([found[f"folded_{w}_{a}"].values[i] for a in "xyz"]) for w in ("center", "normal"))
        corners = np.stack([found[f"folded_corner_{a}"].values[i] for a in "xyz"], axis=-1)
        best: dict[str, Any] = {"surface": None, "angle_error_deg": None, "offset_error_mm": None}
        nearest = np.inf
        for name, quad in faces:
            angle = float(np.degrees(np.arccos(np.clip(abs(normal @ quad.normal), 0.0, 1.0))))
            offset = abs(float((center - quad.center) @ quad.normal))
            on_face = center - ((center - quad.center) @ quad.normal) * quad.normal
            across = abs((on_face - quad.center) @ quad.right) / (quad.right @ quad.right)
            along = abs((on_face - quad.center) @ quad.up) / (quad.up @ quad.up)
            if angle <= MIRROR_ANGLE_DEG and offset <= min(MIRROR_OFFSET, nearest) and max(across, along) <= 1.1:
                nearest = offset
                best = {"surface": name, "angle_error_deg": angle, "offset_error_mm": 1e3 * offset}
        best["generation"] = int(found["generation"].values[i])
        best["length_m"] = float(np.linalg.norm(corners[1] - corners[0]))
        rows.append(best)
    return rows
