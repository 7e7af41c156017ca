"""Cylinders and spheres as mirrors: where rays meet them, where they reflect, and how they spread a pencil of rays.

One class serves both. Vectors are projected on the plane square to the axis; a sphere has no axis, and its vectors stay
as they are. The surface is then the set of points whose projected distance from the middle is the radius R.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mirrorfold.common.geometry import circle_crossings, unit, unit_or_zero
from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array, Mask

HALVINGS = 36
"""Number of steps of the bisection for a reflection point, which give it to 1e-11 of the radius."""


@dataclass(frozen=True, eq=False)
class RoundSurface:
    """An infinite cylinder, or a sphere, seen from outside.

    Attributes
    ----------
    middle : (3,) array [m]
        Center of the sphere, or any point on the axis of the cylinder.
    axis : (3,) array
        Unit vector along the axis of a cylinder; zero for a sphere.
    radius : float [m]
    """

    middle: Array
    axis: Array
    radius: float

    @property
    def base(self) -> Array:
        """Unit vectors along which the middle can move: two square to a cylinder's axis, (2, 3); else all, (3, 3)."""
        return np.linalg.svd(self.axis[None])[2][1:] if self.axis.any() else np.eye(3)

    def across(self, vectors: Array) -> Array:
        """The part of vectors (..., 3) that is square to the axis; for a sphere, the vectors themselves."""
        return vectors - (vectors @ self.axis)[..., None] * self.axis

    def along(self, points: Array) -> Array:
        """Coordinate of points (..., 3) along the axis, from the middle [m]; zero for a sphere."""
        return (points - self.middle) @ self.axis

    def outward(self, points: Array) -> Array:
        """Unit normals (..., 3) of the surface at the places nearest to points (..., 3); zero in the middle."""
        return unit_or_zero(self.across(points - self.middle))

    def beside(self, points: Array) -> Array:
        """Distance [m] of points (..., 3) from the surface, positive outside."""
        return np.linalg.norm(self.across(points - self.middle), axis=-1) - self.radius

    def nearest(self, points: Array) -> Array:
        """The places (..., 3) on the surface that are nearest to points (..., 3)."""
        return points - self.beside(points)[..., None] * self.outward(points)

    def met(self, origin: Array, sight: Array) -> Array:
        """Range [m] at which rays from one origin (3,) along unit vectors (n, 3) enter the surface; NaN if they do not.

        It is the smaller root t of ``|P(o + t d - m)|^2 = R^2``, with the projection P of `across`.
        """
        ahead, offset = self.across(sight), self.across(origin - self.middle)
        range_, _ = circle_crossings(offset, ahead, self.radius, np.sum(ahead**2, axis=-1))
        return np.where(range_ > 0.0, range_, np.nan)

    def passed(self, origin: Array, sight: Array) -> Array:
        """Range [m] at which rays from one origin (3,) along unit vectors (n, 3) are closest to the middle or axis."""
        ahead = self.across(sight)
        square = np.maximum(np.sum(ahead**2, axis=-1), np.finfo(float).tiny)
        return -(ahead @ self.across(origin - self.middle)) / square

    def reflection(self, origin: Array, points: Array) -> tuple[Array, Mask]:
        """Places (n, 3) where the surface reflects rays from an origin (3,) to points (n, 3), and which exist (n,)."""
        places = np.empty(np.shape(points))
        found = np.empty(len(points), dtype=np.bool_)
        _reflections(self.middle, self.axis, self.radius, origin, np.ascontiguousarray(points), places, found)
        return places, found

    def bending(self, sight: Array, normal: Array) -> tuple[Array, Array]:
        """How the surface changes the curvature of waves that arrive along unit vectors (n, 3), at normals (n, 3).

        A wave that arrives with the curvature matrix C leaves with ``C + 2 cos(i) K'``, K' being the curvature of the
        surface as the incident ray projects it on the wavefront (G. A. Deschamps, Proc. IEEE 60, 1972, eq. 31).

        Returns
        -------
        power : (n, 2) array [1/m]
            Curvature that is added along both principal directions, the larger first: ``2 / (R cos i)`` and
            ``2 cos i / R`` for a sphere; ``2 cos(i) (1 + (d.e)^2 / cos(i)^2) / R`` and zero for a cylinder, with the
            direction d of the ray and the cylinder's tangent e square to the axis.
        direction : (n, 3) array
            Unit vectors along the first principal direction, square to the incident rays.
        """
        cosine = np.maximum(-np.sum(sight * normal, axis=1), np.finfo(float).eps)
        if self.axis.any():
            tangent = np.cross(self.axis, normal)
            aslant = tangent + normal * (np.sum(sight * tangent, axis=1) / cosine)[:, None]
            length = np.linalg.norm(aslant, axis=1)
            power = np.column_stack([2.0 * cosine * length**2 / self.radius, np.zeros(len(sight))])
            return power, aslant / length[:, None]
        direction = normal + cosine[:, None] * sight
        small = np.linalg.norm(direction, axis=1) < 1e-9
        # At normal incidence, any direction square to the ray is a principal one.
        direction[small] = np.cross(normal[small], np.eye(3)[np.argmin(np.abs(normal[small]), axis=1)])
        power = np.column_stack([2.0 / (self.radius * cosine), 2.0 * cosine / self.radius])
        return power, unit(direction)


@njit(nogil=True, error_model="numpy")
def reflection_point(middle, axis, radius, origin, x, y, z):  # type: ignore[no-untyped-def]
    """The place x, y, z where a round surface reflects a ray from an origin to a point, and the length of the ray.

    The length is -1 if there is no such place. In the plane square to the axis, or for a sphere in the plane of origin,
    point and middle, both legs of the ray make equal angles with the normal (Alhazen's problem). Let a and b be the
    distances of origin and point from the middle, f the angle between them, and l1 and l2 the lengths of the legs. The
    angle t of the place from the origin solves ``a sin(t) / l1 = b sin(f - t) / l2``. Where both ends see the surface,
    each side of the equation grows with its own angle, so there is at most one solution, which bisection finds. Along
    the axis, the ray advances in proportion to the lengths of its legs.
    """
    ox, oy, oz = origin[0] - middle[0], origin[1] - middle[1], origin[2] - middle[2]
    px, py, pz = x - middle[0], y - middle[1], z - middle[2]
    origin_along, point_along = ox * axis[0] + oy * axis[1] + oz * axis[2], px * axis[0] + py * axis[1] + pz * axis[2]
    ox, oy, oz = ox - origin_along * axis[0], oy - origin_along * axis[1], oz - origin_along * axis[2]
    px, py, pz = px - point_along * axis[0], py - point_along * axis[1], pz - point_along * axis[2]
    a, b = np.sqrt(ox * ox + oy * oy + oz * oz), np.sqrt(px * px + py * py + pz * pz)
    if a <= radius or b <= radius:
        return 0.0, 0.0, 0.0, -1.0
    ox, oy, oz = ox / a, oy / a, oz / a
    cosine = (ox * px + oy * py + oz * pz) / b
    px, py, pz = px / b - cosine * ox, py / b - cosine * oy, pz / b - cosine * oz
    sine = np.sqrt(px * px + py * py + pz * pz)
    turn = np.arctan2(sine, cosine)
    first, last = max(0.0, turn - np.arccos(radius / b)), min(turn, np.arccos(radius / a))
    if first > last:
        return 0.0, 0.0, 0.0, -1.0
    t = 0.0
    for _ in range(HALVINGS):
        t = 0.5 * (first + last)
        first_leg = np.sqrt(a * a + radius * radius - 2.0 * a * radius * np.cos(t))
        second_leg = np.sqrt(b * b + radius * radius - 2.0 * b * radius * np.cos(turn - t))
        if a * np.sin(t) * second_leg < b * np.sin(turn - t) * first_leg:
            first = t
        else:
            last = t
    scale = 1.0 / sine if sine > 1e-12 else 0.0
    c, s = radius * np.cos(t), radius * np.sin(t) * scale
    first_leg = np.sqrt(a * a + radius * radius - 2.0 * a * c)
    second_leg = np.sqrt(b * b + radius * radius - 2.0 * b * radius * np.cos(turn - t))
    up = origin_along + (point_along - origin_along) * first_leg / (first_leg + second_leg)
    length = np.sqrt((first_leg + second_leg) ** 2 + (point_along - origin_along) ** 2)
    return (
        middle[0] + c * ox + s * px + up * axis[0],
        middle[1] + c * oy + s * py + up * axis[1],
        middle[2] + c * oz + s * pz + up * axis[2],
        length,
    )


@njit(nogil=True, error_model="numpy")
def _reflections(middle, axis, radius, origin, points, places, found):  # type: ignore[no-untyped-def]
    """`reflection_point` of each of the points (n, 3)."""
    for i in range(points.shape[0]):
        x, y, z, length = reflection_point(middle, axis, radius, origin, points[i, 0], points[i, 1], points[i, 2])
        places[i, 0], places[i, 1], places[i, 2] = x, y, z
        found[i] = length >= 0.0
