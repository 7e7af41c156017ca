"""Circular arcs given by three points, as in tables of mirrors, and outlines of curved mirrors for drawing."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mirrorfold.common.geometry import cross2, unit
from mirrorfold.common.types import Array

POINTS = 49
"""Number of points of an arc that is drawn: the chords of a half circle then span less than four degrees each."""

STRAIGHT = 1e-6
"""Largest bulge, as a share of the chord, at which three points count as lying on a line."""


def circle_through(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Center (n, 2) and radius (n,) of the circles through three points each; infinite where these lie on a line."""
    b, c = b - a, c - a
    with np.errstate(divide="ignore", invalid="ignore"):
        double = 2.0 * cross2(b, c)
        bb, cc = np.sum(b * b, axis=1), np.sum(c * c, axis=1)
        middle = np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1) / double[:, None]
    return a + middle, np.linalg.norm(middle, axis=1)


def in_line(start: Array, middle: Array, end: Array) -> bool:
    """Whether three points (2,) lie on a line, up to a bulge that no drawing shows."""
    chord = end - start
    return bool(abs(2.0 * cross2(middle - start, chord)) <= STRAIGHT * float(chord @ chord))


class Arc(NamedTuple):
    """The arc through three points: center (2,) and radius of its circle [m], polar angles of both ends [rad], and the
    angle [rad] by which it turns from the first end to the last, positive counter-clockwise.
    """

    center: Array
    radius: float
    first: float
    last: float
    turn: float

    @classmethod
    def through(cls, start: Array, middle: Array, end: Array) -> Arc:
        """The arc from start to end through the middle, (2,) [m] each; the three points must not be `in_line`."""
        (center,), (radius,) = circle_through(start[None], middle[None], end[None])
        first, half, last = (float(np.arctan2(*(point - center)[::-1])) for point in (start, middle, end))
        turn = (last - first) % (2.0 * np.pi)
        if (half - first) % (2.0 * np.pi) > turn:  # the arc through the middle turns the other way
            turn -= 2.0 * np.pi
        return cls(center, float(radius), first, last, turn)


def arc_through(start: Array, middle: Array, end: Array, count: int = POINTS) -> Array:
    """Points (count, 2) along the arc through three points (2,), or the two ends (2, 2) if these lie on a line."""
    if in_line(start, middle, end):
        return np.stack([start, end])
    arc = Arc.through(start, middle, end)
    angle = arc.first + arc.turn * np.linspace(0.0, 1.0, count)
    return arc.center + arc.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def as_three_points(places: Any) -> Any:
    """Given mirrors as three points each if there are both lines (two points) and arcs (three); otherwise unchanged.

    Malformed entries stay for `mirrorfold.detection.mirrors.known_mirrors.check_mirrors` to refuse.
    """
    try:
        mixed = {len(place) for place in places} == {2, 3}
    except TypeError:
        return places
    return [_with_middle(place) for place in places] if mixed else places


def _with_middle(place: Any) -> Any:
    """Both ends of a line with the middle between them; anything that is no line is returned unchanged."""
    try:
        (x0, y0), (x1, y1) = place
        return [[x0, y0], [0.5 * (x0 + x1), 0.5 * (y0 + y1)], [x1, y1]]
    except (TypeError, ValueError):
        return place


def mirror_places(mirrors: xr.Dataset, prefix: str = "") -> list[Array]:
    """The place of every mirror of a table in the floor plan, in the form in which users give mirrors.

    Parameters
    ----------
    mirrors : xarray.Dataset
        The group `mirrors` of a Reconstruction. If it has a column `curvature`, it has xm and ym, the middle of the
        face of each mirror.
    prefix : str
        "folded_" for the true places of the mirrors; empty for those in the unfolded image.

    Returns
    -------
    list of arrays [m]
        The two ends (2, 2) of a line; the start, middle and end (3, 2) of an arc.
    """
    ends = np.stack([mirrors[f"{prefix}{name}"].values for name in ("x0", "y0", "x1", "y1")], axis=-1).reshape(-1, 2, 2)
    if "curvature" not in mirrors or "corner_x" in mirrors:  # in space, the plan shows lines between outermost points
        return list(ends)
    middle = np.stack([mirrors[f"{prefix}{name}"].values for name in ("xm", "ym")], axis=-1)
    bent = mirrors["curvature"].values != 0.0
    return [
        np.stack([line[0], point, line[1]]) if curved else line
        for line, point, curved in zip(ends, middle, bent, strict=True)
    ]


def mirror_curves(mirrors: xr.Dataset, prefix: str = "") -> list[Array]:
    """Every mirror of a table as a polyline to draw: two ends (2, 2) [m], or points (n, 2) [m] along its arc."""
    return [place if len(place) == 2 else arc_through(*place) for place in mirror_places(mirrors, prefix)]


def mirror_outlines(mirrors: xr.Dataset, prefix: str = "") -> list[list[Array]]:
    """Every mirror of a volume's table as polylines (n, 3) [m] to draw.

    They are the closed outline of a plane or of a cylinder's face, and two arcs across the face of a sphere.
    """
    corners = np.stack([mirrors[f"{prefix}corner_{axis}"].values for axis in "xyz"], axis=-1)
    if "curvature" not in mirrors:
        return [[np.vstack([four, four[:1]])] for four in corners]
    middle, axis = (
        np.stack([mirrors[f"{prefix}{name.format(one)}"].values for one in "xyz"], axis=-1)
        for name in ("{}m", "axis_{}")
    )
    return [
        [np.vstack([four, four[:1]])] if not bent else _round_outline(four, m, a)
        for four, m, a, bent in zip(corners, middle, axis, mirrors["curvature"].values != 0.0, strict=True)
    ]


def _round_outline(corners: Array, middle: Array, axis: Array) -> list[Array]:
    """Polylines of a cylinder, of whose corners two lie at each end, or of a sphere, whose axis is zero."""
    if not axis.any():
        return [_arc_in_space(corners[i], middle, corners[i + 2]) for i in (0, 1)]
    low, high = (middle + ((corner - middle) @ axis) * axis for corner in corners[[0, 2]])
    rims = _arc_in_space(corners[0], low, corners[1]), _arc_in_space(corners[2], high, corners[3])
    return [np.vstack([*rims, corners[:1]])]


def _arc_in_space(start: Array, middle: Array, end: Array) -> Array:
    """Points (n, 3) along the arc through three points (3,), or the two ends if these lie on a line."""
    along = unit(end - start)
    aside = (middle - start) - ((middle - start) @ along) * along
    if np.linalg.norm(aside) <= STRAIGHT * np.linalg.norm(end - start):
        return np.stack([start, end])
    plane = np.stack([along, unit(aside)])
    return start + arc_through(np.zeros(2), plane @ (middle - start), plane @ (end - start)) @ plane
