"""What the middle of an array can see of the surfaces of a floor plan, directly and by way of mirrors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import cross2, crossing, reflect, segment_normal
from mirrorfold.common.types import Array, Mask
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Arc, Circle, Surface

BOUNCES = 3
"""Reflections that a line of sight may take to a piece of truth that counts as reachable."""

SMALLEST_COSINE = 0.17
"""Surfaces are taken to be visible up to 80 degrees from their normal: at more, less than a sixth of
their area is turned towards the radar."""

CHORD = 0.01
"""Curved surfaces block the view as chords of this length [m]; those of a metre's radius are 12 um off."""

SHORTEST_MIRROR = 0.15
"""Straight pieces of the truth shorter than this [m] are not counted on to show anything by reflection."""

STRAIGHT = ("segment", "polyline")
"""Kinds of surfaces that mirrors are looked for in."""

ARC_NODES = 721
"""Angles along an arc between which the mirror point of a line of sight is looked for."""

OFF_ARC = 5e-4
"""Mirror points are moved so far [m] off an arc, clear of the chords that stand for it."""

PROBES = np.linspace(0.01, 0.99, 25)
"""Places along a mirror, as shares of its length, one of which must be seen for the mirror to show anything."""

TOUCHING = 1e-4
"""Within this distance of its ends [m] a ray may touch the surfaces that it comes from and goes to."""


def visible_truth(
    scene: Scene, truth: Array, normals: Array, *, bounces: int = BOUNCES, curved: bool = True
) -> tuple[Mask, Mask]:
    """Which points (n, 2) [m] with these normals the middle of the array can see: directly; by way of mirrors, too.

    Lines of sight are those of geometrical optics: by the radar's images in chains of straight pieces, with every
    reflection on the piece itself and nothing in the way; and, where `curved` mirrors count, by way of one arc or
    circle alone. No further than the ambiguous range.
    """
    pieces = [facets(surface, CHORD) for surface in scene.surface]
    blockers = _blockers(scene)
    straight = [f for surface, f in zip(scene.surface, pieces, strict=True) if surface.kind in STRAIGHT]
    mirrors = np.concatenate(straight) if straight else np.empty((0, 2, 2))
    mirrors = mirrors[np.linalg.norm(mirrors[:, 1] - mirrors[:, 0], axis=1) >= SHORTEST_MIRROR]
    radar = _middle_of_array(scene)
    limit = farthest_range(scene.band)
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
                probe = start + PROBES[:, None] * (end - start)
                normal = np.tile(segment_normal(start, end), (len(PROBES), 1))
                if not _seen(images[-1], path, probe, normal, blockers, limit, grazing=True).any():
                    continue
                longer.append(new)
                open_ = ~reachable
                path = [(images[i], mirrors[m]) for i, m in enumerate(new[0])]
                reachable[open_] |= _seen(image, path, truth[open_], normals[open_], blockers, limit)
        chains = longer
    if bounces and curved:
        for surface in scene.surface:
            if isinstance(surface, Arc | Circle) and not reachable.all():
                open_ = ~reachable
                reachable[open_] |= _seen_in_arc(surface, radar, truth[open_], normals[open_], blockers, limit)
    return direct, reachable


def _seen_in_arc(
    surface: Arc | Circle, radar: Array, points: Array, normals: Array, blockers: Array, limit: float
) -> Mask:
    """Whether points (n, 2) with these normals are seen from the radar by way of one arc or circle, either side of it.

    Where the length of the way has no slope along the arc it is reflected.
    """
    first, last = (0.0, 360.0) if isinstance(surface, Circle) else (surface.start_angle, surface.stop_angle)
    angle = np.radians(np.linspace(first, last, ARC_NODES))
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tangent = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
    place = np.asarray(surface.center) + surface.radius * outward
    to_radar = place - radar
    slope = np.sum(tangent * to_radar, axis=1) / np.linalg.norm(to_radar, axis=1)
    away = place - points[:, None]
    slope = slope + np.einsum("md,nmd->nm", tangent, away) / np.maximum(np.linalg.norm(away, axis=2), 1e-9)
    who, node = np.nonzero((slope[:, 1:] < 0.0) != (slope[:, :-1] < 0.0))
    before, after = slope[who, node], slope[who, node + 1]
    met = angle[node] + before / (before - after) * (angle[1] - angle[0])
    normal = np.stack([np.cos(met), np.sin(met)], axis=1)
    hit, target = np.asarray(surface.center) + surface.radius * normal, points[who]
    there, back = hit - radar, target - hit
    length = np.linalg.norm(there, axis=1), np.linalg.norm(back, axis=1)
    incident, reflected = -np.sum(there * normal, axis=1) / length[0], np.sum(back * normal, axis=1) / length[1]
    side = np.sign(incident)
    found = (incident * reflected > 0.0) & (np.abs(incident) >= SMALLEST_COSINE) & (length[0] + length[1] <= limit)
    found &= np.abs(np.sum(back * normals[who], axis=1)) >= SMALLEST_COSINE * length[1]
    hit = hit + OFF_ARC * side[:, None] * normal
    found[found] &= _free(np.broadcast_to(radar, hit.shape)[found], hit[found], blockers)
    found[found] &= _free(hit[found], target[found], blockers)
    seen = np.zeros(len(points), dtype=bool)
    seen[who[found]] = True
    return seen


def seen_by_way(scene: Scene, way: Sequence[Array], truth: Array, normals: Array, *, grazing: bool = False) -> Mask:
    """Which points (n, 2) [m] with these normals the middle of the array can see by way of given mirrors alone.

    Parameters
    ----------
    scene : Scene
    way : sequence of (2, 2) arrays [m]
        Ends of the mirrors at their true places, the one that the radar looks into first; none for line of sight.
    truth, normals : (n, 2) arrays [m]
    grazing : bool, default False
        At any angle, as walls are seen that are straight for many wavelengths; else up to 80 degrees from the normal.
    """
    images = [_middle_of_array(scene)]
    for start, end in way:
        images.append(reflect(images[-1], start, segment_normal(start, end)))
    blockers = _blockers(scene)
    path = list(zip(images, way, strict=False))
    return _seen(images[-1], path, truth, normals, blockers, farthest_range(scene.band), grazing)


def _blockers(scene: Scene) -> Array:
    """Straight pieces of all that is opaque, (n, 2, 2) [m]."""
    opaque = [facets(some, CHORD) for some in scene.surface if getattr(some, "thickness", None) is None]
    return np.concatenate(opaque) if opaque else np.empty((0, 2, 2))


def _middle_of_array(scene: Scene) -> Array:
    """Between the middles of the transmitters and the receivers (2,) [m]."""
    return np.asarray(0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))[:2])


def farthest_range(band: Band) -> float:
    """The ambiguous range [m], beyond which nothing counts as visible."""
    return speed_of_light * (band.points - 1) / (2.0 * (band.stop - band.start))


def facets(surface: Surface, spacing: float) -> Array:
    """Straight pieces of a surface, (n, 2, 2) [m]."""
    return np.concatenate([np.stack([piece[:-1], piece[1:]], axis=1) for piece in surface.pieces(spacing)])


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
    length = np.maximum(np.linalg.norm(target - origin, axis=1), 1e-9)
    slack = TOUCHING / length
    for start, end in blockers:
        along_ray, along_segment = crossing(origin, target, start, end)
        free &= ~((along_ray > slack) & (along_ray < 1.0 - slack) & (along_segment >= 0.0) & (along_segment <= 1.0))
    return free
