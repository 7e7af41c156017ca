"""Building blocks of random floor plans: walls, corners, arcs and discs.

Lengths are in metres, angles in degrees from +x. Each function returns a surface as a scene file states it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mirrorfold.scenes.families.family import Surface

Generator = np.random.Generator
Span = tuple[float, float]

WALL_ROUGHNESS = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
"""Roughness of walls [m]: they remain mirrors at 300 GHz."""

OBJECT_ROUGHNESS = {"rms_height": 0.10e-3, "correlation_length": 0.2e-3}
"""Roughness of objects [m]: rougher, as they shall be seen from all sides."""


def wall(name: str, middle: Span, angle_deg: float, length: float, **more: Any) -> Surface:
    """A straight wall of a length around its middle, in the direction of an angle; `more` are further entries."""
    half = 0.5 * length * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    start, end = np.array(middle) - half, np.array(middle) + half
    return {
        "name": name,
        "kind": "segment",
        "start": start.tolist(),
        "end": end.tolist(),
        "roughness": WALL_ROUGHNESS,
        **more,
    }


def corner(name: str, vertex: Span, facing_deg: float, leg: float) -> Surface:
    """A right-angled corner with two equal legs, whose opening faces a direction."""
    legs = [np.radians(facing_deg + turn) for turn in (45.0, -45.0)]
    ends = [np.array(vertex) + leg * np.array([np.cos(a), np.sin(a)]) for a in legs]
    points = [ends[0].tolist(), list(vertex), ends[1].tolist()]
    return {"name": name, "kind": "polyline", "points": points, "roughness": OBJECT_ROUGHNESS}


def arc(name: str, center: Span, radius: float, facing_deg: float, span_deg: float) -> Surface:
    """An arc of an angular span whose convex side faces a direction."""
    return {
        "name": name,
        "kind": "arc",
        "center": list(center),
        "radius": radius,
        "start_angle": facing_deg - span_deg / 2,
        "stop_angle": facing_deg + span_deg / 2,
        "roughness": OBJECT_ROUGHNESS,
    }


def circle(name: str, center: Span, radius: float) -> Surface:
    """A rough disc."""
    return {"name": name, "kind": "circle", "center": list(center), "radius": radius, "roughness": OBJECT_ROUGHNESS}


def targets(random: Generator, x: Span, y: Span, facing_deg: float) -> list[Surface]:
    """Two or three of a corner, an arc and a disc at random places in the rectangle x, y, more than 0.55 m apart."""
    places: list[np.ndarray] = []
    while len(places) < 3:
        place = np.array([random.uniform(*x), random.uniform(*y)])
        if all(np.linalg.norm(place - other) > 0.55 for other in places):
            places.append(place)
        elif random.random() < 0.02:
            places.clear()
    facing = facing_deg + random.uniform(-25.0, 25.0)
    made = [
        corner("corner", tuple(places[0]), facing, random.uniform(0.15, 0.22)),
        arc("arc", tuple(places[1]), random.uniform(0.15, 0.3), facing, random.uniform(90.0, 150.0)),
        circle("disc", tuple(places[2]), random.uniform(0.06, 0.12)),
    ]
    keep = int(random.integers(2, 4))
    return [made[i] for i in sorted(random.permutation(3)[:keep])]
