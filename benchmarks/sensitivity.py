"""Vary the tuned constants of steps 2 to 6, one at a time, and print how each variation changes the F-scores.

    python benchmarks/sensitivity.py [--seeds 3] [--first 500] [--family NAME ...] [--constant NAME ...]
                                     [--volumes] [--jobs 1] [--json FILE]

Every constant that a module of steps 2 to 6 defines is made 1.5 times smaller and 1.5 times larger. For decibels, the
number of decibels is multiplied; integers change by at least 1; all numbers of a tuple change together; shares become
0.99 at most. Scenes are those of `mirrorfold.scenes.families` with seeds of their own (the seeds of its table stay
unseen), the full-wave sweep of two walls if the file exists, and with `--volumes` the raster scenes of `raster.py`.
Constants of the test for mixed paths are judged on the first scenes of two families and on the full-wave sweep, folded
with the sweep; `GHOST_CELLS` is judged on reconstructions that are folded again.

How to read the table: the rows at the top are F-scores at 2 cm with the constants as they are: mean and worst over the
scenes, of all points and of those seen by way of mirrors. The other rows are differences from them, with the largest
first; each constant has one row for the smaller and one for the larger number. The verdict is on both rows together:

* moves nothing: no mean changes by 0.001, no worst by 0.01. The constant may be left out of the program, or made a
  round number, or it is needed only in cases that are not tried here;
* edge: a mean loses more than 0.01 on at least one side. The constant is tuned closely: say why, or find a better rule;
* gains: no edge, and a mean gains more than 0.01. Try that side on more seeds before you believe it;
* flat: anything between. This is how a constant should be;
* fails: the program stops with an error.

With few scenes the worst is a single scene, and an F-score changes by 0.005 if a single short mirror comes or goes.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from focused_scenes import RAY_FAMILIES, Case, fullwave_cases, ray_cases, volume_cases
from rich.console import Console
from rich.table import Table
from tuned_constants import Constant, Sources, Value

FACTOR = 1.5
"""Each constant is divided and multiplied by this."""

STEPS = ("mirrorfold.detection", "mirrorfold.tree", "mirrorfold.folding", "mirrorfold.reconstruction")
"""Modules of steps 2 to 6, with all modules inside of them."""

LEFT_OUT = {
    "WEIGHTS": "fitted by confidence.py",
    "EXPLAINED": "measured by confidence.py",
    "TRUE_CELLS": "what confidence means",
    "ROOT": "a code",
    "UNSEEN": "a code",
    "CHUNK": "steers memory only",
    "LARGEST_GRID": "steers memory only",
    "LARGEST_GROWTH": "size of the picture; no point depends on it",
    "PIXEL_RADII": "size of the picture; no point depends on it",
    "BORDER_RADII": "size of the picture; no point depends on it",
    "RAYLEIGH_MEDIAN": "follows from a formula",
    "SIGMA_PER_MEDIAN": "follows from a formula",
    "HANN_CELL": "follows from a formula",
    "DEVIATION": "follows from a formula",
    "SHORTEST": "checks mirrors that are given; here they are found",
    "FLATTEST": "checks mirrors that are given; here they are found",
    "LARGEST_COUNT": "checks mirrors that are given; here they are found",
}
"""Constants that are not tuned, by name or by module and name, with the reason."""

SHARES = ("SMALLEST_FILL", "SMALLEST_FILL_SHORT", "SMALLEST_DIRECTION_RATIO", "LARGEST_SINE")
"""Shares and a sine: at 1 or more, nothing would ever pass the test, or there is no angle."""
LARGEST_SHARE = 0.99
"""Largest value that is tried for `SHARES`."""

WITH_SWEEP = ("directions.",)
"""Constants of the test for mixed paths, which needs the sweep; by the beginning of their labels."""
AGAIN = ("reconstruction.GHOST_",)
"""Constants that matter only if a reconstruction is folded again; by the beginning of their labels."""
SEES = ("echoes.", "image_view.", "image_echoes.", "volume_view.", "volume_echoes.")
"""Constants that change the view or the echoes in it; for all others, view and echoes are computed only once."""

FIGURES = ("all", "hidden")
NOTHING_MEAN, NOTHING_WORST, EDGE = 0.001, 0.01, 0.01
"""Limits of the verdicts, as at the top of this file: changes of mean and worst that are nothing, and an edge."""

Task = tuple[Constant | None, Value | None, str]
"""A constant and the value to give to it, or twice None for the unvaried program; and how to fold, see `Case.fold`."""

Scores = dict[str, dict[str, float]]
"""The F-scores of all points and of the hidden ones, by the name of the scene."""


def sides(constant: Constant) -> tuple[Value, Value]:
    """The value divided and multiplied by `FACTOR`; each number of a tuple for itself."""
    if isinstance(constant.value, tuple):
        down, up = zip(*(_sides(value, constant.name) for value in constant.value), strict=True)
        return down, up
    return _sides(constant.value, constant.name)


def _sides(value: int | float, name: str) -> tuple[int | float, int | float]:
    """A number divided and multiplied by `FACTOR`; an integer changes by at least 1, a share becomes 0.99 at most."""
    down, up = value / FACTOR, value * FACTOR
    if isinstance(value, int):
        return min(round(down), value - 1), max(round(up), value + 1)
    return float(down), float(min(up, LARGEST_SHARE) if name in SHARES else up)


def manner(constant: Constant) -> str:
    """How images are folded to judge a constant: "alone", "sweep" or "again", see `Case.fold`."""
    if constant.label.startswith(WITH_SWEEP):
        return "sweep"
    return "again" if constant.label.startswith(AGAIN) else "alone"


def concerned(constant: Constant, case: Case) -> bool:
    """Whether a constant can matter in a scene: constants of images cannot matter in volumes, nor vice versa."""
    if manner(constant) != "alone" and case.sweep is None:
        return False
    part = constant.label
    if case.group == "volumes":
        return not part.startswith(("image_", "line_mirror.", "lines.", "rows.", "directions."))
    return not part.startswith(("plane_mirror.", "planes.", "volume_"))


def selected(sources: Sources, names: list[str] | None) -> tuple[list[Constant], list[str]]:
    """The constants to vary, and a remark on each constant that is not varied, or not everywhere."""
    found = sources.constants(*STEPS)
    remarks = []
    chosen = []
    for constant in found:
        reason = LEFT_OUT.get(constant.name) or LEFT_OUT.get(constant.label)
        if names and constant.name not in names and constant.label not in names:
            continue
        if reason:
            remarks.append(f"{constant.label}: left out, {reason}")
        elif constant.derived:
            remarks.append(f"{constant.label}: left out, computed from others, which it follows")
        elif constant.kernels:
            remarks.append(f"{constant.label}: left out, frozen in the compiled {', '.join(constant.kernels)}")
        else:
            chosen.append(constant)
            remarks += [f"{constant.label}: varied, but not in {where}" for where in constant.stale]
    known = {name for constant in found for name in (constant.name, constant.label)}
    remarks += [f"{name}: named in this benchmark, no longer in the program" for name in LEFT_OUT if name not in known]
    for name in names or []:
        if name not in known:
            raise SystemExit(f"--constant {name}: no such constant; expected a name such as {found[0].label}")
    return chosen, remarks


@dataclass(frozen=True)
class Result:
    """The scores of each scene with a variation, and the error of the last scene that failed."""

    constant: Constant | None
    value: Value | None
    how: str
    scores: Scores
    error: str = ""
    seconds: float = 0.0


def measure(sources: Sources, cases: list[Case], task: Task) -> Result:
    """Fold and score all scenes that a constant concerns, with the value of the task, or the unvaried program."""
    constant, value, how = task
    started = time.perf_counter()
    if constant is None or value is None:
        scores = {c.name: c.scores(how, fresh=False) for c in cases if how == "alone" or c.sweep is not None}
        return Result(None, None, how, scores, seconds=time.perf_counter() - started)
    scores = {}
    error = ""
    with sources.varied(constant, value):
        for case in cases:
            if concerned(constant, case):
                try:
                    scores[case.name] = case.scores(how, fresh=constant.label.startswith(SEES))
                except Exception as problem:  # an absurd value may lead to any error
                    error = f"{case.name}: {type(problem).__name__}: {problem}"
    return Result(constant, value, how, scores, error, time.perf_counter() - started)


_worker: tuple[Sources, list[Case]] | None = None


def _start(cases: list[Case]) -> None:
    """Prepare a process; the process that started it alone handles interrupts."""
    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _worker = Sources("mirrorfold"), cases


def _work(task: Task) -> Result:
    assert _worker is not None  # every process begins with `_start`
    return measure(*_worker, task)


def results(sources: Sources, cases: list[Case], tasks: list[Task], jobs: int) -> Iterator[Result]:
    """The results of all tasks, in the order in which the processes finish them."""
    if jobs == 1:
        for task in tasks:
            yield measure(sources, cases, task)
        return
    # Processes are spawned, not forked: the threads of Numba do not survive a fork.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_start, initargs=(cases,))
    try:
        waiting: list[Future[Result]] = [pool.submit(_work, task) for task in tasks]
        for done in as_completed(waiting):
            yield done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def summary(scores: Scores, cases: list[Case]) -> dict[tuple[str, str, str], float]:
    """Mean and worst of each F-score over the scenes of each group, in the order of the columns."""
    result = {}
    for group in dict.fromkeys(case.group for case in cases):
        names = [case.name for case in cases if case.group == group and case.name in scores]
        for figure in FIGURES:
            values = [scores[name][figure] for name in names if figure in scores[name]]
            if values:
                result[group, figure, "mean"] = float(np.mean(values))
                result[group, figure, "worst"] = min(values)
    return result


def differences(result: Result, unvaried: Scores, cases: list[Case]) -> dict[tuple[str, str, str], float]:
    """How a variation changed means and worsts, over the scenes that it concerns."""
    same = {name: unvaried[name] for name in result.scores}
    before, after = summary(same, cases), summary(result.scores, cases)
    return {key: after[key] - before[key] for key in after}


def verdict(both: list[dict[tuple[str, str, str], float]], failed: bool) -> str:
    """The verdict on the differences of both sides, as described at the top of this file."""
    means = [value for side in both for (_, _, kind), value in side.items() if kind == "mean"]
    worsts = [value for side in both for (_, _, kind), value in side.items() if kind == "worst"]
    if failed or not means:
        return "fails"
    if min(means) < -EDGE:
        return "edge"
    if max(means) > EDGE:
        return "gains"
    if np.max(np.abs(means)) < NOTHING_MEAN and np.max(np.abs(worsts)) < NOTHING_WORST:
        return "moves nothing"
    return "flat"


def written(value: Value) -> str:
    """A number or a tuple of numbers as text."""
    return ", ".join(map(written, value)) if isinstance(value, tuple) else f"{value:.4g}"


def table(found: list[Result], cases: list[Case]) -> Table:
    """A table of the F-scores of the unvaried program, and of their differences with each variation."""
    unvaried = {result.how: result.scores for result in found if result.constant is None}
    heads = {how: summary(scores, cases) for how, scores in unvaried.items()}
    several = {group for group in {c.group for c in cases} if sum(c.group == group for c in cases) > 1}
    columns = list(
        dict.fromkeys(key for head in heads.values() for key in head if key[2] == "mean" or key[0] in several)
    )
    result = Table(
        title="F-scores at 2 cm: unvaried, and by how much each variation changes them", title_justify="left"
    )
    for heading in ("constant", "is", "becomes"):
        result.add_column(heading)
    for group, figure, kind in columns:
        result.add_column(f"{group}\n{figure}{', ' + kind if group in several else ''}", justify="right")
    result.add_column("verdict")
    names = {"alone": "unvaried", "sweep": "unvaried, with the sweep", "again": "unvaried, folded again"}
    for how, head in heads.items():
        cells = [f"{head[key]:.3f}" if key in head else "" for key in columns]
        result.add_row(names[how], "", "", *cells, "", end_section=how == list(heads)[-1])

    by_constant: dict[Constant, list[Result]] = {}
    for one in found:
        if one.constant is not None and one.how in unvaried:
            by_constant.setdefault(one.constant, []).append(one)
    rows = []
    for constant, both in by_constant.items():
        both.sort(key=lambda one: float(np.abs(one.value or 0).sum()))
        moved = [differences(one, unvaried[one.how], cases) for one in both]
        failed = any(one.error for one in both)
        means = [abs(value) for side in moved for key, value in side.items() if key[2] == "mean"]
        effect = np.inf if failed else max(means, default=0.0)
        judgement = verdict(moved, failed) + ("" if len(both) == 2 else ", one side")
        label = constant.label + names[both[0].how].removeprefix("unvaried")
        rows.append((effect, [label, written(constant.value), judgement], both, moved))
    for _, (label, own, judgement), both, moved in sorted(rows, key=lambda row: -row[0]):
        for one, side in zip(both, moved, strict=True):
            cells = [_signed(side[key]) if key in side else "" for key in columns]
            result.add_row(label, own, written(one.value or 0), *cells, judgement, end_section=one is both[-1])
            label = own = judgement = ""
    return result


def _signed(difference: float) -> str:
    """A difference with its sign as text; "0" if it rounds to zero."""
    return f"{difference:+.3f}" if abs(difference) >= 0.0005 else "0"


def to_json(found: list[Result], cases: list[Case]) -> str:
    """All scores of all scenes, as JSON."""
    rows = [
        {"constant": one.constant.label if one.constant else None, "is": one.constant.value if one.constant else None,
         "becomes": one.value, "how": one.how, "scores": one.scores, "error": one.error}
        for one in found
    ]  # fmt: skip
    return json.dumps({"groups": {case.name: case.group for case in cases}, "results": rows}, indent=1)


def main() -> None:
    """Vary the constants that the command line names, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3, help="scenes of each family")
    parser.add_argument("--first", type=int, default=500, help="first seed")
    parser.add_argument("--family", action="append", choices=RAY_FAMILIES)
    parser.add_argument("--constant", action="append", help="such as rows.GAP_CELLS; all by default")
    parser.add_argument("--volumes", action="store_true", help="raster scenes, too")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    sources = Sources("mirrorfold")
    chosen, remarks = selected(sources, options.constant)
    seeds = range(options.first, options.first + options.seeds)
    cases: list[Case] = []
    found: list[Result] = []
    console = Console(width=200)
    try:
        makers = [ray_cases(options.family or RAY_FAMILIES, seeds), fullwave_cases()]
        for maker in makers + ([volume_cases(seeds)] if options.volumes else []):
            for case in maker:
                cases.append(case)
                print(f"focused {case.group}: {case.name}", file=sys.stderr, flush=True)
        chosen = [constant for constant in chosen if any(concerned(constant, case) for case in cases)]
        manners = dict.fromkeys(["alone", *map(manner, chosen)])
        tasks: list[Task] = [(None, None, how) for how in manners]
        # Constants that need the sweep take longest, and come last.
        chosen.sort(key=lambda constant: manner(constant) == "sweep")
        tasks += [(constant, value, manner(constant)) for constant in chosen for value in sides(constant)]
        started = time.perf_counter()
        for one in results(sources, cases, tasks, options.jobs):
            found.append(one)
            left = (time.perf_counter() - started) / len(found) * (len(tasks) - len(found)) / 60.0
            what = f"{one.constant.label} = {written(one.value or 0)}" if one.constant else f"unvaried, {one.how}"
            print(f"{len(found)}/{len(tasks)} {what} ({one.seconds:.1f} s, {left:.0f} min left)"
                  + (f" {one.error}" if one.error else ""), file=sys.stderr, flush=True)  # fmt: skip
    except KeyboardInterrupt:
        print("interrupted; what was found so far:", file=sys.stderr)
    if any(one.constant is None for one in found):
        console.print(table(found, cases))
    for remark in remarks:
        console.print(remark, markup=False, highlight=False)
    if options.json:
        options.json.write_text(to_json(found, cases), encoding="utf-8")


if __name__ == "__main__":
    main()
