"""Sequences of mirrors with arcs among them, and the paths over them.

An arc is two mirrors: the outer side, which spreads the waves, and the inner one, which may focus them. To find the
paths to a point, a fan of rays is cast over the whole sequence from some of the antennas; where the point lies between
two neighbouring rays there is a path, which Newton's method makes exact for every antenna (`fermat`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry, cross2, segment_normal
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.simulation.rays.fermat import (
    BEND,
    CAUSTICS,
    END_COSINE,
    EXTENT,
    FACTS,
    LEGS,
    LENGTH,
    SPREADING,
    starts,
    trace_points,
)
from mirrorfold.simulation.rays.outline import Outline
from mirrorfold.simulation.rays.paths import ChainPaths, Points

FAN = 128
"""Rays of a fan over a whole arc."""

NARROW = 33
"""Rays over the part of an arc from which the next one is met."""

APART = 32
"""A fan is cast from one in so many antennas: neighbours half a wavelength apart differ by some mm in where they see
a mirror, and Newton's method leads from one to the next."""

MOST = 4
"""Paths over one sequence between an antenna and a point, at most."""

FOLD = 1.094
"""Where two paths meet at a caustic, their sum is Airy's integral at zero: ``2 Gamma(4/3) cos(pi/6) / sqrt(2)`` each,
times ``(6 / (k |L'''|))^(1/3)``."""

Face = tuple[int, int]
"""A mirror: its number among the obstacles of an `Outline`, and its side, 0 if it is flat, +1 outer, -1 inner."""


@dataclass(frozen=True, eq=False)
class CurvedPaths(ChainPaths):
    """The paths over one sequence with arcs.

    Attributes
    ----------
    spreading : (paths,) array [m]
        Width of the pencil of rays for each radian at the antenna.
    caustics : (paths,) array
        How many of them lie on the way.
    legs, extent, bend : (paths,) arrays
        Of the last arc, see `fermat`: they limit the field at a caustic.
    """

    spreading: Array
    caustics: Array
    legs: Array
    extent: Array
    bend: Array

    def spread(self, wavelength: Array) -> Array:
        """Amplitude at wavelengths (f, 1) [m], with the phase gained at caustics, (f, paths).

        By geometrical optics ``1 / sqrt(|q|)``; but no more than a stretch of the last arc gives that adds up in phase:
        all of it, or at the meeting of two paths as much as Airy's integral says.
        """
        with np.errstate(divide="ignore"):
            zone = FOLD * np.cbrt(6.0 * wavelength / (2.0 * np.pi * self.bend))
        least = wavelength * self.legs / np.minimum(zone, self.extent) ** 2
        return np.asarray(self.share * 1j**self.caustics / np.sqrt(np.maximum(self.spreading, least)))


@dataclass(frozen=True, eq=False)
class CurvedChain:
    """Mirrors in the order in which a ray from the antenna meets them, at least one of them an arc.

    Attributes
    ----------
    faces : tuple of Face
    antennas : (n, 2) array [m]
    world : Outline
    """

    faces: tuple[Face, ...]
    antennas: Array
    world: Outline

    @property
    def facets(self) -> tuple[int, ...]:
        """The mirrors' numbers among the obstacles of the outline."""
        return tuple(number for number, _ in self.faces)

    @property
    def count(self) -> int:
        """Number of antennas."""
        return len(self.antennas)

    def of(self, antennas: NDArray[np.intp]) -> CurvedChain:
        """The same from some of the antennas."""
        return replace(self, antennas=self.antennas[antennas])

    @cached_property
    def unfolding(
        self,
    ) -> tuple[Isometry, Array, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array, Array]:
        """What the kernels need of the mirrors, and before it the map that unfolds all behind the last of them."""
        flat_count = len(self.world.facets)
        unfold = Isometry.identity()
        arcs: list[list[float]] = []
        arc_slot, leg, flat_slot, unfolded, flat = [], [], [], [], []
        for slot, (number, side) in enumerate(self.faces):
            if number < flat_count:
                ends = self.world.facets[number]
                leg.append(len(arcs))
                flat_slot.append(slot)
                unfolded.append(unfold(ends))
                flat.append(ends)
                unfold = unfold @ Isometry.reflection(ends[0], segment_normal(*ends))
            else:
                x, y, radius, first, span = self.world.arcs[number - flat_count]
                center = unfold(np.array([x, y]))
                arcs.append([*center, *unfold.linear.ravel(), radius, first, span, side, x, y])
                arc_slot.append(slot)
        index = [np.array(some, dtype=np.int64) for some in (arc_slot, leg, flat_slot)]
        return (unfold, np.array(arcs), *index, np.array(unfolded).reshape(-1, 2, 2), np.array(flat).reshape(-1, 2, 2))  # type: ignore[return-value]


def _shoot(antenna: Array, arcs: Array, angle: Array) -> tuple[Array, Array, Array]:
    """Rays from an antenna to angles (m,) on the first arc and on over all of them.

    Returns the angles (m, k), NaN from where a ray misses, and place and heading (m, 2) of the last one that is met.
    """
    angles = np.full((angle.size, len(arcs)), np.nan)
    place = np.tile(antenna, (angle.size, 1))
    heading = np.full((angle.size, 2), np.nan)
    on = np.ones(angle.size, dtype=bool)
    for level, row in enumerate(arcs):
        center, linear, (radius, first, span, side) = row[:2], row[2:6].reshape(2, 2), row[6:10]
        if level == 0:
            at = angle
        else:
            offset = place - center
            nearest = -np.sum(offset * heading, axis=1)
            with np.errstate(invalid="ignore"):
                half = np.sqrt(radius**2 - cross2(heading, offset) ** 2)
                distance = nearest - side * half
                on &= distance > 0.0
                met = (offset + distance[:, None] * heading) @ linear
                at = np.arctan2(met[:, 1], met[:, 0])
                # Some way beyond the ends, so that the last ray within has a neighbour.
                on &= (at - first + 0.05 * span) % (2.0 * np.pi) <= 1.1 * span
        normal = np.stack([np.cos(at), np.sin(at)], axis=1) @ linear.T
        reached = center + radius * normal
        with np.errstate(invalid="ignore", divide="ignore"):
            way = (reached - place) / np.linalg.norm(reached - place, axis=1)[:, None]
            on &= side * np.sum(way * normal, axis=1) < 0.0
        if not on.any():
            break
        angles[on, level] = at[on]
        place = np.where(on[:, None], reached, place)
        out = way - 2.0 * np.sum(way * normal, axis=1)[:, None] * normal
        heading = np.where(on[:, None], out, heading)
    return angles, place, heading


def _fan(antenna: Array, arcs: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]] | None:
    """A fan of rays over all arcs: angles (m, k), places and headings (m, 2), and which ray has the next as neighbour.

    The part of the first arc from which the next one is met is sought again and again, each time in finer steps. None
    where no ray gets through.
    """
    runs = _lit(antenna, arcs[0])
    for level in range(1, len(arcs)):
        runs = _meeting(antenna, arcs, level, runs)
        if not runs:
            return None
    parts = []
    for run in runs:
        angles, place, heading = _shoot(antenna, arcs, run)
        through = np.isfinite(angles[:, -1])
        joined = np.append(through[:-1] & through[1:], False)
        parts.append((angles[through], place[through], heading[through], joined[through]))
    angles, place, heading, joined = (np.concatenate(column) for column in zip(*parts, strict=True))
    return (angles, place, heading, joined) if len(place) else None


def _spread(begin: float, end: float, count: int) -> Array:
    """Angles from one to another, closer together at the ends, where rays may graze an arc and turn fast."""
    return np.asarray(begin + 0.5 * (end - begin) * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, count))))


def _lit(antenna: Array, arc: Array) -> list[Array]:
    """The angles of an arc, and some beyond its ends, at which rays from an antenna meet its side."""
    offset, linear, (radius, first, span, side) = antenna - arc[:2], arc[2:6].reshape(2, 2), arc[6:10]
    margin = 0.0 if span >= 2.0 * np.pi else 0.05 * span
    begin, end = first - margin, first + span + margin
    away = float(np.linalg.norm(offset))
    if side < 0.0:
        return [_spread(begin, end, FAN)]
    if away <= radius:
        return []
    towards = offset @ linear
    middle, half = float(np.arctan2(towards[1], towards[0])), float(np.arccos(radius / away))
    turns = middle + 2.0 * np.pi * np.arange(-2, 3)
    runs = [(max(begin, turn - half), min(end, turn + half)) for turn in turns]
    return [_spread(low, high, FAN) for low, high in runs if high > low]


def _meeting(antenna: Array, arcs: Array, level: int, runs: list[Array]) -> list[Array]:
    """The parts of runs of angles on the first arc from which rays meet the arc of that level."""
    center, radius = arcs[level, :2], arcs[level, 6]
    for _ in range(2):
        narrower = []
        for run in runs:
            angles, place, heading = _shoot(antenna, arcs[:level], run)
            offset = center - place
            aside = cross2(heading, offset) / radius
            ahead = (np.isfinite(angles[:, -1])) & (np.sum(heading * offset, axis=1) > -radius)
            pairs = np.flatnonzero(ahead[:-1] & ahead[1:])
            low, high = aside[pairs], aside[pairs + 1]
            with np.errstate(divide="ignore", invalid="ignore"):
                # Where, between two rays, the distance from the center passes the radius on either side.
                edges = np.sort(np.clip((np.array([[-1.0], [1.0]]) - low) / (high - low), 0.0, 1.0), axis=0)
            edges = np.where(np.abs(high - low) > 0.0, edges, np.where(np.abs(low) < 1.0, [[0.0], [1.0]], 0.0))
            hit = edges[1] > edges[0]
            pairs, (begin, end) = pairs[hit], edges[:, hit]
            if not pairs.size:
                continue
            step = run[pairs + 1] - run[pairs]
            begin, end = run[pairs] + begin * step, run[pairs] + end * step
            breaks = np.flatnonzero((np.diff(pairs) > 1) | (begin[1:] > end[:-1] + 1e-3 * step[1:])) + 1
            for some_begin, some_end in zip(np.split(begin, breaks), np.split(end, breaks), strict=True):
                narrower.append(_spread(some_begin[0], some_end[-1], NARROW))
        runs = narrower
    return runs


def trace_curved(chain: CurvedChain, points: Points) -> CurvedPaths:
    """All paths from the antennas over a sequence with arcs to the points; sorted by antenna, then by point.

    Parameters
    ----------
    chain : CurvedChain
    points : Points

    Raises
    ------
    InputError
        If all rays of an antenna meet at a point, so that no single one is the way there.
    """
    unfold, arcs, *index, unfolded, flat = chain.unfolding
    target = unfold(points.position)
    fans = np.unique(np.append(np.arange(0, chain.count, APART), chain.count - 1))
    start = np.zeros((fans.size, len(target), MOST, len(arcs)))
    count = np.zeros((fans.size, len(target)), dtype=np.int64)
    for i, antenna in enumerate(chain.antennas[fans]):
        fan = _fan(antenna, arcs)
        if fan is not None:
            starts(*fan, target, start[i], count[i])
    used = np.flatnonzero(count.any(axis=0))
    most = 2 * int(count.max(initial=0)) if fans.size > 1 else int(count.max(initial=0))
    shape = (chain.count, used.size, min(most, MOST))
    seen = np.zeros(shape, dtype=bool)
    cosine, facts = np.empty((*shape, len(chain.faces))), np.empty((*shape, FACTS))
    below = np.searchsorted(fans, np.arange(chain.count), side="right") - 1
    above = np.searchsorted(fans, np.arange(chain.count), side="left")
    if used.size:
        in_shares(
            trace_points,
            used.size,
            chain.antennas,
            below,
            above,
            start[:, used],
            count[:, used],
            points.position[used],
            points.normal[used],
            points.through[used],
            target[used],
            arcs,
            *index,
            unfolded,
            flat,
            chain.world.facets,
            chain.world.arcs,
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
        share=np.ones(antenna.size),
        cosine=cosine[found].T.copy(),
        end_cosine=about[END_COSINE],
        spreading=about[SPREADING],
        caustics=about[CAUSTICS],
        legs=about[LEGS],
        extent=about[EXTENT],
        bend=about[BEND],
    )
