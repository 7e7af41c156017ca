"""The walls of a known floor plan as mirrors: what the radar sees of them, and where it sees it in its image.

A wall that is seen by way of others appears in the unfolded image where these reflect it to, and only as far as they
show it. So the lines of sight are followed from the radar, wall by wall, each as a ray that is reflected; straightened,
the rays of one chain of walls meet the image of its last one.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.image_view import SAMPLES_PER_CELL, ImageView
from mirrorfold.detection.view import View
from mirrorfold.errors import InputError

LONGEST_CHAIN = 4
"""Walls on the way: each takes some decibels, and more are not seen."""

FEWEST_DIRECTIONS = 2 * SAMPLES_PER_CELL
"""A wall seen in fewer lines of sight, two resolution cells, is no mirror to speak of."""

TOUCHING = 1e-6
"""Share of the farthest range: a ray does not meet again, at its beginning, the wall that it comes from."""


def mirrors_of_plan(plan: FloorPlan, view: View, *, generations: int | None = None) -> Array:
    """The mirrors of a floor plan as they appear in the unfolded image.

    Parameters
    ----------
    plan : FloorPlan
    view : View
        Of an image.
    generations : int, optional
        Longest chain of walls; `LONGEST_CHAIN` by default.

    Returns
    -------
    (mirrors, 2, 2) array [m]
        Both ends of each. A wall of which the radar sees all keeps its ends; others end at the last line of sight that
        meets them.

    Raises
    ------
    InputError
        If the view is that of a volume: a floor plan knows no heights.
    """
    if not isinstance(view, ImageView):
        raise InputError(
            f"{plan.source}: is a floor plan, which has no heights; give four corners of each mirror (JSON)"
        )
    if plan.images is not None:
        return plan.images
    longest = LONGEST_CHAIN if generations is None else min(max(generations, 1), LONGEST_CHAIN)
    found: list[Array] = []
    _follow(view, plan.walls, view.sight, np.arange(view.u.size), np.zeros(view.u.size), longest, found)
    return np.array(found).reshape(-1, 2, 2)


def _follow(
    view: ImageView, walls: Array, sight: Array, columns: Index, begin: Array, left: int, found: list[Array]
) -> None:  # fmt: skip
    """Add the mirrors that lines of sight meet next, and follow those that are reflected.

    `walls` (n, 2, 2) are the true ones as these lines of sight see them: reflected in all mirrors so far. `begin` [m]
    is how far along each of `columns` the last mirror stands.
    """
    if not len(walls):
        return
    reach = float(view.range[-1])
    towards = walls[:, 1] - walls[:, 0]
    start = walls[:, 0] - view.radar
    with np.errstate(divide="ignore", invalid="ignore"):
        # Ray r s = start + t towards, by the cross products with the direction of the wall and with the ray.
        across = sight[columns][:, :1] * towards[:, 1] - sight[columns][:, 1:] * towards[:, 0]
        r = (start[:, 0] * towards[:, 1] - start[:, 1] * towards[:, 0]) / across
        t = (start[:, 0] * sight[columns][:, 1:] - start[:, 1] * sight[columns][:, :1]) / across
        meets = (t >= 0.0) & (t <= 1.0) & (r > begin[:, None] + TOUCHING * reach) & (r <= reach)
    r = np.where(meets, r, np.inf)
    nearest, distance = r.argmin(axis=1), r.min(axis=1)
    for wall in np.unique(nearest[np.isfinite(distance)]):
        hit = np.flatnonzero((nearest == wall) & np.isfinite(distance))
        # Columns in a row; where something stands in between, the wall is seen in parts.
        for part in np.split(hit, np.flatnonzero(np.diff(columns[hit]) > 1) + 1):
            if part.size < FEWEST_DIRECTIONS:
                continue
            mirror = _visible(view, walls[wall], columns, part, distance)
            found.append(mirror)
            if left > 1:
                normal = segment_normal(*walls[wall])
                seen = np.stack([reflect(walls[:, end], walls[wall, 0], normal) for end in (0, 1)], axis=1)
                seen[wall] = walls[wall]
                _follow(view, seen, sight, columns[part], distance[part], left - 1, found)


def _visible(view: ImageView, wall: Array, columns: Index, part: Index, distance: Array) -> Array:
    """The ends of what is seen of a wall, (2, 2): its own, where the next line of sight would pass beyond them."""
    first, last = view.radar + distance[part[[0, -1]], None] * view.sight[columns[part[[0, -1]]]]
    ends = wall if (wall[1] - wall[0]) @ (last - first) >= 0.0 else wall[::-1]
    _, u = view.to_polar(ends)
    mirror = np.array(
        [
            end if np.isfinite(of_end) and abs(of_end - view.u[columns[part[side]]]) <= view.du else met
            for end, of_end, side, met in zip(ends, u, (0, -1), (first, last), strict=True)
        ]
    )
    return mirror if ends is wall else mirror[::-1]
