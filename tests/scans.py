"""Small three-dimensional scenes for the tests: a few mirrors, a few things, a coarse scan."""

from __future__ import annotations

import numpy as np

from mirrorfold.scenes.floor_plan import parse_scene

ROUGH = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
BOARD = {"material": "plasterboard", "roughness": ROUGH, "volume_depth": 0.015}
STEEL = {"material": "pec", "diffuse_fraction": 0.2}


def content(*surfaces, half=8.0, beams=41, points=801, azimuth=0.0, **scanner):
    """The content of a scene file with these surfaces, seen by a scan of `beams` squared over +-`half` degrees."""
    return {
        "name": "test",
        "dimensions": 3,
        "scanner": {
            "azimuth": {"start": azimuth - half, "stop": azimuth + half, "points": beams},
            "elevation": {"start": -half, "stop": half, "points": beams},
            "spot_radius": 0.017,
            "focus_distance": 3.0,
            **scanner,
        },
        "band": {"start": 270e9, "stop": 300e9, "points": points},
        "surface": list(surfaces),
    }


def scene(*surfaces, **settings):
    return parse_scene(content(*surfaces, **settings))


def panel(name="wall", center=(0.0, 2.0, 0.0), normal=(-1.0, -1.0, 0.0), width=1.6, height=1.6, **finish):
    return {"name": name, "kind": "panel", "center": list(center), "normal": list(normal), "width": width,
            "height": height, **(finish or BOARD)}  # fmt: skip


def ball(name="ball", center=(-1.0, 2.0, 0.0), radius=0.15, **finish):
    return {"name": name, "kind": "sphere", "center": list(center), "radius": radius,
            **({"material": "pec", "diffuse_fraction": 1.0} | finish)}  # fmt: skip


def turned(surface, angle_deg):
    """The same surface turned about the radar's vertical axis, from +y towards +x."""
    angle = np.radians(angle_deg)
    rotation = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    moved = {name: (rotation @ np.array(surface[name])).tolist() for name in ("center", "normal") if name in surface}
    return {**surface, **moved}


def periscope():
    """Three mirrors that turn the view to the left, ahead and to the left again, and a ball behind the last one."""
    return [
        panel("first", (0.0, 1.0, 0.0), (-1.0, -1.0, 0.0), 0.7, 0.8, **STEEL),
        panel("second", (-0.8, 1.0, 0.0), (1.0, 1.0, 0.0), 0.85, 0.8, **STEEL),
        panel("third", (-0.8, 1.8, 0.0), (-1.0, -1.0, 0.0), 1.0, 1.0, **STEEL),
        ball("ball", (-1.5, 1.8, 0.0), 0.15),
    ]
