"""Floor plans for the tests: a few surfaces in the plane before a short array at the origin."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import Isometry
from mirrorfold.scenes.floor_plan import Scene, parse_scene

ROUGH = {"rms_height": 0.1e-3, "correlation_length": 0.2e-3}
BAND = {"start": 290e9, "stop": 300e9, "points": 5}


def make_scene(*surfaces: dict[str, Any], elements: int = 3, pitch: float = 0.5e-3, **entries: Any) -> Scene:
    """A scene of surfaces given as in a scene file, with an array at the origin unless told otherwise."""
    named = [{"name": f"surface {i}", **surface} for i, surface in enumerate(surfaces)]
    array = {"elements": elements, "pitch": pitch, **entries.pop("array", {})}
    return parse_scene({"name": "test", "array": array, "band": BAND, "surface": named, **entries})


def segment(start: tuple[float, float], end: tuple[float, float], **entries: Any) -> dict[str, Any]:
    return {"kind": "segment", "start": start, "end": end, **entries}


def wavenumber(scene: Scene) -> np.ndarray:
    return 2.0 * np.pi * scene.band.frequency / speed_of_light


def busy_scene(move: Isometry | None = None, rx: dict[str, Any] | None = None, **entries: Any) -> Scene:
    """Walls, a corner and an arc, moved by a rotation and a shift."""
    move = move or Isometry.identity()
    turn = np.degrees(np.arctan2(move.linear[1, 0], move.linear[0, 0]))

    def at(*point: float) -> tuple[float, float]:
        x, y = move(np.array(point))
        return float(x), float(y)

    rough = {"rms_height": 0.5e-3, "correlation_length": 2e-3}
    surfaces = [
        segment(at(0.8, 0.2), at(0.9, 2.6), roughness=rough, material="concrete"),
        segment(at(-0.7, 0.9), at(0.1, 1.0), roughness=rough),
        {"kind": "polyline", "points": [at(-0.35, 1.7), at(-0.6, 1.65), at(-0.55, 1.4)], "roughness": rough},
        {"kind": "arc", "center": at(0.2, 2.2), "radius": 0.2, "start_angle": -120 + turn, "stop_angle": 40 + turn},
        segment(at(-0.9, 0.1), at(-1.0, 1.2), material="plasterboard", volume_depth=0.02),
    ]
    surfaces[3]["roughness"] = rough
    array = {"center": at(0, 0), "direction": tuple(move.linear @ [1.0, 0.0]), "rx": rx}
    band = {"start": 30e9, "stop": 31e9, "points": 6}
    return make_scene(*surfaces, pitch=0.03, array=array, band=band, **entries)


SCREEN = segment((-0.5, 1.0), (0.1, 1.0))
MIRROR = segment((0.8, 0.5), (0.8, 2.4))
HIDDEN = segment((-0.2, 1.6), (-0.2, 1.8))
"""Behind the screen; the mirror at x = 0.8 shows it at x = 1.8."""
