"""Which points of a floor plan's surfaces the middle of the array can see, directly and by way of mirrors.

Scores use this to tell which part of the truth is reachable, and families of random scenes to check what is hidden.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.geometry import cross2, crossing, reflect, segment_normal
from mirrorfold.common.types import Array, Mask
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Arc, Circle, Surface

MOST_BOUNCES = 1000
"""Largest number of reflections that may be asked for: echoes of more have died away."""

BOUNCES = 3
"""Largest number of reflections on the way to a point that counts as reachable."""

SMALLEST_COSINE = 0.17
"""Least cosine of the angle to the normal at which a surface counts as visible, 80 degrees: at larger angles, less than
a sixth of its area is turned towards the radar."""

CHORD = 0.01
"""Length [m] of the chords by which curved surfaces block the view; for a radius of 1 m they deviate by 12 um."""

SHORTEST_MIRROR = 0.15
"""Least length [m] of a straight piece that counts as a mirror."""

SMALLEST_RADIUS = 0.05
"""Least radius [m] of an arc or circle that counts as a mirror. A smaller one spreads the waves so much that two places
which it shows to the array are not told apart, nor from its own echo: it is an object."""

STRAIGHT = ("segment", "polyline")
"""Kinds of surfaces whose pieces count as flat mirrors."""

ARC_NODES = 721
"""Number of angles along an arc, between which the specular point of a path is looked for."""

OFF_ARC = 5e-4
"""Distance [m] by which specular points are moved off an arc, so that the chords of the arc do not block the path."""

PROBES = np.linspace(0.01, 0.99, 25)
"""Sample points along a mirror, as fractions of its length: the radar must see one of them to see anything in it."""

TOUCHING = 1e-4
"""Surfaces within this distance [m] of the ends of a ray do not block it, as the ray begins and ends on surfaces."""

AT_ONCE = 8192
"""Number of pairs of a ray and a blocker that are looked at together: so few that they stay in the cache."""


def visible_truth(
    scene: Scene, truth: Array, normals: Array, *, bounces: int = BOUNCES, curved: bool = True
) -> tuple[Mask, Mask]:
    """Which points (n, 2) [m] with these normals the middle of the array can see: directly, and directly or by mirrors.

    Paths are those of geometrical optics. They lead over chains of up to `bounces` straight mirrors, found by the
    images of the radar, with every specular point on its mirror and no obstacle in between. If `curved` mirrors count,
    paths may also lead over a single arc or circle. No path is longer than the ambiguous range.

    Returns
    -------
    direct : (n,) bool array
        Points in line of sight.
    reachable : (n,) bool array
        Points in line of sight, or seen by way of mirrors.
    """
    pieces = [facets(surface, CHORD) for surface in scene.surface]
    blockers = _blockers(scene)
    straight = [f for surface, f in zip(scene.surface, pieces, strict=True) if surface.kind in STRAIGHT]
    mirrors = np.concatenate(straight) if straight else np.empty((0, 2, 2))
    mirrors = mirrors[np.linalg.norm(mirrors[:, 1] - mirrors[:, 0], axis=1) >= SHORTEST_MIRROR]
    radar = scene.array.middle[:2]
    limit = scene.band.ambiguous_range
    direct = _seen(radar, [], truth, normals, blockers, limit)
    reachable = direct.copy()
    # Chains of mirrors, each with the images of the radar in them. A mirror is appended if it is seen over the chain.
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
                unseen = ~reachable
                path = [(images[i], mirrors[m]) for i, m in enumerate(new[0])]
                reachable[unseen] |= _seen(image, path, truth[unseen], normals[unseen], blockers, limit)
        chains = longer
    if bounces and curved:
        for surface in scene.surface:
            if isinstance(surface, Arc | Circle) and surface.radius >= SMALLEST_RADIUS and not reachable.all():
                unseen = ~reachable
                reachable[unseen] |= _seen_in_arc(surface, radar, truth[unseen], normals[unseen], blockers, limit)
    return direct, reachable


def _seen_in_arc(
    surface: Arc | Circle, radar: Array, points: Array, normals: Array, blockers: Array, limit: float
) -> Mask:
    """Whether points (n, 2) [m] with these normals are seen from the radar by way of either side of one arc or circle.

    A specular point is where the derivative of the path length along the arc changes its sign.
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
    found[found] &= _unobstructed(np.broadcast_to(radar, hit.shape)[found], hit[found], blockers)
    found[found] &= _unobstructed(hit[found], target[found], blockers)
    seen = np.zeros(len(points), dtype=bool)
    seen[who[found]] = True
    return seen


def seen_by_way(scene: Scene, way: Sequence[Array], truth: Array, normals: Array, *, grazing: bool = False) -> Mask:
    """Which points (n, 2) [m] with these normals the middle of the array can see by way of the given mirrors only.

    Parameters
    ----------
    scene : Scene
    way : sequence of (2, 2) arrays [m]
        Ends of the mirrors at their true places, in the order in which a ray from the radar meets them; empty for line
        of sight.
    truth, normals : (n, 2) arrays [m]
        Points and their unit normals.
    grazing : bool, default False
        Count points at any angle to the normal, for walls that are straight over many wavelengths; by default up to 80
        degrees.
    """
    images = [scene.array.middle[:2]]
    for start, end in way:
        images.append(reflect(images[-1], start, segment_normal(start, end)))
    blockers = _blockers(scene)
    path = list(zip(images, way, strict=False))
    return _seen(images[-1], path, truth, normals, blockers, scene.band.ambiguous_range, grazing)


def _blockers(scene: Scene) -> Array:
    """Straight pieces of all opaque surfaces, which block the view, (n, 2, 2) [m]."""
    opaque = [facets(some, CHORD) for some in scene.surface if getattr(some, "thickness", None) is None]
    return np.concatenate(opaque) if opaque else np.empty((0, 2, 2))


def facets(surface: Surface, spacing: float) -> Array:
    """Straight pieces of a surface, (n, 2, 2) [m]; curved surfaces in chords of at most `spacing` [m]."""
    return np.concatenate([np.stack([piece[:-1], piece[1:]], axis=1) for piece in surface.pieces(spacing)])


def _seen(
    image: Array, path: list[tuple[Array, Array]], points: Array, normals: Array, blockers: Array, limit: float,
    grazing: bool = False,
) -> Mask:  # fmt: skip
    """Whether points (n, 2) [m] are seen from the `image` of the radar in a chain of mirrors, (n,).

    `path` lists for each mirror, from the radar on, the image of the radar before reflection in it, and its ends
    (2, 2). The path is followed back from each point: to the specular point on the last mirror, and so on to the radar.
    """
    seen = np.linalg.norm(points - image, axis=1) <= limit
    target = points
    source = image
    sight = (points - image) / np.maximum(np.linalg.norm(points - image, axis=1), 1e-9)[:, None]
    if not grazing:
        seen &= np.abs(np.sum(sight * normals, axis=1)) >= SMALLEST_COSINE
    for before, (start, end) in reversed(path):
        along_ray, along_mirror = crossing(source, target, start, end)
        # The image of the radar is behind the mirror, the target in front of it.
        seen &= (along_ray > 0.0) & (along_ray < 1.0 - 1e-9) & (along_mirror >= 0.0) & (along_mirror <= 1.0)
        bounce = start + np.clip(np.nan_to_num(along_mirror), 0.0, 1.0)[:, None] * (end - start)
        side = cross2(end - start, before - start) * cross2(end - start, target - start)
        seen &= side > 0.0
        seen[seen] &= _unobstructed(bounce[seen], target[seen], blockers)
        target, source = bounce, before
    seen[seen] &= _unobstructed(np.broadcast_to(source, target.shape)[seen], target[seen], blockers)
    return np.asarray(seen)


def _unobstructed(origin: Array, target: Array, blockers: Array) -> Mask:
    """Whether the view from origins to targets (n, 2) [m] is free; surfaces on which they lie do not count, (n,)."""
    free = np.ones(len(target), dtype=bool)
    length = np.maximum(np.linalg.norm(target - origin, axis=1), 1e-9)
    slack = TOUCHING / length
    step = AT_ONCE // max(len(target), 1) + 1
    for first in range(0, len(blockers), step):
        if not free.any():
            break
        start, end = blockers[first : first + step, :, None].swapaxes(0, 1)
        along_ray, along_segment = crossing(origin, target, start, end)
        met = (along_ray > slack) & (along_ray < 1.0 - slack) & (along_segment >= 0.0) & (along_segment <= 1.0)
        free &= ~met.any(axis=0)
    return free
