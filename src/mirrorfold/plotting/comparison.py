"""The initial image beside the corrected one, at one scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard, cast

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mirrorfold.common.arguments import boolean
from mirrorfold.common.decibels import PASSED_COLOUR, PASSED_LABEL, TRUTH_COLOUR, bounce_label
from mirrorfold.folding.confident import confident_points, passed_walls
from mirrorfold.folding.frames import pick_frame
from mirrorfold.plotting.axes import (
    CURVE_STEP,
    Extent,
    colour_of,
    draw_radar,
    expect_reconstruction,
    known_plan,
    known_scene,
    mirror_lines,
    radar_of,
)
from mirrorfold.plotting.figures import corrected, ghosts, image, mirrors, shadows
from mirrorfold.plotting.figures import plan as draw_plan
from mirrorfold.plotting.figures import scene as draw_scene
from mirrorfold.plotting.volumes import scene as draw_space

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

MARGIN = 0.12
"""Space around the content of a picture, as a share of its larger side, because ghosts in the image reach beyond their
points."""

PANEL_HEIGHT, PANEL_WIDTH = 5.6, 12.0
"""Largest height of the panels of `before_after`, and width of both together [inch]."""


NO_MIRROR = "no mirror found"

NARROWEST = 2.4
"""Smallest width of a panel [inch], in which its title and three labels of its axis have room."""


def before_after(
    reconstruction: xr.DataTree,
    scene: Scene | Scene3D | str | Path | None = None,
    *,
    plan: FloorPlan | str | Path | None = None,
    floor_db: float = -40.0,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw one figure: the initial image with mirrors and shadows, and beside it the corrected scene.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene, Scene3D or path of a scene file, optional
        The truth, drawn as thin lines in both.
    plan : FloorPlan or path of a DXF or GeoJSON file, optional
        Known walls, drawn like the truth.
    floor_db : float [dB], default -40
    axes : two of matplotlib.axes.Axes, optional
        Two axes of one figure to draw into, without colour bar and legend; by default those of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        Not registered with pyplot; ``figure.savefig(path)`` writes it.
    """
    expect_reconstruction("before_after", reconstruction)
    reconstruction = pick_frame(reconstruction)
    scene, plan = known_scene(scene), known_plan(plan)
    radar = radar_of(reconstruction)
    before = content_extent(reconstruction, scene, plan, folded=False)
    after = content_extent(reconstruction, scene, plan, folded=True)
    bottom, top = min(before[2], after[2]), max(before[3], after[3])
    before, after = (*before[:2], bottom, top), (*after[:2], bottom, top)
    if axes is None:
        scale = _scale(before[1] - before[0], after[1] - after[0], top - bottom)
        before, after = (_widened(extent, NARROWEST / scale) for extent in (before, after))
        figure, (left, right, bar) = _panels(before[1] - before[0], after[1] - after[0], top - bottom)
    else:
        (left, right), bar = axes, None
        figure = left.figure.figure

    initial = reconstruction.children["initial"].dataset["initial"]
    image(initial, left, floor_db=floor_db, normalization="none", extent=before, colorbar=False)
    shadows(reconstruction, left)
    if "z" in reconstruction.children["objects"].variables:
        ghosts(reconstruction, left)
    mirrors(reconstruction, left)
    draw_radar(left, radar)

    corrected(reconstruction, right, floor_db=floor_db, extent=after, colorbar=False)
    for panel in (left, right):
        if _is_flat(scene):
            draw_scene(scene, panel)
        elif scene is not None:
            draw_space(cast("Scene3D", scene), panel)
    found = len(mirror_lines(reconstruction, folded=False)) > 0
    what = "mirrors and their shadows" if found else NO_MIRROR
    left.set(xlim=before[:2], ylim=before[2:], title=f"initial image:\n{what}")
    what = "every echo folded back" if found else "nothing to fold back"
    right.set(xlim=after[:2], ylim=after[2:], title=f"corrected:\n{what}")
    for panel in (left, right):
        if plan is not None:
            draw_plan(plan, panel)
        inches = panel.get_position().width * figure.get_figwidth()
        panel.locator_params(axis="x", nbins=max(2, min(6, int(inches / 0.7))))
    if bar is None:
        return figure
    right.set(ylabel="", yticklabels=[])
    figure.colorbar(right.images[0], cax=bar, label=f"amplitude [dB], floor {floor_db:g} dB")
    figure.legend(handles=legend_entries(reconstruction, scene, plan), loc="lower center", ncols=6, frameon=False)
    return figure


def content_extent(
    reconstruction: xr.DataTree,
    scene: Scene | Scene3D | str | Path | None = None,
    plan: FloorPlan | str | Path | None = None,
    *,
    folded: bool,
) -> Extent:
    """The extent of the floor plan that holds points, mirrors, the radar and known surfaces, with a margin.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene, Scene3D or path of a scene file, optional
        Its surfaces count too. Those of three-dimensional scenes do not, because halls are longer than what is seen.
    plan : FloorPlan or path of a DXF or GeoJSON file, optional
        Its walls count too, unless each of them reaches far beyond the image, which gives a warning.
    folded : bool
        Whether the extent is that of the corrected image, or of the initial one.

    Returns
    -------
    (x0, x1, y0, y1) [m]
        The whole grid where nothing was found.
    """
    expect_reconstruction("content_extent", reconstruction)
    scene, plan, folded = known_scene(scene), known_plan(plan), boolean("folded", folded)
    objects = confident_points(reconstruction)
    suffix = "" if folded else "_initial"
    points = [radar_of(reconstruction)[None], np.column_stack([objects[f"x{suffix}"], objects[f"y{suffix}"]])]
    points += [ends for ends, _ in mirror_lines(reconstruction, folded=folded)]
    if _is_flat(scene):
        points += [piece for surface in scene.surface for piece in surface.pieces(CURVE_STEP)]
    grid = reconstruction.children["initial"].dataset
    corners = np.column_stack([grid["x"].values[[0, -1]], grid["y"].values[[0, -1]]])
    if plan is not None and not plan.lies_beyond(*corners):
        points += plan.lines
    found = np.concatenate(points)
    if len(found) == 1:
        found = corners
    low, high = found.min(axis=0), found.max(axis=0)
    margin = MARGIN * float((high - low).max())
    return (low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin)


def _scale(left_width: float, right_width: float, height: float) -> float:
    """Scale of two panels of these sizes [m], in inches for each metre."""
    return min(PANEL_HEIGHT / height, PANEL_WIDTH / (left_width + right_width))


def _widened(extent: Extent, least: float) -> Extent:
    """The extent widened to at least `least` [m], around the same middle."""
    more = 0.5 * max(least - (extent[1] - extent[0]), 0.0)
    return extent[0] - more, extent[1] + more, *extent[2:]


def _panels(left_width: float, right_width: float, height: float) -> tuple[Figure, list[Axes]]:
    """A figure with two panels of these sizes [m] at one scale, and narrow axes for a colour bar."""
    scale = _scale(left_width, right_width, height)
    widths = [left_width * scale, right_width * scale, 0.18]
    size = np.array([0.8 + sum(widths) + 2 * 0.25 + 0.8, 1.0 + height * scale + 0.65])
    figure = Figure(figsize=(max(size[0], 7.0), size[1]), dpi=150)
    axes, corner = [], 0.8
    for width in widths:
        axes.append(figure.add_axes((corner / figure.get_figwidth(), 1.0 / size[1], width / figure.get_figwidth(),
                                     height * scale / size[1])))  # fmt: skip
        corner += width + 0.25
    return figure, axes


def _is_flat(scene: Scene | Scene3D | None) -> TypeGuard[Scene]:
    """Whether a scene has two dimensions, found without importing scenes, as most results are drawn without one."""
    return getattr(scene, "dimensions", 3) == 2


def legend_entries(reconstruction: xr.DataTree, scene: Scene | Scene3D | None, plan: FloorPlan | None) -> list[Line2D]:
    """Entries of the legend: one for each colour in the picture, for the truth and for the floor plan."""
    objects = confident_points(reconstruction)
    passed = passed_walls(objects)
    bounces = {int(count) for count in np.unique(objects["bounces"].values[~passed])}
    bounces |= {generation - 1 for _, generation in mirror_lines(reconstruction, folded=False)}
    handles = [
        Line2D([], [], color=colour_of(count), linewidth=2.5, marker="o", markersize=4, label=bounce_label(count))
        for count in sorted(bounces)
    ]
    if passed.any():
        handles.append(
            Line2D([], [], color=PASSED_COLOUR, linestyle="none", marker="D", markersize=4, label=PASSED_LABEL)
        )
    for known, label in ((scene, "truth"), (plan, "floor plan")):
        if known is not None:
            handles.append(Line2D([], [], color=TRUTH_COLOUR, linewidth=0.9, label=label))
    return handles
