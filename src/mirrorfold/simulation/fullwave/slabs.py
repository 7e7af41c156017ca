"""The outline of a slab: two straight faces, and rounded ends whose curvature rises and falls smoothly from zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.surfaces import Segment

SmoothShape = Callable[[Array], tuple[Array, Array, Array]]

KNOTS = 512
"""Number of intervals of the spline that describes a rounded end."""


def _turn(v: Array) -> Array:
    """Share of the half turn completed at the fraction v (0 to 1) of a rounded end.

    Its first two derivatives vanish at both ends.
    """
    return v - np.sin(2.0 * np.pi * v) / (2.0 * np.pi)


def _rounded_end() -> tuple[CubicSpline, float, float]:
    """Shape of a rounded end of a slab of thickness 1, which begins at the origin along +x.

    Returns the position as a function of v, the length of the end, and its depth along x, all over the thickness.
    """
    v = np.linspace(0.0, 1.0, KNOTS + 1)
    middle, half = 0.5 * (v[1:] + v[:-1]), 0.5 / KNOTS
    gauss, weights = np.polynomial.legendre.leggauss(4)
    angle = np.pi * _turn(middle[:, None] + half * gauss)
    steps = half * np.stack([np.cos(angle) @ weights, np.sin(angle) @ weights], axis=1)
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    length = 1.0 / path[-1, 1]
    return CubicSpline(v, length * path), float(length), float(length * path[KNOTS // 2, 0])


ROUNDED, END_LENGTH, END_DEPTH = _rounded_end()
"""Shape of a rounded end, its length along the contour, and its depth along the wall, over the thickness."""


def slab_outline(wall: Segment, label: str) -> tuple[SmoothShape, float, float]:
    """The contour of a wall with a thickness, counter-clockwise from the beginning of its right face.

    The faces lie half of the thickness from the line of the wall; the rounded ends reach to its two ends.

    Parameters
    ----------
    wall : Segment
        With a thickness.
    label : str
        Name of the wall in messages.

    Returns
    -------
    shape : callable
        Position (n, 2) [m] and its first and second derivative as functions of arc length (n,) [m].
    length : float [m]
        Length of the whole contour.
    cell : float [m]
        Step of arc length that resolves the rounded ends.

    Raises
    ------
    InputError
        If the wall is not longer than its rounded ends.
    """
    if wall.thickness is None:
        raise ValueError(f"{label} has no thickness")
    thickness = wall.thickness
    start, end = np.array(wall.start), np.array(wall.end)
    straight = float(np.linalg.norm(end - start)) - 2.0 * END_DEPTH * thickness
    if straight <= 0.0:
        raise InputError(
            f"{label}: a wall of thickness {thickness:g} m has rounded ends, and must be longer than "
            f"{2.0 * END_DEPTH * thickness:.3g} m; lengthen it or make it thinner"
        )
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([-along[1], along[0]])
    rounded = END_LENGTH * thickness
    half = straight + rounded

    def shape(u: Array) -> tuple[Array, Array, Array]:
        # The second half of the contour is the first half, rotated by 180 degrees about the middle of the wall.
        second = np.mod(u, 2.0 * half) >= half
        run = np.mod(u, half)
        v = np.clip((run - straight) / rounded, 0.0, 1.0)
        place = np.stack([np.minimum(run, straight) - 0.5 * straight, np.full(len(u), -0.5 * thickness)], axis=1)
        place += thickness * ROUNDED(v)
        angle = np.pi * _turn(v)
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        bend = (
            np.pi
            / rounded
            * (1.0 - np.cos(2.0 * np.pi * v))[:, None]
            * np.stack([-direction[:, 1], direction[:, 0]], axis=1)
        )
        sign = np.where(second, -1.0, 1.0)[:, None]
        turn = np.stack([along, across])
        return 0.5 * (start + end) + sign * place @ turn, sign * direction @ turn, sign * bend @ turn

    return shape, 2.0 * half, rounded / 16.0
