"""The integral equations of conductors and dielectric bodies together, in either polarization.

The wave u is the field along the axis: E in the polarization "TE" (E perpendicular to the plane of incidence), H in
"TM". With monopoles X and dipoles Y on the contours (`media`), the field outside is ``u = u_inc + sum X H0 + sum Y
d'H0 / k0``.

* **Conductor.** TE: u = 0, monopoles (`discretisation`). TM: du/dn = 0, dipoles. Both serve open contours.
* **Dielectric body** of relative permittivity eps. By Green's theorem ``X = j w u_n / 4`` and ``Y = -j w k0 u / 4`` on
  either side of its contour. u and ``u_n`` (TE) or ``u_n / eps`` (TM) are continuous, so that the field inside is minus
  the wave of Y and b X at the inner wavenumber, with b = 1 (TE) or eps (TM). The limit of u from outside plus b times
  that from inside, and likewise the derivatives without the factor, give with w the weight of a node

  ``(K_0 - K_1)(X, Y) -+ (1 + b) 2j / (w k0) (Y, X) = -(u_inc, du_inc/dn / k0)``,

  where K_1 is the block of `media` at the inner wavenumber for monopoles of the strength b. The strongest singularities
  cancel in the difference, and a second-kind equation remains (Mueller, Foundations of the Mathematical Theory of
  Electromagnetic Waves, 1969; Rokhlin, Wave Motion 5, 257, 1983). Its unique solution follows from Rellich's lemma, and
  with losses from Green's identity, as for Mueller's own weights. These weights leave what any two places do to each
  other symmetric, as it is for conductors: what radiates from a group and what it receives have one skeleton.

Logarithms are integrated as on conductors. The ``1 / r^2`` of dipoles on conductors is integrated in the sense of
Hadamard: the sum over the other nodes less ``pi^2 / 3`` of the node's own term, plus what the sum leaves out of the
regular part, by Taylor's series of the contour and finite differences of the density.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.scenes.materials import Dielectric
from mirrorfold.simulation.fullwave.discretisation import ZETA, Nodes
from mirrorfold.simulation.fullwave.media import Medium, _add, _bessel, medium

Complex = NDArray[np.complex64]
Indices = NDArray[np.int64]
Polarization = Literal["TE", "TM"]
Strengths = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Contours of conductors and of dielectric bodies, with their unknowns.

    Attributes
    ----------
    nodes : Nodes
        Normals of bodies point out of them.
    inside : tuple of Dielectric or None
        What each surface encloses; None for conductors.
    polarization : {"TE", "TM"}
    """

    nodes: Nodes
    inside: tuple[Dielectric | None, ...]
    polarization: Polarization

    @cached_property
    def _is_body(self) -> NDArray[np.bool_]:
        """Whether each node belongs to a dielectric body."""
        return np.array([material is not None for material in self.inside])[self.nodes.surface]

    @cached_property
    def _first(self) -> Indices:
        """Number of the first unknown of each node, and of all unknowns at the end: (nodes + 1,)."""
        return np.concatenate([[0], np.cumsum(np.where(self._is_body, 2, 1))])

    @cached_property
    def node(self) -> Indices:
        """The node of each unknown."""
        return np.repeat(np.arange(self.nodes.size), np.diff(self._first))

    @cached_property
    def dipole(self) -> NDArray[np.bool_]:
        """Whether each unknown is a dipole: the second one of a body's node, the one of a conductor's in TM."""
        second = np.arange(self.size) > self._first[self.node]
        return np.where(self._is_body[self.node], second, self.polarization == "TM")

    @cached_property
    def _sources(self) -> tuple[Array, ...]:
        """Coordinates, monopole and dipole moments of the unknowns: arguments of `media._add`."""
        x, y = self.nodes.coordinates
        normal = np.where(self.dipole[:, None], self.nodes.normal[self.node], 0.0).astype(np.float32)
        moments = (~self.dipole).astype(np.float32)
        return x[self.node], y[self.node], moments, np.ascontiguousarray(normal[:, 0]), np.ascontiguousarray(normal[:, 1])

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._first[-1])

    @property
    def digest(self) -> tuple[Array, ...]:
        """What the results depend on beside the nodes: normals, materials and polarization as numbers."""
        materials = [(m.a, m.b, m.c, m.d) if m else (0.0, 0.0, 0.0, 0.0) for m in self.inside]
        return self.nodes.normal, np.array(materials), np.array([self.polarization == "TM"])

    def unknowns_at(self, nodes: Indices) -> Indices:
        """All unknowns of nodes, node by node."""
        first, count = self._first[nodes], np.diff(self._first)[nodes]
        both = np.stack([first, first + 1], axis=1)
        return both[np.arange(2) < count[:, None]]

    def refraction(self, surface: int, k: float) -> float:
        """How many times shorter waves are inside a surface, at most, than outside."""
        permittivity = self._permittivity(surface, k)
        return 1.0 if permittivity is None else max(1.0, abs(np.sqrt(permittivity)))

    def order(self, surface: int) -> Indices:
        """The nodes of a surface in the order in which it is cut into groups.

        A conductor is followed along its contour. A body is cut across: both faces of a slab, which see each other, in
        one group.
        """
        members = np.flatnonzero(self.nodes.surface == surface)
        if self.inside[surface] is None:
            return members
        place = self.nodes.position[members] - self.nodes.position[members].mean(axis=0)
        axis = np.linalg.svd(place, full_matrices=False)[2][0]
        return members[np.argsort(place @ axis, kind="stable")]

    def matrix(self, rows: Indices, columns: Indices, k: float) -> Complex:
        """Part of the matrix of the equations; see `discretisation.matrix`."""
        out = self._block(self._sources, rows, columns, medium(k), 1.0 + 0.0j, 1.0)
        surface = self.nodes.surface[self.node]
        of_columns, of_rows = surface[columns], surface[rows]
        strength, inner = self._inside(k)
        for body in np.unique(of_columns):
            some_rows, some_columns = np.flatnonzero(of_rows == body), np.flatnonzero(of_columns == body)
            if self.inside[body] is not None and len(some_rows):
                within = medium(k, complex(self._permittivity(body, k)))
                b = complex(strength[body])
                part = self._block(self._sources, rows[some_rows], columns[some_columns], within, b, -1.0)
                out[np.ix_(some_rows, some_columns)] += part
        place = np.full(self.size, -1)
        place[columns] = np.arange(len(columns))
        nodes = self.nodes
        x, y = nodes.coordinates
        outline = (nodes.before, nodes.after, x, y, nodes.normal, nodes.weight, nodes.curvature, nodes.surface)
        _correct(rows, place, self.node, self.dipole, self._first, *outline, strength, inner, float(k), out)
        return out

    def at_points(self, points: Array, unknowns: Indices, k: float, *, body: int | None = None) -> Complex:
        """Waves of unknowns at points outside all bodies, or inside one, (unknowns, points)."""
        here = np.asarray(points, dtype=float)
        x, y = np.ascontiguousarray(here[:, 0]), np.ascontiguousarray(here[:, 1])
        none, one = np.zeros(len(here), np.float32), np.ones(len(here), np.float32)
        within, strength, sign = medium(k), 1.0 + 0.0j, 1.0
        if body is not None:
            within, strength, sign = medium(k, complex(self._permittivity(body, k))), complex(self._inside(k)[0][body]), -1.0
            unknowns = np.where(self.nodes.surface[self.node[unknowns]] == body, unknowns, -1)
        tests = (x, y, one, none, none)
        sources = tuple(part[unknowns] for part in self._sources)
        return np.ascontiguousarray(_waves(tests, sources, within, strength, sign).T)

    def _block(self, parts: tuple[Array, ...], rows: Indices, columns: Indices, within: Medium, b: complex, sign: float) -> Complex:
        """Waves of the unknowns of columns at those of rows, in one medium."""
        return _waves(tuple(p[rows] for p in parts), tuple(p[columns] for p in parts), within, b, sign)

    def _permittivity(self, surface: int, k: float) -> complex | None:
        """Relative permittivity of what a surface encloses, at a wavenumber of free space [rad/m]."""
        material = self.inside[surface]
        return None if material is None else complex(material.permittivity(k * speed_of_light / (2.0 * np.pi)))

    def _inside(self, k: float) -> tuple[Strengths, Strengths]:
        """The b of each surface and its inner wavenumber, zero for conductors."""
        permittivity = [self._permittivity(surface, k) for surface in range(len(self.inside))]
        strength = [1.0 if eps is None or self.polarization == "TE" else eps for eps in permittivity]
        inner = [0.0 if eps is None else medium(k, eps).k for eps in permittivity]
        return np.array(strength, dtype=complex), np.array(inner, dtype=complex)


def _waves(tests: tuple[Array, ...], sources: tuple[Array, ...], within: Medium, strength: complex, sign: float) -> Complex:
    """The block of `media` between tests and sources."""
    out = np.zeros((len(tests[0]), len(sources[0])), dtype=np.complex64)
    _add(np.arange(len(out)), *tests, *sources, within.k, within.ratio, strength, within.coefficients, sign, out)
    return out


FIRST_SLOPE, SECOND_SLOPE = 2.0 / 3.0, -1.0 / 12.0
"""Weights of the neighbours in a first difference of fourth order."""

OWN_BEND, FIRST_BEND, SECOND_BEND = -2.5, 4.0 / 3.0, -1.0 / 12.0
"""Weights of the node and its neighbours in a second difference of fourth order."""


@njit(error_model="numpy", nogil=True)
def _smooth(k: complex, k0: float, weight: float) -> tuple[complex, complex]:
    """What remains of monopole and dipole at their own place: the logarithm integrated, ``1 / r^2`` left out."""
    logarithm = np.log(k * weight / (4.0 * math.pi)) + np.euler_gamma
    square = (k / k0) ** 2
    correction = 4j / math.pi * ZETA
    monopole = 1.0 - 2j / math.pi * logarithm + correction
    return monopole, square * (0.5 - 1j / math.pi * (logarithm - 0.5) + 0.5 * correction)


@njit(error_model="numpy", nogil=True)
def _logarithmic(
    dx: float, dy: float, test: bool, source: bool, n: Array, m: Array, k: complex, k0: float, b: complex
) -> complex:
    """What multiplies the logarithm in the block of `media`, of a monopole or dipole at another."""
    r = math.sqrt(dx * dx + dy * dy)
    zeroth, first = _bessel(k * r)
    at_test, at_source = dx * n[0] + dy * n[1], dx * m[0] + dy * m[1]
    if not test and not source:
        value = b * b * zeroth
    elif test != source:
        value = b * k * k / k0 * first * (-at_test if test else at_source)
    else:
        both = 0.0 if r == 0.0 else at_test * at_source / (r * r)
        value = (k / k0) ** 2 * (zeroth * both + first * (n[0] * m[0] + n[1] * m[1] - 2.0 * both))
    return -2j / math.pi * value


@njit(error_model="numpy", nogil=True)
def _step(node: int, forward: bool, before: Indices, after: Indices) -> tuple[int, bool]:
    """The next node along the contour, and the direction from there; an open end is a mirror."""
    neighbour = after[node] if forward else before[node]
    return neighbour, (not forward if neighbour == node else forward)


@njit(error_model="numpy", nogil=True)
def _correct(
    rows: Indices,
    place: Indices,
    node_of: Indices,
    dipole: NDArray[np.bool_],
    first: Indices,
    before: Indices,
    after: Indices,
    x: Array,
    y: Array,
    normal: Array,
    weight: Array,
    curvature: Array,
    surface: Indices,
    strength: Strengths,
    inner: Strengths,
    k0: float,
    out: Complex,
) -> None:
    """Add what nodes do to themselves and the corrections of their neighbours; `place` as in `discretisation`."""
    outer = complex(k0, 0.0)
    for i in range(rows.size):
        row = rows[i]
        node, test = node_of[row], dipole[row]
        w, b, k1 = weight[node], strength[surface[node]], inner[surface[node]]
        body = k1 != 0.0
        own_monopole, own_dipole = _smooth(outer, k0, w)
        if body:
            within = _smooth(k1, k0, w)
            own_monopole -= b * b * within[0]
            own_dipole -= within[1]
        for column in range(first[node], first[node + 1]):
            if place[column] < 0:
                continue
            if test != dipole[column]:
                jump = (1.0 + b) * 2j / (w * k0)
                out[i, place[column]] = (jump if test else -jump) - (1.0 - b) * 1j * curvature[node] / (math.pi * k0)
            else:
                out[i, place[column]] = own_dipole if test else own_monopole
        for forward in (False, True):
            neighbour, _ = _step(node, forward, before, after)
            if neighbour < 0:
                continue
            dx, dy = x[node] - x[neighbour], y[node] - y[neighbour]
            for column in range(first[neighbour], first[neighbour + 1]):
                if place[column] < 0:
                    continue
                source = dipole[column]
                value = _logarithmic(dx, dy, test, source, normal[node], normal[neighbour], outer, k0, 1.0 + 0.0j)
                if body:
                    value -= _logarithmic(dx, dy, test, source, normal[node], normal[neighbour], k1, k0, b)
                out[i, place[column]] += ZETA * value
        if test and not body:
            _finite_part(i, node, place, first, before, after, weight, curvature[node], k0, out)


@njit(error_model="numpy", nogil=True)
def _finite_part(
    row: int,
    node: int,
    place: Indices,
    first: Indices,
    before: Indices,
    after: Indices,
    weight: Array,
    curvature: float,
    k0: float,
    out: Complex,
) -> None:
    """The ``1 / r^2`` of the dipoles of a conductor at and beside the node itself.

    With the arc length s(t) and the density q, ``q / r^2 = (q + q' t + q'' t^2 / 2) (1 + c1 t + c2 t^2) / (s' t)^2``,
    of which the sum over the other nodes leaves out ``(q'' / 2 + c1 q' + c2 q) / s'^2``.
    """
    w = weight[node]
    nodes = np.empty(4, dtype=np.int64)
    weights = np.empty(4)
    for side, forward in enumerate((False, True)):
        here, direction, sign = node, forward, 1.0
        for distance in range(2):
            there, turned = (-1, direction) if here < 0 else _step(here, direction, before, after)
            if turned != direction:  # the arc length is even about an open end, its derivative odd
                sign, direction = -sign, turned
            nodes[2 * side + distance] = there
            weights[2 * side + distance] = sign * weight[there] if there >= 0 else 0.0
            here = there
    # A vertex has no neighbour: the weight is taken to go on as it comes.
    for side in range(2):
        if nodes[2 * side] < 0:
            weights[2 * side], weights[2 * side + 1] = 2.0 * w - weights[2 - 2 * side], 0.0
        if nodes[2 * side + 1] < 0:
            weights[2 * side + 1] = 2.0 * weights[2 * side] - w
    near, far = weights[2] - weights[0], weights[3] - weights[1]
    slope = (FIRST_SLOPE * near + SECOND_SLOPE * far) / w
    near, far = weights[2] + weights[0], weights[3] + weights[1]
    bend = (OWN_BEND * w + FIRST_BEND * near + SECOND_BEND * far) / w
    c1, c2 = -slope, 0.75 * slope**2 - bend / 3.0 + (curvature * w) ** 2 / 12.0
    scale = 2j / math.pi / (k0 * w) ** 2
    own = first[node]
    if place[own] >= 0:
        out[row, place[own]] += scale * (-math.pi**2 / 3.0 + 0.5 * OWN_BEND + c2)
    for side, sign in enumerate((-1.0, 1.0)):
        for distance in range(2):
            there = nodes[2 * side + distance]
            if there < 0 or place[first[there]] < 0:
                continue
            if distance == 0:
                value = 0.5 * FIRST_BEND + sign * c1 * FIRST_SLOPE
            else:
                value = 0.5 * SECOND_BEND + sign * c1 * SECOND_SLOPE
            out[row, place[first[there]]] += scale * value
