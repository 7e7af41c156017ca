"""The session of a live page: it opens a file, folds it on request, and saves folds with the command to repeat them."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arcs import mirror_places
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.stopping import StoppedError, stop
from mirrorfold.detection.mirrors.known_mirrors import check_mirrors, write_mirrors
from mirrorfold.errors import InputError
from mirrorfold.focusing import focus
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.folding import PRESETS
from mirrorfold.folding.earlier import initial_image
from mirrorfold.folding.frames import named_frame
from mirrorfold.folding.pictures import Grid
from mirrorfold.io import load, save
from mirrorfold.io.files import check_output, directory_written_atomically
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.reporting.document import shown_extent, shown_grid, to_document, truth_lines
from mirrorfold.sweep import is_raster
from mirrorfold.viewing.controls import CHANGEABLE, check_value, controls
from mirrorfold.viewing.held import held_settings, what_is_lost
from mirrorfold.viewing.lines import line_of, without_straight_middle
from mirrorfold.viewing.repeating import command_to_repeat

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

Array = NDArray[np.float64]

LIVE_PIXELS = 480_000
"""Largest number of pixels of each picture in the page, 600 x 800; with more, the picture would lag behind a mirror
that is dragged. Saved files have all pixels."""

NAME = re.compile(r"[^-/\\:][^/\\:]*\.nc")
"""Pattern of the name of a file to save: without a slash it cannot lead to another directory, and without a hyphen at
its start it is no option of a command."""


class ConflictError(InputError):
    """A request conflicts with a file that is there already, or with a later request to stop."""


UNREAD = {"status": "busy", "step": "reading the file", "done": 0, "total": 1}
"""The state of a session before anything of its file is known."""


class Session:
    """One file that is opened in the background, and folded on request.

    Parameters
    ----------
    path : path
        Sweep, image or reconstruction.
    scene : Scene or Scene3D, optional
        The truth.
    frame : int, optional
        Which frame of a recording.
    plan : FloorPlan, optional
        Known walls, drawn like the truth.
    """

    def __init__(
        self,
        path: str | Path,
        scene: Scene | Scene3D | None = None,
        *,
        frame: int | None = None,
        plan: FloorPlan | None = None,
    ) -> None:
        self.path = Path(path)
        self.frame, self.plan = frame, plan
        self.scene = scene
        self._lock, self._saving = threading.Lock(), threading.Lock()
        self._stops: dict[str, threading.Event] = {}
        self._lines: Array | None = None
        self._state: dict[str, Any] = dict(UNREAD)

    def open(self) -> threading.Thread:
        """Read the file, focus a sweep, and fold an image, all in a thread; `state` tells the progress."""
        self._state = dict(UNREAD)
        worker = threading.Thread(target=self._open, daemon=True)
        worker.start()
        return worker

    @property
    def state(self) -> dict[str, Any]:
        """How far opening is: `status` "busy" with the step, "failed" with a message, or "ready" with the document."""
        return self._state

    def _open(self) -> None:
        """Open the file, and set the state."""
        try:
            with self._lock:
                document = self._first(named_frame(cast(Any, load(self.path)), self.frame))
            self._state = {"status": "ready", "document": document}
        except InputError as error:
            self._state = {"status": "failed", "message": str(error)}
        except MemoryError:
            self._state = {"status": "failed", "message": f"{self.path}: there is not enough memory to open it"}
        except Exception as error:  # the page shows bugs too, instead of waiting for ever
            found = f"{type(error).__name__}: {error}"
            self._state = {
                "status": "failed",
                "message": f"{self.path}: opening it failed by a mistake of ours ({found})",
            }

    def _report(self, step: str) -> Any:
        """A function that reports the progress of a step in the state."""

        def report(done: int, total: int) -> None:
            self._state = {"status": "busy", "step": step, "done": int(done), "total": int(total)}

        report(0, 1)
        return report

    def _first(self, found: Any) -> dict[str, Any]:
        """The first document of the file's content; makes the plan that all further folds use."""
        self._sweep, self._focused = None, isinstance(found, xr.Dataset)
        preset = "default"
        plan: FoldPlan | None = None
        self._note = ""
        self._opened = found if isinstance(found, xr.DataTree) else None
        if isinstance(found, xr.DataTree):
            reconstruction = found
            self._note = what_is_lost(reconstruction)
            preset = str(found.attrs.get("preset", "default"))
            preset = preset if preset in PRESETS else "default"
        elif isinstance(found, xr.Dataset | xr.DataArray):
            if isinstance(found, xr.Dataset):
                image = focus(found, tolerance=TOLERANCE_TO_FOLD, progress=self._report("focusing"))
                self._sweep = None if is_raster(found) else found
            else:
                image = found
            plan = FoldPlan(image, sweep=self._sweep)
            plan.expect_memory()
            reconstruction = plan.fold(progress=self._report("folding"))
        else:
            raise InputError(
                f"{self.path}: is a scene, expected a sweep, an image or a reconstruction; simulate it first"
            )
        self.editable = "z" not in reconstruction.children["objects"].variables
        # What the file says of its image, which a fold of a reconstruction takes to be normalized.
        self._of_image = {name: value for name, value in reconstruction.attrs.items() if str(name).startswith("image_")}
        held = held_settings(reconstruction.attrs, PRESETS[preset])
        self._preset = preset
        self._settings = {name: value for name, value in held.items() if name in CHANGEABLE}
        self._kept = {name: value for name, value in held.items() if name not in CHANGEABLE}
        # Mirrors that were given to the first fold are given to all further ones.
        if self.editable and reconstruction.attrs.get("mirrors_given"):
            given = reconstruction.children["mirrors"].to_dataset(inherit=False)
            self._lines = check_mirrors(mirror_places(given))
        truth = [] if self.scene is None else truth_lines(self.scene)
        truth += [] if self.plan is None else [line.tolist() for line in self.plan.lines]
        self._extent = shown_extent(reconstruction, truth)
        document = to_document(
            reconstruction, self.scene, largest_image=LIVE_PIXELS, extent=self._extent, effort=1, plan=self.plan
        )
        self._zero_db = document["zero_db"]
        if self.editable:
            self._plan = FoldPlan(reconstruction) if plan is None else plan
            self._grid = shown_grid(initial_image(reconstruction), self._extent, LIVE_PIXELS)
            # The first fold computes what all further folds share, and the settings that are chosen from the image.
            first = self._fold(self._settings, self._lines, grid=self._grid)
            used = held_settings(first.attrs, PRESETS[preset])
            self._settings = {name: used[name] for name in CHANGEABLE}
        state = self._edit_state()
        self._first_settings = self._settings
        self._first_lines = None if state["lines"] is None else check_mirrors(state["lines"])
        return {**document, **state}

    def _edit_state(self) -> dict[str, Any]:
        """The part of a document about editing: controls, their values, given mirrors, and the name to save under."""
        lines = None if self._lines is None else [without_straight_middle(points).tolist() for points in self._lines]
        return {
            "editable": self.editable,
            "values": {**self._settings},
            "controls": controls(self._settings, tested=self._sweep is not None) if self.editable else [],
            "lines": lines,
            "note": self._note if self.editable else "",
            "file": self.path.name,
            "save_as": f"{self.path.stem}.edited.nc",
        }

    def fold(self, request: Any) -> dict[str, Any]:
        """Fold with other settings or mirrors.

        Parameters
        ----------
        request : dict
            `settings`: values of some of `mirrorfold.viewing.controls.CHANGEABLE`, by name; `mirrors`: both ends of
            each mirror [m], for an arc with a point between them, or None to find mirrors; `score`: whether to score
            the result too, which takes longer than the fold; `page`: a name of the page that asks, by which `cancel`
            stops the fold. Folds of several pages run side by side.

        Returns
        -------
        dict
            The document of the result, without the initial image. `line_of` tells for every mirror on which of the
            given lines it lies, `milliseconds` how long the fold took.

        Raises
        ------
        InputError
            If a setting or a mirror of the request is wrong.
        ConflictError
            If the fold was stopped.
        """
        settings, lines = self._checked(request)
        start = time.perf_counter()
        with self._stoppable(request):
            found = self._fold(settings, lines, grid=self._grid)
        with self._lock:
            self._settings, self._lines = settings, lines
        document = to_document(
            found,
            self.scene,
            largest_image=LIVE_PIXELS,
            extent=self._extent,
            zero_db=self._zero_db,
            effort=1,
            plan=self.plan,
            images=("corrected",),
            scored=request.get("score") is True,
        )
        document["line_of"] = (
            [] if lines is None else [line_of(mirror["ends"], lines) for mirror in document["mirrors"]]
        )
        document["milliseconds"] = 1e3 * (time.perf_counter() - start)
        return {**document, **self._edit_state()}

    def cancel(self, request: Any) -> dict[str, Any]:
        """Stop the fold that a page has asked for, if it is still running.

        Parameters
        ----------
        request : dict
            `page`: name of the page.
        """
        with self._lock:
            going = self._stops.get(str(request.get("page")))
        if going is not None:
            going.set()
        return {"stopped": going is not None}

    @contextmanager
    def _stoppable(self, request: Any) -> Iterator[None]:
        """A context in which `cancel` can stop a fold."""
        page, asked = str(request.get("page")), threading.Event()
        with self._lock:
            self._stops[page] = asked
        token = stop.set(asked.is_set)
        try:
            yield
        except StoppedError:
            raise ConflictError("the fold was stopped; what is shown is the one before") from None
        finally:
            stop.reset(token)
            with self._lock:
                if self._stops.get(page) is asked:
                    del self._stops[page]

    def save(self, request: Any) -> dict[str, Any]:
        """Save a fold with the given settings and mirrors, with all pixels, beside the viewed file.

        A reconstruction of which nothing was changed is saved as it was opened, without a new fold.

        Parameters
        ----------
        request : dict
            `name`: name of the file; `settings` and `mirrors` as for `fold`; `replace`: true to replace a file that is
            there already.

        Returns
        -------
        dict
            The saved `files`, and the `command` that makes the same result again, empty where it is unknown.

        Raises
        ------
        InputError
            If the name or the request is wrong, or the file cannot be written.
        ConflictError
            If a file is there already, and `replace` is not true; or if the fold was stopped.
        """
        settings, lines = self._checked(request)
        name = request.get("name")
        if not isinstance(name, str) or not NAME.fullmatch(name) or ".." in name or not name.isprintable():
            raise InputError(f"the name to save under is {name!r}, expected a plain name that ends in .nc")
        output = check_output(self.path.parent / name, inputs=[self.path])
        mirrors = output.with_suffix(".mirrors.json")
        unchanged = self._opened if self._is_first(settings, lines) else None
        files = [output] if lines is None or unchanged is not None else [output, mirrors]
        replace = request.get("replace") is True
        _check_free(files, replace=replace)
        with self._stoppable(request):
            result = self._fold(settings, lines) if unchanged is None else unchanged
        if unchanged is None:
            result.attrs["command"] = command_to_repeat(
                self.path,
                output,
                {**settings, **self._kept},
                preset=self._preset,
                frame=self.frame,
                mirrors=None if lines is None else mirrors,
                focused=self._focused,
                tested=self._sweep is not None,
            )
        with self._saving:
            _check_free(files, replace=replace)  # another page may have saved meanwhile
            with directory_written_atomically(output.parent) as folder:
                if lines is not None and mirrors in files:
                    write_mirrors(lines, folder / mirrors.name)
                save(result, folder / output.name)
        return {"files": [str(file) for file in files], "command": str(result.attrs.get("command", ""))}

    def _is_first(self, settings: dict[str, Any], lines: Array | None) -> bool:
        """Whether settings and mirrors are those with which the file was opened."""
        if lines is None or self._first_lines is None:
            return settings == self._first_settings and lines is self._first_lines
        return settings == self._first_settings and np.array_equal(lines, self._first_lines)

    def _fold(self, settings: dict[str, Any], lines: Array | None, grid: Grid | None = None) -> xr.DataTree:
        """A fold with these settings and mirrors, by default with all pixels."""
        found = self._plan.fold(mirrors=lines, preset=self._preset, **self._kept, **settings, grid=grid)
        found.attrs |= self._of_image
        return found

    def _checked(self, request: Any) -> tuple[dict[str, Any], Array | None]:
        """The settings, those not in the request as before, and the mirrors of a request.

        Raises
        ------
        InputError
            If the request is not an object of settings and mirrors, or the file cannot be folded anew.
        """
        if self._state.get("status") != "ready":
            raise InputError(f"{self.path.name}: is not open")
        if not self.editable:
            raise InputError(f"{self.path.name}: is a volume, whose mirrors cannot be changed in the page")
        if not isinstance(request, dict) or not isinstance(request.get("settings", {}), dict):
            raise InputError("the request is no object with 'settings' and 'mirrors'")
        settings = dict(self._settings)
        for name, value in request.get("settings", {}).items():
            check_value(name, value)
            settings[name] = value
        mirrors = request.get("mirrors")
        return settings, None if mirrors is None else check_mirrors(mirrors)


def _check_free(files: list[Path], *, replace: bool) -> None:
    """Refuse to replace files that are there already, unless that is asked for.

    Raises
    ------
    ConflictError
    """
    there = [file.name for file in files if os.path.lexists(file)]
    if there and not replace:
        raise ConflictError(
            f"{' and '.join(there)}: is there already; save once more to replace it, or change the name"
        )
