"""Upper bounds on the brightness of blocks of pixels, so that drawing can skip the blocks that show nothing.

Most of a grid shows nothing. Before it is drawn, every sample of the image is therefore mapped into the scene, and
raises the bound of the blocks of pixels that may look it up. A block whose bound does not exceed what is already drawn
there is skipped.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import ROOT, UNSEEN, Array, Index
from mirrorfold.detection import View

FEWEST_PIXELS = 8
"""A block has at least this many pixels along each axis: the bounds of smaller blocks cost more than they spare."""

HALF_SAMPLE = 0.75
"""Largest distance of a direction from the nearest sampled direction, as a share of the chord between neighbouring
samples. It is 0.5 for samples in equal steps of the angle, and up to 0.71, at the edge of the view, in equal steps of
the sine."""

SHARE_OF_BLOCK = 0.25
"""Neighbouring range samples of one direction are handled as one while they span at most this share of the edge of a
block."""


class Blocks(NamedTuple):
    """Blocks of pixels, and upper bounds of the amplitudes that each map may draw in them.

    A block has `size` pixels along y, x and z. The `bound` (y, maps, x, z) is zero where a map draws nothing, and
    `order` (y, maps, x, z) numbers the blocks along z from the largest bound to the smallest.
    """

    size: tuple[int, int, int]
    bound: NDArray[np.float32]
    order: Index


def blocks(
    view: View,
    maps: dict[int, Isometry],
    grid: tuple[Array, Array, Array],
    blobs: NDArray[np.int16],
    amplitude: NDArray[np.float32],
    gain: NDArray[np.float32],
    through: tuple[NDArray[Any], NDArray[Any], float],
) -> Blocks:
    """The blocks of the grid of pixels that `mirrorfold.folding.pictures.draw` draws on, with their bounds.

    For the number of each mirror, and `ROOT` for none, `maps` lead from where the image shows an object to where it
    stands. The `grid` are the coordinates x, y and z of the pixels [m], and `blobs` (directions, ranges) say by which
    mirror each sample is folded, see `owned_blobs`. The `gain` (ranges,) that undoes the spreading with range is not
    applied to the `amplitude` (directions, ranges) yet. Lines of sight lead `through` mirrors by their passages, two
    arrays, see `LinesOfSight.passages`, with a margin behind walls [m].
    """
    across = _chords(view)
    reach = HALF_SAMPLE * view.range[-1] * float(np.median(across)) + view.dr
    steps = np.array([axis[1] - axis[0] if axis.size > 1 else 1.0 for axis in grid])
    size = [max(FEWEST_PIXELS, int(np.ceil(2.0 * reach / step))) for step in steps]
    counts = [-(-axis.size // pixels) for axis, pixels in zip(grid, size, strict=True)]
    first, scale = np.array([axis[0] for axis in grid]) - 0.5 * steps, 1.0 / (np.array(size) * steps)
    samples_at_once = max(1, int(SHARE_OF_BLOCK / (scale.max() * view.dr)))
    bound = np.zeros((len(maps), *counts), dtype=np.float32)
    largest_gain = gain.copy()
    largest_gain[1:] = np.maximum(gain[1:], gain[:-1])

    def fill(item: tuple[int, int]) -> None:
        """Set the bounds of one map, given its place in the table and the number of its mirror."""
        place, number = item
        into = maps[number]
        start, heading = np.zeros(3), np.zeros((len(view.sight), 3))
        start[: view.dimensions] = into(view.radar)
        heading[:, : view.dimensions] = view.sight @ into.linear.T
        drawn = np.zeros(bound.shape[1:], dtype=np.float32)
        _fill(
            bound[place], drawn, (start - first) * scale, heading * scale, scale, across, view.range, samples_at_once,
            amplitude, largest_gain, number, *through, blobs,
        )  # fmt: skip
        bound[place][drawn == 0.0] = 0.0

    for_each(fill, enumerate(maps))
    bound = np.ascontiguousarray(np.transpose(bound, (2, 0, 1, 3)))
    return Blocks((size[1], size[0], size[2]), bound, np.argsort(-bound, axis=-1))


def _chords(view: View) -> Array:
    """Chord from each direction's unit vector to its farther neighbour's, summed over the axes, (directions,)."""
    sight = view.sight.reshape(*view.shape, -1)
    total = np.zeros(view.shape)
    for axis in range(len(view.shape)):
        step = np.moveaxis(np.linalg.norm(np.diff(sight, axis=axis), axis=-1), axis, -1)
        edge = [(0, 0)] * (step.ndim - 1)
        longest = np.maximum(np.pad(step, [*edge, (0, 1)]), np.pad(step, [*edge, (1, 0)]))
        total += np.moveaxis(longest, -1, axis)
    return total.ravel()


@njit(nogil=True, error_model="numpy", inline="always")
def _span(middle, reach, count):  # type: ignore[no-untyped-def]
    """First and last of `count` blocks that ``middle +- reach`` [blocks] meets; the last below the first if none."""
    return max(int(np.floor(middle - reach)), 0), min(int(np.floor(middle + reach)), count - 1)


@njit(nogil=True, error_model="numpy", inline="always")
def _passes(crossing, through, low, high, direction, mirror):  # type: ignore[no-untyped-def]
    """Whether a line of sight leads by way of `mirror` anywhere between the ranges `low` and `high` [m]."""
    begin = -np.inf
    for k in range(crossing.shape[0] + 1):
        end = crossing[k, direction] if k < crossing.shape[0] else np.inf
        if through[k, direction] == mirror and begin <= high and end >= low:
            return True
        begin = end
    return False


@njit(nogil=True, error_model="numpy", inline="always")
def _raise(blocks, x, y, z, reach, scale, value):  # type: ignore[no-untyped-def]
    """Raise `blocks` (x, y, z) to a value, up to `reach` [m] around a place x, y, z [blocks] along all axes.

    `scale` (3,) is in blocks per metre.
    """
    x0, x1 = _span(x, reach * scale[0], blocks.shape[0])
    y0, y1 = _span(y, reach * scale[1], blocks.shape[1])
    z0, z1 = _span(z, reach * scale[2], blocks.shape[2])
    for i in range(x0, x1 + 1):
        for j in range(y0, y1 + 1):
            for q in range(z0, z1 + 1):
                blocks[i, j, q] = max(blocks[i, j, q], value)


@njit(nogil=True, error_model="numpy")
def _fill(  # type: ignore[no-untyped-def]
    bound, drawn, start, heading, scale, across, range_, samples_at_once, amplitude, gain, number, crossing, through,
    margin, blobs,
):  # fmt: skip
    """Raise the `bound` (x, y, z) of blocks by the samples that one map shows there; 1 in `drawn` marks what it draws.

    `start` (3,) is in blocks, `heading` (beams, 3) and `scale` (3,) in blocks per metre, and ranges are in metres. The
    amplitude of a pixel is interpolated between samples, so a sample raises bounds as far as its neighbours. A pixel
    belongs to the mirror of its nearest sample, so a sample marks blocks only half as far. As many neighbouring samples
    of one direction as `samples_at_once` are handled as one.
    """
    dr = range_[1] - range_[0]
    for beam in range(heading.shape[0]):
        for first in range(0, range_.size, samples_at_once):
            last = min(first + samples_at_once, range_.size) - 1
            value, own = np.float32(0.0), False
            for k in range(first, last + 1):
                value = max(value, amplitude[beam, k] * gain[k])
                owner = blobs[beam, k]
                own |= owner == number or (number == ROOT and owner != UNSEEN)
            # A little more than half a sample beyond the outermost ones, for rounding.
            r, half_depth = 0.5 * (range_[first] + range_[last]), 0.5 * (last - first) * dr + 0.51 * dr
            half = HALF_SAMPLE * (abs(r) + half_depth) * across[beam] + half_depth
            x, y, z = start[0] + r * heading[beam, 0], start[1] + r * heading[beam, 1], start[2] + r * heading[beam, 2]
            if own and _passes(crossing, through, r - margin - half_depth, r - margin + half_depth, beam, number):
                _raise(drawn, x, y, z, half, scale, np.float32(1.0))
            _raise(bound, x, y, z, 2.0 * half, scale, value)
