"""Random scenes of a family, drawn until its hidden surfaces are hidden from the radar and mirrors show them.

Full-wave families are scaled to the wavelength of a radar, and make these checks themselves, with lengths of their own.
Scenes in space are not checked here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mirrorfold.errors import InputError
from mirrorfold.scenes.families.family import Family
from mirrorfold.scenes.families.radars import Radar
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.surfaces import Surface
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
        If none of `DRAWS` draws is valid, the radar sees too little, or the family makes surfaces that are wrong.
    """
    far_enough = False
    for scene in _draws(family, seed, radar):
        if not isinstance(scene, Scene) or family.engine == "fullwave":
            return scene
        if not in_reach(scene):
            continue
        if good(scene, family.bounces, family.curved):
            return scene
        far_enough = True
    if not far_enough:
        raise sees_too_little(family, radar)
    raise InputError(
        f"family {family.name!r}, seed {seed}: none of {DRAWS} draws hides its objects from radar {radar.name!r} and "
        f"shows them by mirrors within its {scene.band.ambiguous_range:.3g} m; give it other ranges, or a radar that "
        "sees farther"
    )


def reaches(family: Family, seed: int, radar: Radar) -> bool:
    """Whether the hidden surfaces of some draw of a scene are nearer than the radar's ambiguous range."""
    scenes = _draws(family, seed, radar)
    return any(not isinstance(one, Scene) or family.engine == "fullwave" or in_reach(one) for one in scenes)


def sees_too_little(family: Family, radar: Radar) -> InputError:
    """The error for a radar whose ambiguous range is too small for a family."""
    return InputError(
        f"radar {radar.name!r} cannot see family {family.name!r}: in each of {DRAWS} draws, hidden surfaces are "
        "farther away than its ambiguous range; give its band more points, or choose a radar that sees farther"
    )


def _draws(family: Family, seed: int, radar: Radar) -> Iterator[Any]:
    """The draws of a scene, one after another, valid or not; InputError if the family makes surfaces that are wrong."""
    places: dict[str, Any] = {"array": radar.array} if radar.array else {"dimensions": 3, "scanner": radar.scanner}
    if family.polarization != "TE":
        places["polarization"] = family.polarization
    # Objects that are called as functions have no name of their own.
    name = getattr(family.make, "__name__", family.name)
    random = np.random.default_rng([sum(map(ord, name)), seed])
    for _ in range(DRAWS):
        content = {"name": f"{family.name} {seed}", **places, "band": radar.band, "surface": family.make(random, radar)}
        yield parse_scene(content, source=f"family {family.name!r}, seed {seed}")


def in_reach(scene: Scene) -> bool:
    """Whether a large enough part of each hidden surface is nearer to the radar than its ambiguous range."""
    radar, limit = scene.array.middle[:2], scene.band.ambiguous_range
    hidden = [surface for surface in scene.surface if is_hidden(surface)]
    return all(
        np.mean(np.linalg.norm(surface.sample(SPACING)[0] - radar, axis=-1) <= limit) >= least_shown(surface)
        for surface in hidden
    )


def is_hidden(surface: Surface) -> bool:
    """Whether a surface is one that the radar must not see directly, by the first word of its name."""
    return next(iter(surface.name.split()), "") in HIDDEN


def least_shown(surface: Surface) -> float:
    """The share of a hidden surface that mirrors must show."""
    return SHOWN_OF_CIRCLE if surface.kind == "circle" else SHOWN


def good(scene: Scene, bounces: int, curved: bool = False) -> bool:
    """Whether each hidden surface is out of sight, apart from all others, and a large part of it is shown by mirrors.

    With `curved`, flat mirrors must not show any part of it.
    """
    parts = [surface.sample(SPACING)[:2] for surface in scene.surface]
    hidden = [i for i, surface in enumerate(scene.surface) if is_hidden(surface)]
    for i in hidden:
        for j, (other, _) in enumerate(parts):
            if i != j and np.linalg.norm(parts[i][0][:, None] - other[None], axis=-1).min() < APART:
                return False
    for i in hidden:
        direct, reachable = visible_truth(scene, *parts[i], bounces=bounces)
        if curved and visible_truth(scene, *parts[i], bounces=FLAT_BOUNCES, curved=False)[1].any():
            return False
        if direct.any() or reachable.mean() < least_shown(scene.surface[i]):
            return False
    return True
