"""Random scenes of a family, drawn until what shall be hidden is hidden, and mirrors show it.

Families of full waves are sized to a radar, and check that themselves, in lengths of their own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mirrorfold.errors import InputError
from mirrorfold.scenes.families.family import Family
from mirrorfold.scenes.families.radars import Radar
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.visibility import visible_truth

DRAWS = 2000
"""After so many draws in vain a family's ranges count as impossible; the strictest of ours needs some tens."""

HIDDEN = ("corner", "arc", "disc", "target")
"""First words of the names of surfaces that the radar must not see directly."""

SPACING = 0.005
"""Surfaces are sampled this densely [m], a third of today's resolution cell."""

APART = 0.12
"""Hidden surfaces keep this distance from all others [m], eight cells of the usual radar."""

FLAT_BOUNCES = 2
"""Flat mirrors in a row that must not show what only a curved one shall show; more are too weak."""

SHOWN, SHOWN_OF_CIRCLE = 0.5, 0.2
"""Share of a hidden surface that mirrors must show; less of a circle, more than half of which is always turned away."""


def scene_of(family: Family, seed: int, radar: Radar) -> Any:
    """A scene of a family, the same for the same seed.

    Raises
    ------
    InputError
        If none of many draws is valid, or if what the family makes is no scene.
    """
    places: dict[str, Any] = {"array": radar.array} if radar.array else {"dimensions": 3, "scanner": radar.scanner}
    if family.polarization != "TE":
        places["polarization"] = family.polarization
    random = np.random.default_rng([sum(map(ord, family.make.__name__)), seed])
    for _ in range(DRAWS):
        content = {"name": f"{family.name} {seed}", **places, "band": radar.band, "surface": family.make(random, radar)}
        scene = parse_scene(content, source=f"family {family.name!r}, seed {seed}")
        if not isinstance(scene, Scene) or family.engine == "fullwave" or good(scene, family.bounces, family.curved):
            return scene
    raise InputError(
        f"family {family.name!r}, seed {seed}: none of {DRAWS} draws hides its objects from the radar and shows them "
        "by mirrors; give it other ranges"
    )


def good(scene: Scene, bounces: int, curved: bool = False) -> bool:
    """Whether every hidden surface is out of sight, touches no other, and a good part of it is shown by mirrors.

    Where they shall be `curved`, no flat one may show any of it.
    """
    parts = [surface.sample(SPACING)[:2] for surface in scene.surface]
    hidden = [i for i, surface in enumerate(scene.surface) if surface.name.split()[0] in HIDDEN]
    for i in hidden:
        for j, (other, _) in enumerate(parts):
            if i != j and np.linalg.norm(parts[i][0][:, None] - other[None], axis=-1).min() < APART:
                return False
    for i in hidden:
        direct, reachable = visible_truth(scene, *parts[i], bounces=bounces)
        if curved and visible_truth(scene, *parts[i], bounces=FLAT_BOUNCES, curved=False)[1].any():
            return False
        if direct.any() or reachable.mean() < (SHOWN_OF_CIRCLE if scene.surface[i].kind == "circle" else SHOWN):
            return False
    return True
