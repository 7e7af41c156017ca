"""What the middle of an array can see of the surfaces of a floor plan, directly and by way of mirrors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import cross2, crossing, reflect, segment_normal
from mirrorfold.common.types import Array, Mask
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Surface

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

PROBES = np.linspace(0.01, 0.99, 25)
"""Places along a mirror, as shares of its length, one of which must be seen for the mirror to show anything."""

TOUCHING = 1e-4
"""Within this distance of its ends [m] a ray may touch the surfaces that it comes from and goes to."""


def visible_truth(scene: Scene, truth: Array, normals: Array, *, bounces: int = BOUNCES) -> tuple[Mask, Mask]:
    """Which points (n, 2) [m] with these normals the middle of the array can see: directly; by way of mirrors, too.

    Lines of sight are those of geometrical optics: by the radar's images in chains of straight pieces, with every
    reflection on the piece itself and nothing in the way; no further than the ambiguous range.
    """
    pieces = [facets(surface, CHORD) for surface in scene.surface]
    blockers = np.concatenate(pieces) if pieces else np.empty((0, 2, 2))
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
    return direct, reachable


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
    pieces = [facets(surface, CHORD) for surface in scene.surface]
    blockers = np.concatenate(pieces) if pieces else np.empty((0, 2, 2))
    path = list(zip(images, way, strict=False))
    return _seen(images[-1], path, truth, normals, blockers, farthest_range(scene.band), grazing)


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
