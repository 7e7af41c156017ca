"""Echoes of waves that a flat object or the back of a wall beside their path reflected, on to a thing that is known.

A flat object that is no mirror in the image still reflects, and so does the back of a wall. If the last leg of an
echo's path passes well inside of its ends, nothing stands behind it (`behind_walls`). If the leg passes close to an
end, both may be: the wave went past the end, or the end reflected it. If the end did, the true place follows from
reflecting the leg there, and at each wall that it meets from there on. If a known thing stands at just that place, the
wave came from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import crossing, reflect, segment_normal
from mirrorfold.common.types import Array, Chain, Mask
from mirrorfold.detection import ImageView, Mirror, any_curved
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.behind_walls import BEHIND_CELLS, INSIDE_CELLS, last_leg
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS, true_ends

REFLECTED_ON = "comes from a known place, by way of a flat object"

MOST_REFLECTIONS = 3
"""Largest number of reflections that are followed from the last mirror on."""


def reflected_on(found: Found, view: ImageView, walls: Mapping[Chain, Sequence[Mirror]]) -> dict[Chain, Mask]:
    """Which object echoes of each chain of flat mirrors were reflected on to a known place, (n,) each.

    Parameters
    ----------
    found : Found
    view : ImageView
    walls : mapping of chain to sequence of Mirror
        Known walls and flat objects, each with the mirrors before it by way of which it is seen.
    """
    ends = {chain: true_ends(tuple(way)) for chain, way in walls.items() if way and not any_curved(way)}
    asked, known = dict[Chain, _Asked](), list[Array]()
    for node in found.tree.walk():
        others = [wall for chain, wall in ends.items() if chain != node.chain]
        near = np.zeros((len(others), len(node.objects)), dtype=bool)
        if len(node.objects) and not any_curved(node.way):
            legs = last_leg(node.objects, node.way, view)
            for row, wall in zip(near, others, strict=True):
                row[:] = _near_end(wall, *legs, node.objects.range, view)
            asked[node.chain] = _Asked(*legs, np.asarray(view.cell(node.objects.range)), others, near)
        # An echo that is in doubt itself explains no other.
        known.append(node.fold(node.objects.position[~near.any(axis=0)]))
        if node.chain:
            known.append(node.face_fold(node.face.position))
    places = cKDTree(np.concatenate(known))
    return {
        node.chain: asked[node.chain].come_from(places)
        if node.chain in asked
        else np.zeros(len(node.objects), dtype=bool)
        for node in found.tree.walk()
    }


class _Asked(NamedTuple):
    """The echoes of one chain whose last leg passes close to ends of walls.

    Attributes
    ----------
    leaves, stands : (n, 2) arrays [m]
        Begin and end of the last leg of each echo's path.
    cell : (n,) array [m]
        Resolution cell of each echo.
    walls : sequence of (2, 2) arrays [m]
        Ends of all walls that may reflect the wave.
    near : (walls, n) bool array
        Which echo's leg passes close to an end of which wall.
    """

    leaves: Array
    stands: Array
    cell: Array
    walls: Sequence[Array]
    near: Mask

    def come_from(self, places: cKDTree) -> Mask:
        """Which of the echoes come from one of these places by way of a wall, (n,)."""
        explained = np.zeros(len(self.stands), dtype=bool)
        for wall, echo in np.argwhere(self.near):
            place = _followed(self.leaves[echo], self.stands[echo], int(wall), self.walls, float(self.cell[echo]))
            explained[echo] |= places.query(place)[0] <= EXPECTED_CELLS * self.cell[echo]
        return explained


def _near_end(wall: Array, leaves: Array, stands: Array, range_: Array, view: ImageView) -> Mask:
    """Whether straight paths cross a wall, or its line just beyond it, closer to an end than a known wall hides, (n,).

    Beyond the end, up to the width of the radar's beam at the crossing counts.
    """
    length = np.linalg.norm(stands - leaves, axis=1)
    with np.errstate(invalid="ignore"):
        share, along = crossing(leaves, stands, *wall)
        behind = (1.0 - share) * length
        cell, beam = np.asarray(view.cell(range_)), view.width(range_ - behind)
        inside = (0.5 - np.abs(along - 0.5)) * float(np.linalg.norm(wall[1] - wall[0]))
        far = np.minimum(share * length, behind) > BEHIND_CELLS * cell
        return np.asarray(far & (inside > -beam) & (inside < INSIDE_CELLS * cell))


def _followed(leaves: Array, place: Array, first: int, walls: Sequence[Array], cell: float) -> Array:
    """The true place (2,) [m] at the end of a path that is reflected at a first wall, and then at those that it meets.

    Parameters
    ----------
    leaves, place : (2,) arrays [m]
        Where the path begins, and where it would end if nothing reflected it.
    first : int
        Number of the wall that reflects it first.
    walls : sequence of (2, 2) arrays [m]
        The ends of each wall.
    cell : float [m]
        Resolution cell at the end of the path: walls closer than `BEHIND_CELLS` to an end of a leg are not met.
    """
    met: int | None = first
    for _ in range(MOST_REFLECTIONS):
        if met is None:
            break
        share, _along = crossing(leaves, place, *walls[met])
        leaves = leaves + share * (place - leaves)
        place = reflect(place, walls[met][0], segment_normal(*walls[met]))
        length, shares = float(np.linalg.norm(place - leaves)), {}
        for number, wall in enumerate(walls):
            share, along = crossing(leaves, place, *wall)
            if 0.0 <= along <= 1.0 and min(share, 1.0 - share) * length > BEHIND_CELLS * cell:
                shares[number] = float(share)
        met = min(shares, key=lambda number: shares[number]) if shares else None
    return place
