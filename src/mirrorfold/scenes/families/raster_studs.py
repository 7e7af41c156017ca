"""A family of scenes in space with a drywall board on studs: an object behind the board, and another that it reflects.

The board is a mirror and a window at once. At 300 GHz a plasterboard of 12.5 mm attenuates a wave by 30 dB one way, by
the fit of Recommendation ITU-R P.2040, and nothing behind it is seen. So the scanner works at 112 to 128 GHz, where the
attenuation is 6 dB. Half of the rooms also have a sheet of steel, which shows the same object beside the view.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.beams import beam_angles
from mirrorfold.common.geometry import reflect, unit
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.glass import GLASS_ROUGHNESS
from mirrorfold.scenes.families.radars import Radar
from mirrorfold.scenes.families.raster import MOST_DRAWS, SNR_DB, named
from mirrorfold.scenes.families.raster_round import CLOTH, METAL

Generator = np.random.Generator

SCANNER = Radar(
    name="scanner, 120 GHz",
    what="112-128 GHz, 17 mm beam radius at 2.4 m, steered over 40 x 20 degrees in 107 x 55 steps; 6.6 m unambiguous",
    band={"start": 112e9, "stop": 128e9, "points": 701},
    scanner={
        "azimuth": {"start": -20.0, "stop": 20.0, "points": 107},
        "elevation": {"start": -10.0, "stop": 10.0, "points": 55},
        "spot_radius": 0.017,
        "focus_distance": 2.4,
    },
)
"""A scanner with an aperture of 11 cm radius; with that of the usual scanner, 7 cm, the beam radius would be 27 mm."""

THICKNESSES = 9.5e-3, 12.5e-3, 15e-3
"""Thicknesses of boards as sold [m]."""

STUD = 0.05, 0.075
"""Width and depth of a stud [m]."""

HEIGHT = 2.4
"""Height of walls, from floor to ceiling [m]."""

CENTRES = 0.4, 0.625
"""Distances between the middles of studs [m]: three or two studs to a board of 1.25 m."""

BESIDE_DEG = 12.0
"""Least angle [degree] by which the middle of the object in front of the board is outside the view: half a body at
1.5 m."""

WOOD = {"material": "wood", "diffuse_fraction": 0.5}
"""Material and scattering of wooden studs."""


def _direction(degrees: float) -> Array:
    """Unit vector in the floor plan at an angle from +y towards +x [degree]."""
    return np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees)), 0.0])


def _object(random: Generator, name: str, place: Array, towards: Array) -> Surface:
    """A box, a ball or a body at a place (3,) [m], which faces about the point `towards` (3,) [m]."""
    way = towards - place
    heading = float(np.degrees(np.arctan2(way[0], way[1]))) + float(random.uniform(-25.0, 25.0))
    kind = str(random.choice(["box", "ball", "body"]))
    if kind == "ball":
        return METAL | {"name": name, "kind": "sphere", "center": place.tolist(), "diffuse_fraction": 1.0,
                        "radius": float(random.uniform(0.12, 0.2))}  # fmt: skip
    if kind == "box":
        size = random.uniform([0.2, 0.2, 0.25], [0.35, 0.35, 0.5]).tolist()
        return METAL | {"name": name, "kind": "box", "center": place.tolist(), "size": size, "heading": heading,
                        "rounding": 0.03}  # fmt: skip
    height = float(random.uniform(1.6, 1.8))
    return CLOTH | {"name": name, "kind": "mannequin", "position": [*place[:2].tolist(), -0.65 * height],
                    "height": height, "heading": heading}  # fmt: skip


def studs(random: Generator, radar: Radar) -> list[Surface]:
    """A board on studs at 25 to 50 degrees, an object behind it, another beside the view, and perhaps a steel sheet."""
    steel = bool(random.random() < 0.5)
    edge = radar.scanner["azimuth"]["stop"] + BESIDE_DEG
    for _ in range(MOST_DRAWS):
        surfaces = _room(random, steel)
        place = named(surfaces, "target")
        if abs(beam_angles(np.array(place.get("center") or place["position"]))[0]) > edge:
            return surfaces
    raise InputError(f"studs: in none of {MOST_DRAWS} draws an object stands beside the view of radar {radar.name!r}")


def _room(random: Generator, steel: bool) -> list[Surface]:
    """A random room of this family; its objects may still be inside the view."""
    side = float(random.choice([-1.0, 1.0]))
    incidence, distance = float(random.uniform(25.0, 50.0)), float(random.uniform(1.7, 2.0))
    # The steel sheet occupies the outer third of the view, on the side to which the board reflects.
    middle = distance * _direction(side * (-6.0 if steel else 0.0))
    normal = _direction(180.0 - side * (incidence + 6.0 * steel))
    along, width = np.array([normal[1], -normal[0], 0.0]), float(random.uniform(1.0, 1.3))
    width = min(width, 0.9) if steel else width
    thickness = float(random.choice(THICKNESSES))
    board = {"name": "board", "kind": "panel", "center": middle.tolist(), "normal": normal.tolist(), "width": width,
             "height": HEIGHT, "material": "plasterboard", "thickness": thickness,
             "roughness": GLASS_ROUGHNESS}  # fmt: skip
    found = [board]
    heading = float(np.degrees(np.arctan2(normal[0], normal[1])))
    finish, centres = (METAL if random.random() < 0.5 else WOOD), float(random.choice(CENTRES))
    first = float(random.uniform(0.0, centres))
    count = int(np.floor((0.5 * width + first) / centres)) + int(np.floor((0.5 * width - first) / centres)) + 1
    start = first - centres * np.floor((0.5 * width + first) / centres)
    for number in range(count):
        deep = middle - (0.5 * thickness + 0.5 * STUD[1]) * normal + (start + number * centres) * along
        found.append(finish | {"name": f"stud {number + 1}", "kind": "box", "center": deep.tolist(),
                               "size": [STUD[0], STUD[1], HEIGHT], "heading": heading})  # fmt: skip
    # The object behind the board, and the mirror image of the one in front of it, are in different parts of the view.
    parts = random.permutation([-1.0, 1.0]) * random.uniform(0.17, 0.25)
    hits = [middle + part * width * along + np.array([0.0, 0.0, random.uniform(-0.1, 0.1)]) for part in parts]
    behind = hits[0] + float(random.uniform(0.35, 0.7)) * unit(hits[0])
    image = hits[1] + float(random.uniform(0.8, 1.2) + 0.3 * steel) * unit(hits[1])
    before = reflect(image, middle, normal)
    found += [_object(random, "behind", behind, np.zeros(3)), _object(random, "target", before, hits[1])]
    if steel:
        at = float(random.uniform(2.1, 2.3)) * _direction(side * 14.5)
        facing = unit(unit(-at) + unit(before - at) * [1.0, 1.0, 0.0])
        found.append({"name": "steel", "kind": "panel", "center": at.tolist(), "normal": facing.tolist(),
                      "width": 0.55, "height": HEIGHT, "material": "pec", "roughness": GLASS_ROUGHNESS})  # fmt: skip
    return found


FAMILIES = (
    Family(
        name="raster studs",
        what="a board of 9.5-15 mm on studs at 25-50 degrees: an object stands behind it, it reflects another",
        engine="raster",
        make=studs,
        bounces=1,
        snr_db=SNR_DB,
        radar=SCANNER,
        polarization="both",
    ),
)
