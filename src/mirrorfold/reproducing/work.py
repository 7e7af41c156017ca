"""What a running experiment is given: its size, a way to report progress, and a store of intermediate results."""

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
    """A running experiment: its size, its progress, and its store of intermediate results.

    The results of `sweep` and `kept` are stored on disk until the experiment is done. When the experiment is run again
    after an interruption, both return the stored results at once. Each result is identified by the number of the call
    that computed it. Therefore the order of the calls must be the same in every run.

    Attributes
    ----------
    quick : bool
        Whether the experiment runs at reduced size.
    folder : Path, optional
        Folder of the stored results; without a folder, nothing is stored.
    digest : str
        Digest of the program; results that another program has stored are not used.
    workers : int
        Number of processes that solve for full waves.
    progress : callable (done, total), optional
        Called to report how many steps are done, of how many in total.
    """

    quick: bool
    folder: Path | None = None
    digest: str = ""
    workers: int = 1
    progress: Progress | None = None
    _number: Iterator[int] = field(default_factory=count, repr=False)

    def size(self, full: T, quick: T) -> T:
        """One of two values of a size, such as a number of scenes: `quick` in a quick run, otherwise `full`."""
        return quick if self.quick else full

    def step(self, done: int, total: int) -> None:
        """Report that `done` steps of `total` are done."""
        if self.progress is not None:
            self.progress(done, total)

    def sweep(self, scene: Scene | Scene3D, **settings: Any) -> xr.Dataset:
        """The sweep of a scene, simulated by `mirrorfold.simulate` with these settings, or as it was stored before."""
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

    def reconstruction(self, scene: Scene | Scene3D, **settings: Any) -> xr.DataTree:
        """The reconstruction from the `sweep` of a scene, by `mirrorfold.reconstruct` as it is."""
        return mf.reconstruct(self.sweep(scene, **settings))

    def kept(self, compute: Callable[[], T]) -> T:
        """The result of a function, computed, or as it was stored before.

        It is stored as JSON, and must consist of lists, dicts whose keys are texts, texts and numbers.
        """
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
        """The store of the results in files of one suffix; None without a folder."""
        if self.folder is None:
            return None
        self.folder.mkdir(parents=True, exist_ok=True)
        return Parts(self.folder / suffix[1:], self.digest, "program", suffix)


def _whole(parts: Parts) -> set[int]:
    """The numbers of the stored results that may be used: those that are complete and come from the same program."""
    return parts.verified() if parts.fingerprint_found == parts.fingerprint else set()


def _decoded(path: Path) -> Any:
    """The JSON with which a stored file begins; a digest follows it."""
    return json.JSONDecoder().raw_decode(path.read_bytes().decode("utf-8", errors="replace"))[0]


def _expected(found: Any, kind: type[T]) -> T:
    """An object that was read, after a check that it is of the type that was written."""
    assert isinstance(found, kind)
    return found
