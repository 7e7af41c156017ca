"""The table of expected quality, from scores of random scenes: see `mirrorfold.describing.quality`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from mirrorfold.scoring.figures import NEAR, WIDE, WITHIN_CELLS

WALL_EDGES = (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 17.0, 21.0, 28.0, 40.0, 70.0, 120.0)
"""Edges of the classes of walls, by the length of the wall in resolution cells."""

LIMIT_EDGES = (0.06, 0.1, 0.16, 0.23, 0.33, 0.47, 0.7, 1.0, 1.5, 2.5, 5.0)
"""Edges of the classes of distances up to which a point counts as right, in resolution cells."""

FOUND = 0.25
"""A wall counts as a mirror that shows the hidden surfaces if the hidden F-score within 1.5 cells is above this."""

MIRRORED_EDGES_DB = (-17.0, -11.5, -8.5, -5.0, -3.0)
"""Edges of the classes of walls, by the share of the power that they mirror at 45 degrees [dB]. Walls above the last
edge count as good mirrors; the classes by length and by distance are of them alone."""

FEWEST = 3
"""Least number of scores in a class."""

Row = dict[str, Any]


def quality_table(rows: Sequence[Row], fewest: int = FEWEST) -> dict[str, Any]:
    """The factors of the expected hidden F-score.

    The first factor is the chance that the wall is found, by its length in cells. The second is the F-score of the
    scenes in which it was found, by the distance at which a point counts as right, in cells.

    Parameters
    ----------
    rows : sequence of dict
        Scores of scenes, as `two_walls_family.judge` returns them.
    fewest : int
        Least number of scores in a class; other classes are left out.

    Returns
    -------
    dict
        `found` and `close`, the two factors, each with `at`, `mean`, `standard_error` and `scenes` by class, and the
        range of lengths in which it is `valid`; `close_in_cells`, the second factor at 1.5 cells, with its standard
        error; `mirrored`, a factor for lossy walls by the share that they mirror [dB]; and the number of `scenes`.
    """
    used = [row for row in rows if row["mirrored_db"] >= MIRRORED_EDGES_DB[-1]]
    seen = [row for row in used if row["shown"] and row["f_cells"] > FOUND]
    found = _classes([(row["wall_cells"], float(row in seen)) for row in used], WALL_EDGES, fewest)
    limits = [(limit / row["cell_m"], row[name]) for row in seen for name, limit in (("f_2cm", NEAR), ("f_5cm", WIDE))]
    close = _classes(limits, LIMIT_EDGES, fewest)
    in_cells = np.array([row["f_cells"] for row in seen] or [0.0])
    return {
        "found": found,
        "close": close,
        "close_in_cells": {
            "at": WITHIN_CELLS,
            "mean": round(float(in_cells.mean()), 4),
            "standard_error": round(float(in_cells.std() / max(len(in_cells) - 1, 1) ** 0.5), 4),
        },
        "mirrored": _of_lossy_walls(rows, fewest),
        "scenes": len(rows),
    }


def _of_lossy_walls(rows: Sequence[Row], fewest: int) -> dict[str, list[float]]:
    """F-score at 1.5 cells, over that of the same scene with good mirrors, by classes of the mirrored share [dB]."""
    names = ("frequency", "bandwidth", "aperture", "seed", "object_correlation")
    good = {
        tuple(row[name] for name in names): row["f_cells"]
        for row in rows
        if row["mirrored_db"] >= MIRRORED_EDGES_DB[-1] and row["f_cells"] > FOUND
    }
    lossy = [row for row in rows if row["mirrored_db"] < MIRRORED_EDGES_DB[-1]]
    pairs = [(row, good[key]) for row in lossy if (key := tuple(row[name] for name in names)) in good]
    # `_classes` takes logarithms, but the levels are negative: their signs are changed there and back.
    ratios = [(-row["mirrored_db"], row["f_cells"] / other) for row, other in pairs]
    table = _classes(ratios, [-edge for edge in reversed(MIRRORED_EDGES_DB)], fewest)
    at = [-value for value in reversed(table["at"])]
    rest = {name: table[name][::-1] for name in ("mean", "standard_error", "scenes")}
    end: dict[str, list[float]] = {"mean": [1.0], "standard_error": [0.0], "scenes": [0]}
    return {"at": [*at, MIRRORED_EDGES_DB[-1]], **{name: [*rest[name], *end[name]] for name in rest}}


def _classes(pairs: Sequence[tuple[float, float]], edges: Sequence[float], fewest: int) -> dict[str, list[float]]:
    """Means and standard errors of values by classes of a positive quantity, given as pairs (quantity, value).

    The standard deviation of n values is taken to be at least ``1 / (n + 1)``: a few values that are all alike do not
    prove that all further ones are.
    """
    table: dict[str, list[float]] = {"at": [], "mean": [], "standard_error": [], "scenes": [], "valid": []}
    for low, high in pairwise(edges):
        inside = [(at, value) for at, value in pairs if low <= at < high]
        if len(inside) < fewest:
            continue
        at, values = np.array(inside).T
        n = len(values)
        error = float(values.std(ddof=1)) if n > 1 else 1.0
        table["at"].append(round(float(np.exp(np.log(at).mean())), 4))
        table["mean"].append(round(float(values.mean()), 4))
        table["standard_error"].append(round(max(error, 1.0 / (n + 1)) / np.sqrt(n), 4))
        table["scenes"].append(n)
        lowest = table["valid"][0] if table["valid"] else round(float(at.min()), 4)
        table["valid"] = [lowest, round(float(at.max()), 4)]
    return table
