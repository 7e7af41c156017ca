"""Blocks of pixels, and how bright their pixels can be: most of a grid shows nothing, and is not looked at."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.views.view import View
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT

FEWEST_PIXELS = 8
"""Pixels of a block along each axis, at least: fewer cost more to look up than they spare."""

HALF_SAMPLE = 0.75
"""How far a direction may be from the sampled one that is nearest to it, as a share of the chord between neighbouring
samples: half of it in equal steps of the angle; in equal steps of the sine up to 0.71 at the edge of the view."""

SHARE_OF_BLOCK = 0.25
"""Neighbouring samples of one direction are handled as one where they reach over no more than this share of the edge
of a block."""


class Blocks(NamedTuple):
    """Blocks of pixels, and how bright each mirror may make their pixels.

    Attributes
    ----------
    size : tuple of int
        Pixels of a block along y, x and z.
    bound : (y, maps, x, z) array
        The largest amplitude that each map may show in each block; zero where it shows nothing.
    order : (y, maps, x, z) array of int
        Indices of the blocks along z, from the one with the largest bound on.
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
    """The blocks of a grid x, y, z [m], see `mirrorfold.folding.pictures.draw`.

    Parameters
    ----------
    view : View
        The image by direction and range.
    maps : dict of int to Isometry
        By the number of each mirror, the map from where the image shows an object to where it stands.
    grid : tuple of (n,) arrays [m]
        Coordinates x, y and z of the pixels.
    blobs : (directions, ranges) array of int
        Number of the mirror that each sample is folded by, see `mirrorfold.folding.points.owned_blobs`.
    amplitude : (directions, ranges) array
        What is drawn.
    gain : (ranges,) array
        Factors that undo the spreading with range.
    through : tuple
        Passages of the lines of sight, two arrays, see `LinesOfSight.passages`, and the margin behind walls [m].
    """
    across = _chords(view)
    reach = HALF_SAMPLE * view.range[-1] * float(np.median(across)) + view.dr
    steps = np.array([axis[1] - axis[0] if axis.size > 1 else 1.0 for axis in grid])
    size = [max(FEWEST_PIXELS, int(np.ceil(2.0 * reach / step))) for step in steps]
    counts = [-(-axis.size // pixels) for axis, pixels in zip(grid, size, strict=True)]
    first, scale = np.array([axis[0] for axis in grid]) - 0.5 * steps, 1.0 / (np.array(size) * steps)
    together = max(1, int(SHARE_OF_BLOCK / (scale.max() * view.dr)))
    bound = np.zeros((len(maps), *counts), dtype=np.float32)
    louder = gain.copy()
    louder[1:] = np.maximum(gain[1:], gain[:-1])

    def fill(item: tuple[int, int]) -> None:
        place, number = item
        into = maps[number]
        start, heading = np.zeros(3), np.zeros((len(view.sight), 3))
        start[: view.dimensions] = into(view.radar)
        heading[:, : view.dimensions] = view.sight @ into.linear.T
        shown = np.zeros(bound.shape[1:], dtype=np.bool_)
        _fill(
            bound[place], shown, (start - first) * scale, heading * scale, scale, across, view.range, together,
            amplitude, louder, number, *through, blobs,
        )  # fmt: skip
        bound[place][~shown] = 0.0

    for_each(fill, enumerate(maps))
    bound = np.ascontiguousarray(np.transpose(bound, (2, 0, 1, 3)))
    return Blocks((size[1], size[0], size[2]), bound, np.argsort(-bound, axis=-1))


def _chords(view: View) -> Array:
    """The longer chord from each direction's unit vector to its neighbours', summed over the axes, (directions,)."""
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
    """Whether the radar sees by way of a mirror anywhere between two ranges [m] of a direction."""
    begin = -np.inf
    for k in range(crossing.shape[0] + 1):
        end = crossing[k, direction] if k < crossing.shape[0] else np.inf
        if through[k, direction] == mirror and begin <= high and end >= low:
            return True
        begin = end
    return False


@njit(nogil=True, error_model="numpy")
def _fill(  # type: ignore[no-untyped-def]
    bound, shown, start, heading, scale, across, range_, together, amplitude, gain, number, crossing, through, margin,
    blobs,
):  # fmt: skip
    """Raise the `bound` (x, y, z) of blocks by what one map shows, and mark those where it shows anything (`shown`).

    Lengths are in blocks. The amplitude of a pixel is interpolated between samples, so that a sample counts as far as
    the next one. Which mirror a pixel belongs to is asked of the nearest sample, so that this counts half as far. As
    many samples of one direction as `together` says are handled as one.
    """
    dr = range_[1] - range_[0]
    for beam in range(heading.shape[0]):
        for first in range(0, range_.size, together):
            last = min(first + together, range_.size) - 1
            value, own = np.float32(0.0), False
            for k in range(first, last + 1):
                value = max(value, amplitude[beam, k] * gain[k])
                owner = blobs[beam, k]
                own |= owner == number or (number == ROOT and owner != NOBODY)
            r, deep = 0.5 * (range_[first] + range_[last]), 0.5 * (last - first) * dr + 0.51 * dr
            if own:
                own = _passes(crossing, through, r - margin - deep, r - margin + deep, beam, number)
            half = HALF_SAMPLE * (abs(r) + deep) * across[beam] + deep
            x, y, z = start[0] + r * heading[beam, 0], start[1] + r * heading[beam, 1], start[2] + r * heading[beam, 2]
            for wide in range(2):  # first which mirror it belongs to, then how bright it is
                if wide == 0 and not own:
                    continue
                reach = half * (1.0 + wide)
                x0, x1 = _span(x, reach * scale[0], bound.shape[0])
                y0, y1 = _span(y, reach * scale[1], bound.shape[1])
                z0, z1 = _span(z, reach * scale[2], bound.shape[2])
                for i in range(x0, x1 + 1):
                    for j in range(y0, y1 + 1):
                        for q in range(z0, z1 + 1):
                            if wide:
                                bound[i, j, q] = max(bound[i, j, q], value)
                            else:
                                shown[i, j, q] = True
