"""The walls of a known floor plan as mirrors: which parts of them the radar sees, and where its image shows these.

A wall that is seen by way of others appears in the unfolded image where these reflect it to, and only as far as they
show it. So the lines of sight are followed from the radar, from wall to wall. Instead of the ray, the walls behind are
reflected at each wall: the line of sight stays straight, as in the image, and meets the image of each next wall.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.geometry import crossing, reflect, segment_normal
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL, ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.errors import InputError

LONGEST_CHAIN = 4
"""Largest number of walls on a path: each takes some decibels, so that longer paths show nothing."""

FEWEST_DIRECTIONS = 2 * SAMPLES_PER_CELL
"""Least number of neighbouring lines of sight that must meet a wall, two resolution cells: less shows hardly
anything."""

TOUCHING = 1e-6
"""Least distance from one wall to the next on a path, as a share of the largest range: so that a ray does not meet the
wall again that it comes from."""


def mirrors_of_plan(plan: FloorPlan, view: View, *, generations: int | None = None) -> Array:
    """The mirrors of a floor plan as they appear in the unfolded image.

    Parameters
    ----------
    plan : FloorPlan
    view : View
        The view of an image.
    generations : int, optional
        Largest number of walls in a chain; `LONGEST_CHAIN` by default and at most.

    Returns
    -------
    (mirrors, 2, 2) array [m]
        Both ends of each mirror; three points each, (mirrors, 3, 2), if a file that mirrorfold has written holds arcs.
        A wall keeps those ends that the radar sees; elsewhere it ends at the last line of sight that meets it.

    Raises
    ------
    InputError
        If the view is that of a volume: a floor plan has no heights.
    """
    if not isinstance(view, ImageView):
        what = "is a floor plan, which has no heights; give four corners of each mirror (JSON)"
        raise InputError(f"{plan.source}: {what}")
    if plan.images is not None:
        return plan.images
    longest = LONGEST_CHAIN if generations is None else min(max(generations, 1), LONGEST_CHAIN)
    found: list[Array] = []
    _follow(view, plan.walls, view.sight, np.arange(view.u.size), np.zeros(view.u.size), longest, found)
    return np.array(found).reshape(-1, 2, 2)


def _follow(
    view: ImageView, walls: Array, sight: Array, columns: Index, begin: Array, left: int, found: list[Array]
) -> None:  # fmt: skip
    """Add to `found` the mirrors that lines of sight meet next, and follow these lines behind each of them.

    `walls` (n, 2, 2) [m] are the walls as these lines of sight show them, reflected in all mirrors on the path so far.
    `columns` (m,) are the numbers of the lines of sight, `begin` (m,) [m] the ranges at which they met the last mirror,
    and `left` is how many more mirrors the path may have.
    """
    if not len(walls):
        return
    reach = float(view.range[-1])
    range_ = np.empty((len(walls), columns.size))
    for met, wall in zip(range_, walls, strict=True):  # the lines of sight have unit length
        met[:], along = crossing(view.radar, view.radar + sight[columns], *wall)
        met[~((along >= 0.0) & (along <= 1.0) & (met > begin + TOUCHING * reach) & (met <= reach))] = np.inf
    nearest, distance = range_.argmin(axis=0), range_.min(axis=0)
    for number in np.unique(nearest[np.isfinite(distance)]):
        wall, hit = walls[number], np.flatnonzero((nearest == number) & np.isfinite(distance))
        # Only neighbouring columns make one mirror: a wall with another one in front of its middle is seen in parts.
        for part in np.split(hit, np.flatnonzero(np.diff(columns[hit]) > 1) + 1):
            if part.size < FEWEST_DIRECTIONS:
                continue
            found.append(_visible(view, wall, columns[part[[0, -1]]], distance[part[[0, -1]]]))
            if left > 1:
                seen = reflect(walls, wall[0], segment_normal(*wall))
                seen[number] = wall
                _follow(view, seen, sight, columns[part], distance[part], left - 1, found)


def _visible(view: ImageView, wall: Array, outermost: Index, range_: Array) -> Array:
    """The ends of the part of a wall that is seen, (2, 2) [m], in the order of the wall's own ends.

    `outermost` (2,) are the first and the last direction that meet the wall, at ranges (2,) [m]. An end is that of the
    wall itself if it lies within one direction of the outermost one; else it is where that direction meets the wall.
    """
    met = view.points(range_, outermost)
    turn = slice(None, None, 1 if (wall[1] - wall[0]) @ (met[1] - met[0]) >= 0.0 else -1)
    _, u = view.to_polar(wall[turn])
    own = np.abs(u - view.u[outermost]) <= view.du  # False behind the radar, where u is NaN
    return np.where(own[:, None], wall[turn], met)[turn]
