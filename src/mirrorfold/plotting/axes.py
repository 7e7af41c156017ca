"""Parts that all pictures share: axes in metres, colours by number of bounces, and access to a reconstruction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.patheffects as patheffects
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from mirrorfold.common.arcs import mirror_curves
from mirrorfold.common.arguments import boolean, in_message, number, wrong_kind
from mirrorfold.common.decibels import COLOURS, TRUTH_COLOUR
from mirrorfold.common.facts import recorded_radar
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.io.own.checks import check_reconstruction
from mirrorfold.io.plans import as_plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

Extent = tuple[float, float, float, float]

DRAW_BEFORE_AFTER = "draw it with --what before-after, in Python with mf.plot.before_after"
"""The remedy for a picture that a reconstruction does not have."""

LOWEST_FLOOR_DB = -1000.0
"""Lowest floor of a picture [dB]: no numbers of single precision differ by more."""

CURVE_STEP = 0.005
"""Length of the chords by which curved surfaces are drawn [m]."""


def axes_or_new(ax: Axes | None, size: tuple[float, float] = (7.0, 6.0)) -> Axes:
    """The given axes, or those of a new figure of this width and height [inch]."""
    return Figure(figsize=size, layout="constrained", dpi=150).subplots() if ax is None else ax


def in_metres(ax: Axes) -> Axes:
    """Label both axes in metres, and give them the same scale."""
    ax.set_aspect("equal")
    ax.set(xlabel="cross-range x [m]", ylabel="range y [m]")
    return ax


def checked_extent(extent: Any) -> Extent | None:
    """Check the extent (x0, x1, y0, y1) [m] to which a picture is limited; None where it is not limited.

    Raises
    ------
    InputError
        If it is no such extent.
    """
    if extent is None:
        return None
    row = isinstance(extent, list | tuple) or (isinstance(extent, np.ndarray) and extent.ndim == 1)
    if row and len(extent) == 4:
        x0, x1, y0, y1 = (number("extent", value, "m") for value in extent)
        if x0 < x1 and y0 < y1:
            return x0, x1, y0, y1
    raise InputError(f"extent is {in_message(extent)}, expected (x0, x1, y0, y1) in metres with x0 < x1 and y0 < y1")


def checked_floor(floor_db: Any) -> float:
    """Check the level [dB] below which all is drawn alike.

    Raises
    ------
    InputError
        If it is no negative number, or below `LOWEST_FLOOR_DB`.
    """
    found = number("floor_db", floor_db, "dB")
    if not LOWEST_FLOOR_DB <= found < 0.0:
        raise InputError(
            f"floor_db is {in_message(floor_db)}, expected a negative number of decibels down to {LOWEST_FLOOR_DB:g}, "
            "for example -40"
        )
    return found


def outer_edges(centres: Array) -> tuple[float, float]:
    """Outer edges of the first and the last pixel along an axis, from the pixels' centres."""
    half = 0.5 * mean_step(centres)
    return float(centres[0] - half), float(centres[-1] + half)


def colour_of(bounces: int) -> str:
    """The colour of points and mirrors that were seen by this number of bounces."""
    return COLOURS[bounces % len(COLOURS)]


def halo(width: float) -> list[Any]:
    """A white rim that keeps lines and letters legible on dark pixels."""
    return [patheffects.withStroke(linewidth=2 * width, foreground="white", alpha=0.8)]


def draw_radar(ax: Axes, radar: Array) -> None:
    """Draw a triangle at the radar (2,) [m], unless it is more than 1.5 sizes of the picture from its middle."""
    if ax.images and np.any(np.abs(radar - ax.dataLim.get_points().mean(axis=0)) > 1.5 * np.array(ax.dataLim.size)):
        return
    ax.plot(*radar, marker="^", markersize=9, color="black", markeredgecolor="white", linestyle="none", zorder=5)


def expect_reconstruction(name: str, value: object) -> None:
    """Refuse a value that is no reconstruction.

    Raises
    ------
    InputError
        If it is none; `name` is that of the plot, for the message.
    """
    if not isinstance(value, xr.DataTree):
        raise wrong_kind(f"plot.{name}", value, "a reconstruction (xarray.DataTree), as fold and reconstruct return")
    check_reconstruction(value, source=f"plot.{name}")


def known_scene(scene: Any) -> Scene | Scene3D | None:
    """The true scene of a result, from a scene or the path of its file; None where none is given."""
    if scene is None:
        return None
    from mirrorfold.scenes.floor_plan import as_scene  # heavy, and most results are drawn without a scene

    return as_scene(scene)


def scene_in_space(scene: Any) -> Scene3D:
    """A scene of three dimensions, from a scene or the path of its file.

    Raises
    ------
    InputError
        If it is no scene of three dimensions.
    """
    found = known_scene(scene)
    if found is None or found.dimensions != 3:
        raise wrong_kind("scene", scene, "a scene of three dimensions", reader="mf.load_scene")
    return found


def known_plan(plan: Any) -> FloorPlan | None:
    """The known floor plan of a result, from a plan or the path of its file; None where none is given."""
    return None if plan is None else as_plan(plan)


def draw_truth(ax: Axes, line: Array, alpha: float = 1.0) -> None:
    """Draw a true surface (n, 2) [m] as a thin line, with a rim that keeps it legible on mirrors and points."""
    ax.plot(*line.T, color=TRUTH_COLOUR, linewidth=1.0, alpha=alpha, path_effects=halo(1.1), zorder=4)


def radar_of(reconstruction: xr.DataTree) -> Array:
    """Position of the radar in the floor plan, (2,) [m]."""
    return recorded_radar(reconstruction.attrs)[:2]


def mirror_lines(reconstruction: xr.DataTree, *, folded: bool) -> list[tuple[Array, int]]:
    """Each mirror as a line, its two ends (2, 2) or points along an arc (n, 2) [m], with its generation.

    With `folded`, mirrors are at their true places, otherwise where they appear in the initial image.
    """
    folded = boolean("folded", folded)
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    lines = mirror_curves(held, "folded_" if folded else "")
    return list(zip(lines, held["generation"].values.astype(int).tolist(), strict=True))
