"""Paths with their amplitudes, by kind: to diffuse scatterers, and specular returns over mirrors, edges and arcs.

Every function traces the paths of one kind and multiplies, for each path, the coefficients of all mirrors and walls on
the way with the spreading of the wave. The amplitudes are evaluated at three frequencies, the `_knots`; `Paths`
interpolates between them. A half-transparent wall turns one path into several, one for each wave of its `WaveSeries`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.types import Array, Complex
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.simulation.rays.curved import CurvedChain, trace_curved
from mirrorfold.simulation.rays.edges import edge_factor, edge_waves
from mirrorfold.simulation.rays.glints import Glints, glints, sees_arc
from mirrorfold.simulation.rays.outline import Outline
from mirrorfold.simulation.rays.paths import Chain, ChainPaths, Points, trace
from mirrorfold.simulation.rays.phasors import Paths
from mirrorfold.simulation.rays.scatterers import Scatterers, named
from mirrorfold.simulation.rays.slabs import (
    WaveSeries,
    passages,
    product_of_series,
    reflected,
    reflected_in_turn,
    thickness_of,
    transmitted,
)

LIT = 0.5
"""A return that reaches no receiver with this share of its amplitude is left out. The same chain in the other direction
may not be among the chains, where no antenna sees its mirrors outside of penumbras."""


def _knots(band: Band) -> Array:
    """Both ends of the band and its middle, (3, 1) array [Hz]."""
    return np.array([[band.start], [band.middle], [band.stop]])


def _traced(chain: Chain | CurvedChain, points: Points, outline: Outline, *, sharp: int = -1) -> ChainPaths:
    """The paths to points over a chain of flat mirrors, see `trace`, or over a chain with arcs."""
    return trace_curved(chain, points) if isinstance(chain, CurvedChain) else trace(chain, points, outline, sharp=sharp)


def _mirrors(scene: Scene, outline: Outline, chain: Chain | CurvedChain, cosine: Array) -> WaveSeries:
    """Waves after reflection at the mirrors of a chain, at the knots; `cosine` (mirrors, paths) of the incidence."""
    surfaces = [scene.surface[outline.surface[facet]] for facet in chain.facets]
    return reflected_in_turn(surfaces, _knots(scene.band), cosine, named(scene.polarization))


def _walls(
    scene: Scene, outline: Outline, chain: Chain | CurvedChain, antenna: NDArray[np.intp], end: Array
) -> list[WaveSeries]:
    """Waves that each half-transparent wall lets through, on paths from antennas over a chain to `end` (paths, 2)."""
    if isinstance(chain, CurvedChain) or not outline.slabs:
        return []
    return [
        transmitted(scene.surface[outline.surface[facet]], _knots(scene.band), cosine, named(scene.polarization))
        for facet, cosine in passages(chain, antenna, end, outline)
    ]


def diffuse_paths(
    scene: Scene, outline: Outline, seen_over: Sequence[Chain | CurvedChain], scatterers: Scatterers
) -> list[Paths]:
    """The one-way paths from the antennas to the scatterers.

    The scattering strength is a product of a factor for the way in and one for the way out; each amplitude holds the
    factor of its own way, see `scatterers`.
    """
    found = []
    for chain in seen_over:
        paths = _traced(chain, scatterers.points, outline)
        walls = _walls(scene, outline, chain, paths.antenna, scatterers.points.position[paths.point])
        law_of_path = scatterers.law[paths.point]
        # A half-transparent wall scatters at its face, which lies half its thickness in front of the outline.
        before = np.array([0.5 * (thickness_of(law.surface) or 0.0) for law in scatterers.laws])
        ahead = before[law_of_path] * paths.end_cosine if before.any() else 0.0
        for amplitude, extra in product_of_series(_mirrors(scene, outline, chain, paths.cosine), *walls):
            amplitude *= scatterers.weight[paths.point] * paths.spread(speed_of_light / _knots(scene.band))
            for index in np.unique(law_of_path):
                mine = law_of_path == index
                amplitude[:, mine] *= scatterers.laws[index].factor(_knots(scene.band), paths.end_cosine[mine])
            length = paths.length + extra - ahead
            found.append(
                Paths.at_first_frequency(scene.band, chain.count, paths.antenna, paths.point, length, amplitude)
            )
    return found


def mirror_returns(scene: Scene, outline: Outline, seen_over: Sequence[Chain | CurvedChain], rx: Array) -> list[Paths]:
    """The paths from the transmitters over chains of mirrors to the receivers."""
    found = []
    receivers = Points.free(rx)
    for chain in seen_over:
        facets = chain.facets
        # A return over the same chain there and back turns at a mirror whose ends radiate edge waves.
        turn = len(facets) // 2 if facets == facets[::-1] else -1
        paths = _traced(chain, receivers, outline, sharp=turn)
        if (np.abs(paths.share) >= LIT).any():
            walls = _walls(scene, outline, chain, paths.antenna, rx[paths.point])
            for amplitude, extra in product_of_series(_mirrors(scene, outline, chain, paths.cosine), *walls):
                amplitude = amplitude * paths.spread(speed_of_light / _knots(scene.band))
                length = paths.length + extra
                found.append(
                    Paths.at_first_frequency(scene.band, chain.count, paths.antenna, paths.point, length, amplitude)
                )
    return found


def edge_returns(scene: Scene, outline: Outline, to_tx: Sequence[Chain], to_rx: Sequence[Chain]) -> list[Paths]:
    """The waves diffracted at the ends of all mirrors, out and back over the same chain."""
    found = []
    back = {chain.facets: chain for chain in to_rx}
    for waves in edge_waves(to_tx, to_rx, outline):
        surface = scene.surface[outline.surface[waves.facet]]
        end = np.broadcast_to(waves.edge, (waves.tx.size, 2))
        met = product_of_series(
            _mirrors(scene, outline, waves.chain, waves.tx_cosine),
            _mirrors(scene, outline, waves.chain, waves.rx_cosine),
            reflected(surface, _knots(scene.band), waves.end_cosine, named(scene.polarization)),
            *_walls(scene, outline, waves.chain, waves.tx, end),
            *_walls(scene, outline, back[waves.chain.facets], waves.rx, end),
        )
        for coefficient, extra in met:
            amplitude = coefficient * edge_factor(waves, speed_of_light / _knots(scene.band))
            antennas = waves.chain.images.shape[1]
            length = waves.length + extra
            found.append(Paths.at_first_frequency(scene.band, antennas, waves.tx, waves.rx, length, amplitude))
    return found


def glint_returns(scene: Scene, outline: Outline, to_tx: Sequence[Chain], to_rx: Sequence[Chain]) -> list[Paths]:
    """The glints of all arcs, for every pair of a chain on the way out and a chain on the way back that see the arc."""
    found = []
    for index, arc in enumerate(outline.arcs):
        surface = scene.surface[outline.surface[len(outline.facets) + index]]
        tx_chains = [chain for chain in to_tx if sees_arc(chain, arc, outline)]
        rx_chains = tx_chains if to_rx is to_tx else [chain for chain in to_rx if sees_arc(chain, arc, outline)]
        for tx_chain, rx_chain in product(tx_chains, rx_chains):
            glint = glints(arc, tx_chain, rx_chain, outline)
            if not glint.length.size:
                continue
            met = product_of_series(
                _mirrors(scene, outline, tx_chain, glint.tx_cosine),
                _mirrors(scene, outline, rx_chain, glint.rx_cosine),
                reflected(surface, _knots(scene.band), glint.end_cosine, named(scene.polarization)),
                *_walls(scene, outline, tx_chain, glint.tx, glint.place),
                *_walls(scene, outline, rx_chain, glint.rx, glint.place),
            )
            for coefficient, extra in met:
                amplitude = coefficient * _glint_spreading(
                    glint, arc_length=arc[2] * arc[4], frequency=_knots(scene.band)
                )
                antennas = tx_chain.images.shape[1]
                length = glint.length + extra
                found.append(Paths.at_first_frequency(scene.band, antennas, glint.tx, glint.rx, length, amplitude))
    return found


def _glint_spreading(glint: Glints, *, arc_length: float, frequency: Array) -> Complex:
    """Spreading factor of glints, limited near caustics, with the phase gained there, shape (frequencies, glints).

    See `glints` for the formulas.
    """
    with np.errstate(divide="ignore"):
        optics = 1.0 / np.sqrt(np.abs(glint.spreading))
    aperture = np.sqrt(frequency / speed_of_light) * glint.end_cosine * arc_length / np.sqrt(glint.legs)
    caustic = np.where(glint.spreading < 0.0, 1.0j, 1.0)
    return np.asarray(glint.share * np.minimum(optics, aperture) * caustic)
