"""Circles of the search for arcs: proposed by three echoes, chosen by the rows on them, and fitted to points."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from mirrorfold.common.arcs import circle_through
from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.search.fit import robust_weights, weighted_fit
from mirrorfold.detection.search.rows import heaviest_run

PROPOSALS = 600
"""Number of circles that are proposed for each arc."""

NEAR_CELLS, REACH_CELLS = 2.0, 24.0
"""Least and largest distance, in resolution cells, between echoes that propose a circle: closer ones say nothing of its
curvature."""

PROPOSED_BULGE_CELLS = 0.25
"""Least bulge, in resolution cells, of the three echoes that propose a circle: in an S-shaped row, most of the circles
that pass near many echoes are nearly straight."""

SMALLEST_CELLS, LARGEST_CELLS = 1.2, 400.0
"""Least and largest radius, in resolution cells: a smaller circle is a point, and a larger one is straight over any row
that fits into a room."""

NEAR = 0.35
"""Largest distance of echoes from their row, as a share of the resolution cell across it. It is smaller than for lines,
because the two halves of an S leave each other's circles gradually."""

FEWEST = 6
"""Least number of echoes of an arc."""

FITS = 8
"""Number of times that a circle is fitted with the weights that follow from the fit before."""


def arc_over(middle: Array, radius: float, points: Array, radar: Array) -> ArcMirror:
    """The part of a circle over which points (n, 2) [m] lie, which are all on one side of it."""
    towards = np.mean((points - middle) / np.linalg.norm(points - middle, axis=1)[:, None], axis=0)
    first = float(np.arctan2(towards[1], towards[0])) - np.pi
    whole = ArcMirror(middle, radius, first, 2.0 * np.pi, radar)
    along = whole.along(points)
    return whole.part(float(along.min()), float(along.max()))


def fitted_circle(points: Array, weight: Array, middle: Array, radius: float) -> tuple[Array, float]:
    """The circle that fits points (n, 2) best, its center and radius, by weighted least squares from a first one on.

    Cauchy weights keep outliers from moving it (see `fit.robust_weights`).
    """
    for _ in range(FITS):
        offset = points - middle
        away = np.linalg.norm(offset, axis=1)
        beside = away - radius
        _, trust = robust_weights(beside, weight, np.finfo(float).eps * radius)
        design = np.column_stack([offset / away[:, None], np.ones(len(points))])
        step = weighted_fit(design, beside, trust)
        middle, radius = middle + step[:2], radius + float(step[2])
    return middle, radius


def proposed(points: Array, weight: Array, cells: Array, radar: Array, random: np.random.Generator) -> ArcMirror | None:
    """The most bent row among echoes at points (n, 2) [m], as an arc; None if there is none.

    Three echoes propose a circle. It is worth what it gains over the straight line through its heaviest unbroken row of
    echoes, ``sum of w (min(l / h, 1)^2 - (c / h)^2)``: w is the `weight` (n,) of an echo, l and c are its distances
    from the line and from the circle, and h is half of `NEAR` cells (as in MSAC: Torr and Zisserman, Comput. Vis. Image
    Underst. 78, 2000). So a small pillar is worth more than a long straight wall, and than a circle through two
    objects. `cells` (n,) [m] are the resolution cells of the echoes.
    """
    cell = float(np.median(cells))
    seeds = random.choice(len(points), PROPOSALS, p=weight / weight.sum())
    distance = cdist(points[seeds], points)
    near = (distance > NEAR_CELLS * cell) & (distance < REACH_CELLS * cell)
    a, b = (np.argmax(near * random.random(near.shape), axis=1) for _ in range(2))
    middle, radius = circle_through(points[seeds], points[a], points[b])
    each, apart = np.arange(seeds.size), np.linalg.norm(points[a] - points[b], axis=1)
    valid = near[each, a] & near[each, b] & (apart > NEAR_CELLS * cell) & np.isfinite(radius)
    valid &= (radius > SMALLEST_CELLS * cell) & (radius < LARGEST_CELLS * cell)
    chord = np.maximum(apart, np.maximum(distance[each, a], distance[each, b]))
    # An arc with the chord c bulges by ``c^2 / (8 R)``; one whose chord is longer than R by at least ``c / 8``.
    valid &= chord**2 > 8.0 * np.minimum(radius, chord) * PROPOSED_BULGE_CELLS * cell
    if not valid.any():
        return None
    middle, radius, seeds = middle[valid], radius[valid], seeds[valid]
    beside = cdist(middle, points) - radius[:, None]
    reach = 0.5 * NEAR * cell
    on_it = (np.abs(beside) < reach) & (distance[valid] < 2.0 * REACH_CELLS * cell)
    votes = np.where(on_it, 1.0 - (beside / reach) ** 2, 0.0) @ weight
    best, row = _most_bent(
        middle, radius, beside / reach, on_it, np.argsort(-votes), votes, points, weight, cells, reach
    )
    return arc_over(middle[best], float(radius[best]), points[row], radar) if row.size else None


@njit(makes_arrays=True, nogil=True, error_model="numpy")
def _most_bent(middle, radius, beside, on_it, order, votes, points, weight, cells, reach):  # type: ignore[no-untyped-def]
    """Which of the circles gains most for its heaviest row over a straight line, and the echoes of that row, (k,).

    `beside` (circles, n) are the distances of the echoes from the circles, in units of `reach` [m], and `on_it` whether
    they count; `order` are the circles by falling `votes`, which no gain exceeds. The row is empty where none gains.
    """
    best, most, best_row = 0, 0.0, np.empty(0, dtype=np.int64)
    for i in order:
        if votes[i] <= most:
            break
        voters = np.flatnonzero(on_it[i])
        offset = points[voters] - middle[i]
        away = np.sqrt(offset[:, 0] ** 2 + offset[:, 1] ** 2)
        towards = np.arctan2((offset[:, 1] / away).mean(), (offset[:, 0] / away).mean())
        angle = np.arctan2(offset[:, 1], offset[:, 0]) - towards
        along = radius[i] * ((angle + np.pi) % (2.0 * np.pi) - np.pi)
        voters, along = voters[np.argsort(along)], np.sort(along)
        first, end, heaviest = heaviest_run(along, cells[voters], weight[voters])
        row = voters[first:end]
        if row.size < FEWEST:
            continue
        share = weight[row] / heaviest
        x, y = points[row, 0], points[row, 1]
        x, y = x - (share * x).sum(), y - (share * y).sum()
        # The angle of the line through the row, by weighted total least squares.
        chord = 0.5 * np.arctan2(2.0 * (share * x * y).sum(), (share * (x * x - y * y)).sum())
        gain = 0.0
        for k in range(row.size):
            off = min(abs(y[k] * np.cos(chord) - x[k] * np.sin(chord)) / reach, 1.0)
            gain += weight[row[k]] * (off**2 - beside[i, row[k]] ** 2)
        if gain > most:
            best, most, best_row = i, gain, row
    return best, best_row
