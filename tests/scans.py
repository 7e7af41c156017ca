"""Small three-dimensional scenes for the tests: a few mirrors, a few things, a coarse scan; exact scans of points."""

from __future__ import annotations

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.beams import beam_direction, beam_radius
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.sweep import make_raster_sweep

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


FREQUENCY = np.linspace(270e9, 300e9, 401)
SPOT = {"spot_radius": 0.017, "focus_distance": 1.5}
"""Frequencies [Hz] and beam [m] of the exact scans of points."""


def point_sweep(*targets, half=3.0, beams=25, noise=0.0, **attrs):
    """The exact sweep of point targets (x, y, z) [m]."""
    angle = np.linspace(-half, half, beams)
    sight = beam_direction(angle[:, None], angle)
    s = np.zeros((FREQUENCY.size, beams, beams), dtype=complex)
    for target in np.array(targets, dtype=float):
        range_ = np.linalg.norm(target)
        width = beam_radius(range_, wavelength=speed_of_light / FREQUENCY.mean(), **SPOT)
        rho = np.linalg.norm(np.cross(sight, target), axis=-1)
        wave = np.exp(-4j * np.pi * FREQUENCY * range_ / speed_of_light)
        s += wave[:, None, None] * np.exp(-2.0 * (rho / width) ** 2)
    generator = np.random.default_rng(0)
    s += noise * (generator.standard_normal(s.shape) + 1j * generator.standard_normal(s.shape))
    return make_raster_sweep(s, frequency=FREQUENCY, azimuth=angle, elevation=angle, **(SPOT | attrs))
