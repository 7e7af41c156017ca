"""The integral equations of conductors and dielectric bodies together, in either polarization.

The scalar field u is the field component along the axis: E in the polarization "TE" (E perpendicular to the plane of
incidence), H in "TM". The unknowns are monopoles X and dipoles Y on the contours (`media`). The field outside is
``u = u_inc + sum X H0 + sum Y d'H0 / k0``, with d' the derivative along the normal at the source.

* **Conductor.** TE: u = 0, with monopoles (`discretisation`). TM: du/dn = 0, with dipoles. Both work for open contours.
* **Dielectric body** of relative permittivity eps. By Green's theorem ``X = j w u_n / 4`` and ``Y = -j w k0 u / 4`` on
  either side of its contour. u and ``u_n`` (TE) or ``u_n / eps`` (TM) are continuous. The field inside is therefore
  minus the field of Y and b X at the inner wavenumber, with b = 1 (TE) or eps (TM). Adding the limit of u from outside
  and b times that from inside, and adding the limits of the derivatives without the factor b, gives with w the weight
  of a node

  ``(K_0 - K_1)(X, Y) -+ (1 + b) 2j / (w k0) (Y, X) = -(u_inc, du_inc/dn / k0)``,

  where K_0 is the block of `media` outside, and K_1 that at the inner wavenumber for monopoles of the strength b. The
  strongest singularities cancel in the difference, and a second-kind equation remains (Mueller, Foundations of the
  Mathematical Theory of Electromagnetic Waves, 1969; Rokhlin, Wave Motion 5, 257, 1983). Its solution is unique by
  Rellich's lemma, and with losses by Green's identity, as for Mueller's own weights. With the weights chosen here the
  coupling between any two places is symmetric, as for conductors: the same skeleton of a group serves for the field
  that it radiates and for the field that it receives.

Logarithmic singularities are integrated as on conductors. The ``1 / r^2`` singularity of dipoles on conductors is
integrated in the sense of Hadamard: the sum over the other nodes, minus ``pi^2 / 3`` times the node's own term, plus
the regular part that the sum leaves out, by Taylor's series of the contour and finite differences of the density.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.slabs import Polarization
from mirrorfold.common.types import Array
from mirrorfold.scenes.materials import Dielectric
from mirrorfold.simulation.fullwave.discretisation import ZETA, Nodes
from mirrorfold.simulation.fullwave.media import Medium, add_waves, bessel, medium

Complex = NDArray[np.complex64]
Indices = NDArray[np.int64]
Strengths = NDArray[np.complex128]
Sources = tuple[NDArray, ...]
"""Coordinates x and y [m], moments of monopoles and of dipoles along x and y: arguments of `media.add_waves`."""


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Contours of conductors and of dielectric bodies, with their unknowns.

    Attributes
    ----------
    nodes : Nodes
        Normals of bodies point out of them.
    inside : tuple of Dielectric or None
        Material that each surface encloses; None for conductors.
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
        """Number of the first unknown of each node, and the number of all unknowns at the end: (nodes + 1,)."""
        return np.concatenate([[0], np.cumsum(np.where(self._is_body, 2, 1))])

    @cached_property
    def node(self) -> Indices:
        """Number of the node of each unknown."""
        return np.repeat(np.arange(self.nodes.size), np.diff(self._first))

    @cached_property
    def dipole(self) -> NDArray[np.bool_]:
        """Whether each unknown is a dipole: the second unknown of a body's node, and that of a conductor's in TM."""
        second = np.arange(self.size) > self._first[self.node]
        return np.where(self._is_body[self.node], second, self.polarization == "TM")

    @cached_property
    def _sources(self) -> Sources:
        """All unknowns as sources for `media.add_waves`."""
        x, y = self.nodes.coordinates
        normal = np.where(self.dipole[:, None], self.nodes.normal[self.node], 0.0).astype(np.float32)
        moments = (~self.dipole).astype(np.float32)
        return (
            x[self.node],
            y[self.node],
            moments,
            np.ascontiguousarray(normal[:, 0]),
            np.ascontiguousarray(normal[:, 1]),
        )

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._first[-1])

    @property
    def digest(self) -> tuple[Array, ...]:
        """Normals, materials and polarization as numbers: what results depend on in addition to the nodes' places."""
        materials = [(m.a, m.b, m.c, m.d) if m else (0.0, 0.0, 0.0, 0.0) for m in self.inside]
        return self.nodes.normal, np.array(materials), np.array([self.polarization == "TM"])

    def unknowns_at(self, nodes: Indices) -> Indices:
        """All unknowns of nodes, node by node."""
        first, count = self._first[nodes], np.diff(self._first)[nodes]
        both = np.stack([first, first + 1], axis=1)
        return both[np.arange(2) < count[:, None]]

    def refraction(self, surface: int, k: float) -> float:
        """Magnitude of the refractive index inside a surface, at least 1: waves are as much shorter there."""
        return max(1.0, abs(np.sqrt(self._permittivity(surface, k))))

    def strength(self, surface: int, k: float) -> float:
        """Coupling of monopoles inside a surface over that outside, ``|b|^2``, at least 1."""
        return max(1.0, abs(self._inside(k)[0][surface]) ** 2)

    def order(self, surface: int) -> Indices:
        """Nodes of a surface in the order in which the surface is divided into groups.

        Groups of a conductor follow each other along its contour, those of a body along its longest axis: both faces of
        a slab, which interact strongly, are then in the same group.
        """
        members = np.flatnonzero(self.nodes.surface == surface)
        if self.inside[surface] is None:
            return members
        place = self.nodes.position[members] - self.nodes.position[members].mean(axis=0)
        axis = np.linalg.svd(place, full_matrices=False)[2][0]
        return members[np.argsort(place @ axis, kind="stable")]

    def matrix(self, rows: Indices, columns: Indices, k: float) -> Complex:
        """Block of the matrix of the equations; see `discretisation.matrix`."""
        out = self._block(self._sources, rows, columns, medium(k), 1.0 + 0.0j, 1.0)
        surface = self.nodes.surface[self.node]
        of_columns, of_rows = surface[columns], surface[rows]
        strength, inner = self._inside(k)
        for body in np.unique(of_columns):
            some_rows, some_columns = np.flatnonzero(of_rows == body), np.flatnonzero(of_columns == body)
            if self.inside[body] is not None and len(some_rows):
                within = medium(k, self._permittivity(body, k))
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
        """Fields of unit unknowns at points, (unknowns, points).

        By default the points are outside all bodies. With `body`, they are inside that body, and `unknowns` are its
        own.
        """
        here = np.asarray(points, dtype=float)
        x, y = np.ascontiguousarray(here[:, 0]), np.ascontiguousarray(here[:, 1])
        none, one = np.zeros(len(here), np.float32), np.ones(len(here), np.float32)
        within, strength, sign = medium(k), 1.0 + 0.0j, 1.0
        if body is not None:
            within, strength, sign = medium(k, self._permittivity(body, k)), complex(self._inside(k)[0][body]), -1.0
        tests = (x, y, one, none, none)
        sources = tuple(part[unknowns] for part in self._sources)
        # The block multiplies by the strength b at test and source; here it belongs to the sources only.
        return np.ascontiguousarray(_waves(tests, sources, within, strength, sign).T / np.complex64(strength))

    def encloses(self, surface: int, points: Array) -> NDArray[np.bool_]:
        """Whether a body encloses points, (points,), by the angle under which they see its contour.

        The result is not reliable for points on the contour.
        """
        own = self.nodes.surface == surface
        x, y = (np.ascontiguousarray(part[own]) for part in self.nodes.coordinates)
        return _seen_angle(points, x, y, self.nodes.normal[own], self.nodes.weight[own]) > math.pi

    def _block(
        self, parts: Sources, rows: Indices, columns: Indices, within: Medium, b: complex, sign: float
    ) -> Complex:
        """Fields of the unknowns `columns` at the unknowns `rows` in one medium, times `sign`, (rows, columns)."""
        return _waves(tuple(p[rows] for p in parts), tuple(p[columns] for p in parts), within, b, sign)

    def _permittivity(self, surface: int, k: float) -> complex:
        """Relative permittivity inside a surface at the wavenumber k of free space [rad/m]; 1 for conductors."""
        material = self.inside[surface]
        return 1.0 + 0.0j if material is None else complex(material.permittivity(k * speed_of_light / (2.0 * np.pi)))

    def _inside(self, k: float) -> tuple[Strengths, Strengths]:
        """The factor b of each surface, and its inner wavenumber [rad/m], which is zero for conductors."""
        permittivity = [self._permittivity(surface, k) for surface in range(len(self.inside))]
        strength = [1.0 if self.polarization == "TE" else eps for eps in permittivity]
        body = [material is not None for material in self.inside]
        inner = [medium(k, eps).k if filled else 0.0 for eps, filled in zip(permittivity, body, strict=True)]
        return np.array(strength, dtype=complex), np.array(inner, dtype=complex)


Equation = Nodes | Boundaries
"""The equation of a scene as the solver uses it: unknowns at nodes, the matrix, and fields of unknowns at antennas."""


def _waves(tests: Sources, sources: Sources, within: Medium, strength: complex, sign: float) -> Complex:
    """The block K of `media` between tests and sources, times `sign`, (tests, sources)."""
    out = np.zeros((len(tests[0]), len(sources[0])), dtype=np.complex64)
    add_waves(np.arange(len(out)), *tests, *sources, within.k, within.ratio, strength, within.coefficients, sign, out)
    return out


@njit(makes_arrays=True, error_model="numpy", nogil=True)
def _seen_angle(points: Array, x: Array, y: Array, normal: Array, weight: Array) -> Array:
    """Angle [rad] under which each point sees a closed contour: 2 pi for points inside, 0 for points outside."""
    out = np.zeros(len(points))
    for i in range(len(points)):
        for j in range(x.size):
            dx, dy = x[j] - points[i, 0], y[j] - points[i, 1]
            out[i] += weight[j] * (dx * normal[j, 0] + dy * normal[j, 1]) / max(dx * dx + dy * dy, weight[j] ** 2)
    return out


SLOPE = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Weights of the following neighbours, nearest first, in a first difference of eighth order; the preceding neighbours
have the negative weights. Lower orders cause errors at an open end, where the weights of the nodes go to zero."""

OWN_BEND, BEND = -205 / 72, (8 / 5, -1 / 5, 8 / 315, -1 / 560)
"""Weights of the node itself, and of its neighbours on either side, in a second difference of eighth order."""

REACH = len(SLOPE)
"""Number of neighbours on either side in these differences."""


@njit(error_model="numpy", nogil=True)
def _self_terms(k: complex, k0: float, weight: float) -> tuple[complex, complex]:
    """Matrix elements of a monopole and of a dipole at their own node: logarithm integrated, ``1 / r^2`` left out."""
    logarithm = np.log(k * weight / (4.0 * math.pi)) + np.euler_gamma
    square = (k / k0) ** 2
    correction = 4j / math.pi * ZETA
    monopole = 1.0 - 2j / math.pi * logarithm + correction
    return monopole, square * (0.5 - 1j / math.pi * (logarithm - 0.5) + 0.5 * correction)


@njit(error_model="numpy", nogil=True)
def _logarithmic(
    dx: float, dy: float, test: bool, source: bool, n: Array, m: Array, k: complex, k0: float, b: complex
) -> complex:
    """Factor of the logarithm in the block K of `media`, between a test and a source.

    (dx, dy) [m] leads from the source to the test. `test` and `source` say whether each is a dipole instead of a
    monopole; n and m are their normals.
    """
    r = math.sqrt(dx * dx + dy * dy)
    zeroth, first = bessel(k * r)
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
    """The next node along the contour, and the direction to go on in: an open end reverses it, like a mirror."""
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
    """Set the elements of nodes with themselves, and correct those of neighbours; `place` as in `discretisation`."""
    outer = complex(k0, 0.0)
    for i in range(rows.size):
        row = rows[i]
        node, test = node_of[row], dipole[row]
        w, b, k1 = weight[node], strength[surface[node]], inner[surface[node]]
        body = k1 != 0.0
        own_monopole, own_dipole = _self_terms(outer, k0, w)
        if body:
            within = _self_terms(k1, k0, w)
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


@njit(makes_arrays=True, error_model="numpy", nogil=True)
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
    """Add the finite part of the ``1 / r^2`` singularity of a conductor's dipoles, at a node and its neighbours.

    With the arc length s(t) and the jump f of the field, ``f s' / r^2 = g(t) / t^2`` for t measured from the node. The
    sum over the other nodes leaves out ``g''(0) / 2 = (f'' / 2 + f (s''' / (6 s') - (s'' / s')^2 / 4 + (c s')^2 / 12))
    / s'`` at the curvature c. Finite differences are taken of f, not of f s': towards an open end f is odd in t, but f
    s' is even, and would admit ``f = 1 / sqrt(s)``, a solution without sources.
    """
    w = weight[node]
    nodes = np.empty((2, REACH), dtype=np.int64)
    weights, signs = np.empty((2, REACH)), np.empty((2, REACH))
    for side in range(2):
        here, forward, sign, parity = node, side == 1, 1.0, 1.0
        for step in range(REACH):
            there, turned = _step(here, forward, before, after)
            if there < 0:  # f is even about a vertex, and odd about an open end; the arc length is the reverse
                there, turned, parity = here, not forward, -parity
            if turned != forward:
                sign, forward = -sign, turned
            here = there
            nodes[side, step], weights[side, step], signs[side, step] = here, sign * weight[here], sign * parity
    slope, bend = 0.0, OWN_BEND * w
    for step in range(REACH):
        slope += SLOPE[step] * (weights[1, step] - weights[0, step])
        bend += BEND[step] * (weights[1, step] + weights[0, step])
    left_out = bend / (6.0 * w) - 0.25 * (slope / w) ** 2 + (curvature * w) ** 2 / 12.0
    scale = 2j / math.pi / (k0 * w) ** 2
    own = place[first[node]]
    if own >= 0:
        out[row, own] += scale * (-(math.pi**2) / 3.0 + 0.5 * OWN_BEND + left_out)
    for side in range(2):
        for step in range(REACH):
            there = nodes[side, step]
            if place[first[there]] >= 0:
                value = 0.5 * BEND[step] * signs[side, step] * w / weight[there]
                out[row, place[first[there]]] += scale * value
