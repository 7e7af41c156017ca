"""The solution at one frequency: groups are eliminated from the leaves up, and one dense system joins the largest.

The response M of a group gives the currents of its skeletons, up to the sign, for the field that excites the skeletons.
With the matrix D of a leaf, the interpolation T to the skeletons of a group, and the coupling G between its children,

``M = T D^-1 T^T`` for a leaf and ``M = T (I + M_c G)^-1 M_c T^T`` for a group with children,

where M_c is the block diagonal matrix of the responses of the children. The sweep is ``-b_rx^T (I + M S)^-1 M b_tx``,
with M now that of the largest groups, S their coupling, and b the fields of the antennas at their skeletons. M is never
inverted: it is singular to working precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from mirrorfold.common.types import Array
from mirrorfold.simulation.fullwave.boundaries import Equation
from mirrorfold.simulation.fullwave.compression import Group, interpolation
from mirrorfold.simulation.fullwave.discretisation import Nodes

Complex = NDArray[np.complex64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class System:
    """The equation, antennas and groups of a scene, which the solver uses at every frequency.

    Attributes
    ----------
    equation : Nodes or Boundaries
    tx, rx : (n, 2) and (m, 2) arrays [m]
        Positions of transmitters and receivers.
    roots : tuple of Group
        The largest groups; empty to solve the whole dense system instead.
    """

    equation: Equation
    tx: Array
    rx: Array
    roots: tuple[Group, ...]

    @property
    def nodes(self) -> Nodes:
        """The nodes on all contours."""
        return self.equation.nodes

    @property
    def antennas(self) -> Array:
        """Positions of transmitters and receivers, (n + m, 2) [m]; only (n, 2) if both are the same."""
        return self.tx if np.array_equal(self.tx, self.rx) else np.concatenate([self.tx, self.rx])


@dataclass(frozen=True, eq=False)
class _Eliminated:
    """An eliminated group at one frequency: its response for the parent, and the matrices to find its currents later.

    Attributes
    ----------
    response : (s, s) complex64 array
        The matrix M of the group.
    inward : (n, s) complex64 array
        Currents of the n members for a unit field at each skeleton, ``D^-1 T^T`` or ``(I + M_c G)^-1 M_c T^T``.
    interpolation : (s, n) complex64 array
        The matrix T.
    coupling : (n, n) complex64 array
        The matrix G; empty for a leaf.
    children : tuple of _Eliminated
    """

    response: Complex
    inward: Complex
    interpolation: Complex
    coupling: Complex
    children: tuple[_Eliminated, ...]


def scattered(system: System, k: float) -> Complex:
    """Field scattered from every transmitter to every receiver, for sources with the field ``H0^(2)(k r)``.

    Parameters
    ----------
    system : System
    k : float [rad/m]

    Returns
    -------
    (tx, rx) complex64 array
    """
    members, charges, _ = _solve_last_system(system, np.eye(len(system.tx), dtype=np.complex64), k)
    return charges.T @ system.equation.at_points(system.rx, members, k)


def currents(system: System, excitation: Complex, k: float) -> Complex:
    """All unknowns for given excitations: currents of conductors, monopoles and dipoles of dielectric bodies.

    Parameters
    ----------
    system : System
    excitation : (tx, n) complex64 array
        Strengths of the transmitters in each of n cases, as multiples of the field ``H0^(2)(k r)``.
    k : float [rad/m]

    Returns
    -------
    (unknowns, n) complex64 array
        The scattered field is the sum of the fields of these unknowns; a unit current radiates ``H0^(2)(k r)``.
    """
    members, charges, eliminated = _solve_last_system(system, excitation, k)
    if not system.roots:
        return charges
    blocks = [group.response for group in eliminated]
    exciting = _incident(system, members, excitation, k) + _coupling(system.equation, members, blocks, k) @ charges
    result = np.zeros((system.equation.size, excitation.shape[1]), dtype=np.complex64)
    for root, group, part in zip(system.roots, eliminated, _split(exciting, blocks), strict=True):
        _descend(root, group, -part, result)
    return result


def residual(system: System, k: float, *, seed: int, cases: int = 4) -> float:
    """Relative residual of the compressed solution in the full system, for random strengths of the transmitters.

    Parameters
    ----------
    system : System
    k : float [rad/m]
    seed : int
        Seed of these strengths.
    cases : int
        Number of right-hand sides.

    Returns
    -------
    float
        Norm of ``A I + b`` over that of the incident field b, with the full matrix A, which is never stored.
    """
    generator = np.random.default_rng(seed)
    shape = (len(system.tx), cases)
    excitation = (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)).astype(np.complex64)
    solution = currents(system, excitation, k)
    everything = np.arange(system.equation.size)
    incident = _incident(system, everything, excitation, k)
    left = np.empty_like(incident)
    for rows in np.array_split(everything, max(1, len(everything) // BLOCK_ROWS)):
        left[rows] = system.equation.matrix(rows, everything, k) @ solution + incident[rows]
    return float(np.linalg.norm(left) / np.linalg.norm(incident))


BLOCK_ROWS = 256
"""Number of rows of the full matrix that are computed at a time when the matrix is not stored."""


def _solve_last_system(system: System, excitation: Complex, k: float) -> tuple[Indices, Complex, list[_Eliminated]]:
    """Solve the last dense system.

    Returns the unknowns that are left (all skeletons of the largest groups), their currents ``-(I + M S)^-1 M b``, and
    the eliminated largest groups. Without groups: all unknowns, their currents, and an empty list.
    """
    if not system.roots:
        members = np.arange(system.equation.size)
        whole = system.equation.matrix(members, members, k)
        return members, -_solve(whole, _incident(system, members, excitation, k)), []
    eliminated = [_eliminate(root, system, k) for root in system.roots]
    blocks = [group.response for group in eliminated]
    members = np.concatenate([root.skeletons for root in system.roots])
    right = _blockwise(blocks, _incident(system, members, excitation, k))
    joined = _coupling(system.equation, members, blocks, k)
    _identity_plus(blocks, joined, out=joined)
    return members, -_solve(joined, right), eliminated


def _incident(system: System, members: Indices, excitation: Complex, k: float) -> Complex:
    """Incident field of the transmitters at the unknowns `members`, (members, cases)."""
    return system.equation.at_points(system.tx, members, k) @ excitation


def _eliminate(group: Group, system: System, k: float) -> _Eliminated:
    """Eliminate a group, after all groups below it."""
    children = tuple(_eliminate(child, system, k) for child in group.children)
    to_skeleton = interpolation(group, system.equation, system.antennas, k)
    if not children:
        inward = _solve(system.equation.matrix(group.members, group.members, k), to_skeleton.T)
        return _Eliminated(to_skeleton @ inward, inward, to_skeleton, np.empty((0, 0), np.complex64), ())
    blocks = [child.response for child in children]
    coupling = _coupling(system.equation, group.members, blocks, k)
    inward = _solve(_identity_plus(blocks, coupling, out=np.empty_like(coupling)), _blockwise(blocks, to_skeleton.T))
    return _Eliminated(to_skeleton @ inward, inward, to_skeleton, coupling, children)


def _coupling(equation: Equation, members: Indices, blocks: Sequence[Complex], k: float) -> Complex:
    """The matrix between the unknowns of different groups.

    The blocks on the diagonal, within each group, are set to zero, as the group's response contains them.
    """
    result = equation.matrix(members, members, k)
    first = 0
    for block in blocks:
        last = first + len(block)
        result[first:last, first:last] = 0.0
        first = last
    return result


def _descend(group: Group, eliminated: _Eliminated, exciting: Complex, result: Complex) -> None:
    """Fill `result` with the currents of all unknowns of a group, from the field that excites its skeletons."""
    currents = eliminated.inward @ exciting
    if not group.children:
        result[group.members] = currents
        return
    at_members = eliminated.interpolation.T @ exciting - eliminated.coupling @ currents
    parts = _split(at_members, [child.response for child in eliminated.children])
    for child, below, part in zip(group.children, eliminated.children, parts, strict=True):
        _descend(child, below, part, result)


def _split(array: Complex, blocks: Sequence[Complex]) -> list[Complex]:
    """The parts of an array whose rows belong to each block of a block diagonal matrix."""
    return np.split(array, np.cumsum([len(block) for block in blocks])[:-1])


def _blockwise(blocks: Sequence[Complex], array: Complex) -> Complex:
    """Product of a block diagonal matrix and an array."""
    return np.concatenate([block @ part for block, part in zip(blocks, _split(array, blocks), strict=True)])


def _identity_plus(blocks: Sequence[Complex], coupling: Complex, *, out: Complex) -> Complex:
    """``I + M G`` for block diagonal M; `out` may be G itself."""
    for block, source, target in zip(blocks, _split(coupling, blocks), _split(out, blocks), strict=True):
        target[:] = block @ source
    out.ravel()[:: len(out) + 1] += 1.0
    return out


def _solve(a: Complex, b: Complex) -> Complex:
    """Solution of ``a x = b``; a, in row-major order, is overwritten by its factors.

    LAPACK expects column-major order: it factors the transpose of a, and then solves with the transpose of that.
    """
    factors, pivots, info = lapack.cgetrf(a.T, overwrite_a=1)
    if info > 0:
        raise FloatingPointError(f"the system of {len(a)} equations is singular at its row {info}")
    solution, _ = lapack.cgetrs(factors, pivots, b, trans=1)
    return np.ascontiguousarray(solution)
