"""Cylinders and spheres as mirrors of a three-dimensional scene: what they show, spread as a curved mirror spreads it.

Each scatterer is seen by the one ray that the surface reflects to it (Fermat's principle). The Gaussian beam that is
reflected beside this ray is wider, by the power of the mirror along two directions square to each other, and its axis
moves faster over the scene than that of a beam that goes straight: both follow from one matrix
(`mirrorfold.common.beams.spread_beam`). That is exact to second order about the ray, so for beams that light a small
part of the surface.
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
        Index in the scene.
    shape : RoundSurface
    reach : float [m]
        How far a cylinder goes on along its axis, to either side of its middle.
    """

    surface: int
    shape: RoundSurface
    reach: float

    def holds(self, points: Array) -> Mask:
        """Whether points (n, 3) of the endless surface lie on the face."""
        return np.asarray(np.abs(self.shape.along(points)) <= self.reach)


def round_faces(scene: Scene3D, frequency: float) -> list[RoundFace]:
    """Those faces of a scene that reflect more than `WEAKEST_CHAIN` of the power, there and back."""
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
    """Which points (n, 3) with outward normals a round face shows to the scanner.

    Parameters
    ----------
    scene : Scene3D
    traced : TracedScene
    face : RoundFace
    points, normals : (n, 3) arrays [m]
    frequency : float [Hz]
    smallest_cosine : float
        Points that are seen more obliquely are not.

    Returns
    -------
    seen : (n,) bool array
    places : (n, 3) array [m]
        Where the face reflects the ray to each; meaningless where it is not seen.
    amplitude : (n,) complex array
        Reflection coefficient there, likewise.
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
    """What a round face leaves of a beam, (n,) each but the last.

    Attributes
    ----------
    wide, narrow : (n,) arrays [m]
        Radii of a beam that goes straight, as far as the whole way is long, and responds to turning as this one does.
    loss : (n,) array
        Intensity on the axis over that of such a beam.
    direction : (n, 3) array
        Unit vector along which the radius is `wide`.
    """

    wide: Array
    narrow: Array
    loss: Array
    direction: Array


def spread(scene: Scene3D, face: RoundFace, places: Array, rest: Array, frequency: float) -> Spread:
    """Of beams that are reflected at places (n, 3) [m] and go on for the rest (n,) [m] of their way."""
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
    """Where a round face is met at a right angle from an origin (3,) [m]; None where that is beyond its ends."""
    place = face.shape.nearest(origin[None])
    outside = face.shape.beside(origin[None])[0] > 0.0
    return place[0] if outside and face.holds(place)[0] else None
