"""Curvature by a few nodes: a skeleton of pixels from whose phases all others follow.

Over a sector of the image the phase factors ``exp(j k E(pair; p))`` of all pairs span a space of few dimensions.
Pivoted QR picks node pixels p_q whose factors span it (interpolative decomposition, Cheng et al. 2005)::

    exp(j k E(pair; p)) ~ sum_q exp(j k_c E(pair; p_q)) W_q'q(k) V_q(p).

V is fitted on Chebyshev points of (1/r, u) and is a smooth function of the pixel; W carries the nodes from the
middle wavenumber k_c to k. Both are least-squares fits over a random choice of pairs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numba import njit
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Complex
from mirrorfold.focusing.lattice import Lattice, across
from mirrorfold.focusing.problem import Problem

PAIR_SAMPLES = 500
"""Random pairs that stand for all of them, at least; more where there are many nodes."""

END_SAMPLES = 20
"""Elements of either array that are paired with each other besides: denser towards the ends, where phases vary most."""

CANDIDATES = 350
"""Chebyshev points drawn as candidates for nodes, at least."""

TEST_POINTS = 250
"""Random pixels, between the Chebyshev points, on which V is tested."""

TABLE_REFINEMENTS = 5
"""Times that the table of V is made finer before its error is taken as it is."""

LARGEST_TABLE = 40_000
"""Chebyshev points at which V is tabulated, at most."""

WAVENUMBER_NODES = 8
"""Chebyshev points in wavenumber from which W is interpolated to every frequency."""

ON_LINE = 1e-7
"""Distance [m] from the line that counts as none: 1e-3 rad at 1 THz."""

MAXIMUM_NODES = 150
"""With more nodes than this the exact kernel is as fast."""


class UnsuitedError(Exception):
    """The geometry has no structure that the fast path could use."""


@dataclass(frozen=True)
class Sector:
    """A part of the image: ranges [m] from the lattice's centre, cosines to its axis."""

    near: float
    far: float
    u_low: float
    u_high: float


WIDEST_OFF_LINE = 0.99
"""Largest |u| for antennas off their line, whose phases go with sqrt(1 - u^2)."""


def warp(u: Array, off_line: bool) -> Array:
    """The coordinate along which V is a smooth function: u, or its angle where antennas stand off the line.

    Raises
    ------
    UnsuitedError
        If antennas off the line are looked at from its very ends.
    """
    if not off_line:
        return u
    if np.abs(u).max() > WIDEST_OFF_LINE:
        raise UnsuitedError("antennas off the line, seen along it")
    return np.asarray(np.arcsin(u))


@dataclass(frozen=True, eq=False)
class Nodes:
    """The skeleton of a sector.

    Attributes
    ----------
    range, cosine : (nodes,) arrays
        Polar coordinates of the node pixels.
    transfer : (frequencies, nodes, nodes) complex array
        W: from nodes at the middle wavenumber to nodes at each wavenumber.
    value : (inverse ranges, cosines, nodes) complex array
        V at the Chebyshev points of the sector.
    inverse_low, inverse_high : float [1/m]
        Interval of 1/r that the Chebyshev points span.
    off_line : bool
        Whether antennas stand off the line: see `warp`.
    error : float
        Root-mean-square error over pairs and pixels, relative: that of the image of white data.
    """

    range: Array
    cosine: Array
    transfer: Complex
    value: Complex
    inverse_low: float
    inverse_high: float
    off_line: bool
    error: float


def chebyshev(low: float, high: float, n: int) -> Array:
    """The n Chebyshev points of an interval."""
    return 0.5 * (low + high) + 0.5 * (high - low) * np.cos(np.pi * (np.arange(n) + 0.5) / n)


def chebyshev_matrix(low: float, high: float, n: int, at: Array) -> Array:
    """Values at `at` of the n Lagrange polynomials on the Chebyshev points of [low, high], shape (at, n)."""
    half = 0.5 * (high - low) if high > low else 1.0
    t = np.clip((at - 0.5 * (low + high)) / half, -1.2, 1.2)
    nodes = np.cos(np.pi * (np.arange(n) + 0.5) / n)
    order = np.arange(n)
    scale = np.where(order == 0, 1.0, 2.0) / n
    basis = np.polynomial.chebyshev.chebvander(t, n - 1)
    return np.asarray((basis * scale) @ np.cos(np.outer(order, np.arccos(nodes))))


def remainder(problem: Problem, lattice: Lattice, pairs: NDArray[np.int64], r: Array, u: Array, height: float) -> Array:
    """E(pair; p) [m] for pixels at range r, cosine u: the path less ``2 (r - X_s u)``, shape (pairs, pixels).

    `height` is the offset [m] of the pixels from the lattice along the third direction, which is that of
    `across(lattice)`; antennas off the line see it.
    """
    forward, upward = across(lattice)
    up = np.full(r.size, height)
    ahead = np.sqrt(np.maximum(r * r * (1.0 - u * u) - up * up, 0.0))
    total = -2.0 * (r[None, :] - lattice.point_of_pair[pairs][:, None] * u[None, :])
    for element, index in ((problem.tx, lattice.tx), (problem.rx, lattice.rx)):
        place = ((element - lattice.centre) @ np.stack([lattice.axis, forward, upward], axis=1))[index[pairs]]
        place[np.abs(place) < ON_LINE] = 0.0
        # Analytic in u beyond 1 too, where the guard of the polar grid may lie.
        d2 = r * r + np.sum(place**2, axis=1)[:, None] - 2.0 * np.outer(place[:, 0], r * u)
        if place[:, 1:].any():
            d2 = d2 - 2.0 * (np.outer(place[:, 1], ahead) + np.outer(place[:, 2], up))
        total += np.sqrt(np.maximum(d2, 0.0))
    return np.asarray(total)


def antennas_off_line(problem: Problem, lattice: Lattice) -> bool:
    """Whether any antenna stands off the lattice's line."""
    offset = np.concatenate([problem.tx, problem.rx]) - lattice.centre
    return bool(np.linalg.norm(offset - np.outer(offset @ lattice.axis, lattice.axis), axis=1).max() > ON_LINE)


def spreads(problem: Problem, lattice: Lattice, sector: Sector, height: float, curvature: float) -> tuple[float, float]:
    """Largest slopes of ``E - curvature (1 - u^2) / r`` along r [m/m] and along u [m].

    Times the wavenumber they are what E adds to the width of the image's spectrum, and so to the polar grid's sampling.
    """
    rng = np.random.default_rng(0)
    pairs = rng.integers(0, lattice.tx.size, 200)
    r, u = (
        grid.ravel()
        for grid in np.meshgrid(
            np.geomspace(sector.near, sector.far, 8), np.linspace(sector.u_low, sector.u_high, 13), indexing="ij"
        )
    )

    def rest(r: Array, u: Array) -> Array:
        return remainder(problem, lattice, pairs, r, u, height) - curvature * (1.0 - u * u) / r

    dr, du = 1e-4 * sector.near, 1e-4
    along_r = np.abs(rest(r + dr, u) - rest(r - dr, u)).max() / (2.0 * dr)
    along_u = np.abs(rest(r, u + du) - rest(r, u - du)).max() / (2.0 * du)
    return float(along_r), float(along_u)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def product(left, right):  # type: ignore[no-untyped-def]
    """The matrix product of two small complex matrices, on this thread alone."""
    out = np.zeros((left.shape[0], right.shape[1]), np.complex128)
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            factor = left[i, k]
            for j in range(right.shape[1]):
                out[i, j] += factor * right[k, j]
    return out


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def pivoted_basis(rows, tolerance, most):  # type: ignore[no-untyped-def]
    """Rows picked by pivoted modified Gram-Schmidt, and the orthonormal basis they span.

    Stops when the rest is under `tolerance` of the whole in the Frobenius norm; `rows` is overwritten. LAPACK's pivoted
    QR would factor the whole matrix, and wait for its threads at every column.
    """
    n, m = rows.shape
    power = np.zeros(n)
    for i in range(n):
        for j in range(m):
            power[i] += rows[i, j].real ** 2 + rows[i, j].imag ** 2
    enough = tolerance**2 * power.sum()
    picked = np.zeros(min(n, m), np.int64)
    basis = np.zeros((min(n, m), m), np.complex128)
    count = 0
    while count < min(n, m, most) and (count == 0 or power.sum() > enough):
        best = np.argmax(power)
        size = 0.0
        for j in range(m):
            size += rows[best, j].real ** 2 + rows[best, j].imag ** 2
        size = np.sqrt(size)
        if size == 0.0:
            break
        unit = basis[count]
        for j in range(m):
            unit[j] = rows[best, j] / size
        for i in range(n):
            re, im = 0.0, 0.0
            for j in range(m):
                re += unit[j].real * rows[i, j].real + unit[j].imag * rows[i, j].imag
                im += unit[j].real * rows[i, j].imag - unit[j].imag * rows[i, j].real
            left = 0.0
            for j in range(m):
                a = rows[i, j].real - (re * unit[j].real - im * unit[j].imag)
                b = rows[i, j].imag - (re * unit[j].imag + im * unit[j].real)
                rows[i, j] = complex(a, b)
                left += a * a + b * b
            power[i] = left
        power[best] = 0.0
        picked[count] = best
        count += 1
    return picked[:count], basis[:count]


def _sample_pairs(lattice: Lattice, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Pairs that stand for all: some at random, some on a Chebyshev grid of the elements."""
    total = lattice.tx.size
    if total <= count + END_SAMPLES**2:
        return np.arange(total)
    t = 0.5 - 0.5 * np.cos(np.pi * np.arange(END_SAMPLES) / (END_SAMPLES - 1))
    i, k = (np.unique(np.rint(t * index.max()).astype(int)) for index in (lattice.tx, lattice.rx))
    chosen = np.isin(lattice.tx, i) & np.isin(lattice.rx, k)
    return np.union1d(np.flatnonzero(chosen), rng.integers(0, total, count))


def _arcsine(rng: np.random.Generator, low: float, high: float, n: int) -> Array:
    """Random numbers with the density of Chebyshev points, both ends included."""
    t = np.cos(np.pi * rng.random(n))
    t[:2] = -1.0, 1.0
    return 0.5 * (low + high) + 0.5 * (high - low) * rng.permutation(t)


def find_nodes(problem: Problem, lattice: Lattice, sector: Sector, height: float, tolerance: float) -> Nodes:
    """The fewest nodes found whose root-mean-square error over the sector stays under `tolerance`.

    Raises
    ------
    UnsuitedError
        If they are too many, or V too rough to be tabulated.
    """
    rng = np.random.default_rng(0)
    k_low, k, k_high = float(problem.k[0]), float(problem.k[problem.k.size // 2]), float(problem.k[-1])
    turns = k * lattice.curvature(problem) / sector.near
    pairs = _sample_pairs(lattice, int(PAIR_SAMPLES + 10.0 * turns), rng)
    test_pairs = rng.integers(0, lattice.tx.size, TEST_POINTS)
    # 1/r reaches further out than the sector, so that scaling the wavenumber stays inside.
    low, high = k_low / k / sector.far * 0.999, k_high / k / sector.near * 1.001

    def path(inverse: Array, u: Array, of: NDArray[np.int64] = pairs) -> Array:
        return remainder(problem, lattice, of, 1.0 / inverse, u, height)

    off_line = antennas_off_line(problem, lattice)
    warp_low, warp_high = warp(np.array([sector.u_low, sector.u_high]), off_line)
    draws = int(CANDIDATES + 15.0 * turns)
    inverse, u = _arcsine(rng, low, high, draws), _arcsine(rng, sector.u_low, sector.u_high, draws)
    rest = path(inverse, u)
    picked, basis = pivoted_basis(np.exp(1j * k * rest.T), tolerance, MAXIMUM_NODES + 1)
    if picked.size > MAXIMUM_NODES:
        raise UnsuitedError(f"more than {MAXIMUM_NODES} nodes")
    rest = np.ascontiguousarray(rest[:, picked])
    test_base = np.exp(1j * k * path(inverse[picked], u[picked], test_pairs))
    base = np.exp(1j * k * rest)
    onto = np.ascontiguousarray(basis.conj())
    solver = scipy.linalg.solve_triangular(product(onto, base), np.eye(picked.size, dtype=np.complex128))

    def coordinates(columns: Complex) -> Complex:
        return np.asarray(product(solver, product(onto, columns)))

    wavenumber = chebyshev(k_low, k_high, WAVENUMBER_NODES)
    moved = np.stack([coordinates(np.exp(1j * each * rest)) for each in wavenumber])
    spread = chebyshev_matrix(k_low, k_high, WAVENUMBER_NODES, problem.k)
    transfer = np.tensordot(spread, moved, axes=1)
    # Tabulate V ever more finely until it holds between the Chebyshev points, at both ends of the band.
    test_inverse = rng.uniform(1.0 / sector.far, 1.0 / sector.near, TEST_POINTS)
    test_u = rng.uniform(sector.u_low, sector.u_high, TEST_POINTS)
    test_rest = path(test_inverse, test_u, test_pairs)
    n_r, n_u = int(8 + turns * (1.0 - sector.near / sector.far)), int(12 + turns * (sector.u_high - sector.u_low))
    error = float("inf")
    for _ in range(TABLE_REFINEMENTS):
        warped = chebyshev(warp_low, warp_high, n_u)
        grid = np.meshgrid(chebyshev(low, high, n_r), np.sin(warped) if off_line else warped, indexing="ij")
        value = coordinates(np.exp(1j * k * path(grid[0].ravel(), grid[1].ravel()))).T.reshape(n_r, n_u, -1)
        to_r = chebyshev_matrix(low, high, n_r, test_inverse)
        to_u = chebyshev_matrix(warp_low, warp_high, n_u, warp(test_u, off_line))
        at_tests = np.einsum("ta,tb,abq->qt", to_r, to_u, value, optimize=True)
        previous, error = error, 0.0
        for m in (0, problem.k.size // 2, problem.k.size - 1):
            made = product(test_base, product(np.ascontiguousarray(transfer[m]), at_tests))
            wanted_factors = np.exp(1j * float(problem.k[m]) * test_rest)
            error = max(error, float(np.sqrt(np.mean(np.abs(made - wanted_factors) ** 2))))
        if error <= 1.5 * tolerance or error > 0.8 * previous:
            break
        n_r, n_u = int(1.4 * n_r), int(1.4 * n_u)
        if n_r * n_u > LARGEST_TABLE:
            raise UnsuitedError("the nodes' values vary too fast to be tabulated")
    return Nodes(1.0 / inverse[picked], u[picked], transfer, value, low, high, off_line, error)
