"""What a simulation by rays takes of the memory, and in how many tiles of scatterers it has to be made.

Paths are counted before they are traced: from a few transmitters, which are taken to see as much as the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from logging import INFO
from typing import Literal

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.forecasts import GIGABYTE, Parts, expect, fullest, log, total
from mirrorfold.common.memory import room_below
from mirrorfold.common.records import Record, fact
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.simulation.plane import in_plane
from mirrorfold.simulation.rays.curved import MOST, CurvedChain
from mirrorfold.simulation.rays.fermat import FACTS
from mirrorfold.simulation.rays.outline import Outline, outline
from mirrorfold.simulation.rays.paths import Chain, chains
from mirrorfold.simulation.rays.phasors import Paths, points_of
from mirrorfold.simulation.rays.returns import diffuse_paths, edge_returns, glint_returns, mirror_returns
from mirrorfold.simulation.rays.scatterers import Scatterers, scatterers
from mirrorfold.simulation.rays.ways import LONGEST, Ways, there_and_back, ways

LONGEST_BLOCK = 16
"""Frequencies whose fields are computed in one go."""

BLOCK_BYTES = 200e6
"""Size of the fields of a block, above which it is made shorter."""

FIELD_SHARE = 0.25
"""Of the room for paths and fields, that the fields may take of it where it is short."""

WAVES = 8
"""That a half-transparent wall makes of one, of those that count."""

COUNTED = 5
"""Transmitters, evenly chosen, whose paths are counted beforehand."""

PATH_BYTES = 44.0
"""Of a path: phasor, turn, bend, and the number of its scatterer."""

TRACED_BYTES = 24.0
"""Of each pair of an antenna and a point while a chain is traced: share, length and angle at the end ..."""

MIRROR_BYTES = 8.0
"""... and an angle for each mirror."""

CURVED_BYTES = 2.0 * (1.0 + 8.0 * (FACTS + LONGEST))
"""Of each pair of an antenna and a point while a sequence with an arc is traced: room for two paths, each of which is
known or not, with angles and facts."""

FOUND_BYTES = 56.0
"""Of each path of a chain while it is copied from these tables: its ends twice, length, share and angle at the end."""

WORKED_BYTES = 232.0
"""Of each path of a chain while its amplitudes, at three frequencies, become phasors: 40 of its geometry, 48 of the
amplitudes, 48 of those that are not zero, and six complex numbers in double precision."""

MOST_TILES = 256
"""In so many tiles the fields of a block, not the paths, take the memory."""

ROOM_SHARE = 0.8
"""Of the memory that is left, for a tile: what is freed of one is not all there for the next."""

REMEDY = "give fewer elements, frequencies, surfaces or bounces, close other programs, or raise the limit"


@dataclass(frozen=True, eq=False)
class Lit:
    """A scene and what its antennas see: all that paths are traced from.

    Attributes
    ----------
    scene : Scene
    world : Outline
    tx, rx : (n, 2) arrays [m]
    tx_chains : list of Chain
        From the transmitters over up to twice as many mirrors as are asked for.
    bounces : int
    to_tx, to_rx : list of Chain
        Over up to that many; the same list for one array.
    tx_ways, rx_ways : Ways
        What the antennas see over few mirrors with arcs among them; the same for one array.
    over_arcs : list of CurvedChain
        From the transmitters over two arcs or more, and back to the receivers.
    rough : Scatterers
    edges : bool
        Whether the ends of mirrors radiate.
    """

    scene: Scene
    world: Outline
    tx: Array
    rx: Array
    tx_chains: Sequence[Chain]
    bounces: int
    to_tx: Sequence[Chain]
    to_rx: Sequence[Chain]
    tx_ways: Ways
    rx_ways: Ways
    over_arcs: Sequence[CurvedChain]
    rough: Scatterers
    edges: bool

    @property
    def same_array(self) -> bool:
        """Whether transmitters and receivers stand at the same places."""
        return self.to_rx is self.to_tx

    @property
    def over_tx(self) -> list[Chain | CurvedChain]:
        """Sequences over which the transmitters see scatterers."""
        return [*self.to_tx, *self.tx_ways.chains]

    @property
    def over_rx(self) -> list[Chain | CurvedChain]:
        """Those over which the receivers do."""
        return [*self.to_rx, *self.rx_ways.chains]

    @property
    def antennas(self) -> int:
        """Whose fields at the scatterers are needed."""
        return len(self.tx) + (0 if self.same_array else len(self.rx))

    def block(self, columns: int, nbytes: float) -> int:
        """Frequencies whose fields at so many scatterers are held at once, in so many bytes."""
        each = 8 * (self.antennas * columns + len(self.tx) * len(self.rx))
        return int(np.clip(nbytes // each, 1, min(LONGEST_BLOCK, self.scene.band.points)))

    @cached_property
    def counts(self) -> Counts:
        """How many paths there will be."""
        some = np.unique(np.linspace(0, len(self.tx) - 1, min(COUNTED, len(self.tx))).astype(int))
        few = replace(
            self,
            tx=self.tx[some],
            tx_chains=[chain.of(some) for chain in self.tx_chains],
            to_tx=[chain.of(some) for chain in self.to_tx],
            tx_ways=replace(self.tx_ways, chains=[chain.of(some) for chain in self.tx_ways.chains]),
            over_arcs=[chain.of(some) for chain in self.over_arcs],
        )
        times = len(self.tx) / some.size
        pieces = diffuse_paths(self.scene, self.world, few.over_tx, self.rough)
        found = [paths.point.size for paths in specular_paths(few)]
        return Counts(
            diffuse=times * sum(paths.point.size for paths in pieces) * self.antennas / len(self.tx),
            largest=times * max((paths.point.size for paths in pieces), default=0),
            specular=times * sum(found),
            largest_specular=times * max(found, default=0),
            used=points_of(pieces).size,
        )

    @property
    def most(self) -> Counts:
        """How many paths there would be if every antenna saw everything over every chain."""
        pairs, arcs, ends = len(self.tx) * len(self.rx), len(self.world.arcs), 2 * len(self.world.facets)
        each = MOST if self.tx_ways.chains or self.over_arcs else 1  # paths over one sequence
        each *= WAVES ** len(self.world.slabs)
        seen = len(self.tx) * len(self.over_tx) + (0 if self.same_array else len(self.rx) * len(self.over_rx))
        back = len(self.tx_chains) + len(self.over_arcs)
        back += ends * len(self.to_tx) + arcs * len(self.to_tx) * len(self.to_rx)
        return Counts(
            diffuse=float(each * len(self.rough) * seen),
            largest=float(each * len(self.rough) * max(len(self.tx), len(self.rx))),
            specular=float(each * pairs * back),
            largest_specular=float(each * pairs),
            used=len(self.rough),
        )


@dataclass(frozen=True)
class Counts:
    """Numbers of paths: to scatterers from all antennas, of these over the one chain with most; the same of specular
    returns; and how many scatterers are seen.
    """

    diffuse: float
    largest: float
    specular: float
    largest_specular: float
    used: int


class RayEstimate(Record):
    """What a simulation by rays would take."""

    kind: Literal["estimate"]
    scatterers: int
    chains: int
    paths: int = fact("all of them, counted from a few transmitters")
    frequencies: int
    sweep_bytes: int
    tiles: int = fact("in which the scatterers are taken, so that they fit")
    memory_gb: float = fact("predicted, the sweep included, the program itself not")
    parts_gb: dict[str, float] = fact("what takes it, where it is the most")
    remarks: list[str] = fact("sentences on what looks wrong")


def light(
    scene: Scene, *, bounces: int, seed: int, spacing: float | None = None, edges: bool = True, curved: bool = True
) -> Lit:
    """A scene with its chains of mirrors and its scatterers; see `scattered_field`.

    Raises
    ------
    InputError
        If the scene is not a two-dimensional one of surfaces that rays can follow.
    """
    tx, rx = in_plane(scene.array.tx_position), in_plane(scene.array.rx_position)
    world = outline(scene)
    tx_chains = chains(tx, world, 2 * bounces)
    to_tx = [chain for chain in tx_chains if len(chain.facets) <= bounces]
    same_array = np.array_equal(tx, rx)
    to_rx = to_tx if same_array else chains(rx, world, bounces)
    tx_ways = ways(tx, world, to_tx, bounces * curved)
    rx_ways = tx_ways if same_array else ways(rx, world, to_rx, bounces * curved)
    over_arcs = list(there_and_back(tx_ways, rx_ways, tx, world))
    spacing = speed_of_light / float(scene.band.frequency.mean()) if spacing is None else spacing
    rough = scatterers(scene, world, spacing=spacing, seed=seed)
    return Lit(scene, world, tx, rx, tx_chains, bounces, to_tx, to_rx, tx_ways, rx_ways, over_arcs, rough, edges)


def specular_paths(lit: Lit) -> list[Paths]:
    """The paths of all purely specular returns."""
    scene, world = lit.scene, lit.world
    found = mirror_returns(scene, world, [*lit.tx_chains[1:], *lit.over_arcs], lit.rx)
    found += glint_returns(scene, world, lit.to_tx, lit.to_rx)
    if lit.edges:
        # There, over the mirror that ends, and back: one mirror more than twice the chain.
        shorter = ([c for c in to if len(c.facets) < lit.bounces] for to in (lit.to_tx, lit.to_rx))
        found += edge_returns(scene, world, *shorter)
    return found


def tiled_parts(lit: Lit, tiles: int, field_bytes: float = BLOCK_BYTES, counts: Counts | None = None) -> Parts:
    """What a simulation in so many tiles holds at once where it holds most, by name [bytes]."""
    counts, pairs = counts or lit.counts, float(len(lit.tx) * len(lit.rx))
    held = {"sweep": 8.0 * pairs * lit.scene.band.points}
    to_scatterers = {"paths to scatterers": PATH_BYTES * counts.diffuse / tiles}
    points = float(len(lit.rough)) * max(len(lit.tx), len(lit.rx)) / tiles
    table = TRACED_BYTES + MIRROR_BYTES * lit.bounces
    if lit.tx_ways.chains or lit.rx_ways.chains:
        table = max(table, CURVED_BYTES)
    found = table - TRACED_BYTES + FOUND_BYTES
    largest = counts.largest / tiles
    tracing = {"tracing": max(table * points + found * largest, WORKED_BYTES * largest)}
    back = {"specular paths": PATH_BYTES * counts.specular}
    back_table = table + MIRROR_BYTES * lit.bounces
    tracing_back = {"tracing": max(back_table * pairs, WORKED_BYTES * counts.largest_specular)}
    columns = int(np.ceil(counts.used / tiles))
    each = 8.0 * (lit.antennas * columns + 2.0 * pairs)
    fields = {"fields": lit.block(columns, field_bytes) * each}
    return fullest(
        held | back | to_scatterers | tracing,
        held | back | tracing_back,
        held | back | to_scatterers | fields,
        {"sweep": held["sweep"], "its copies": 2.0 * held["sweep"]},
    )


def tiles_that_fit(lit: Lit, limit: float | None) -> tuple[int, float]:
    """The fewest tiles that fit into the memory, and what the fields of a block may take [bytes].

    Raises
    ------
    InputError
        If no number of tiles does.
    """
    room = ROOM_SHARE * room_below(limit)
    if not log.isEnabledFor(INFO) and total(tiled_parts(lit, 1, counts=lit.most)) <= room:
        return 1, BLOCK_BYTES  # and nothing has to be counted
    counted = f"scene {lit.scene.name!r}: {len(lit.tx)} x {len(lit.rx)} antennas and {len(lit.rough)} scatterers"
    for power in range(int(np.log2(MOST_TILES)) + 1):
        tiles = 2**power
        whole = total(tiled_parts(lit, tiles))
        if whole <= room:
            expect(tiled_parts(lit, tiles), counted, REMEDY, limit=limit)
            return tiles, BLOCK_BYTES
        narrow = FIELD_SHARE * max(room - 8.0 * len(lit.tx) * len(lit.rx) * lit.scene.band.points, 0.0)
        if narrow < BLOCK_BYTES and total(tiled_parts(lit, tiles, narrow)) <= room:
            expect(tiled_parts(lit, tiles, narrow), counted, REMEDY, limit=limit)
            return tiles, narrow
    lacking = (total(tiled_parts(lit, MOST_TILES, 0.0)) - room) / GIGABYTE
    raise InputError(
        f"{counted} need about {lacking:.3g} GB more than there may be, though they are taken in tiles; {REMEDY}"
    )


def estimate_rays(scene: Scene, *, bounces: int, seed: int, memory_limit: float | None = None) -> RayEstimate:
    """What a simulation would take, without doing it.

    Raises
    ------
    InputError
        If the scene cannot be simulated, or does not fit.
    """
    lit = light(scene, bounces=bounces, seed=seed)
    tiles, field_bytes = tiles_that_fit(lit, memory_limit)
    parts = tiled_parts(lit, tiles, field_bytes)
    remarks = [f"The memory does not hold all paths: the scatterers are taken in {tiles} tiles."] if tiles > 1 else []
    return RayEstimate(
        kind="estimate",
        scatterers=len(lit.rough),
        chains=len(lit.tx_chains),
        paths=round(lit.counts.diffuse + lit.counts.specular),
        frequencies=scene.band.points,
        sweep_bytes=8 * len(lit.tx) * len(lit.rx) * scene.band.points,
        tiles=tiles,
        memory_gb=total(parts) / GIGABYTE,
        parts_gb={name: nbytes / GIGABYTE for name, nbytes in parts.items()},
        remarks=remarks,
    )
