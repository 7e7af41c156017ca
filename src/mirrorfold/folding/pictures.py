"""The pictures of the folded and of the unfolded scene: which kernel draws what."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.volume_view import VolumeView
from mirrorfold.folding.image_picture import draw_image
from mirrorfold.folding.points import Points, folded_blobs
from mirrorfold.folding.volume_picture import draw_volume, voxel_axes
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree

Grid = tuple[Array, ...]
"""Pixel coordinates x and y, and in space z [m]."""

LARGEST_GROWTH = 2.0
"""The corrected grid grows to hold what folds to outside of the image, by at most this share of the image's size."""


def pictures(
    image: xr.DataArray, sight: LinesOfSight, tree: MirrorTree, points: Points, wall_margin: float, grid: Grid | None
) -> tuple[tuple[Array, Array], NDArray[np.float32], NDArray[np.float32], str]:
    """The folded and the unfolded scene on one grid.

    Parameters
    ----------
    image : DataArray
    sight : LinesOfSight
    tree : MirrorTree
    points : Points
    wall_margin : float [m]
    grid : tuple of 1D arrays [m], optional
        By default the image's own, grown as far as points fold to, or one about all points of a volume.

    Returns
    -------
    axes : (x, y)
        1D arrays [m].
    intensity, initial : (y, x) arrays
    what : str
        What the pixels are.
    """
    folds, blobs = tree.folds(), folded_blobs(points, sight)
    if isinstance(sight.view, VolumeView):
        x, y, z = voxel_axes(points, sight.view) if grid is None else grid
        unfolded = LinesOfSight.unfolded(sight.view)
        pair = [draw_volume(x, y, z, s, folds, wall_margin, blobs).max(axis=0) for s in (sight, unfolded)]
        return (x, y), pair[0], pair[1], "strongest amplitude of each vertical column, normalised"
    assert isinstance(sight.view, ImageView)  # the other kind of view
    x, y = _grown(image, points) if grid is None else grid
    intensity, initial = draw_image(x, y, sight.view, sight, folds, wall_margin, blobs)
    return (x, y), intensity, initial, "amplitude, range-normalised"


def _grown(image: xr.DataArray, points: Points) -> tuple[Array, Array]:
    """The image's coordinates, continued in the same steps as far as folded points lie."""
    axes = []
    for i, name in enumerate("xy"):
        axis = image[name].values.astype(float)
        step = (axis[-1] - axis[0]) / (axis.size - 1)
        position = points.position[:, i]
        limit = int(LARGEST_GROWTH * axis.size)
        below = above = 0
        if position.size:
            below = int(np.clip(np.ceil((axis[0] - position.min()) / step), 0, limit))
            above = int(np.clip(np.ceil((position.max() - axis[-1]) / step), 0, limit))
        before, after = axis[0] - step * np.arange(below, 0, -1), axis[-1] + step * np.arange(1, above + 1)
        axes.append(np.concatenate([before, axis, after]))
    return axes[0], axes[1]
