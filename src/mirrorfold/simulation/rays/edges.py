"""Edge waves: what the ends of straight mirrors add to the specular returns, so that these do not stop at once.

Seen by physical optics, a mirror that ends returns the stationary-phase value of an endless one times a Fresnel
integral for each end (Born and Wolf, Principles of Optics, section 8.7). With the detour ``D`` of the path over
the end against the specular one, and ``v = sqrt(4 D / lambda)``, the integral is the step of geometrical optics less
or plus a wave from the end,

    G(v) = exp(j pi v^2 / 2) (1 + j) / 2 * integral from v to infinity of exp(-j pi t^2 / 2) dt,

a half on the edge of the beam and ``1 / (sqrt(2) pi v)`` far from it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import wofz

from mirrorfold.common.geometry import reflect, segment_normal, signed_distance
from mirrorfold.common.types import Array
from mirrorfold.simulation.rays.outline import TOUCH, Outline
from mirrorfold.simulation.rays.paths import Chain, Points, trace

INSET = 1e-3
"""Distance [m] from its end at which a mirror has to be lit: about the wavelength."""


@dataclass(frozen=True, eq=False)
class EdgeWaves:
    """The waves from one end of a mirror, between transmitters and receivers that see it over the same chain.

    Attributes
    ----------
    chain : Chain
        Of the transmitters' side.
    facet : int
        The mirror that ends.
    edge : (2,) array [m]
        Its end.
    tx, rx : (waves,) int arrays
    length : (waves,) array [m]
        Of the path over the end.
    specular : (waves,) array [m]
        Of the specular path, which may miss the mirror.
    sign : (waves,) array
        -1 where the specular point lies on the mirror's side of the end, +1 beyond it.
    tx_cosine, rx_cosine : (bounces, waves) arrays
        Of the angles of incidence on the mirrors of the chain.
    end_cosine : (waves,) array
        Of the angle of incidence on the mirror that ends, for the specular path.
    """

    chain: Chain
    facet: int
    edge: Array
    tx: NDArray[np.intp]
    rx: NDArray[np.intp]
    length: Array
    specular: Array
    sign: Array
    tx_cosine: Array
    rx_cosine: Array
    end_cosine: Array


def edge_waves(tx_chains: Sequence[Chain], rx_chains: Sequence[Chain], world: Outline) -> Iterator[EdgeWaves]:
    """The edge waves of all ends of mirrors, there and back over the same chain.

    Parameters
    ----------
    tx_chains, rx_chains : sequences of Chain
        From the transmitters and from the receivers.
    world : Outline
    """
    from_receivers = {chain.facets: chain for chain in rx_chains}
    for tx_chain in tx_chains:
        rx_chain = from_receivers.get(tx_chain.facets)
        if rx_chain is None:
            continue
        for facet, (start, end) in enumerate(world.facets):
            if tx_chain.facets and tx_chain.facets[-1] == facet:
                continue
            for edge, other in ((start, end), (end, start)):
                waves = _waves(tx_chain, rx_chain, facet, edge, other, world)
                if waves.length.size:
                    yield waves


def _waves(tx_chain: Chain, rx_chain: Chain, facet: int, edge: Array, other: Array, world: Outline) -> EdgeWaves:
    """The waves from the end `edge` of the mirror between `edge` and `other`."""
    inward = (other - edge) / np.linalg.norm(other - edge)
    normal = segment_normal(edge, other)
    lit = Points.free((edge + INSET * inward)[None])
    there = trace(tx_chain, lit, world)
    back = there if rx_chain is tx_chain else trace(rx_chain, lit, world)
    tx, rx = (i.ravel() for i in np.indices((there.antenna.size, back.antenna.size)))
    source, target = tx_chain.images[-1][there.antenna[tx]], rx_chain.images[-1][back.antenna[rx]]
    above, beyond = signed_distance(source, edge, normal), signed_distance(target, edge, normal)
    # A mirror joined at an inner angle goes on as a corner, which has no edge.
    joined = _inner_side(facet, edge, normal, world)
    keep = (above * beyond > TOUCH**2) & (np.sign(above) != joined)
    tx, rx, source, target, above, beyond = (a[keep] for a in (tx, rx, source, target, above, beyond))
    image = reflect(source, edge, normal)
    specular = np.linalg.norm(target - image, axis=-1)
    along_source, along_target = (source - edge) @ inward, (target - edge) @ inward
    foot = (along_source * np.abs(beyond) + along_target * np.abs(above)) / (np.abs(above) + np.abs(beyond))
    return EdgeWaves(
        chain=tx_chain,
        facet=facet,
        edge=edge,
        tx=there.antenna[tx],
        rx=back.antenna[rx],
        length=np.linalg.norm(source - edge, axis=-1) + np.linalg.norm(target - edge, axis=-1),
        specular=specular,
        sign=np.where(foot > 0.0, -1.0, 1.0),
        tx_cosine=there.cosine[:, tx],
        rx_cosine=back.cosine[:, rx],
        end_cosine=(np.abs(above) + np.abs(beyond)) / specular,
    )


def _inner_side(facet: int, edge: Array, normal: Array, world: Outline) -> float:
    """The side (sign along `normal`) to which another mirror goes on from the same point; 0 for none."""
    for index, ends in enumerate(world.facets):
        at_edge = np.linalg.norm(ends - edge, axis=-1) < TOUCH
        if index != facet and at_edge.any():
            return float(np.sign((ends[int(np.argmin(at_edge))] - edge) @ normal))
    return 0.0


def edge_factor(waves: EdgeWaves, wavelength: Array) -> NDArray[np.complex128]:
    """``sign G(v)`` at wavelengths [m] (n, 1), shape (n, waves).

    The Fresnel integral is an error function, ``G(v) = exp(z^2) erfc(z) / 2`` with ``z = sqrt(j pi / 2) v``.
    """
    v = np.sqrt(4.0 * np.maximum(waves.length - waves.specular, 0.0) / wavelength)
    z = np.sqrt(0.5j * np.pi) * v
    return np.asarray(waves.sign * 0.5 * wofz(1j * z))
