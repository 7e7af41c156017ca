"""The truth of a floor plan: samples of its surfaces, and its straight faces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mirrorfold.common.geometry import segment_normal
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.visibility import BOUNCES, CHORD, STRAIGHT, facets, visible_truth
from mirrorfold.scoring.mirrors import Face
from mirrorfold.scoring.truth import Truth

TRUTH_SPACING = 0.002
"""True surfaces are sampled this densely [m], a tenth of the distance of a good point."""


@lru_cache(4)  # a scene is judged again and again: in a report, in a score, by several methods
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
        for start, end in facets(surface, CHORD)
    ]
