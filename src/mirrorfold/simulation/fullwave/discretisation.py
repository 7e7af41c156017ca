"""Nodes on the contours, and the matrix that turns their currents into the field on them.

The electric-field integral equation with E along the axis, ``sum_j H0^(2)(k r_ij) I_j = -E_i``, for the currents
``I_j = J_j w_j`` of nodes uniform in a parameter t. The logarithm in the kernel is integrated to fifth order by the
zeta-corrected trapezoidal rule (Wu and Martinsson, Adv. Comput. Math. 47, 45, 2021), which leaves the matrix complex
symmetric:

``A_ii = 1 - (2j / pi) (ln(k w_i / (4 pi)) + gamma)``, and ``-(2j / pi) zeta'(-2) (1, -2, 1) J0(k r)`` around the
diagonal. At an open end, where the current grows as ``1 / sqrt(s)``, the arc length s is even in t and the sum is that
over both signs of t, so that the neighbour across the end is the node itself. Towards a sharp vertex ``s ~ t^p``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.special import zeta

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.simulation.fullwave.contours import Arm, End
from mirrorfold.simulation.fullwave.kernel import _fill, hankel

Complex = NDArray[np.complex64]
Indices = NDArray[np.int64]

ZETA = -float(zeta(3)) / (4.0 * math.pi**2)
"""Derivative of Riemann's zeta function at -2."""

OPEN_POWER, VERTEX_POWER = 2, 4
"""Power of t with which the arc length begins at an open end and at a sharp vertex."""

OPEN_REACH, VERTEX_REACH = 0.5, 0.5
"""Length scale of the grading [wavelengths]."""

FINEST = 5.0
"""Least number of nodes on that scale."""

SHORTEST_ARM = 14.0
"""Length of an arm over that scale, at least: the gradings of both ends then do not feel each other."""

DIFFERENCE = 1e-3
"""Step of the difference that gives the curvature, over that which resolves the shape."""

GAUSS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True, eq=False)
class Nodes:
    """The discretised contours.

    Attributes
    ----------
    position : (n, 2) array [m]
    weight : (n,) array [m]
        Arc length that each node stands for.
    before, after : (n,) arrays of int
        Neighbours along the contour: -1 where there is none, the node itself at an open end.
    arm : (n,) array of int
    surface : (n,) array of int
    normal : (n, 2) array
        Unit normals, to the right of the direction of travel: outward where the contour is counter-clockwise.
    curvature : (n,) array [1/m]
        Positive where the contour bends away from the normal, as a circle does.
    """

    position: Array
    weight: Array
    before: Indices
    after: Indices
    arm: Indices
    surface: Indices
    normal: Array
    curvature: Array

    @cached_property
    def coordinates(self) -> tuple[Array, Array]:
        """The positions as two contiguous (n,) arrays x and y [m]."""
        return np.ascontiguousarray(self.position[:, 0]), np.ascontiguousarray(self.position[:, 1])

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.weight)

    # What follows makes nodes an equation of their own, with one unknown each; see `boundaries` for others.

    @property
    def nodes(self) -> Nodes:
        """These nodes."""
        return self

    @cached_property
    def node(self) -> Indices:
        """The node of each unknown."""
        return np.arange(self.size)

    def unknowns_at(self, nodes: Indices) -> Indices:
        """The unknowns of nodes: their currents."""
        return nodes

    def refraction(self, surface: int, k: float) -> float:
        """How many times shorter waves are inside a surface than outside: there is no inside."""
        return 1.0

    def strength(self, surface: int, k: float) -> float:
        """How many times stronger sources are inside a surface than outside, likewise."""
        return 1.0

    def order(self, surface: int) -> Indices:
        """The nodes of a surface in the order in which it is cut into groups: along the contour."""
        return np.flatnonzero(self.surface == surface)

    def matrix(self, rows: Indices, columns: Indices, k: float) -> Complex:
        """Part of the matrix of the integral equation; see the function `matrix`."""
        return matrix(self, rows, columns, k)

    def at_points(self, points: Array, unknowns: Indices, k: float) -> Complex:
        """Waves of unit currents at points outside, (unknowns, points)."""
        return hankel(self.position[unknowns], points, k)


def discretise(arms: Sequence[Arm], *, wavelength: float, per_wavelength: Sequence[float]) -> Nodes:
    """Nodes on all arms.

    Parameters
    ----------
    arms : sequence of Arm
    wavelength : float [m]
        The shortest one of the band.
    per_wavelength : sequence of float
        Nodes per wavelength of arc length, of each arm.
    """
    positions, weights, before, after, owner, normals, curvatures = [], [], [], [], [], [], []
    count = 0
    for index, (arm, density) in enumerate(zip(arms, per_wavelength, strict=True)):
        place, position, weight = _nodes_of(arm, wavelength, density)
        normal, curvature = _bending(arm, place)
        normals.append(normal)
        curvatures.append(curvature)
        number = count + np.arange(len(weight))
        outer = {"open": (number[0], number[-1]), "closed": (number[-1], number[0]), "vertex": (-1, -1)}
        positions.append(position)
        weights.append(weight)
        before.append(np.append(outer[arm.ends[0]][0], number[:-1]))
        after.append(np.append(number[1:], outer[arm.ends[1]][1]))
        owner.append(np.full(len(weight), index))
        count += len(weight)
    arm_of_node = np.concatenate(owner)
    return Nodes(
        position=np.concatenate(positions),
        weight=np.concatenate(weights),
        before=np.concatenate(before),
        after=np.concatenate(after),
        arm=arm_of_node,
        surface=np.array([arm.surface for arm in arms])[arm_of_node],
        normal=np.concatenate(normals),
        curvature=np.concatenate(curvatures),
    )


def _bending(arm: Arm, place: Array) -> tuple[Array, Array]:
    """Unit normals (n, 2), to the right, and curvature (n,) [1/m] of an arm at parameters."""
    step = DIFFERENCE * arm.cell
    tangents = [arm.shape(np.clip(place + shift, 0.0, arm.length))[1] for shift in (-step, 0.0, step)]
    speed = np.linalg.norm(tangents[1], axis=1)
    directions = [tangent / np.linalg.norm(tangent, axis=1)[:, None] for tangent in tangents]
    normal = np.stack([directions[1][:, 1], -directions[1][:, 0]], axis=1)
    run = np.clip(place + step, 0.0, arm.length) - np.clip(place - step, 0.0, arm.length)
    return normal, -np.sum((directions[2] - directions[0]) * normal, axis=1) / (run * speed)


def _nodes_of(arm: Arm, wavelength: float, per_wavelength: float) -> tuple[Array, Array, Array]:
    """Parameters (n,), positions (n, 2) [m] and weights (n,) [m] of the nodes of one arm."""
    cells = max(32, math.ceil(arm.length / arm.cell))
    u = np.linspace(0.0, arm.length, cells + 1)
    inner = (u[:-1, None] + 0.5 * (GAUSS + 1.0) * (u[1] - u[0])).ravel()
    speed = np.linalg.norm(arm.shape(inner)[1], axis=1).reshape(cells, -1)
    s = np.concatenate([[0.0], np.cumsum(speed @ GAUSS_WEIGHTS * 0.5 * (u[1] - u[0]))])
    closed = arm.ends[0] == "closed"
    if closed:  # u(s) - s is periodic, u(s) is not
        ratio = arm.length / s[-1]
        wobble = CubicSpline(s, np.append((u - ratio * s)[:-1], 0.0), bc_type="periodic")
        count = max(8, math.ceil(s[-1] / wavelength * per_wavelength))
        step = s[-1] / count
        along = (np.arange(count) + 0.5) * step
        place, stretch = ratio * along + wobble(along), (ratio + wobble(along, 1)) * step
    else:
        inverse = CubicSpline(s, u)
        along, slope, step = _graded(float(s[-1]), arm.ends, wavelength, wavelength / per_wavelength)
        place, stretch = inverse(along), inverse(along, 1) * slope * step
    position, derivative = arm.shape(place)
    return place, position, np.linalg.norm(derivative, axis=1) * stretch


def _graded(length: float, ends: tuple[End, End], wavelength: float, spacing: float) -> tuple[Array, Array, float]:
    """Midpoint nodes uniform in t: their arc length s, its derivative, and the step of t.

    ``s'(t) = tanh(t / a)^(p-1) + tanh((T - t) / b)^(q-1) - 1``
    """
    (a, p), (b, q) = (
        (min(wavelength * reach, length / SHORTEST_ARM), power) for reach, power in ((_GRADING[end]) for end in ends)
    )
    duration = length + a * _lag(p) + b * _lag(q)
    count = math.ceil(duration / min(spacing, a / FINEST, b / FINEST))
    step = duration / count
    t = (np.arange(count) + 0.5) * step
    rest = t[::-1]
    s = a * _integral(p, t / a) + b * (_integral(q, duration / b) - _integral(q, rest / b)) - t
    slope = np.tanh(t / a) ** (p - 1) + np.tanh(rest / b) ** (q - 1) - 1.0
    return s, slope, step


_GRADING = {"open": (OPEN_REACH, OPEN_POWER), "vertex": (VERTEX_REACH, VERTEX_POWER)}


def _integral(power: int, x: ArrayLike) -> Array:
    """Integral of ``tanh(x)^(power - 1)`` from 0."""
    x = np.asarray(x, dtype=float)
    log_cosh = np.logaddexp(x, -x) - math.log(2.0)
    if power == 2:
        return np.asarray(log_cosh)
    if power == 3:
        return np.asarray(x - np.tanh(x))
    return np.asarray(log_cosh - 0.5 * np.tanh(x) ** 2)


def _lag(power: int) -> float:
    """How far that integral falls behind x."""
    return {2: math.log(2.0), 3: 1.0, 4: math.log(2.0) + 0.5}[power]


def matrix(nodes: Nodes, rows: Indices, columns: Indices, k: float) -> Complex:
    """Part of the matrix of the integral equation.

    Parameters
    ----------
    nodes : Nodes
    rows, columns : (n,) and (m,) arrays of int
        Numbers of nodes, each at most once.
    k : float [rad/m]

    Returns
    -------
    (n, m) complex64 array
    """
    x, y = nodes.coordinates
    out = np.empty((len(rows), len(columns)), dtype=np.complex64)
    _fill(x[rows], y[rows], x[columns], y[columns], k, out)
    place = np.full(nodes.size, -1)
    place[columns] = np.arange(len(columns))
    _correct(rows, place, nodes.before, nodes.after, x, y, nodes.weight, k, out)
    return out


@njit(error_model="numpy", nogil=True)
def _correct(
    rows: Indices,
    place: Indices,
    before: Indices,
    after: Indices,
    x: Array,
    y: Array,
    weight: Array,
    k: float,
    out: Complex,
) -> None:
    """Replace the diagonal and add the correction of the neighbours; `place` is the column of each node or -1."""
    correction = complex(0.0, -2.0 / math.pi * ZETA)
    for i in range(rows.size):
        node = rows[i]
        column = place[node]
        if column >= 0:
            logarithm = math.log(k * weight[node] / (4.0 * math.pi)) + np.euler_gamma
            out[i, column] = complex(1.0, -2.0 / math.pi * logarithm) - 2.0 * correction
        for neighbour in (before[node], after[node]):
            if neighbour < 0 or place[neighbour] < 0:
                continue
            square = 0.25 * k * k * ((x[node] - x[neighbour]) ** 2 + (y[node] - y[neighbour]) ** 2)
            # J0 by three terms of its power series: neighbours are less than a radian apart.
            out[i, place[neighbour]] += correction * (1.0 - square + 0.25 * square**2 - square**3 / 36.0)
