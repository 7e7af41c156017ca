"""The truth of a floor plan: what the middle of the array can see of its surfaces, directly and by way of mirrors."""

from __future__ import annotations

from itertools import chain

import numpy as np

from mirrorfold.common.geometry import cross2, crossing, reflect, segment_normal
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Surface
from mirrorfold.scoring.mirrors import Face
from mirrorfold.scoring.truth import BOUNCES, SMALLEST_COSINE, Array, Mask, Truth, farthest_range

TRUTH_SPACING = 0.002
"""True surfaces are sampled this densely [m], a tenth of the distance of a good point."""

CHORD = 0.01
"""Curved surfaces block the view as chords of this length [m]; those of a metre's radius are 12 um off."""

SHORTEST_MIRROR = 0.15
"""Straight pieces of the truth shorter than this [m] are not counted on to show anything by reflection."""

STRAIGHT = ("segment", "polyline")
"""Kinds of surfaces that mirrors are looked for in."""

PROBES = np.linspace(0.01, 0.99, 25)
"""Places along a mirror, as shares of its length, one of which must be seen for the mirror to show anything."""

TOUCHING = 1e-4
"""Within this distance of its ends [m] a ray may touch the surfaces that it comes from and goes to."""


def truth(scene: Scene, *, bounces: int = BOUNCES) -> Truth:
    """Samples of all surfaces, and which of them can be seen by way of at most so many mirrors."""
    samples = [(np.empty((0, 2)), np.empty((0, 2))), *(s.sample(TRUTH_SPACING)[:2] for s in scene.surface)]
    owner = np.repeat(np.arange(-1, len(scene.surface)), [len(points) for points, _ in samples])
    place, normals = map(np.concatenate, zip(*samples, strict=True))
    direct, reachable = visible_truth(scene, place, normals, bounces=bounces)
    names = {index: surface.name for index, surface in enumerate(scene.surface)}
    return Truth(names, place, normals, owner, direct, reachable, size=TRUTH_SPACING, reach=0.5 * TRUTH_SPACING)


def faces(scene: Scene) -> list[Face]:
    """The straight pieces that a detected mirror may be an image of."""
    return [
        Face(surface.name, 0.5 * (start + end), segment_normal(start, end), 0.5 * (end - start)[None])
        for surface in scene.surface
        if surface.kind in STRAIGHT
        for start, end in _facets(surface)
    ]


def visible_truth(scene: Scene, truth: Array, normals: Array, *, bounces: int = BOUNCES) -> tuple[Mask, Mask]:
    """Which points (n, 2) [m] with these normals the middle of the array can see: directly; by way of mirrors, too.

    Lines of sight are those of geometrical optics: by the radar's images in chains of straight pieces, with every
    reflection on the piece itself and nothing in the way; no further than the ambiguous range.
    """
    blockers = np.concatenate([np.empty((0, 2, 2)), *(_facets(surface) for surface in scene.surface)])
    straight = chain(*(_facets(surface) for surface in scene.surface if surface.kind in STRAIGHT))
    mirrors = [mirror for mirror in straight if np.linalg.norm(mirror[1] - mirror[0]) >= SHORTEST_MIRROR]
    radar = 0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))[:2]
    limit = farthest_range(scene.band)
    direct = _seen(radar, [], truth, normals, blockers, limit)
    reachable = direct.copy()
    # Chains of mirrors, each with the image of the radar before it: they grow while their last mirror can be seen.
    chains: list[tuple[list[tuple[Array, Array]], Array]] = [([], radar)]
    for _ in range(bounces):
        longer = []
        for path, image in chains:
            for mirror in mirrors:
                if path and path[-1][1] is mirror:
                    continue
                start, end = mirror
                probe = start + PROBES[:, None] * (end - start)
                if not _seen(image, path, probe, None, blockers, limit).any():
                    continue
                new = [*path, (image, mirror)], reflect(image, start, segment_normal(start, end))
                longer.append(new)
                open_ = ~reachable
                reachable[open_] |= _seen(new[1], new[0], truth[open_], normals[open_], blockers, limit)
        chains = longer
    return direct, reachable


def _facets(surface: Surface) -> Array:
    """Straight pieces of a surface, (n, 2, 2) [m]."""
    return np.concatenate([np.stack([piece[:-1], piece[1:]], axis=1) for piece in surface.pieces(CHORD)])


def _seen(
    image: Array, path: list[tuple[Array, Array]], points: Array, normals: Array | None, blockers: Array, limit: float
) -> Mask:
    """Whether points are seen from the radar's `image` in a chain of mirrors, with normals at no grazing angle.

    `path` lists, from the radar on, the image before each mirror and the mirror (2, 2). The way back is walked from
    the point: to its reflection in the last mirror, and so on to the radar.
    """
    sight = points - image
    distance = np.linalg.norm(sight, axis=1)
    seen = distance <= limit
    if normals is not None:
        seen &= np.abs(np.sum(sight * normals, axis=1)) >= SMALLEST_COSINE * distance
    target, source = points, image
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
