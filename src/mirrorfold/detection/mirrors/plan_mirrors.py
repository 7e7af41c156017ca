"""The walls of a known floor plan as mirrors: what the radar sees of them, and where it sees it in its image.

A wall that is seen by way of others appears in the unfolded image where these reflect it to, and only as far as they
show it. So the lines of sight are followed from the radar, wall by wall, each as a ray that is reflected; straightened,
the rays of one chain of walls meet the image of its last one.
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
"""Most walls on a way: each takes some decibels, so that longer ways show nothing."""

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
        Both ends of each; of arcs, in files that mirrorfold has written, three points, (mirrors, 3, 2). A wall of which
        the radar sees all keeps its ends; others end at the last line of sight that meets them.

    Raises
    ------
    InputError
        If the view is that of a volume: a floor plan knows no heights.
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
    """Add the mirrors that lines of sight meet next, and follow those that are reflected.

    `walls` (n, 2, 2) are the true ones as these lines of sight see them: reflected in all mirrors so far. `begin` [m]
    is how far along each of `columns` the last mirror stands.
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
        # Columns in a row; where another wall stands in between, this one is seen in parts.
        for part in np.split(hit, np.flatnonzero(np.diff(columns[hit]) > 1) + 1):
            if part.size < FEWEST_DIRECTIONS:
                continue
            found.append(_visible(view, wall, columns[part[[0, -1]]], distance[part[[0, -1]]]))
            if left > 1:
                seen = reflect(walls, wall[0], segment_normal(*wall))
                seen[number] = wall
                _follow(view, seen, sight, columns[part], distance[part], left - 1, found)


def _visible(view: ImageView, wall: Array, outermost: Index, range_: Array) -> Array:
    """The ends of what is seen of a wall, (2, 2): its own, where the next line of sight would pass beyond them.

    The first and the last direction that meet it, `outermost`, do so at ranges [m].
    """
    met = view.points(range_, outermost)
    turn = slice(None, None, 1 if (wall[1] - wall[0]) @ (met[1] - met[0]) >= 0.0 else -1)
    _, u = view.to_polar(wall[turn])
    own = np.abs(u - view.u[outermost]) <= view.du  # False behind the radar, where u is NaN
    return np.where(own[:, None], wall[turn], met)[turn]
