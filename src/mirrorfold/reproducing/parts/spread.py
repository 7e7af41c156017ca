"""Numbers of a scene beside those of random scenes: means with standard errors, and a table of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.reproducing.findings import Table

UNITS = ("deg", "m", "db")
"""Units with which the names of numbers may end."""

Row = tuple[str, str, float, str]
"""A row of the table: name of the number, its description, a factor for its unit, and its format."""


def spread(draws: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Mean and standard error of every number over the random scenes in which it is known; empty without scenes.

    Examples
    --------
    >>> {name: round(value, 3) for name, value in spread([{"width_m": 1.0}, {"width_m": 3.0}]).items()}
    {'family_width_mean_m': 2.0, 'family_width_se_m': 1.0}
    """
    found = {}
    for name in draws[0] if draws else ():
        values = _known(draws, name)
        stem, _, unit = name.rpartition("_")
        stem, end = (stem, f"_{unit}") if unit in UNITS else (name, "")
        found[f"family_{stem}_mean{end}"] = float(values.mean()) if values.size else np.nan
        found[f"family_{stem}_se{end}"] = standard_error(values)
    return found


def spread_table(title: str, of: str, first: Mapping[str, float], draws: Sequence[Mapping[str, float]],
                 rows: Sequence[Row]) -> Table:  # fmt: skip
    """A table of the numbers of the scene, and their mean, standard error, least and largest value in random scenes.

    `of` is the name of the random scenes in the heading.
    """
    columns = ["", "the scene"]
    if draws:
        columns += [f"mean of {len(draws)} {of}", "standard error", "from", "to"]
    lines = []
    for name, what, factor, form in rows:
        line = [what, format(factor * first[name], form)]
        if draws:
            values = factor * _known(draws, name)
            statistics = values.mean(), standard_error(values), values.min(), values.max()
            line += [format(value, form) for value in statistics]
        lines.append(line)
    return Table(title=title, columns=columns, rows=lines)


def _known(draws: Sequence[Mapping[str, float]], name: str) -> Array:
    values = np.array([draw[name] for draw in draws], dtype=float)
    return values[np.isfinite(values)]


def standard_error(values: Array) -> float:
    """Standard error of the mean; NaN for a single value."""
    return float(values.std(ddof=1) / np.sqrt(values.size)) if values.size > 1 else np.nan
