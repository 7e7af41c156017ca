"""What an experiment works with: its size, its progress, and a place that keeps what has been done of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import xarray as xr

import mirrorfold as mf
from mirrorfold.common.parts import Parts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mirrorfold.common.types import Progress
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

T = TypeVar("T")


@dataclass
class Work:
    """An experiment at work.

    What `sweep` and `kept` return is kept on disk until the experiment is done. When it is run again after an
    interruption, they return it at once. They know it by the order of the calls, which must therefore be the same in
    every run.

    Attributes
    ----------
    quick : bool
        At reduced size.
    folder : Path, optional
        Of what is kept; nothing is kept without one.
    digest : str
        Of the program; what another one has kept is not used.
    workers : int
        Processes for full waves.
    progress : callable (done, total), optional
    """

    quick: bool
    folder: Path | None = None
    digest: str = ""
    workers: int = 1
    progress: Progress | None = None
    _number: Iterator[int] = field(default_factory=count, repr=False)

    def size(self, full: T, quick: T) -> T:
        """One of two sizes of the same, such as a number of scenes: the quick one for a quick run."""
        return quick if self.quick else full

    def step(self, done: int, total: int) -> None:
        """Tell how far the experiment is."""
        if self.progress is not None:
            self.progress(done, total)

    def sweep(self, scene: Scene | Scene3D, **settings: Any) -> xr.Dataset:
        """The sweep of a scene by `mirrorfold.simulate`, with these settings; kept."""
        number = next(self._number)
        parts = self._parts(".nc")
        if parts is not None and number in _whole(parts):
            return _expected(mf.load(parts.path(number)), xr.Dataset)
        if settings.get("solver") == "fullwave":
            settings["workers"] = self.workers
            if self.folder is not None:
                settings["checkpoint"] = self.folder / f"frequencies-{number}"
                settings["resume"] = settings["checkpoint"].exists()
        found = mf.simulate(scene, **settings, progress=self.progress)
        if parts is not None:
            with parts.written(number) as temporary:
                mf.save(found, temporary.with_suffix(".nc"))
                temporary.with_suffix(".nc").rename(temporary)
        return found

    def kept(self, compute: Callable[[], T]) -> T:
        """What a function returns, made of lists, dicts with text for keys, texts and numbers; kept as JSON."""
        number = next(self._number)
        parts = self._parts(".json")
        if parts is not None and number in _whole(parts):
            return _decoded(parts.path(number))
        found = compute()
        if parts is not None:
            with parts.written(number) as temporary:
                temporary.write_text(json.dumps(found), encoding="utf-8")
        return found

    def _parts(self, suffix: str) -> Parts | None:
        """The place of what is kept in files of one kind."""
        if self.folder is None:
            return None
        self.folder.mkdir(parents=True, exist_ok=True)
        return Parts(self.folder / suffix[1:], self.digest, "program", suffix)


def _whole(parts: Parts) -> set[int]:
    """The numbers that may be used: whole, and of the same program."""
    return parts.verified() if parts.fingerprint_found == parts.fingerprint else set()


def _decoded(path: Path) -> Any:
    """The JSON at the head of a sealed file."""
    return json.JSONDecoder().raw_decode(path.read_bytes().decode("utf-8", errors="replace"))[0]


def _expected(found: Any, kind: type[T]) -> T:
    """What was read, which is of the kind that was written."""
    assert isinstance(found, kind)
    return found
