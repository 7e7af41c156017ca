"""Step 2, within the search for curved mirrors: two arcs that pass into each other, fitted as one smooth curve.

The halves of an S share a point and a tangent. Fitted separately, each half has its own direction and curvature there.
Fitted together, each half also profits from what the other one says of their joint.

The curve has five parameters: the joint (x, y) [m], the direction there [rad], and the curvatures [1/m] of the halves
before and behind the joint, positive where the center of the circle lies to the left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.types import Array
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.search.circles import arc_over
from mirrorfold.detection.search.fit import KINK_SHARES, fit_covariance, flat, robust_weights, weighted_fit
from mirrorfold.detection.views.image_view import ImageView

SIGNIFICANT = 4.0
"""Number of standard errors by which the circles of separate halves may cross or miss each other. So the joint fit may
have a sum of squared residuals larger by the share ``SIGNIFICANT^2 / N``, with N the number of independent cells."""

STEP = 1e-4
"""Step of numerical derivatives, as a share of the unit in which a parameter is counted (`scale`)."""

JOINTS = 25
"""Number of places at which the joint of an S is tried, between the `KINK_SHARES` of its length."""

Halves = tuple[ArcMirror, ArcMirror]
Measured = tuple[Array, Array]
"""Centroids of power (n, 2) [m] across an arc, and their weights (n,)."""


def fitted_together(halves: Halves, measured: tuple[Measured, Measured], view: ImageView) -> Halves | None:
    """Two arcs fitted together, with a common end and tangent, to the centroids of power across them.

    None if they are no smooth curve.
    """
    gaps = np.linalg.norm(halves[0].ends[:, None] - halves[1].ends[None], axis=2)
    meet = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    joint = 0.5 * (halves[0].ends[meet[0]] + halves[1].ends[meet[1]])
    along = unit(unit(joint - halves[0].center) + unit(halves[1].center - joint))
    curvatures = [float(np.sign((arc.middle - joint) @ turned(along))) / arc.radius for arc in halves]
    first = np.array([*joint, np.arctan2(along[1], along[0]), *curvatures])
    scale = np.array([1.0, 1.0, *(1.0 / np.array([halves[0].length, *(arc.length**2 for arc in halves)]))])
    points, weight = (np.concatenate(parts) for parts in zip(*measured, strict=True))
    apart = np.concatenate([arc.beside(places) for arc, (places, _) in zip(halves, measured, strict=True)])
    deviation, trust = robust_weights(apart, weight, float(np.finfo(float).eps) * halves[0].radius)
    root = np.sqrt(weight / weight.max()) / (2.0 * deviation)
    curve = least_squares(lambda curve: root * beside(curve, points), first, x_scale=scale, loss="cauchy").x
    if np.cos(curve[2] - first[2]) < 0.0:  # the same curve in the opposite direction
        curve = np.array([*curve[:2], curve[2] + np.pi, -curve[4], -curve[3]])
    off = beside(curve, points)
    independent = sum(arc.independent(view) for arc in halves)
    most = (1.0 + SIGNIFICANT**2 / independent) * (trust @ apart**2)
    if np.any(curve[3:] * first[3:] <= 0.0) or trust @ off**2 > most:
        return None
    design = _slopes(lambda curve: beside(curve, points), curve, scale)
    if not design.any(axis=0).all():  # all points lie on one half, and tell nothing of the other's curvature
        return None
    place = (points - curve[:2]) @ np.array([np.cos(curve[2]), np.sin(curve[2])])
    variance = fit_covariance(design, off, weight, place[:, None], independent)
    one, other = (_half(curve, i, halves[i], halves[i].ends[1 - meet[i]], variance, scale) for i in (0, 1))
    return one, other


def s_shaped(points: Array, weight: Array, radar: Array) -> Halves | None:
    """Two arcs that bend to opposite sides, with a common end and tangent, through a row of points (n, 2) [m].

    Along its chord, the row is fitted by two parabolas whose joint is tried at several places. None if they bend to the
    same side.
    """
    normal, center = flat(points, weight)
    chord = -turned(normal)
    along, beside = (points - center) @ chord, (points - center) @ normal
    least, best = np.inf, None
    for joint in along.min() + np.linspace(*KINK_SHARES, JOINTS) * np.ptp(along):
        design = np.column_stack(
            [np.ones_like(along), along - joint, 0.5 * (along - joint) ** 2, 0.5 * np.maximum(along - joint, 0.0) ** 2]
        )
        curve = weighted_fit(design, beside, weight)
        residual = float(weight @ (beside - design @ curve) ** 2)
        if residual < least:
            least, best = residual, (joint, *curve.tolist())
    if best is None or best[3] * (best[3] + best[4]) >= 0.0:
        return None
    joint, height, slope, before, change = best
    place, way = center + joint * chord + height * normal, unit(chord + slope * normal)
    ends = points[[np.argmin(along), np.argmax(along)]]
    halves = []
    for end, bend in zip(ends, (before, before + change), strict=True):
        # The curvature of a parabola is ``y'' / (1 + y'^2)^(3/2)``.
        curvature = bend / (1.0 + slope**2) ** 1.5
        middle = place + turned(way) / curvature
        halves.append(arc_over(middle, abs(1.0 / curvature), np.stack([end, place]), radar))
    return halves[0], halves[1]


def _half(curve: Array, which: int, arc: ArcMirror, end: Array, variance: Array, scale: Array) -> ArcMirror:
    """The arc of one half of a curve, from the joint to the point nearest to `end` (2,) [m], with its standard errors.

    `which` is 0 for the half before the joint, 1 for that behind it; `variance` (5, 5) is the covariance of the
    parameters of the curve, in units of `scale` (5,).
    """
    towards = turned(np.array([np.cos(curve[2]), np.sin(curve[2])]))
    circle = replace(arc, middle=curve[:2] + towards / curve[3 + which], radius=float(1.0 / abs(curve[3 + which])))
    half = circle.part(*np.sort(circle.along(np.stack([end, curve[:2]]))).tolist())
    reach = 0.25 * half.length
    places = half.center + np.array([[0.0], [-reach], [reach]]) * half.tangents

    def in_middle(curve: Array) -> Array:
        """Offset [m], angle [rad] and curvature [1/m] of a curve in the middle of the half."""
        here, before, behind = beside(curve, places)
        return np.array([here, (behind - before) / (2.0 * reach), curve[3 + which]])

    slopes = _slopes(in_middle, curve, scale)
    return half.with_errors(np.diag(slopes @ variance @ slopes.T))


def beside(curve: Array, points: Array) -> Array:
    """Distance [m] of points (n, 2) from a smooth curve, positive to its left, (n,)."""
    offset = points - curve[:2]
    along = np.array([np.cos(curve[2]), np.sin(curve[2])])
    place, height = offset @ along, offset @ turned(along)
    curvature = np.where(place < 0.0, curve[3], curve[4])
    # ``1 / k`` minus the distance from the center of the circle, in a form that holds down to the curvature k = 0.
    away = np.hypot(1.0 - curvature * height, curvature * place)
    return (2.0 * height - curvature * (height**2 + place**2)) / (1.0 + away)


def _slopes(function: Callable[[Array], Array], curve: Array, scale: Array) -> Array:
    """Derivatives (n, 5) of a function (n,) of a curve by each of its parameters, in units of `scale` (5,)."""
    steps = STEP * np.diag(scale)
    return np.stack([(function(curve + step) - function(curve - step)) / (2.0 * STEP) for step in steps], axis=1)
