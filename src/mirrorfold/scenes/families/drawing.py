"""Random scenes of a family, drawn until its hidden surfaces are hidden from the radar and mirrors show them.

Full-wave families are scaled to the wavelength of a radar, and make these checks themselves, with lengths of their own.
Scenes in space are not checked here.
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
"""Largest number of draws for one scene, after which the ranges of a family count as impossible; the strictest family
here needs some tens."""

HIDDEN = ("corner", "arc", "disc", "target")
"""First words of the names of surfaces that the radar must not see directly."""

SPACING = 0.005
"""Spacing of the points that sample the surfaces [m]: a third of the range resolution of the 300 GHz radar."""

APART = 0.12
"""Least distance of hidden surfaces from all others [m]: eight resolution cells of the 300 GHz radar."""

FLAT_BOUNCES = 2
"""Length of the chains of flat mirrors that must not show what only a curved mirror shall show; longer chains are too
weak to matter."""

SHOWN, SHOWN_OF_CIRCLE = 0.5, 0.2
"""Least share of a hidden surface that mirrors must show; for a circle less, as more than half of it always faces
away."""


def scene_of(family: Family, seed: int, radar: Radar) -> Any:
    """A scene of a family, the same for the same seed.

    Raises
    ------
    InputError
        If none of `DRAWS` draws is valid, or the family makes surfaces that are wrong.
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
    reach = scene.band.ambiguous_range
    raise InputError(
        f"family {family.name!r}, seed {seed}: none of {DRAWS} draws hides its objects from radar {radar.name!r} and "
        f"shows them by mirrors within its {reach:.3g} m; give it other ranges, or a radar that sees farther"
    )


def good(scene: Scene, bounces: int, curved: bool = False) -> bool:
    """Whether each hidden surface is out of sight, apart from all others, and a large part of it is shown by mirrors.

    With `curved`, flat mirrors must not show any part of it.
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
