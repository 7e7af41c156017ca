"""Ray simulation in two dimensions: specular paths of geometrical optics and frozen diffuse scatterers.

The field of every antenna at every scatterer is the sum over the direct ray and the paths over all chains of
mirrors, ``A[n, s] = sum over paths of prod(R rho) exp(-j k d) / sqrt(d)`` times the scatterer's factor. By reciprocity
the diffuse part of the sweep is ``S = A_tx A_rx^T``, one matrix product per frequency, which holds all mixed paths
(there over one chain, back over another). To it come the purely specular returns: mirrors and corners by chains of
images, arcs and circles by their glints, and the waves from the ends of mirrors, with which a return fades instead of
stopping at once.

Arcs are mirrors, too: on each way there may be two mirrors with an arc among them, and any number of flat ones.

What is left out: edge waves of arcs, of shadows, and of a mirror after another has reflected the wave; light that
scatters diffusely twice; longer chains with arcs; and what passes through a surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares, products
from mirrorfold.common.types import Array, Complex
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.simulation.plane import in_plane
from mirrorfold.simulation.rays.curved import CurvedChain, trace_curved
from mirrorfold.simulation.rays.edges import edge_factor, edge_waves
from mirrorfold.simulation.rays.glints import Glints, glints, sees_arc
from mirrorfold.simulation.rays.outline import Outline, outline
from mirrorfold.simulation.rays.paths import Chain, ChainPaths, Points, chains, trace
from mirrorfold.simulation.rays.scatterers import Scatterers, scatterers, specular_coefficient
from mirrorfold.simulation.rays.ways import there_and_back, ways

LONGEST_BLOCK = 16
"""Frequencies whose fields are computed in one go."""

BLOCK_BYTES = 200e6
"""Size of the fields of a block, above which it is made shorter."""

TILE = 512
"""Paths that are taken through a block at a time; their phasors stay in the first-level cache."""


def scattered_field(
    scene: Scene,
    *,
    bounces: int,
    seed: int,
    spacing: float | None = None,
    edges: bool = True,
    curved: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.complex64]:
    """What each receiver measures of each transmitter, for sources with the field ``exp(-j k d) / sqrt(d)``.

    Parameters
    ----------
    scene : Scene
    bounces : int
        Largest number of mirrors between an antenna and what scatters; twice as many in purely specular returns.
    seed : int
    spacing : float [m], optional
        Mean distance of the diffuse scatterers along the outlines; by default the wavelength at mid-band.
    edges : bool
        Whether the ends of mirrors radiate; without, specular returns are those of geometrical optics.
    curved : bool
        Whether arcs are mirrors on the way to something else; without, they scatter and glint alone.
    progress : callable, optional
        Called as ``progress(done, total)`` after every block of frequencies.

    Returns
    -------
    (frequencies, tx, rx) complex64 array

    Raises
    ------
    InputError
        If the scene is not a two-dimensional one of surfaces that rays can follow.
    """
    frequency = scene.band.frequency
    tx, rx = in_plane(scene.array.tx_position), in_plane(scene.array.rx_position)
    same_array = np.array_equal(tx, rx)
    world = outline(scene)
    tx_chains = chains(tx, world, 2 * bounces)
    to_tx = [chain for chain in tx_chains if len(chain.facets) <= bounces]
    to_rx = to_tx if same_array else chains(rx, world, bounces)

    spacing = speed_of_light / float(frequency.mean()) if spacing is None else spacing
    rough = scatterers(scene, world, spacing=spacing, seed=seed)
    tx_ways = ways(tx, world, to_tx, bounces * curved)
    rx_ways = tx_ways if same_array else ways(rx, world, to_rx, bounces * curved)
    from_tx = _diffuse(scene, world, [*to_tx, *tx_ways.chains], rough)
    from_rx = from_tx if same_array else _diffuse(scene, world, [*to_rx, *rx_ways.chains], rough)
    over_arcs = there_and_back(tx_ways, rx_ways, tx, world)
    specular = _mirror_returns(scene, world, [*tx_chains[1:], *over_arcs], rx)
    specular += _glint_returns(scene, world, to_tx, to_rx)
    if edges:
        # There, over the mirror that ends, and back: one mirror more than twice the chain.
        specular += _edge_returns(scene, world, *([c for c in to if len(c.facets) < bounces] for to in (to_tx, to_rx)))
    # A scatterer counts where both ways reach it.
    used = np.intersect1d(_points(from_tx), _points(from_rx)).astype(np.int32)
    from_tx = [paths.renumbered(used) for paths in from_tx]
    from_rx = from_tx if same_array else [paths.renumbered(used) for paths in from_rx]

    per_frequency = 8 * (len(tx) * (used.size + len(rx)) + (0 if same_array else len(rx) * used.size))
    block = int(np.clip(BLOCK_BYTES // per_frequency, 1, LONGEST_BLOCK))
    s = np.empty((frequency.size, len(tx), len(rx)), dtype=np.complex64)
    for first in range(0, frequency.size, block):
        part = s[first : first + block]
        tx_field = _next_fields(from_tx, (len(part), len(tx), used.size))
        rx_field = tx_field if same_array else _next_fields(from_rx, (len(part), len(rx), used.size))
        products(tx_field, rx_field.transpose(0, 2, 1), out=part)
        part += _next_fields(specular, part.shape)
        if progress is not None:
            progress(first + len(part), frequency.size)
    return s


@dataclass(frozen=True, eq=False)
class _Paths:
    """Some paths, and their phasors as they proceed from one frequency to the next.

    Between the two ends of the band and its middle, where an amplitude a is evaluated, its logarithm is taken for a
    parabola in frequency, which roughness makes it nearly. The phasor ``a exp(-j k d)`` then changes from frequency
    to frequency by a factor that itself changes by a constant one.

    Attributes
    ----------
    start : (n + 1,) array of int
        Where the paths of each antenna begin.
    point : (paths,) array of int
        Column of the table of fields.
    phasor : (paths,) complex array
        At the next frequency.
    turn : (paths,) complex array
        Factor from the next frequency to the one after it.
    bend : (paths,) complex array
        Relative change of that factor from step to step. It is small; complex64 keeps it exactly enough.
    """

    start: NDArray[np.int64]
    point: NDArray[np.int32]
    phasor: Complex
    turn: Complex
    bend: NDArray[np.complex64]

    @classmethod
    def at_first_frequency(
        cls,
        band: Band,
        antennas: int,
        antenna: NDArray[np.intp],
        point: NDArray[np.intp],
        length: Array,
        amplitude: Complex,
    ) -> _Paths:
        """Paths sorted by antenna, with their (3, paths) amplitudes at the `_knots` of the band."""
        keep = np.all(amplitude != 0.0, axis=0)
        low, middle, high = amplitude[:, keep]
        length = length[keep]
        growth = np.log(high / low)
        curvature = 2.0 * growth - 4.0 * np.log(middle / low)
        wavenumber = 2.0 * np.pi * band.frequency / speed_of_light
        steps = band.points - 1
        wavenumber_step = (wavenumber[-1] - wavenumber[0]) / steps
        # With x from 0 to 1 over the band, a(x) = low exp(growth x + curvature x (x - 1)).
        return cls(
            start=np.searchsorted(antenna[keep], np.arange(antennas + 1)),
            point=point[keep].astype(np.int32),
            phasor=low * np.exp(-1j * wavenumber[0] * length),
            turn=np.exp(growth / steps + curvature * (1.0 - steps) / steps**2 - 1j * wavenumber_step * length),
            bend=np.expm1(2.0 * curvature / steps**2).astype(np.complex64),
        )

    def proceed(self, field: NDArray[np.complex64]) -> None:
        """Add the paths to the fields (frequencies, n, points), and go on to the frequency after these."""
        in_shares(_proceed, field.shape[1], self.start, self.point, self.phasor, self.turn, self.bend, field)

    def renumbered(self, points: NDArray[np.int32]) -> _Paths:
        """The paths to the given points (sorted) alone, which become columns 0, 1, 2 ..."""
        column = np.minimum(np.searchsorted(points, self.point), max(points.size - 1, 0)).astype(np.int32)
        keep = points[column] == self.point if points.size else np.zeros(self.point.size, dtype=bool)
        return _Paths(
            start=np.concatenate([[0], np.cumsum(keep)])[self.start],
            point=column[keep],
            phasor=self.phasor[keep],
            turn=self.turn[keep],
            bend=self.bend[keep],
        )


def _points(pieces: Sequence[_Paths]) -> NDArray[np.int32]:
    """The points to which any path leads, in rising order."""
    return np.unique(np.concatenate([np.unique(paths.point) for paths in pieces]))


def _knots(band: Band) -> Array:
    """Both ends of the band and its middle, (3, 1) array [Hz]."""
    return np.array([[band.start], [0.5 * (band.start + band.stop)], [band.stop]])


def _reflections(scene: Scene, world: Outline, chain: Chain | CurvedChain, cosine: Array) -> Complex:
    """Product of the specular coefficients along a chain at the knots of the band, shape (3, paths)."""
    coefficient = np.ones((3, cosine.shape[1]), dtype=complex)
    for facet, at_mirror in zip(chain.facets, cosine, strict=True):
        coefficient *= specular_coefficient(scene.surface[world.surface[facet]], _knots(scene.band), at_mirror)
    return coefficient


def _diffuse(scene: Scene, world: Outline, seen_over: Sequence[Chain | CurvedChain], rough: Scatterers) -> list[_Paths]:
    """The paths from the antennas to the scatterers; each amplitude holds one way's share of the scattering."""
    found = []
    for chain in seen_over:
        paths = _traced(chain, rough.points, world)
        amplitude = _reflections(scene, world, chain, paths.cosine)
        amplitude *= rough.weight[paths.point] * paths.spread(speed_of_light / _knots(scene.band))
        law_of_path = rough.law[paths.point]
        for index in np.unique(law_of_path):
            mine = law_of_path == index
            amplitude[:, mine] *= rough.laws[index].factor(_knots(scene.band), paths.end_cosine[mine])
        found.append(
            _Paths.at_first_frequency(scene.band, chain.count, paths.antenna, paths.point, paths.length, amplitude)
        )
    return found


def _traced(chain: Chain | CurvedChain, points: Points, world: Outline) -> ChainPaths:
    """The paths over a chain of flat mirrors, or over a sequence with arcs."""
    return trace_curved(chain, points) if isinstance(chain, CurvedChain) else trace(chain, points, world)


def _mirror_returns(scene: Scene, world: Outline, seen_over: Sequence[Chain | CurvedChain], rx: Array) -> list[_Paths]:
    """The paths from the transmitters over chains of mirrors to the receivers."""
    found = []
    receivers = Points.free(rx)
    for chain in seen_over:
        paths = _traced(chain, receivers, world)
        if paths.length.size:
            amplitude = _reflections(scene, world, chain, paths.cosine)
            amplitude = amplitude * paths.spread(speed_of_light / _knots(scene.band))
            found.append(
                _Paths.at_first_frequency(scene.band, chain.count, paths.antenna, paths.point, paths.length, amplitude)
            )
    return found


def _edge_returns(scene: Scene, world: Outline, to_tx: Sequence[Chain], to_rx: Sequence[Chain]) -> list[_Paths]:
    """The waves from the ends of all mirrors, there and back over the same chain."""
    found = []
    for waves in edge_waves(to_tx, to_rx, world):
        surface = scene.surface[world.surface[waves.facet]]
        amplitude = (
            _reflections(scene, world, waves.chain, waves.tx_cosine)
            * _reflections(scene, world, waves.chain, waves.rx_cosine)
            * specular_coefficient(surface, _knots(scene.band), waves.end_cosine)
            * edge_factor(waves, speed_of_light / _knots(scene.band))
            / np.sqrt(waves.specular)
        )
        antennas = waves.chain.images.shape[1]
        found.append(_Paths.at_first_frequency(scene.band, antennas, waves.tx, waves.rx, waves.length, amplitude))
    return found


def _glint_returns(scene: Scene, world: Outline, to_tx: Sequence[Chain], to_rx: Sequence[Chain]) -> list[_Paths]:
    """The glints of all arcs, with every chain that sees an arc on either way."""
    found = []
    for index, arc in enumerate(world.arcs):
        surface = scene.surface[world.surface[len(world.facets) + index]]
        tx_chains = [chain for chain in to_tx if sees_arc(chain, arc, world)]
        rx_chains = tx_chains if to_rx is to_tx else [chain for chain in to_rx if sees_arc(chain, arc, world)]
        for tx_chain, rx_chain in product(tx_chains, rx_chains):
            glint = glints(arc, tx_chain, rx_chain, world)
            if glint.length.size:
                amplitude = (
                    _reflections(scene, world, tx_chain, glint.tx_cosine)
                    * _reflections(scene, world, rx_chain, glint.rx_cosine)
                    * specular_coefficient(surface, _knots(scene.band), glint.end_cosine)
                    * _glint_spreading(glint, arc_length=arc[2] * arc[4], frequency=_knots(scene.band))
                )
                antennas = tx_chain.images.shape[1]
                found.append(
                    _Paths.at_first_frequency(scene.band, antennas, glint.tx, glint.rx, glint.length, amplitude)
                )
    return found


def _glint_spreading(glint: Glints, *, arc_length: float, frequency: Array) -> Complex:
    """Spreading of glints with its limit at caustics and the phase gained there, shape (frequencies, glints)."""
    with np.errstate(divide="ignore"):
        optics = 1.0 / np.sqrt(np.abs(glint.spreading))
    aperture = np.sqrt(frequency / speed_of_light) * glint.end_cosine * arc_length / np.sqrt(glint.legs)
    caustic = np.where(glint.spreading < 0.0, 1.0j, 1.0)
    return np.asarray(glint.share * np.minimum(optics, aperture) * caustic)


def _next_fields(pieces: Sequence[_Paths], shape: tuple[int, ...]) -> NDArray[np.complex64]:
    """Fields at the next frequencies, shape (frequencies, n, points); the paths then stand at the one after these."""
    field = np.zeros(shape, dtype=np.complex64)
    for paths in pieces:
        paths.proceed(field)
    return field


@njit(error_model="numpy", nogil=True)
def _proceed(
    start: NDArray[np.int64],
    point: NDArray[np.int32],
    phasor: Complex,
    turn: Complex,
    bend: NDArray[np.complex64],
    field: NDArray[np.complex64],
    first_antenna: int,
    last_antenna: int,
) -> None:
    """Add the phasors to the field (frequencies, n, points), and take them from each frequency to the next.

    For the antennas n from the first up to, and without, the last.
    """
    for n in range(first_antenna, last_antenna):
        for first in range(start[n], start[n + 1], TILE):
            last = min(first + TILE, start[n + 1])
            for f in range(field.shape[0]):
                for i in range(first, last):
                    field[f, n, point[i]] += phasor[i]
                for i in range(first, last):
                    phasor[i] *= turn[i]
                    turn[i] *= 1.0 + bend[i]
