"""Memory of a simulation by rays, and the number of tiles of scatterers in which it fits.

The number of paths is estimated before all are traced: those of a few transmitters are counted, and the others are
assumed to have as many.
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
from mirrorfold.simulation.rays.chains_with_arcs import LONGEST, ChainsWithArcs, chains_with_arcs, there_and_back
from mirrorfold.simulation.rays.curved import MOST_PATHS, CurvedChain
from mirrorfold.simulation.rays.fermat import FACTS
from mirrorfold.simulation.rays.outline import Outline, outline_of
from mirrorfold.simulation.rays.paths import Chain, chains
from mirrorfold.simulation.rays.phasors import Paths, points_of
from mirrorfold.simulation.rays.returns import diffuse_paths, edge_returns, glint_returns, mirror_returns
from mirrorfold.simulation.rays.scatterers import Scatterers, draw_scatterers

LONGEST_BLOCK = 16
"""Largest number of frequencies in a block: the fields of all its frequencies are computed together."""

BLOCK_BYTES = 200e6
"""Largest size of the fields of a block [B]; larger blocks are shortened."""

FIELD_SHARE = 0.25
"""Share of the memory for paths and fields that the fields may take if memory is short."""

WAVES = 8
"""Number of waves above the threshold `WEAKEST_WAVE` of `slabs` that a half-transparent wall makes of one, at most."""

COUNTED = 5
"""Number of transmitters, evenly chosen, whose paths are counted beforehand."""

PATH_BYTES = 44.0
"""Memory of a path [B]: phasor, turn, bend, and the number of its scatterer."""

TRACED_BYTES = 24.0
"""Memory per pair of an antenna and a point while a chain is traced [B]: share, length and cosine at the point ..."""

MIRROR_BYTES = 8.0
"""... and in addition the cosine at each mirror of the chain [B]."""

CURVED_BYTES = 2.0 * (1.0 + 8.0 * (FACTS + LONGEST))
"""Memory per pair of an antenna and a point while a chain with an arc is traced [B]: two paths, each with a flag that
says whether it exists, its facts, and the cosines at its mirrors."""

FOUND_BYTES = 56.0
"""Memory per path of a chain while it is copied from these tables [B]: both ends twice, length, share and cosine at the
point."""

WORKED_BYTES = 232.0
"""Memory per path of a chain while phasors are made of its amplitudes at three frequencies [B]: 40 for the geometry, 48
for the amplitudes, 48 for those that are not zero, and six complex numbers in double precision."""

MOST_TILES = 256
"""Largest number of tiles: with as many, the fields of a block take most of the memory, no longer the paths."""

ROOM_SHARE = 0.8
"""Share of the free memory that a tile may take: not all that one tile frees is available to the next."""

REMEDY = "give fewer elements, frequencies, surfaces or bounces, close other programs, or raise the limit"


@dataclass(frozen=True, eq=False)
class VisibleScene:
    """A scene with its scatterers and with the chains over which its antennas see: all that is needed to trace paths.

    Attributes
    ----------
    scene : Scene
    outline : Outline
    tx, rx : (n, 2) arrays [m]
        Positions of transmitters and receivers.
    tx_chains : list of Chain
        Chains from the transmitters over up to ``2 bounces`` flat mirrors, for specular returns.
    bounces : int
    to_tx, to_rx : list of Chain
        Chains from the transmitters, and from the receivers, over up to `bounces` flat mirrors; the same list if both
        stand at the same places.
    tx_chains_with_arcs, rx_chains_with_arcs : ChainsWithArcs
        Chains with arcs among their few mirrors; the same object if both stand at the same places.
    over_arcs : list of CurvedChain
        Chains from the transmitters to the receivers with two reflections at arcs or more.
    scatterers : Scatterers
    edges : bool
        Whether the ends of mirrors radiate edge waves, and shadows have penumbras.
    """

    scene: Scene
    outline: Outline
    tx: Array
    rx: Array
    tx_chains: Sequence[Chain]
    bounces: int
    to_tx: Sequence[Chain]
    to_rx: Sequence[Chain]
    tx_chains_with_arcs: ChainsWithArcs
    rx_chains_with_arcs: ChainsWithArcs
    over_arcs: Sequence[CurvedChain]
    scatterers: Scatterers
    edges: bool

    @property
    def same_array(self) -> bool:
        """Whether transmitters and receivers stand at the same places."""
        return self.to_rx is self.to_tx

    @property
    def over_tx(self) -> list[Chain | CurvedChain]:
        """Chains over which the transmitters see scatterers."""
        return [*self.to_tx, *self.tx_chains_with_arcs.chains]

    @property
    def over_rx(self) -> list[Chain | CurvedChain]:
        """Chains over which the receivers see scatterers."""
        return [*self.to_rx, *self.rx_chains_with_arcs.chains]

    @property
    def antennas(self) -> int:
        """Number of antennas whose fields at the scatterers are computed: shared places count once."""
        return len(self.tx) + (0 if self.same_array else len(self.rx))

    def block(self, columns: int, nbytes: float) -> int:
        """Number of frequencies of a block whose fields at `columns` scatterers fit into `nbytes`."""
        each = 8 * (self.antennas * columns + len(self.tx) * len(self.rx))
        return int(np.clip(nbytes // each, 1, min(LONGEST_BLOCK, self.scene.band.points)))

    @cached_property
    def counts(self) -> Counts:
        """Estimated numbers of paths, from those of a few transmitters."""
        some = np.unique(np.linspace(0, len(self.tx) - 1, min(COUNTED, len(self.tx))).astype(int))
        few = replace(
            self,
            tx=self.tx[some],
            tx_chains=[chain.of(some) for chain in self.tx_chains],
            to_tx=[chain.of(some) for chain in self.to_tx],
            tx_chains_with_arcs=replace(
                self.tx_chains_with_arcs, chains=[chain.of(some) for chain in self.tx_chains_with_arcs.chains]
            ),
            over_arcs=[chain.of(some) for chain in self.over_arcs],
        )
        times = len(self.tx) / some.size
        pieces = diffuse_paths(self.scene, self.outline, few.over_tx, self.scatterers)
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
        """Numbers of paths if every antenna saw every point over every chain: an upper bound."""
        pairs, arcs, ends = len(self.tx) * len(self.rx), len(self.outline.arcs), 2 * len(self.outline.facets)
        each = MOST_PATHS if self.tx_chains_with_arcs.chains or self.over_arcs else 1  # paths over one sequence
        each *= WAVES ** len(self.outline.slabs)
        seen = len(self.tx) * len(self.over_tx) + (0 if self.same_array else len(self.rx) * len(self.over_rx))
        back = len(self.tx_chains) + len(self.over_arcs)
        back += ends * len(self.to_tx) + arcs * len(self.to_tx) * len(self.to_rx)
        return Counts(
            diffuse=float(each * len(self.scatterers) * seen),
            largest=float(each * len(self.scatterers) * max(len(self.tx), len(self.rx))),
            specular=float(each * pairs * back),
            largest_specular=float(each * pairs),
            used=len(self.scatterers),
        )


@dataclass(frozen=True)
class Counts:
    """Numbers of paths.

    Attributes
    ----------
    diffuse : float
        Paths from all antennas to scatterers.
    largest : float
        The part of them that leads over one chain, for the chain with most paths.
    specular, largest_specular : float
        The same for specular returns.
    used : int
        Number of scatterers that are seen.
    """

    diffuse: float
    largest: float
    specular: float
    largest_specular: float
    used: int


class RayEstimate(Record):
    """Size and memory of a simulation by rays, estimated beforehand."""

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


def find_visible(
    scene: Scene, *, bounces: int, seed: int, spacing: float | None = None, edges: bool = True, curved: bool = True
) -> VisibleScene:
    """Find the chains of mirrors of a scene and draw its scatterers; parameters as in `scattered_field`.

    Raises
    ------
    InputError
        If the scene is not two-dimensional, or has surfaces that rays cannot follow.
    """
    tx, rx = in_plane(scene.array.tx_position), in_plane(scene.array.rx_position)
    outline = outline_of(scene, penumbras=edges)
    tx_chains = chains(tx, outline, 2 * bounces)
    to_tx = [chain for chain in tx_chains if len(chain.facets) <= bounces]
    same_array = np.array_equal(tx, rx)
    to_rx = to_tx if same_array else chains(rx, outline, bounces)
    tx_chains_with_arcs = chains_with_arcs(tx, outline, to_tx, bounces * curved)
    rx_chains_with_arcs = tx_chains_with_arcs if same_array else chains_with_arcs(rx, outline, to_rx, bounces * curved)
    over_arcs = there_and_back(tx_chains_with_arcs, rx_chains_with_arcs, tx, outline)
    spacing = speed_of_light / float(scene.band.frequency.mean()) if spacing is None else spacing
    scatterers = draw_scatterers(scene, outline, spacing=spacing, seed=seed)
    return VisibleScene(
        scene,
        outline,
        tx,
        rx,
        tx_chains,
        bounces,
        to_tx,
        to_rx,
        tx_chains_with_arcs,
        rx_chains_with_arcs,
        over_arcs,
        scatterers,
        edges,
    )


def specular_paths(visible: VisibleScene) -> list[Paths]:
    """The paths of all purely specular returns: over mirrors, glints of arcs, and edge waves."""
    scene, outline = visible.scene, visible.outline
    found = mirror_returns(scene, outline, [*visible.tx_chains[1:], *visible.over_arcs], visible.rx)
    found += glint_returns(scene, outline, visible.to_tx, visible.to_rx)
    if visible.edges:
        # A chain out, the mirror with the end, the chain back: one mirror more than twice the length of the chain.
        shorter = ([c for c in to if len(c.facets) < visible.bounces] for to in (visible.to_tx, visible.to_rx))
        found += edge_returns(scene, outline, *shorter)
    return found


def tiled_parts(
    visible: VisibleScene, tiles: int, field_bytes: float = BLOCK_BYTES, counts: Counts | None = None
) -> Parts:
    """What a simulation in `tiles` tiles keeps in memory at the moment of largest demand, by name [B]."""
    counts, pairs = counts or visible.counts, float(len(visible.tx) * len(visible.rx))
    held = {"sweep": 8.0 * pairs * visible.scene.band.points}
    to_scatterers = {"paths to scatterers": PATH_BYTES * counts.diffuse / tiles}
    points = float(len(visible.scatterers)) * max(len(visible.tx), len(visible.rx)) / tiles
    table = TRACED_BYTES + MIRROR_BYTES * visible.bounces
    if visible.tx_chains_with_arcs.chains or visible.rx_chains_with_arcs.chains:
        table = max(table, CURVED_BYTES)
    found = table - TRACED_BYTES + FOUND_BYTES
    largest = counts.largest / tiles
    tracing = {"tracing": max(table * points + found * largest, WORKED_BYTES * largest)}
    back = {"specular paths": PATH_BYTES * counts.specular}
    back_table = table + MIRROR_BYTES * visible.bounces
    tracing_back = {"tracing": max(back_table * pairs, WORKED_BYTES * counts.largest_specular)}
    columns = int(np.ceil(counts.used / tiles))
    each = 8.0 * (visible.antennas * columns + 2.0 * pairs)
    fields = {"fields": visible.block(columns, field_bytes) * each}
    return fullest(
        held | back | to_scatterers | tracing,
        held | back | tracing_back,
        held | back | to_scatterers | fields,
        {"sweep": held["sweep"], "its copies": 2.0 * held["sweep"]},
    )


def tiles_that_fit(visible: VisibleScene, limit: float | None) -> tuple[int, float]:
    """The fewest tiles that fit into the memory, and the size that the fields of a block may have [B].

    Raises
    ------
    InputError
        If no number of tiles up to `MOST_TILES` fits.
    """
    room = ROOM_SHARE * room_below(limit)
    if not log.isEnabledFor(INFO) and total(tiled_parts(visible, 1, counts=visible.most)) <= room:
        return 1, BLOCK_BYTES  # the upper bound fits already, so that no paths have to be counted
    antennas = f"{len(visible.tx)} x {len(visible.rx)} antennas"
    counted = f"scene {visible.scene.name!r}: {antennas} and {len(visible.scatterers)} scatterers"
    for power in range(int(np.log2(MOST_TILES)) + 1):
        tiles = 2**power
        whole = total(tiled_parts(visible, tiles))
        if whole <= room:
            expect(tiled_parts(visible, tiles), counted, REMEDY, limit=limit)
            return tiles, BLOCK_BYTES
        narrow = FIELD_SHARE * max(room - 8.0 * len(visible.tx) * len(visible.rx) * visible.scene.band.points, 0.0)
        if narrow < BLOCK_BYTES and total(tiled_parts(visible, tiles, narrow)) <= room:
            expect(tiled_parts(visible, tiles, narrow), counted, REMEDY, limit=limit)
            return tiles, narrow
    lacking = (total(tiled_parts(visible, MOST_TILES, 0.0)) - room) / GIGABYTE
    raise InputError(
        f"{counted} need about {lacking:.3g} GB more than there may be, though they are taken in tiles; {REMEDY}"
    )


def estimate_rays(scene: Scene, *, bounces: int, seed: int, memory_limit: float | None = None) -> RayEstimate:
    """Size and memory of a simulation by rays, estimated without running it.

    Raises
    ------
    InputError
        If the scene cannot be simulated, or does not fit.
    """
    visible = find_visible(scene, bounces=bounces, seed=seed)
    tiles, field_bytes = tiles_that_fit(visible, memory_limit)
    parts = tiled_parts(visible, tiles, field_bytes)
    remarks = [f"The memory does not hold all paths: the scatterers are taken in {tiles} tiles."] if tiles > 1 else []
    return RayEstimate(
        kind="estimate",
        scatterers=len(visible.scatterers),
        chains=len(visible.tx_chains),
        paths=round(visible.counts.diffuse + visible.counts.specular),
        frequencies=scene.band.points,
        sweep_bytes=8 * len(visible.tx) * len(visible.rx) * scene.band.points,
        tiles=tiles,
        memory_gb=total(parts) / GIGABYTE,
        parts_gb={name: nbytes / GIGABYTE for name, nbytes in parts.items()},
        remarks=remarks,
    )
