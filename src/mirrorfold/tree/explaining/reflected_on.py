"""Echoes of waves that a flat object or the back of a wall beside their path reflected, on to a known object.

A flat object that is no mirror in the image still reflects, and so does the back of a wall. If the last leg of an
echo's path passes well inside of its ends, nothing stands behind it (`behind_walls`). If the leg passes close to an
end, both may be: the wave went past the end, or the end reflected it. If the end did, the true place follows from
reflecting the leg there, and at each wall that it meets from there on. If a known object stands at just that place, the
wave came from it. Also known is where legs lead that pass well inside of the ends, reflected by each wall that they
meet: the image shows an object there by way of a wall that it does not show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.geometry import crossing, reflect, segment_normal
from mirrorfold.common.types import Array, Chain, Mask
from mirrorfold.detection import ImageView, Mirror, any_curved
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.behind_walls import BEHIND_CELLS, INSIDE_CELLS, last_leg, widened
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS, true_ends
from mirrorfold.tree.mirror_tree import MirrorTree

REFLECTED_ON = "comes from a known place, by way of a flat object"

MOST_REFLECTIONS = 3
"""Largest number of reflections that are followed from the last mirror on."""


def reflected_on(found: Found, view: ImageView, walls: Mapping[Chain, Sequence[Mirror]]) -> dict[Chain, Mask]:
    """Which object echoes of each chain were reflected on to a known place, (n,) each.

    The `walls` are known walls and flat objects, each with the mirrors before it by way of which it is seen, by chain.
    """
    ends = {chain: true_ends(tuple(way)) for chain, way in walls.items() if way and not any_curved(way)}
    nodes = list(found.tree.walk())
    others = {node.chain: [wall for chain, wall in ends.items() if chain != node.chain] for node in nodes}
    near = {node.chain: _near_ends(node, others[node.chain], view) for node in nodes}
    # An echo that is in doubt itself explains no other.
    known = [_led_to(node, others[node.chain], np.asarray(~near[node.chain].any(axis=0)), view) for node in nodes]
    known += [node.face_fold(node.face.position) for node in nodes if node.chain]
    places = cKDTree(np.concatenate(known))
    return {node.chain: _come_from(places, node, others[node.chain], near[node.chain], view) for node in nodes}


def _led_to(node: MirrorTree, walls: Sequence[Array], chosen: Mask, view: ImageView) -> Array:
    """Where the paths to the chosen object echoes of a node lead, reflected by each wall that they meet, (m, 2) [m].

    No wall is met where a curved mirror shows another.
    """
    echoes = node.objects.take(chosen)
    places = node.fold(echoes.position)
    if len(echoes) and not any_curved(node.way[:-1]):
        leaves, cell = last_leg(echoes, node.way, view)[0], view.cell(echoes.range) * widened(echoes, node.way)
        shares = np.array([_share(leaves, places, wall, cell) for wall in walls]).reshape(len(walls), len(echoes))
        for echo in np.flatnonzero(np.isfinite(shares).any(axis=0)):
            first = int(np.argmin(shares[:, echo]))
            places[echo] = _followed(leaves[echo], places[echo], first, walls, float(cell[echo]))
    return places


def _near_ends(node: MirrorTree, walls: Sequence[Array], view: ImageView) -> Mask:
    """Which object echo's last leg passes close to an end of which wall, (walls, n).

    Each wall is given by its ends, (2, 2) [m]. None is near where a curved mirror shows another.
    """
    near = np.zeros((len(walls), len(node.objects)), dtype=bool)
    if len(node.objects) and not any_curved(node.way[:-1]):
        legs, growth = last_leg(node.objects, node.way, view), widened(node.objects, node.way)
        for row, wall in zip(near, walls, strict=True):
            row[:] = _near_end(wall, *legs, node.objects.range, view, growth)
    return near


def _come_from(places: cKDTree, node: MirrorTree, walls: Sequence[Array], near: Mask, view: ImageView) -> Mask:
    """Which object echoes of a node come from one of these places by way of a wall that is `near`, (n,)."""
    explained = np.zeros(len(node.objects), dtype=bool)
    if near.any():
        leaves, stands = last_leg(node.objects, node.way, view)
        cell = view.cell(node.objects.range) * widened(node.objects, node.way)
        for wall, echo in np.argwhere(near):
            place = _followed(leaves[echo], stands[echo], int(wall), walls, float(cell[echo]))
            explained[echo] |= places.query(place)[0] <= EXPECTED_CELLS * cell[echo]
    return explained


def _near_end(wall: Array, leaves: Array, stands: Array, range_: Array, view: ImageView, growth: Array) -> Mask:
    """Whether straight paths cross a wall less than `INSIDE_CELLS` inside of its end, or its line just beyond, (n,).

    Beyond the end, up to the width of the radar's beam at the crossing counts. A curved mirror widens both; `growth` is
    the factor at the end of the path.
    """
    length = np.linalg.norm(stands - leaves, axis=1)
    with np.errstate(invalid="ignore"):
        share, along = crossing(leaves, stands, *wall)
        behind = (1.0 - share) * length
        cell, beam = view.cell(range_), view.width(range_ - behind)
        inside = (0.5 - np.abs(along - 0.5)) * float(np.linalg.norm(wall[1] - wall[0]))
        far = np.minimum(share * length, behind / growth) > BEHIND_CELLS * cell
        wider = 1.0 + share * (growth - 1.0)
        return far & (inside > -beam * wider) & (inside < INSIDE_CELLS * cell * wider)


def _followed(leaves: Array, place: Array, first: int, walls: Sequence[Array], cell: float) -> Array:
    """The true place (2,) [m] at the end of a path that is reflected at a first wall, and then at those that it meets.

    If nothing reflected it, the path would lead from `leaves` to `place`, (2,) [m] each. The walls are given by their
    ends, (2, 2) [m]; `first` is the number of the first one. At the end, a resolution cell is `cell` [m] wide: walls
    closer than `BEHIND_CELLS` such cells to an end of a leg are not met.
    """
    met = first
    for _ in range(MOST_REFLECTIONS):
        share, _along = crossing(leaves, place, *walls[met])
        leaves = leaves + share * (place - leaves)
        place = reflect(place, walls[met][0], segment_normal(*walls[met]))
        shares = [float(_share(leaves, place, wall, cell)) for wall in walls]
        met = int(np.argmin(shares))
        if not np.isfinite(shares[met]):
            break
    return place


def _share(leaves: Array, places: Array, wall: Array, cell: Array | float) -> Array:
    """Share of straight paths (..., 2) [m] at which they meet a wall; infinite if they do not, (...)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        share, along = crossing(leaves, places, *wall)
        length = np.linalg.norm(places - leaves, axis=-1)
        met = (along >= 0.0) & (along <= 1.0) & (np.minimum(share, 1.0 - share) * length > BEHIND_CELLS * cell)
    return np.where(met, share, np.inf)
