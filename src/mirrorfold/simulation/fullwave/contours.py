"""The contours of a scene, divided at sharp vertices into smooth arms.

An arm is a twice differentiable curve between open ends or sharp vertices, or a closed curve. A rough surface is its
smooth outline, displaced along the normal by a random profile.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Arc, Circle, Curve, Polyline, Roughness, Segment, Surface
from mirrorfold.simulation.fullwave.roughness import CELLS, rough_heights
from mirrorfold.simulation.fullwave.slabs import SmoothShape, slab_outline

End = Literal["open", "vertex", "closed"]
Shape = Callable[[Array], tuple[Array, Array]]

VERTEX_DEGREES = 1.0
"""Smallest turn of a polyline at a vertex: pieces that meet at a smaller angle count as one straight piece."""

STEEPEST_BEND = 0.5
"""Largest product of roughness height and curvature: at 1 the displaced curve would have a cusp."""

TAPER = 2.0
"""Scale of the taper near sharp vertices: at the distance d heights are multiplied by ``1 - exp(-(d / (TAPER L))^2)``,
with the correlation length L, so that both arms meet at the vertex."""


@dataclass(frozen=True, eq=False)
class Arm:
    """One smooth curve.

    Attributes
    ----------
    surface : int
        Number of the surface that the arm belongs to.
    shape : callable
        Position (n, 2) [m] and its derivative as functions of the parameter (n,), which runs from 0 to `length`.
    length : float [m]
        Length of the smooth outline, without roughness.
    cell : float [m]
        Step of the parameter that resolves the shape.
    ends : pair of "open", "vertex" or "closed"
        Kind of the first and of the last end. A vertex is shared with the arm before or after this one, in the order of
        the list; for a closed polyline, also with the last or the first of its arms.
    """

    surface: int
    shape: Shape
    length: float
    cell: float
    ends: tuple[End, End]


def outline_length(surface: Surface) -> float:
    """Length of a surface without its roughness [m]."""
    return sum(length for _, length, _, _ in _outline(surface))


def is_slab(surface: Surface) -> bool:
    """Whether a surface is a dielectric body: a straight wall with a thickness."""
    return isinstance(surface, Segment) and surface.thickness is not None


def contours(scene: Scene, *, seed: int) -> list[Arm]:
    """The arms of all surfaces of a scene, rough ones with random profiles from the seed.

    Raises
    ------
    InputError
        If a surface is neither a perfect conductor nor a dielectric wall with a thickness, or too rough for its length
        or its curvature.
    """
    arms: list[Arm] = []
    for index, surface in enumerate(scene.surface):
        if not is_slab(surface) and (surface.material != "pec" or surface.volume_depth):
            found = f"material {str(surface.material)!r}" if surface.material != "pec" else "a volume_depth"
            raise InputError(
                f"surface[{index}] {surface.name!r} has {found}, but the full-wave solver takes perfect conductors "
                'alone, and of dielectrics segments with a thickness; set material = "pec" without volume_depth, '
                "give a thickness, or use solver 'rays'"
            )
        # One random generator per surface: a change of another surface does not change the profile of this one.
        generator = np.random.default_rng([seed, index])
        for outline, length, cell, ends in _outline(surface):
            roughness = surface.roughness
            if roughness is None or roughness.rms_height == 0.0:
                arms.append(Arm(index, _position_and_derivative(outline), length, cell, ends))
                continue
            label = f"surface[{index}] {surface.name!r}"
            shape = _displaced(outline, length, ends, roughness, label, generator)
            arms.append(Arm(index, shape, length, min(cell, roughness.correlation_length / CELLS), ends))
    return arms


def _position_and_derivative(outline: SmoothShape) -> Shape:
    """The shape of an arm without roughness: position and first derivative of the outline."""
    return lambda u: outline(u)[:2]


def _outline(surface: Surface) -> list[tuple[SmoothShape, float, float, tuple[End, End]]]:
    """Shape, length, cell and ends of the smooth arms of one surface."""
    if isinstance(surface, Segment) and is_slab(surface):
        return [(*slab_outline(surface, f"surface {surface.name!r}"), ("closed", "closed"))]
    if isinstance(surface, Arc | Circle):
        return [_circular(surface)]
    if isinstance(surface, Curve):
        curve, length = surface.spline()
        cell = length / (4.0 * (len(surface.points) - 1))
        ends: tuple[End, End] = ("closed", "closed") if surface.is_closed else ("open", "open")
        return [(lambda u: (curve(u), curve(u, 1), curve(u, 2)), length, cell, ends)]
    corners = np.array(surface.points if isinstance(surface, Polyline) else [surface.start, surface.end])
    corners = _without_flat_vertices(corners)
    closed = len(corners) > 3 and bool(np.all(corners[0] == corners[-1]))
    last = len(corners) - 2
    arms = []
    for i, (start, end) in enumerate(pairwise(corners)):
        before: End = "vertex" if i > 0 or closed else "open"
        after: End = "vertex" if i < last or closed else "open"
        length = float(np.linalg.norm(end - start))
        arms.append((_straight(start, (end - start) / length), length, length, (before, after)))
    return arms


def _without_flat_vertices(corners: Array) -> Array:
    """The corners (n, 2) of a polyline without those at which it turns by less than `VERTEX_DEGREES`."""
    direction = np.diff(corners, axis=0)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    turn = np.einsum("ij,ij->i", direction[1:], direction[:-1]) < np.cos(np.radians(VERTEX_DEGREES))
    return corners[np.concatenate([[True], turn, [True]])]


def _straight(start: Array, direction: Array) -> SmoothShape:
    """The line from `start` along the unit vector `direction`."""

    def shape(u: Array) -> tuple[Array, Array, Array]:
        along = np.broadcast_to(direction, (len(u), 2))
        return start + u[:, None] * direction, along, np.zeros((len(u), 2))

    return shape


def _circular(surface: Arc | Circle) -> tuple[SmoothShape, float, float, tuple[End, End]]:
    """Shape, length, cell and ends of an arc, counter-clockwise, or of a whole circle."""
    center, radius = np.array(surface.center), surface.radius
    first, last = (0.0, 360.0) if isinstance(surface, Circle) else sorted((surface.start_angle, surface.stop_angle))
    closed = last - first >= 360.0

    def shape(u: Array) -> tuple[Array, Array, Array]:
        angle = np.radians(first) + u / radius
        outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        along = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
        return center + radius * outward, along, -outward / radius

    length = float(np.radians(last - first) * radius)
    return shape, length, radius / 8.0, ("closed", "closed") if closed else ("open", "open")


def _displaced(
    outline: SmoothShape,
    length: float,
    ends: tuple[End, End],
    roughness: Roughness,
    label: str,
    generator: np.random.Generator,
) -> Shape:
    """The shape of an outline displaced along its normal by a random profile."""
    correlation = roughness.correlation_length
    knots, heights = rough_heights(length, roughness, generator=generator, periodic=ends[0] == "closed", label=label)
    for end, distance in ((ends[0], knots), (ends[1], length - knots)):
        if end == "vertex":
            heights = heights * -np.expm1(-((distance / (TAPER * correlation)) ** 2))
    profile = CubicSpline(knots, heights, bc_type="periodic" if ends[0] == "closed" else "not-a-knot")
    _, first, second = outline(knots)
    speed = np.linalg.norm(first, axis=1)
    curvature = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    bend = float(np.max(np.abs(heights) * curvature))
    if bend > STEEPEST_BEND:
        raise InputError(
            f"{label}: roughness of rms_height {roughness.rms_height:g} m is too large for a radius of "
            f"curvature of {1.0 / curvature.max():g} m, heights reach {100 * bend:.0f} % of it; expected at most "
            f"{100 * STEEPEST_BEND:.0f} %, lower rms_height or bend the surface less"
        )

    def rough(u: Array) -> tuple[Array, Array]:
        position, along, bending = outline(u)
        scale = np.linalg.norm(along, axis=1)[:, None]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / scale
        turning = np.stack([-bending[:, 1], bending[:, 0]], axis=1) / scale
        turning -= normal * np.sum(turning * normal, axis=1)[:, None]
        height, slope = profile(u)[:, None], profile(u, 1)[:, None]
        return position + height * normal, along + slope * normal + height * turning

    return rough
