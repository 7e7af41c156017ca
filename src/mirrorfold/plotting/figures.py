"""Pictures of images, reconstructions and scenes.

Every function draws into the axes it is given, or into new ones, and returns them. Amplitudes are shown in dB below
a reference that a few glints cannot move, down to a stated floor; lengths are metres, x to the right and y, the
range, upwards. One colour stands for one number of bounces throughout: what is in line of sight, what was seen by way
of one mirror, of two, and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.patheffects as patheffects
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from mirrorfold.common.decibels import COLOURS, TRUTH_COLOUR, bounce_label, decibels
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mirrorfold.scenes.floor_plan import Scene

Extent = tuple[float, float, float, float]

COLOUR_MAP = "gray_r"
"""Perceptually uniform, and without any hue that could be taken for one of `COLOURS`."""

MARGIN = 0.06
"""Space around the content of a picture, as a share of its larger side."""

PANEL_HEIGHT, PANEL_WIDTH = 5.6, 12.0
"""Largest height of the panels of `before_after`, and width of both together [inch]."""

CURVE_STEP = 0.005
"""Length of the chords that curved surfaces are drawn with [m]."""


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
    """Draw a plan view in dB.

    Parameters
    ----------
    image : xarray.DataArray
        Real or complex amplitudes over (y, x) [m].
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    floor_db : float [dB], default -40
        Weaker pixels are drawn as if they had this level.
    normalization : {"r", "none"}, default "r"
        Multiply the amplitudes by the distance from the radar, which undoes the spreading of a line source on the
        two ways; or leave them.
    radar : (2,) [m], default the origin
        Where the distance counts from.
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
    if not isinstance(image, xr.DataArray) or image.dims != ("y", "x"):
        found = image.dims if isinstance(image, xr.DataArray) else type(image).__name__
        raise InputError(f"plot.image: got {found}, expected an image with dimensions (y, x)")
    if not floor_db < 0:
        raise InputError(f"floor_db is {floor_db!r}, expected a negative number of decibels, for example -40")
    if normalization not in ("r", "none"):
        raise InputError(f"normalization is {normalization!r}, expected 'r' or 'none'")
    ax = _axes(ax)
    if extent is not None:
        image = image.sel(x=slice(*extent[:2]), y=slice(*extent[2:]))
    amplitude = np.abs(image.values).astype(float)
    if normalization == "r":
        radar = np.asarray(radar, dtype=float)
        amplitude = amplitude * np.hypot(image["y"].values[:, None] - radar[1], image["x"].values - radar[0])
    mesh = ax.imshow(
        decibels(amplitude, floor_db),
        extent=_edges(image["x"].values) + _edges(image["y"].values),
        origin="lower",
        cmap=COLOUR_MAP,
        vmin=floor_db,
        vmax=0.0,
        interpolation="antialiased",
    )
    if colorbar and isinstance(ax.figure, Figure):
        label = "amplitude x range" if normalization == "r" else "amplitude"
        ax.figure.colorbar(mesh, ax=ax, label=f"{label} [dB], floor {floor_db:g} dB", shrink=0.7, pad=0.02)
    return _frame(ax)


def mirrors(reconstruction: xr.DataTree, ax: Axes | None = None, *, folded: bool = False) -> Axes:
    """Draw the mirrors, numbered, in the colour of the number of bounces they were seen by.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    folded : bool, default False
        Where the mirrors really stand; by default, where they appear in the initial image.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _axes(ax)
    for index, (ends, generation) in enumerate(_mirror_lines(reconstruction, folded=folded)):
        colour = _colour(generation - 1)
        ax.plot(*ends.T, color=colour, linewidth=2.5, solid_capstyle="round", path_effects=_halo(2.0))
        along = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
        ax.annotate(
            str(index),
            ends.mean(axis=0),
            xytext=(-12.0 * along[1], 12.0 * along[0]),
            textcoords="offset points",
            color=colour,
            fontweight="bold",
            ha="center",
            va="center",
            path_effects=_halo(2.5),
        )
    return _frame(ax)


def shadows(reconstruction: xr.DataTree, ax: Axes | None = None, *, reach: float | None = None) -> Axes:
    """Shade what lies behind each mirror of the initial image: what appears there was seen by reflection.

    In the initial image, which is not folded, the ways to everything are straight; the shadow of every mirror, also
    of one seen through others, is its shadow from the radar itself, or from the virtual radar of its own mirror world.

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
    ax = _axes(ax)
    radar = _radar(reconstruction)
    if reach is None:
        grid = reconstruction.children["initial"].dataset
        corners = np.array([(x, y) for x in grid["x"].values[[0, -1]] for y in grid["y"].values[[0, -1]]])
        reach = float(np.linalg.norm(corners - radar, axis=1).max())
    limits = ax.get_xlim(), ax.get_ylim()
    for ends, generation in _mirror_lines(reconstruction, folded=False):
        distance = np.linalg.norm(ends - radar, axis=1, keepdims=True)
        far = radar + (ends - radar) * (reach / np.maximum(distance, 1e-9))
        ax.fill(*np.concatenate([ends, far[::-1]]).T, color=_colour(generation - 1), alpha=0.13, linewidth=0)
    if ax.has_data() and ax.images:
        ax.set(xlim=limits[0], ylim=limits[1])
    return _frame(ax)


def scene(scene: Scene, ax: Axes | None = None, *, alpha: float = 1.0) -> Axes:
    """Draw the surfaces of a scene, thin, and the radar as a triangle.

    Parameters
    ----------
    scene : Scene
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    alpha : float, default 1
        Opacity.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _axes(ax)
    for surface in scene.surface:
        for piece in surface.pieces(CURVE_STEP):
            ax.plot(*piece.T, color=TRUTH_COLOUR, linewidth=0.9, alpha=alpha)
    radar = 0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))
    _draw_radar(ax, radar[:2])
    return _frame(ax)


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
    ax = image(
        reconstruction.dataset["intensity"],
        ax,
        floor_db=floor_db,
        normalization="none",
        extent=extent,
        colorbar=colorbar,
    )
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    bounces = objects["bounces"].values
    for count in np.unique(bounces):
        chosen = bounces == count
        ax.plot(
            objects["x"].values[chosen],
            objects["y"].values[chosen],
            linestyle="none",
            marker="o",
            markersize=2.6,
            markeredgewidth=0,
            color=_colour(int(count)),
            alpha=0.8,
            rasterized=True,
        )
    mirrors(reconstruction, ax, folded=True)
    _draw_radar(ax, _radar(reconstruction))
    return _frame(ax)


def before_after(
    reconstruction: xr.DataTree,
    scene: Scene | None = None,
    *,
    floor_db: float = -40.0,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """One figure: the initial image with mirrors and shadows, and beside it the corrected scene.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene, optional
        The truth, drawn thin in both.
    floor_db : float [dB], default -40
    axes : two of matplotlib.axes.Axes, optional
        To draw into, of one figure; without colour bar and legend then. New ones by default.

    Returns
    -------
    matplotlib.figure.Figure
        Not registered with pyplot; ``figure.savefig(path)`` writes it.
    """
    radar = _radar(reconstruction)
    before = content_extent(reconstruction, scene, folded=False)
    after = content_extent(reconstruction, scene, folded=True)
    bottom, top = min(before[2], after[2]), max(before[3], after[3])
    before, after = (*before[:2], bottom, top), (*after[:2], bottom, top)
    if axes is None:
        figure, (left, right, bar) = _panels(before[1] - before[0], after[1] - after[0], top - bottom)
    else:
        (left, right), bar = axes, None
        figure = left.figure.figure

    initial = reconstruction.children["initial"].dataset["initial"]
    image(initial, left, floor_db=floor_db, normalization="none", extent=before, colorbar=False)
    shadows(reconstruction, left)
    mirrors(reconstruction, left)
    _draw_radar(left, radar)
    left.set(xlim=before[:2], ylim=before[2:], title="initial image:\nmirrors and their shadows")

    corrected(reconstruction, right, floor_db=floor_db, extent=after, colorbar=False)
    right.set(xlim=after[:2], ylim=after[2:], title="corrected:\nevery echo folded back")

    if scene is not None:
        _draw_scene(scene, left, alpha=0.45)
        _draw_scene(scene, right, alpha=1.0)
    for panel in (left, right):
        panel.locator_params(axis="x", nbins=6)
    if bar is None:
        return figure
    right.set(ylabel="", yticklabels=[])
    figure.colorbar(right.images[0], cax=bar, label=f"amplitude [dB], floor {floor_db:g} dB")
    figure.legend(handles=_legend(reconstruction, scene), loc="lower center", ncols=6, frameon=False)
    return figure


def content_extent(reconstruction: xr.DataTree, scene: Scene | None = None, *, folded: bool) -> Extent:
    """The part of the floor plan that holds something, with a margin.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene, optional
        Its surfaces count too.
    folded : bool
        Of the corrected image; else of the initial one.

    Returns
    -------
    (x0, x1, y0, y1) [m]
        The whole grid where nothing was found.
    """
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    suffix = "" if folded else "_initial"
    points = [_radar(reconstruction)[None], np.column_stack([objects[f"x{suffix}"], objects[f"y{suffix}"]])]
    points += [ends for ends, _ in _mirror_lines(reconstruction, folded=folded)]
    if scene is not None:
        points += [piece for surface in scene.surface for piece in surface.pieces(CURVE_STEP)]
    found = np.concatenate(points)
    if len(found) == 1:
        grid = reconstruction.children["initial"].dataset
        found = np.column_stack([grid["x"].values[[0, -1]], grid["y"].values[[0, -1]]])
    low, high = found.min(axis=0), found.max(axis=0)
    margin = MARGIN * float((high - low).max())
    return (low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin)


def _panels(left_width: float, right_width: float, height: float) -> tuple[Figure, list[Axes]]:
    """A figure with two panels of these sizes [m] at one scale, and narrow axes for a colour bar."""
    scale = min(PANEL_HEIGHT / height, PANEL_WIDTH / (left_width + right_width))
    widths = [left_width * scale, right_width * scale, 0.18]
    size = np.array([0.8 + sum(widths) + 2 * 0.25 + 0.8, 1.0 + height * scale + 0.65])
    figure = Figure(figsize=(max(size[0], 7.0), size[1]), dpi=150)
    axes, corner = [], 0.8
    for width in widths:
        axes.append(figure.add_axes((corner / figure.get_figwidth(), 1.0 / size[1], width / figure.get_figwidth(),
                                     height * scale / size[1])))  # fmt: skip
        corner += width + 0.25
    return figure, axes


def _mirror_lines(reconstruction: xr.DataTree, *, folded: bool) -> list[tuple[Array, int]]:
    """The two ends (2, 2) [m] of each mirror, and its generation."""
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    prefix = "folded_" if folded else ""
    ends = np.stack([held[f"{prefix}{name}"].values for name in ("x0", "y0", "x1", "y1")], axis=-1)
    return list(zip(ends.reshape(-1, 2, 2), held["generation"].values.astype(int).tolist(), strict=True))


def _radar(reconstruction: xr.DataTree) -> Array:
    """Where the radar stands (2,) [m]."""
    return np.array([reconstruction.attrs.get("radar_x", 0.0), reconstruction.attrs.get("radar_y", 0.0)], dtype=float)


def _legend(reconstruction: xr.DataTree, scene: Scene | None) -> list[Line2D]:
    """One entry for each colour in the picture, and one for the truth."""
    bounces = {int(count) for count in np.unique(reconstruction.children["objects"].dataset["bounces"].values)}
    bounces |= {generation - 1 for _, generation in _mirror_lines(reconstruction, folded=False)}
    handles = [
        Line2D([], [], color=_colour(count), linewidth=2.5, marker="o", markersize=4, label=bounce_label(count))
        for count in sorted(bounces)
    ]
    if scene is not None:
        handles.append(Line2D([], [], color=TRUTH_COLOUR, linewidth=0.9, label="truth"))
    return handles


def _colour(bounces: int) -> str:
    return COLOURS[bounces % len(COLOURS)]


def _draw_radar(ax: Axes, radar: Array) -> None:
    ax.plot(*radar, marker="^", markersize=9, color="black", markeredgecolor="white", linestyle="none", zorder=5)


def _halo(width: float) -> list[Any]:
    """A white rim that keeps lines and letters legible on dark pixels."""
    return [patheffects.withStroke(linewidth=2 * width, foreground="white", alpha=0.8)]


def _axes(ax: Axes | None) -> Axes:
    return Figure(figsize=(7, 6), layout="constrained").subplots() if ax is None else ax


def _frame(ax: Axes) -> Axes:
    """Metres on both axes, and as long on the one as on the other."""
    ax.set_aspect("equal")
    ax.set(xlabel="cross-range x [m]", ylabel="range y [m]")
    return ax


def _edges(centres: Array) -> tuple[float, float]:
    """Outer edges of the first and the last pixel."""
    half = 0.5 * (centres[-1] - centres[0]) / max(centres.size - 1, 1)
    return float(centres[0] - half), float(centres[-1] + half)


_draw_scene = scene
"""`scene`, where a parameter has taken its name."""
