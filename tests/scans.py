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


def pillar(middle=(0.0, 2.2), radius=0.2, name="pillar", **finish):
    """An upright pillar, rough steel by default."""
    ends = [[*middle, z] for z in (-1.0, 1.0)]
    return {"name": name, "kind": "cylinder", "start": ends[0], "end": ends[1], "radius": radius,
            **({"material": "pec", "roughness": ROUGH} | finish)}  # fmt: skip


def box(name="target", center=(-1.0, 1.6, 0.0), size=(0.25, 0.25, 0.3), heading=70.0):
    """A box beside the view, of rough metal with round edges."""
    return {"name": name, "kind": "box", "center": list(center), "size": list(size), "heading": heading,
            "rounding": 0.03, "material": "pec", "diffuse_fraction": 0.5}  # fmt: skip


NEAR_FOCUS = {"spot_radius": 0.0095, "focus_distance": 2.1}
"""The same aperture focused nearer: a round mirror spreads what it shows, the more the wider the beam is on it."""


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
