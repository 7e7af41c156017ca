"""Two walls that hide a corner and an arc: the shipped scene, and a scene in which each wall shows the other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mirrorfold.reproducing.parts.scenes import plan_scene, shipped_plan
from mirrorfold.scenes.arrays import Band, LinearArray
from mirrorfold.scenes.floor_plan import Scene

WALL_ROUGHNESS = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
OBJECT_ROUGHNESS = {"rms_height": 0.10e-3, "correlation_length": 0.2e-3}
"""Rms height and correlation length in the published simulations [m]."""

PUBLISHED_TOP = 300e9
"""Upper end of the published band [Hz]. For a lower band, roughness is scaled with the wavelength from here."""


def hidden_walls() -> Scene:
    """The shipped scene: one wall hides corner and arc, the other shows them; neither wall shows the other."""
    return shipped_plan("two_walls")


def facing_walls() -> Scene:
    """Two walls that face each other: each shows the other, and the left one shows its own image in the right one."""
    right = {"name": "right wall", "kind": "segment", "start": [1.03, 0.91], "end": [0.57, 1.79]}
    left = {"name": "left wall", "kind": "segment", "start": [-0.41, 0.41], "end": [-0.03, 1.34]}
    corner = {"name": "corner", "kind": "polyline", "points": [[-0.29, 2.04], [-0.49, 1.99], [-0.44, 1.80]]}
    arc = {"name": "arc", "kind": "arc", "center": [-0.40, 1.45], "radius": 0.25, "start_angle": -50.0}
    shapes: list[dict[str, Any]] = [right, left, corner, arc | {"stop_angle": 64.6}]
    rough = [WALL_ROUGHNESS if shape["kind"] == "segment" else OBJECT_ROUGHNESS for shape in shapes]
    return plan_scene(
        {
            "name": "two walls that face each other",
            "array": {"elements": 161, "pitch": 0.5e-3},
            "band": {"start": 290e9, "stop": 300e9, "points": 401},
            "surface": [shape | {"roughness": how} for shape, how in zip(shapes, rough, strict=True)],
        }
    )


def at_lower_band(scene: Scene, array: LinearArray, band: Band) -> Scene:
    """The same floor plan for another radar, its surfaces as rough in wavelengths as the published ones."""
    scale = PUBLISHED_TOP / band.stop
    rough = [
        replace(
            surface,
            roughness=None
            if surface.roughness is None
            else replace(
                surface.roughness,
                rms_height=scale * surface.roughness.rms_height,
                correlation_length=scale * surface.roughness.correlation_length,
            ),
        )
        for surface in scene.surface
    ]
    return replace(scene, array=array, band=band, surface=tuple(rough))


SMALL_RADAR = LinearArray(elements=87, pitch=6e-3), Band(start=20e9, stop=24e9, points=111)
"""Radar for quick full waves: 20 to 24 GHz over 52 cm. The computing time grows with the second to third power of the
walls' length in wavelengths. Cells of 3.7 cm by 1.5 degrees are 2.5 and 2 times those of the published radar."""

THINNED_RADAR = LinearArray(elements=121, pitch=0.5e-3), Band(start=290e9, stop=300e9, points=281)
"""Radar for quick rays: three quarters of the published array, and frequencies for an unambiguous range of 4.2 m."""

MIDDLE_RADAR = LinearArray(elements=161, pitch=1e-3), Band(start=145e9, stop=155e9, points=401)
"""Radar for the other full waves: 145 to 155 GHz over 16 cm, the published resolution at half the published
frequency."""
