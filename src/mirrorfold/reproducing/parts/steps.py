"""The algorithm step by step, drawn from a reconstruction: image, mirrors and objects, and each generation folded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

import mirrorfold as mf
from mirrorfold.common.chains import mirror_chains
from mirrorfold.common.decibels import TRUTH_COLOUR, bounce_label
from mirrorfold.common.geometry import Isometry, segment_normal
from mirrorfold.common.types import Array
from mirrorfold.folding.confident import confident_points
from mirrorfold.plotting.axes import Extent, colour_of, draw_radar, halo, mirror_lines, radar_of
from mirrorfold.plotting.comparison import content_extent
from mirrorfold.scoring.cells import point_cells

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mirrorfold.scenes.floor_plan import Scene

PANEL, COLUMNS = 3.5, 3
"""Width of a panel [inch], and how many stand side by side."""

FLOOR_DB = -40.0
"""Floor of the images [dB]."""


def generations(reconstruction: xr.DataTree) -> int:
    """The deepest generation of the mirrors that were found."""
    table = reconstruction.children["mirrors"].to_dataset(inherit=False)["generation"].values
    return int(table.max(initial=0))


def partial_folds(reconstruction: xr.DataTree, generation: int) -> dict[str, Isometry]:
    """The maps, by chain, of the initial image after the folding of all generations from the deepest to this one.

    The mirrors are at their places in the initial image. Echoes that were seen by way of a chain are reflected at the
    last mirror of the chain first, then at the mirror before it, and so on to the mirror of this generation. Echoes of
    shorter chains stay where they are.
    """
    table = reconstruction.children["mirrors"].to_dataset(inherit=False)
    found = {"": Isometry.identity()}
    lines = {chain: ends for chain, (ends, _) in zip(mirror_chains(table), mirror_lines(reconstruction, folded=False),
                                                     strict=True)}  # fmt: skip
    for chain in sorted(lines, key=lambda name: name.count("/")):
        parent, ends = chain.rpartition("/")[0], lines[chain]
        own = Isometry.reflection(ends[0], segment_normal(*ends))
        found[chain] = found[parent] @ own if chain.count("/") + 1 >= generation else Isometry.identity()
    return found


def folded_down_to(reconstruction: xr.DataTree, generation: int, extent: Extent) -> xr.DataArray:
    """The initial image (y, x) after the folding of all generations from the deepest to this one.

    Only the echoes that became points of the reconstruction are drawn: the image within a resolution cell of each.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    generation : int
        1 for the corrected image; one more than the deepest for the initial one.
    extent : (x0, x1, y0, y1) [m]
    """
    initial = reconstruction.children["initial"].dataset["initial"]
    points = confident_points(reconstruction)
    place = np.column_stack([points["x_initial"], points["y_initial"]])
    cell = point_cells(points, reconstruction.attrs)
    assert cell is not None  # the image was focused from a sweep
    cut = initial.sel(x=slice(*extent[:2]), y=slice(*extent[2:]))
    pixels = np.stack(np.meshgrid(cut["x"].values, cut["y"].values), axis=-1).reshape(-1, 2)
    drawn = np.zeros(len(pixels))
    corner = np.array([initial["x"].values[0], initial["y"].values[0]])
    step = np.array([np.diff(initial[axis].values[:2])[0] for axis in "xy"])
    for chain, fold in partial_folds(reconstruction, generation).items():
        which = points["chain"].values == chain
        if not which.any():
            continue
        source = fold.inverse(pixels)
        distance, nearest = cKDTree(place[which]).query(source, distance_upper_bound=float(cell[which].max()))
        near = np.flatnonzero(np.isfinite(distance))
        near = near[distance[near] <= cell[which][nearest[near]]]
        at = ((source[near] - corner) / step)[:, ::-1].T
        drawn[near] = np.maximum(drawn[near], map_coordinates(initial.values, at, order=1))
    return cut.copy(data=drawn.reshape(cut.shape).astype(np.float32))


def steps(reconstruction: xr.DataTree, scene: Scene) -> tuple[Figure, dict[str, xr.DataArray]]:
    """A figure with a panel for each step, and the images in the panels by the name of the step."""
    before, after = (content_extent(reconstruction, scene, folded=folded) for folded in (False, True))
    extent = (min(before[0], after[0]), max(before[1], after[1]), min(before[2], after[2]), max(before[3], after[3]))
    deepest = generations(reconstruction)
    images = {"initial": reconstruction.children["initial"].dataset["initial"]}
    images["initial"] = images["initial"].sel(x=slice(*extent[:2]), y=slice(*extent[2:]))
    images |= {
        f"folded_{generation}": folded_down_to(reconstruction, generation, extent)
        for generation in range(deepest, 0, -1)
    }
    count = len(images) + 1
    rows = -(-count // COLUMNS)
    height = PANEL * (extent[3] - extent[2]) / (extent[1] - extent[0])
    figure = Figure(figsize=(COLUMNS * (PANEL + 0.4) + 1.2, rows * (height + 0.75) + 0.45), dpi=150,
                    layout="constrained")  # fmt: skip
    panels = list(figure.subplots(rows, COLUMNS, squeeze=False).ravel())
    for panel in panels[count:]:
        panel.set_axis_off()
    _image(panels[0], images["initial"], "the initial image", 0)
    draw_radar(panels[0], radar_of(reconstruction))
    _image(panels[1], images["initial"], "mirrors, their shadows, objects", 1)
    panels[1].images[0].set_alpha(0.25)
    mf.plot.shadows(reconstruction, panels[1])
    _points(panels[1], reconstruction, deepest + 1)
    mf.plot.mirrors(reconstruction, panels[1])
    draw_radar(panels[1], radar_of(reconstruction))
    for number, generation in enumerate(range(deepest, 0, -1), 2):
        title = f"generation {generation} folded" + ("" if generation > 1 else ": corrected")
        _image(panels[number], images[f"folded_{generation}"], title, number)
        _points(panels[number], reconstruction, generation)
        _mirrors(panels[number], reconstruction, generation)
        draw_radar(panels[number], radar_of(reconstruction))
    mf.plot.scene(scene, panels[count - 1])
    for number, panel in enumerate(panels[:count]):
        panel.set(xlim=extent[:2], ylim=extent[2:], ylabel="range y [m]" if number % COLUMNS == 0 else "")
    figure.colorbar(panels[0].images[0], ax=panels, label=f"amplitude [dB], floor {FLOOR_DB:g} dB", aspect=30,
                    shrink=0.8 if rows == 1 else 0.6, pad=0.01)  # fmt: skip
    handles = _legend(reconstruction, deepest)
    if count < len(panels):
        panels[count].legend(handles=handles, loc="center left", frameon=False)
    else:
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure, images


def _image(ax: Axes, image: xr.DataArray, title: str, number: int) -> None:
    mf.plot.image(image, ax, floor_db=FLOOR_DB, normalization="none", colorbar=False)
    ax.set_title(f"({'abcdefgh'[number]}) {title}", loc="left", fontsize="medium")


def _points(ax: Axes, reconstruction: xr.DataTree, generation: int) -> None:
    """Draw the points of objects, with all generations from the deepest to this one folded."""
    points = confident_points(reconstruction)
    points = points.isel(point=points["surface"].values == "object")
    folds, bounces = partial_folds(reconstruction, generation), points["bounces"].values
    initial = np.column_stack([points["x_initial"], points["y_initial"]])
    place = np.array([folds[chain](at) for chain, at in zip(points["chain"].values.astype(str), initial, strict=True)])
    for count in np.unique(bounces):
        ax.plot(*place[bounces == count].T, "o", markersize=2.2, markeredgewidth=0, color=colour_of(int(count)))


def _mirrors(ax: Axes, reconstruction: xr.DataTree, generation: int) -> None:
    """Draw the mirrors, each folded by the chain by way of which it was seen, down to this generation."""
    table = reconstruction.children["mirrors"].to_dataset(inherit=False)
    folds = partial_folds(reconstruction, generation)
    lines = zip(mirror_chains(table), mirror_lines(reconstruction, folded=False), strict=True)
    for chain, (ends, depth) in sorted(lines, key=lambda line: -line[1][1]):
        place: Array = folds[chain.rpartition("/")[0]](ends)
        width = 1.6 + 1.8 * (depth - 1)  # deeper ones are wider and drawn first: all of them show where they coincide
        ax.plot(*place.T, color=colour_of(depth - 1), linewidth=width, solid_capstyle="round", path_effects=halo(2.0))


def _legend(reconstruction: xr.DataTree, deepest: int) -> list[Line2D | Patch]:
    """Colours of mirrors, objects and shadows by the number of bounces."""
    points = confident_points(reconstruction)
    counts = np.unique(points["bounces"].values[points["surface"].values == "object"])
    lines = [Line2D([], [], color=colour_of(n), linewidth=3.0, label=f"mirror, generation {n + 1}")
             for n in range(deepest)]  # fmt: skip
    dots = [Line2D([], [], color=colour_of(int(n)), marker="o", markersize=5, linestyle="none",
                   label=f"object, {bounce_label(int(n))}") for n in counts]  # fmt: skip
    return [*lines, *dots, Patch(color=colour_of(0), alpha=0.13, label="shadow"),
            Line2D([], [], color=TRUTH_COLOUR, linewidth=1.0, label="truth")]  # fmt: skip
