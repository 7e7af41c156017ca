"""Chains of mirrors with arcs among them, and the paths over them.

An arc counts as two mirrors: its outer side, which spreads the waves, and its inner side, which may focus them. To find
the paths to a point, a fan of rays is traced over the whole chain from some of the antennas. Where the point lies
between two neighbouring rays there is a path. Newton's method then makes the path exact for every antenna (`fermat`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry, cross2, segment_normal
from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array, Complex
from mirrorfold.errors import InputError
from mirrorfold.simulation.rays.fermat import (
    APERTURE,
    CAUSTICS,
    END_COSINE,
    FACTS,
    FIRST,
    FOLD,
    LENGTH,
    M00,
    M01,
    M10,
    M11,
    RADIUS,
    SIDE,
    SPAN,
    SPREADING,
    X,
    Y,
    starts,
    trace_points,
)
from mirrorfold.simulation.rays.outline import Outline
from mirrorfold.simulation.rays.paths import ChainPaths, Points

FAN = 128
"""Number of rays of a fan over a whole arc."""

PROLONGED = 0.05
"""Share of its span by which an arc is prolonged at either end in fans, so that the outermost rays have neighbours."""

NARROW = 33
"""Number of rays over the part of an arc from which rays meet the next arc."""

FINER = 4
"""Each edge of that part is narrowed down as often to one of 32 steps: to a millionth of the step between two rays."""

APART = 32
"""Fans are cast from every 32nd antenna: the places at which neighbouring antennas, half a wavelength apart, see a
mirror differ by little, so that Newton's method follows the paths from antenna to antenna."""

MOST_PATHS = 4
"""Largest number of paths over one chain between an antenna and a point."""

AIRY = 1.094
"""Where two paths merge at a caustic, their sum is Airy's integral at zero: each contributes ``2 Gamma(4/3) cos(pi/6) /
sqrt(2)``, this factor, times ``(6 / (k |L'''|))^(1/3)``, with the third derivative L''' of the path length."""

MirrorSide = tuple[int, int]
"""A mirror: its number among the obstacles of an `Outline`, and its side: 0 flat, +1 outer, -1 inner side of an arc."""


@dataclass(frozen=True, eq=False)
class CurvedPaths(ChainPaths):
    """The paths over one chain with arcs.

    Attributes
    ----------
    spreading : (paths,) array [m]
        Width ``|q|`` of the pencil of rays at the point, per radian at the antenna.
    caustics : (paths,) array
        Number of caustics on each path.
    aperture, fold : (paths,) arrays, [m^(2/3)]
        Properties of the arcs that limit the field at a caustic, see `FACTS` in `fermat`.
    """

    spreading: Array
    caustics: Array
    aperture: Array
    fold: Array

    def spread(self, wavelength: Array) -> Complex:
        """Complex amplitude at wavelengths (f, 1) [m], with the phase gained at caustics, (f, paths).

        It is ``1 / sqrt(|q|)`` by geometrical optics, which diverges at a caustic. It is limited to the least of the
        amplitudes that the arcs return where they add up in phase: an arc over its whole length, or, where two paths
        merge, over the length that Airy's integral gives, whichever is shorter. Thus it is the same in both directions.
        """
        at_fold = self.fold * (np.pi / (3.0 * wavelength)) ** (2.0 / 3.0) / AIRY**2
        least = wavelength * np.maximum(self.aperture, at_fold)
        return np.asarray(self.share * 1j**self.caustics / np.sqrt(np.maximum(self.spreading, least)))


@dataclass(frozen=True, eq=False)
class CurvedChain:
    """Mirrors in the order in which a ray from the antenna meets them, at least one of them an arc.

    Attributes
    ----------
    mirrors_and_sides : tuple of MirrorSide
    antennas : (n, 2) array [m]
    outline : Outline
    """

    mirrors_and_sides: tuple[MirrorSide, ...]
    antennas: Array
    outline: Outline

    @property
    def facets(self) -> tuple[int, ...]:
        """Numbers of the mirrors among the obstacles of the outline."""
        return tuple(number for number, _ in self.mirrors_and_sides)

    @property
    def count(self) -> int:
        """Number of antennas."""
        return len(self.antennas)

    def of(self, antennas: NDArray[np.intp]) -> CurvedChain:
        """The same chain from some of the antennas only."""
        return replace(self, antennas=self.antennas[antennas])

    @cached_property
    def unfolding(
        self,
    ) -> tuple[Isometry, Array, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array, Array]:
        """The isometry that unfolds the space behind the last mirror, and the mirrors as the kernels take them.

        After the isometry: the table of arcs; `arc_slot`, the places of the arcs in the chain; `leg` and `flat_slot`,
        the legs on which the flat mirrors are crossed and their places in the chain; `unfolded` and `flat`, the ends of
        the flat mirrors, unfolded and true, (f, 2, 2) [m].
        """
        flat_count = len(self.outline.facets)
        unfold = Isometry.identity()
        arcs: list[list[float]] = []
        arc_slot, leg, flat_slot, unfolded, flat = [], [], [], [], []
        for slot, (number, side) in enumerate(self.mirrors_and_sides):
            if number < flat_count:
                ends = self.outline.facets[number]
                leg.append(len(arcs))
                flat_slot.append(slot)
                unfolded.append(unfold(ends))
                flat.append(ends)
                unfold = unfold @ Isometry.reflection(ends[0], segment_normal(*ends))
            else:
                x, y, radius, first, span = self.outline.arcs[number - flat_count]
                center = unfold(np.array([x, y]))
                arcs.append([*center, *unfold.linear.ravel(), radius, first, span, side, x, y])
                arc_slot.append(slot)
        index = [np.array(some, dtype=np.int64) for some in (arc_slot, leg, flat_slot)]
        return (unfold, np.array(arcs), *index, np.array(unfolded).reshape(-1, 2, 2), np.array(flat).reshape(-1, 2, 2))  # type: ignore[return-value]


@njit(makes_arrays=True, error_model="numpy", nogil=True)
def _trace_rays(antenna: Array, arcs: Array, angle: Array) -> tuple[Array, Array, Array]:
    """Trace rays from an antenna to the angles (m,) on the first arc, and on over all k arcs.

    Returns the angles (m, k) at which each ray meets the arcs, NaN from the first arc that it misses on, and the place
    and the reflected direction (m, 2) at the last arc that it meets.
    """
    angles = np.full((angle.size, arcs.shape[0]), np.nan)
    place, heading = np.empty((angle.size, 2)), np.empty((angle.size, 2))
    for ray in range(angle.size):
        x, y, dx, dy, at = antenna[0], antenna[1], np.nan, np.nan, angle[ray]
        for level in range(arcs.shape[0]):
            arc = arcs[level]
            radius, side = arc[RADIUS], arc[SIDE]
            if level > 0:
                ox, oy = x - arc[X], y - arc[Y]
                # The root is NaN for a ray that misses the whole circle.
                distance = -(ox * dx + oy * dy) - side * np.sqrt(radius * radius - (dx * oy - dy * ox) ** 2)
                ox, oy = ox + distance * dx, oy + distance * dy
                at = np.arctan2(ox * arc[M01] + oy * arc[M11], ox * arc[M00] + oy * arc[M10])
                longer = (1.0 + 2.0 * PROLONGED) * arc[SPAN]
                if not distance > 0.0 or (at - arc[FIRST] + PROLONGED * arc[SPAN]) % (2.0 * np.pi) > longer:
                    break
            cos, sin = np.cos(at), np.sin(at)
            nx, ny = arc[M00] * cos + arc[M01] * sin, arc[M10] * cos + arc[M11] * sin
            wx, wy = arc[X] + radius * nx - x, arc[Y] + radius * ny - y
            way = np.sqrt(wx * wx + wy * wy)
            wx, wy = wx / way, wy / way
            incidence = wx * nx + wy * ny
            if not side * incidence < 0.0:
                break
            angles[ray, level] = at
            x, y = arc[X] + radius * nx, arc[Y] + radius * ny
            dx, dy = wx - 2.0 * incidence * nx, wy - 2.0 * incidence * ny
        place[ray, 0], place[ray, 1], heading[ray, 0], heading[ray, 1] = x, y, dx, dy
    return angles, place, heading


def _fan(antenna: Array, arcs: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]] | None:
    """A fan of rays from an antenna over all k arcs; None if no ray reaches the last arc.

    Returns the angles (m, k), the places on the last arc and the directions behind it (m, 2), and the mask (m,) of rays
    whose neighbour is the next ray. For each arc after the first, the fan is narrowed to the parts of the first arc
    from which rays meet that arc, in finer steps.
    """
    intervals = _lit_intervals(antenna, arcs[0])
    for level in range(1, len(arcs)):
        intervals = _intervals_meeting(antenna, arcs, level, intervals)
    angle, paired = _all_of(intervals)
    angles, place, heading = _trace_rays(antenna, arcs, angle)
    through = np.isfinite(angles[:, -1])
    paired[:-1] &= through[1:]
    return (angles[through], place[through], heading[through], paired[through]) if through.any() else None


def _all_of(intervals: list[Array]) -> tuple[Array, NDArray[np.bool_]]:
    """The angles of all intervals, and a mask of those followed by another angle of the same interval."""
    paired = [np.arange(1, interval.size + 1) < interval.size for interval in intervals]
    return np.concatenate([np.empty(0), *intervals]), np.concatenate([np.empty(0, dtype=bool), *paired])


def _dense_at_ends(begin: float, end: float, count: int) -> Array:
    """Angles from `begin` to `end`, denser at both ends, where rays may graze an arc and change direction quickly."""
    return np.asarray(begin + 0.5 * (end - begin) * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, count))))


def _lit_intervals(antenna: Array, arc: Array) -> list[Array]:
    """Intervals of the angle on an arc, each as sampled angles, in which rays from an antenna meet the reflecting side.

    An arc that is no whole circle is prolonged by `PROLONGED` of its span at either end.
    """
    offset, linear, (radius, first, span, side) = antenna - arc[:2], arc[2:6].reshape(2, 2), arc[6:10]
    margin = 0.0 if span >= 2.0 * np.pi else PROLONGED * span
    begin, end = first - margin, first + span + margin
    away = float(np.linalg.norm(offset))
    if side < 0.0:
        return [_dense_at_ends(begin, end, FAN)]
    if away <= radius:
        return []
    towards = offset @ linear
    middle, half = float(np.arctan2(towards[1], towards[0])), float(np.arccos(radius / away))
    turns = middle + 2.0 * np.pi * np.arange(-2, 3)
    intervals = [(max(begin, turn - half), min(end, turn + half)) for turn in turns]
    return [_dense_at_ends(low, high, FAN) for low, high in intervals if high > low]


def _intervals_meeting(antenna: Array, arcs: Array, level: int, intervals: list[Array]) -> list[Array]:
    """The parts of intervals of the angle on the first arc from which rays meet arc number `level`."""
    center, radius = arcs[level, :2], arcs[level, 6]
    angle, paired = _all_of(intervals)
    angles, place, heading = _trace_rays(antenna, arcs[:level], angle)
    offset = center - place
    aside = cross2(heading, offset) / radius
    along = np.sum(heading * offset, axis=1)
    ahead = np.isfinite(angles[:, -1]) & (along > -radius)
    # The outer side is met from outside only: not from where the arc before runs within the circle.
    outside = (arcs[level, SIDE] < 0.0) | ((along > 0.0) & (np.linalg.norm(offset, axis=1) > radius))
    pairs = np.flatnonzero(ahead[:-1] & ahead[1:] & (outside[:-1] | outside[1:]) & paired[:-1])
    low, high = aside[pairs], aside[pairs + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        # Fractions between two rays at which the ray's distance from the center equals the radius, either side.
        edges = np.sort(np.clip((np.array([[-1.0], [1.0]]) - low) / (high - low), 0.0, 1.0), axis=0)
    edges = np.where(np.abs(high - low) > 0.0, edges, np.where(np.abs(low) < 1.0, [[0.0], [1.0]], 0.0))
    hit = edges[1] > edges[0]
    pairs, (begin, end) = pairs[hit], edges[:, hit]
    if not pairs.size:
        return []
    step = angle[pairs + 1] - angle[pairs]
    begin, end = angle[pairs] + begin * step, angle[pairs] + end * step
    breaks = np.flatnonzero((np.diff(pairs) > 1) | (begin[1:] > end[:-1] + 1e-3 * step[1:])) + 1
    # Between two rays the distance is no linear function: half of the width is added at either end, up to these rays.
    low, high = begin[np.append(0, breaks)], end[np.append(breaks - 1, -1)]
    margin = 0.5 * (high - low)
    low = np.maximum(low - margin, angle[pairs[np.append(0, breaks)]])
    high = np.minimum(high + margin, angle[pairs[np.append(breaks - 1, -1)] + 1])
    intervals = [_dense_at_ends(*ends, NARROW) for ends in zip(low, high, strict=True)]
    return _up_to_edges(antenna, arcs[: level + 1], intervals)


def _up_to_edges(antenna: Array, arcs: Array, intervals: list[Array]) -> list[Array]:
    """The parts of intervals of the angle on the first arc from which rays reach the last arc, up to their very edges.

    The direction of a ray that grazes an arc changes as the square root of the distance from the edge: between a rough
    edge and the true one, the paths of a wide range of directions would be missing.
    """
    angle, paired = _all_of(intervals)
    through = np.isfinite(_trace_rays(antenna, arcs, angle)[0][:, -1])
    change = np.flatnonzero((through[:-1] != through[1:]) & paired[:-1])
    on, off = angle[change + ~through[change]], angle[change + through[change]]
    for _ in range(FINER if change.size else 0):
        between = on + np.linspace(0.0, 1.0, NARROW)[:, None] * (off - on)
        reach = np.isfinite(_trace_rays(antenna, arcs, between.ravel())[0][:, -1]).reshape(between.shape)
        last = np.argmin(reach, axis=0) - 1
        on, off = np.take_along_axis(between, np.stack([last, last + 1]), axis=0)
    # An interval that begins, or ends, with a ray that reaches the arc keeps this end.
    outermost = ~paired | np.append(True, ~paired[:-1])
    ends = np.sort(np.concatenate([angle[through & outermost], on]))
    return [_dense_at_ends(begin, end, NARROW) for begin, end in ends.reshape(-1, 2)]


def trace_curved(chain: CurvedChain, points: Points) -> CurvedPaths:
    """All paths from the antennas over a chain with arcs to the points; sorted by antenna, then by point.

    Parameters
    ----------
    chain : CurvedChain
    points : Points

    Raises
    ------
    InputError
        If an arc focuses all rays of an antenna onto one point, which no single path then leads to.
    """
    unfold, arcs, *index, unfolded, flat = chain.unfolding
    target = unfold(points.position)
    fans = np.unique(np.append(np.arange(0, chain.count, APART), chain.count - 1))
    start = np.zeros((fans.size, len(target), MOST_PATHS, len(arcs)))
    count = np.zeros((fans.size, len(target)), dtype=np.int64)
    for i, antenna in enumerate(chain.antennas[fans]):
        fan = _fan(antenna, arcs)
        if fan is not None:
            starts(*fan, target, start[i], count[i])
    used = np.flatnonzero(count.any(axis=0))
    most = 2 * int(count.max(initial=0)) if fans.size > 1 else int(count.max(initial=0))
    shape = (chain.count, used.size, min(most, MOST_PATHS))
    seen = np.zeros(shape, dtype=bool)
    cosine, facts = np.empty((*shape, len(chain.mirrors_and_sides))), np.empty((*shape, FACTS))
    if used.size:
        in_shares(
            trace_points,
            used.size,
            chain.antennas,
            fans,
            *(np.ascontiguousarray(table[:, used]) for table in (start, count)),
            points.position[used],
            points.normal[used],
            points.enclosing_face[used],
            target[used],
            arcs,
            *index,
            unfolded,
            flat,
            chain.outline.facets,
            chain.outline.arcs,
            seen,
            cosine,
            facts,
        )
    antenna, column, _ = found = np.nonzero(seen)
    about = facts[found].T
    gathered = np.flatnonzero(np.isnan(about[LENGTH]))
    if gathered.size:
        x, y = chain.antennas[antenna[gathered[0]]]
        raise InputError(
            f"array: the antenna at ({x:g}, {y:g}) m stands where a curved surface gathers all of its rays, which do "
            "not tell the field there; move one of the two, or use the solver 'fullwave'"
        )
    return CurvedPaths(
        antenna=antenna,
        point=used[column],
        length=about[LENGTH],
        share=np.ones(antenna.size, np.complex64),
        cosine=cosine[found].T.copy(),
        end_cosine=about[END_COSINE],
        spreading=about[SPREADING],
        caustics=about[CAUSTICS],
        aperture=about[APERTURE],
        fold=about[FOLD],
    )
