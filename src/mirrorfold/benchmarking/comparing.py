"""Comparison of two benchmarks, scene by scene."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from mirrorfold.benchmarking.figures import FIGURES, Figure
from mirrorfold.benchmarking.results import FILE, read_lines
from mirrorfold.benchmarking.scenes import Line
from mirrorfold.benchmarking.summaries import interval, values
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.errors import InputError

Verdict = Literal["better", "worse", "no difference"]
"""Whether the second benchmark is better than the first."""

Scene = tuple[str, str, int]
"""Family, radar and seed of a scene."""


class Difference(Record):
    """Difference of a figure, second benchmark minus first, over the scenes that both have."""

    figure: str
    scenes: int
    first: Number = fact("mean over these scenes")
    second: Number
    difference: Number = fact("mean, second less first")
    low: Number = fact("lower end of its 95 % interval; null for a single scene")
    high: Number = fact("upper end")
    verdict: Verdict = fact("on the second; no difference where the interval holds zero")


class FamilyDifference(Record):
    """The differences of all figures, for one family seen by one radar."""

    family: str
    radar: str
    first_method: str
    second_method: str
    scenes: int = fact("that both have tried")
    failures: list[int] = fact("of the first and of the second among them")
    differences: list[Difference]


class BenchmarkComparison(Record):
    """Two benchmarks side by side."""

    kind: Literal["benchmark comparison"]
    first: str
    second: str
    results: list[FamilyDifference]
    remarks: list[str] = fact("sentences on what deserves attention")
    files: list[str] = fact("what was written", default=LEFT_OUT)


def compare_benchmarks(first: str | Path, second: str | Path) -> BenchmarkComparison:
    """Compare two benchmarks on the scenes that both have.

    Differences are taken scene by scene, so that the difficulty of a scene cancels out. Their mean has an interval by
    the bootstrap. A figure is better or worse if this interval does not contain zero.

    Parameters
    ----------
    first, second : path
        Folders of benchmarks. ``FOLDER:METHOD`` chooses one method of a folder. Otherwise the methods that both folders
        have are compared; two folders with a single method each are compared whatever these methods are.

    Raises
    ------
    InputError
        If a folder holds no benchmark, a method is not in it, or they have no scene in common.
    """
    one, other = (_by_method(str(name)) for name in (first, second))
    shared = [method for method in one if method in other]
    pairs = [(method, method) for method in shared]
    if len(one) == len(other) == 1:
        pairs = [(next(iter(one)), next(iter(other)))]
    if not pairs:
        raise InputError(
            f"{first} has {', '.join(one)} and {second} has {', '.join(other)}; name the methods as FOLDER:METHOD"
        )
    other_scenes = sum(_without_other_scenes(one[m], other[n]) for m, n in pairs)
    results = [found for pair in pairs for found in _differences(one[pair[0]], other[pair[1]], pair)]
    if not results:
        raise InputError(f"{first} and {second} have no scene in common; run both on the same families and seeds")
    remarks = []
    if other_scenes:
        remarks.append(
            f"{other_scenes} {'result is' if other_scenes == 1 else 'results are'} of different scenes of the same "
            "family and seed, and left out."
        )
    unshared = [sum(len(set(a[m]) - set(b[n])) for m, n in ((p if a is one else p[::-1]) for p in pairs))
             for a, b in ((one, other), (other, one))]  # fmt: skip
    for name, count in zip((first, second), unshared, strict=True):
        if count:
            remarks.append(f"{count} {'scene is' if count == 1 else 'scenes are'} in {name} only, and left out.")
    for name, methods, side in ((first, one, 0), (second, other, 1)):
        unpaired = [method for method in methods if method not in {pair[side] for pair in pairs}]
        if unpaired:
            remarks.append(f"{', '.join(unpaired)}: in {name} only, and left out.")
    remarks += [
        f"{name}: failed on {count} of {found.scenes} scenes of {found.family} ({method}), which no difference counts."
        for found in results
        for name, method, count in zip(
            (first, second), (found.first_method, found.second_method), found.failures, strict=True
        )
        if count
    ]
    if any(one.scenes == 1 for found in results for one in found.differences):
        remarks.append("A difference on a single scene has no interval, and so no verdict.")
    return BenchmarkComparison(
        kind="benchmark comparison", first=str(first), second=str(second), results=results, remarks=remarks
    )


def _without_other_scenes(first: dict[Scene, Line], second: dict[Scene, Line]) -> int:
    """Leave out of both what has the same family and seed but is another scene; return how many these were.

    Only lines of the same version tell: digests of scenes differ between versions.
    """
    shared = [(scene, first[scene], second[scene]) for scene in first.keys() & second.keys()]
    different = [scene for scene, a, b in shared if a.version == b.version and a.get("scene") != b.get("scene")]
    for scene in different:
        del first[scene], second[scene]
    return len(different)


def _by_method(name: str) -> dict[str, dict[Scene, Line]]:
    """The lines of results in a folder by method and scene; only those of one method for the name ``FOLDER:METHOD``.

    Raises
    ------
    InputError
        If the folder holds no benchmark, or not this method.
    """
    folder, _, method = (name, "", "") if Path(name).is_dir() else name.partition(":")
    lines = read_lines(Path(folder) / FILE)
    if not lines:
        raise InputError(f"{folder}: holds no benchmark ({FILE}); give the folder that `mirrorfold benchmark` wrote")
    found: dict[str, dict[Scene, Line]] = {}
    for line in lines.values():
        found.setdefault(line.method, {})[line.family, line.radar, line.seed] = line
    if not method:
        return found
    if method not in found:
        raise InputError(f"{folder}: has no method {method!r}, expected one of: {', '.join(found)}")
    return {method: found[method]}


def _differences(
    first: Mapping[Scene, Line], second: Mapping[Scene, Line], methods: tuple[str, str]
) -> list[FamilyDifference]:
    """The differences for each family and radar that both benchmarks have, in the order of the first."""
    groups: dict[tuple[str, str], list[Scene]] = {}
    for scene in first:
        if scene in second:
            groups.setdefault(scene[:2], []).append(scene)
    results = []
    for (family, radar), scenes in groups.items():
        sides = [first[scene] for scene in scenes], [second[scene] for scene in scenes]
        results.append(
            FamilyDifference(
                family=family,
                radar=radar,
                first_method=methods[0],
                second_method=methods[1],
                scenes=len(scenes),
                failures=[sum(line.error is not None for line in lines) for lines in sides],
                differences=[_difference(sides, figure) for figure in FIGURES.values()],
            )
        )
    return results


def _difference(sides: tuple[list[Line], list[Line]], figure: Figure) -> Difference:
    """The difference of a figure over pairs of lines, second minus first, where it is defined in both."""
    first, second = (values(lines, figure) for lines in sides)
    known = np.isfinite(first) & np.isfinite(second)
    paired = (second - first)[known]
    if not paired.size:
        return Difference(figure=figure.name, scenes=0, first=None, second=None, difference=None, low=None, high=None,
                          verdict="no difference")  # fmt: skip
    low, high = interval(paired)
    verdict: Verdict = "no difference"
    if low is not None and high is not None and (low > 0.0 or high < 0.0):
        verdict = "better" if (low > 0.0) == figure.high else "worse"
    return Difference(
        figure=figure.name,
        scenes=int(paired.size),
        first=float(first[known].mean()),
        second=float(second[known].mean()),
        difference=float(paired.mean()),
        low=low,
        high=high,
        verdict=verdict,
    )
