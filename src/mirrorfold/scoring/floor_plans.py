"""The truth of a floor plan: samples of its surfaces, and its straight faces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mirrorfold.common.geometry import segment_normal
from mirrorfold.common.types import Array
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.visibility import BOUNCES, CHORD, STRAIGHT, facets, visible_truth
from mirrorfold.scoring.mirrors import Face
from mirrorfold.scoring.truth import Truth

TRUTH_SPACING = 0.002
"""Spacing of the samples of true surfaces [m]: a tenth of the distance of a good point."""


@lru_cache(4)  # a scene is judged again and again: in a report, in a score, by several methods
def truth(scene: Scene, *, bounces: int = BOUNCES) -> Truth:
    """Samples of all surfaces, and which of them can be seen by way of at most `bounces` mirrors."""
    samples = [(np.empty((0, 2)), np.empty((0, 2))), *(s.sample(TRUTH_SPACING)[:2] for s in scene.surface)]
    owner = np.repeat(np.arange(-1, len(scene.surface)), [len(points) for points, _ in samples])
    place, normals = map(np.concatenate, zip(*samples, strict=True))
    direct, reachable = visible_truth(scene, place, normals, bounces=bounces)
    names = {index: surface.name for index, surface in enumerate(scene.surface)}
    return Truth(names, place, normals, owner, direct, reachable, size=TRUTH_SPACING, reach=0.5 * TRUTH_SPACING)


def faces(scene: Scene) -> list[Face]:
    """Straight pieces of surfaces that detected mirrors are compared with; both faces of a wall with a thickness."""
    found = []
    for surface in scene.surface:
        if surface.kind not in STRAIGHT:
            continue
        thickness = getattr(surface, "thickness", None)
        for start, end in facets(surface, CHORD):
            middle, normal, half = 0.5 * (start + end), segment_normal(start, end), 0.5 * (end - start)[None]
            for outward in (normal,) if thickness is None else (normal, -normal):
                face = middle + 0.5 * (thickness or 0.0) * outward
                found.append(Face(surface.name, face, outward, half, one_sided=thickness is not None))
    return found


def curves(scene: Scene) -> list[tuple[str, Array]]:
    """The curved surfaces that curved mirrors are compared with: the name of each, and points (n, 2) [m] along it."""
    return [
        (surface.name, piece)
        for surface in scene.surface
        if surface.kind not in STRAIGHT
        for piece in surface.pieces(TRUTH_SPACING)
    ]
