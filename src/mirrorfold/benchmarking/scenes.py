"""One scene of a benchmark: drawn, simulated, focused, and reconstructed and scored by every method."""

from __future__ import annotations

import hashlib
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from mirrorfold import __version__
from mirrorfold.benchmarking.methods import as_reconstruction, load_method
from mirrorfold.common.parts import is_sealed, seal
from mirrorfold.common.records import LEFT_OUT, Record, fact
from mirrorfold.errors import InputError
from mirrorfold.focusing import focus
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.io import load, save
from mirrorfold.io.files import written_whole
from mirrorfold.scenes.families import Family, Radar, draw
from mirrorfold.scoring.score import PlanScore, VolumeScore, score
from mirrorfold.simulation import simulate

T = TypeVar("T")


class Line(Record):
    """What one method made of one scene: a line of the file of results."""

    family: str
    radar: str
    seed: int
    method: str
    version: str = fact("of mirrorfold")
    scene: str = fact("digest of the scene and of how it is simulated", default=LEFT_OUT)
    error: str | None = fact("why there is no score; null if there is one")
    seconds: dict[str, float] = fact("by step: simulate, focus, fold, score")
    score: PlanScore | VolumeScore | None


@dataclass(frozen=True)
class Task:
    """A scene, and the methods that are still to be tried on it.

    Attributes
    ----------
    family, radar, seed
    methods : tuple of str
        See `load_method`.
    sweeps : Path, optional
        Folder that keeps simulated sweeps.
    """

    family: Family
    radar: Radar
    seed: int
    methods: tuple[str, ...]
    sweeps: Path | None = None


def judge(task: Task) -> list[Line]:
    """The line of every method; whatever goes wrong is told in it."""
    seconds: dict[str, float] = {}
    known: Any = LEFT_OUT
    try:
        scene = draw(task.family, task.seed, radar=task.radar)
        known = scene_digest(task, scene)
        path = _kept_sweep(task, known)
        sweep = _timed(seconds, "simulate", lambda: _simulated(task, scene, path, known))
        image = _timed(seconds, "focus", lambda: focus(sweep, tolerance=TOLERANCE_TO_FOLD))
    except Exception as error:
        said = _said(error, "there is no image,")
        return [_line(task, method, seconds, known, error=said) for method in task.methods]
    measured = None if task.family.engine == "raster" else sweep
    return [_judged(task, method, scene, image, measured, seconds, known) for method in task.methods]


def _judged(
    task: Task,
    method: str,
    scene: Any,
    image: xr.DataArray,
    sweep: xr.Dataset | None,
    before: dict[str, float],
    known: str,
) -> Line:
    """The line of one method, which gets copies: it may write into what it is given."""
    seconds = dict(before)
    function = load_method(method)
    given = image.copy(deep=True), None if sweep is None else sweep.copy(deep=True)
    try:
        with _apart():
            result = _timed(seconds, "fold", lambda: function(*given))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever a method does wrong is its failure, not the benchmark's
        return _line(task, method, seconds, known, error=_said(error, "the method raised"))
    try:
        found = _timed(seconds, "score", lambda: score(as_reconstruction(result, image), scene))
    except Exception as error:
        return _line(task, method, seconds, known, error=_said(error, "what the method returned cannot be scored,"))
    return _line(task, method, seconds, known, score=found)


@contextmanager
def _apart() -> Iterator[None]:
    """What a method prints goes to stderr, for stdout may be JSON; where it goes, and how it counts, ends with it."""
    with chdir("."), np.errstate(), redirect_stdout(sys.stderr):
        yield


def _said(error: BaseException, what: str) -> str:
    """An error in one sentence; those that are not meant for users say what happened first."""
    text = str(error) if isinstance(error, InputError) else f"{what} {type(error).__name__}: {error}"
    return " ".join(text.split()).removesuffix(":")


def _line(
    task: Task, method: str, seconds: dict[str, float], known: Any, *, score: Any = None, error: str | None = None
) -> Line:
    return Line(
        family=task.family.name, radar=task.radar.name, seed=task.seed, method=method, version=__version__,
        scene=known, error=error, seconds=seconds, score=score,
    )  # fmt: skip


def simulated(task: Task, scene: Any) -> xr.Dataset:
    """The sweep of a scene, from the folder of sweeps if it is there and can be trusted."""
    known = scene_digest(task, scene)
    return _simulated(task, scene, _kept_sweep(task, known), known)


def scene_digest(task: Task, scene: Any) -> str:
    """A digest of all that a simulated sweep depends on."""
    return hashlib.sha256(repr((__version__, scene, sorted(_options(task).items()))).encode()).hexdigest()


def _options(task: Task) -> dict[str, Any]:
    """How the scene of a task is simulated."""
    family = task.family
    solver = "fullwave" if family.engine == "fullwave" else "rays"
    return {"solver": solver, "seed": task.seed, "snr_db": family.snr_db, **family.options}


def _kept_sweep(task: Task, known: str) -> Path | None:
    """Where the sweep of a scene is kept, if it is to be; a file that cannot be trusted is removed, with a warning."""
    if task.sweeps is None:
        return None
    # Whatever changes the sweep changes the name of its file.
    path = task.sweeps / f"{task.family.name} {task.radar.name} {task.seed} {known[:12]}.nc".replace(" ", "-")
    if path.is_file() and not is_sealed(path, known):
        warnings.warn(f"{path}: is damaged or was not written by a benchmark, and is simulated again", stacklevel=2)
        path.unlink()
    return path


def _simulated(task: Task, scene: Any, path: Path | None, known: str) -> xr.Dataset:
    """The sweep of a scene, from its file if it is there."""
    if path is not None and path.is_file():
        kept = load(path)
        assert isinstance(kept, xr.Dataset)  # nothing else is sealed there
        return kept
    sweep = simulate(scene, **_options(task))
    if path is not None:
        with written_whole(path) as temporary:
            save(sweep, temporary)
            seal(temporary, known)
    return sweep


def _timed(seconds: dict[str, float], step: str, work: Callable[[], T]) -> T:
    """What a step returns, without its warnings; how long it took is noted."""
    started = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return work()
        finally:
            seconds[step] = round(time.perf_counter() - started, 4)
