"""Echoes that would stand behind a known wall, where no wave comes.

A line of sight ends at the next wall that it meets: what the image shows farther on was seen by way of that wall, too.
Where that wall was found in the image as a mirror, such echoes are folded by it. But the image of a wall in another
mirror may be too faint to be found, where the wall is half hidden or meets the line of sight at a slant. If the wall is
known from elsewhere, its true place shows that the last leg of the echo's path would pass through it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from mirrorfold.common.types import ROOT, Array, Chain, Mask
from mirrorfold.detection import ArcMirror, Echoes, ImageView, LineMirror, Mirror, View, any_curved, fold_of
from mirrorfold.detection.finding import NEAREST
from mirrorfold.detection.mirrors.curved import growth_over
from mirrorfold.detection.search.lines import SHORT_CELLS, find_lines
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.true_walls import BEYOND
from mirrorfold.tree.lines_of_sight import LinesOfSight

BEHIND = "would stand behind a wall"

BEHIND_CELLS = 1.5
"""Only paths that begin and end more than this many resolution cells away from a wall pass through it: an echo closer
to the wall may be its own, and a mirror closer to it is the other leg of a corner."""

INSIDE_CELLS = 1.0
"""Paths that pass through a wall cross it at least this many resolution cells inside of its ends."""

SHORTEST_ROW_CELLS = 3.0
"""Rows hide what is behind them if they are longer than this, in resolution cells: at least one cell is then left
inside of both ends."""

HIDDEN_CELLS = 1.5
"""A wall ends if the radar sees the place this many resolution cells beyond its end. If objects hide that place, the
wall may go on."""


def prolonged_where_hidden(found: Found) -> dict[Chain, tuple[Mirror, ...]]:
    """`MirrorTree.mirrors_by_chain`, with straight mirrors prolonged as far as objects hide what is beyond."""
    sight, by_chain = found.sight, found.tree.mirrors_by_chain()
    for index, (*before, last) in sight.ways.items():
        if isinstance(last, LineMirror):
            first, end = (_hidden(last, side, sight, int(sight.parent[index])) for side in (-1.0, 1.0))
            by_chain[sight.chain[index]] = (*before, last.part(-first, last.length + end))
    return by_chain


def flat_objects(found: Found, view: ImageView) -> dict[Chain, tuple[Mirror, ...]]:
    """Straight rows of object echoes in line of sight, each in the form of a mirror, under a chain that no mirror has.

    A flat object that is too short for a mirror lets no wave pass, either. In a volume there are none.
    """
    objects = found.tree.objects
    shortest = SHORT_CELLS * float(view.cell(objects.range_up_to(NEAREST)))
    return {(-1 - i,): (row,) for i, row in enumerate(find_lines(objects, view, minimum_length=shortest))}


def _hidden(wall: LineMirror, side: float, sight: LinesOfSight, parent: int) -> float:
    """Length [m] by which a wall that is seen by way of `parent` may go on, hidden by objects, beyond its start (-1) or
    its end (1).
    """
    view = sight.view
    end = wall.center + 0.5 * side * wall.length * wall.direction
    cell = view.cell_at(end)
    steps = np.arange(HIDDEN_CELLS * cell, BEYOND * wall.length, 0.5 * cell)
    range_, direction, inside = view.locate(end + side * steps[:, None] * wall.direction)
    seen = inside & (sight.seen_through(range_ - view.range_cell, direction) == parent)
    seen &= sight.cover.clear(range_, direction, wall.strength)
    first = int(np.argmax(seen)) if seen.any() else len(seen)
    return float(steps[first - 1]) if first else 0.0


def behind_walls(echoes: Echoes, chain: Chain, by_chain: Mapping[Chain, tuple[Mirror, ...]], view: View) -> Mask:
    """Which of the echoes that are seen by way of a chain of mirrors would stand behind another known wall, (n,).

    `by_chain` holds the mirrors of each chain, as `prolonged_where_hidden` returns them. Not tested are curved walls,
    and echoes that a curved mirror shows by way of another.
    """
    way = by_chain[chain]
    if not len(echoes) or any_curved(way[:-1]):
        return np.zeros(len(echoes), dtype=bool)
    others = [other for name, other in by_chain.items() if name != chain]
    return met_by(others, *last_leg(echoes, way, view), view.cell(echoes.range), widened(echoes, way))


def behind_rows(objects: Echoes, rows: Sequence[Mirror], sight: LinesOfSight, view: ImageView) -> Mask:
    """Which objects in line of sight would stand behind curved rows that are no mirrors, (n,).

    Rows are unbroken and let no wave pass: echoes behind them are images of known objects, or multiple scattering.
    """
    behind = np.zeros(len(objects), dtype=bool)
    for row in rows:
        cell = view.cell_at(row.center)
        range_, direction, _ = view.locate(row.center[None])
        if not isinstance(row, ArcMirror) or row.length <= SHORTEST_ROW_CELLS * cell:
            continue
        if sight.seen_through(range_, direction) == ROOT:
            end = INSIDE_CELLS * cell
            crossing = row.part(end, row.length - end).crossing(view)[objects.direction]
            behind |= objects.range > crossing + view.object_depth(objects.range)
    return behind


def widened(echoes: Echoes, way: Sequence[Mirror]) -> Array:
    """Factor by which the last mirror of a chain, if it is curved, widens the cell at the end of a path, (n,)."""
    return np.maximum(growth_over(way, echoes.position).max(axis=1), 1.0)


def last_leg(echoes: Echoes, way: Sequence[Mirror], view: View) -> tuple[Array, Array]:
    """Begin and end of the last leg of the path to each echo, from the last mirror on, (n, d) [m] each.

    No mirror but the last may be curved.
    """
    leaves, sight = np.broadcast_to(view.radar, echoes.position.shape), echoes.position - view.radar
    if way:
        *before, last = way
        place, normal = last.facing(echoes.position)
        share = np.sum((place - view.radar) * normal, axis=1) / np.sum(sight * normal, axis=1)
        leaves = fold_of(before, view.dimensions)(view.radar + share[:, None] * sight)
    return leaves, fold_of(way, view.dimensions)(echoes.position)


def met_by(
    walls: Iterable[Sequence[Mirror]], leaves: Array, stands: Array, cell: Array, growth: Array | float = 1.0, *,
    surely: bool = True,
) -> Mask:  # fmt: skip
    """Whether straight paths from `leaves` to `stands`, (n, d) [m] each, meet a wall well before their end, (n,).

    Each wall is preceded by the mirrors by way of which it is seen; curved ones are not tested. `cell` (n,) [m] is the
    resolution cell at the end of each path, as flat mirrors show it, and `growth` (n,) the factor by which a curved
    mirror at its beginning widens it. Paths that may as well pass beside the wall, or begin or end at it, count as
    paths that do not meet it, or, if not only those count that `surely` do, as paths that do.
    """
    met = np.zeros(len(stands), dtype=bool)
    for way in walls:
        if way and not any_curved(way):
            met |= _met(way[-1], way[:-1], leaves, stands, cell, growth, 1.0 if surely else -1.0)
    return met


def _met(
    wall: Mirror, to_it: Sequence[Mirror], leaves: Array, stands: Array, cell: Array, growth: Array | float, side: float
) -> Mask:
    """Whether straight paths (n, d) [m] meet a wall, at its true place, well before their end, (n,).

    Those that come within the margins count as inside of them or, with `side` -1 instead of 1, as outside.
    """
    fold = fold_of(to_it, leaves.shape[1])
    center = fold(wall.center)
    normal, tangents = fold(wall.center + wall.normal) - center, fold(wall.center + wall.tangents) - center
    way = stands - leaves
    length = np.linalg.norm(way, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = ((center - leaves) @ normal) / (way @ normal)
        offset = leaves + share[:, None] * way - center
        met = np.minimum(share, (1.0 - share) / growth) * length > side * BEHIND_CELLS * cell
        width = cell * (1.0 + share * (growth - 1.0))
        for tangent, (first, last) in zip(tangents, wall.sides, strict=True):
            along = offset @ tangent
            met &= np.minimum(along - first, last - along) >= side * INSIDE_CELLS * width
    return met
