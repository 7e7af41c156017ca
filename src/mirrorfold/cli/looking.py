"""The verbs `report`, `view` and `show`: a page to keep, a live page in the browser, and a figure."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import mirrorfold as mf
from mirrorfold.cli.options import FloorPlanFile, Frame, Output
from mirrorfold.cli.results import load_plan, read
from mirrorfold.cli.terminal import say, show_files, show_json
from mirrorfold.cli.writing import output_file
from mirrorfold.common.records import Record, fact
from mirrorfold.errors import InputError
from mirrorfold.io.suffixes import PICTURES
from mirrorfold.plotting.saving import save_figure


class Report(Record):
    """A report that was written."""

    kind: Literal["report"]
    bytes: int
    files: list[str] = fact("what was written")


class View(Record):
    """A live page that is being served."""

    kind: Literal["view"]
    address: str


class Figure(Record):
    """A figure for a paper or a talk."""

    kind: Literal["figure"]
    what: str
    files: list[str] = fact("what was written")


def report(
    reconstruction: Path,
    *,
    output: Output,
    scene: Path | None = None,
    plan: FloorPlanFile = None,
    frame: Frame = None,
    json: bool = False,
) -> None:
    """Write a report.

    Parameters
    ----------
    reconstruction
        Reconstruction to read (netCDF).
    output
        Page to write (HTML).
    scene
        Scene file with the truth (TOML), to draw it and to score against it.
    json
        Print what was written as one JSON object.
    """
    from mirrorfold.folding.frames import named_frame
    from mirrorfold.reporting import PAGES

    output_file(output, inputs=[reconstruction, scene, plan], suffixes=PAGES)
    truth = None if scene is None else mf.load_scene(scene)
    found = named_frame(read(reconstruction, "reconstruction"), frame)
    mf.report(found, output, scene=truth, plan=load_plan(plan))
    if json:
        show_json(Report(kind="report", bytes=output.stat().st_size, files=[str(output)]))
        return
    show_files([output])


def view(
    file: Path,
    *,
    scene: Path | None = None,
    plan: FloorPlanFile = None,
    frame: Frame = None,
    port: int = 0,
    no_open: bool = False,
    json: bool = False,
) -> None:
    """View a file in the browser.

    Parameters
    ----------
    file
        Sweep, image or reconstruction (netCDF). The page lists what is wrong with it.
    scene
        Scene file with the truth (TOML).
    port
        Port of the page, on this machine alone; by default any free one.
    no_open
        Do not open the browser.
    json
        Print the address as one JSON object.
    """
    from mirrorfold.viewing import view as serve

    def announce(address: str) -> None:
        if json:
            show_json(View(kind="view", address=address))
        else:
            say(f"{file} is at {address} for one browser on this machine: the link works once; Ctrl+C ends it")
        sys.stdout.flush()

    with suppress(KeyboardInterrupt):
        serve(file, scene=scene, plan=plan, frame=frame, port=port, open_browser=not no_open, announce=announce)


def show(
    file: Path,
    *,
    output: Output,
    what: Literal["before-after", "initial", "corrected", "mirrors", "tree", "space", "body", "score", "frames"]
    | None = None,
    scene: Path | None = None,
    plan: FloorPlanFile = None,
    frame: Frame = None,
    floor_db: float = -40.0,
    dpi: int = 300,
    json: bool = False,
) -> None:
    """Draw a figure.

    Parameters
    ----------
    file
        Sweep, image, reconstruction (netCDF) or scene (TOML).
    output
        Figure to write (.png, .pdf or .svg).
    what
        Which picture of a reconstruction; by default before-after, for a folded scan space, for a recording frames.
    scene
        Scene file with the truth (TOML), drawn thin; needed for score.
    floor_db
        Level below which images are blank [dB].
    dpi
        Resolution of a PNG, and of the images in PDF and SVG [1/inch].
    json
        Print what was drawn as one JSON object.
    """
    from mirrorfold.cli.figures import draw
    from mirrorfold.io.files import written_atomically

    if not 10 <= dpi <= 2400:
        raise InputError(f"--dpi is {dpi}, expected 10 to 2400 dots per inch")
    output_file(output, inputs=[file, scene, plan], suffixes=PICTURES)
    truth = None if scene is None else mf.load_scene(scene)
    found: Any = mf.load(file)
    if frame is not None:
        found = mf.pick_frame(found, frame)
    drawn, figure = draw(found, what, truth, floor_db, str(file), load_plan(plan))
    with written_atomically(output) as temporary:
        save_figure(figure, temporary, dpi=dpi, bbox_inches="tight")
    if json:
        show_json(Figure(kind="figure", what=drawn, files=[str(output)]))
        return
    show_files([output])
