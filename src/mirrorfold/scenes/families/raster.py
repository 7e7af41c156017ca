"""Families of scenes in space before a raster scanner: a body beside the view, shown by boards that scatter inside.

A method that is fitted to one depth profile of the scattering inside a wall misplaces the fronts of walls with other
profiles, and everything that it sees by way of them. So all profiles of `mirrorfold.scenes.materials.VolumeProfile` are
drawn, with depths of 3 to 30 mm, and walls that do not scatter inside.
"""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from typing import Any

import numpy as np

from mirrorfold.common.beams import beam_angles
from mirrorfold.common.geometry import reflect
from mirrorfold.errors import InputError
from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.radars import RADARS, Radar

Generator = np.random.Generator
Draw = Callable[[Generator], list[Surface]]
Make = Callable[[Generator, Radar], list[Surface]]

PROFILES: dict[str, tuple[str | None, float, float]] = {
    "face": (None, 0.0, 0.0),
    "shallow": ("exponential", 0.003, 0.010),
    "deep": ("exponential", 0.015, 0.030),
    "uniform": ("uniform", 0.006, 0.025),
    "layers": ("layers", 0.008, 0.020),
}
"""Kinds of scattering inside a wall: profile, least and largest depth [m]. A wall of kind "face" has none inside."""

TRUNK, ARM = 0.17, 0.38
"""Bound on a mannequin's horizontal reach: no part is farther from its axis than ``height (TRUNK + ARM sin(a))``, with
arms lifted by the angle a."""

MOST_DRAWS = 1000
"""Largest number of draws for one scene."""

SNR_DB = 20.0
"""Signal-to-noise ratio per sample [dB]: the body is then some 30 dB above the noise of the volume."""


def inside(random: Generator, kind: str | None = None) -> dict[str, Any]:
    """The entries of a wall that scatters inside in one of the ways of `PROFILES`, by default a random one."""
    profile, least, largest = PROFILES[kind or str(random.choice(list(PROFILES)))]
    depth = float(random.uniform(least, largest))
    return {"volume_depth": depth, "volume_profile": profile} if profile else {"volume_depth": 0.0}


def shipped(name: str) -> list[Surface]:
    """The surfaces of one of the shipped scene files."""
    content = files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml").read_text(encoding="utf-8")
    surfaces: list[Surface] = tomllib.loads(content)["surface"]
    return surfaces


def named(surfaces: list[Surface], name: str) -> Surface:
    """The surface of that name."""
    return next(surface for surface in surfaces if surface["name"] == name)


def drywall(random: Generator, lean_deg: float = 0.0) -> list[Surface]:
    """A wall at 30 to 60 degrees and 1.9 to 2.4 m, and a body in a random pose, whose mirror image is in the view."""
    surfaces = shipped("drywall-mannequin")
    angle, distance = np.radians(random.uniform(30.0, 60.0)), random.uniform(1.9, 2.4)
    side = random.choice([-1.0, 1.0])
    flat = np.array([side * np.sin(angle), -np.cos(angle), 0.0])
    lean = np.radians(lean_deg)
    normal = np.cos(lean) * flat + np.array([0.0, 0.0, np.sin(lean)])
    wall, body = named(surfaces, "drywall"), named(surfaces, "mannequin")
    wall |= {"center": [0.0, distance, 0.0], "normal": normal.tolist(), "width": 3.0}
    wall["volume_depth"] = float(random.choice([0.0, random.uniform(0.005, 0.03)], p=[0.2, 0.8]))
    # The ghost is in the middle of the field of view; the body, upright, is at the mirror image of it in the wall.
    seen = distance + random.uniform(1.25, 1.6)
    azimuth = np.radians(random.uniform(-3.0, 3.0))
    ghost = np.array([seen * np.sin(azimuth), seen * np.cos(azimuth), 0.0])
    place = reflect(ghost, wall["center"], flat)
    chest = reflect(ghost, wall["center"], normal)
    place[2] = chest[2] + random.uniform(-0.93, -0.87)
    towards = reflect(np.zeros(3), wall["center"], flat) - place
    heading = np.degrees(np.arctan2(towards[0], towards[1])) + random.uniform(-20.0, 20.0)
    body |= {
        "position": place.tolist(),
        "heading": float(heading),
        "height": float(random.uniform(1.6, 1.8)),
        "arms": random.uniform(8.0, 30.0, 2).tolist(),
        "elbows": random.uniform(5.0, 60.0, 2).tolist(),
        "stride": float(random.uniform(-12.0, 12.0)),
    }
    named(surfaces, "foil")["center"] = [0.0, 0.0, 0.7 * body["height"]]
    return surfaces


def leaning_drywall(random: Generator) -> list[Surface]:
    """As `drywall`, with a wall that leans by 5 degrees."""
    return drywall(random, lean_deg=5.0 * random.choice([-1.0, 1.0]))


def corridor(random: Generator) -> list[Surface]:
    """The shipped corridor, turned by up to 5 degrees about the vertical and shifted; its body moved and posed anew."""
    surfaces = shipped("corridor")
    turn = np.radians(random.uniform(-5.0, 5.0))
    # The corridor is turned about a point in the view, so that its walls stay in view.
    pivot = np.array([-0.1, 2.2])
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    shift = random.uniform([-0.05, -0.05], [0.05, 0.05])

    def moved(place: list[float]) -> list[float]:
        return [*(pivot + rotation @ (np.array(place[:2]) - pivot) + shift).tolist(), place[2]]

    for surface in surfaces:
        for name in ("center", "position"):
            if name in surface:
                surface[name] = moved(surface[name])
        if "normal" in surface:
            surface["normal"] = [*(rotation @ surface["normal"][:2]).tolist(), 0.0]
        if "heading" in surface:
            surface["heading"] += float(np.degrees(turn))
    body = named(surfaces, "mannequin")
    body["position"] = (np.array(body["position"]) + random.uniform([-0.05, -0.05, -0.03], [0.05, 0.05, 0.03])).tolist()
    body |= {
        "heading": body["heading"] + float(random.uniform(-25.0, 25.0)),
        "height": float(random.uniform(1.6, 1.8)),
        "arms": random.uniform(6.0, 16.0, 2).tolist(),
        "elbows": random.uniform(5.0, 40.0, 2).tolist(),
        "stride": float(random.uniform(-12.0, 12.0)),
    }
    return surfaces


def hidden(surfaces: list[Surface], radar: Radar) -> bool:
    """Whether the body is completely outside the field of view in azimuth."""
    body = named(surfaces, "mannequin")
    x, y, _ = body["position"]
    azimuth, _ = beam_angles([x, y, 0.0])
    reach = body["height"] * (TRUNK + ARM * np.sin(np.radians(max(body["arms"]))))
    aside = np.degrees(np.arcsin(min(reach / np.hypot(x, y), 1.0)))
    field = radar.scanner["azimuth"]
    return bool(azimuth + aside < field["start"] or azimuth - aside > field["stop"])


def scattering(name: str, draw: Draw, kind: str | None = None) -> Make:
    """The function `make` of a family: draws a scene until its body is hidden, and sets how its walls scatter inside.

    All walls scatter in the way `kind` of `PROFILES`; by default each wall in a random way. `name` becomes the name of
    the function, and so a part of the seed.
    """

    @functools.wraps(draw)
    def make(random: Generator, radar: Radar) -> list[Surface]:
        for _ in range(MOST_DRAWS):
            surfaces = draw(random)
            if hidden(surfaces, radar):
                return [surface | (inside(random, kind) if surface["kind"] == "panel" else {}) for surface in surfaces]
        raise InputError(
            f"{name}: in none of {MOST_DRAWS} draws the body stands beside the view of radar {radar.name!r}; "
            "choose one with a narrower view"
        )

    make.__name__ = name
    return make


SCANNER = replace(
    RADARS["scanner"],
    name="scanner, 1001 frequencies",
    what=f"{RADARS['scanner'].what}; 5.0 m unambiguous",
    band=RADARS["scanner"].band | {"points": 1001},
)


def _family(name: str, what: str, draw: Draw, kind: str | None = None, bounces: int = 1) -> Family:
    """A family of scenes before `SCANNER`."""
    make = scattering(name, draw, kind)
    settings: dict[str, Any] = {"make": make, "bounces": bounces, "snr_db": SNR_DB, "radar": SCANNER}
    return Family(name=f"raster {name}", what=what, engine="raster", **settings)


FAMILIES = (
    _family("face alone", "A board that scatters on its face alone shows a body beside the view.", drywall, "face"),
    _family("shallow", "The same; the board scatters inside as exp(-2 z / d), d from 3 to 10 mm.", drywall, "shallow"),
    _family("deep", "The same, d from 15 to 30 mm.", drywall, "deep"),
    _family("uniform", "The same; the board scatters evenly down to 6 to 25 mm.", drywall, "uniform"),
    _family("layers", "The same; the board scatters behind its face and at its back, 8-20 mm deep.", drywall, "layers"),
    _family("leaning", "The same; the board leans by 5 degrees and scatters in any of these ways.", leaning_drywall),
    _family("corridor", "Around a corner; each wall scatters in any of these ways.", corridor, bounces=2),
)
