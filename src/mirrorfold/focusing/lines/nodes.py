"""Nodes: a few pixels whose curvature phases determine those of all other pixels of a sector.

E(pair; p) is the part of a pair's path that the lattice does not describe (see `lattice`). It varies so slowly over a
sector of the image that the phase factors ``exp(j k E(pair; p))`` of all pairs span a space of few dimensions. Pivoted
Gram-Schmidt picks nodes, pixels p_q whose factors span it (interpolative decomposition, Cheng et al. 2005)::

    exp(j k E(pair; p)) ~ sum_q',q exp(j k_q' E(pair; p_q')) W_q'q(k) V_q(p).

V is a smooth function of the pixel, tabulated on Chebyshev points of (1/r, w). W takes the nodes from the middle
wavenumber to k. Both are least-squares fits over a random choice of pairs. Where both foci are one point of one line, E
is nearly proportional to 1/r. Then a change of the wavenumber acts like a change of range, and all k_q are the middle
wavenumber. Elsewhere the nodes, and the pairs to which V is fitted, are drawn from the whole band.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array, Complex
from mirrorfold.focusing.lines.lattice import Lattice
from mirrorfold.focusing.problem import Problem, UnsuitedError

PAIR_SAMPLES = 500
"""Least number of random pairs that stand for all; more are drawn where many nodes are expected."""

END_SAMPLES = 20
"""Elements of either array that are also paired, all with all: denser towards the ends, where phases vary most."""

CANDIDATES = 350
"""Least number of pixels that are drawn as candidates for nodes."""

PAIRS_A_RADIAN, CANDIDATES_A_RADIAN = 10.0, 15.0
"""Further pairs and candidates for each radian of the largest curvature phase, with which the number of nodes grows."""

TEST_POINTS = 250
"""Number of random pixels, and of random pairs, on which V is tested between the Chebyshev points."""

ACCEPTED, NO_GAIN, FINER = 1.5, 0.8, 1.4
"""A table of V is taken if its error is at most `ACCEPTED` times the tolerance, or more than `NO_GAIN` times that of
the table before; the next table has `FINER` times as many points along either axis."""

TABLE_REFINEMENTS = 5
"""Largest number of tables of V that are tried, each finer; the error of the last one is accepted as it is."""

LARGEST_TABLE = 40_000
"""Largest number of Chebyshev points at which V is tabulated."""

WAVENUMBER_NODES = 8
"""Chebyshev points in wavenumber from which W is interpolated to every frequency."""

MAXIMUM_NODES = 150
"""Largest number of nodes: with more, the exact kernel is as fast."""

PROBE_PAIRS, PROBE_CANDIDATES = 200, 180
"""Number of random pairs and pixels from which the number of nodes is estimated while a plan is laid out."""

PROBED = 120.0
"""Where the estimate is this many nodes, there are twice as many: few pairs and pixels miss a share of the nodes that
grows with the square of their number, a tenth of 40, a quarter of 60 (measured on 200 sectors of random geometries)."""

INDEPENDENT = 0.1
"""Singular values below this share of the tolerance, relative to the largest, count as zero."""

TIE = 1e-9
"""Rows whose squared lengths differ by this share count as equally long: far above rounding, far below any gain."""

EQUATIONS, SPARE_EQUATIONS = 8, 150
"""V and W are fitted to EQUATIONS pairs for each node, and SPARE_EQUATIONS more."""


class Sector(NamedTuple):
    """A part of the image: an interval of the range [m], and one of the second coordinate w (see `lattice`)."""

    near: float
    far: float
    w_low: float
    w_high: float


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a sector, and the functions V and W by which they determine its other pixels.

    Attributes
    ----------
    range, direction, wavenumber : (nodes,) arrays
        Polar coordinates r [m] and w of the node pixels, and the wavenumber [rad/m] at which they are taken.
    transfer : (frequencies, nodes, nodes) complex array
        W: from the nodes at the middle wavenumber to each wavenumber.
    value : (inverse ranges, directions, nodes) complex array
        V at the Chebyshev points of the sector.
    inverse_low, inverse_high : float [1/m]
        Interval of 1/r that the Chebyshev points span.
    error : float
        Root-mean-square error of the phase factors over pairs and pixels: the relative error of white noise imaged.
    """

    range: Array
    direction: Array
    wavenumber: Array
    transfer: Complex
    value: Complex
    inverse_low: float
    inverse_high: float
    error: float


def chebyshev(low: float, high: float, n: int) -> Array:
    """The n Chebyshev points of the interval [low, high]."""
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


def remainder(problem: Problem, lattice: Lattice, pairs: NDArray[np.int64], r: Array, w: Array) -> Array:
    """E(pair; p) [m] for pixels at range r in direction w: the path less ``2 (r - X_s u)``, shape (pairs, pixels)."""
    along, ahead = lattice.direction(w)
    distance = lattice.distance(r, w)
    total = -2.0 * (r[None, :] - lattice.point_of_pair[pairs][:, None] * along[None, :])
    for element, index in ((problem.tx, lattice.tx), (problem.rx, lattice.rx)):
        place = lattice.places(element)[index[pairs]]
        # Squared distance by the law of cosines: analytic in w beyond the sector too, where the polar grid has guards.
        d2 = distance**2 + np.sum(place**2, axis=1)[:, None] - 2.0 * np.outer(place[:, 0], distance * along)
        if place[:, 1].any():
            d2 = d2 - 2.0 * np.outer(place[:, 1], distance * ahead)
        total += np.sqrt(np.maximum(d2, 0.0))
    return np.asarray(total)


def largest_slopes(problem: Problem, lattice: Lattice, sector: Sector, curvature: float) -> tuple[float, float]:
    """Largest slopes of ``E - curvature (1 - u^2) / r`` along r [m/m] and along w [m], over random pairs.

    Multiplied by the wavenumber, they widen the image's spectrum, so that the polar grid must be sampled more finely.
    """
    rng = np.random.default_rng(0)
    pairs = rng.integers(0, lattice.tx.size, 200)
    r, w = (
        grid.ravel()
        for grid in np.meshgrid(
            np.geomspace(sector.near, sector.far, 8), np.linspace(sector.w_low, sector.w_high, 13), indexing="ij"
        )
    )

    def remainders(r: Array, w: Array) -> Array:
        along, _ = lattice.direction(w)
        return remainder(problem, lattice, pairs, r, w) - curvature * (1.0 - along**2) / r

    dr, dw = 1e-4 * sector.near, 1e-4
    along_r = np.abs(remainders(r + dr, w) - remainders(r - dr, w)).max() / (2.0 * dr)
    along_w = np.abs(remainders(r, w + dw) - remainders(r, w - dw)).max() / (2.0 * dw)
    return float(along_r), float(along_w)


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def pivoted_rows(rows, tolerance, most):  # type: ignore[no-untyped-def]
    """Indices of at most `most` rows that nearly span all rows, picked by pivoted modified Gram-Schmidt.

    Stops when what is left of all rows is below `tolerance` of the rows, in the Frobenius norm; `rows` is overwritten.
    LAPACK's pivoted QR would factor the whole matrix, and wait for its threads at every column.
    """
    n, m = rows.shape
    power = np.zeros(n)
    for i in range(n):
        for j in range(m):
            power[i] += rows[i, j].real ** 2 + rows[i, j].imag ** 2
    enough = tolerance**2 * power.sum()
    picked = np.zeros(min(n, m), np.int64)
    unit = np.zeros(m, rows.dtype)
    count = 0
    while count < min(n, m, most) and (count == 0 or power.sum() > enough):
        # At first all rows of phase factors are equally long, and rounding must not choose among them.
        best = np.argmax(power >= power.max() * (1.0 - TIE))
        size = 0.0
        for j in range(m):
            size += rows[best, j].real ** 2 + rows[best, j].imag ** 2
        size = np.sqrt(size)
        if size == 0.0:
            break
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
    return picked[:count]


def _sample_pairs(lattice: Lattice, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of pairs that stand for all: `count` at random, and all pairs of END_SAMPLES elements of either array."""
    total = lattice.tx.size
    if total <= count + END_SAMPLES**2:
        return np.arange(total)
    t = 0.5 - 0.5 * np.cos(np.pi * np.arange(END_SAMPLES) / (END_SAMPLES - 1))
    i, k = (np.unique(np.rint(t * index.max()).astype(int)) for index in (lattice.tx, lattice.rx))
    chosen = np.isin(lattice.tx, i) & np.isin(lattice.rx, k)
    return np.union1d(np.flatnonzero(chosen), rng.integers(0, total, count))


def _arcsine(rng: np.random.Generator, low: float, high: float, n: int) -> Array:
    """Random numbers (n,) in [low, high] with the density of Chebyshev points, both ends among them."""
    t = np.cos(np.pi * rng.random(n))
    t[:2] = -1.0, 1.0
    return 0.5 * (low + high) + 0.5 * (high - low) * rng.permutation(t)


class _Draw(NamedTuple):
    """Candidates for nodes: inverse range [1/m], direction, wavenumber [rad/m]."""

    inverse: Array
    w: Array
    k: Array


def _inverse_range(problem: Problem, sector: Sector) -> tuple[float, float]:
    """Interval of 1/r [1/m], wider than the sector: it holds the ranges r k_c / k for all wavenumbers k of the band."""
    k_low, k, k_high = float(problem.k[0]), problem.middle_wavenumber, float(problem.k[-1])
    return k_low / k / sector.far * 0.999, k_high / k / sector.near * 1.001


def _draw(problem: Problem, lattice: Lattice, sector: Sector, count: int, rng: np.random.Generator) -> _Draw:
    """Random candidates for nodes over a sector."""
    low, high = _inverse_range(problem, sector)
    inverse, w = _arcsine(rng, low, high, count), _arcsine(rng, sector.w_low, sector.w_high, count)
    k = problem.middle_wavenumber
    if lattice.scales:
        return _Draw(inverse, w, np.full(count, k))
    # As wide as the products of the band's wavenumbers and the factors of `_relative_wavenumbers`.
    return _Draw(inverse, w, _arcsine(rng, problem.k[0] ** 2 / k, problem.k[-1] ** 2 / k, count))


def _relative_wavenumbers(problem: Problem, lattice: Lattice, count: int, rng: np.random.Generator) -> Array:
    """Random wavenumbers, as multiples of the middle one, at which `count` pairs are fitted."""
    if lattice.scales:
        return np.ones(count)
    k = problem.k / problem.middle_wavenumber
    return _arcsine(rng, float(k[0]), float(k[-1]), count)


def count_nodes(problem: Problem, lattice: Lattice, sector: Sector, tolerance: float) -> int:
    """Number of nodes that a sector will need, estimated from few pairs and pixels to within a tenth.

    Raises
    ------
    UnsuitedError
        If there are too many.
    """
    rng = np.random.default_rng(0)
    total = lattice.tx.size
    pairs = rng.integers(0, total, PROBE_PAIRS)
    draw = _draw(problem, lattice, sector, PROBE_CANDIDATES, rng)
    remainders = remainder(problem, lattice, pairs, 1.0 / draw.inverse, draw.w)
    remainders *= _relative_wavenumbers(problem, lattice, pairs.size, rng)[:, None]
    found = pivoted_rows(np.exp(1j * draw.k * remainders).T.copy(), tolerance, MAXIMUM_NODES).size
    if found >= MAXIMUM_NODES:
        raise UnsuitedError(f"more than {MAXIMUM_NODES} nodes")
    return min(int(found * (1.0 + (found / PROBED) ** 2)), MAXIMUM_NODES)


def table_size(problem: Problem, sector: Sector, slopes: tuple[float, float]) -> tuple[int, int]:
    """Number of Chebyshev points in 1/r and in w of the first table of V, from the phases that the slopes make."""
    half = 0.5 * problem.middle_wavenumber
    depth, width = sector.near * (1.0 - sector.near / sector.far), sector.w_high - sector.w_low
    return int(8 + half * slopes[0] * depth), int(12 + half * slopes[1] * width)


def find_nodes(
    problem: Problem, lattice: Lattice, sector: Sector, tolerance: float, slopes: tuple[float, float]
) -> Nodes:
    """The nodes of a sector, as few as are found to keep the root-mean-square error near `tolerance`, with V and W.

    Parameters
    ----------
    problem : Problem
    lattice : Lattice
    sector : Sector
    tolerance : float
    slopes : pair of float
        Largest slopes of E without its curvature along r [m/m] and w [m], from `largest_slopes`.

    Raises
    ------
    UnsuitedError
        If there are too many nodes, or V varies too fast to be tabulated.
    """
    rng = np.random.default_rng(0)
    k_low, k, k_high = float(problem.k[0]), problem.middle_wavenumber, float(problem.k[-1])
    phase = k * lattice.curvature(problem) / sector.near  # largest curvature phase [rad]
    wanted = int(PAIR_SAMPLES + PAIRS_A_RADIAN * phase)
    pairs = _sample_pairs(lattice, wanted, rng)
    if not lattice.scales:
        pairs = np.tile(pairs, -(-wanted // pairs.size))  # a few pairs are fitted at several wavenumbers each
    test_pairs = rng.integers(0, lattice.tx.size, TEST_POINTS)
    low, high = _inverse_range(problem, sector)

    def remainder_at(of: NDArray[np.int64], inverse: Array, w: Array) -> Array:
        return remainder(problem, lattice, of, 1.0 / inverse, w)

    draw = _draw(problem, lattice, sector, int(CANDIDATES + CANDIDATES_A_RADIAN * phase), rng)
    remainders = remainder_at(pairs, draw.inverse, draw.w)
    scale = _relative_wavenumbers(problem, lattice, pairs.size, rng)[:, None]
    picked = pivoted_rows(np.exp(1j * draw.k * (scale * remainders)).T.copy(), tolerance, MAXIMUM_NODES + 1)
    if picked.size > MAXIMUM_NODES:
        raise UnsuitedError(f"more than {MAXIMUM_NODES} nodes")
    inverse, w, node_k = (part[picked] for part in draw)
    # A few times as many equations (pairs) as unknowns (nodes) determine the fits as well as all pairs would.
    subset = rng.permutation(pairs.size)[: int(EQUATIONS * picked.size) + SPARE_EQUATIONS]
    pairs, scale, remainders = pairs[subset], scale[subset], remainders[np.ix_(subset, picked)]
    test_factors = np.exp(1j * node_k * remainder_at(test_pairs, inverse, w))
    basis, triangle = np.linalg.qr(np.exp(1j * node_k * (scale * remainders)))
    fit = scipy.linalg.solve_triangular(triangle, basis.conj().T)

    factors_at = [np.exp(1j * (each / k) * node_k * remainders) for each in chebyshev(k_low, k_high, WAVENUMBER_NODES)]
    # Nodes that differ only in wavenumber are nearly equal at the middle one: take the smallest coefficients.
    fit_k_c = fit if lattice.scales else np.linalg.pinv(np.exp(1j * node_k * remainders), rcond=INDEPENDENT * tolerance)
    moved = np.stack([fit_k_c @ columns for columns in factors_at])
    transfer = np.tensordot(chebyshev_matrix(k_low, k_high, WAVENUMBER_NODES, problem.k), moved, axes=1)
    # Tabulate V ever more finely, until test pixels and test pairs agree at both ends and in the middle of the band.
    test_inverse = rng.uniform(1.0 / sector.far, 1.0 / sector.near, TEST_POINTS)
    test_w = rng.uniform(sector.w_low, sector.w_high, TEST_POINTS)
    test_remainders = remainder_at(test_pairs, test_inverse, test_w)
    n_r, n_w = table_size(problem, sector, slopes)
    error = float("inf")
    for _ in range(TABLE_REFINEMENTS):
        grid = np.meshgrid(chebyshev(low, high, n_r), chebyshev(sector.w_low, sector.w_high, n_w), indexing="ij")
        at_points = np.exp(1j * k * (scale * remainder_at(pairs, grid[0].ravel(), grid[1].ravel())))
        value = (fit @ at_points).T.reshape(n_r, n_w, -1)
        to_r = chebyshev_matrix(low, high, n_r, test_inverse)
        to_w = chebyshev_matrix(sector.w_low, sector.w_high, n_w, test_w)
        at_tests = np.matmul(to_w[:, None, :], np.tensordot(to_r, value, axes=1))[:, 0].T
        previous, error = error, 0.0
        for m in (0, problem.k.size // 2, problem.k.size - 1):
            made = test_factors @ (transfer[m] @ at_tests)
            wanted_factors = np.exp(1j * float(problem.k[m]) * test_remainders)
            error = max(error, float(np.sqrt(np.mean(np.abs(made - wanted_factors) ** 2))))
        if error <= ACCEPTED * tolerance or error > NO_GAIN * previous:
            break
        n_r, n_w = int(FINER * n_r), int(FINER * n_w)
        if n_r * n_w > LARGEST_TABLE:
            raise UnsuitedError("the nodes' values vary too fast to be tabulated")
    return Nodes(1.0 / inverse, w, node_k, transfer, value, low, high, error)
