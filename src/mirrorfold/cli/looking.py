"""The verbs that look at files: a page that stays, a page that answers, and a figure."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

import mirrorfold as mf
from mirrorfold.cli import VERBS
from mirrorfold.cli.terminal import show_files, show_json
from mirrorfold.cli.verbs import Flag, Output, app, read


def report(reconstruction: Path, *, output: Output, scene: Path | None = None, json: Flag = False) -> None:
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
    from mirrorfold.io.files import check_output

    check_output(output, inputs=[path for path in (reconstruction, scene) if path is not None])
    truth = None if scene is None else mf.load_scene(scene)
    mf.report(read(reconstruction, "reconstruction"), output, scene=truth)
    if json:
        show_json({"kind": "report", "bytes": output.stat().st_size, "files": [str(output)]})
        return
    show_files([output])


def view(
    file: Path,
    *,
    scene: Path | None = None,
    port: int = 0,
    no_open: Flag = False,
    json: Flag = False,
) -> None:
    """View a file in the browser.

    Parameters
    ----------
    file
        Sweep, image or reconstruction (netCDF). What is wrong with it is said in the page.
    scene
        Scene file with the truth (TOML).
    port
        Of the page, on this machine alone; any that is free by default.
    no_open
        Do not open the browser.
    json
        Print the address as one JSON object.
    """
    from mirrorfold.viewing import view as serve

    def announce(address: str) -> None:
        if json:
            show_json({"kind": "view", "address": address})
        else:
            print(f"{file} is at {address} for browsers on this machine; Ctrl+C ends it")
        sys.stdout.flush()

    with suppress(KeyboardInterrupt):
        serve(file, scene=scene, port=port, open_browser=not no_open, announce=announce)


for verb in (report, view):
    app.command(
        verb,
        name=verb.__name__,
        help=VERBS[verb.__name__].purpose,
        help_epilogue=f"Example: {VERBS[verb.__name__].example}\n",
        version_flags=[],
    )
