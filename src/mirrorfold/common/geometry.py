"""Lines and planes as mirrors: reflection, isometries, crossings.

A mirror is given by a point on it and its unit normal. The last axis of every array of points holds the coordinates.
Distances, reflections and isometries work in any number of dimensions; functions for two dimensions say so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.arguments import expect_unit, in_message
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError


def unit(vector: ArrayLike) -> Array:
    """Vector(s) scaled to length one, shape (..., d)."""
    vector = np.asarray(vector, dtype=float)
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def unit_or_zero(vector: Array) -> Array:
    """Vector(s) (..., d) scaled to length one; those of length zero stay as they are."""
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), np.finfo(float).tiny)


def turned(vector: Array) -> Array:
    """2D vector(s) (..., 2), turned by +90 degrees."""
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def segment_normal(start: ArrayLike, end: ArrayLike) -> Array:
    """Unit normal of the 2D segment(s) start -> end: the direction turned by +90 degrees, shape (..., 2)."""
    return turned(unit(np.asarray(end, dtype=float) - np.asarray(start, dtype=float)))


def signed_distance(points: ArrayLike, on_mirror: ArrayLike, normal: ArrayLike) -> Array:
    """Distance [m] of points (..., d) from the line or plane, positive on the side of `normal`."""
    offset = np.asarray(points, dtype=float) - np.asarray(on_mirror, dtype=float)
    return offset @ np.asarray(normal, dtype=float)


def reflect(points: ArrayLike, on_mirror: ArrayLike, normal: ArrayLike) -> Array:
    """Mirror images of points (..., d) in the line or plane through `on_mirror` with unit `normal`.

    ``p' = p - 2 ((p - q) . n) n`` (Householder reflection).
    """
    points = np.asarray(points, dtype=float)
    normal = np.asarray(normal, dtype=float)
    return points - 2.0 * signed_distance(points, on_mirror, normal)[..., None] * normal


def reflect_each(points: Array, on_mirrors: Array | float, normals: Array) -> Array:
    """As `reflect`, each of points (..., d) in a line or plane of its own, with unit normals (..., d)."""
    return points - 2.0 * np.sum((points - on_mirrors) * normals, axis=-1, keepdims=True) * normals


@dataclass(frozen=True, eq=False)
class Isometry:
    """The map ``p -> linear @ p + shift``, which any chain of reflections is.

    Attributes
    ----------
    linear : (d, d) array
        Orthogonal matrix; its determinant is -1 for an odd number of reflections.
    shift : (d,) array [m]
    """

    linear: Array
    shift: Array

    @classmethod
    def identity(cls, dimensions: int = 2) -> Isometry:
        """The map that leaves every point where it is."""
        return cls(np.eye(dimensions), np.zeros(dimensions))

    @classmethod
    def reflection(cls, on_mirror: ArrayLike, normal: ArrayLike) -> Isometry:
        """Reflection in the line or plane through `on_mirror` with unit `normal`."""
        normal = np.asarray(normal, dtype=float)
        linear = np.eye(normal.size) - 2.0 * np.outer(normal, normal)
        return cls(linear, 2.0 * float(np.dot(on_mirror, normal)) * normal)

    def __call__(self, points: ArrayLike) -> Array:
        """Map points (..., d) [m]."""
        return np.asarray(points, dtype=float) @ self.linear.T + self.shift

    def __matmul__(self, other: Isometry) -> Isometry:
        """``(a @ b)(p) == a(b(p))``."""
        return Isometry(self.linear @ other.linear, self.linear @ other.shift + self.shift)

    @property
    def inverse(self) -> Isometry:
        """The map that undoes this one."""
        return Isometry(self.linear.T, -self.linear.T @ self.shift)


def cross2(a: ArrayLike, b: ArrayLike) -> Array:
    """The z component of the cross product of 2D vectors, shape (...)."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def crossing(origin: ArrayLike, targets: ArrayLike, start: ArrayLike, end: ArrayLike) -> tuple[Array, Array]:
    """Where the rays origin -> target, (..., 2) [m], meet the line through start and end (2,) [m].

    Returns two fractions (...): of the way from origin to target, below 1 if the line is met before the target; and of
    the way from start to end, in [0, 1] if the segment itself is met. Both are infinite for rays parallel to the line.
    """
    origin, start = np.asarray(origin, dtype=float), np.asarray(start, dtype=float)
    ray = np.asarray(targets, dtype=float) - origin
    span = np.asarray(end, dtype=float) - start
    to_start = start - origin
    with np.errstate(divide="ignore", invalid="ignore"):
        denominator = cross2(ray, span)
        along_ray = np.where(denominator == 0.0, np.inf, cross2(to_start, span) / denominator)
        along_segment = np.where(denominator == 0.0, np.inf, cross2(to_start, ray) / denominator)
    return along_ray, along_segment


def circle_crossings(offset: Array, rays: Array, radius: float, square: Array | float = 1.0) -> tuple[Array, Array]:
    """How far along rays (n, d) the near and the far side of a circle or a sphere are met, (n,) each; NaN if missed.

    They are the roots t of ``|o + t v|^2 = R^2``, with the offset o (d,) [m] of the common origin of the rays from the
    middle, the radius R [m], and the rays v of length one. For others, `square` (n,) must be ``|v|^2``.
    """
    half = rays @ offset
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(half**2 - square * (offset @ offset - radius**2))
        return (-half - root) / square, (-half + root) / square


def place(value: ArrayLike, name: str) -> Array:
    """A place given by two or three coordinates [m], as three; the third is then zero.

    Raises
    ------
    InputError
        If the value is no such place.
    """
    expect_unit(name, value, "m")
    try:
        point = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        point = np.empty(0)
    if point.shape not in ((2,), (3,)) or not np.isfinite(point).all():
        raise InputError(
            f"{name} is {in_message(value)}, expected two or three finite coordinates in metres, for example (0, 1.5)"
        )
    return np.array([*point, 0.0][:3])
