"""Step 2, within the search: the line or plane of a mirror, fitted to the image itself, not to single echoes.

Folding needs the direction of a mirror to a tenth of a degree, and speckle moves single echoes too much for that. So at
places along the mirror, the centroid of power across it is computed, and a line or plane is fitted to these centroids.
Where a wall scatters from inside, they lie behind its face, which `mirrorfold.detection.search.fronts` finds.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from mirrorfold.common.statistics import robust_deviation
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.views.view import View

PROFILE_SAMPLES = 61
"""Number of samples of a profile across a mirror."""

FEWEST_PLACES = 4
"""Least number of places along a mirror to which a line is fitted."""

ROUNDS = 3
"""Number of iterations of a fit: each begins with the result of the one before."""

BLOCK_CELLS, FEWEST_BLOCKS = 4.0, 3
"""Size of a block of a mirror in resolution cells, so large that the speckle of neighbouring blocks is nearly
independent; and least number of blocks along a direction for each parameter along it, an offset, an angle, or a
curvature: if blocks are fewer, each is fitted so well by parameters of its own that it tells little of errors."""

ROUNDING = 1e-9
"""Share of a block within which a position counts as on its border: far more than rounding errors."""

KINKS, KINK_SHARES = 13, (0.2, 0.8)
"""Number of places at which a kink of a row is tried; and the first and last one, as shares of the row's length: a
shorter part says little of a direction."""

BREAKS, TRIED_BREAKS = (0.1, 0.9), 33
"""First and last place where a row may break into two, as shares of its length; and number of places that are tried."""

Flat = TypeVar("Flat", LineMirror, PlaneMirror)
"""Mirrors that are fitted by moving them: what is curved has a fit of its own."""


def flat(points: Array, weight: Array) -> tuple[Array, Array]:
    """Unit normal and centroid of the line or plane through points (n, d), by weighted total least squares."""
    center = weight @ points / weight.sum()
    offset = points - center
    return np.linalg.eigh((offset * weight[:, None]).T @ offset)[1][:, 0], center


def cell_side(along: Array, independent: float) -> float:
    """Side [m] of a cell, if the extent of positions (n, d - 1) [m] along a mirror holds `independent` such cells."""
    return float((np.prod(np.ptp(along, axis=0)) / independent) ** (1.0 / along.shape[1]))


def blocks(along: Array, side: float, cells: float, *, fewest: int) -> Index:
    """Number of the block that each of the positions (n, d - 1) [m] along a mirror lies in, (n,).

    A block holds so many `cells`, each with the given `side` [m]. There are at least `fewest` blocks along each
    direction.
    """
    first, size = along.min(axis=0), np.maximum(np.ptp(along, axis=0), np.finfo(float).tiny)
    count = np.maximum(np.rint(size / (side * cells ** (1.0 / along.shape[1]))), fewest)
    # Pixels of a grid may stand on the border of two blocks: rounding must not decide in which.
    place = np.minimum(((along - first) / size * count + ROUNDING).astype(np.intp), count.astype(np.intp) - 1)
    return np.unique(np.ravel_multi_index(tuple(place.T), tuple(count.astype(np.intp))), return_inverse=True)[1]


class Fit(NamedTuple):
    """A line or plane fitted to points.

    Its normal and center (d,), the robust standard deviation [m] of the points' distances from it, and the standard
    errors of its offset [m] and angle [degree]; of the two angles of a plane the larger error.
    """

    normal: Array
    center: Array
    deviation: float
    offset_error: float
    angle_error: float


def robust(points: Array, weight: Array, independent: float) -> Fit:
    """The line or plane through points (n, d), with Cauchy weights, which keep outliers from moving it.

    `independent` is the number of independent points: neighbours share a resolution cell and its speckle.
    """
    trust = weight
    for _ in range(ROUNDS):
        normal, center = flat(points, trust)
        beside = (points - center) @ normal
        deviation, trust = robust_weights(beside, weight, np.finfo(float).tiny)
    along = (points - center) @ np.linalg.svd(normal[None])[2][1:].T
    variance = fit_covariance(np.column_stack([np.ones(len(along)), along]), beside, weight, along, independent)
    angle = np.sqrt(np.linalg.eigvalsh(variance[1:, 1:])[-1])
    return Fit(normal, center, deviation, float(np.sqrt(variance[0, 0])), float(np.degrees(angle)))


def robust_weights(beside: Array, weight: Array, least: float) -> tuple[float, Array]:
    """Robust standard deviation [m] of distances `beside` (n,) from a fit, and Cauchy weights for the next fit, (n,).

    The deviation follows from the median of the absolute distances; `least` [m] keeps that of a perfect fit above zero.
    """
    deviation = robust_deviation(beside) + least
    return deviation, weight / (1.0 + (beside / (2.0 * deviation)) ** 2)


def fit_covariance(design: Array, beside: Array, weight: Array, along: Array, independent: float) -> Array:
    """Covariance (p, p) of the parameters of a fit with Cauchy weights, from how much the blocks of a mirror differ.

    The columns of `design` (n, p) are the derivatives of the distances by these parameters, `beside` (n,) the
    residuals, `weight` (n,) the weights without those of Cauchy, and `along` (n, d - 1) [m] the positions along the
    mirror.
    """
    trust = robust_weights(beside, weight, np.finfo(float).tiny)[1]
    # A point that moves away is trusted less: its pull grows less than its distance, and no more if that is large.
    stiffness = trust * np.maximum(2.0 * trust / weight - 1.0, 0.0)
    return block_covariance(design, trust * beside, stiffness, along, independent)


def block_covariance(design: Array, pull: Array, stiffness: Array, along: Array, independent: float) -> Array:
    """Covariance (p, p) of the parameters of a fit, from how much the blocks of a mirror differ.

    The columns of `design` (n, p) are the derivatives of the residuals by these parameters, `pull` (n,) the weighted
    residuals, which the fit balances, and `stiffness` (n,) the derivatives of these pulls by the residuals; `along` (n,
    d - 1) [m] are the positions along the mirror.

    Points within a block of cells depend on each other, those of different blocks do not. So without each block in
    turn, how much do the parameters change? This is the jackknife (Efron and Stein, Ann. Stat. 9, 1981). It does not
    grow where neighbouring points stray to opposite sides because a bright speckle between them draws both; and it does
    where the line follows the blocks at its ends, which decide about the angle. From few blocks, little is known of how
    much they differ: Student's distribution with v degrees of freedom has the variance v / (v - 2).
    """
    parameters, directions = design.shape[1], along.shape[1]
    fewest = FEWEST_BLOCKS * (parameters + 1 - directions)  # an angle along each direction, and one common offset
    block = blocks(along, cell_side(along, independent), BLOCK_CELLS, fewest=fewest)
    count = int(block.max()) + 1
    size = np.sqrt(np.mean(design**2, axis=0))  # parameters of other units, and scenes of any size, weigh alike
    design = design / size
    score, own = np.zeros((count, parameters)), np.zeros((count, parameters, parameters))
    np.add.at(score, block, pull[:, None] * design)
    np.add.at(own, block, (stiffness[:, None] * design)[:, :, None] * design[:, None])
    change = np.linalg.pinv(own.sum(axis=0) - own, hermitian=True) @ score[..., None]
    freedom = max(count - parameters, 3)
    spread = (change @ change.mT).sum(axis=0) * (count - 1) / count * freedom / (freedom - 2)
    return np.asarray(spread / np.outer(size, size))


def weighted_fit(design: Array, values: Array, weight: Array) -> Array:
    """The coefficients (p,) of the columns of `design` (n, p) that fit values (n,) best, by weighted least squares."""
    root = np.sqrt(weight)
    return np.asarray(np.linalg.lstsq(root[:, None] * design, root * values, rcond=None)[0], dtype=float)


def weighted_residual(design: Array, values: Array, weight: Array) -> float:
    """Weighted sum of squared residuals of values (n,) about their `weighted_fit`."""
    return float(np.sum(weight * (values - design @ weighted_fit(design, values, weight)) ** 2))


def kink_residual(along: Array, beside: Array, weight: Array) -> float:
    """Weighted sum of squared residuals [m^2] of points about the best line with one kink, as of two walls that touch.

    `along` and `beside` (n,) [m] are the positions of the points along a row and their distances from it. The kink is
    at least a fifth of the row away from either end.
    """
    kinks = along.min() + np.linspace(*KINK_SHARES, KINKS) * np.ptp(along)
    designs = (np.column_stack([np.ones_like(along), along, np.maximum(along - kink, 0.0)]) for kink in kinks)
    return min(weighted_residual(design, beside, weight) for design in designs)


def refined(mirror: Flat, view: Any, reach: float, lobe: float, clip: float) -> tuple[Flat, float]:
    """The mirror, moved to the line or plane through the centroids of power across it, with its standard errors.

    Also the robust standard deviation [m] of the centroids from it; infinite where there is no fit. `reach`, `lobe` and
    `clip` are those of `power_centroids`.
    """
    deviation, base = np.inf, mirror.places(view)
    for _ in range(ROUNDS):
        points, weight = power_centroids(mirror, view, reach, lobe, clip, base)
        if len(points) < FEWEST_PLACES:
            return mirror, np.inf
        fit = robust(points, weight, mirror.independent(view))
        mirror = mirror.moved(fit.normal, fit.center)
        mirror, deviation = replace(mirror, angle_error=fit.angle_error, offset_error=fit.offset_error), fit.deviation
        base = mirror.places(view)
        if not np.isfinite(base).all():  # some lines of sight that should meet it now miss it
            return mirror, np.inf
    return mirror, deviation


def power_centroids(
    mirror: Mirror, view: View, reach: float, lobe: float, clip: float, base: Array | None = None
) -> tuple[Array, Array]:
    """Centroids of power across a mirror, (n, d) [m], and their weights, (n,).

    The profiles reach over `reach` widths of the resolution cell to either side of the mirror. Of each profile, samples
    with at least `lobe` times its peak amplitude count, which is its main lobe. A centroid has the weight ``min(P,
    clip) / w^2``, with P the peak power over its median and w the width of the resolution cell across the mirror.
    `base` are the places along the mirror, if they are known.
    """
    base = mirror.places(view) if base is None else base
    across = view.extent_each(base, mirror.facing(base)[1])
    depth = across[:, None] * np.linspace(-reach, reach, PROFILE_SAMPLES)
    beyond, power = mirror.profiles(view, base, depth)
    peak = power.max(axis=1)
    power[power < lobe**2 * peak[:, None]] = 0.0
    total = power.sum(axis=1)
    bright = np.flatnonzero(total > 0.0)
    if not bright.size:
        return np.empty((0, view.dimensions)), np.empty(0)
    power *= depth
    centroid = power.sum(axis=1)[bright] / total[bright]
    weight = np.minimum(peak[bright] / np.median(peak[bright]), clip) / across[bright] ** 2
    return base[bright] + centroid[:, None] * beyond[bright], weight


def split_in_two(along: Array, beside: Array, weight: Array) -> tuple[float, float, float]:
    """Split a row of points into the two that are best fitted by two straight lines, which need not touch.

    `along` and `beside` (n,) [m] are the positions of the points along the row and their distances from it. Returns the
    position [m] between the two rows; the weighted sum of squared residuals of the two lines, relative to that of one
    line; and how far the shorter row leaves the line of the longer one [m].
    """
    order = np.argsort(along)
    x, y, w = along[order] - along.mean(), beside[order] - beside.mean(), weight[order]
    # Cumulative sums along the row: the sums over any part of the row are differences of two of them.
    before = np.cumsum(np.column_stack([w, w * x, w * y, w * x * x, w * x * y, w * y * y]), axis=0)
    ends = np.unique(np.searchsorted(x, x[0] + np.linspace(*BREAKS, TRIED_BREAKS) * (x[-1] - x[0])))
    ends = ends[(ends > 2) & (ends < len(x) - 2)]
    if not ends.size:
        return float(along.max()), 1.0, 0.0
    residual = _line_residual(before[ends - 1]) + _line_residual(before[-1] - before[ends - 1])
    least = int(np.argmin(residual))
    end = int(ends[least])
    place = 0.5 * (x[end - 1] + x[end]) + along.mean()
    left = float(residual[least] / max(float(_line_residual(before[-1])), np.finfo(float).tiny))
    shorter = x[end:] if x[-1] - x[end] < x[end - 1] - x[0] else x[:end]
    lines = np.array([_line(before[end - 1]), _line(before[-1] - before[end - 1])])
    apart = np.diff(lines @ np.vander(shorter[[0, -1]], 2, increasing=True).T, axis=0)
    return float(place), left, float(np.abs(apart).max())


def parabola_residual(along: Array, beside: Array, weight: Array) -> float:
    """Weighted sum of squared residuals of points about the best parabola, relative to that about the best line.

    `along` and `beside` (n,) [m] are the positions of the points along the row and their distances from it.
    """
    x = (along - along.mean()) / max(float(np.ptp(along)), np.finfo(float).tiny)
    line, parabola = (weighted_residual(np.vander(x, terms, increasing=True), beside, weight) for terms in (2, 3))
    return parabola / max(line, float(np.finfo(float).tiny))


def _line(sums: Array) -> Array:
    """The best line, its height at zero and its slope, (2,), from the same sums (6,) as for `_line_residual`."""
    w, x, y, xx, xy, _ = sums
    slope = (xy - x * y / w) / max(xx - x * x / w, np.finfo(float).tiny)
    return np.array([(y - slope * x) / w, slope])


def _line_residual(sums: Array) -> Array:
    """Weighted sum of squared residuals about the best line, (...), from sums (..., 6) of w, wx, wy, wxx, wxy, wyy."""
    w, x, y, xx, xy, yy = np.moveaxis(sums, -1, 0)
    x_squares, xy_products = xx - x * x / w, xy - x * y / w
    return np.maximum(yy - y * y / w - xy_products**2 / np.maximum(x_squares, np.finfo(float).tiny), 0.0)
