"""Glints: specular returns of arcs and circles, in line of sight and seen over chains of mirrors.

Let the images of transmitter and receiver be at the distances d1 and d2 from the specular point, and t the angle of
incidence on an arc of radius a. Geometrical optics gives the amplitude ``1 / sqrt(q)`` with ``q = d1 + d2 + 2 d1 d2 /
(a cos t)`` on the convex side, and ``q = d1 + d2 - 2 d1 d2 / (a cos t)`` on the concave side (Kouyoumjian and Pathak,
Proc. IEEE 62, 1974). If q is negative, the ray has passed a caustic, and its phase is advanced by a quarter turn: the
factor +j for ``exp(+jwt)``. Near a caustic q vanishes. The amplitude is therefore limited to that of physical optics
when the whole arc adds up in phase, ``sqrt(k / (2 pi)) cos t W / sqrt(d1 d2)`` for an arc of length W.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array
from mirrorfold.simulation.rays.outline import Obstacles, Outline
from mirrorfold.simulation.rays.paths import Chain, ChainTables, Points, follow, trace

NODES = 64
"""Number of intervals on an arc: in each of them a change of sign of the slope of the path length is looked for."""

STEPS, FLAT = 60, 1e-12
"""Method of false position: largest number of steps in such an interval, and slope at which it ends. Seven or eight
steps usually suffice. The remaining slope causes an error of the path length of second order only."""

MOST_SPECULAR_POINTS = 4
"""Largest number of specular points on a circle between two given points: Alhazen's problem is of fourth degree."""


@dataclass(frozen=True, eq=False)
class Glints:
    """The glints of one arc over one pair of chains.

    Attributes
    ----------
    tx, rx : (glints,) arrays of int
        Numbers of transmitter and receiver.
    length : (glints,) array [m]
        Length of the whole path.
    share : (glints,) complex array
        Share of the amplitude: 1, or less in the penumbra of an edge.
    spreading : (glints,) array [m]
        The q of geometrical optics; negative behind a caustic.
    legs : (glints,) array [m^2]
        The product d1 d2.
    end_cosine : (glints,) array
        Cosine of the angle of incidence on the arc.
    tx_cosine, rx_cosine : (bounces, glints) arrays
        Cosines of the angles of incidence on the mirrors of the two chains.
    place : (glints, 2) array [m]
        The specular point.
    """

    tx: NDArray[np.intp]
    rx: NDArray[np.intp]
    length: Array
    share: NDArray[np.complex64]
    spreading: Array
    legs: Array
    end_cosine: Array
    tx_cosine: Array
    rx_cosine: Array
    place: Array


def sees_arc(chain: Chain, arc: Array, outline: Outline) -> bool:
    """Whether any antenna sees one of `NODES` points of the arc (5,) over the chain."""
    angle = arc[3] + arc[4] * (np.arange(NODES) + 0.5) / NODES
    position = arc[:2] + arc[2] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return trace(chain, Points.free(position), outline).length.size > 0


def glints(arc: Array, tx_chain: Chain, rx_chain: Chain, outline: Outline) -> Glints:
    """All glints of an arc that the transmitters see over one chain and the receivers over another, or the same.

    Parameters
    ----------
    arc : (5,) array
        As in `Outline`.
    tx_chain, rx_chain : Chain
        Chains from the antennas to the arc.
    outline : Outline
    """
    shape = (tx_chain.images.shape[1], rx_chain.images.shape[1], MOST_SPECULAR_POINTS)
    share, distance = np.zeros(shape, np.complex64), np.empty((*shape, 2))
    cosine, convex = np.empty(shape), np.empty(shape)
    tx_cosine = np.empty((*shape, len(tx_chain.facets)))
    rx_cosine = np.empty((*shape, len(rx_chain.facets)))
    place = np.empty((*shape, 2))
    angles = arc[3] + arc[4] * np.arange(NODES + 1) / NODES
    slopes = [_slopes(arc, angles, chain.images[-1]) for chain in (tx_chain, rx_chain)]
    in_shares(
        _glints,
        shape[0],
        arc,
        angles,
        *slopes,
        tx_chain.tables,
        rx_chain.tables,
        outline.obstacles,
        share,
        distance,
        cosine,
        convex,
        tx_cosine,
        rx_cosine,
        place,
    )
    found = np.nonzero(share)
    to_tx, to_rx = distance[found].T
    legs = to_tx * to_rx
    return Glints(
        tx=found[0],
        rx=found[1],
        length=to_tx + to_rx,
        share=share[found],
        spreading=to_tx + to_rx + convex[found] * 2.0 * legs / (arc[2] * cosine[found]),
        legs=legs,
        end_cosine=cosine[found],
        tx_cosine=tx_cosine[found].T,
        rx_cosine=rx_cosine[found].T,
        place=place[found],
    )


def _slopes(arc: Array, angles: Array, ends: Array) -> Array:
    """Derivatives (n, m), along the arc, of the distances to the points `ends` (n, 2), at angles (m,) of the arc."""
    normal = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    if arc[4] >= 2.0 * np.pi:
        normal[-1] = normal[0]  # the last node of a circle is its first one: rounding must not lose a root there
    apart = arc[:2] + arc[2] * normal - ends[:, None]
    slope = normal[:, 0] * apart[..., 1] - normal[:, 1] * apart[..., 0]
    return np.asarray(slope / np.maximum(np.linalg.norm(apart, axis=-1), np.finfo(float).tiny))


@njit(error_model="numpy", nogil=True)
def _slope(cos: float, sin: float, arc: Array, ax: float, ay: float, bx: float, by: float) -> float:
    """Derivative, along the arc, of the path length from a over a point of the arc to b."""
    x, y = arc[0] + arc[2] * cos, arc[1] + arc[2] * sin
    to_a = np.sqrt((x - ax) ** 2 + (y - ay) ** 2)
    to_b = np.sqrt((x - bx) ** 2 + (y - by) ** 2)
    return float(cos * ((y - ay) / to_a + (y - by) / to_b) - sin * ((x - ax) / to_a + (x - bx) / to_b))


@njit(error_model="numpy", nogil=True)
def _root(
    low: float, high: float, below: float, above: float, arc: Array, ax: float, ay: float, bx: float, by: float
) -> float:
    """The angle between `low` and `high` at which the slope is zero; at these two it is `below` and `above`.

    `below` and `above` have different signs. Method of false position, in which the value at an end that stays is
    halved (the Illinois method: Dowell and Jarratt, BIT 11, 168, 1971).
    """
    stayed, root = 0, low
    for _ in range(STEPS):
        root = (low * above - high * below) / (above - below)
        slope = _slope(np.cos(root), np.sin(root), arc, ax, ay, bx, by)
        if abs(slope) < FLAT:
            break
        if (slope < 0.0) == (below < 0.0):
            low, below = root, slope
            above *= 0.5 if stayed == 1 else 1.0
            stayed = 1
        else:
            high, above = root, slope
            below *= 0.5 if stayed == -1 else 1.0
            stayed = -1
    return root


@njit(error_model="numpy", nogil=True)
def _glints(
    arc: Array,
    angles: Array,
    tx_slope: Array,
    rx_slope: Array,
    tx_chain: ChainTables,
    rx_chain: ChainTables,
    obstacles: Obstacles,
    share: NDArray[np.complex64],
    distance: Array,
    cosine: Array,
    convex: Array,
    tx_cosine: Array,
    rx_cosine: Array,
    place: Array,
    first: int,
    last: int,
) -> None:
    """Fill rows `first` to `last` of the tables of glints, (tx, rx, `MOST_SPECULAR_POINTS`).

    The share stays 0 where there is no glint.
    """
    tx_images, rx_images = tx_chain[0], rx_chain[0]
    for n in range(first, last):
        ax, ay = tx_images[-1, n, 0], tx_images[-1, n, 1]
        for m in range(rx_images.shape[1]):
            bx, by = rx_images[-1, m, 0], rx_images[-1, m, 1]
            count = 0
            for node in range(NODES):
                before, after = tx_slope[n, node] + rx_slope[m, node], tx_slope[n, node + 1] + rx_slope[m, node + 1]
                if (before < 0.0) == (after < 0.0) or count == MOST_SPECULAR_POINTS:
                    continue
                root = _root(angles[node], angles[node + 1], before, after, arc, ax, ay, bx, by)
                nx, ny = np.cos(root), np.sin(root)
                x, y = arc[0] + arc[2] * nx, arc[1] + arc[2] * ny
                above_a = (ax - x) * nx + (ay - y) * ny
                above_b = (bx - x) * nx + (by - y) * ny
                # If the two images are on different sides, the path leads through the arc and is no reflection.
                if above_a * above_b <= 0.0:
                    continue
                share_a, to_a = follow(x, y, -1, n, tx_chain, obstacles, -1, tx_cosine[n, m, count])
                if share_a == 0.0:
                    continue
                share_b, to_b = follow(x, y, -1, m, rx_chain, obstacles, -1, rx_cosine[n, m, count])
                if share_b == 0.0:
                    continue
                share[n, m, count] = share_a * share_b
                distance[n, m, count, 0], distance[n, m, count, 1] = to_a, to_b
                cosine[n, m, count] = abs(above_a) / to_a
                place[n, m, count, 0], place[n, m, count, 1] = x, y
                convex[n, m, count] = 1.0 if above_a > 0.0 else -1.0
                count += 1
