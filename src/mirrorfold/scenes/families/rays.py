"""The families whose sweeps are simulated by rays."""

from __future__ import annotations

from typing import Any

import numpy as np

from mirrorfold.scenes.families.family import Family, Surface
from mirrorfold.scenes.families.parts import WALL_ROUGHNESS, Generator, arc, circle, corner, targets, wall
from mirrorfold.scenes.families.radars import Radar


def one_wall(random: Generator, radar: Radar) -> list[Surface]:
    """A pillar hides an object, and a wall at the side shows it."""
    pillar = circle("pillar", (random.uniform(-0.25, 0.0), random.uniform(0.9, 1.1)), random.uniform(0.14, 0.22))
    mirror = wall("wall", (random.uniform(0.6, 0.85), random.uniform(1.2, 1.6)), random.uniform(98.0, 112.0),
                  random.uniform(0.9, 1.3))  # fmt: skip
    return [pillar, mirror, *targets(random, (-0.9, 0.05), (1.5, 2.4), -40.0)[:1]]


def two_walls(random: Generator, radar: Radar, **mirror: Any) -> list[Surface]:
    """One wall hides the targets, the other shows them."""
    occluder = wall("wall 1", (random.uniform(-0.5, -0.25), random.uniform(0.95, 1.2)), random.uniform(150.0, 185.0),
                    random.uniform(0.9, 1.2), **mirror)  # fmt: skip
    shows = wall("wall 2", (random.uniform(0.6, 0.85), random.uniform(1.2, 1.6)), random.uniform(98.0, 115.0),
                 random.uniform(0.8, 1.2), **mirror)  # fmt: skip
    return [occluder, shows, *targets(random, (-1.0, 0.1), (1.4, 2.4), -15.0)]


def corridor(random: Generator, radar: Radar) -> list[Surface]:
    """The radar stands in a corridor; its far wall shows what is around the corner."""
    turn = random.uniform(-0.6, -0.45), random.uniform(1.1, 1.4)
    inner = {
        "name": "inner corner",
        "kind": "polyline",
        "points": [
            [turn[0] + random.uniform(0.0, 0.1), 0.4],
            list(turn),
            [turn[0] - 1.3, turn[1] + random.uniform(-0.1, 0.1)],
        ],
        "roughness": WALL_ROUGHNESS,
    }
    far = wall("far wall", (random.uniform(-0.6, -0.3), turn[1] + random.uniform(1.0, 1.4)), random.uniform(-8.0, 12.0),
               random.uniform(1.6, 2.2))  # fmt: skip
    return [inner, far, *targets(random, (turn[0] - 1.1, turn[0] - 0.3), (turn[1] + 0.25, turn[1] + 1.0), 60.0)[:2]]


def three_bounces(random: Generator, radar: Radar) -> list[Surface]:
    """A periscope: the first mirror shows the second one, and the second mirror shows the target."""
    first = wall("mirror 1", (random.uniform(-0.1, 0.15), random.uniform(1.3, 1.5)), 45.0 + random.uniform(-4.0, 4.0),
                 random.uniform(0.9, 1.1))  # fmt: skip
    second = wall("mirror 2", (random.uniform(1.1, 1.3), random.uniform(1.3, 1.5)), 45.0 + random.uniform(-5.0, 5.0),
                  random.uniform(1.0, 1.2))  # fmt: skip
    occluder = wall("screen", (random.uniform(0.5, 0.65), random.uniform(0.85, 1.0)), random.uniform(-10.0, 25.0), 0.4)
    place = random.uniform(0.9, 1.5), random.uniform(2.0, 2.5)
    kind = int(random.integers(3))
    target = [
        corner("target", place, -90.0 + random.uniform(-25.0, 25.0), random.uniform(0.15, 0.22)),
        arc("target", place, random.uniform(0.15, 0.3), -90.0, 130.0),
        circle("target", place, random.uniform(0.08, 0.15)),
    ][kind]
    return [first, second, occluder, target]


def drywall(random: Generator, radar: Radar) -> list[Surface]:
    """As `two_walls`, of plasterboard that scatters inside down to 1 to 3 cm."""
    return two_walls(random, radar, material="plasterboard", volume_depth=random.uniform(0.01, 0.03))


def discs(random: Generator, radar: Radar) -> list[Surface]:
    """Four small discs behind a wall, which another wall shows."""
    walls = two_walls(random, radar)[:2]
    places: list[np.ndarray] = []
    while len(places) < 4:
        place = np.array([random.uniform(-0.9, 0.1), random.uniform(1.4, 2.4)])
        if all(np.linalg.norm(place - other) > 0.2 for other in places):
            places.append(place)
    return [*walls, *(circle(f"disc {i}", tuple(p), random.uniform(0.015, 0.05)) for i, p in enumerate(places))]


def empty(random: Generator, radar: Radar) -> list[Surface]:
    """No surfaces: the sweep is noise only."""
    return []


FAMILIES = (
    Family(
        name="one wall",
        what="a pillar of radius 14-22 cm hides a corner, arc or disc, and a wall of 0.9-1.3 m to the side shows it",
        engine="rays",
        make=one_wall,
    ),
    Family(
        name="two walls",
        what="a wall hides two or three of a corner, an arc and a disc 1.4-2.4 m away, another of 0.8-1.2 m shows them",
        engine="rays",
        make=two_walls,
    ),
    Family(
        name="corridor",
        what="one or two objects around the corner of a corridor, shown by its far wall of 1.6-2.2 m, 2.1-2.8 m away",
        engine="rays",
        make=corridor,
    ),
    Family(
        name="three bounces",
        what="a periscope of two mirrors of 0.9-1.2 m at 40-50 degrees, and a corner, arc or disc behind a screen",
        engine="rays",
        make=three_bounces,
        bounces=2,
    ),
    Family(name="empty", what="nothing but noise", engine="rays", make=empty, snr_db=20.0),
    Family(
        name="drywall",
        what="two walls of plasterboard that scatter from 1-3 cm deep, and objects as between two walls",
        engine="rays",
        make=drywall,
    ),
    *(
        Family(
            name=f"SNR {snr_db:g} dB",
            what=f"two walls, with noise {snr_db:g} dB below the mean power of a sample",
            engine="rays",
            make=two_walls,
            snr_db=snr_db,
        )
        for snr_db in (20.0, 10.0, 0.0)
    ),
    Family(
        name="discs",
        what="two walls, and four discs of radius 1.5-5 cm behind the first",
        engine="rays",
        make=discs,
    ),
)
