"""Which chains of mirrors with arcs among them lead anywhere.

Chains grow by one mirror at a time: a mirror is appended if an antenna sees one of its sample points over the chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.simulation.rays.curved import CurvedChain, MirrorSide, trace_curved
from mirrorfold.simulation.rays.outline import Outline
from mirrorfold.simulation.rays.paths import Chain, Points, trace

LONGEST = 2
"""Largest number of mirrors on one way if an arc is among them: each arc weakens the waves by more than a flat mirror
does."""

PROBES = 64
"""Number of sample points on a mirror; it counts as seen if an antenna sees one of them."""


def mirror_sides_of(outline: Outline) -> list[MirrorSide]:
    """All mirrors of the outline: facets, and both sides of each arc."""
    flat, arcs = len(outline.facets), len(outline.arcs)
    return [*((i, 0) for i in range(flat)), *((flat + i, side) for i in range(arcs) for side in (1, -1))]


def _probes(mirror_side: MirrorSide, outline: Outline) -> Points:
    """Sample points on a mirror; those on an arc with the normals of its reflecting side."""
    number, side = mirror_side
    along = (np.arange(PROBES) + 0.5) / PROBES
    if number < len(outline.facets):
        start, end = outline.facets[number]
        return Points.free(start + along[:, None] * (end - start))
    x, y, radius, first, span = outline.arcs[number - len(outline.facets)]
    outward = np.stack([np.cos(first + span * along), np.sin(first + span * along)], axis=1)
    position = np.array([x, y]) + radius * outward
    return Points(position, side * outward, np.full(PROBES, -1, dtype=np.int64))


def sees(chain: Chain | CurvedChain, mirror_side: MirrorSide, outline: Outline) -> bool:
    """Whether the first, the middle or the last antenna sees a sample point of a mirror over a chain."""
    few = np.unique([0, chain.count // 2, chain.count - 1])
    if isinstance(chain, CurvedChain):
        return trace_curved(chain.of(few), _probes(mirror_side, outline)).length.size > 0
    return trace(chain.of(few), _probes(mirror_side, outline), outline).length.size > 0


@dataclass(frozen=True, eq=False)
class ChainsWithArcs:
    """The mirrors that a set of antennas sees over chains of at most `LONGEST` mirrors.

    Attributes
    ----------
    chains : list of CurvedChain
        The chains with an arc among their mirrors.
    seen : dict
        For every chain, also of flat mirrors only, the set of mirrors that are seen over it.
    """

    chains: list[CurvedChain]
    seen: dict[tuple[MirrorSide, ...], set[MirrorSide]]


def chains_with_arcs(antennas: Array, outline: Outline, flat: Sequence[Chain], bounces: int) -> ChainsWithArcs:
    """The mirrors that antennas see over chains of at most `bounces`, and at most `LONGEST`, mirrors.

    Parameters
    ----------
    antennas : (n, 2) array [m]
    outline : Outline
    flat : sequence of Chain
        Chains of flat mirrors only, the line of sight among them.
    bounces : int

    Returns
    -------
    ChainsWithArcs
        Empty for an outline without arcs.
    """
    found = ChainsWithArcs([], {})
    longest = min(LONGEST, bounces)
    if not len(outline.arcs) or not longest:
        return found
    mirror_sides = mirror_sides_of(outline)
    generation: list[Chain | CurvedChain] = [chain for chain in flat if len(chain.facets) <= longest]
    while generation:
        longer: list[Chain | CurvedChain] = []
        for chain in generation:
            way = chain.mirrors_and_sides
            # A flat mirror, or the outer side of an arc, never reflects a wave onto itself.
            last = way[-1] if way and way[-1][1] >= 0 else None
            found.seen[way] = {
                mirror_side for mirror_side in mirror_sides if mirror_side != last and sees(chain, mirror_side, outline)
            }
            if isinstance(chain, CurvedChain):
                found.chains.append(chain)
            if len(way) < longest:
                longer += [
                    CurvedChain((*way, mirror_side), antennas, outline)
                    for mirror_side in sorted(found.seen[way])
                    if mirror_side[1] or any(side for _, side in way)
                ]
        generation = longer
    return found


def there_and_back(from_tx: ChainsWithArcs, from_rx: ChainsWithArcs, tx: Array, outline: Outline) -> list[CurvedChain]:
    """Chains from the transmitters by way of a mirror that both sides see to the receivers, with two arcs or more.

    A chain with a single reflection at an arc, and flat mirrors before and after it, is a glint (`glints`).
    """
    ways = {
        (*there, mirror_side, *back[::-1])
        for there, shown in from_tx.seen.items()
        for back, also in from_rx.seen.items()
        if abs(len(there) - len(back)) <= 1  # so that both directions of a chain are found, or neither
        for mirror_side in shown & also
    }
    return [CurvedChain(way, tx, outline) for way in sorted(ways) if sum(side != 0 for _, side in way) > 1]
