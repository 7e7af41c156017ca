"""Families of scenes in space in which only a pillar or a ball shows the objects beside the view of a raster scanner.

A round mirror spreads the beam, the more the wider the beam is at the mirror. So the beam of this scanner is focused
there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mirrorfold.common.beams import beam_angles
from mirrorfold.common.geometry import unit
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.parts import WALL_ROUGHNESS
from mirrorfold.scenes.families.radars import RADARS, Radar
from mirrorfold.scenes.families.raster import SNR_DB

Generator = np.random.Generator

SCANNER = replace(
    RADARS["scanner"],
    name="scanner, near focus",
    what="270-300 GHz, 9.5 mm beam radius at 2.1 m, steered over 28 x 24 degrees in 91 x 79 steps; 5.0 m unambiguous",
    band=RADARS["scanner"].band | {"points": 1001},
    scanner={
        "azimuth": {"start": -14.0, "stop": 14.0, "points": 91},
        "elevation": {"start": -12.0, "stop": 12.0, "points": 79},
        "spot_radius": 0.0095,
        "focus_distance": 2.1,
    },
)
"""A scanner with the aperture of the usual one, 7 cm radius, focused nearer: its beam is accordingly narrower there."""

STEEPEST = 0.3
"""Least cosine of incidence, 72 degrees, at which a mirror must show the middle of an object: near its limb it shows
nothing."""

APART = 0.45
"""Distance of the middles of two hidden objects [m]."""

CLOTH = {"material": {"permittivity": 2.6, "conductivity": 3.0}, "diffuse_fraction": 0.5}
METAL = {"material": "pec", "diffuse_fraction": 0.5}
"""Materials and scattering of hidden objects, as in the shipped scenes."""


def _shown(shape: RoundSurface, place: np.ndarray, radar: Radar) -> bool:
    """Whether a mirror shows a place (3,) [m] inside the view of the radar, and not near the mirror's limb."""
    hit, found = shape.reflection(np.zeros(3), place[None])
    if not found[0]:
        return False
    azimuth, elevation = beam_angles(hit[0])
    cosine = -float(unit(hit[0]) @ shape.outward(hit)[0])
    edges = radar.scanner["azimuth"]["stop"] - 1.0, radar.scanner["elevation"]["stop"] - 1.0
    return bool(cosine > STEEPEST and abs(azimuth) < edges[0] and abs(elevation) < edges[1])


def _hidden(random: Generator, shape: RoundSurface, radar: Radar) -> list[Surface]:
    """One or two of a box, a ball and a body beside the view, `APART` from each other, where the mirror shows them."""
    count, places = int(random.integers(1, 3)), list[np.ndarray]()
    while len(places) < count:
        place = np.array([random.choice([-1.0, 1.0]) * random.uniform(0.85, 1.3), random.uniform(1.0, 1.9), 0.0])
        place[2] = random.uniform(-0.15, 0.15)
        if _shown(shape, place, radar) and all(np.linalg.norm(place - other) > APART for other in places):
            places.append(place)
    made: list[Surface] = []
    for kind, place in zip(random.permutation(["box", "ball", "body"])[:count].tolist(), places, strict=True):
        towards = float(np.degrees(np.arctan2(-place[0], 2.0 - place[1])))
        name = {"name": f"target {kind}"}
        if kind == "box":
            size = random.uniform([0.2, 0.2, 0.25], [0.35, 0.35, 0.5]).tolist()
            heading = towards + float(random.uniform(-40.0, 40.0))
            made.append(name | METAL | {"kind": "box", "center": place.tolist(), "size": size, "heading": heading,
                                        "rounding": 0.03})  # fmt: skip
        elif kind == "ball":
            radius = float(random.uniform(0.12, 0.2))
            made.append(name | METAL | {"kind": "sphere", "center": place.tolist(), "radius": radius,
                                        "diffuse_fraction": 1.0})  # fmt: skip
        else:
            height = float(random.uniform(1.6, 1.8))
            made.append(name | CLOTH | {"kind": "mannequin", "position": [*place[:2].tolist(), -0.6 * height],
                                        "height": height, "heading": towards})  # fmt: skip
    return made


def _mirror_middle(random: Generator, radius: float) -> np.ndarray:
    """Random middle (3,) [m] of a mirror of a radius [m], so that its face is near the focus of the beam."""
    azimuth, distance = np.radians(random.uniform(-4.0, 4.0)), random.uniform(1.8, 2.3) + radius
    return np.array([distance * np.sin(azimuth), distance * np.cos(azimuth), 0.0])


def pillar(random: Generator, radar: Radar) -> list[Surface]:
    """An upright pillar, and the hidden objects that it shows."""
    radius = float(random.uniform(0.10, 0.40))
    middle = _mirror_middle(random, radius)
    ends = [[*middle[:2].tolist(), z] for z in (-1.2, 1.0)]
    mirror = {"name": "pillar", "kind": "cylinder", "start": ends[0], "end": ends[1], "radius": radius,
              "roughness": WALL_ROUGHNESS}  # fmt: skip
    return [mirror, *_hidden(random, RoundSurface(middle, np.array([0.0, 0.0, 1.0]), radius), radar)]


def ball(random: Generator, radar: Radar) -> list[Surface]:
    """A ball, and the hidden objects that it shows."""
    radius = float(random.uniform(0.15, 0.35))
    middle = _mirror_middle(random, radius)
    middle[2] = random.uniform(-0.1, 0.1)
    mirror = {"name": "ball", "kind": "sphere", "center": middle.tolist(), "radius": radius,
              "roughness": WALL_ROUGHNESS}  # fmt: skip
    return [mirror, *_hidden(random, RoundSurface(middle, np.zeros(3), radius), radar)]


FAMILIES = (
    Family(
        name="raster pillar",
        what="an upright pillar of radius 10-40 cm shows one or two of a box, a ball and a body beside the view",
        engine="raster",
        make=pillar,
        snr_db=SNR_DB,
        radar=SCANNER,
        curved=True,
    ),
    Family(
        name="raster sphere",
        what="the same; a ball of radius 15-35 cm shows them",
        engine="raster",
        make=ball,
        snr_db=SNR_DB,
        radar=SCANNER,
        curved=True,
    ),
)
