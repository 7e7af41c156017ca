"""Families of floor plans whose sweeps are simulated by the full-wave solver: small enough to take a minute or two.

Scenes are drawn in a unit of length of their own, with walls about one unit long, and then scaled by the wavelength, so
that they have some 11 000 unknowns with any radar: a unit is about 300 wavelengths, 30 cm at 300 GHz, 1.1 m at 79 GHz.
Echoes that are reflected to and fro between walls fade slowly, and eventually wrap around the ambiguous range. The
ambiguous range is five to ten units, at least twice the distance of the hidden objects, except in the family that tests
wrapped echoes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import Any, cast

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import LinearArray
from mirrorfold.scenes.families.drawing import FLAT_BOUNCES, HIDDEN, SPACING
from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.parts import WALL_ROUGHNESS, Span, arc, circle, corner, wall
from mirrorfold.scenes.families.radars import RADARS, Radar
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.materials import permittivity
from mirrorfold.scenes.surfaces import Surface as PlanSurface
from mirrorfold.scenes.visibility import visible_truth

Generator = np.random.Generator
Draw = Callable[[Generator], list[Surface]]
Make = Callable[[Generator, Radar], list[Surface]]

OUTLINE = 1000.0
"""Total length of all surfaces [wavelengths]: some 11 000 unknowns at the tolerance below. Each face of a dielectric
wall counts double, and by the wavelength inside the wall; see `_unknowns`."""

TOLERANCE = 5e-3
"""Relative error of the sweeps, -46 dB: below the weakest echoes that are evaluated in any image."""

CORRELATION, WALL_HEIGHT, OBJECT_HEIGHT, PANE_HEIGHT = 0.25, 0.05, 0.09, 0.035
"""Roughness [wavelengths]: correlation length, and rms heights of walls, of objects and of dielectric walls. So walls
remain mirrors, dielectric walls also windows, and objects are seen from all sides."""

CLEAR = "clear", "behind"
"""First words of the names of objects that the radar shall see: directly, or through a half-transparent wall."""

OBJECTS = (*HIDDEN, *CLEAR)
"""First words of the names of all objects; the radar must not see those in `HIDDEN`."""

GAP, NEAREST = 0.07, 0.4
"""Least distance between two surfaces, and between surfaces and antennas [units]."""

SHOWN, SHOWN_OF_CLOSED = 0.45, 0.2
"""Least share of a hidden surface that mirrors show; less for a closed one, half of which faces away from a mirror."""

IN_SIGHT = 0.3
"""Least share of a surface named in `CLEAR` that the radar sees directly."""

EYES = 5
"""Number of antennas along the array, its ends among them, from which hidden surfaces must not be visible."""

MOST_DRAWS = 5000
"""Largest number of draws for one scene."""

LENGTHS = ("start", "end", "points", "center", "radius")
"""Entries of a surface that are scaled."""


def places(random: Generator, count: int, x: Span, y: Span, apart: float) -> list[Span]:
    """Random places in the rectangle x, y, more than `apart` from each other."""
    found: list[Span] = []
    while len(found) < count:
        place = float(random.uniform(*x)), float(random.uniform(*y))
        if all(np.hypot(place[0] - a, place[1] - b) > apart for a, b in found):
            found.append(place)
        elif random.random() < 0.02:
            found.clear()
    return found


def targets(random: Generator, count: int, x: Span, y: Span, facing_deg: float) -> list[Surface]:
    """As many as `count` of a corner, an arc and a disc, at random places in a rectangle, facing about a direction."""
    facing = facing_deg + random.uniform(-25.0, 25.0)
    at = places(random, 3, x, y, 0.5)
    made = [
        corner("corner", at[0], facing, random.uniform(0.15, 0.22)),
        arc("arc", at[1], random.uniform(0.15, 0.25), facing, random.uniform(90.0, 150.0)),
        circle("disc", at[2], random.uniform(0.06, 0.12)),
    ]
    return [made[i] for i in sorted(random.permutation(3)[:count])]


def two(random: Generator) -> list[Surface]:
    """Two walls: one hides the objects behind it, the other, to the right, shows them."""
    return [
        wall("wall 1", (random.uniform(-0.5, -0.25), random.uniform(0.95, 1.2)), random.uniform(150.0, 185.0),
             random.uniform(0.9, 1.1)),
        wall("wall 2", (random.uniform(0.6, 0.85), random.uniform(1.2, 1.6)), random.uniform(98.0, 115.0),
             random.uniform(0.8, 1.1)),
    ]  # fmt: skip


def fitting(*, bounces: int = 1, outline: float = OUTLINE, only_curved: bool = False) -> Callable[[Draw], Make]:
    """Decorator: turns a function that draws surfaces [units] into the `make` of a family, with valid scenes [m].

    Valid means that the hidden surfaces are seen by way of up to `bounces` mirrors, a part of them only by way of that
    many; with `only_curved`, no part of them by way of flat mirrors. `outline` [wavelengths] is the total length of all
    surfaces; see `OUTLINE`.
    """

    def decorate(draw: Draw) -> Make:
        @functools.wraps(draw)
        def make(random: Generator, radar: Radar) -> list[Surface]:
            for _ in range(MOST_DRAWS):
                unit, surfaces = sized(draw(random), radar, outline)
                if valid(_scene(surfaces, radar), unit, bounces, only_curved):
                    return surfaces
            raise InputError(
                f"{draw.__name__}: none of {MOST_DRAWS} draws is valid for radar {radar.name!r}; choose another radar"
            )

        return make

    return decorate


def _scene(surfaces: list[Surface], radar: Radar) -> Scene:
    """The scene of these surfaces with the array and the band of a radar."""
    return cast(Scene, parse_scene({"name": "draw", "array": radar.array, "band": radar.band, "surface": surfaces}))


def sized(surfaces: list[Surface], radar: Radar, outline: float = OUTLINE) -> tuple[float, list[Surface]]:
    """The unit [m] in which all surfaces together have the length `outline` [wavelengths]; the surfaces in metres."""
    wavelength = speed_of_light / radar.band["stop"]
    drawn = _scene(surfaces, radar).surface
    length = sum(_unknowns(surface, radar.band["stop"]) * surface.sample(0.05)[2].sum() for surface in drawn)
    unit = outline * wavelength / length

    def in_metres(surface: Surface) -> Surface:
        height = OBJECT_HEIGHT if surface["name"].startswith(OBJECTS) else WALL_HEIGHT
        height = PANE_HEIGHT if "thickness" in surface else height
        rough = {"rms_height": height * wavelength, "correlation_length": CORRELATION * wavelength}
        lengths = {name: (unit * np.array(surface[name])).tolist() for name in LENGTHS if name in surface}
        return surface | lengths | ({"roughness": rough} if "roughness" in surface else {})

    return unit, [in_metres(surface) for surface in surfaces]


def _unknowns(surface: PlanSurface, frequency: float) -> float:
    """Number of unknowns on a surface over that on a conductor of the same length.

    A dielectric wall has nodes on both faces, two unknowns per node, and nodes spaced by the wavelength inside.
    """
    if getattr(surface, "thickness", None) is None:
        return 1.0
    return 4.0 * abs(np.sqrt(complex(permittivity(surface.material, frequency))))


def valid(scene: Scene, unit: float, bounces: int, only_curved: bool = False) -> bool:
    """Whether surfaces are apart, hidden ones are invisible from all along the array, and mirrors show them."""
    samples = [surface.sample(min(0.02 * unit, SPACING))[:2] for surface in scene.surface]
    antennas = scene.array.tx_position[:, :2]
    parts = [antennas, *(points for points, _ in samples)]
    for (i, one), (_, other) in combinations(enumerate(parts), 2):
        least = (NEAREST if i == 0 else GAP) * unit
        if np.linalg.norm(one[:, None] - other[None], axis=-1).min() < least:
            return False
    along = antennas[np.linspace(0, len(antennas) - 1, EYES).astype(int)]
    eyes = [replace(scene, array=LinearArray(elements=1, pitch=1.0, center=tuple(place))) for place in along]
    hidden = []
    for surface, sample in zip(scene.surface, samples, strict=True):
        if surface.name.startswith(HIDDEN):
            if any(visible_truth(place, *sample, bounces=0)[0].any() for place in (scene, *eyes)):
                return False
            hidden.append((SHOWN_OF_CLOSED if surface.kind == "circle" else SHOWN, sample))
        elif surface.name.startswith(CLEAR) and visible_truth(scene, *sample, bounces=0)[0].mean() < IN_SIGHT:
            return False
    deep = 0.0
    for least, sample in hidden:
        shown = visible_truth(scene, *sample, bounces=bounces)[1].mean()
        if shown < least:
            return False
        if only_curved and visible_truth(scene, *sample, bounces=FLAT_BOUNCES, curved=False)[1].any():
            return False
        deep = max(deep, shown - visible_truth(scene, *sample, bounces=bounces - 1)[1].mean())
    return deep >= 0.5 * SHOWN_OF_CLOSED


@fitting()
def two_walls(random: Generator) -> list[Surface]:
    """Behind a wall stand two or three objects, which another wall shows."""
    return [*two(random), *targets(random, int(random.integers(2, 4)), (-1.0, 0.1), (1.4, 2.4), -15.0)]


@fitting(bounces=2)
def three_bounces(random: Generator) -> list[Surface]:
    """Mirror A shows an arc and mirror B, which shows another side of the arc; a screen hides both."""
    return [
        wall("mirror A", (random.uniform(-0.1, 0.1), random.uniform(1.3, 1.5)), random.uniform(41.0, 49.0),
             random.uniform(0.9, 1.1)),
        wall("mirror B", (random.uniform(1.1, 1.4), random.uniform(1.3, 1.6)), random.uniform(50.0, 80.0),
             random.uniform(0.9, 1.1)),
        wall("screen", (random.uniform(0.45, 0.65), random.uniform(0.7, 0.9)), random.uniform(0.0, 30.0),
             random.uniform(0.45, 0.6)),
        arc("arc", (random.uniform(0.55, 1.0), random.uniform(1.6, 2.1)), random.uniform(0.15, 0.25),
            random.uniform(-110.0, -30.0), random.uniform(100.0, 160.0)),
    ]  # fmt: skip


@fitting()
def corridor(random: Generator) -> list[Surface]:
    """The radar stands in a corridor, whose far wall shows an object or two around the corner."""
    x, y = random.uniform(-0.55, -0.4), random.uniform(1.0, 1.25)
    inner = [[x + random.uniform(0.0, 0.1), 0.5], [x, y], [x - 1.0, y + random.uniform(-0.1, 0.1)]]
    return [
        {"name": "inner corner", "kind": "polyline", "points": inner, "roughness": WALL_ROUGHNESS},
        wall("far wall", (random.uniform(-0.5, -0.3), y + random.uniform(0.9, 1.2)), random.uniform(-8.0, 12.0),
             random.uniform(1.3, 1.6)),
        *targets(random, int(random.integers(1, 3)), (x - 0.95, x - 0.2), (y + 0.2, y + 0.85), 60.0),
    ]  # fmt: skip


@fitting()
def clutter(random: Generator) -> list[Surface]:
    """Two or three objects in line of sight, beside one or two hidden ones that a wall shows."""
    hidden = targets(random, int(random.integers(1, 3)), (-0.9, 0.1), (1.4, 2.2), -15.0)
    at = places(random, 3, (-0.5, 0.5), (0.55, 1.7), 0.3)
    facing = -90.0 + random.uniform(-30.0, 30.0)
    clear = [
        circle("clear disc", at[0], random.uniform(0.05, 0.1)),
        corner("clear corner", at[1], facing, random.uniform(0.08, 0.14)),
        arc("clear arc", at[2], random.uniform(0.08, 0.16), facing, random.uniform(80.0, 140.0)),
    ]
    return [*two(random), *hidden, *(clear[i] for i in sorted(random.permutation(3)[: int(random.integers(2, 4))]))]


@fitting(bounces=3)
def mirror_in_mirror_in_mirror(random: Generator) -> list[Surface]:
    """Mirror A shows B, B shows C, and C shows an arc or a disc; a screen hides all but A."""
    place = random.uniform(-0.2, 0.45), random.uniform(1.95, 2.25)
    return [
        wall("mirror A", (random.uniform(-0.1, 0.05), random.uniform(1.0, 1.15)), random.uniform(42.0, 48.0),
             random.uniform(0.75, 0.85)),
        wall("mirror B", (random.uniform(0.95, 1.15), random.uniform(1.0, 1.15)), random.uniform(42.0, 48.0),
             random.uniform(0.85, 1.0)),
        wall("mirror C", (random.uniform(0.95, 1.15), random.uniform(1.9, 2.1)), random.uniform(130.0, 140.0),
             random.uniform(0.85, 1.0)),
        wall("screen", (random.uniform(0.38, 0.5), random.uniform(0.5, 0.6)), random.uniform(-10.0, 25.0),
             random.uniform(0.4, 0.55)),
        [
            arc("arc", place, random.uniform(0.15, 0.25), random.uniform(-30.0, 10.0), random.uniform(90.0, 130.0)),
            circle("disc", place, random.uniform(0.1, 0.16)),
        ][int(random.integers(2))],
    ]  # fmt: skip


@fitting()
def bright_corner(random: Generator) -> list[Surface]:
    """Before the wall that shows the hidden objects stands a smooth corner that faces the radar: its side lobes,
    the tail of its pulse and its own images are stronger than what is looked for.
    """
    at = random.uniform(0.2, 0.5), random.uniform(0.8, 1.2)
    facing = np.degrees(np.arctan2(-at[1], -at[0])) + random.uniform(-15.0, 15.0)
    bright = corner("clear bright corner", at, facing, random.uniform(0.06, 0.1))
    del bright["roughness"]
    return [*two(random), bright, *targets(random, 2, (-1.0, 0.1), (1.4, 2.4), -15.0)]


@fitting()
def posts(random: Generator) -> list[Surface]:
    """Four or five thin posts behind a wall, which another wall shows, and two in line of sight."""
    hidden = places(random, int(random.integers(4, 6)), (-0.7, 0.0), (1.45, 2.2), 0.2)
    clear = [*places(random, 1, (-0.4, 0.4), (0.5, 0.75), 0.0), *places(random, 1, (0.2, 0.45), (0.85, 1.4), 0.0)]
    return [
        *two(random),
        *(circle(f"target {i + 1}", place, random.uniform(0.02, 0.05)) for i, place in enumerate(hidden)),
        *(circle(f"clear post {i + 1}", place, random.uniform(0.02, 0.05)) for i, place in enumerate(clear)),
    ]


@fitting()
def curved(random: Generator) -> list[Surface]:
    """Beside each end of the wall that shows the hidden objects stands something round: a column and a curved wall,
    whose echoes run on where the wall ends, and which reflect to all sides.
    """
    first, shows = two(random)
    start, end = np.array(shows["start"]), np.array(shows["end"])
    along = (end - start) / np.linalg.norm(end - start)
    radius, bend = random.uniform(0.1, 0.16), random.uniform(0.2, 0.4)
    column = start - (radius + random.uniform(0.1, 0.2)) * along + random.uniform(-0.1, 0.1, 2)
    middle = end + random.uniform(0.15, 0.35) * along
    away = np.array([along[1], -along[0]])
    facing = float(np.degrees(np.arctan2(-away[1], -away[0])))
    return [
        first,
        shows,
        circle("clear column", tuple(column), radius),
        arc("clear curved wall", tuple(middle + bend * away), bend, facing, random.uniform(60.0, 100.0)),
        *targets(random, int(random.integers(1, 3)), (-1.0, 0.1), (1.4, 2.4), -15.0),
    ]


def near(name: str, points: int) -> Radar:
    """One of `RADARS` with another number of frequencies, to which the time of a sweep is proportional."""
    radar = replace(RADARS[name], name=f"{name}, {points} frequencies", band=RADARS[name].band | {"points": points})
    return replace(radar, what=f"{radar.what}; {radar.cell * (points - 1):.1f} m unambiguous")


def family(name: str, make: Make, radar: Radar, bounces: int = 1, **more: Any) -> Family:
    """A full-wave family, whose description `what` is the docstring of the function `make`."""
    what = " ".join((make.__doc__ or "").split())
    settings: dict[str, Any] = {"bounces": bounces, "radar": radar, "options": {"tolerance": TOLERANCE}, **more}
    return Family(name=f"full-wave {name}", what=what, engine="fullwave", make=make, **settings)


SMALL, FINE, LARGE = near("300 GHz", 201), near("230 GHz", 321), near("79 GHz", 201)
MIDDLE, WRAPPING = near("122 GHz", 321), near("122 GHz", 161)

FAMILIES = (
    family("two walls", two_walls, SMALL),
    family("three bounces", three_bounces, SMALL, bounces=2),
    family("corridor", corridor, MIDDLE),
    family("wrapped corridor", corridor, WRAPPING),
    family("clutter", clutter, MIDDLE),
    family("mirror in mirror in mirror", mirror_in_mirror_in_mirror, FINE, bounces=3),
    family("bright corner", bright_corner, LARGE),
    family("posts", posts, FINE),
    family("curved", curved, LARGE),
)
