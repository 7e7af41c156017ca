"""Which chains of mirrors with arcs among them lead anywhere.

Chains grow by one mirror at a time: a mirror is appended if an antenna sees one of its sample points over the chain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.simulation.rays.curved import CurvedChain, Face, trace_curved
from mirrorfold.simulation.rays.outline import Outline
from mirrorfold.simulation.rays.paths import Chain, Points, trace

LONGEST = 2
"""Largest number of mirrors on one way if an arc is among them: each arc weakens the waves by more than a flat mirror
does."""

PROBES = 64
"""Number of sample points on a mirror; it counts as seen if an antenna sees one of them."""


def faces_of(world: Outline) -> list[Face]:
    """All mirrors of the outline: facets, and both sides of each arc."""
    flat, arcs = len(world.facets), len(world.arcs)
    return [*((i, 0) for i in range(flat)), *((flat + i, side) for i in range(arcs) for side in (1, -1))]


def _probes(face: Face, world: Outline) -> Points:
    """Sample points on a mirror; those on an arc with the normals of its reflecting side."""
    number, side = face
    along = (np.arange(PROBES) + 0.5) / PROBES
    if number < len(world.facets):
        start, end = world.facets[number]
        return Points.free(start + along[:, None] * (end - start))
    x, y, radius, first, span = world.arcs[number - len(world.facets)]
    outward = np.stack([np.cos(first + span * along), np.sin(first + span * along)], axis=1)
    position = np.array([x, y]) + radius * outward
    return Points(position, side * outward, np.full(PROBES, -1, dtype=np.int64))


def sees(chain: Chain | CurvedChain, face: Face, world: Outline) -> bool:
    """Whether the first, the middle or the last antenna sees a sample point of a mirror over a chain."""
    few = np.unique([0, chain.count // 2, chain.count - 1])
    if isinstance(chain, CurvedChain):
        return trace_curved(chain.of(few), _probes(face, world)).length.size > 0
    return trace(chain.of(few), _probes(face, world), world).length.size > 0


@dataclass(frozen=True, eq=False)
class Ways:
    """The mirrors that a set of antennas sees over chains of at most `LONGEST` mirrors.

    Attributes
    ----------
    chains : list of CurvedChain
        The chains with an arc among their mirrors.
    seen : dict
        For every chain, also of flat mirrors only, the set of mirrors that are seen over it.
    """

    chains: list[CurvedChain]
    seen: dict[tuple[Face, ...], set[Face]]


def ways(antennas: Array, world: Outline, flat: Sequence[Chain], bounces: int) -> Ways:
    """The mirrors that antennas see over chains of at most `bounces`, and at most `LONGEST`, mirrors.

    Parameters
    ----------
    antennas : (n, 2) array [m]
    world : Outline
    flat : sequence of Chain
        Chains of flat mirrors only, the line of sight among them.
    bounces : int

    Returns
    -------
    Ways
        Empty for an outline without arcs.
    """
    found = Ways([], {})
    longest = min(LONGEST, bounces)
    if not len(world.arcs) or not longest:
        return found
    faces = faces_of(world)
    generation: list[Chain | CurvedChain] = [chain for chain in flat if len(chain.facets) <= longest]
    while generation:
        longer: list[Chain | CurvedChain] = []
        for chain in generation:
            way = chain.faces
            # A flat mirror, or the outer side of an arc, never reflects a wave onto itself.
            last = way[-1] if way and way[-1][1] >= 0 else None
            found.seen[way] = {face for face in faces if face != last and sees(chain, face, world)}
            if isinstance(chain, CurvedChain):
                found.chains.append(chain)
            if len(way) < longest:
                longer += [
                    CurvedChain((*way, face), antennas, world)
                    for face in sorted(found.seen[way])
                    if face[1] or any(side for _, side in way)
                ]
        generation = longer
    return found


def there_and_back(from_tx: Ways, from_rx: Ways, tx: Array, world: Outline) -> Iterator[CurvedChain]:
    """Chains from the transmitters by way of a mirror that both sides see to the receivers, with two arcs or more.

    A chain with a single reflection at an arc, and flat mirrors before and after it, is a glint (`glints`).
    """
    for there, shown in from_tx.seen.items():
        for back, also in from_rx.seen.items():
            if len(there) - len(back) not in (0, 1):  # so that each chain is found once
                continue
            for face in sorted(shown & also):
                way = (*there, face, *back[::-1])
                if sum(side != 0 for _, side in way) > 1:
                    yield CurvedChain(way, tx, world)
