"""Skeletons: the few unknowns of a group that represent all of it towards the rest of the scene and the antennas.

The field that a group radiates is sampled on the rest of the scene and at the antennas, densely nearby and sparsely far
away. An interpolative decomposition (Cheng, Gimbutas, Martinsson and Rokhlin, SIAM J. Sci. Comput. 26, 2005) of these
samples selects the unknowns, the skeletons, whose fields combine to those of all others. A piece of wall meets waves
from few directions only, and so needs far fewer skeletons than for arbitrary waves. Groups of skeletons are compressed
again, level by level (Martinsson and Rokhlin, J. Comput. Phys. 205, 2005).

Skeletons are chosen once, at the highest frequency, and used for the whole band.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack, qr

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.simulation.fullwave.boundaries import Equation

Complex = NDArray[np.complex64]
Indices = NDArray[np.int64]

LEAF = 10.0
"""Length of the smallest groups, the leaves [wavelengths]."""

MOST_UNKNOWNS = 500
"""Largest number of unknowns of a leaf, on average: a foil has thousands of nodes per wavelength, as many as its small
thickness requires, and the work on a leaf grows with the cube of their number."""

FAN_OUT = 4
"""Number of groups that are joined to one group of the next level."""

LONGEST = 160.0
"""Length [wavelengths] of the largest groups."""

SAMPLING = 0.3
"""Spacing of the samples over that of the interference fringes of a group's field, which is ``d lambda / l`` at the
distance d from a group of length l."""

PROBES = 16
"""Approximate number of points of a group from which the distances of the samples are measured."""

ROWS_PER_SKELETON = 2
"""Number of samples per skeleton from which the interpolation is computed at every frequency: with a single one it
fails at the low end of the band."""

DAMPING = 0.03
"""Damping of the interpolation over its tolerance. Below the top frequency some skeletons are redundant, and would
otherwise carry large currents that cancel each other."""


@dataclass(frozen=True, eq=False)
class Group:
    """A piece of contour and its skeleton.

    Attributes
    ----------
    members : (n,) array of int
        Numbers of all unknowns of a leaf; of any other group, the skeletons of its children, child after child.
    skeleton, rest : (s,) and (n - s,) arrays of int
        Indices into `members` of the skeletons and of the other unknowns.
    rows : (r,) array of int
        Numbers of the unknowns outside the group at which the skeletons must reproduce its field.
    antennas : (a,) array of int
        Numbers of the antennas at which they must reproduce it, too.
    scale : (r + a,) float32 array
        Factors by which the field at these samples is multiplied, so that near and far ones have equal weight.
    damping : float
        Damping of the interpolation, relative to the norm of a column.
    children : tuple of Group
        Empty for a leaf.
    """

    members: Indices
    skeleton: Indices
    rest: Indices
    rows: Indices
    antennas: Indices
    scale: NDArray[np.float32]
    damping: float
    children: tuple[Group, ...]

    @property
    def skeletons(self) -> Indices:
        """Numbers of the unknowns that are skeletons."""
        return self.members[self.skeleton]

    def walk(self) -> list[Group]:
        """All groups below this one, and then this one: children before their parents."""
        return [group for child in self.children for group in child.walk()] + [self]


def compress(equation: Equation, antennas: Array, *, k: float, tolerance: float) -> tuple[Group, ...]:
    """Divide a scene into groups and choose their skeletons; returns the largest groups, which hold all others.

    Parameters
    ----------
    equation : Nodes or Boundaries
    antennas : (a, 2) array [m]
        Transmitters and receivers.
    k : float [rad/m]
        Largest wavenumber of the band.
    tolerance : float
        Relative error of the interpolation.
    """
    nodes = equation.nodes
    roots: list[Group] = []
    for surface in np.unique(nodes.surface):
        wavelength = 2.0 * np.pi / k / equation.refraction(surface, k)
        members = equation.order(surface)
        # The tolerance is relative to the strongest fields, inside a body; weaker ones outside must be right, too.
        finest = tolerance / equation.strength(surface, k)
        length = nodes.weight[members].sum()
        unknowns = len(equation.unknowns_at(np.sort(members)))
        leaves = max(1, round(length / (LEAF * wavelength)), -(-unknowns // MOST_UNKNOWNS))
        bounds = np.searchsorted(np.cumsum(nodes.weight[members]), np.linspace(0.0, length, leaves + 1)[1:-1])
        parts = [np.sort(part) for part in np.split(members, bounds)]
        groups = [_skeletonise(equation, part, equation.unknowns_at(part), (), antennas, k, finest) for part in parts]
        span = length / leaves
        while len(groups) > 1 and span * FAN_OUT <= LONGEST * wavelength * 1.5:
            joined = np.array_split(np.arange(len(groups)), -(-len(groups) // FAN_OUT))
            families = [tuple(groups[i] for i in family) for family in joined]
            parts = [_nodes_spanned(members, [c.skeletons for c in family], equation) for family in families]
            groups = [
                _skeletonise(equation, part, np.concatenate([c.skeletons for c in family]), family, antennas, k, finest)
                for part, family in zip(parts, families, strict=True)
            ]
            span *= FAN_OUT
        roots += groups
    return tuple(roots)


def _nodes_spanned(order: Indices, skeletons: list[Indices], equation: Equation) -> Indices:
    """Nodes of a surface from the first to the last one with a skeleton, in the surface's `order`; returned sorted."""
    found = np.flatnonzero(np.isin(order, equation.node[np.concatenate(skeletons)]))
    return np.sort(order[found[0] : found[-1] + 1])


def _skeletonise(
    equation: Equation,
    part: Indices,
    members: Indices,
    children: tuple[Group, ...],
    antennas: Array,
    k: float,
    tolerance: float,
) -> Group:
    """Choose the skeleton of a group, and the samples from which the interpolation is computed later.

    `part` are the nodes of the group, and `members` its unknowns: all of a leaf, else the skeletons of its children.
    """
    places = equation.node[members]
    sampled, apart = _samples(equation, part, places, k)
    rows = equation.unknowns_at(sampled)
    distance = apart if len(rows) == len(apart) else apart[np.searchsorted(sampled, equation.node[rows])]
    probes = equation.nodes.position[places[:: max(1, len(members) // PROBES)]]
    to_antennas = np.min(np.linalg.norm(antennas[:, None] - probes, axis=2), axis=1)
    # The inverse of the modulus of the Hankel function, to a few per cent.
    scale = np.sqrt(0.5 * np.pi * k * np.concatenate([distance, to_antennas])).astype(np.float32)
    field = sampled_field(equation, rows, antennas, members, k) * scale[:, None]
    triangle = qr(field, mode="r", check_finite=False)[0][: len(members)]
    triangle, order = qr(triangle, mode="r", pivoting=True, check_finite=False)
    size = np.abs(np.diag(triangle))
    rank = max(1, int(np.count_nonzero(size > tolerance * size[0])))
    skeleton, rest = np.sort(order[:rank]), np.sort(order[rank:])
    chosen = _independent_rows(field[:, skeleton])
    inner = chosen[chosen < len(rows)]
    outer = chosen[chosen >= len(rows)]
    return Group(
        members=members,
        skeleton=skeleton,
        rest=rest,
        rows=rows[inner],
        antennas=outer - len(rows),
        scale=scale[chosen],
        damping=DAMPING * tolerance,
        children=children,
    )


def sampled_field(equation: Equation, rows: Indices, antennas: Array, members: Indices, k: float) -> Complex:
    """Field of the unit unknowns `members` at the unknowns `rows` and at antennas, (rows + antennas, members)."""
    at_antennas = equation.at_points(antennas, members, k).T
    return np.concatenate([equation.matrix(rows, members, k), at_antennas])


def interpolation(group: Group, equation: Equation, antennas: Array, k: float) -> Complex:
    """The matrix T (skeletons, members) that turns the strengths of all members into equivalent ones of the skeletons.

    It follows from the samples of the group by damped least squares.
    """
    field = sampled_field(equation, group.rows, antennas[group.antennas], group.members, k) * group.scale[:, None]
    kept = len(group.skeleton)
    result = np.zeros((kept, len(group.members)), dtype=np.complex64)
    result[np.arange(kept), group.skeleton] = 1.0
    if len(group.rest):
        basis = np.zeros((len(field) + kept, kept), dtype=np.complex64, order="F")
        basis[: len(field)] = field[:, group.skeleton]
        np.fill_diagonal(basis[len(field) :], group.damping * np.linalg.norm(basis) / np.sqrt(kept))
        target = np.zeros((len(basis), len(group.rest)), dtype=np.complex64, order="F")
        target[: len(field)] = field[:, group.rest]
        result[:, group.rest] = lapack.cgels(basis, target, overwrite_a=1, overwrite_b=1)[1][:kept]
    return result


def _independent_rows(field: Complex) -> Indices:
    """Indices of rows that determine all others: the pivot rows of Gaussian elimination.

    The elimination is repeated on the remaining rows until there are `ROWS_PER_SKELETON` rows per column.
    """
    remaining = np.arange(len(field))
    chosen = []
    for _ in range(ROWS_PER_SKELETON):
        if not len(remaining):
            break
        _, pivots, _ = lapack.cgetrf(field[remaining])
        order = np.arange(len(remaining))
        for i, pivot in enumerate(pivots):
            order[[i, pivot]] = order[[pivot, i]]
        taken = order[: len(pivots)]
        chosen.append(remaining[taken])
        remaining = np.delete(remaining, taken)
    return np.sort(np.concatenate(chosen))


def _samples(equation: Equation, part: Indices, places: Indices, k: float) -> tuple[Indices, Array]:
    """Nodes outside a group at which its field is sampled, and their distances from the group [m], (n,) each.

    `part` are the nodes of the group, `places` those of its unknowns. On the group's own dielectric body the samples
    are denser by its refractive index, as the waves inside are shorter.
    """
    nodes = equation.nodes
    x, y = nodes.coordinates
    probes = places[:: max(1, len(places) // PROBES)]
    length = nodes.weight[part].sum()
    surface = int(nodes.surface[part[0]])
    refraction = equation.refraction(surface, k)
    passing = nodes.weight if refraction == 1.0 else np.where(nodes.surface == surface, refraction, 1.0) * nodes.weight
    own = np.zeros(nodes.size, dtype=np.bool_)
    own[part] = True
    distance = np.empty(nodes.size)
    taken = np.empty(nodes.size, dtype=np.bool_)
    _sample(x, y, passing, own, probes, SAMPLING * 2.0 * np.pi / k / length, distance, taken)
    rows = np.flatnonzero(taken)
    return rows, distance[rows]


@njit(error_model="numpy", nogil=True)
def _sample(
    x: Array,
    y: Array,
    weight: Array,
    own: NDArray[np.bool_],
    probes: Indices,
    spread: float,
    distance: Array,
    taken: NDArray[np.bool_],
) -> None:
    """Take nodes at intervals of `spread` times their distance from the probes, leaving out the group's `own` nodes.

    Fills `distance` (nodes,) [m] and the mask `taken` (nodes,).
    """
    passed = 1.0
    for i in range(x.size):
        taken[i] = False
        if own[i]:
            passed = 1.0
            continue
        nearest = np.inf
        for p in probes:
            nearest = min(nearest, (x[i] - x[p]) ** 2 + (y[i] - y[p]) ** 2)
        distance[i] = math.sqrt(nearest)
        passed += weight[i] / (spread * distance[i])
        if passed >= 1.0:
            taken[i] = True
            passed = min(passed - 1.0, 1.0)
