"""How much of an echo adds up in phase over the pairs, for waves of given direction and curvature.

An echo from the direction u and the distance ``rho = 1 / q`` reaches the elements with deviations of its path from that
to the middle of the array, and its samples add up in phase once these are undone. A point adds ``(x_i^2 + x_k^2) / 2
rho`` to the path, a flat face that shows the image of the transmitter ``(x_i - x_k)^2 / 4 rho``: what the distance of
transmitter and receiver adds is the same for both, and for any smooth shape between them (Hubral, Geophysics 48,
1051-1062, 1983). A right-angled corner sends every ray back to where it came from: it shows the transmitter mirrored at
its vertex, and adds ``(x_i + x_k)^2 / 4 rho``. The largest coherence of the three therefore tells the distance,
whatever the echo comes from.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, next_fast_len

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import cpu_count
from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.focusing.phasor import unit_phasor

Complex64 = NDArray[np.complex64]

POINT, FACE, CORNER = 0, 1, 2
"""What an echo may come from."""

OVERSAMPLING = 4
"""Points of the range profile in a cell, at least, between which it is linear to a few percent."""


def profiles(s: NDArray[np.complexfloating], wavenumber: Array) -> tuple[Complex64, float]:
    """Range profiles (pairs, points) with the carrier of mid-band taken out, and the path between two points [m]."""
    count = wavenumber.size
    taper = hann(count)[:, None].astype(np.float32)
    points = next_fast_len(OVERSAMPLING * count)
    profile = ifft((s * taper).T, points, axis=1, workers=cpu_count())
    step = 2.0 * np.pi / ((wavenumber[-1] - wavenumber[0]) / (count - 1)) / points
    carrier = np.exp(-1j * (wavenumber.mean() - wavenumber[0]) * step * np.arange(points))
    profile *= carrier
    return profile.astype(np.complex64, copy=False), float(step)


def windows(profile: Complex64, gate: NDArray[np.int64], half: int, carrier: float, step: float) -> NDArray[np.float32]:
    """Pieces of the profiles around the gates, unwrapped around the ambiguous range: (pairs, 2 half + 1, 2, gates).

    The third axis holds real and imaginary parts, so that all gates are worked on side by side.
    """
    size = profile.shape[1]
    index = np.arange(-half, half + 1)[:, None] + gate
    turn = np.exp(-1j * carrier * size * step * np.floor_divide(index, size))
    pieces = profile[:, index % size] * turn
    return np.ascontiguousarray(np.stack([pieces.real, pieces.imag], axis=2), dtype=np.float32)


@njit(error_model="numpy", nogil=True, fastmath=True, inline="always")
def _change(along: float, curvature: float) -> float:
    """``(sqrt(1 + q a) - 1) / q``, exact for q = 0 too."""
    return along / (np.sqrt(max(1.0 + curvature * along, 0.0)) + 1.0)


@njit(error_model="numpy", nogil=True, fastmath=True)
def _lengthen(
    tx: Array, rx: Array, tx_of: NDArray[np.int64], rx_of: NDArray[np.int64], direction: Array, q: float, shape: int,
    out: Array,
) -> None:  # fmt: skip
    """How much longer than 2 / q the paths of pairs (pairs,) are, by way of something of that shape in a direction."""
    for p in range(out.size):
        a, b = tx[tx_of[p]], rx[rx_of[p]]
        a_ahead = a[0] * direction[0] + a[1] * direction[1] + a[2] * direction[2]
        b_ahead = b[0] * direction[0] + b[1] * direction[1] + b[2] * direction[2]
        if shape == FACE:
            apart = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
            out[p] = 2.0 * _change(q * (a_ahead * b_ahead + 0.25 * apart) - a_ahead - b_ahead, q)
        elif shape == CORNER:
            twice = (a[0] + b[0]) ** 2 + (a[1] + b[1]) ** 2 + (a[2] + b[2]) ** 2
            out[p] = 2.0 * _change(0.25 * q * twice - a_ahead - b_ahead, q)
        else:
            a_square = a[0] ** 2 + a[1] ** 2 + a[2] ** 2
            b_square = b[0] ** 2 + b[1] ** 2 + b[2] ** 2
            out[p] = _change(q * a_square - 2.0 * a_ahead, q) + _change(q * b_square - 2.0 * b_ahead, q)


@njit(error_model="numpy", nogil=True, fastmath=True)
def _add_up(
    windows: NDArray[np.float32], cell: NDArray[np.int64], rest: NDArray[np.float32], cos: NDArray[np.float32],
    sin: NDArray[np.float32], total: NDArray[np.float32],
) -> None:  # fmt: skip
    """Add ``w exp(j ...)`` and ``|w|^2`` of all pairs, each w between two cells of its window, to (3, gates)."""
    for p in range(cell.size):
        here, beyond, share, c, s = windows[p, cell[p]], windows[p, cell[p] + 1], rest[p], cos[p], sin[p]
        for g in range(total.shape[1]):
            re = here[0, g] + share * (beyond[0, g] - here[0, g])
            im = here[1, g] + share * (beyond[1, g] - here[1, g])
            total[0, g] += re * c - im * s
            total[1, g] += re * s + im * c
            total[2, g] += re * re + im * im


@njit(error_model="numpy", nogil=True, fastmath=True)
def coherence(
    windows: NDArray[np.float32], step: float, shift: float, shape: int, tx: Array, rx: Array, tx_of: NDArray[np.int64],
    rx_of: NDArray[np.int64], centre: float, directions: Array, curvature: float, along: Array, ahead: Array,
    out: Array,
) -> None:  # fmt: skip
    """Raise out (gates,) to the largest ``|sum y|^2 / (n sum |y|^2)``, ``y = w(L + shift D) exp(j k_c D)``, over u.

    D is how much longer the path is than 2 rho, by way of a point, a flat face or a corner in the direction u, at the
    distance rho = 1 / q. A contracting wave is the time reversal of one from the opposite side.
    """
    pairs, size, _, gates = windows.shape
    middle = size // 2
    sign = 1.0 if curvature >= 0.0 else -1.0
    longer, cell, rest = np.empty(pairs), np.empty(pairs, np.int64), np.empty(pairs, np.float32)
    cos, sin = np.empty(pairs, np.float32), np.empty(pairs, np.float32)
    for u in sign * directions:
        direction = u * along + np.sqrt(1.0 - u * u) * ahead
        _lengthen(tx, rx, tx_of, rx_of, direction, abs(curvature), shape, longer)
        for p in range(pairs):
            at = shift * sign * longer[p] / step + middle
            cell[p] = int(min(max(np.floor(at), 0.0), size - 2.0))
            rest[p] = at - cell[p]
            cos[p], sin[p] = unit_phasor(sign * centre / (2.0 * np.pi) * longer[p])
        total = np.zeros((3, gates), np.float32)
        _add_up(windows, cell, rest, cos, sin, total)
        for g in range(gates):
            if total[2, g] > 0.0:
                out[g] = max(out[g], (total[0, g] ** 2 + total[1, g] ** 2) / (pairs * total[2, g]))
