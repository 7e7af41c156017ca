"""The walls of a known floor plan as mirrors: which parts of them the radar sees, and where its image shows these.

A wall that is seen by way of others appears in the unfolded image where these reflect it to, and only as far as they
show it. So the lines of sight are followed from the radar, from wall to wall. Instead of the ray, the walls behind are
reflected at each wall: the line of sight stays straight, as in the image, and meets the image of each next wall. Behind
a curved wall no further walls are followed: what it shows of a wall is curved, and counts as an object.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.arcs import Arc, as_three_points
from mirrorfold.common.geometry import circle_crossings, crossing, reflect, segment_normal
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
wall again that it comes from. Circles that differ by less, as a share of their radius, are one."""


def mirrors_of_plan(plan: FloorPlan, view: View, *, generations: int | None = None) -> Array:
    """The mirrors of a floor plan as they appear in the unfolded image: both ends of each, (mirrors, 2, 2) [m].

    If there are arcs, it is three points each, (mirrors, 3, 2). A straight wall keeps those ends that the radar sees;
    elsewhere, and if it is curved, it ends at the last line of sight that meets it. A chain has as many walls as there
    are `generations`, but at most, and by default, `LONGEST_CHAIN`.

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
    _follow(view, plan.walls, plan.curves, np.arange(view.u.size), np.zeros(view.u.size), longest, found)
    return np.array(as_three_points(found)) if found else np.empty((0, 2, 2))


def _follow(
    view: ImageView, walls: Array, curves: Array, columns: Index, begin: Array, left: int, found: list[Array]
) -> None:  # fmt: skip
    """Add to `found` the mirrors that lines of sight meet next, and follow these lines behind each of them.

    `walls` (n, 2, 2) [m] are the straight walls, `curves` (c, 3, 2) [m] the arcs as these lines of sight show them,
    reflected in all mirrors on the path so far. `columns` (m,) are the numbers of the lines of sight, `begin` (m,) [m]
    the ranges at which they met the last mirror, and `left` is how many more mirrors the path may have.
    """
    reach = float(view.range[-1])
    range_ = _met(view, walls, curves, columns)
    range_[~((range_ > begin + TOUCHING * reach) & (range_ <= reach))] = np.inf
    if not len(range_):
        return
    nearest, distance = range_.argmin(axis=0), range_.min(axis=0)
    for number in np.unique(nearest[np.isfinite(distance)]):
        hit = np.flatnonzero((nearest == number) & np.isfinite(distance))
        # Only neighbouring columns make one mirror: a wall with another one in front of its middle is seen in parts.
        for part in np.split(hit, np.flatnonzero(np.diff(columns[hit]) > 1) + 1):
            if part.size < FEWEST_DIRECTIONS:
                continue
            if number >= len(walls):
                part = part[[0, part.size // 2, -1]]
                found.append(view.points(distance[part], columns[part]))
                continue
            wall = walls[number]
            found.append(_visible(view, wall, columns[part[[0, -1]]], distance[part[[0, -1]]]))
            if left > 1:
                normal = segment_normal(*wall)
                seen, bent = reflect(walls, wall[0], normal), reflect(curves, wall[0], normal)
                seen[number] = wall
                _follow(view, seen, bent, columns[part], distance[part], left - 1, found)


def _met(view: ImageView, walls: Array, curves: Array, columns: Index) -> Array:
    """Ranges [m] at which lines of sight meet walls and circles, (walls + 2 circles, m); infinite where they do not.

    After the walls follow the near and the far side of each circle that holds any of the curves.
    """
    sight = view.sight[columns]
    rows = []
    for wall in walls:  # the lines of sight have unit length
        range_, along = crossing(view.radar, view.radar + sight, *wall)
        rows.append(np.where((along >= 0.0) & (along <= 1.0), range_, np.inf))
    for arcs in _circles(curves):
        center = arcs[0].center
        for range_ in circle_crossings(view.radar - center, sight, arcs[0].radius):
            offset = view.radar + range_[:, None] * sight - center
            angle = np.arctan2(offset[:, 1], offset[:, 0])
            on_one = [(angle - arc.first) * np.sign(arc.turn) % (2.0 * np.pi) <= abs(arc.turn) for arc in arcs]
            rows.append(np.where(np.any(on_one, axis=0), range_, np.inf))
    return np.array(rows).reshape(-1, columns.size)


def _circles(curves: Array) -> list[list[Arc]]:
    """The arcs (c, 3, 2) [m] of each circle that holds any."""
    circles: list[list[Arc]] = []
    for arc in (Arc.through(*curve) for curve in curves):
        for arcs in circles:
            most = TOUCHING * arc.radius
            if np.linalg.norm(arcs[0].center - arc.center) <= most and abs(arcs[0].radius - arc.radius) <= most:
                arcs.append(arc)
                break
        else:
            circles.append([arc])
    return circles


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
