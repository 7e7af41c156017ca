"""Pictures of folded volumes: the largest hidden object from the front and in section, and the scene in perspective.

The plan view before and after folding is drawn by `mirrorfold.plotting.comparison.before_after`, as for a floor plan.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from mirrorfold.common.arcs import mirror_outlines
from mirrorfold.common.arguments import boolean
from mirrorfold.common.decibels import COLOURS, TRUTH_COLOUR, bounce_label
from mirrorfold.common.facts import recorded_radar
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.folding.confident import confident_points
from mirrorfold.plotting.axes import (
    DRAW_BEFORE_AFTER,
    axes_or_new,
    checked_floor,
    colour_of,
    draw_radar,
    draw_truth,
    expect_reconstruction,
    in_metres,
    outer_edges,
    scene_in_space,
)
from mirrorfold.plotting.outlines import cut, silhouette, wireframe

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

    from mirrorfold.scenes.solids import Scene3D


FLOOR_DB = -20.0
"""Floor of the pictures of bodies [dB]: speckle fades by 10 dB, and foil is stronger than cloth by as much."""

SMOOTHING = 0.013
"""Length over which the power of neighbouring points is averaged [m], about the radius of the beam."""

CELL = 0.008
"""Size of the pixels of the picture from the front [m]."""

SECTION_WIDTH, SECTION_DEPTH = 0.10, 0.35
"""Half the thickness of the slice that the picture from the side highlights, and smallest depth of this picture [m]."""

FEWEST = 30
"""Smallest number of hidden points for a picture of a body."""

LARGEST_CLUSTER_GAP = 0.12
"""Largest distance between neighbouring points of one object [m]."""


def _points(reconstruction: xr.DataTree) -> dict[str, Array]:
    """Columns of the table of points, by name. Where `surface` is missing, as in early files, all are of objects.

    Raises
    ------
    InputError
        If the reconstruction has two dimensions.
    """
    expect_reconstruction("volume", reconstruction)
    objects = confident_points(reconstruction)
    if "z" not in objects.variables:
        raise InputError(f"reconstruction: is a floor plan, it has no heights; {DRAW_BEFORE_AFTER}")
    columns = {str(name): objects[name].values for name in objects.variables}
    return {"surface": np.full(len(columns["z"]), "object")} | columns


def _largest_object(points: Array) -> NDArray[np.bool_]:
    """Which points (n, 3) [m] belong to the largest group, connected by gaps of at most `LARGEST_CLUSTER_GAP`."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(LARGEST_CLUSTER_GAP, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    group = connected_components(graph, directed=False)[1]
    return np.asarray(group == np.argmax(np.bincount(group)))


def _last_mirror(reconstruction: xr.DataTree, chain: str) -> Array:
    """Middle (3,) [m] of the last mirror of a chain, at its true place."""
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    index = int(np.flatnonzero(mirrors["chain"].values == chain)[0])
    return np.array([float(mirrors[f"folded_center_{axis}"][index]) for axis in "xyz"])


def has_body(reconstruction: xr.DataTree) -> bool:
    """Whether enough points of objects were seen by way of mirrors for `body`."""
    columns = _points(reconstruction)
    return int(((columns["bounces"] > 0) & (columns["surface"] == "object")).sum()) >= FEWEST


def body(
    reconstruction: xr.DataTree, scene: Scene3D | str | Path | None = None, *, floor_db: float = FLOOR_DB
) -> Figure:
    """Draw the largest hidden object at its true place, from the front and from the side.

    Parameters
    ----------
    reconstruction : xarray.DataTree
        The reconstruction of a volume.
    scene : Scene3D or path of a scene file, optional
        The truth, drawn as thin outlines.
    floor_db : float [dB]
        Level, relative to the brightest pixel, that is drawn as the darkest.

    Raises
    ------
    InputError
        If the reconstruction has two dimensions, or fewer than `FEWEST` points of objects were seen by way of mirrors.
    """
    columns = _points(reconstruction)
    scene = None if scene is None else scene_in_space(scene)
    floor_db = checked_floor(floor_db)
    hidden = (columns["bounces"] > 0) & (columns["surface"] == "object")
    if hidden.sum() < FEWEST:
        raise InputError(
            f"reconstruction: {int(hidden.sum())} points of objects were seen by way of mirrors, expected at least "
            f"{FEWEST} to draw a body"
        )
    points = np.stack([columns[axis][hidden] for axis in "xyz"], axis=-1)
    amplitude = columns["amplitude"][hidden].astype(float)
    mine = _largest_object(points)
    points, amplitude = points[mine], amplitude[mine]
    # across: the horizontal direction of largest extent; ahead: perpendicular to it, towards the last mirror.
    middle = points.mean(axis=0)
    flat = np.linalg.eigh(np.cov((points - middle)[:, :2].T))[1]
    ahead = np.array([*flat[:, 0], 0.0])
    if (_last_mirror(reconstruction, columns["chain"][hidden][mine][0]) - middle) @ ahead < 0.0:
        ahead = -ahead
    # As an observer in front of the object sees it: its own right is on the left.
    across = np.cross([0.0, 0.0, 1.0], ahead)
    u, v = (points - middle) @ across, (points - middle) @ ahead
    x = np.arange(u.min() - 0.08, u.max() + 0.08, CELL)
    z = np.arange(points[:, 2].min() - 0.08, points[:, 2].max() + 0.08, CELL)
    # Both panels at one scale, side by side.
    wide, deep, high = np.ptp(x), max(float(np.ptp(v)), SECTION_DEPTH) + 0.16, np.ptp(z)
    inch = min(5.4 / high, 4.5 / wide)
    figure = Figure(figsize=(inch * (wide + deep) + 3.4, inch * high + 1.3), layout="constrained")
    front, side = figure.subplots(1, 2, width_ratios=(wide, deep))
    picture = draw_front(front, u, points[:, 2], amplitude, x, z, floor_db=floor_db)
    front.set(title="seen from the front", xlabel="across [m]", ylabel="height z [m]", aspect="equal", facecolor="0.92")
    figure.colorbar(picture, ax=front, label=f"amplitude [dB], floor {floor_db:g} dB", shrink=0.8)
    cut_here = np.abs(u) < SECTION_WIDTH
    side.scatter(v[~cut_here], points[~cut_here, 2], s=3, color="0.8", label="all of it", linewidths=0)
    label = f"within {100 * SECTION_WIDTH:.0f} cm of the middle"
    side.scatter(v[cut_here], points[cut_here, 2], s=7, color=COLOURS[1], label=label, linewidths=0)
    middle_v = 0.5 * (v.min() + v.max())
    side.set(title="cut from the side", xlabel="ahead [m]", ylabel="height z [m]", aspect="equal",
             xlim=(middle_v - 0.5 * deep, middle_v + 0.5 * deep), ylim=front.get_ylim())  # fmt: skip
    if scene is not None:
        draw_silhouette(front, scene, points, middle, across, x, z)
        draw_cut(side, scene, middle, ahead)
    figure.legend(*side.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8, markerscale=2.0,
                  frameon=False)  # fmt: skip
    return figure


def draw_front(
    ax: Axes,
    u: Array,
    z: Array,
    amplitude: Array,
    columns: Array,
    rows: Array,
    *,
    floor_db: float,
    reference: float | None = None,
) -> AxesImage:
    """Draw points as an image of the mean power of the points around each pixel, which averages speckle.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    u, z, amplitude : (n,) arrays
        Places in the picture [m], and amplitudes.
    columns, rows : 1D arrays [m]
        Centres of the pixels.
    floor_db : float [dB]
    reference : float, optional
        Amplitude shown as 0 dB; by default that of the brightest pixel.
    """
    power = smoothed_power(u, z, amplitude, columns, rows)
    level = 10.0 * np.log10(power / (np.nanmax(power) if reference is None else reference**2))
    extent = (*outer_edges(columns), *outer_edges(rows))
    return ax.imshow(level, origin="lower", extent=extent, vmin=floor_db, vmax=0.0, cmap="inferno")


def smoothed_power(u: Array, z: Array, amplitude: Array, columns: Array, rows: Array) -> Array:
    """Mean power of the points around each pixel (rows, columns), weighted with a Gaussian; NaN where there are none.

    Points (n,) have places [m] and amplitudes; the pixels' centres are given [m].
    """
    from scipy.spatial import cKDTree

    grid = np.stack(np.broadcast_arrays(columns[None, :], rows[:, None]), axis=-1).reshape(-1, 2)
    tree = cKDTree(np.stack([u, z], axis=1))
    distance, index = tree.query(grid, k=min(12, len(u)), distance_upper_bound=2.5 * SMOOTHING)
    weight = np.where(np.isfinite(distance), np.exp(-0.5 * (distance / SMOOTHING) ** 2), 0.0)
    squares = np.append(amplitude**2, 0.0)[index]
    with np.errstate(invalid="ignore", divide="ignore"):
        power = np.sum(weight * squares, axis=1) / np.sum(weight, axis=1)
    power[distance[:, 0] > 1.4 * SMOOTHING] = np.nan
    return np.asarray(power.reshape(rows.size, columns.size))


def draw_silhouette(ax: Axes, scene: Scene3D, points: Array, middle: Array, across: Array, u: Array, z: Array) -> None:
    """Draw the silhouette of the round solid to which most of the points (n, 3) [m] are nearest, as a thin line.

    The pixels u and z [m] are those of the picture; u counts from `middle` (3,) [m] along `across`. Flat walls are left
    out.
    """
    from scipy.spatial import cKDTree

    from mirrorfold.simulation.raster.meshes import solids

    round_ones = [solid for solid in solids(scene) if not solid.quads]
    if not round_ones:
        return
    distance = [cKDTree(solid.vertices).query(points)[0] for solid in round_ones]
    solid = round_ones[int(np.argmax(np.bincount(np.argmin(distance, axis=0), minlength=len(round_ones))))]
    up = np.array([0.0, 0.0, 1.0])
    mask = silhouette(solid.vertices - [*middle[:2], 0.0], solid.faces, across, up, u, z)
    ax.contour(u, z, mask, levels=[0.5], colors=TRUTH_COLOUR, linewidths=0.8)


def draw_cut(ax: Axes, scene: Scene3D, middle: Array, along: Array) -> None:
    """Draw the section of a scene by an upright plane through `middle` (3,) [m]: distance `along` it, and height."""
    normal = np.cross(along, [0.0, 0.0, 1.0])
    limits = ax.get_xlim(), ax.get_ylim()
    for piece, lines in enumerate(cut(scene, middle, normal).values()):
        flat = np.stack([(lines - middle) @ along, lines[..., 2]], axis=-1)
        ax.add_collection(LineCollection(list(flat), colors=TRUTH_COLOUR, linewidths=0.8,
                                         label="truth" if piece == 0 else None))  # fmt: skip
    ax.set(xlim=limits[0], ylim=limits[1])


def space(reconstruction: xr.DataTree, scene: Scene3D | str | Path | None = None, *, folded: bool = True) -> Figure:
    """Draw the whole scene in perspective: points by their number of bounces, mirrors by their outlines.

    Parameters
    ----------
    reconstruction : xarray.DataTree
        The reconstruction of a volume.
    scene : Scene3D or path of a scene file, optional
        The truth, drawn as thin outlines.
    folded : bool
        Whether points and mirrors are at their true places, or where they appeared before folding.
    """
    columns = _points(reconstruction)
    scene = None if scene is None else scene_in_space(scene)
    folded = boolean("folded", folded)
    suffix, prefix = ("", "folded_") if folded else ("_initial", "")
    points = np.stack([columns[axis + suffix] for axis in "xyz"], axis=-1)
    figure = Figure(figsize=(9.0, 7.5), layout="constrained")
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    for i, outlines in enumerate(mirror_outlines(mirrors, prefix)):
        for line in outlines:
            axes.plot(*line.T, color=colour_of(int(mirrors["generation"][i]) - 1), linewidth=1.4)
    if scene is not None:
        for line in wireframe(scene):
            axes.plot(*line.T, color=TRUTH_COLOUR, linewidth=0.7)
    on_mirror = columns["surface"] == "mirror"
    for bounces in np.unique(columns["bounces"]):
        colour = colour_of(int(bounces))
        for wall in (True, False):
            which = (columns["bounces"] == bounces) & (on_mirror == wall)
            if not which.any():
                continue
            chosen = points[which]
            if wall:
                chosen = chosen[:: max(1, len(chosen) // 1500)]
            axes.scatter(*chosen.T, s=1.2 if wall else 4.0, color=colour, alpha=0.25 if wall else 0.8, linewidths=0,
                         depthshade=not wall)  # fmt: skip
    origin = recorded_radar(reconstruction.attrs)
    axes.scatter(*origin, marker="^", color="black", s=50)
    axes.set(xlabel="cross-range x [m]", ylabel="range y [m]", zlabel="height z [m]")
    everything = np.vstack([points, [origin]])
    axes.set_box_aspect(np.maximum(np.ptp(everything, axis=0), 0.3), zoom=1.05)
    axes.view_init(elev=24.0, azim=-62.0)
    axes.set_title("corrected: every echo folded back" if folded else "as the radar sees it, ghosts behind the walls")
    figure.legend(handles=_space_legend(columns["bounces"], scene), loc="outside lower center", ncols=5, fontsize=9,
                  frameon=False)  # fmt: skip
    return figure


def _space_legend(bounces: Array, scene: Scene3D | None) -> list[Line2D]:
    """Entries of the legend for each colour, for the truth and for the radar, larger than the marks in the picture."""
    handles = [
        Line2D([], [], color=colour_of(int(count)), linewidth=1.4, marker="o", markersize=4,
               label=f"{bounce_label(int(count))}: mirrors and points")
        for count in np.unique(bounces)
    ]  # fmt: skip
    if scene is not None:
        handles.append(Line2D([], [], color=TRUTH_COLOUR, linewidth=0.7, label="truth"))
    return [*handles, Line2D([], [], color="black", marker="^", markersize=7, linestyle="none", label="radar")]


def scene(scene: Scene3D | str | Path, ax: Axes | None = None) -> Axes:
    """Draw the floor plan of a scene: the outlines of its solids from above as thin lines, the radar as a triangle.

    Parameters
    ----------
    scene : Scene3D or path of a scene file
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    """
    from scipy.spatial import ConvexHull, QhullError

    from mirrorfold.simulation.raster.meshes import solids

    scene = scene_in_space(scene)
    ax = axes_or_new(ax)
    for solid in solids(scene):
        flat = solid.vertices[:, :2]
        try:
            outline = flat[ConvexHull(flat).vertices]
        except QhullError:  # an upright panel has no area from above
            order = np.argsort(flat @ np.linalg.svd(flat - flat.mean(axis=0))[2][0])
            outline = flat[order[[0, -1]]]
        draw_truth(ax, np.vstack([outline, outline[:1]]))
    draw_radar(ax, np.asarray(scene.scanner.origin[:2]))
    return in_metres(ax)
