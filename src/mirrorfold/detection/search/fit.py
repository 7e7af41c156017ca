"""Step 2, within the search: the line or plane of a mirror, fitted to the image itself, not to single echoes.

A tenth of a degree is what folding asks for. The centre of power across the mirror, place by place, gives it, where
single echoes stray by speckle. Where a wall scatters from inside, `mirrorfold.detection.search.fronts` tells its face.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from mirrorfold.common.types import Array, Index
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.view import View

PROFILE_SAMPLES = 61
"""Samples of a profile across a mirror."""

FEWEST_PLACES = 4
"""Fewest places along a mirror that a line is fitted to."""

ROUNDS = 3
"""Rounds of a fit: each begins where the one before has led."""

BLOCK_CELLS, FEWEST_BLOCKS = 4.0, 6
"""Resolution cells to a block of a mirror, whose speckle hardly depends on that of the next; and how many at least tell
by how much blocks differ."""

M = TypeVar("M", bound=Mirror)


def flat(points: Array, weight: Array) -> tuple[Array, Array]:
    """Unit normal and centroid of the line or plane with the least weighted squared distances to points (n, d)."""
    center = weight @ points / weight.sum()
    offset = points - center
    return np.linalg.eigh((offset * weight[:, None]).T @ offset)[1][:, 0], center


def cell_side(along: Array, independent: float) -> float:
    """Side [m] of an independent cell of those that positions along a mirror (n, d - 1) [m] cover."""
    return float((np.prod(np.ptp(along, axis=0)) / independent) ** (1.0 / along.shape[1]))


def blocks(along: Array, side: float, cells: float, *, fewest: int) -> Index:
    """Numbers of the blocks that positions along a mirror (n, d - 1) [m] fall into, each of so many cells, (n,).

    There are at least `fewest` along each direction.
    """
    first, size = along.min(axis=0), np.maximum(np.ptp(along, axis=0), np.finfo(float).tiny)
    count = np.maximum(np.rint(size / (side * cells ** (1.0 / along.shape[1]))), fewest)
    place = np.minimum(((along - first) / size * count).astype(np.intp), count.astype(np.intp) - 1)
    return np.unique(np.ravel_multi_index(tuple(place.T), tuple(count.astype(np.intp))), return_inverse=True)[1]


SIGMA_PER_MEDIAN = 1.4826
"""Standard deviation of normally distributed errors over the median of their sizes."""

KINKS = 13
"""Places that are tried for a kink."""


BREAKS, TRIED_BREAKS = (0.1, 0.9), 33
"""Share of a row where it may fall into two, and places that are tried."""


class Fit(NamedTuple):
    """A line or plane through points: normal and center (d,), how far [m] the points stray from it, robust, and the
    standard errors of its offset [m] and angle [degree].
    """

    normal: Array
    center: Array
    deviation: float
    offset_error: float
    angle_error: float


def robust(points: Array, weight: Array, independent: float) -> Fit:
    """The line or plane through points (n, d), with Cauchy weights against those that stand elsewhere.

    Of the points so many are `independent`: neighbours share a resolution cell and its speckle.
    """
    trust = weight
    for _ in range(ROUNDS):
        normal, center = flat(points, trust)
        beside = (points - center) @ normal
        deviation, trust = trusted(beside, weight, np.finfo(float).tiny)
    tangents = np.linalg.svd(normal[None])[2][1:]
    return Fit(normal, center, deviation, *_errors((points - center) @ tangents.T, beside, trust, independent))


def trusted(beside: Array, weight: Array, least: float) -> tuple[float, Array]:
    """Standard deviation [m] of distances (n,) from a fit, by their median, and Cauchy weights of the next fit, (n,).

    The `least` [m] keeps the deviation of a perfect fit above zero.
    """
    deviation = SIGMA_PER_MEDIAN * float(np.median(np.abs(beside))) + least
    return deviation, weight / (1.0 + (beside / (2.0 * deviation)) ** 2)


def _errors(along: Array, beside: Array, trust: Array, independent: float) -> tuple[float, float]:
    """Standard errors of a fit's offset [m] and angle [degree], the larger one of a plane's two.

    What the points of one block of cells pull at the fit depends on each other, and on no other block's (Liang and
    Zeger, Biometrika 73, 1986). So the errors are as large as blocks differ, and not larger where neighbours stray to
    opposite sides, because the bright speckle between them draws both.
    """
    design = np.column_stack([np.ones(len(along)), along])
    variance = block_covariance(design, beside, trust, along, independent)
    return float(np.sqrt(variance[0, 0])), float(np.degrees(np.sqrt(np.linalg.eigvalsh(variance[1:, 1:])[-1])))


def block_covariance(design: Array, beside: Array, trust: Array, along: Array, independent: float) -> Array:
    """Covariance (p, p) of what the columns of `design` (n, p) fit, from how the blocks of a mirror differ."""
    block = blocks(along, cell_side(along, independent), BLOCK_CELLS, fewest=FEWEST_BLOCKS)
    pull = np.zeros((block.max() + 1, design.shape[1]))
    np.add.at(pull, block, (trust * beside)[:, None] * design)
    bread = np.linalg.pinv(design.T @ (trust[:, None] * design))
    return np.asarray(bread @ pull.T @ pull @ bread * len(pull) / max(len(pull) - design.shape[1], 1))


def left_of_kink(along: Array, beside: Array, weight: Array) -> float:
    """Weighted sum of squares [m^2] by which places (n,) beside a line miss the best line with one kink.

    Two straight walls that touch are such a line. A kink nearer to an end than a fifth of the row is none.
    """
    root, left = np.sqrt(weight), np.inf
    for kink in along.min() + np.linspace(0.2, 0.8, KINKS) * np.ptp(along):
        design = np.column_stack([np.ones_like(along), along, np.maximum(along - kink, 0.0)])
        slopes = np.linalg.lstsq(root[:, None] * design, root * beside, rcond=None)[0]
        left = min(left, float(np.sum(weight * (beside - design @ slopes) ** 2)))
    return left


def refined(mirror: M, view: View, reach: float, lobe: float, clip: float) -> tuple[M, float]:
    """A mirror moved to the line or plane through the centres of power across it, and how far [m] these stray.

    `reach`, `lobe` and `clip` are those of `centres`.
    """
    deviation = np.inf
    for _ in range(ROUNDS):
        points, weight = centres(mirror, view, reach, lobe, clip)
        if len(points) < FEWEST_PLACES:
            return mirror, np.inf
        fit = robust(points, weight, mirror.independent(view))
        mirror = mirror.moved(fit.normal, fit.center)
        mirror, deviation = replace(mirror, angle_error=fit.angle_error, offset_error=fit.offset_error), fit.deviation
        if not np.isfinite(mirror.places(view)).all():  # it has turned away from lines of sight that should meet it
            return mirror, np.inf
    return mirror, deviation


def centres(mirror: Mirror, view: View, reach: float, lobe: float, clip: float) -> tuple[Array, Array]:
    """Centres of power across a mirror, (n, d) [m], and their weight, (n,).

    Profiles across the mirror are taken up to `reach` widths of the resolution cell to either side, their main lobes
    down to the amplitude `lobe` relative to their peaks. Places weigh with their power up to `clip` times the median.
    """
    base = mirror.places(view)
    across = view.extent_each(base, mirror.facing(base)[1])
    depth = across[:, None] * np.linspace(-reach, reach, PROFILE_SAMPLES)
    beyond, power = mirror.profiles(view, base, depth)
    peak = power.max(axis=1)
    power[power < lobe**2 * peak[:, None]] = 0.0
    total = power.sum(axis=1)
    lit = np.flatnonzero(total > 0.0)
    if not lit.size:
        return np.empty((0, view.dimensions)), np.empty(0)
    power *= depth
    centroid = power.sum(axis=1)[lit] / total[lit]
    weight = np.minimum(peak[lit] / np.median(peak[lit]), clip) / across[lit] ** 2
    return np.asarray(base[lit] + centroid[:, None] * beyond[lit]), weight


def broken(along: Array, beside: Array, weight: Array) -> tuple[float, float]:
    """Where places (n,) along and beside a line are best taken for two lines that need not touch, and what these leave.

    Returns the place between the two [m], and their weighted sum of squares relative to that of one line.
    """
    order = np.argsort(along)
    x, y, w = along[order] - along.mean(), beside[order] - beside.mean(), weight[order]
    # Sums over all places before each, of which those of any part of the row follow.
    before = np.cumsum(np.column_stack([w, w * x, w * y, w * x * x, w * x * y, w * y * y]), axis=0)
    ends = np.unique(np.searchsorted(x, x[0] + np.linspace(*BREAKS, TRIED_BREAKS) * (x[-1] - x[0])))
    ends = ends[(ends > 2) & (ends < len(x) - 2)]
    if not ends.size:
        return float(along.max()), 1.0
    left = _left_of_line(before[ends - 1]) + _left_of_line(before[-1] - before[ends - 1])
    least = int(np.argmin(left))
    end = int(ends[least])
    place = 0.5 * (x[end - 1] + x[end]) + along.mean()
    return float(place), float(left[least] / max(float(_left_of_line(before[-1])), np.finfo(float).tiny))


def bowed(along: Array, beside: Array, weight: Array) -> float:
    """What the best parabola leaves of places (n,) along and beside a line, relative to what the best line leaves."""
    x, root = (along - along.mean()) / max(float(np.ptp(along)), np.finfo(float).tiny), np.sqrt(weight)
    design, left = np.vander(x, 3, increasing=True), []
    for terms in (2, 3):
        fit = np.linalg.lstsq(root[:, None] * design[:, :terms], root * beside, rcond=None)[0]
        left.append(float(np.sum(weight * (beside - design[:, :terms] @ fit) ** 2)))
    return left[1] / max(left[0], float(np.finfo(float).tiny))


def _left_of_line(sums: Array) -> Array:
    """Weighted squares that the best straight line leaves, (...), from sums (..., 6) of w, wx, wy, wxx, wxy and wyy."""
    w, x, y, xx, xy, yy = np.moveaxis(sums, -1, 0)
    turn, lean = xx - x * x / w, xy - x * y / w
    return np.asarray(np.maximum(yy - y * y / w - lean**2 / np.maximum(turn, np.finfo(float).tiny), 0.0))
