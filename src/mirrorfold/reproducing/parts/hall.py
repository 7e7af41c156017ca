"""A hall of two mirrors: a point between them is seen directly, and by way of one, two and three mirrors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.common.geometry import Isometry, segment_normal
from mirrorfold.common.types import Array
from mirrorfold.reproducing.parts.scenes import plan_scene

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

ELEMENTS, PITCH, START, STOP = 161, 0.5e-3, 290e9, 300e9
"""The published array and band: 8 cm, 10 GHz."""

RADIUS = 1e-3
"""Radius of the target [m]. The target is a circle: at every angle its echo comes from a single point, which is nearer
than its middle by the radius."""

CHAINS = ((), ("right",), ("right", "left"), ("right", "left", "right"))
"""The chains of mirrors by way of which the target is seen, in the order in which the outgoing wave meets them."""

LABELS = ("line of sight", "one fold", "two folds", "three folds")


def drawn(seed: int) -> tuple[dict[str, Array], Array]:
    """Two random mirrors that face each other, by their ends (2, 2) [m], and a random place between them (2,) [m]."""
    random = np.random.default_rng(seed)
    mirrors = {}
    for name, side in (("right", 1.0), ("left", -1.0)):
        away, lean = random.uniform(0.22, 0.30), np.radians(random.uniform(-3.0, 3.0))
        ends = np.array([0.12, 3.2])
        mirrors[name] = np.column_stack([side * away + np.tan(lean) * (ends - 1.0), ends])
    return mirrors, np.array([random.uniform(-0.1, 0.1), random.uniform(1.5, 2.2)])


def hall_scene(mirrors: dict[str, Array], target: Array, *, elements: int, points: int) -> Scene:
    """The scene of both mirrors and the target, with an array and a band like the published ones."""
    walls = [{"name": name, "kind": "segment", "start": ends[0].tolist(), "end": ends[1].tolist()}
             for name, ends in mirrors.items()]  # fmt: skip
    circle = {"name": "target", "kind": "circle", "center": target.tolist(), "radius": RADIUS}
    return plan_scene(
        {
            "name": "a point between two mirrors",
            "array": {"elements": elements, "pitch": PITCH},
            "band": {"start": START, "stop": STOP, "points": points},
            "surface": [*walls, circle],
        }
    )


def unfolding(mirrors: dict[str, Array], chain: tuple[str, ...]) -> Isometry:
    """The map from the ghost that a chain of mirrors shows to the true place, as reflections at the true mirrors.

    The mirror that the wave meets first is the last to reflect the object into its ghost; so it reflects back first.
    """
    fold = Isometry.identity()
    for name in chain:
        fold = Isometry.reflection(mirrors[name][0], segment_normal(*mirrors[name])) @ fold
    return fold


def image_mirrors(mirrors: dict[str, Array]) -> Array:
    """The mirrors of the longest chain where the image shows them, the one in line of sight first, (3, 2, 2) [m]."""
    longest = CHAINS[-1]
    return np.stack(
        [unfolding(mirrors, longest[:before]).inverse(mirrors[name]) for before, name in enumerate(longest)]
    )
