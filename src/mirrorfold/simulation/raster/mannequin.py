"""Mesh of a human body, made of round cones and ellipsoids that are joined smoothly.

Proportions are those of an average adult (Drillis and Contini, Body segment parameters, 1966) as shares of the height.
The surface is the zero level of a signed distance, found by marching cubes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.simulation.raster.caster import NOT_INSTALLED

CELL = 0.010
"""Step of the marching cubes [m]: the triangles of a limb of 4 cm radius then deviate from it by less than 0.3 mm."""

BLEND = 0.022
"""Length [m] over which neighbouring parts blend into each other."""


def round_cone(points: Array, start: Array, end: Array, first: float, last: float) -> Array:
    """Signed distance [m] of points (..., 3) from the hull of two spheres: radius `first` at start, `last` at end.

    The foot point on the axis is shifted by the slope of the cone, which makes the distance exact on the lateral
    surface.
    """
    span = end - start
    length = float(np.linalg.norm(span))
    axis = span / length
    offset = points - start
    along = offset @ axis
    aside = np.linalg.norm(offset - along[..., None] * axis, axis=-1)
    slope = (first - last) / length
    foot = np.clip(along + aside * slope / np.sqrt(max(1.0 - slope**2, 1e-6)), 0.0, length)
    return np.asarray(np.hypot(along - foot, aside) - (first + (last - first) * foot / length))


def ellipsoid(points: Array, center: Array, radii: Array) -> Array:
    """Signed distance [m] of points (..., 3) from an ellipsoid, exact to first order near its surface."""
    scaled = np.linalg.norm((points - center) / radii, axis=-1)
    gradient = np.linalg.norm((points - center) / radii**2, axis=-1)
    return np.asarray(scaled * (scaled - 1.0) / np.maximum(gradient, 1e-9))


def smooth_minimum(a: Array, b: Array, blend: float) -> Array:
    """The smaller of two distances, rounded by a quadratic where they differ by less than `blend` [m]."""
    overlap = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(np.minimum(a, b) - 0.25 * blend * overlap**2)


def _parts(
    height: float, arms: tuple[float, float], elbows: tuple[float, float], stride: float
) -> tuple[list[tuple[Array, Array, float, float]], list[tuple[Array, Array]]]:
    """Round cones (start, end, radii) and ellipsoids (center, radii) [m] of the body; x right, y ahead, z up."""

    def at(x: float, y: float, z: float) -> Array:
        return height * np.array([x, y, z])

    cones = [
        (at(0, 0.004, 0.81), at(0, 0.012, 0.885), 0.034 * height, 0.032 * height),  # neck
        (at(-0.085, 0, 0.79), at(0.085, 0, 0.79), 0.042 * height, 0.042 * height),  # shoulders
    ]
    ellipsoids = [
        (at(0, 0.012, 0.932), at(0.047, 0.057, 0.068)),  # head
        (at(0, 0.062, 0.915), at(0.012, 0.016, 0.018)),  # nose
        (at(0, 0, 0.715), at(0.098, 0.066, 0.125)),  # chest
        (at(0, 0, 0.60), at(0.082, 0.056, 0.10)),  # belly
        (at(0, -0.004, 0.515), at(0.095, 0.064, 0.068)),  # hips
    ]
    for side, lift, bend, swing in ((-1.0, arms[0], elbows[0], 1.0), (1.0, arms[1], elbows[1], -1.0)):
        lifted, bent, step = np.radians(lift), np.radians(bend), np.radians(swing * stride)
        shoulder = at(side * 0.118, 0, 0.79)
        down = np.array([side * np.sin(lifted), 0.0, -np.cos(lifted)])
        elbow = shoulder + 0.172 * height * down
        ahead = np.cos(bent) * down + np.sin(bent) * np.array([0.0, 1.0, 0.0])
        wrist = elbow + 0.146 * height * ahead
        cones += [
            (shoulder, elbow, 0.033 * height, 0.026 * height),
            (elbow, wrist, 0.026 * height, 0.018 * height),
            (wrist, wrist + 0.075 * height * ahead, 0.021 * height, 0.015 * height),
        ]
        hip = at(side * 0.052, 0, 0.505)
        leg = np.array([side * 0.06, np.sin(step), -np.cos(step)])
        knee = hip + 0.235 * height * leg
        # The shank leans outward less than the thigh does; without a stride the sole is on the ground.
        ankle = knee + 0.226 * height * np.array([side * 0.04, np.sin(0.6 * step), -np.cos(0.6 * step)])
        toe = ankle + at(side * 0.012, 0.105, -0.018)
        cones += [
            (hip, knee, 0.050 * height, 0.035 * height),
            (knee, ankle, 0.034 * height, 0.023 * height),
            (ankle + at(0, -0.015, -0.014), toe, 0.024 * height, 0.018 * height),
        ]
    return cones, ellipsoids


@lru_cache(maxsize=32)
def mannequin_mesh(
    height: float, arms: tuple[float, float], elbows: tuple[float, float], stride: float
) -> tuple[Array, NDArray[np.int64]]:
    """Watertight mesh of a body in its own frame: standing on z = 0, looking along +y.

    Parameters
    ----------
    height : float [m]
    arms, elbows, stride : angles [degree]
        As in `mirrorfold.scenes.solids.Mannequin`.

    Returns
    -------
    vertices : (v, 3) array [m]
    faces : (f, 3) array of int
        Vertices of each triangle, counter-clockwise seen from outside.

    Raises
    ------
    InputError
        If scikit-image is not installed.
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError:
        raise InputError(NOT_INSTALLED) from None
    cones, ellipsoids = _parts(height, arms, elbows, stride)
    spheres: list[tuple[Array, Array]] = [
        (end, np.full(3, radius)) for a, b, first, last in cones for end, radius in ((a, first), (b, last))
    ]
    low = np.min([center - radius for center, radius in [*spheres, *ellipsoids]], axis=0) - 2 * CELL
    high = np.max([center + radius for center, radius in [*spheres, *ellipsoids]], axis=0) + 2 * CELL
    shape = tuple(np.ceil((high - low) / CELL).astype(int) + 1)
    far = 4.0 * CELL + BLEND
    distance = np.full(shape, far)

    def join(first_corner: Array, last_corner: Array, shape_of: Callable[[Array], Array]) -> None:
        """Blend one part, with the distance function `shape_of`, into `distance` within the box of these corners."""
        box = tuple(
            slice(max(int((a - o) / CELL), 0), int((b - o) / CELL) + 2)
            for a, b, o in zip(first_corner, last_corner, low, strict=True)
        )
        index = np.stack(np.meshgrid(*(np.arange(n)[s] for n, s in zip(shape, box, strict=True)), indexing="ij"), -1)
        here = shape_of(low + CELL * index)
        distance[box] = smooth_minimum(distance[box], np.minimum(here, far), BLEND)

    for start, end, first, last in cones:
        reach = max(first, last) + far
        part = partial(round_cone, start=start, end=end, first=first, last=last)
        join(np.minimum(start, end) - reach, np.maximum(start, end) + reach, part)
    for center, radii in ellipsoids:
        join(center - radii - far, center + radii + far, partial(ellipsoid, center=center, radii=radii))
    vertices, faces, _, _ = marching_cubes(distance, 0.0, spacing=(CELL,) * 3, gradient_direction="descent")
    vertices = vertices + low
    vertices[:, 2] -= vertices[:, 2].min()
    vertices *= height / vertices[:, 2].max()
    return vertices.astype(float), faces.astype(np.int64)
