"""What the pictures share: axes in metres, colours by the number of bounces, and what is read from a reconstruction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.patheffects as patheffects
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mirrorfold.common.arcs import mirror_curves
from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.decibels import COLOURS, TRUTH_COLOUR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Extent = tuple[float, float, float, float]

CURVE_STEP = 0.005
"""Length of the chords that curved surfaces are drawn with [m]."""


def axes_or_new(ax: Axes | None, size: tuple[float, float] = (7.0, 6.0)) -> Axes:
    """The axes given, or those of a new figure of this width and height [inch]."""
    return Figure(figsize=size, layout="constrained", dpi=150).subplots() if ax is None else ax


def in_metres(ax: Axes) -> Axes:
    """Metres on both axes, and as long on the one as on the other."""
    ax.set_aspect("equal")
    ax.set(xlabel="cross-range x [m]", ylabel="range y [m]")
    return ax


def outer_edges(centres: Array) -> tuple[float, float]:
    """Outer edges of the first and the last pixel."""
    half = 0.5 * (centres[-1] - centres[0]) / max(centres.size - 1, 1)
    return float(centres[0] - half), float(centres[-1] + half)


def colour_of(bounces: int) -> str:
    """The colour of what was seen by way of so many mirrors."""
    return COLOURS[bounces % len(COLOURS)]


def halo(width: float) -> list[Any]:
    """A white rim that keeps lines and letters legible on dark pixels."""
    return [patheffects.withStroke(linewidth=2 * width, foreground="white", alpha=0.8)]


def draw_radar(ax: Axes, radar: Array) -> None:
    """A triangle where the radar stands (2,) [m], unless it is farther away than all that is shown is large."""
    if ax.images and np.any(np.abs(radar - ax.dataLim.get_points().mean(axis=0)) > 1.5 * np.array(ax.dataLim.size)):
        return
    ax.plot(*radar, marker="^", markersize=9, color="black", markeredgecolor="white", linestyle="none", zorder=5)


def expect_reconstruction(name: str, value: object) -> None:
    """Refuse what is no reconstruction.

    Raises
    ------
    InputError
        `name` is that of the plot.
    """
    if not isinstance(value, xr.DataTree):
        raise wrong_kind(f"plot.{name}", value, "a reconstruction (xarray.DataTree), as fold and reconstruct return")


def draw_truth(ax: Axes, line: Array, alpha: float = 1.0) -> None:
    """A true surface (n, 2) [m], thin, with a rim that keeps it legible on mirrors and points."""
    ax.plot(*line.T, color=TRUTH_COLOUR, linewidth=1.0, alpha=alpha, path_effects=halo(1.1), zorder=4)


def radar_of(reconstruction: xr.DataTree) -> Array:
    """Where the radar stands (2,) [m]."""
    return np.array([reconstruction.attrs.get("radar_x", 0.0), reconstruction.attrs.get("radar_y", 0.0)], dtype=float)


def mirror_lines(reconstruction: xr.DataTree, *, folded: bool) -> list[tuple[Array, int]]:
    """Each mirror as a line: its two ends (2, 2) [m], or points along an arc (n, 2); and its generation."""
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    lines = mirror_curves(held, "folded_" if folded else "")
    return list(zip(lines, held["generation"].values.astype(int).tolist(), strict=True))
