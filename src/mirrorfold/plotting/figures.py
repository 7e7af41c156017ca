"""Pictures of images, reconstructions and scenes.

Every function draws into the given axes, or into new ones, and returns them. Amplitudes are shown in dB relative to a
robust reference, which a few very strong pixels do not change, down to a stated floor. Lengths are in metres, x to the
right and y, the range, upwards. Each number of bounces has its colour in all pictures: line of sight, one mirror, two
mirrors, and so on.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from mirrorfold.common.arguments import boolean, in_message, number, one_of, wrong_kind
from mirrorfold.common.decibels import COLOURS, PASSED_COLOUR, TRUTH_COLOUR, decibels
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.folding.confident import confident_points, passed_walls
from mirrorfold.folding.frames import pick_frame
from mirrorfold.io.plans import as_plan
from mirrorfold.plotting.axes import (
    CURVE_STEP,
    Extent,
    axes_or_new,
    checked_extent,
    checked_floor,
    colour_of,
    draw_radar,
    draw_truth,
    expect_reconstruction,
    halo,
    in_metres,
    known_scene,
    mirror_lines,
    outer_edges,
    radar_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.scenes.floor_plan import Scene

COLOUR_MAP = "gray_r"
"""Colour map of images: grey, so that no pixel can be taken for one of the `COLOURS`."""


def image(
    image: xr.DataArray,
    ax: Axes | None = None,
    *,
    floor_db: float = -40.0,
    normalization: str = "r",
    radar: ArrayLike = (0.0, 0.0),
    extent: Extent | None = None,
    colorbar: bool = True,
) -> Axes:
    """Draw a plan view in dB; an image of a single row or column is drawn as a curve of its level.

    Parameters
    ----------
    image : xarray.DataArray
        Real or complex amplitudes over (y, x) [m].
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    floor_db : float [dB], default -40
        Weaker pixels are drawn as if they had this level.
    normalization : {"r", "none"}, default "r"
        Multiply the amplitudes by the distance from the radar, which undoes the spreading of waves of a line source on
        the way out and back; or leave them as they are.
    radar : (2,) [m], default the origin
        Position of the radar, from which the distance counts.
    extent : (x0, x1, y0, y1) [m], optional
        What to show; everything by default.
    colorbar : bool, default True

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the image is no plan view, or an argument is wrong.
    """
    if isinstance(image, xr.DataArray) and "frame" in image.dims:
        image = pick_frame(image)
    if not isinstance(image, xr.DataArray) or image.dims != ("y", "x"):
        raise wrong_kind("plot.image", image, "an image (xarray.DataArray) with the dimensions (y, x)")
    floor_db = checked_floor(floor_db)
    one_of("normalization", normalization, ("r", "none"))
    radar, colorbar = place(radar, "radar"), boolean("colorbar", colorbar)
    extent = checked_extent(extent)
    if extent is not None:
        image = image.sel(x=slice(*extent[:2]), y=slice(*extent[2:]))
        if image.size == 0:
            raise InputError(
                f"extent is {in_message(extent)}, and the image has no pixel there; leave it out to see where"
            )
    ax = axes_or_new(ax)
    amplitude = np.abs(image.values).astype(float)
    if normalization == "r":
        radar = np.asarray(radar, dtype=float)
        amplitude = amplitude * np.hypot(image["y"].values[:, None] - radar[1], image["x"].values - radar[0])
    if 1 in image.shape:
        return _profile(image, decibels(amplitude, floor_db).ravel(), ax, floor_db)
    mesh = ax.imshow(
        decibels(amplitude, floor_db),
        extent=outer_edges(image["x"].values) + outer_edges(image["y"].values),
        origin="lower",
        cmap=COLOUR_MAP,
        vmin=floor_db,
        vmax=0.0,
        interpolation="antialiased",
    )
    if colorbar and isinstance(ax.figure, Figure):
        label = "amplitude x range" if normalization == "r" else "amplitude"
        ax.figure.colorbar(mesh, ax=ax, label=f"{label} [dB], floor {floor_db:g} dB", shrink=0.7, pad=0.02)
    return in_metres(ax)


def _profile(image: xr.DataArray, level: Array, ax: Axes, floor_db: float) -> Axes:
    """Draw the level [dB] along an image that is one pixel wide, such as that of a single antenna over range."""
    along, text = ("y", "range y [m]") if image.sizes["y"] > 1 else ("x", "cross-range x [m]")
    ax.plot(image[along].values, level, color=COLOURS[5], linewidth=1.2)
    ax.set(xlabel=text, ylabel=f"amplitude [dB], floor {floor_db:g} dB", ylim=(floor_db, 3.0))
    ax.grid(alpha=0.3, linewidth=0.5)
    return ax


def mirrors(reconstruction: xr.DataTree, ax: Axes | None = None, *, folded: bool = False) -> Axes:
    """Draw the mirrors with their numbers, in the colour of the number of bounces by which they were seen.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    folded : bool, default False
        Draw them where they really stand; by default, where they appear in the initial image.

    Returns
    -------
    matplotlib.axes.Axes
    """
    expect_reconstruction("mirrors", reconstruction)
    ax = axes_or_new(ax)
    for index, (ends, generation) in enumerate(mirror_lines(reconstruction, folded=folded)):
        colour = colour_of(generation - 1)
        ax.plot(*ends.T, color=colour, linewidth=3.4, solid_capstyle="round", path_effects=halo(2.4))
        along = (ends[-1] - ends[0]) / max(float(np.linalg.norm(ends[-1] - ends[0])), 1e-9)
        ax.annotate(
            str(index),
            ends.mean(axis=0),
            xytext=(-12.0 * along[1], 12.0 * along[0]),
            textcoords="offset points",
            color=colour,
            fontweight="bold",
            ha="center",
            va="center",
            path_effects=halo(2.5),
        )
    return in_metres(ax)


def shadows(reconstruction: xr.DataTree, ax: Axes | None = None, *, reach: float | None = None) -> Axes:
    """Shade the area behind each mirror of the initial image: what appears there was seen by reflection.

    In the initial image, which is not folded, every line of sight is straight. So the shadow of every mirror, even if
    it was seen through others, is its shadow as seen from the radar.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    reach : float [m], optional
        How far from the radar the shadows are drawn; by default to the end of the initial image.

    Returns
    -------
    matplotlib.axes.Axes
    """
    expect_reconstruction("shadows", reconstruction)
    ax = axes_or_new(ax)
    radar = radar_of(reconstruction)
    if reach is None:
        grid = reconstruction.children["initial"].dataset
        corners = np.array([(x, y) for x in grid["x"].values[[0, -1]] for y in grid["y"].values[[0, -1]]])
        reach = float(np.linalg.norm(corners - radar, axis=1).max())
    limits = ax.get_xlim(), ax.get_ylim()
    for ends, generation in mirror_lines(reconstruction, folded=False):
        distance = np.linalg.norm(ends - radar, axis=1, keepdims=True)
        far = radar + (ends - radar) * (reach / np.maximum(distance, 1e-9))
        ax.fill(*np.concatenate([ends, far[::-1]]).T, color=colour_of(generation - 1), alpha=0.13, linewidth=0)
    if ax.has_data() and ax.images:
        ax.set(xlim=limits[0], ylim=limits[1])
    return in_metres(ax)


def scene(scene: Scene | str | Path, ax: Axes | None = None, *, alpha: float = 1.0) -> Axes:
    """Draw the surfaces of a scene as thin lines, and the radar as a triangle.

    Parameters
    ----------
    scene : Scene or path of a scene file
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    alpha : float, default 1
        Opacity.

    Returns
    -------
    matplotlib.axes.Axes
    """
    found = known_scene(scene)
    if found is None or found.dimensions != 2:
        raise wrong_kind(
            "plot.scene", scene, "a scene of two dimensions, as mf.load_scene and mf.parse_scene return", reader=""
        )
    alpha = number("alpha", alpha, lowest=0.0, highest=1.0)
    ax = axes_or_new(ax)
    for surface in found.surface:
        for piece in surface.pieces(CURVE_STEP):
            draw_truth(ax, piece, alpha)
    draw_radar(ax, found.array.middle[:2])
    return in_metres(ax)


def plan(plan: FloorPlan | str | Path, ax: Axes | None = None, *, alpha: float = 1.0) -> Axes:
    """Draw the lines of a known floor plan as thin lines.

    Parameters
    ----------
    plan : FloorPlan or path of a DXF or GeoJSON file
        As `mirrorfold.load` reads one from a DXF or GeoJSON file.
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    alpha : float, default 1
        Opacity.

    Returns
    -------
    matplotlib.axes.Axes
    """
    lines, alpha = as_plan(plan).lines, number("alpha", alpha, lowest=0.0, highest=1.0)
    ax = axes_or_new(ax)
    for line in lines:
        ax.plot(*line.T, color=TRUTH_COLOUR, linewidth=0.9, alpha=alpha)
    return in_metres(ax)


def corrected(
    reconstruction: xr.DataTree,
    ax: Axes | None = None,
    *,
    floor_db: float = -40.0,
    extent: Extent | None = None,
    colorbar: bool = True,
) -> Axes:
    """Draw the folded image with its objects, coloured by bounces, and the mirrors at their true places.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    floor_db : float [dB], default -40
    extent : (x0, x1, y0, y1) [m], optional
        What to show; everything by default.
    colorbar : bool, default True

    Returns
    -------
    matplotlib.axes.Axes
    """
    expect_reconstruction("corrected", reconstruction)
    reconstruction = pick_frame(reconstruction)
    ax = image(
        reconstruction.dataset["intensity"],
        ax,
        floor_db=floor_db,
        normalization="none",
        extent=extent,
        colorbar=colorbar,
    )
    _points(reconstruction, ax, "")
    mirrors(reconstruction, ax, folded=True)
    draw_radar(ax, radar_of(reconstruction))
    return in_metres(ax)


def ghosts(reconstruction: xr.DataTree, ax: Axes) -> Axes:
    """Draw the points where they were before folding, as walls outshine them in the plan view of a volume."""
    _points(reconstruction, ax, "_initial")
    return in_metres(ax)


MANY_POINTS = 3000
"""Number of points above which their marks are small and pale, so that dense groups of points show as shapes."""


def _points(reconstruction: xr.DataTree, ax: Axes, suffix: str) -> None:
    """Draw the points in the colour of their number of bounces; the suffix is "" for folded places, or "_initial"."""
    objects = confident_points(reconstruction)
    bounces = objects["bounces"].values
    passed = passed_walls(objects)
    size, alpha = (1.3, 0.35) if bounces.size > MANY_POINTS else (2.6, 0.8)
    kinds = [((bounces == count) & ~passed, "o", colour_of(int(count))) for count in np.unique(bounces)]
    for chosen, marker, colour in [*kinds, (passed, "D", PASSED_COLOUR)]:
        ax.plot(
            objects[f"x{suffix}"].values[chosen],
            objects[f"y{suffix}"].values[chosen],
            linestyle="none",
            marker=marker,
            markersize=size,
            markeredgewidth=0,
            color=colour,
            alpha=alpha,
            rasterized=True,
        )
