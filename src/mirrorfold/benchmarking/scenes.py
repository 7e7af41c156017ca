"""One scene of a benchmark: it is drawn, simulated and focused; then each method reconstructs it and is scored."""

from __future__ import annotations

import hashlib
import re
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from mirrorfold import __version__
from mirrorfold.benchmarking.methods import as_reconstruction, load_method, output_to_stderr
from mirrorfold.common.parts import is_sealed, seal
from mirrorfold.common.records import LEFT_OUT, Record, fact
from mirrorfold.errors import InputError, shortened
from mirrorfold.focusing import focus
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.io import load, save
from mirrorfold.io.files import written_atomically
from mirrorfold.scenes.families import Family, Radar, draw
from mirrorfold.scoring.score import PlanScore, VolumeScore, score
from mirrorfold.simulation import simulate

MOST_LETTERS = 80
"""Letters of the names of family and radar in the name of a file: disks allow 255 in all."""

T = TypeVar("T")


class Line(Record):
    """The result of one method on one scene: a line of the file of results."""

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
        Folder in which simulated sweeps are kept.
    """

    family: Family
    radar: Radar
    seed: int
    methods: tuple[str, ...]
    sweeps: Path | None = None


@output_to_stderr()
def judge(task: Task) -> list[Line]:
    """The line of every method on one scene; an error is reported in the line."""
    seconds: dict[str, float] = {}
    digest: Any = LEFT_OUT
    try:
        scene = draw(task.family, task.seed, radar=task.radar)
        digest = scene_digest(task, scene)
        path = _kept_sweep(task, digest)
        sweep = _timed(seconds, "simulate", lambda: _simulated(task, scene, path, digest))
        image = _timed(seconds, "focus", lambda: focus(sweep, tolerance=TOLERANCE_TO_FOLD))
    except (Exception, SystemExit) as error:
        sentence = _sentence(error, "there is no image,")
        return [_line(task, method, seconds, digest, error=sentence) for method in task.methods]
    measured = None if task.family.engine == "raster" else sweep
    return [_judged(task, method, scene, image, measured, seconds, digest) for method in task.methods]


def _judged(
    task: Task,
    method: str,
    scene: Any,
    image: xr.DataArray,
    sweep: xr.Dataset | None,
    earlier: dict[str, float],
    digest: str,
) -> Line:
    """The line of one method. The method gets copies, since it may write into its arguments."""
    seconds = dict(earlier)
    function = load_method(method)
    given = image.copy(deep=True), None if sweep is None else sweep.copy(deep=True)
    try:
        with _isolated():
            result = _timed(seconds, "fold", lambda: function(*given))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # any error of a method is a failure of the method, not of the benchmark
        return _line(task, method, seconds, digest, error=_sentence(error, "the method raised"))
    try:
        found = _timed(seconds, "score", lambda: score(as_reconstruction(result, image), scene))
    except Exception as error:
        return _line(
            task, method, seconds, digest, error=_sentence(error, "what the method returned cannot be scored,")
        )
    return _line(task, method, seconds, digest, score=found)


@contextmanager
def _isolated() -> Iterator[None]:
    """Restore the folder and NumPy's error state after a method."""
    with chdir("."), np.errstate():
        yield


def _sentence(error: BaseException, what: str) -> str:
    """An error as one sentence; an error that is not meant for users is introduced by `what`."""
    try:
        told = str(error)
    except Exception:  # a foreign error may fail to say what it is
        told = "its message cannot be read"
    text = told if isinstance(error, InputError) else f"{what} {type(error).__name__}: {told}"
    return " ".join(shortened(text).split()).removesuffix(":")


def _line(
    task: Task, method: str, seconds: dict[str, float], digest: Any, *, score: Any = None, error: str | None = None
) -> Line:
    return Line(
        family=task.family.name, radar=task.radar.name, seed=task.seed, method=method, version=__version__,
        scene=digest, error=error, seconds=seconds, score=score,
    )  # fmt: skip


def simulated(task: Task, scene: Any) -> xr.Dataset:
    """The sweep of a scene: from the folder of sweeps if a trusted file is there, else simulated."""
    digest = scene_digest(task, scene)
    return _simulated(task, scene, _kept_sweep(task, digest), digest)


def scene_digest(task: Task, scene: Any) -> str:
    """A digest of everything that a simulated sweep depends on."""
    return hashlib.sha256(repr((__version__, scene, sorted(_options(task).items()))).encode()).hexdigest()


def _options(task: Task) -> dict[str, Any]:
    """Options of the simulation of a task."""
    family = task.family
    solver = "fullwave" if family.engine == "fullwave" else "rays"
    return {"solver": solver, "seed": task.seed, "snr_db": family.snr_db, **family.options}


def _kept_sweep(task: Task, digest: str) -> Path | None:
    """The file of a sweep, None if sweeps are not kept; a file that cannot be trusted is removed, with a warning."""
    if task.sweeps is None:
        return None
    # Anything that changes the sweep changes the digest, and so the name of its file.
    name = f"{task.family.name} {task.radar.name}"[:MOST_LETTERS]
    path = task.sweeps / re.sub(r"[^\w.,-]", "-", f"{name} {task.seed} {digest[:12]}.nc")
    if path.is_file() and not is_sealed(path, digest):
        warnings.warn(f"{path}: is damaged or was not written by a benchmark, and is simulated again", stacklevel=2)
        path.unlink()
    return path


def _simulated(task: Task, scene: Any, path: Path | None, digest: str) -> xr.Dataset:
    """The sweep of a scene: from its file if it exists, else simulated."""
    if path is not None and path.is_file():
        kept = load(path)
        assert isinstance(kept, xr.Dataset)  # nothing else is sealed there
        return kept
    sweep = simulate(scene, **_options(task))
    if path is not None:
        with written_atomically(path) as temporary:
            save(sweep, temporary)
            seal(temporary, digest)
    return sweep


def _timed(seconds: dict[str, float], step: str, work: Callable[[], T]) -> T:
    """The result of a step, without its warnings; the time that it took is stored in `seconds`."""
    started = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return work()
        finally:
            seconds[step] = round(time.perf_counter() - started, 4)
