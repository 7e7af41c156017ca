"""Cylinders and spheres as mirrors of a three-dimensional scene: what is seen in them, and how they spread beams.

Each scatterer is seen by the one ray that the surface reflects to it (Fermat's principle). A Gaussian beam around this
ray is wider after the reflection, by the optical power of the mirror along two orthogonal directions. When the scanner
turns, the axis of the reflected beam moves faster over the scene than that of a straight beam. Both effects follow from
one matrix (`mirrorfold.common.beams.spread_beam`). This is exact to second order about the ray, hence accurate for
beams that light a small part of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.beams import spread_beam
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.common.types import Array, Mask
from mirrorfold.scenes.solids import Cylinder, Scene3D, Sphere
from mirrorfold.simulation.raster.chains import WEAKEST_CHAIN, TracedScene
from mirrorfold.simulation.raster.speckle import specular_amplitude
from mirrorfold.simulation.rays.scatterers import named


@dataclass(frozen=True, eq=False)
class RoundFace:
    """The round face of a cylinder or sphere of the scene.

    Attributes
    ----------
    surface : int
        Number of the surface in the scene.
    shape : RoundSurface
        The endless cylinder, or the sphere.
    reach : float [m]
        Half the length of a cylinder along its axis; infinite for a sphere.
    """

    surface: int
    shape: RoundSurface
    reach: float

    def holds(self, points: Array) -> Mask:
        """Whether points (n, 3) [m] of the endless cylinder, or of the sphere, lie on the face, (n,)."""
        return np.asarray(np.abs(self.shape.along(points)) <= self.reach)


def round_faces(scene: Scene3D, frequency: float) -> list[RoundFace]:
    """The round faces of a scene that reflect more than `WEAKEST_CHAIN` of the power on each way."""
    found = []
    for index, surface in enumerate(scene.surface):
        if isinstance(surface, Sphere):
            shape, reach = RoundSurface(np.array(surface.center), np.zeros(3), surface.radius), np.inf
        elif isinstance(surface, Cylinder):
            start, end = np.array(surface.start), np.array(surface.end)
            length = float(np.linalg.norm(end - start))
            shape, reach = RoundSurface(0.5 * (start + end), (end - start) / length, surface.radius), 0.5 * length
        else:
            continue
        coefficient = specular_amplitude(surface, frequency, np.array([1.0, 0.1]), named(scene.polarization))
        if np.abs(coefficient).max() ** 2 > WEAKEST_CHAIN:
            found.append(RoundFace(index, shape, reach))
    return found


def shown_in(
    scene: Scene3D, traced: TracedScene, face: RoundFace, points: Array, normals: Array, *, frequency: float,
    smallest_cosine: float,
) -> tuple[Mask, Array, NDArray[np.complex128]]:  # fmt: skip
    """Which points (n, 3) with outward normals the scanner sees in a round face.

    Parameters
    ----------
    scene : Scene3D
    traced : TracedScene
    face : RoundFace
    points, normals : (n, 3) arrays [m]
    frequency : float [Hz]
    smallest_cosine : float
        Least cosine of the angle between a point's normal and its ray to the face; more oblique points are not seen.

    Returns
    -------
    seen : (n,) bool array
    places : (n, 3) array [m]
        Point of the face that reflects the ray to each point; meaningless for points that are not seen.
    amplitude : (n,) complex array
        Reflection coefficient of the face at that place; zero for points that are not seen.
    """
    origin = np.array(scene.scanner.origin)
    places, seen = face.shape.reflection(origin, points)
    amplitude = np.zeros(len(points), dtype=complex)
    seen &= face.holds(places)
    back = places - points
    seen &= np.sum(back * normals, axis=1) > smallest_cosine * np.linalg.norm(back, axis=1)
    which = np.flatnonzero(seen)
    there = np.broadcast_to(origin, (which.size, 3))
    blocked = traced.blocked(points[which], places[which])
    blocked |= traced.blocked(places[which], there)
    seen[which[blocked]] = False
    which = which[~blocked]
    sight, normal = places[which] - origin, face.shape.outward(places[which])
    cosine = -np.sum(sight * normal, axis=1) / np.linalg.norm(sight, axis=1)
    finish = scene.surface[face.surface]
    amplitude[which] = specular_amplitude(finish, frequency, cosine, named(scene.polarization))
    return seen, places, amplitude


@dataclass(frozen=True, eq=False)
class Spread:
    """Beams after reflection at a round face, described by equivalent straight beams.

    The equivalent straight beam is as long as the whole path, and its response to an echo falls as fast as that of the
    reflected beam when the scanner turns.

    Attributes
    ----------
    wide, narrow : (n,) arrays [m]
        Larger and smaller radius of the equivalent straight beam, in two orthogonal directions.
    loss : (n,) array
        Intensity on the axis of the reflected beam over that of the equivalent straight beam.
    direction : (n, 3) array
        Unit vector along which the radius is `wide`.
    """

    wide: Array
    narrow: Array
    loss: Array
    direction: Array


def spread(scene: Scene3D, face: RoundFace, places: Array, rest: Array, frequency: float) -> Spread:
    """Spread of beams that are reflected at places (n, 3) [m] of a round face, and travel on for `rest` (n,) [m]."""
    scanner, wavelength = scene.scanner, speed_of_light / frequency
    sight = places - np.array(scanner.origin)
    before = np.linalg.norm(sight, axis=1)
    sight = sight / before[:, None]
    power, direction = face.shape.bending(sight, face.shape.outward(places))
    width, lever = spread_beam(
        before[:, None], rest[:, None], power,
        spot_radius=scanner.spot_radius, focus_distance=scanner.focus_distance, wavelength=wavelength,
    )  # fmt: skip
    straight = width * (before + rest)[:, None] / lever
    loss = np.prod(straight / width, axis=1)
    first = straight[:, 0] >= straight[:, 1]
    direction = np.where(first[:, None], direction, np.cross(sight, direction))
    return Spread(straight.max(axis=1), straight.min(axis=1), loss, direction)


def facing_place(face: RoundFace, origin: Array) -> Array | None:
    """Point (3,) [m] at which a ray from the origin (3,) [m] meets a round face at a right angle.

    None if the point is beyond the ends of the face, or the origin is inside it.
    """
    place = face.shape.nearest(origin[None])
    outside = face.shape.beside(origin[None])[0] > 0.0
    return place[0] if outside and face.holds(place)[0] else None
