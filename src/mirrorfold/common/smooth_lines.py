"""Curves in floor plans: drawings hold the circles and arcs of pillars and bays as polylines of many short pieces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mirrorfold.common.arcs import Arc, in_line
from mirrorfold.common.geometry import cross2
from mirrorfold.common.types import Array

LARGEST_TURN = np.radians(20.0)
"""Largest angle [rad] between neighbouring pieces of a curve: a wall that turns by more has an edge. Arcs of 7 cm
radius and more that are drawn to a millimetre turn by less."""

FEWEST_PIECES = 4
"""Least number of pieces of a curve; three pieces with edges of equal angles are as often a bay window."""

LARGEST_BESIDE = 0.5
"""Largest distance of the vertices from the arc, over the largest distance between the arc and the chords: the arc is
then closer to the curve that was drawn than the pieces are."""

LONGEST_PIECE = 3.0
"""Largest length of a piece of a curve, over the median: a longer one is a wall beside a rounded corner. Through a long
wall and the first short pieces there is a circle of large radius. Programs that halve a curve until it is drawn well
make pieces twice as long as others."""


def straight_and_curved(line: Array) -> tuple[Array, Array]:
    """The straight pieces of a polyline (n, 2) [m], both ends each (pieces, 2, 2), and its arcs, three points each
    (arcs, 3, 2): the first, one near the middle, and the last.

    An arc is a row of pieces along a circle; of more than half a circle there are two.
    """
    line = line[np.append(True, np.linalg.norm(np.diff(line, axis=0), axis=1) > 0.0)]
    pieces = np.diff(line, axis=0)
    turn = np.arctan2(cross2(pieces[:-1], pieces[1:]), np.sum(pieces[:-1] * pieces[1:], axis=1))
    straight, arcs = np.ones(len(pieces), dtype=bool), []
    at = 0
    while at < len(turn) - FEWEST_PIECES + 2:
        last = _end_of_arc(line, turn, at)
        if last > at:
            cuts = [at, last] if np.abs(turn[at : last - 1]).sum() < np.pi else [at, (at + last) // 2, last]
            arcs += [line[[first, (first + end) // 2, end]] for first, end in pairwise(cuts)]
            straight[at:last] = False
        at = max(last, at + 1)
    return np.stack([line[:-1], line[1:]], axis=1)[straight], np.array(arcs).reshape(-1, 3, 2)


def _end_of_arc(line: Array, turn: Array, first: int) -> int:
    """Number of the last vertex, from number `first` on, that lies with all vertices between on one arc."""
    bends = turn[first:] * np.sign(turn[first])
    smooth = (bends > 0.0) & (bends <= LARGEST_TURN) & (np.cumsum(bends) < 2.0 * np.pi)
    pieces = 1 + (len(smooth) if smooth.all() else int(np.argmin(smooth)))
    end = first
    for last in range(first + FEWEST_PIECES, first + pieces + 1):
        if not _on_circle(line[first : last + 1]):
            break
        end = last
    return end


def _on_circle(points: Array) -> bool:
    """Whether the vertices (n, 2) [m] lie on one circle, with short chords between them."""
    last = len(points) - 1
    three = points[[0, last // 2, last - 1 if np.array_equal(points[0], points[last]) else last]]
    if in_line(*three):
        return False
    circle = Arc.through(*three)
    chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if chord.max() > min(2.0 * circle.radius * np.sin(0.5 * LARGEST_TURN), LONGEST_PIECE * np.median(chord)):
        return False
    sagitta = circle.radius - np.sqrt(circle.radius**2 - 0.25 * chord.max() ** 2)
    beside = np.abs(np.linalg.norm(points - circle.center, axis=1) - circle.radius)
    return bool(beside.max() <= LARGEST_BESIDE * sagitta)
