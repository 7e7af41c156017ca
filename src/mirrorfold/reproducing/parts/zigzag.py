"""Random zig-zag corridors: walls that show a target by way of a certain number of bounces, and of no fewer."""

from __future__ import annotations

from typing import Any

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.reproducing.parts.scenes import plan_scene
from mirrorfold.scenes.families.parts import OBJECT_ROUGHNESS, Generator, arc, wall
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import surface_named
from mirrorfold.scenes.visibility import visible_truth

ELEMENTS, PITCH, EVERY = 161, 0.5e-3, 3
"""The published array: number of places and their distance [m]. Every third place receives; the grating lobes of these
receivers do no harm, because the transmitters' beam has none."""

START, STOP, POINTS = 290e9, 300e9, 461
"""The published band [Hz], with frequencies for an unambiguous range of 6.9 m, beyond the longest path."""

FIRST, LEG, TURN = (1.1, 1.3), (0.65, 0.85), (80.0, 100.0)
"""Least and largest distance from the radar to the first wall and from wall to wall [m], and angle by which each wall
turns the path [degree]."""

ENTRANCE, LENGTH = (0.45, 0.55), (0.55, 0.7)
"""Least and largest length of the first wall, and of the other walls [m]."""

TARGET, SPAN = (0.12, 0.18), 130.0
"""Least and largest radius of the target, an arc [m], and the angle that the arc spans [degree]."""

SHOWN, APART, DRAWS = 0.3, 0.1, 3000
"""Least share of the target that the walls must show; least distance between surfaces [m]; most draws to find such a
corridor."""


def corridor(bounces: int, seed: int, material: str) -> Scene:
    """A scene in which the target can be seen by way of `bounces` walls of a material, and of no fewer."""
    random = np.random.default_rng([bounces, seed])
    for _ in range(DRAWS):
        scene = plan_scene(
            {
                "name": f"{bounces} bounces, {material}, {seed}",
                "array": array(),
                "band": {"start": START, "stop": STOP, "points": POINTS},
                "surface": _surfaces(random, bounces, material),
            }
        )
        if _suitable(scene, bounces):
            return scene
    raise ValueError(f"no corridor of {bounces} bounces with seed {seed} in {DRAWS} draws")


def alone(scene: Scene, distance: float) -> Scene:
    """The target of a scene by itself in line of sight, turned towards the radar."""
    target = surface_named(scene, "target")
    assert target.kind == "arc"
    content = arc("target", (0.0, distance + target.radius), target.radius, -90.0, SPAN)
    band = {"start": START, "stop": STOP, "points": POINTS}
    return plan_scene({"name": "target alone", "array": array(), "band": band, "surface": [content]})


def way(scene: Scene, bounces: int) -> float:
    """Length of the path from the radar to the target by way of the middles of the walls [m]."""
    places = [np.zeros(2)]
    for name in (*(f"wall {number + 1}" for number in range(bounces)), "target"):
        places.append(surface_named(scene, name).sample(0.01)[0].mean(axis=0))
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def array() -> dict[str, Any]:
    """The array as in a scene file."""
    rx = {"elements": (ELEMENTS - 1) // EVERY + 1, "pitch": EVERY * PITCH}
    return {"elements": ELEMENTS, "pitch": PITCH, "rx": rx}


def _surfaces(random: Generator, bounces: int, material: str) -> list[dict[str, Any]]:
    """Walls that turn the path alternately to the right and to the left, the target at its end, and a screen."""
    heading, place = 90.0 + random.uniform(-2.0, 2.0), np.zeros(2)
    surfaces = []
    for number in range(bounces):
        place = place + random.uniform(*(LEG if number else FIRST)) * _direction(heading)
        turn = random.uniform(*TURN) * (-1.0 if number % 2 == 0 else 1.0)
        length = random.uniform(*(LENGTH if number else ENTRANCE))
        # A mirror along the mean of both headings reflects a wave from the one heading to the other.
        middle = float(place[0]), float(place[1])
        surfaces.append(wall(f"wall {number + 1}", middle, heading + 0.5 * turn, length, material=material))
        heading += turn
    place = place + random.uniform(*LEG) * _direction(heading)
    radius = random.uniform(*TARGET)
    center = place + radius * _direction(heading)
    surfaces.append(arc("target", (float(center[0]), float(center[1])), radius, heading + 180.0, SPAN))
    # A screen hides all walls but the first. It begins beside this wall, and its glint does not return to the radar.
    near, far = (
        0.42 * _direction(90.0 - random.uniform(16.0, 18.0)),
        0.72 * _direction(90.0 - random.uniform(58.0, 62.0)),
    )
    screen = {"name": "screen", "kind": "segment", "start": near.tolist(), "end": far.tolist(), "material": material}
    return [*surfaces, {**screen, "roughness": OBJECT_ROUGHNESS}]


def _direction(degrees: float) -> Array:
    return np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])


def _suitable(scene: Scene, bounces: int) -> bool:
    """Whether surfaces keep `APART`, and this number of bounces shows `SHOWN` of the target, and fewer show nothing."""
    parts = [surface.sample(0.02)[0] for surface in scene.surface]
    for i, one in enumerate(parts):
        if any(np.linalg.norm(one[:, None] - other, axis=-1).min() < APART for other in parts[i + 1 :]):
            return False
    points, normals, _ = surface_named(scene, "target").sample(0.01)
    if visible_truth(scene, points, normals, bounces=bounces - 1)[1].any():
        return False
    return bool(visible_truth(scene, points, normals, bounces=bounces)[1].mean() >= SHOWN)
