"""The pictures of the folded and of the unfolded scene: which kernel draws what."""

from __future__ import annotations

from typing import cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array, Chain
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.volume_view import VolumeView
from mirrorfold.folding import image_picture, volume_picture
from mirrorfold.folding.points import Points, folded_blobs
from mirrorfold.folding.volume_picture import voxel_axes
from mirrorfold.tree.lines_of_sight import ROOT, LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree

Grid = tuple[Array, ...]
"""Pixel coordinates x and y, and in space z [m]."""

LARGEST_GROWTH = 2.0
"""The corrected grid grows to hold what folds to outside of the image, by at most this share of the image's size."""


def pictures(
    image: xr.DataArray, sight: LinesOfSight, tree: MirrorTree, points: Points, wall_margin: float, grid: Grid | None
) -> tuple[Grid, NDArray[np.float32], NDArray[np.float32], str]:
    """The folded and the unfolded scene on one grid: its axes x and y, both pictures (y, x), and what their pixels are.

    The grid is by default the image's own, grown as far as points fold to, or one about all points of a volume.
    """
    view, blobs = sight.view, folded_blobs(points, sight)
    grid = grid or (voxel_axes(points, view) if isinstance(view, VolumeView) else _grown(image, points))
    both = sight, LinesOfSight.unfolded(view)
    folded, initial = (draw(one, tree.folds(), wall_margin, grid, blobs) for one in both)
    if view.dimensions == 2:
        return grid, folded, initial, "amplitude, range-normalised"
    what = "strongest amplitude of each vertical column, normalised"
    return grid[:2], folded.max(axis=0), initial.max(axis=0), what


def draw(
    sight: LinesOfSight,
    folds: dict[Chain, Isometry],
    wall_margin: float,
    grid: Grid,
    blobs: NDArray[np.int16],
) -> NDArray[np.float32]:
    """Normalised amplitude of the true scene on a regular grid, (y, x) or (z, y, x).

    Every pixel looks up the image where each chain of mirrors shows it, if nothing stands in the way there: there are
    no holes, as pushing pixels to their folded places would leave them. Echoes up to `wall_margin` [m] behind a mirror
    belong to the wall. `blobs` (directions, ranges) says where the image shows what folds to a point, see
    `folded_blobs`; nothing else is folded.
    """
    view = sight.view
    x, y, *z = grid
    kernel, own = (
        (volume_picture.draw_row, volume_picture.volume_tables(view, *z))
        if isinstance(view, VolumeView)
        else (image_picture.draw_row, image_picture.image_tables(cast(ImageView, view)))
    )
    mirrors = {ROOT: Isometry.identity(view.dimensions)}
    mirrors |= {index: folds[chain].inverse for index, chain in enumerate(sight.chain) if chain}
    linear, shift = (np.array([getattr(back, name) for back in mirrors.values()]) for name in ("linear", "shift"))
    crossing, through = map(np.ascontiguousarray, sight.passages)
    empty = sight.open if sight.open.size else np.zeros(len(view.sight))
    seen = np.array(list(mirrors)), crossing, through, sight.cover.range, sight.cover.level, empty, wall_margin, blobs
    out = np.zeros((y.size, x.size, *(axis.size for axis in z)), dtype=np.float32)
    for_each(lambda i: kernel(x, float(y[i]), linear, shift, *seen, out[i], *own), range(y.size))
    return np.moveaxis(out, -1, 0) if z else out


def _grown(image: xr.DataArray, points: Points) -> Grid:
    """The image's coordinates, continued in the same steps as far as folded points lie."""
    axes = []
    for name, place in zip("xy", points.position.T, strict=True):
        axis = image[name].values.astype(float)
        step = (axis[-1] - axis[0]) / (axis.size - 1)
        ends = [axis[0] - place.min(initial=axis[0]), place.max(initial=axis[-1]) - axis[-1]]
        below, above = np.clip(np.ceil(np.array(ends) / step), 0, int(LARGEST_GROWTH * axis.size))
        before, after = axis[0] - step * np.arange(below, 0, -1), axis[-1] + step * np.arange(1, above + 1)
        axes.append(np.concatenate([before, axis, after]))
    return tuple(axes)
