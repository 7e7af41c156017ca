"""Facts about scenes: what their radar can resolve in them, and which surfaces are too far away."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from mirrorfold.common.records import Record, fact
from mirrorfold.describing.contents import Described
from mirrorfold.describing.resolution import Arrays, Scan, resolution, scan_resolution
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

SURFACE_STEP = 0.01
"""Distance between the points of a surface among which the farthest is searched [m]; its distance is stated to a
centimetre."""


class SurfaceFacts(Record):
    """A surface of a scene."""

    name: str
    kind: str
    material: str


class SceneFacts(Arrays, Described):
    """A scene in two dimensions."""

    kind: Literal["scene"]
    farthest_surface_m: float
    surfaces: list[SurfaceFacts]
    remarks: list[str] = fact("sentences on what looks wrong")


class VolumeSceneFacts(Scan, Described):
    """A scene in three dimensions."""

    kind: Literal["scene"]
    surfaces: list[SurfaceFacts]
    remarks: list[str] = fact("sentences on what looks wrong")


def describe_scene(scene: Scene) -> SceneFacts:
    """Facts about a scene in two dimensions, and what its arrays resolve in it."""
    radar = scene.array.middle[:2]
    ways = [np.linalg.norm(surface.sample(SURFACE_STEP)[0] - radar, axis=1) for surface in scene.surface]
    farthest = float(max((way.max() for way in ways), default=0.0))
    nearest = float(min((way.min() for way in ways), default=0.0))
    between = None if not ways else sorted({nearest, 0.5 * (nearest + farthest), farthest})
    facts, remarks = resolution(scene.band.frequency, scene.array.tx_position, scene.array.rx_position, ranges=between)
    if facts.ambiguous_range_m is not None and farthest > facts.ambiguous_range_m:
        remarks.append(
            f"The farthest surface, {farthest:.3g} m away, lies beyond the unambiguous range of "
            f"{facts.ambiguous_range_m:.3g} m and will appear at a wrong place; use more frequency points."
        )
    return SceneFacts(
        kind="scene",
        title=scene.name,
        **facts,
        farthest_surface_m=farthest,
        surfaces=_surfaces(scene),
        remarks=[*remarks, *_slips(scene)],
    )


def describe_volume_scene(scene: Scene3D) -> VolumeSceneFacts:
    """Facts about a scene in three dimensions, and what its scanner resolves in it."""
    azimuth, elevation = scene.scanner.angles
    beam = (scene.scanner.spot_radius, scene.scanner.focus_distance)
    facts, remarks = scan_resolution(scene.band.frequency, azimuth, elevation, beam)
    remarks += _slips(scene)
    return VolumeSceneFacts(kind="scene", title=scene.name, **facts, surfaces=_surfaces(scene), remarks=remarks)


def _surfaces(scene: Scene | Scene3D) -> list[SurfaceFacts]:
    return [
        SurfaceFacts(name=surface.name, kind=surface.kind, material=str(surface.material)) for surface in scene.surface
    ]


def _slips(scene: Scene | Scene3D) -> list[str]:
    """That there is no surface, and why `simulate` would refuse the scene, or what it would warn of, as remarks."""
    from mirrorfold.simulation.limits import angle_doubts, check_extent  # imports the readers of scenes

    empty = [] if scene.surface else ["The scene has no surfaces."]
    try:
        check_extent(scene)
    except InputError as error:
        return [*empty, str(error)]
    return [*empty, *angle_doubts(scene)]
