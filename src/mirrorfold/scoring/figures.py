"""How close points come to the truth: accuracy, precision, completeness, F-score, invented points.

They are the same in two and three dimensions. Accuracy is the mean distance of the reconstructed points from the
nearest true surface. Completeness is the share of the true surface, as far as it could be seen at all, that has a point
near it. Points are first thinned to one in each cell, so that a dense cluster counts once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mirrorfold.common.records import Number, Record, fact
from mirrorfold.common.types import Array

CELL = 0.01
"""Edge [m] of the square or cubic cells in which points are thinned: half of `NEAR`, so that the mean of a cell is
closer to its points than the smallest distance that is judged."""

NEAR, COVERED, WIDE, INVENTED, FALSE = 0.02, 0.03, 0.05, 0.10, 0.15
"""Distances [m]: up to `NEAR` a point is good, up to `COVERED` a piece of truth is covered, up to `WIDE` a point is
fair; beyond `INVENTED` a point is invented, beyond `FALSE` false. They are chosen, not derived: from a few to tens of
resolution cells of a bandwidth of 10 to 30 GHz (5 to 15 mm each)."""

WITHIN_CELLS = 1.5
"""In the figures in cells, a point is good within this many diagonals of its resolution cell. What lies in the cell
around the point is at most half a diagonal away."""


class Figures(Record):
    """How close points come to the truth."""

    points: int = fact("how many, as the reconstruction holds them: of objects and on the faces of mirrors")
    cells: int = fact("how many after thinning to one in each cell of a centimetre; all other figures are of these")
    accuracy_m: Number = fact("mean distance of the points from the truth")
    precision_2cm: Number = fact("share of the points within 2 cm of the truth")
    completeness_2cm: Number = fact("share of the truth within 2 cm of the points")
    f_score_2cm: Number = fact("harmonic mean of both")
    precision_5cm: Number
    completeness_5cm: Number
    f_score_5cm: Number
    completeness_3cm: Number
    precision_cells: Number = fact(
        "share of the points within 1.5 resolution cells of the truth, where their size is known"
    )
    completeness_cells: Number
    f_score_cells: Number
    cell_m: Number = fact("diagonal of the resolution cell, the median over the points")
    chamfer_m: Number = fact("mean of both mean distances")
    invented_fraction: Number = fact("share of the points far from every surface")
    false_fraction: Number


def thinned(points: Array) -> tuple[Array, NDArray[np.int64]]:
    """The mean of the points (n, d) [m] in each cell of a grid of edge `CELL`, (m, d), and how many these are, (m,)."""
    cells = np.floor(points / CELL).astype(np.int64)
    _, which, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    which = which.ravel()
    return np.stack([np.bincount(which, weights=column) / counts for column in points.T], axis=-1), counts


def figures(
    points: Array, count: NDArray[np.int64], distance: Array, reachable: Array, cell: Array | None = None
) -> Figures:
    """All figures of some points; those that are undefined are None.

    The points (n, d) [m] are `thinned`, and each stands for `count` (n,) of them. `distance` (n,) [m] is that from the
    nearest true surface, and `reachable` (m, d) [m] are samples of the truth that could be seen. `cell` (n,) [m] is the
    diagonal of the resolution cell of each point, if it is known. In the figures in cells, a sample of the truth is
    covered if the point nearest to it is within `WITHIN_CELLS` of that point's own cell.
    """
    to_points, nearest = cKDTree(points).query(reachable)  # infinite without points
    one_way, other_way = _mean(distance), _mean(to_points)
    in_cells: tuple[float | None, float | None] = None, None
    if cell is not None:
        covered = to_points / cell[nearest] if len(points) else to_points
        in_cells = _share(distance / cell, WITHIN_CELLS), _share(covered, WITHIN_CELLS)
    near = {limit: (_share(distance, limit), _share(to_points, limit)) for limit in (NEAR, COVERED, WIDE)}
    return Figures(
        points=int(count.sum()),
        cells=len(points),
        accuracy_m=one_way,
        precision_2cm=near[NEAR][0],
        completeness_2cm=near[NEAR][1],
        f_score_2cm=_harmonic_mean(*near[NEAR]),
        precision_5cm=near[WIDE][0],
        completeness_5cm=near[WIDE][1],
        f_score_5cm=_harmonic_mean(*near[WIDE]),
        completeness_3cm=near[COVERED][1],
        precision_cells=in_cells[0],
        completeness_cells=in_cells[1],
        f_score_cells=_harmonic_mean(*in_cells),
        cell_m=float(np.median(cell)) if cell is not None and len(cell) else None,
        chamfer_m=None if one_way is None or other_way is None else 0.5 * (one_way + other_way),
        invented_fraction=float(np.mean(distance > INVENTED)) if len(distance) else 0.0,
        false_fraction=float(np.mean(distance > FALSE)) if len(distance) else 0.0,
    )


def _share(distances: Array, limit: float) -> float | None:
    """Share of the distances that are within a limit; None if there are none."""
    return float(np.mean(distances <= limit)) if len(distances) else None


def _mean(distances: Array) -> float | None:
    return float(np.mean(distances)) if len(distances) and np.isfinite(distances).all() else None


def _harmonic_mean(precision: float | None, completeness: float | None) -> float | None:
    """The F-score: 0 without points, None without truth."""
    if completeness is None:
        return None
    both = (precision or 0.0) + completeness
    return 2.0 * (precision or 0.0) * completeness / both if both else 0.0
