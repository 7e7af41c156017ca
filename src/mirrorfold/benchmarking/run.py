"""A benchmark: random scenes of families are seen by radars, reconstructed by methods, and the results are scored."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace
from itertools import product
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mirrorfold.benchmarking.methods import load_method, output_to_stderr
from mirrorfold.benchmarking.results import FILE, Key, append, key, open_results
from mirrorfold.benchmarking.scenes import Line, Task, judge, scene_digest
from mirrorfold.benchmarking.summaries import Benchmark, summarise
from mirrorfold.common.arguments import in_message, listed, path_of, whole_number, wrong_kind
from mirrorfold.common.signals import leave_to_parent, start_tracker
from mirrorfold.common.threads import cpu_count
from mirrorfold.errors import EndedError, InputError
from mirrorfold.scenes.families import (
    FAMILIES,
    Family,
    Radar,
    draw,
    family_named,
    is_of_its_kind,
    radar_named,
    radars_of,
    wrong_kind_of_radar,
)
from mirrorfold.scenes.families.drawing import reaches, sees_too_little

if TYPE_CHECKING:
    from mirrorfold.common.types import Progress


def benchmark(
    families: str | Family | Sequence[str | Family] | None = None,
    *,
    radars: str | Radar | Sequence[str | Radar] | None = None,
    methods: str | Sequence[str] = "ours",
    seeds: Iterable[int] = range(10),
    output: str | Path | None = None,
    sweeps: str | Path | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Benchmark:
    """Judge methods on random scenes whose truth is known.

    Each scene is simulated and focused once; every method gets the same image and sweep. A method that raises an error
    on a scene, or returns what cannot be scored, has failed there: failures are counted, and the benchmark goes on.

    Parameters
    ----------
    families : str, Family or several, optional
        Families of `mirrorfold.scenes.families`, or your own; by default all families that are simulated by rays, which
        takes some seconds for each scene.
    radars : str, Radar or several, optional
        Radars of the same module; by default the usual one of each family. A family that has a radar of its own is
        always seen by that radar.
    methods : str or several
        "ours", "flat", "opaque", "published" or "MODULE:FUNCTION", a function that is called with the image and the
        sweep (None for raster scans) and returns a Reconstruction, or a dict with `points` (n, d) [m] and, if it knows
        them, `bounces` (n,), `initial` (n, d) [m] and `mirrors` (m, 2, 2) [m].
    seeds : iterable of int
        Seeds of the random scenes: one scene for each.
    output : path, optional
        Folder for the results: each one is written as a line of `scenes.jsonl` as soon as it is done. Results that are
        there already are not made again, except for failures. By default nothing is written.
    sweeps : path, optional
        Folder that keeps the simulated sweeps, for another run on the same scenes.
    jobs : int
        Number of scenes at a time, each in a process of its own. With more than one, a script needs
        ``if __name__ == "__main__":``, and families of your own functions of a module.
    progress : callable (done, total), optional
        Called as scenes are done.

    Returns
    -------
    Benchmark
        For each family, radar and method: mean with its 95 % interval, median and worst of every figure; failures;
        time by step.

    Raises
    ------
    InputError
        If a name is not known, a method cannot be imported, a radar sees no hidden object of a family, or there is
        nothing to do.
    """
    tasks = _tasks(families, radars, methods, seeds)
    jobs = whole_number("jobs", jobs, lowest=1)
    if jobs > 1:
        _expect_sendable(tasks)
    output = None if output is None else path_of("output", output, "the path of a folder")
    sweeps = None if sweeps is None else path_of("sweeps", sweeps, "the path of a folder")
    for folder in (output, sweeps):
        if folder is not None and Path(folder).exists() and not Path(folder).is_dir():
            raise InputError(f"{folder}: is no folder; give the path of one")
    for folder in (output, sweeps):
        if folder is not None:
            Path(folder).mkdir(parents=True, exist_ok=True)
    file = None if output is None else Path(output) / FILE
    done: dict[Key, Line] = {} if file is None else open_results(file)
    succeeded = _succeeded(tasks, done)
    wanted = [(task, method) for task in tasks for method in task.methods]
    sweep_folder = Path(sweeps) if sweeps is not None else None
    todo = []
    for task in tasks:
        missing = tuple(method for method in task.methods if _key(task, method) not in succeeded)
        if missing:
            todo.append(replace(task, methods=missing, sweeps=sweep_folder))
    finished = len(tasks) - len(todo)
    if progress is not None:
        progress(finished, len(tasks))
    for lines in _judged(todo, jobs):
        if file is not None:
            append(file, lines)
        done |= {key(line): line for line in lines}
        finished += 1
        if progress is not None:
            progress(finished, len(tasks))
    return summarise([done[_key(task, method)] for task, method in wanted])


def _tasks(
    families: str | Family | Sequence[str | Family] | None,
    radars: str | Radar | Sequence[str | Radar] | None,
    methods: str | Sequence[str],
    seeds: Iterable[Any],
) -> list[Task]:
    """One task for each scene, with all methods, in the order of the families.

    Raises
    ------
    InputError
        As `benchmark`.
    """
    usual = [family for family in FAMILIES.values() if family.engine == "rays"]
    chosen = usual if families is None else [
        family if isinstance(family, Family) else family_named(family)
        for family in ([families] if isinstance(families, str | Family) else listed("families", families))
    ]  # fmt: skip
    seen_by = None if radars is None else [
        radar if isinstance(radar, Radar) else radar_named(radar)
        for radar in ([radars] if isinstance(radars, str | Radar) else listed("radars", radars))
    ]  # fmt: skip
    names = tuple([methods] if isinstance(methods, str) else listed("methods", methods))
    for name in names:
        if not isinstance(name, str):
            raise wrong_kind("methods", name, "ours, flat, opaque, published or MODULE:FUNCTION")
        load_method(name)
    names = tuple(dict.fromkeys(names))
    if not isinstance(seeds, Iterable):
        raise wrong_kind("seeds", seeds, "whole numbers, such as range(10)")
    numbers = [int(seed) if isinstance(seed, np.integer) else seed for seed in seeds]
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int) or number < 0:
            raise InputError(
                f"seeds holds {in_message(number)}, expected whole numbers of at least 0, such as range(10)"
            )
    seen_by = None if seen_by is None else _first_of_each_name(seen_by)
    tasks = [
        Task(family, radar, seed, names)
        for family in _first_of_each_name(chosen)
        for radar, seed in product(_radars(family, seen_by), dict.fromkeys(numbers))
    ]
    if not tasks or not names:
        raise InputError("benchmark: has no family, radar, method or seed; give at least one of each")
    for family, radar in {(task.family.name, task.radar.name): (task.family, task.radar) for task in tasks}.values():
        far_enough = True  # if the family raises an error, it is reported when its scene is tried
        with suppress(Exception, SystemExit), output_to_stderr():
            far_enough = reaches(family, tasks[0].seed, radar)
        if not far_enough:
            raise sees_too_little(family, radar)
    return tasks


def _expect_sendable(tasks: list[Task]) -> None:
    """Refuse families that cannot be sent to other processes, such as those that are made by a lambda."""
    for family in {task.family.name: task.family for task in tasks}.values():
        try:
            pickle.dumps(family)
        except Exception as error:  # what cannot be pickled may raise anything
            raise InputError(
                f"family {family.name!r}: cannot be sent to another process ({error}); make it by a function of a "
                "module, or give jobs=1"
            ) from None


Named = TypeVar("Named", Family, Radar)


def _first_of_each_name(given: Iterable[Named]) -> list[Named]:
    """The families or radars without those whose name an earlier one has."""
    found: dict[str, Named] = {}
    for one in given:
        found.setdefault(one.name, one)
    return list(found.values())


def _radars(family: Family, chosen: list[Radar] | None) -> list[Radar]:
    """The radars that see a family: its own or usual one, or those of the chosen ones that can."""
    seen_by = radars_of(family)[:1] if chosen is None or family.radar is not None else chosen
    suitable = [radar for radar in seen_by if is_of_its_kind(radar, family)]
    if seen_by and not suitable:
        raise wrong_kind_of_radar(seen_by[0], family)
    return suitable


def _succeeded(tasks: list[Task], done: dict[Key, Line]) -> set[Key]:
    """Keys of results that need not be made again; gives a warning of results of other scenes with the same names."""
    found, other = set(), 0
    for task in tasks:
        keys = {_key(task, method) for method in task.methods}
        scored = {name for name in keys & done.keys() if done[name].error is None}
        if scored:
            digest = None  # if the family raises an error, it is reported when its scene is tried
            with suppress(Exception, SystemExit), output_to_stderr():
                digest = scene_digest(task, draw(task.family, task.seed, radar=task.radar))
            same = {name for name in scored if done[name].scene == digest}
            found |= same
            other += len(scored - same)
    if other:
        warnings.warn(
            f"benchmark: {other} results are of other scenes, families or radars of the same name; they are made again",
            stacklevel=3,
        )
    return found


def _key(task: Task, method: str) -> Key:
    return task.family.name, task.radar.name, task.seed, method


def _judged(tasks: list[Task], jobs: int) -> Iterator[list[Line]]:
    """The lines of each scene as soon as it is done, in `jobs` processes."""
    if jobs == 1 or len(tasks) < 2:
        yield from map(judge, tasks)
        return
    # Processes are spawned, not forked: the threads of Numba do not survive a fork.
    threads = max(1, cpu_count() // jobs)
    start_tracker()
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_prepare_process, initargs=(threads,))
    try:
        for future in as_completed([pool.submit(judge, task) for task in tasks]):
            yield future.result()
    except BrokenProcessPool:
        raise EndedError(
            "benchmark: a process has ended midway, for want of memory, or because a method crashed or ended it; use "
            "fewer jobs, or mend the method"
        ) from None
    except BaseException:  # an interruption must not wait for scenes that take minutes
        for child in active_children():
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _prepare_process(threads: int) -> None:
    """Prepare a worker process: it uses its share of the cores, and leaves interruptions to its parent."""
    import numba
    from threadpoolctl import threadpool_limits

    leave_to_parent()
    numba.set_num_threads(min(threads, numba.get_num_threads()))
    threadpool_limits(threads)
