"""Echoes whose path, from the last mirror on, would pass through a known object.

Along a line of sight an object hides what is behind it, unless that is much brighter. But the image of an object in a
mirror may be faint, where its face throws the wave to the side, and multiple scattering behind it, as between the
object and a wall, may be brighter. The object itself may be bright in line of sight or in another mirror. So true
places are compared: an echo is left out if the last leg of its path, from the last mirror to its true place, passes
between neighbouring echoes of an opaque object, well inside of the object.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import turned
from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection import ImageView, any_curved
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.behind_walls import last_leg
from mirrorfold.tree.grouping import connected

BEHIND_AN_OBJECT = "would stand behind another object"

NEIGHBOURS_CELLS = 0.75
"""Largest distance of two echoes of one unbroken surface, in resolution cells."""

AROUND_PATH_CELLS = 0.5
"""A path passes through a surface if the surface reaches at least this many resolution cells to either side of the
path: echoes of an edge lie up to half a cell beyond the edge, and an edge bends waves around it."""

BEYOND_CELLS = 1.0
"""An object hides only echoes that are more than this many resolution cells behind it, for nearer ones may be its own;
and it hides nothing from a mirror that is closer to it than that."""

AT_ONCE = 1_000_000
"""Number of combinations, of a path and a pair of neighbouring echoes, that are tested at once; bounds the memory."""


def behind_objects(found: Found, view: ImageView) -> dict[Chain, Mask]:
    """Which object echoes of each chain of mirrors would stand behind known objects, (n,) each.

    An object hides only echoes that are seen by way of as many mirrors or more, for places are less certain with each
    mirror; and only echoes no brighter than its own brightest echo, for a weaker object may be a side lobe itself. Not
    tested are echoes by way of curved mirrors, and direct echoes, which the lines of sight decide.
    """
    behind = {node.chain: np.zeros(len(node.objects), dtype=bool) for node in found.tree.walk()}

    flat = [node for node in found.tree.walk() if not any_curved(node.way)]
    for generation in {node.generation for node in flat if node.chain and len(node.objects)}:
        before = [node for node in flat if node.generation <= generation]
        surfaces = _surfaces(
            np.concatenate([node.fold(node.objects.position) for node in before]),
            np.concatenate([node.objects.amplitude for node in before]),
            np.concatenate([view.cell(node.objects.range) for node in before]),
        )
        for node in (node for node in before if node.generation == generation):
            legs, objects = last_leg(node.objects, node.way, view), node.objects
            behind[node.chain] = _passed(surfaces, *legs, objects.amplitude, view.cell(objects.range))
    return behind


_Surface = tuple[Array, Index, float]
"""The echoes of one surface: their true places (n, 2) [m], the pairs (k, 2) of those that are neighbours, by their
numbers, and their largest amplitude."""


def _surfaces(places: Array, amplitude: Array, cell: Array) -> list[_Surface]:
    """Group echoes at true places (n, 2) [m], of an `amplitude` and a resolution `cell` [m], (n,), into surfaces."""
    pairs = cKDTree(places).query_pairs(NEIGHBOURS_CELLS * cell.max(initial=0.0), output_type="ndarray")
    apart = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
    pairs = pairs[apart <= NEIGHBOURS_CELLS * cell[pairs].min(axis=1, initial=np.inf)]
    surface, found = connected(pairs, len(places)), list[_Surface]()
    for number in np.unique(surface[pairs]):
        own = np.flatnonzero(surface == number)
        neighbours = np.searchsorted(own, pairs[surface[pairs[:, 0]] == number])
        found.append((places[own], neighbours, float(amplitude[own].max())))
    return found


def _passed(surfaces: list[_Surface], leaves: Array, stands: Array, amplitude: Array, cell: Array) -> Mask:
    """Whether straight paths from `leaves` to `stands`, (n, 2) [m] each, pass through a surface well before their end,
    (n,).

    At the end of each path would stand an echo of an `amplitude` and a resolution `cell` [m], (n,) each.
    """
    path, passed = stands - leaves, np.zeros(len(stands), dtype=bool)
    length = np.maximum(np.linalg.norm(path, axis=1), np.finfo(float).tiny)
    ahead = path / length[:, None]
    aside = turned(ahead)
    for places, neighbours, brightest in surfaces:
        pieces = 1 + len(stands) * len(neighbours) // AT_ONCE
        for some in np.array_split(np.flatnonzero(amplitude <= brightest), pieces):
            margin, edge = (share * cell[some, None] for share in (BEYOND_CELLS, AROUND_PATH_CELLS))
            along, beside = (axis[some] @ places.T - np.sum(axis[some] * leaves[some], axis=1)[:, None]
                             for axis in (ahead, aside))  # fmt: skip
            beside[(along < margin) | (along > length[some, None] - margin)] = np.nan
            between = np.prod(beside[:, neighbours], axis=2) < 0.0
            passed[some] |= (beside >= edge).any(axis=1) & (beside <= -edge).any(axis=1) & between.any(axis=1)
    return passed
