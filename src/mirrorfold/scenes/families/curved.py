"""Families of scenes in which only a curved mirror shows what is hidden: a pillar, a concave bay, an S-shaped wall.

A rough screen in front of the radar hides the objects, as the first wall does in the family "two walls". The mirror is
at the side. The radius of curvature is drawn first, then the place.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.parts import WALL_ROUGHNESS, Generator, arc, circle, corner, wall
from mirrorfold.scenes.families.radars import Radar


def _hidden(random: Generator, facing_deg: float) -> list[Surface]:
    """One or two of a corner, an arc and a disc behind the screen, more than 0.5 m apart."""
    places: list[np.ndarray] = []
    while len(places) < 2:
        place = np.array([random.uniform(-0.8, -0.1), random.uniform(1.45, 2.2)])
        if all(np.linalg.norm(place - other) > 0.5 for other in places):
            places.append(place)
    facing = facing_deg + random.uniform(-25.0, 25.0)
    made = [
        corner("corner", tuple(places[0]), facing, random.uniform(0.15, 0.22)),
        arc("arc", tuple(places[0]), random.uniform(0.15, 0.3), facing, random.uniform(90.0, 150.0)),
        circle("disc", tuple(places[1]), random.uniform(0.06, 0.12)),
    ]
    which = [[0], [1], [2], [0, 2], [1, 2]][int(random.integers(5))]
    return [made[i] for i in which]


def _screen(random: Generator) -> Surface:
    return wall("screen", (random.uniform(-0.45, -0.3), random.uniform(0.95, 1.1)), random.uniform(165.0, 185.0),
                random.uniform(0.8, 1.0))  # fmt: skip


def pillar(random: Generator, radar: Radar) -> list[Surface]:
    """A round pillar as the mirror, a screen, and the hidden objects."""
    radius = random.uniform(0.10, 0.40)
    x = random.uniform(0.35, 0.55) + radius
    mirror = circle("pillar", (x, random.uniform(1.3, 1.7)), radius) | {"roughness": WALL_ROUGHNESS}
    return [_screen(random), mirror, *_hidden(random, -15.0)]


def bay(random: Generator, radar: Radar) -> list[Surface]:
    """A concave wall, bent around the scene, as the mirror; a screen, and the hidden objects."""
    radius, length = random.uniform(1.0, 3.0), random.uniform(0.8, 1.2)
    middle = np.array([random.uniform(0.6, 0.85), random.uniform(1.2, 1.6)])
    towards = np.radians(random.uniform(188.0, 205.0))  # direction that the wall faces
    center = middle + radius * np.array([np.cos(towards), np.sin(towards)])
    mirror = arc("bay", tuple(center), radius, float(np.degrees(towards)) - 180.0, float(np.degrees(length / radius)))
    return [_screen(random), mirror | {"roughness": WALL_ROUGHNESS}, *_hidden(random, -15.0)]


def s_wall(random: Generator, radar: Radar) -> list[Surface]:
    """A wall of a convex and a concave arc that join smoothly, as the mirror; a screen, and the hidden objects."""
    join = np.array([random.uniform(0.6, 0.85), random.uniform(1.25, 1.5)])
    towards = np.radians(random.uniform(190.0, 205.0))
    normal = np.array([np.cos(towards), np.sin(towards)])
    halves: list[Surface] = []
    upper_convex = bool(random.integers(2))
    for name, up in (("lower half", False), ("upper half", True)):
        radius, length = random.uniform(0.6, 1.5), random.uniform(0.45, 0.65)
        convex = up == upper_convex
        # The center is behind a convex half, and in front of a concave one; each arc runs from the joint to its end.
        center = join - normal * radius if convex else join + normal * radius
        begin = towards if convex else towards + np.pi
        span = length / radius * (-1.0 if convex == up else 1.0)
        angles = np.sort(np.degrees([begin, begin + span]))
        halves.append(
            {"name": name, "kind": "arc", "center": center.tolist(), "radius": radius, "start_angle": float(angles[0]),
             "stop_angle": float(angles[1]), "roughness": WALL_ROUGHNESS}
        )  # fmt: skip
    return [_screen(random), *halves, *_hidden(random, -15.0)]


FAMILIES = (
    Family(
        name="pillar",
        what="a screen hides one or two of a corner, an arc and a disc; a pillar of radius 10-40 cm shows them",
        engine="rays",
        make=pillar,
        curved=True,
    ),
    Family(
        name="concave bay",
        what="the same; a concave wall of radius 1-3 m, 0.8-1.2 m long, shows them",
        engine="rays",
        make=bay,
        curved=True,
    ),
    Family(
        name="s-wall",
        what="the same; a wall of a convex and a concave half, of radii 0.6-1.5 m, shows them",
        engine="rays",
        make=s_wall,
        curved=True,
    ),
)
