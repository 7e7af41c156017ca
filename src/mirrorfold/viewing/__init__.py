"""The live page: it shows a file in the browser, and folds it anew while the user moves mirrors or changes settings.

The page is that of a report with controls. It asks a server, made with the standard library, for every fold. So no
further package is needed, a fold is on the screen in a fraction of a second, and a test can operate the page like a
person.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D


def view(
    path: str | Path,
    *,
    scene: Scene | Scene3D | str | Path | None = None,
    plan: FloorPlan | str | Path | None = None,
    frame: int | None = None,
    port: int = 0,
    open_browser: bool = True,
    announce: Callable[[str], None] | None = None,
) -> None:
    """Serve a live page of a file to the browser on this machine, until interrupted.

    Parameters
    ----------
    path : path
        Sweep, image or reconstruction (netCDF). If the file cannot be read, the page says why.
    scene : Scene, Scene3D or path of a scene file, optional
        The truth, drawn as thin lines; the result is scored against it.
    plan : FloorPlan or path of a DXF or GeoJSON file, optional
        Known walls, drawn like the truth.
    frame : int, optional
        Which frame of a recording.
    port : int
        Port of the server; 0 for any free port.
    open_browser : bool
        Whether to open the page.
    announce : callable (address), optional
        Called with a link to the page, which works once, when the server is ready.

    Raises
    ------
    InputError
        If there is no such file, the port is not free, or the scene is wrong.
    """
    from mirrorfold.common.arguments import path_of
    from mirrorfold.common.reading import check_file
    from mirrorfold.io.plans import as_plan
    from mirrorfold.scenes.floor_plan import as_scene
    from mirrorfold.viewing.server import Server
    from mirrorfold.viewing.session import Session

    path = path_of("view", path, "the path of a sweep, an image or a reconstruction; write it with mf.save first")
    check_file(path, "give a sweep, an image or a reconstruction (netCDF)")
    truth = None if scene is None else as_scene(scene)
    walls = None if plan is None else as_plan(plan)
    session = Session(path, truth, frame=frame, plan=walls)
    with Server(session, port) as server:
        session.open()  # only now that there is a port: otherwise nobody would see it
        if announce is not None:
            announce(server.link())
        if open_browser:
            import webbrowser

            webbrowser.open(server.link())
        server.serve_forever(poll_interval=0.2)


__all__ = ["view"]
