"""Checks before a simulation: scenes with numbers in a wrong unit, and sweeps too large for the memory, are refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.memory import available_memory
from mirrorfold.common.plausible import extent, frequency_unit, length_unit, pitch, reach, shorter_unit
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Arc, Circle

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D
    from mirrorfold.simulation.raster.meshes import Solid

LONGEST_CORRELATION = 10.0
"""Largest correlation length of a rough surface, in sizes of the surface: a longer one is a tilt, no roughness."""

CLEARANCE = 0.5 / np.pi
"""Least distance of antennas from surfaces in wavelengths, ``k d = 1``: nearer, the field of a source is not yet the
wave ``exp(-j k d) / sqrt(d)``."""

COPIES = 3.0
"""Number of arrays of the size of the sweep that a simulation holds at once."""

COARSE = 1e12
"""Chord length [m] longer than any outline: each surface is then returned as its fewest corners."""


def check_extent(scene: Scene | Scene3D) -> None:
    """Refuse a scene whose lengths or frequencies are in a wrong unit, or whose sweep does not fit into the memory.

    Raises
    ------
    InputError
        The message states the numbers, and what was probably meant.
    """
    _check_samples(scene)
    _check_frequencies(scene)
    _check_surfaces(scene)
    _check_roughness(scene)


def angle_doubts(scene: Scene | Scene3D) -> list[str]:
    """Sentences about arcs whose angles, in degrees, were probably given in radians: they span less than 2 pi degrees.

    Whole numbers are taken for degrees.
    """
    found = []
    for index, surface in enumerate(scene.surface):
        if not isinstance(surface, Arc):
            continue
        start, stop = surface.start_angle, surface.stop_angle
        if max(abs(start), abs(stop)) <= 2.0 * np.pi and not (start.is_integer() or stop.is_integer()):
            found.append(
                f"scene {scene.name!r}: surface[{index}] {surface.name!r} spans {abs(stop - start):.3g} degrees, from "
                f'{start:g} to {stop:g}; if these are radians, write "{start:g} rad" and "{stop:g} rad"'
            )
    return found


def check_clearance(scene: Scene) -> None:
    """Refuse antennas on a surface, or inside a wall, where rays do not describe the field.

    Raises
    ------
    InputError
        The message names the antenna, the surface and the least distance.
    """
    wavelength = speed_of_light / scene.band.stop
    antennas = np.unique(np.concatenate([scene.array.tx_position, scene.array.rx_position])[:, :2], axis=0)
    for index, surface in enumerate(scene.surface):
        least = CLEARANCE * wavelength + 0.5 * (getattr(surface, "thickness", None) or 0.0)
        # Chords of a circle lie inside of it by their square over eight radii.
        chord = float(np.sqrt(8.0 * surface.radius * least)) if isinstance(surface, Arc | Circle) else COARSE
        for piece in surface.pieces(chord):
            for start, end in pairwise(piece):
                along = np.clip((antennas - start) @ (end - start) / np.sum((end - start) ** 2), 0.0, 1.0)
                away = np.linalg.norm(antennas - start - along[:, None] * (end - start), axis=1)
                if away.min() < least:
                    x, y = antennas[np.argmin(away)]
                    raise InputError(
                        f"array: the antenna at ({x:.6g}, {y:.6g}) m stands on surface[{index}] {surface.name!r}, "
                        f"{away.min():.2g} m from it; expected at least {least:.2g} m, move one of the two"
                    )


def check_scanner(scene: Scene3D, solids: Sequence[Solid]) -> None:
    """Refuse a scanner that stands on a flat face or inside a panel, which its beams would begin behind or in.

    Raises
    ------
    InputError
        The message names the surface and the least distance.
    """
    origin = np.asarray(scene.scanner.origin)
    for solid in solids:
        surface = scene.surface[solid.surface]
        thickness = getattr(surface, "thickness", None) or 0.0
        least = CLEARANCE * speed_of_light / scene.band.stop + 0.5 * thickness
        faces = solid.quads
        if thickness and faces:
            faces = (replace(faces[0], center=np.mean([face.center for face in faces], axis=0)),)
        away = min((float(np.linalg.norm(origin - face.nearest(origin))) for face in faces), default=np.inf)
        if away < least:
            raise InputError(
                f"scanner: its origin stands on surface[{solid.surface}] {surface.name!r}, {away:.2g} m from it; "
                f"expected at least {least:.2g} m, move one of the two"
            )


def _check_samples(scene: Scene | Scene3D) -> None:
    """Refuse a sweep that does not fit into the memory."""
    if isinstance(scene, Scene):
        counts = [array.count for array in (scene.array, scene.array.rx or scene.array)]
        what = f"{counts[0]} transmitters x {counts[1]} receivers"
    else:
        counts = [angles.size for angles in scene.scanner.angles]
        what = f"{counts[0]} x {counts[1]} beams"
    size, free = 8.0 * scene.band.points * counts[0] * counts[1], available_memory()
    if COPIES * size > free:
        raise InputError(
            f"scene {scene.name!r}: {what} x {scene.band.points} frequencies are {size / 1e9:.3g} GB of samples, and "
            f"{free / COPIES / 1e9:.3g} GB would fit into the memory; give fewer elements, beams or frequencies"
        )


def _check_frequencies(scene: Scene | Scene3D) -> None:
    """Refuse a band whose wavelength is too long for the array, and a pitch that is too long for the wavelength."""
    if isinstance(scene, Scene):
        places = scene.array.tx_position, scene.array.rx_position
        length, step = extent(*places), min((one for one in map(pitch, places) if one), default=0.0)
    else:
        length = step = 2.0 * scene.scanner.spot_radius
    unit = frequency_unit(scene.band.stop, length, step, speed_of_light)
    if unit is not None:
        raise InputError(
            f"scene {scene.name!r}: band.stop is {scene.band.stop:g} Hz, a wavelength of "
            f"{speed_of_light / scene.band.stop:.3g} m, and the antennas reach over {length:.3g} m; "
            f'probably "{scene.band.stop:g} {unit}" was meant'
        )
    if not isinstance(scene, Scene):
        return
    # The pitch of a sparse array may be that large; but no array is longer than the distance to all surfaces it sees.
    other = length_unit(step, speed_of_light / scene.band.stop) if length > _farthest(scene) else None
    if other is not None:
        raise InputError(
            f"scene {scene.name!r}: neighbouring antennas stand {step:.3g} m apart, "
            f'{step * scene.band.stop / speed_of_light:.0f} wavelengths; probably "{step:g} {other}" was meant as pitch'
        )


def _check_surfaces(scene: Scene | Scene3D) -> None:
    """Refuse surfaces farther away than the largest plausible distance."""
    ambiguous = scene.band.ambiguous_range
    limit = reach(ambiguous, speed_of_light / scene.band.stop)
    for index, surface in enumerate(scene.surface):
        away = _distance(scene, surface)
        if away > limit:
            raise InputError(
                f"scene {scene.name!r}: surface[{index}] {surface.name!r} reaches {away:.4g} m from the radar, whose "
                f"frequency steps tell ranges up to {ambiguous:.3g} m; expected at most {limit:.3g} m"
                + shorter_unit(away, limit)
            )


def _check_roughness(scene: Scene | Scene3D) -> None:
    """Refuse surfaces that are rougher than they are large, or whose roughness is much longer than they are."""
    for index, surface in enumerate(scene.surface):
        if surface.roughness is None:
            continue
        size = max(extent(_corners(surface)), 2.0 * getattr(surface, "radius", 0.0)) or np.inf
        for name, most in (("rms_height", size), ("correlation_length", LONGEST_CORRELATION * size)):
            found = getattr(surface.roughness, name)
            if found > most:
                raise InputError(
                    f"scene {scene.name!r}: surface[{index}] {surface.name!r} is {size:.3g} m large, and {name} of its "
                    f'roughness is {found:g} m, expected at most {most:.3g} m; write it with its unit, as in "50 um"'
                )


def _farthest(scene: Scene | Scene3D) -> float:
    """Distance [m] from the radar to the farthest point of all surfaces, zero where there is none."""
    return max((_distance(scene, surface) for surface in scene.surface), default=0.0)


def _distance(scene: Scene | Scene3D, surface: Any) -> float:
    """Distance [m] from the radar to the farthest corner of a surface; see `_corners`."""
    origin = scene.array.tx_position.mean(axis=0) if isinstance(scene, Scene) else np.asarray(scene.scanner.origin)
    corners = _corners(surface)
    return float(np.linalg.norm(corners - origin[: corners.shape[1]], axis=1).max())


def _corners(surface: Any) -> Array:
    """Corners of a surface, or its middle where it has none, (n, 2) or (n, 3) [m]."""
    if hasattr(surface, "pieces"):
        return np.concatenate(surface.pieces(COARSE))
    if hasattr(surface, "on"):  # a patch lies on another surface
        return np.zeros((1, 3))
    if hasattr(surface, "start"):
        return np.array([surface.start, surface.end], dtype=np.float64)
    return np.array([surface.frame.shift], dtype=np.float64)
