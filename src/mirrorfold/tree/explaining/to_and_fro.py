"""Echoes of waves that went to and fro between an object and a wall beside it.

An object near a wall sends a part of the wave to that wall, along the wall's normal. The wall sends it back to the same
place of the object, and this place to the radar. For a place at range r0 and the distance d away from the wall, an echo
stands in the same direction at r0 + d, behind the object, and after a second turn another at r0 + 2 d. If the object is
smooth, all turns are glints, and the first echo is as bright as the object's own face: its brightness does not
distinguish it from the echo of another object.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array, Chain, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS, in_image, square_distances, true_ends
from mirrorfold.tree.grouping import object_numbers
from mirrorfold.tree.lines_of_sight import ROOT, LinesOfSight

TO_AND_FRO = "went to and fro between an object and a wall"

RESOLVED_CELLS = 1.0
"""Least distance, in range cells, of a place from the wall, and of an echo behind that place: nearer ones are not
resolved."""

BRIGHTER_DB = 6.0, -10.0
"""Largest level of an echo over the brightest echo of the object before it, after one turn and after two. A turn does
not make an echo brighter, but speckle may. The vertex of a corner, a true object that stands at such a place, is at
least 16 dB brighter than the edges before it."""


def to_and_fro(found: Found, view: ImageView) -> dict[Chain, Mask]:
    """Which object echoes of each chain of mirrors went to and fro between a known object and a known wall, (n,) each.

    The known object may be seen by way of other mirrors than the echo. Curved mirrors and walls are not tested.

    Parameters
    ----------
    found : Found
    view : ImageView
    """
    sight, by_chain, folds = found.sight, found.tree.mirrors_by_chain(), found.tree.folds()
    objects = {node.chain: node.objects for node in found.tree.walk()}
    marks = {chain: np.zeros(len(echoes), dtype=bool) for chain, echoes in objects.items()}

    stands = np.concatenate([folds[chain](echoes.position) for chain, echoes in objects.items()])
    level = np.concatenate([_brightest(echoes, view) for echoes in objects.values()])
    flat = {chain: way for chain, way in by_chain.items() if not any(mirror.curved for mirror in way)}
    walls = [true_ends(way) for way in flat.values() if way]
    number = {(): ROOT} | {chain: index for index, chain in enumerate(sight.chain) if chain}
    for chain, way in flat.items():
        place, later, behind = _behind(objects[chain], stands, way, sight, number[chain])
        for wall in walls:
            away, beyond = square_distances(stands[place], wall)
            met = (beyond <= view.cell(objects[chain].range[later])) & (away > RESOLVED_CELLS * view.range_cell)
            for turn, brighter in enumerate(BRIGHTER_DB, 1):
                told = met & (np.abs(turn * away - behind) <= EXPECTED_CELLS * view.range_cell)
                told &= objects[chain].amplitude[later] <= ratio_of(brighter) * level[place]
                marks[chain][later[told]] = True
    return marks


def _behind(
    echoes: Echoes, stands: Array, way: Sequence[Mirror], sight: LinesOfSight, index: int
) -> tuple[Array, Array, Array]:
    """Pairs of a true place among `stands` (n, 2) [m] and an echo behind it, (pairs,) each, and how far behind it [m].

    The place appears in the image by way of the mirrors `way`, the last of which has the number `index`, in a direction
    whose beam also holds the echo.
    """
    view, seen = sight.view, in_image(way, stands)
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
    kept = behind > RESOLVED_CELLS * view.range_cell
    return place[kept], later[kept], behind[kept]


def _brightest(echoes: Echoes, view: ImageView) -> Array:
    """Amplitude of the brightest echo of each echo's own object, of those before it or unresolved from it, (n,)."""
    level = echoes.amplitude.copy()
    of_object = object_numbers(view, echoes.range, echoes.direction) if len(echoes) else np.empty(0, dtype=np.intp)
    for number in np.unique(of_object):
        own = np.flatnonzero(of_object == number)
        own = own[np.argsort(echoes.range[own])]
        last = np.searchsorted(echoes.range[own], echoes.range[own] + RESOLVED_CELLS * view.range_cell, "right")
        level[own] = np.maximum.accumulate(echoes.amplitude[own])[last - 1]
    return level
