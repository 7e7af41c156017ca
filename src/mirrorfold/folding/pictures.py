"""The pictures of the folded and of the unfolded scene, and the grid of pixels that they are drawn on."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import Isometry, reflect_each
from mirrorfold.common.normalization import RANGE_POWERS
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import ROOT, Array, Index, Mask
from mirrorfold.detection import ArcMirror, ImageView, RoundMirror, View, VolumeView, fold_of
from mirrorfold.detection.mirrors.mirror import ChainFold
from mirrorfold.folding.blocks import blocks
from mirrorfold.folding.drawing import draw_bent_row, draw_round_row, draw_row
from mirrorfold.folding.points import BLOB_CELLS, Points, owned_blobs
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.lines_of_sight import LinesOfSight

Grid = tuple[Array, ...]
"""Pixel coordinates x and y, and z for a volume [m]."""

LARGEST_GROWTH = 2.0
"""The grid grows to hold points that fold to places outside of the image: on each side by at most this multiple of the
image's size."""

PIXEL_RADII, BORDER_RADII = 0.6, 9.0
"""Edge of the pixels of a volume's plan view, and width of the border around its points, in radii of the beam where it
is narrowest. Vertical columns are sampled in steps of two edges."""

LARGEST_GRID = 60_000_000
"""The plan view of a volume is drawn from at most this many voxels: where there would be more, the pixels grow."""

LARGEST_ANGLE = np.radians(89.999)
"""Largest elevation, and half of the largest azimuth from the middle one, that are drawn of a volume [rad]."""


def pictures(
    image: xr.DataArray, found: Found, points: Points, settings: FoldSettings, grid: Grid | None
) -> tuple[Grid, NDArray[np.float32], NDArray[Any], str]:
    """The folded and the unfolded scene on one grid: its axes x and y, both pictures (y, x), and what their pixels are.

    By default, the grid is that of the image, grown to hold all folded points; the unfolded picture then has the pixels
    of the image, complex if these are. For a volume, it is a grid around all points.
    """
    sight, view = found.sight, found.sight.view
    least, wall_margin = settings.min_confidence, settings.wall_margin or 0.0
    blobs = owned_blobs(points, sight, least)
    points = points.take(points.confidence >= least)
    given = grid is not None
    grid = grid or (_around(points, view) if isinstance(view, VolumeView) else _grown(image, points))
    folded = draw(sight, wall_margin, grid, blobs, strongest=True)
    blobs.fill(ROOT)
    initial = draw(LinesOfSight.unfolded(view), wall_margin, grid, blobs, strongest=True)
    if (points.wall != "").any():
        np.maximum(folded, _passed_pixels(points, view, grid) * initial, out=folded)
    if isinstance(view, ImageView):
        if image.ndim == 2 and not given:
            # Drawn pixels are interpolated, which is right to a tenth only; those of the image are exact.
            measured = _measured(image, view, grid, initial)
            np.copyto(folded, np.abs(measured), where=folded == initial)
            initial = measured
        return grid, folded, initial, "amplitude, range-normalised"
    return grid[:2], folded, initial, "strongest amplitude of each vertical column, normalised"


def _measured(image: xr.DataArray, view: ImageView, grid: Grid, drawn: NDArray[np.float32]) -> NDArray[Any]:
    """The normalised pixels of an image themselves, (y, x), on a grid that continues theirs, where they are `drawn`.

    They are complex if those of the image are.
    """
    x, y = (image[name].values.astype(float) for name in "xy")
    values, power = image.values, float(view.power - RANGE_POWERS[str(image.attrs.get("normalization", "none"))])
    below, left = (int(np.abs(axis - first).argmin()) for axis, first in zip(grid[::-1], (y[0], x[0]), strict=True))
    out = np.zeros(drawn.shape, dtype=np.result_type(values.dtype, np.float32))

    def row(i: int) -> None:
        pixels = below + i, slice(left, left + x.size)
        gain = (np.hypot(x - view.radar[0], y[i] - view.radar[1]) ** power).astype(np.float32)
        np.multiply(gain, values[i], out=out[pixels], where=drawn[pixels] > 0.0)

    for_each(row, range(y.size))
    return out


def _passed_pixels(points: Points, view: View, grid: Grid) -> NDArray[np.float32]:
    """Ones at pixels within `BLOB_CELLS` of an echo that passed through a wall, zeros elsewhere, (y, x)."""
    x, y = grid[:2]
    seen = points.initial[points.wall != ""]
    places = np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1)
    reach = BLOB_CELLS * view.cells_at(seen)
    distance, nearest = cKDTree(seen[:, :2]).query(places, distance_upper_bound=float(reach.max()))
    reach = np.append(reach, 0.0)
    return (distance <= reach[nearest]).astype(np.float32)


def draw(
    sight: LinesOfSight, wall_margin: float, grid: Grid, blobs: NDArray[np.int16], *, strongest: bool = False
) -> NDArray[np.float32]:
    """Normalised amplitude of the true scene on a regular grid, (y, x) or (z, y, x).

    With `strongest`, only the largest amplitude of each vertical column, (y, x); the voxels are then never all held in
    memory. Every pixel looks up the image at the places where chains of mirrors show it, unless something stands in the
    way there. So there are no holes, as moving pixels to their folded places would leave. Echoes up to `wall_margin`
    [m] behind a mirror belong to the wall. `blobs` (directions, ranges) says by which mirror each sample is folded, see
    `owned_blobs`: no other samples are folded, and doubted ones are not drawn.
    """
    view, samples = sight.view, _samples_of(sight.view)
    x, y, *z = map(np.array, grid)  # kernels are compiled once for arrays that may be written to
    height, columns = z[0] if z else np.zeros(1), strongest or not z
    folds = {index: fold_of(way, view.dimensions) for index, way in sight.ways.items()}
    flat = {ROOT: Isometry.identity(view.dimensions)}
    flat |= {index: fold for index, fold in folds.items() if isinstance(fold, Isometry)}
    back = {index: fold.inverse if index != ROOT else fold for index, fold in flat.items()}
    maps = np.stack([_into_view(one, samples.frame, view.radar) for one in back.values()])
    crossing, through = map(np.ascontiguousarray, sight.passages)
    empty = sight.empty_up_to if sight.empty_up_to.size else np.zeros(len(view.sight))
    cover, side, shape = tuple(sight.cover), view.beside_steps(view.range), (*view.shape, 1)[:2]
    looked_up = samples.amplitude, samples.gain, side, shape, samples.grid
    seen = maps[0], crossing, through, cover, empty, wall_margin, blobs, *looked_up
    passages = crossing, through, wall_margin
    near = blocks(view, flat, (x, y, height), blobs, samples.by_direction, samples.gain, passages)
    curved = {index: fold for index, fold in folds.items() if isinstance(fold, ChainFold)}
    arcs = [(index, way) for index, fold in curved.items() if (way := _bent(fold, view))]
    round_ones = [
        (index, *box, met)
        for index, fold in curved.items()
        if (met := _round(fold)) and (box := _boxed(fold, view, blobs == index, (x, y, height)))
    ]
    numbers, out = np.array(list(flat)), np.zeros((y.size, x.size, 1 if columns else height.size), dtype=np.float32)

    def row(i: int) -> None:
        part = i // near.size[0]
        nearby = near.bound[part], near.order[part], near.size[1:]
        draw_row(x, float(y[i]), height, maps, numbers, *nearby, seen, out[i])
        for index, way in arcs:
            draw_bent_row(x, float(y[i]), *way, index, seen, out[i])
        for index, across, ahead, up, met in round_ones:
            if ahead.start <= i < ahead.stop:
                part_of_row = out[i, across] if columns else out[i, across, up]
                draw_round_row(x[across], float(y[i]), height[up], *met, index, seen, part_of_row)

    for_each(row, range(y.size))
    return out[..., 0] if columns else np.moveaxis(out, -1, 0)


class _Samples(NamedTuple):
    """The samples of a view as the kernels look them up: an image is a volume with one row of directions.

    Their amplitudes, not yet multiplied by the `gain` (ranges,) that undoes the spreading with range, are held
    `by_direction` (directions, ranges), and as `amplitude` (columns, rows, ranges) along both axes of directions; the
    row of an image is there twice, to interpolate between. The `frame` (d, d) holds the unit vectors of the radar's own
    frame, and the `grid` (3, 4) first value, step, and lowest and highest value of both angles and the range, see
    `draw_row`.
    """

    by_direction: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    gain: NDArray[np.float32]
    frame: Array
    grid: Array


def _samples_of(view: View) -> _Samples:
    """The samples of a view."""
    if isinstance(view, VolumeView):
        grid = _grid_of(view.axes[0] - view.middle, view.axes[1], view.range)
        grid[0, 2:] *= 0.5
        grid[:2, 2:] = np.tan(np.clip(grid[:2, 2:], -LARGEST_ANGLE, LARGEST_ANGLE))
        by_direction = view.amplitude.reshape(-1, view.range.size)
        return _Samples(by_direction, view.amplitude, view.gain.astype(np.float32), view.frame, grid)
    view = cast(ImageView, view)
    by_direction = np.ascontiguousarray(view.amplitude.T, dtype=np.float32)
    amplitude, gain = np.repeat(by_direction[:, None], 2, axis=1), np.ones(view.range.size, dtype=np.float32)
    return _Samples(by_direction, amplitude, gain, view.frame, _grid_of(view.u, view.u, view.range))


def _grid_of(*axes: Array) -> Array:
    """Of each axis its first value, its step, and its ends, half a step before the first value and behind the last."""
    return np.array([(a[0], a[1] - a[0], 1.5 * a[0] - 0.5 * a[1], 1.5 * a[-1] - 0.5 * a[-2]) for a in axes])


def _into_view(back: Isometry, frame: Array, radar: Array) -> Array:
    """The map (3, 4) from true places to the radar's own `frame`, given the map `back` to places in the image."""
    into, size = np.zeros((3, 4)), len(frame)
    into[:size, :size], into[:size, 3] = frame @ back.linear, frame @ (back.shift - radar)
    return into


def _bent(fold: ChainFold, view: View) -> tuple[Array, Index, Array, Array, Array] | None:
    """Arguments of `draw_bent_row` for an arc: `unfold`, `column`, `place`, `heading` and `before`.

    None if the last mirror of the chain is no arc, or one before it is curved, too.
    """
    arc, unfold = fold.way[-1], _unfolded(fold)
    if unfold is None or not isinstance(arc, ArcMirror) or not isinstance(view, ImageView):
        return None
    range_ = arc.crossing(view)
    column = np.flatnonzero(np.isfinite(range_))
    sight = view.sight[column]
    place = view.radar + range_[column, None] * sight
    heading = reflect_each(sight, 0.0, arc.outward(arc.along(place)))
    return unfold, column, place, heading, range_[column]


def _round(fold: ChainFold) -> tuple[Array, Array, Array, float, Array] | None:
    """Arguments of `draw_round_row` for a cylinder or sphere: `unfold`, `middle`, `axis`, `radius` and `radar`.

    None if the last mirror of the chain is neither, or one before it is curved, too.
    """
    mirror, unfold = fold.way[-1], _unfolded(fold)
    if unfold is None or not isinstance(mirror, RoundMirror):
        return None
    return unfold, mirror.shape.middle, mirror.shape.axis, mirror.shape.radius, mirror.radar


def _unfolded(fold: ChainFold) -> Array | None:
    """The map (d, d + 1) from true places to where the mirrors before the last one of a chain show them; None if one of
    these is curved.
    """
    back = fold_of(fold.way[:-1], fold.way[-1].center.size)
    return np.column_stack([back.inverse.linear, back.inverse.shift]) if isinstance(back, Isometry) else None


def _boxed(fold: ChainFold, view: View, shown: Mask, grid: Grid) -> tuple[slice, slice, slice] | None:
    """Slices along x, y and z of the voxels that hold all samples that a chain folds, marked in `shown` (directions,
    ranges); None if there are no such samples.
    """
    direction, sample = np.nonzero(shown)
    if not direction.size:
        return None
    place = fold(view.points(view.range[sample], direction))
    box = []
    for axis, low, high in zip(grid, place.min(axis=0), place.max(axis=0), strict=True):
        first, last = np.searchsorted(axis, [low, high]).tolist()
        box.append(slice(max(first - 1, 0), min(last + 1, axis.size)))
    return box[0], box[1], box[2]


def _grown(image: xr.DataArray, points: Points) -> Grid:
    """The coordinates of the image, continued in the same steps to hold all folded points."""
    axes = []
    for name, place in zip("xy", points.position.T, strict=True):
        axis = image[name].values.astype(float)
        step = (axis[-1] - axis[0]) / (axis.size - 1)
        ends = [axis[0] - place.min(initial=axis[0]), place.max(initial=axis[-1]) - axis[-1]]
        below, above = np.clip(np.ceil(np.array(ends) / step), 0, int(LARGEST_GROWTH * axis.size))
        before, after = axis[0] - step * np.arange(below, 0, -1), axis[-1] + step * np.arange(1, above + 1)
        axes.append(np.concatenate([before, axis, after]))
    return tuple(axes)


def _around(points: Points, view: VolumeView) -> Grid:
    """Pixel coordinates x, y and z [m] around all points, before and after folding; without points, a unit cube."""
    radius = float(view.width(view.range[view.range > 0.0]).min()) if view.beam is None else view.beam[0]
    places = np.concatenate([points.position, points.initial])
    border = BORDER_RADII * radius
    low, high = (places.min(0) - border, places.max(0) + border) if len(places) else (np.zeros(3), np.ones(3))
    pixel = PIXEL_RADII * radius
    pixel *= max(1.0, float(np.prod(high - low) / (2.0 * pixel**3) / LARGEST_GRID) ** (1.0 / 3.0))
    steps = pixel * np.array([1.0, 1.0, 2.0])
    ends = zip(steps, np.floor(low / steps), np.ceil(high / steps), strict=True)
    return tuple(step * np.arange(first, last + 1) for step, first, last in ends)
