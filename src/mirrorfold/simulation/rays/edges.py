"""Edge waves: diffraction at the ends of straight mirrors, so that specular returns fade instead of stopping abruptly.

In physical optics, a mirror of finite length returns the stationary-phase value of an infinite mirror times a Fresnel
integral for each end (Born and Wolf, Principles of Optics, section 8.7). Let ``D`` be the length of the path over the
end minus that of the specular path, and ``v = sqrt(4 D / lambda)``. The integral is the unit step of geometrical optics
minus (specular point on the mirror) or plus (beyond its end) the wave from the end,

    G(v) = exp(j pi v^2 / 2) (1 + j) / 2 * integral from v to infinity of exp(-j pi t^2 / 2) dt,

whose magnitude is 1/2 on the edge of the beam and ``1 / (sqrt(2) pi v)`` far from it. Over the end of length L, and the
specular path of length l, the wave spreads as ``sqrt(2 / (L + l))``. So it is the reflected part of Sommerfeld's exact
solution for a half-plane at all angles (Born and Wolf, section 11.7), and far from the beam of Keller's wave.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import wofz

from mirrorfold.common.geometry import reflect, segment_normal, signed_distance
from mirrorfold.common.types import Array, Complex
from mirrorfold.simulation.rays.outline import TOUCH, Outline
from mirrorfold.simulation.rays.paths import Chain, Points, trace
from mirrorfold.simulation.rays.penumbras import EDGE

INSET = 1e-3
"""Distance [m] from the end of a mirror at which antennas must see the mirror for an edge wave: about a wavelength."""


@dataclass(frozen=True, eq=False)
class EdgeWaves:
    """The waves from one end of a mirror, between transmitters and receivers that see it over the same chain.

    Attributes
    ----------
    chain : Chain
        From the transmitters to the mirror.
    facet : int
        Number of the mirror.
    edge : (2,) array [m]
        The end of the mirror.
    tx, rx : (waves,) int arrays
        Numbers of the transmitter and of the receiver of each wave.
    length : (waves,) array [m]
        Length of the path from transmitter over the end to receiver.
    specular : (waves,) array [m]
        Length of the specular path over the line of the mirror; its specular point may lie beyond the end.
    share : (waves,) complex array
        Share of the amplitude that arrives, see `ChainPaths`.
    sign : (waves,) array
        -1 where the specular point lies on the mirror's side of the end, +1 beyond the end, and 0 on the end itself,
        where the specular path has a half of its amplitude.
    tx_cosine, rx_cosine : (bounces, waves) arrays
        Cosines of the angles of incidence on the mirrors of the chain, on the way out and back.
    end_cosine : (waves,) array
        Cosine of the angle of incidence of the specular path on the mirror.
    """

    chain: Chain
    facet: int
    edge: Array
    tx: NDArray[np.intp]
    rx: NDArray[np.intp]
    length: Array
    specular: Array
    share: Complex
    sign: Array
    tx_cosine: Array
    rx_cosine: Array
    end_cosine: Array


def edge_waves(tx_chains: Sequence[Chain], rx_chains: Sequence[Chain], outline: Outline) -> Iterator[EdgeWaves]:
    """The edge waves of all ends of mirrors, out and back over the same chain.

    Parameters
    ----------
    tx_chains, rx_chains : sequences of Chain
        Chains from the transmitters and from the receivers.
    outline : Outline
    """
    from_receivers = {chain.facets: chain for chain in rx_chains}
    for tx_chain in tx_chains:
        rx_chain = from_receivers.get(tx_chain.facets)
        if rx_chain is None:
            continue
        for facet, (start, end) in enumerate(outline.facets):
            if tx_chain.facets and tx_chain.facets[-1] == facet:
                continue
            for edge, other, further in zip((start, end), (end, start), outline.beyond[facet], strict=True):
                waves = _waves(tx_chain, rx_chain, facet, edge, other, further, outline)
                if waves.length.size:
                    yield waves


def _waves(
    tx_chain: Chain, rx_chain: Chain, facet: int, edge: Array, other: Array, further: Array, outline: Outline
) -> EdgeWaves:
    """The waves from the end `edge` of the mirror between `edge` and `other`; `further` as `Outline.beyond`."""
    inward = (other - edge) / np.linalg.norm(other - edge)
    normal = segment_normal(edge, other)
    lit = Points.free((edge + INSET * inward)[None])
    there = trace(tx_chain, lit, outline)
    back = there if rx_chain is tx_chain else trace(rx_chain, lit, outline)
    tx, rx = (i.ravel() for i in np.indices((there.antenna.size, back.antenna.size)))
    source, target = tx_chain.images[-1][there.antenna[tx]], rx_chain.images[-1][back.antenna[rx]]
    above, beyond = signed_distance(source, edge, normal), signed_distance(target, edge, normal)
    # Where another mirror joins at an angle that faces the antenna, the two form a corner, which has no edge wave.
    joined = np.sign((further - edge) @ normal)  # NaN, which equals no sign, if there is none
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
        share=there.share[tx] * back.share[rx],
        sign=np.where(np.abs(foot) < EDGE, 0.0, -np.sign(foot)),
        tx_cosine=there.cosine[:, tx],
        rx_cosine=back.cosine[:, rx],
        end_cosine=(np.abs(above) + np.abs(beyond)) / specular,
    )


def edge_factor(waves: EdgeWaves, wavelength: Array) -> NDArray[np.complex128]:
    """``share sign G(v) sqrt(2 / (L + l))`` at wavelengths [m] (n, 1), shape (n, waves).

    The Fresnel integral is an error function, ``G(v) = exp(z^2) erfc(z) / 2`` with ``z = sqrt(j pi / 2) v``.
    """
    v = np.sqrt(4.0 * np.maximum(waves.length - waves.specular, 0.0) / wavelength)
    z = np.sqrt(0.5j * np.pi) * v
    return np.asarray(waves.share * waves.sign * 0.5 * wofz(1j * z) * np.sqrt(2.0 / (waves.length + waves.specular)))
