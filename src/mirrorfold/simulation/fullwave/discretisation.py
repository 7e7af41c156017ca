"""Nodes on the contours, and the matrix that turns their currents into the field on the contours.

The electric-field integral equation with E along the axis is ``sum_j H0^(2)(k r_ij) I_j = -E_i``, for the currents
``I_j = J_j w_j`` of nodes that are uniform in a parameter t; w_j is the arc length that node j represents. The
logarithmic singularity of the kernel is integrated to fifth order by the zeta-corrected trapezoidal rule (Wu and
Martinsson, Adv. Comput. Math. 47, 45, 2021). The matrix stays complex symmetric. Its diagonal is

``A_ii = 1 - (2j / pi) (ln(k w_i / (4 pi)) + gamma)``, to which ``-(2j / pi) zeta'(-2) (1, -2, 1) J0(k r)`` is added on
and beside the diagonal. At an open end the current grows as ``1 / sqrt(s)``. There the arc length s is an even function
of t, and the sum is continued to both signs of t, so that the neighbour of the first node across the end is that node
itself. Towards a sharp vertex ``s ~ t^p``.
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
"""Power of t with which the arc length grows from an open end and from a sharp vertex."""

OPEN_REACH, VERTEX_REACH = 0.5, 0.5
"""Length scale of the grading of the nodes towards an open end and towards a sharp vertex [wavelengths]."""

FINEST = 5.0
"""Least number of steps of t on that length scale."""

SHORTEST_ARM = 14.0
"""Least length of an arm over that length scale, so that the gradings at its two ends do not overlap; on a shorter arm
the scale is reduced."""

DIFFERENCE = 1e-3
"""Step of the finite difference that gives the curvature, over the step that resolves the shape of the arm."""

GAUSS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Nodes and weights of the quadrature that gives the arc length of each cell."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """The discretised contours.

    Attributes
    ----------
    position : (n, 2) array [m]
    weight : (n,) array [m]
        Arc length that each node represents.
    before, after : (n,) arrays of int
        Numbers of the neighbours along the contour: -1 beside a vertex, the node itself at an open end.
    arm, surface : (n,) arrays of int
        Number of the arm and of the surface that each node belongs to.
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

    # The members below make the nodes an equation for the solver, with one unknown per node: the integral equation of
    # conductors with E along the axis. `Boundaries` is the equation of all other scenes.

    @property
    def nodes(self) -> Nodes:
        """These nodes."""
        return self

    @cached_property
    def node(self) -> Indices:
        """Number of the node of each unknown."""
        return np.arange(self.size)

    def unknowns_at(self, nodes: Indices) -> Indices:
        """Numbers of the unknowns of nodes: their currents, with the numbers of the nodes."""
        return nodes

    def refraction(self, surface: int, k: float) -> float:
        """Refractive index inside a surface: 1, as a conductor has no inside."""
        return 1.0

    def strength(self, surface: int, k: float) -> float:
        """Strength of sources inside a surface over that outside: 1, as a conductor has no inside."""
        return 1.0

    def order(self, surface: int) -> Indices:
        """Nodes of a surface in the order in which the surface is divided into groups: along the contour."""
        return np.flatnonzero(self.surface == surface)

    def matrix(self, rows: Indices, columns: Indices, k: float) -> Complex:
        """Block of the matrix of the integral equation; see the function `matrix`."""
        return matrix(self, rows, columns, k)

    def at_points(self, points: Array, unknowns: Indices, k: float) -> Complex:
        """Fields of unit currents at points outside, (unknowns, points)."""
        return hankel(self.position[unknowns], points, k)


def discretise(arms: Sequence[Arm], *, wavelength: float, per_wavelength: Sequence[float]) -> Nodes:
    """Place nodes on all arms.

    Parameters
    ----------
    arms : sequence of Arm
    wavelength : float [m]
        Shortest wavelength of the band.
    per_wavelength : sequence of float
        Number of nodes per wavelength of arc length on each arm.
    """
    positions, weights, before, after, owner, normals, curvatures = [], [], [], [], [], [], []
    count = 0
    for index, (arm, density) in enumerate(zip(arms, per_wavelength, strict=True)):
        place, position, weight = _nodes_of(arm, wavelength, density)
        normal, curvature = _normals_and_curvature(arm, place)
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


def _normals_and_curvature(arm: Arm, place: Array) -> tuple[Array, Array]:
    """Unit normals (n, 2), to the right, and curvature (n,) [1/m] of an arm at the parameters `place` (n,)."""
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
    """Midpoint nodes that are uniform in t: their arc length s [m], its derivative s', and the step of t.

    ``s'(t) = tanh(t / a)^(p-1) + tanh((T - t) / b)^(q-1) - 1`` for t from 0 to T, with the length scales a, b and the
    powers p, q of the two ends.
    """
    (a, p), (b, q) = (
        (min(wavelength * reach, length / SHORTEST_ARM), power) for reach, power in ((_GRADING[end]) for end in ends)
    )
    duration = length + a * _lag_behind(p) + b * _lag_behind(q)
    count = math.ceil(duration / min(spacing, a / FINEST, b / FINEST))
    step = duration / count
    t = (np.arange(count) + 0.5) * step
    rest = t[::-1]
    s = a * _integral(p, t / a) + b * (_integral(q, duration / b) - _integral(q, rest / b)) - t
    slope = np.tanh(t / a) ** (p - 1) + np.tanh(rest / b) ** (q - 1) - 1.0
    return s, slope, step


_GRADING = {"open": (OPEN_REACH, OPEN_POWER), "vertex": (VERTEX_REACH, VERTEX_POWER)}


def _integral(power: int, x: ArrayLike) -> Array:
    """Integral of ``tanh(x)^(power - 1)`` from 0 to x, for the powers 2, 3 and 4."""
    x = np.asarray(x, dtype=float)
    log_cosh = np.logaddexp(x, -x) - math.log(2.0)
    if power == 2:
        return np.asarray(log_cosh)
    if power == 3:
        return np.asarray(x - np.tanh(x))
    return np.asarray(log_cosh - 0.5 * np.tanh(x) ** 2)


def _lag_behind(power: int) -> float:
    """Limit of ``x - _integral(power, x)`` for large x."""
    return {2: math.log(2.0), 3: 1.0, 4: math.log(2.0) + 0.5}[power]


def matrix(nodes: Nodes, rows: Indices, columns: Indices, k: float) -> Complex:
    """Block of the matrix of the integral equation.

    Parameters
    ----------
    nodes : Nodes
    rows, columns : (n,) and (m,) arrays of int
        Numbers of nodes, each at most once.
    k : float [rad/m]
        Wavenumber.

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
    """Replace the diagonal of a block of the matrix, and correct the elements of neighbouring nodes.

    `place` (nodes,) is the column of each node in the block, or -1.
    """
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
