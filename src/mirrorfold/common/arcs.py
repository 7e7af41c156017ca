"""Arcs given by three points, as tables of mirrors hold them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mirrorfold.common.geometry import cross2, unit
from mirrorfold.common.types import Array

POINTS = 49
"""Points of an arc that is drawn: the chords of a half circle span less than four degrees each."""

STRAIGHT = 1e-6
"""Bulge, as a share of the chord, up to which three points lie on a line."""


def circle_through(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Middle (n, 2) and radius (n,) of the circles through three points each, infinite where they lie on a line."""
    b, c = b - a, c - a
    with np.errstate(divide="ignore", invalid="ignore"):
        double = 2.0 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
        bb, cc = np.sum(b * b, axis=1), np.sum(c * c, axis=1)
        middle = np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1) / double[:, None]
    return a + middle, np.linalg.norm(middle, axis=1)


def in_line(start: Array, middle: Array, end: Array) -> bool:
    """Whether three points (2,) lie on a line, as far as a drawing can tell."""
    chord = end - start
    return bool(abs(2.0 * cross2(middle - start, chord)) <= STRAIGHT * float(chord @ chord))


class Arc(NamedTuple):
    """The arc through three points: center (2,) and radius [m] of its circle, the angles [rad] of its ends, and how far
    it turns from the first to the last [rad], positive counter-clockwise.
    """

    center: Array
    radius: float
    first: float
    last: float
    turn: float

    @classmethod
    def through(cls, start: Array, middle: Array, end: Array) -> Arc:
        """The arc from start to end by way of the middle, (2,) [m] each, which are not `in_line`."""
        (center,), (radius,) = circle_through(start[None], middle[None], end[None])
        first, half, last = (float(np.arctan2(*(point - center)[::-1])) for point in (start, middle, end))
        turn = (last - first) % (2.0 * np.pi)
        if (half - first) % (2.0 * np.pi) > turn:  # the middle lies on the other way around
            turn -= 2.0 * np.pi
        return cls(center, float(radius), first, last, turn)


def arc_through(start: Array, middle: Array, end: Array, count: int = POINTS) -> Array:
    """Points (count, 2) along the arc through three points (2,), or the two ends (2, 2) if these lie on a line."""
    if in_line(start, middle, end):
        return np.stack([start, end])
    arc = Arc.through(start, middle, end)
    angle = arc.first + arc.turn * np.linspace(0.0, 1.0, count)
    return np.asarray(arc.center + arc.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def by_three(places: Any) -> Any:
    """Lines by three points, too, where some of the given mirrors are arcs; the mirrors as they are where none is.

    What else stands among them is left for `mirrorfold.detection.mirrors.known_mirrors.check_mirrors` to refuse.
    """
    try:
        mixed = {len(place) for place in places} == {2, 3}
    except TypeError:
        return places
    return [_with_middle(place) for place in places] if mixed else places


def _with_middle(place: Any) -> Any:
    """Both ends of a line, with their middle between them; what is no such line stays."""
    try:
        (x0, y0), (x1, y1) = place
        return [[x0, y0], [0.5 * (x0 + x1), 0.5 * (y0 + y1)], [x1, y1]]
    except (TypeError, ValueError):
        return place


def mirror_places(mirrors: xr.Dataset, prefix: str = "") -> list[Array]:
    """Every mirror of a table in the floor plan, as mirrors are given.

    Parameters
    ----------
    mirrors : xarray.Dataset
        The group `mirrors` of a Reconstruction. Where some have a `curvature`, all have xm and ym on the middle of
        the face.
    prefix : str
        "folded_" for their true places.

    Returns
    -------
    list of arrays [m]
        Of a line its two ends (2, 2), of an arc its start, the middle and its end (3, 2).
    """
    ends = np.stack([mirrors[f"{prefix}{name}"].values for name in ("x0", "y0", "x1", "y1")], axis=-1).reshape(-1, 2, 2)
    if "curvature" not in mirrors or "corner_x" in mirrors:  # of round mirrors in space the plan has the outermost
        return list(ends)
    middle = np.stack([mirrors[f"{prefix}{name}"].values for name in ("xm", "ym")], axis=-1)
    bent = mirrors["curvature"].values != 0.0
    return [
        np.stack([line[0], point, line[1]]) if curved else line
        for line, point, curved in zip(ends, middle, bent, strict=True)
    ]


def mirror_curves(mirrors: xr.Dataset, prefix: str = "") -> list[Array]:
    """Every mirror of a table, as of `mirror_places`, to be drawn: two ends (2, 2) [m], or points along its arc."""
    return [place if len(place) == 2 else arc_through(*place) for place in mirror_places(mirrors, prefix)]


def mirror_outlines(mirrors: xr.Dataset, prefix: str = "") -> list[list[Array]]:
    """Every mirror of a volume's table, to be drawn: polylines (n, 3) [m].

    A plane has its closed outline, a cylinder that of its face, and a sphere two arcs across its face.
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
    """That of a cylinder, of which two corners lie at each end, or of a sphere, of zero axis."""
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
    return np.asarray(start + arc_through(np.zeros(2), plane @ (middle - start), plane @ (end - start)) @ plane)
