"""Echoes of waves that went to and fro between an object and a wall or another object beside it.

An object near a wall sends a part of the wave to that wall, along the wall's normal. The wall sends it back to the same
place of the object, and this place to the radar. For a place at range r0 and the distance d away from the wall, an echo
stands in the same direction at r0 + d, behind the object, and after a second turn another at r0 + 2 d. If the object is
smooth, all turns are glints, and the first echo is as bright as the object's own face: its brightness does not
distinguish it from the echo of another object.

Two objects beside each other do the same: each has such an echo behind it, at r0 + d for the distance d of its place
from the nearest place of the other.

The wave turns where the normal of the object's face bisects the directions to the radar and to the wall. The face may
throw what it scatters otherwise aside there, and show no echo: so places between the echoes of a face count, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import cKDTree

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.statistics import consecutive
from mirrorfold.common.types import ROOT, Array, Chain, Index, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror, any_curved
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS, in_image, square_distances, true_ends
from mirrorfold.tree.grouping import connected, object_numbers
from mirrorfold.tree.lines_of_sight import LinesOfSight

TO_AND_FRO = "went to and fro between an object and a wall, or another object"

RESOLVED_CELLS = 1.0
"""Least distance, in range cells, of a place from the wall or the other object, and of an echo behind that place:
nearer ones are not resolved."""

GAP_CELLS = 3.0
"""Largest distance, in resolution cells, of neighbouring echoes of one face: a glint reaches one cell to either side,
and speckle tears a gap of one cell."""

BRIGHTER_DB = 6.0, -10.0
"""Largest level of an echo over the brightest echo of the object before it, after one turn at a wall and after two. A
turn does not make an echo brighter, but speckle may. The vertex of a corner, a true object that stands at such a place,
is at least 16 dB brighter than the edges before it."""

NEARER_CELLS = 1.5
"""Length, in range cells, by which an object may reach nearer to another than its echoes do: the side that it turns to
the other is often out of sight."""

BESIDE_CELLS = 5.0
"""Largest distance of two objects, in range cells: farther away, little of what one spreads meets the other."""

LOBE_CELLS = 1.5
"""Radius of the main lobe of a bright echo, in resolution cells: fainter echoes in it are a part of that one."""


def to_and_fro(found: Found, view: ImageView) -> dict[Chain, Mask]:
    """Which object echoes of each chain of mirrors went to and fro beside a known object, (n,) each.

    The known object may be seen by way of other mirrors than the echo. Curved mirrors and walls are not tested.
    """
    sight, nodes = found.sight, list(found.tree.walk())
    objects = {node.chain: node.objects for node in nodes}
    marks = {chain: np.zeros(len(echoes), dtype=bool) for chain, echoes in objects.items()}

    faces = {chain: _face(echoes, view) for chain, echoes in objects.items()}
    placed = {node.chain: node.fold(faces[node.chain][0]) for node in nodes}
    stands, level = np.concatenate(list(placed.values())), np.concatenate([level for _, level in faces.values()])
    true = {chain: placed[chain][: len(echoes)] for chain, echoes in objects.items()}
    others = _others(true, objects, view)
    flat = {node.chain: node.way for node in nodes if not any_curved(node.way)}
    walls = [true_ends(way) for way in flat.values() if way]
    number = {(): ROOT} | {chain: index for index, chain in enumerate(sight.chain) if chain}
    for chain, way in flat.items():
        place, later, behind = _behind(objects[chain], stands, way, sight, number[chain])
        pairs = _Pairs(
            stands[place], true[chain][later], behind, level[place],
            objects[chain].amplitude[later], view.cell(objects[chain].range[later]),
        )  # fmt: skip
        for turned in _turned_at(walls, pairs, view.range_cell):
            marks[chain][later[turned]] = True
        peak, beside = bright_echoes(objects[chain], view), np.zeros(len(objects[chain]), dtype=bool)
        for turned in _turned_beside(others, pairs, view.range_cell):
            beside[later[turned]] = True
        marks[chain] |= beside[peak]
    return marks


class _Pairs(NamedTuple):
    """Places of objects, each with an echo behind it in the same beam.

    The object is at the true `place` (n, 2) [m]; its brightest echo has the amplitude `level` (n,). The `echo` would
    stand at (n, 2) [m], so far `behind` the place, (n,) [m]; it has an `amplitude` and a resolution `cell` [m], (n,).
    """

    place: Array
    echo: Array
    behind: Array
    level: Array
    amplitude: Array
    cell: Array


def _turned_at(walls: Sequence[Array], pairs: _Pairs, range_cell: float) -> Iterator[Mask]:
    """Which echoes behind places turned at a wall, (n,), for each wall and number of turns; `walls` holds their ends.

    `range_cell` is in [m].
    """
    for wall in walls:
        away, beyond = square_distances(pairs.place, wall)
        met = (beyond <= pairs.cell) & (away > RESOLVED_CELLS * range_cell)
        for turn, brighter in enumerate(BRIGHTER_DB, 1):
            expected = np.abs(turn * away - pairs.behind) <= EXPECTED_CELLS * range_cell
            yield met & expected & (pairs.amplitude <= ratio_of(brighter) * pairs.level)


def _turned_beside(others: Sequence[tuple[cKDTree, float]], pairs: _Pairs, range_cell: float) -> Iterator[Mask]:
    """Which echoes behind places turned at an object beside the place, (n,), for each of the objects.

    That object is neither the one at the place, nor the one that would stand at the echo. Both objects spread the wave,
    so that the echo is weaker than either. `range_cell` is in [m].
    """
    for places, brightest in others:
        away, own = (places.query(place)[0] for place in (pairs.place, pairs.echo))
        beyond = (away - pairs.behind) / range_cell
        expected = (beyond >= -EXPECTED_CELLS) & (beyond <= NEARER_CELLS) & (away <= BESIDE_CELLS * range_cell)
        apart = np.minimum(away, own) > RESOLVED_CELLS * range_cell
        yield expected & apart & (pairs.amplitude <= np.minimum(pairs.level, brightest))


def _others(true: dict[Chain, Array], objects: dict[Chain, Echoes], view: ImageView) -> list[tuple[cKDTree, float]]:
    """Each object: the true places (n, 2) [m] of its echoes by all chains, and the amplitude of the brightest one."""
    places = np.concatenate(list(true.values()))
    amplitude = np.concatenate([echoes.amplitude for echoes in objects.values()])
    near = cKDTree(places).query_pairs(RESOLVED_CELLS * view.range_cell, output_type="ndarray")
    number = connected(near, len(places))
    return [(cKDTree(places[own]), float(amplitude[own].max())) for own in number == np.unique(number)[:, None]]


def _behind(
    echoes: Echoes, stands: Array, way: Sequence[Mirror], sight: LinesOfSight, index: int
) -> tuple[Index, Index, Array]:
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
    place, later = np.repeat(shown[row], last - first), order[consecutive(first, last - first)]
    behind = echoes.range[later] - range_[place]
    kept = behind > RESOLVED_CELLS * view.range_cell
    return place[kept], later[kept], behind[kept]


def _face(echoes: Echoes, view: ImageView) -> tuple[Array, Array]:
    """Places of the image on the faces of objects (n, 2) [m], and the brightest amplitude of the object there, (n,).

    These are the places of the echoes first, then places at most half a cell apart between neighbours on one face.
    """
    level, cells = _brightest(echoes, view), view.in_cells(echoes.position)
    near = cKDTree(cells).query_pairs(GAP_CELLS, output_type="ndarray")
    apart = np.linalg.norm(cells[near[:, 0]] - cells[near[:, 1]], axis=1)
    pairs = near.T.astype(np.int32)  # the only indices that the spanning trees of SciPy 1.14 take
    graph = coo_array((np.maximum(apart, np.finfo(float).tiny), pairs), shape=(len(cells), len(cells)))
    link = minimum_spanning_tree(graph.tocsr()).tocoo()
    count = np.maximum(np.ceil(2.0 * link.data).astype(int) - 1, 0)
    share = (consecutive(1, count) / np.repeat(count + 1, count))[:, None]
    one, other = np.repeat(link.row, count), np.repeat(link.col, count)
    between = (1.0 - share) * echoes.position[one] + share * echoes.position[other]
    return np.concatenate([echoes.position, between]), np.append(level, np.maximum(level[one], level[other]))


def bright_echoes(echoes: Echoes, view: ImageView) -> Index:
    """The bright echo of which each echo is a part, (n,): the one that is reached by steps to the brightest nearby."""
    near = cKDTree(cells := view.in_cells(echoes.position)).query_ball_point(cells, LOBE_CELLS)
    brightest = np.array([some[np.argmax(echoes.amplitude[some])] for some in near], dtype=np.intp)
    while not np.array_equal(further := brightest[brightest], brightest):
        brightest = further
    return brightest


def _brightest(echoes: Echoes, view: ImageView) -> Array:
    """Amplitude of the brightest echo of each echo's own object, of those before it or unresolved from it, (n,)."""
    level = echoes.amplitude.copy()
    of_object = object_numbers(view, echoes)
    for number in np.unique(of_object):
        own = np.flatnonzero(of_object == number)
        own = own[np.argsort(echoes.range[own])]
        last = np.searchsorted(echoes.range[own], echoes.range[own] + RESOLVED_CELLS * view.range_cell, "right")
        level[own] = np.maximum.accumulate(echoes.amplitude[own])[last - 1]
    return level
