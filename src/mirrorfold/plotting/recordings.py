"""All frames of a recording in one picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mirrorfold.errors import InputError
from mirrorfold.folding.confident import confident_points
from mirrorfold.folding.frames import frame_count
from mirrorfold.plotting.axes import DRAW_BEFORE_AFTER, axes_or_new, draw_radar, in_metres, mirror_lines, radar_of
from mirrorfold.plotting.comparison import content_extent
from mirrorfold.plotting.figures import image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FRAME_COLOURS = "viridis"


def frames(reconstruction: xr.DataTree, ax: Axes | None = None, *, floor_db: float = -40.0) -> Axes:
    """Draw all frames of a recording: moving objects leave a trail from the first frame, dark, to the last, bright.

    Parameters
    ----------
    reconstruction : xarray.DataTree
        The reconstruction of a recording.
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    floor_db : float [dB], default -40
        Floor of the picture behind the points, which shows the strongest amplitude of all frames.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the reconstruction has no frames.
    """
    count = frame_count(reconstruction)
    if count is None:
        raise InputError(f"reconstruction: has no frames; {DRAW_BEFORE_AFTER}")
    ax = axes_or_new(ax)
    strongest = reconstruction.dataset["intensity"].max("frame").fillna(0.0)
    extent = content_extent(reconstruction, folded=True)
    image(strongest, ax, floor_db=floor_db, normalization="none", extent=extent, colorbar=False)
    objects = confident_points(reconstruction)
    scale = ScalarMappable(Normalize(0, max(count - 1, 1)), FRAME_COLOURS)
    number = objects["frame"].values
    ax.scatter(objects["x"], objects["y"], c=scale.to_rgba(number), s=5.0, linewidths=0, rasterized=True, zorder=3)
    owner = reconstruction.children["mirrors"].to_dataset(inherit=False)["frame"].values
    for (ends, _), frame in zip(mirror_lines(reconstruction, folded=True), owner, strict=True):
        ax.plot(*ends.T, color=scale.to_rgba(frame), linewidth=1.2, alpha=0.7)
    draw_radar(ax, radar_of(reconstruction))
    if isinstance(ax.figure, Figure):
        ticks = np.unique(np.linspace(0, count - 1, min(count, 6)).round())
        ax.figure.colorbar(scale, ax=ax, label="frame", ticks=ticks, shrink=0.7, pad=0.02)
    ax.set(xlim=extent[:2], ylim=extent[2:], title=f"corrected: {count} frames")
    return in_metres(ax)
