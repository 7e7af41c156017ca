"""Picture of a comparison: two results side by side, and the difference between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from mirrorfold.common.decibels import decibels
from mirrorfold.describing.comparison import Changes, checked_pair, find_changes, two_names
from mirrorfold.folding.confident import confident_points
from mirrorfold.plotting.axes import Extent, checked_floor, draw_radar, in_metres, mirror_lines, outer_edges, radar_of
from mirrorfold.plotting.comparison import content_extent
from mirrorfold.plotting.figures import COLOUR_MAP, mirrors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIFFERENCE_DB = 12.0
"""Both ends of the scale of differences [dB]: a factor of four in amplitude."""

DIFFERENCE_MAP = "RdBu_r"
GAINED, LOST, KEPT = "#D55E00", "#0072B2", "#7F7F7F"
"""Colours of points of the second alone, of the first alone, and of both; they differ for the colour-blind too."""

NOTHING = "#E4E4E4"
"""Colour of pixels at which both results are below the floor."""

PANEL = 4.6
"""Largest width and height of a panel [inch]."""


def compare(
    first: Any, second: Any, *, names: tuple[str, str] = ("first", "second"), floor_db: float = -40.0
) -> Figure:
    """Draw one figure: two results, the difference of their levels and, for reconstructions, points gained and lost.

    Parameters
    ----------
    first, second : xarray.DataTree or xarray.DataArray
        Two reconstructions or two images.
    names : two of str
        Titles of the panels.
    floor_db : float [dB], default -40
        Weaker pixels are drawn as if they had this level.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        As `mirrorfold.compare`.
    """
    first, second = checked_pair(first, second)
    names, floor_db = two_names(names), checked_floor(floor_db)
    changes = find_changes(first, second)
    extent = _extent(first, second, changes)
    width, height = extent[1] - extent[0], extent[3] - extent[2]
    scale = PANEL / max(width, height)
    count = 4 if isinstance(first, xr.DataTree) else 3
    columns = 2 if count == 4 and width > height else count
    rows = count // columns
    size = columns * (max(width * scale, 2.2) + 1.0), rows * (max(height * scale, 1.6) + 0.9)
    figure = Figure(figsize=size, layout="constrained", dpi=150)
    axes: list[Axes] = list(np.ravel(figure.subplots(rows, columns)))
    edges = outer_edges(changes.first["x"].values) + outer_edges(changes.first["y"].values)
    levels = _levels(changes, floor_db)
    for ax, name, level, one in zip(axes, names, levels, (first, second), strict=False):
        shown = ax.imshow(level, extent=edges, origin="lower", cmap=COLOUR_MAP, vmin=floor_db, vmax=0.0)
        shown_as = f"{name}, {one['polarization'].values}" if "polarization" in one.coords else name
        ax.set_title(shown_as, fontsize="medium")
        if isinstance(one, xr.DataTree):
            mirrors(one, ax, folded=True)
    figure.colorbar(shown, ax=axes[:2], label=f"amplitude [dB], floor {floor_db:g} dB", shrink=0.8)
    colours: Any = {"cmap": DIFFERENCE_MAP, "vmin": -DIFFERENCE_DB, "vmax": DIFFERENCE_DB}
    drawn = axes[2].imshow(changes.difference, extent=edges, origin="lower", **colours)
    figure.colorbar(drawn, ax=axes[2], label="second over first [dB]", shrink=0.8, extend="both")
    axes[2].set_title("difference", fontsize="medium")
    axes[2].set_facecolor(NOTHING)  # because a difference of zero is white
    if isinstance(first, xr.DataTree):
        _points(axes[3], first, second, changes)
    for ax in axes:
        in_metres(ax)
        ax.set(xlim=extent[:2], ylim=extent[2:])
        if isinstance(first, xr.DataTree):
            draw_radar(ax, radar_of(first))
    return figure


def _levels(changes: Changes, floor_db: float) -> tuple[Any, Any]:
    """Levels of both pictures [dB], relative to the same reference."""
    both = decibels(np.stack([changes.first.values, changes.second.values]), floor_db)
    return both[0], both[1]


def _points(ax: Axes, first: xr.DataTree, second: xr.DataTree, changes: Changes) -> None:
    """Draw points and mirrors of both results; points that only one result has are coloured."""
    a, b = map(confident_points, (first, second))
    for held, chosen, colour, label in (
        (b, ~changes.gained, KEPT, "kept"),
        (a, changes.lost, LOST, "lost"),
        (b, changes.gained, GAINED, "gained"),
    ):
        x, y = held["x"].values[chosen], held["y"].values[chosen]
        ax.plot(x, y, ".", markersize=3.5, color=colour, label=f"{int(chosen.sum())} {label}", rasterized=True)
    for one, colour, style in ((first, LOST, "-"), (second, GAINED, "--")):
        for ends, _ in mirror_lines(one, folded=True):
            ax.plot(*ends.T, color=colour, linestyle=style, linewidth=1.2)
    ax.set_title("points, and mirrors of both", fontsize="medium")
    ax.legend(fontsize="small", markerscale=2.5)


def _extent(first: Any, second: Any, changes: Changes) -> Extent:
    """The extent to show: everything that either result contains."""
    if not isinstance(first, xr.DataTree):
        return outer_edges(changes.first["x"].values) + outer_edges(changes.first["y"].values)
    a, b = (content_extent(one, folded=True) for one in (first, second))
    return min(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), max(a[3], b[3])
