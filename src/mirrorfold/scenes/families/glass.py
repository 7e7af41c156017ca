"""A family of scenes with a half-transparent wall: objects in front of it, which it reflects, and objects behind it.

Screens hide the objects in front of the wall from the radar, so that they are seen by reflection only. In the image,
both kinds appear behind the wall. The middle of the wall and the angle of incidence are drawn first, then all else.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.geometry import reflect
from mirrorfold.common.types import Array
from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.parts import Generator, Span, arc, circle, corner, wall
from mirrorfold.scenes.families.radars import Radar

GLASS_ROUGHNESS = {"rms_height": 0.08e-3, "correlation_length": 0.4e-3}
"""Roughness of a wall [m] whose face is visible, but which remains a mirror and a window: structured glass, a painted
board."""

APART = 0.3
"""Least distance of objects from each other in the image, and so also between the true places on either side."""

ATTEMPTS = 60
"""Largest number of draws for the places of all objects of one wall."""


def _direction(degrees: float) -> Array:
    """Unit vector at an angle from +y towards +x [degree]."""
    return np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])


def _object(random: Generator, name: str, place: Array, facing_deg: float) -> Surface:
    """A corner, an arc or a disc at a place, which faces about the given direction."""
    kind, facing = int(random.integers(3)), facing_deg + random.uniform(-20.0, 20.0)
    at = float(place[0]), float(place[1])
    return [
        corner(name, at, facing, random.uniform(0.12, 0.18)),
        arc(name, at, random.uniform(0.12, 0.22), facing, random.uniform(90.0, 140.0)),
        circle(name, at, random.uniform(0.06, 0.12)),
    ][kind]


def glass_door(random: Generator, radar: Radar) -> list[Surface]:
    """A pane or board, one or two hidden objects in front of it, and one or two objects behind it."""
    return half_transparent(random, distance=(1.1, 1.5), length=(0.9, 1.3), depth=(0.35, 0.9), most=2)


def half_transparent(random: Generator, *, distance: Span, length: Span, depth: Span, most: int) -> list[Surface]:
    """A half-transparent wall, hidden objects in front of it and other objects behind it.

    Parameters
    ----------
    random : numpy.random.Generator
    distance, length : pair of floats
        Ranges from which the distance of the wall's middle from the radar, and the length of the wall, are drawn.
    depth : pair of floats
        Range from which the distances between the wall and the objects, along the ray, are drawn.
    most : int
        Largest number of objects on either side; there is at least one.

    Returns
    -------
    list of dict
        Surfaces, in the unit of the given lengths; the thickness of the wall is always in metres.
    """
    middle = random.uniform(*distance) * _direction(random.uniform(8.0, 28.0))
    sight = middle / np.linalg.norm(middle)
    incidence, long = np.radians(random.uniform(22.0, 66.0)), random.uniform(*length)
    turn = np.array([[np.cos(incidence), -np.sin(incidence)], [np.sin(incidence), np.cos(incidence)]])
    normal = min((turn @ -sight, turn.T @ -sight), key=lambda n: (sight - 2.0 * (sight @ n) * n)[0])
    along = np.array([-normal[1], normal[0]])
    made_of = {"material": "glass"} if random.random() < 0.5 else {
        "material": {"permittivity": random.uniform(2.5, 6.5), "conductivity": random.uniform(0.0, 0.5)}
    }  # fmt: skip
    door = wall("glass door", (float(middle[0]), float(middle[1])), float(np.degrees(np.arctan2(along[1], along[0]))),
                long, thickness=random.uniform(4e-3, 10e-3), **made_of) | {"roughness": GLASS_ROUGHNESS}  # fmt: skip
    reflected, through = (int(random.integers(1, most + 1)) for _ in range(2))
    places: list[Array] = []
    for _ in range(ATTEMPTS):
        if len(places) == reflected + through:
            break
        hit = middle + random.uniform(-0.32, 0.32) * long * along
        place = hit + random.uniform(*depth) * hit / np.linalg.norm(hit)
        if all(np.linalg.norm(place - other) > APART for other in places):
            places.append(place)
    surfaces = [door]
    for number, image in enumerate(places):
        behind = number >= reflected
        place = image if behind else reflect(image, middle, normal)
        # An object faces the radar, or the image of the radar in the wall.
        towards = -image if behind else 2.0 * (image @ normal) * normal - image
        facing = float(np.degrees(np.arctan2(towards[1], towards[0])))
        name = f"behind {number + 1 - reflected}" if behind else f"target {number + 1}"
        surfaces.append(_object(random, name, place, facing))
        if not behind:
            screen = random.uniform(0.45, 0.6) * place
            bearing = float(np.degrees(np.arctan2(-place[0], place[1])))
            middle_of = float(screen[0]), float(screen[1])
            surfaces.append(wall(f"screen {number + 1}", middle_of, bearing, random.uniform(0.35, 0.5)))
    return surfaces


FAMILIES = (
    Family(
        name="glass door",
        what="a pane of 4-10 mm at 22-66 degrees shows one or two hidden objects, and one or two stand behind it",
        engine="rays",
        make=glass_door,
        snr_db=20.0,
        radar="122 GHz",
        polarization="both",
        options={"bounces": 2},
    ),
)
