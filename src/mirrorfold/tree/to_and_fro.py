"""Echoes that have gone to and fro between a thing and a wall beside it.

A thing near a wall sends a part of the wave on to that wall, square to it, so that the wall sends it back to the same
place of the thing, and that one to the radar. By a place at range r0, which is the distance d away from the wall, the
echo stands at r0 + d in the same direction, behind the thing; after a second turn another stands at r0 + 2 d. Where the
thing is smooth, all turns are glints, and the first echo is as bright as what the thing shows of its own face:
brightness does not tell it from what stands there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.geometry import segment_normal, signed_distance, unit
from mirrorfold.common.types import Array, Chain, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror, fold_of
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.lines_of_sight import ROOT, LinesOfSight
from mirrorfold.tree.things import things

TO_AND_FRO = "went to and fro between a thing and a wall"

CELLS = 0.75
"""How far an echo may be, in range cells, from where it is expected: it is seen half a cell off, and walls are, too."""

APART_CELLS = 1.0
"""Walls closer to a place, in range cells, are not told from it, nor is an echo from one that stands no farther in
front of it."""

BRIGHTER_DB = 6.0, -10.0
"""How much brighter an echo may be than the brightest of the thing before it, after one turn and after two. A turn does
not make it brighter, but speckle may, and what is not flat spreads it: the vertex of a corner, which stands there, is
brighter than the edges before it by 16 dB and more."""


def to_and_fro(found: Found, view: View) -> dict[Chain, Mask]:
    """Which objects of each chain of mirrors went to and fro between a known thing and a known wall, (n,) each.

    The thing may be known by way of other mirrors, and show this echo alone to the mirror that is asked. In a volume
    nothing is said, nor of curved mirrors and walls.

    Parameters
    ----------
    found : Found
    view : View
    """
    sight, ways, folds = found.sight, found.tree.ways(), found.tree.folds()
    objects = {node.chain: node.objects for node in found.tree.walk()}
    marks = {chain: np.zeros(len(echoes), dtype=bool) for chain, echoes in objects.items()}
    if not isinstance(view, ImageView):
        return marks
    stands = np.concatenate([folds[chain](echoes.position) for chain, echoes in objects.items()])
    level = np.concatenate([_brightest(echoes, view) for echoes in objects.values()])
    flat = {chain: way for chain, way in ways.items() if not any(mirror.curved for mirror in way)}
    walls = [fold_of(way[:-1], view.dimensions)(way[-1].ends) for way in flat.values() if way]
    number = {(): ROOT} | {chain: index for index, chain in enumerate(sight.chain) if chain}
    for chain, way in flat.items():
        place, later, behind = _behind(objects[chain], stands, way, sight, number[chain])
        for start, end in walls:
            away = np.abs(signed_distance(stands[place], start, segment_normal(start, end)))
            along = np.abs((stands[place] - 0.5 * (start + end)) @ unit(end - start))
            reach = 0.5 * np.linalg.norm(end - start) + view.cell(objects[chain].range[later])
            met = (along <= reach) & (away > APART_CELLS * view.range_cell)
            for turn, brighter in enumerate(BRIGHTER_DB, 1):
                told = met & (np.abs(turn * away - behind) <= CELLS * view.range_cell)
                told &= objects[chain].amplitude[later] <= 10.0 ** (brighter / 20.0) * level[place]
                marks[chain][later[told]] = True
    return marks


def _behind(
    echoes: Echoes, stands: Array, way: Sequence[Mirror], sight: LinesOfSight, index: int
) -> tuple[Array, Array, Array]:
    """Pairs of a place of `stands` (n, 2) [m] and an echo behind it, (pairs,) each, and how far behind it [m].

    Mirrors, of which that number is the last, show the place in a direction that its beam shares with the echo.
    """
    view, seen = sight.view, stands
    for mirror in way:
        seen = mirror.reflection.inverse(seen)
    range_, direction, inside = view.locate(seen)
    shown = np.flatnonzero(inside)
    shown = shown[sight.seen_through(range_[shown], direction[shown]) == index]
    row, covered = view.within(seen[shown], view.covered_angle)
    order = np.argsort(echoes.direction)
    first, last = (np.searchsorted(echoes.direction, covered, side, order) for side in ("left", "right"))
    count = last - first
    place = np.repeat(shown[row], count)
    later = order[np.arange(count.sum()) + np.repeat(last - np.cumsum(count), count)]
    behind = echoes.range[later] - range_[place]
    kept = behind > APART_CELLS * view.range_cell
    return place[kept], later[kept], behind[kept]


def _brightest(echoes: Echoes, view: ImageView) -> Array:
    """Amplitude of the brightest of each echo's thing that stands no farther behind it than is told apart, (n,)."""
    level = echoes.amplitude.copy()
    thing = things(view, echoes.range, echoes.direction) if len(echoes) else np.empty(0, dtype=np.intp)
    for number in np.unique(thing):
        own = np.flatnonzero(thing == number)
        own = own[np.argsort(echoes.range[own])]
        last = np.searchsorted(echoes.range[own], echoes.range[own] + APART_CELLS * view.range_cell, "right")
        level[own] = np.maximum.accumulate(echoes.amplitude[own])[last - 1]
    return level
