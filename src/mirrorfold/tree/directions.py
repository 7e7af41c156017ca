"""Echoes that left and arrived by different ways.

With the transmitter in line of sight of a thing and the receiver behind a mirror, or the other way round, path lengths
average and the echo focuses where nothing is. In a MIMO sweep such a ghost gives itself away: with the transmitters
focused on it, the receivers hear it from another direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import LARGEST_SINE, ImageView

Array = NDArray[np.float64]
Complex = NDArray[np.complex64]
Mask = NDArray[np.bool_]

SMALLEST_RATIO = 0.5
"""True echoes have ratios near one, mixed ones far below a half."""

PHASE_SPREAD = 0.5
"""Frequencies are summed in groups over which the phase of no direction turns by more than this [rad]."""

CHUNK = 64
"""Points treated at once; bounds the memory."""


@numba.njit(cache=True, nogil=True, parallel=True, error_model="numpy", fastmath=True)
def _send(k0: float, dk: float, weight: Array, taper: Array, path: Array, phasor: Complex) -> None:
    """``phasor[m, i, p] = weight[i] taper[m] exp(j (k0 + m dk) path[p, i])``, from one frequency to the next."""
    points, antennas = path.shape
    for i in numba.prange(antennas):
        for p in range(points):
            turn = complex(np.cos(dk * path[p, i]), np.sin(dk * path[p, i]))
            value = weight[i] * complex(np.cos(k0 * path[p, i]), np.sin(k0 * path[p, i]))
            for m in range(taper.size):
                phasor[m, i, p] = value * taper[m]
                value *= turn


@numba.njit(cache=True, nogil=True, parallel=True, error_model="numpy", fastmath=True)
def _listen(
    field: Complex, k0: float, dk: float, x: Array, y: Array, px: Array, py: Array, reach: Array, level: Array
) -> None:
    """``level[p, j] = |sum_b,k field[p, b, k] exp(j (k0 + b dk) (|q_pj - rx_k| - r_p))|``, points p, directions j."""
    points, groups, antennas = field.shape
    for p in numba.prange(points):
        for j in range(px.shape[1]):
            total = 0.0 + 0.0j
            for k in range(antennas):
                path = np.sqrt((px[p, j] - x[k]) ** 2 + (py[p, j] - y[k]) ** 2) - reach[p]
                turn = complex(np.cos(dk * path), np.sin(dk * path))
                value = complex(np.cos(k0 * path), np.sin(k0 * path))
                for b in range(groups):
                    total += field[p, b, k] * value
                    value *= turn
            level[p, j] = abs(total)


@dataclass(frozen=True, eq=False)
class _Array:
    """One side of the radar in the floor plan, with a Hann window against the side lobes of glints."""

    position: Array
    weight: Array

    @classmethod
    def of(cls, position: Array) -> _Array:
        """The antennas at positions (n, 3) [m]."""
        along = np.linalg.norm(position - position[0], axis=1)
        share = (along + np.ptp(along) / along.size / 2) / (np.ptp(along) * (1.0 + 1.0 / along.size))
        return cls(position[:, :2], np.sin(np.pi * share) ** 2)


def direction_ratio(sweep: xr.Dataset, polar: ImageView, range_: Array, u: Array) -> Array:
    """How much of an echo arrives from the direction that it left in.

    With ``B(u, u')`` the wideband focus of the transmitters at a point and of the receivers at the same range in
    direction u', the ratio is ``|B(u, u)| / max |B(u, u')|``: near one for echoes that came back the way they went.

    Parameters
    ----------
    sweep : xarray.Dataset
        MIMO or synthetic-aperture Sweep with at least two transmitters and receivers.
    polar : ImageView
        Tells where range and u count from.
    range_, u : (n,) arrays
        The points to test.

    Returns
    -------
    (n,) array
    """
    speed = float(sweep.attrs.get("wave_speed", speed_of_light))
    k = 2.0 * np.pi * sweep["frequency"].values / speed
    data = sweep["s"].values
    tx, rx = _Array.of(sweep["tx_position"].values), _Array.of(sweep["rx_position"].values)
    taper = np.sin(np.pi * np.arange(1, k.size + 1) / (k.size + 1)) ** 2
    # A path from the antenna at the end of the array differs from that of the middle by up to half its length.
    spread = 0.5 * float(np.linalg.norm(np.ptp(rx.position, axis=0)))
    groups = int(np.clip(np.ceil((k[-1] - k[0]) * spread / PHASE_SPREAD), 1, k.size))
    size = k.size // groups
    groups = -(-k.size // size)
    edges = np.arange(groups) * size
    dk = float(k[-1] - k[0]) / max(k.size - 1, 1)
    # Half of the receivers' own beam width.
    beams = int(np.ceil(LARGEST_SINE * 2.0 * max(polar.aperture_rx, 1.0)))
    ring = np.linspace(-LARGEST_SINE, LARGEST_SINE, 2 * beams + 1)
    ratio = np.empty(range_.size)
    for first in range(0, range_.size, CHUNK):
        part = slice(first, first + CHUNK)
        r, points = range_[part], polar.to_points(range_[part], u[part])
        path = np.linalg.norm(points[:, None] - tx.position, axis=-1) + r[:, None]
        send = np.empty((k.size, tx.weight.size, r.size), dtype=np.complex64)
        _send(float(k[0]), dk, tx.weight, taper, path, send)
        heard = np.matmul(data.swapaxes(1, 2), send)  # (frequency, rx, point)
        field = np.add.reduceat(heard, edges, axis=0).transpose(2, 0, 1) * rx.weight.astype(np.float32)
        directions = np.concatenate([np.broadcast_to(ring, (r.size, ring.size)), u[part, None]], axis=1)
        where = polar.to_points(np.broadcast_to(r[:, None], directions.shape), directions)
        level = np.empty(directions.shape)
        _listen(
            np.ascontiguousarray(field),
            float(k[0]) + 0.5 * (size - 1) * dk,
            size * dk,
            np.ascontiguousarray(rx.position[:, 0]),
            np.ascontiguousarray(rx.position[:, 1]),
            np.ascontiguousarray(where[..., 0]),
            np.ascontiguousarray(where[..., 1]),
            r,
            level,
        )
        ratio[part] = level[:, -1] / np.maximum(level.max(axis=1), np.finfo(float).tiny)
    return ratio


def is_mixed(
    echoes: Echoes, sweep: xr.Dataset, polar: ImageView, known: dict[tuple[float, float], float] | None = None
) -> Mask:
    """Which echoes arrive from another direction than they left in, (n,).

    Tested once in each resolution cell, at its brightest echo; a sweep with a single transmitter or receiver cannot
    tell, and accuses none. `known` holds the ratios of echoes by range and u, and takes up those that are measured.
    """
    known = {} if known is None else known
    if min(sweep.sizes["tx"], sweep.sizes["rx"]) < 2 or not echoes.range.size:
        return np.zeros(echoes.range.size, dtype=bool)
    _, u = polar.to_polar(echoes.position)
    cells = np.stack([echoes.range / polar.range_cell, u / polar.u_cell]).astype(np.intp)
    _, cell = np.unique(cells, axis=1, return_inverse=True)
    cell = cell.ravel()
    order = np.lexsort([-echoes.amplitude, cell])
    brightest = order[np.unique(cell[order], return_index=True)[1]]
    where = list(zip(echoes.range[brightest].tolist(), u[brightest].tolist(), strict=True))
    new = brightest[[place not in known for place in where]]
    if new.size:
        measured = direction_ratio(sweep, polar, echoes.range[new], u[new])
        known.update(zip(zip(echoes.range[new].tolist(), u[new].tolist(), strict=True), measured, strict=True))
    ratio = np.array([known[place] for place in where])
    return np.asarray(ratio[cell] < SMALLEST_RATIO)
