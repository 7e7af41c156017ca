"""Mean, median and worst value of the figures over the scenes of each family, with intervals by the bootstrap."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Literal

import numpy as np

from mirrorfold.benchmarking.figures import FIGURES, Figure
from mirrorfold.benchmarking.scenes import Line
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.common.types import Array

RESAMPLES = 4000
"""Number of samples of the bootstrap: the ends of an interval are then reproducible to one or two hundredths of its
width."""

LEVEL = 95.0
"""Confidence level of the intervals [%]."""


class Spread(Record):
    """Distribution of a figure over the scenes for which it is defined."""

    scenes: int = fact("for which it is defined")
    mean: Number
    low: Number = fact("lower end of the 95 % interval of the mean; null for a single scene")
    high: Number = fact("upper end")
    median: Number
    worst: Number


class FamilyResult(Record):
    """The results of one method on the scenes of a family, seen by one radar."""

    family: str
    radar: str
    method: str
    scenes: int = fact("that were tried")
    failures: int = fact("those without a score")
    errors: list[str] = fact("why, each reason once, the most frequent first")
    figures: dict[str, Spread] = fact("by name: F-scores, precision and completeness at 2 cm, in cells at 1.5 cells")
    seconds: dict[str, float] = fact("mean time by step")


class Benchmark(Record):
    """The results of a benchmark."""

    kind: Literal["benchmark"]
    seeds: list[int]
    results: list[FamilyResult]
    remarks: list[str] = fact("sentences on what deserves attention")
    files: list[str] = fact("what was written", default=LEFT_OUT)


def summarise(lines: Sequence[Line]) -> Benchmark:
    """The summary of all lines, in the order in which families, radars and methods first appear."""
    groups: dict[tuple[str, str, str], list[Line]] = {}
    for line in lines:
        groups.setdefault((line.family, line.radar, line.method), []).append(line)
    results = [_summary(group) for group in groups.values()]
    tried = Counter(line.method for line in lines)
    remarks = []
    for method in tried:
        errors = Counter(line.error for line in lines if line.method == method and line.error is not None)
        if errors:
            most = errors.most_common(1)[0][0]
            remarks.append(f"{method} failed on {errors.total()} of {tried[method]} scenes, most often so: {most}")
    return Benchmark(kind="benchmark", seeds=sorted({line.seed for line in lines}), results=results, remarks=remarks)


def _summary(lines: list[Line]) -> FamilyResult:
    steps = dict.fromkeys(step for line in lines for step in line.seconds)
    times = {step: [line.seconds[step] for line in lines if step in line.seconds] for step in steps}
    errors = Counter(line.error for line in lines if line.error is not None)
    first = lines[0]
    return FamilyResult(
        family=first.family,
        radar=first.radar,
        method=first.method,
        scenes=len(lines),
        failures=sum(errors.values()),
        errors=[error for error, _ in errors.most_common()],
        figures={name: spread(values(lines, figure), figure) for name, figure in FIGURES.items()},
        seconds={step: float(np.mean(found)) for step, found in times.items()},
    )


def values(lines: Sequence[Line], figure: Figure) -> Array:
    """The values of a figure in all lines, (n,); NaN where it is undefined or the method failed."""
    found = [None if line.score is None else figure.read(line.score) for line in lines]
    return np.array([np.nan if value is None else value for value in found], dtype=np.float64)


def spread(values: Array, figure: Figure) -> Spread:
    """Mean with its interval, median and worst of the values (n,) that are finite."""
    known = values[np.isfinite(values)]
    if not known.size:
        return Spread(scenes=0, mean=None, low=None, high=None, median=None, worst=None)
    low, high = interval(known)
    return Spread(
        scenes=int(known.size),
        mean=float(known.mean()),
        low=low,
        high=high,
        median=float(np.median(known)),
        worst=float(known.min() if figure.high else known.max()),
    )


def interval(values: Array) -> tuple[Number, Number]:
    """The 95 % interval of the mean of values (n,), by the bootstrap (Efron and Tibshirani 1993, section 13.3).

    As many values are drawn from these with replacement, many times. The means of these samples spread as the means
    over other scenes would; the interval holds the middle 95 % of them. The seed is fixed. A single value has no
    interval.
    """
    if values.size < 2:
        return None, None
    draws = np.random.default_rng(0).integers(values.size, size=(RESAMPLES, values.size))
    low, high = np.percentile(values[draws].mean(axis=1), [50.0 - LEVEL / 2.0, 50.0 + LEVEL / 2.0])
    return float(low), float(high)
