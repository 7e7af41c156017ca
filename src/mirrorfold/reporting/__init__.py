"""A reconstruction as one self-contained page that needs no network and no server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

PAGES = (".html", ".htm")
"""Suffixes of a page."""

LARGEST_PAGE = 6_000_000
"""Largest size of a page [bytes], so that it can be sent as an attachment; otherwise its pictures are made coarser."""


def report(
    reconstruction: xr.DataTree,
    path: str | Path,
    *,
    scene: Scene | Scene3D | str | Path | None = None,
    plan: FloorPlan | str | Path | None = None,
) -> Path:
    """Write a page that shows a reconstruction, with its points, mirrors, settings and, if `scene` is given, its score.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    path : path
        The HTML file to write.
    scene : Scene, Scene3D or path of a scene file, optional
        The truth: drawn as thin lines, and the result scored against it.
    plan : FloorPlan or path of a DXF or GeoJSON file, optional
        Known walls, drawn like the truth.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    InputError
        If the reconstruction or the scene cannot be used, or the file cannot be written.
    """
    from mirrorfold.folding.frames import pick_frame
    from mirrorfold.io.files import check_output, written_atomically
    from mirrorfold.io.own.checks import check_reconstruction
    from mirrorfold.io.plans import as_plan
    from mirrorfold.reporting.document import LARGEST_IMAGE, title_of, to_document
    from mirrorfold.reporting.page import to_html

    path = check_output(path, suffixes=PAGES)
    checked = pick_frame(check_reconstruction(reconstruction))
    walls = None if plan is None else as_plan(plan)
    corners = np.array([np.asarray(checked[axis])[[0, -1]] for axis in "xy"]).T
    if walls is not None and walls.lies_beyond(*corners):
        walls = None
    truth = None
    if scene is not None:
        from mirrorfold.scenes.floor_plan import as_scene

        truth = as_scene(scene)
    limit = LARGEST_IMAGE
    while True:
        page = to_html(to_document(checked, truth, largest_image=limit, plan=walls), title=title_of(checked, truth))
        if len(page) <= LARGEST_PAGE or limit < LARGEST_IMAGE // 64:
            break
        limit //= 2
    with written_atomically(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


__all__ = ["report"]
