"""Coherence of an echo: how much of it adds up in phase over the pairs, for waves of given direction and curvature.

An echo from the direction u and the distance ``rho = 1 / q`` has, for each pair of elements, another path than for the
middle of the array. Once these differences are undone, its samples add up in phase. With the offsets x_i and x_k of
transmitter and receiver across the line of sight, the path by way of

- a point is longer by ``(x_i^2 + x_k^2) / (2 rho) = ((x_i - x_k)^2 + (x_i + x_k)^2) / (4 rho)``,
- a flat face, which shows the mirror image of the transmitter, by ``(x_i - x_k)^2 / (4 rho)``,
- a right-angled corner, which shows the transmitter mirrored at its vertex, by ``(x_i + x_k)^2 / (4 rho)``.

The term of the distance ``x_i - x_k`` is the same for a point, a flat face, and any smooth shape between them (Hubral,
Geophysics 48, 1051-1062, 1983). So the distance at which the largest of the three coherences peaks is that of the echo,
whatever it comes from.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, next_fast_len

from mirrorfold.common.kernels import njit
from mirrorfold.common.phasor import unit_phasor
from mirrorfold.common.threads import cpu_count
from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann

Complex64 = NDArray[np.complex64]

POINT, FACE, CORNER = 0, 1, 2
"""The shapes that an echo may come from: a point, a flat face, a right-angled corner."""

OVERSAMPLING = 4
"""Points of the range profile per range cell, at least: linear interpolation between them is right to a few percent."""


def profiles(s: NDArray[np.complexfloating], wavenumber: Array) -> tuple[Complex64, float]:
    """Range profiles (pairs, points) of samples (frequencies, pairs), and the path [m] from one point to the next.

    The carrier, the phase ``exp(j k_c d)`` of the path d at the mean wavenumber k_c, is taken off. `wavenumber` is in
    [rad/m].
    """
    count = wavenumber.size
    taper = hann(count)[:, None].astype(np.float32)
    points = next_fast_len(OVERSAMPLING * count)
    profile = ifft((s * taper).T, points, axis=1, workers=cpu_count())
    step = 2.0 * np.pi / ((wavenumber[-1] - wavenumber[0]) / (count - 1)) / points
    carrier = np.exp(-1j * (wavenumber.mean() - wavenumber[0]) * step * np.arange(points))
    profile *= carrier
    return profile.astype(np.complex64, copy=False), float(step)


def windows(profile: Complex64, gate: NDArray[np.int64], half: int, carrier: float, step: float) -> NDArray[np.float32]:
    """Pieces of the profiles, `half` points to either side of each gate: (pairs, 2 half + 1, 2, gates).

    A gate is an index of a point. Pieces that reach over an end of the profile go on at its other end, with the phase
    of the carrier [rad/m] corrected for the ambiguous path. The third axis holds real and imaginary parts, so that the
    gates are adjacent in memory.
    """
    size = profile.shape[1]
    index = np.arange(-half, half + 1)[:, None] + gate
    turn = np.exp(-1j * carrier * size * step * np.floor_divide(index, size))
    pieces = profile[:, index % size] * turn
    return np.ascontiguousarray(np.stack([pieces.real, pieces.imag], axis=2), dtype=np.float32)


@njit(error_model="numpy", nogil=True, fastmath=True, inline="always")
def _change(along, curvature):  # type: ignore[no-untyped-def]
    """``(sqrt(1 + q a) - 1) / q``, exact for q = 0 too."""
    return along / (np.sqrt(max(np.float32(1.0) + curvature * along, np.float32(0.0))) + np.float32(1.0))


@njit(makes_arrays=True, error_model="numpy", nogil=True, fastmath=True)
def sides_of(tx, rx, tx_of, rx_of):  # type: ignore[no-untyped-def]
    """Places of the transmitter and the receiver of each pair, (2, 3, pairs) [m], in single precision."""
    sides = np.empty((2, 3, tx_of.size), np.float32)
    for p in range(tx_of.size):
        for i in range(3):
            sides[0, i, p], sides[1, i, p] = tx[tx_of[p], i], rx[rx_of[p], i]
    return sides


@njit(error_model="numpy", nogil=True, fastmath=True)
def squares(sides, shape, out):  # type: ignore[no-untyped-def]
    """The squares (2, pairs) [m^2] in the paths of pairs, which hold for all directions.

    From the positions (2, 3, pairs) [m] of the transmitters a and the receivers b: a^2 and b^2 for a point,
    ``(a - b)^2 / 4`` for a face, ``(a + b)^2 / 4`` for a corner.
    """
    quarter = np.float32(0.25)
    for p in range(out.shape[1]):
        out[0, p] = out[1, p] = 0.0
        for i in range(3):
            a, b = sides[0, i, p], sides[1, i, p]
            if shape == POINT:
                out[0, p] += a * a
                out[1, p] += b * b
            else:
                c = a - b if shape == FACE else a + b
                out[0, p] += quarter * c * c


@njit(error_model="numpy", nogil=True, fastmath=True)
def lengthen(sides, square, direction, q, shape, out):  # type: ignore[no-untyped-def]
    """The paths of pairs (pairs,) [m] less 2 / q, by way of a reflector of this shape, at 1 / q in this direction."""
    two, (x, y, z) = np.float32(2.0), direction
    for p in range(out.size):
        a = sides[0, 0, p] * x + sides[0, 1, p] * y + sides[0, 2, p] * z
        b = sides[1, 0, p] * x + sides[1, 1, p] * y + sides[1, 2, p] * z
        if shape == POINT:
            out[p] = _change(q * square[0, p] - two * a, q) + _change(q * square[1, p] - two * b, q)
        elif shape == FACE:
            out[p] = two * _change(q * (a * b + square[0, p]) - a - b, q)
        else:
            out[p] = two * _change(q * square[0, p] - a - b, q)


@njit(error_model="numpy", nogil=True, fastmath=True)
def look_up(longer, cells, middle, last, turns, cell, rest, cos, sin):  # type: ignore[no-untyped-def]
    """For paths `longer` [m] than that of the gate: point of the window, fraction of a point, and phase factor."""
    for p in range(longer.size):
        at = longer[p] * cells + middle
        cell[p] = np.int32(min(max(np.floor(at), np.float32(0.0)), last))
        rest[p] = at - np.float32(cell[p])
    for p in range(longer.size):
        cos[p], sin[p] = unit_phasor(turns * longer[p])


@njit(error_model="numpy", nogil=True, fastmath=True)
def _add_up(windows, cell, rest, cos, sin, total):  # type: ignore[no-untyped-def]
    """Add to `total` (3, gates), over the pairs, ``w exp(j phase)`` and ``|w|^2``, w interpolated in the window."""
    for p in range(cell.size):
        here, beyond, share, c, s = windows[p, cell[p]], windows[p, cell[p] + 1], rest[p], cos[p], sin[p]
        for g in range(total.shape[1]):
            re = here[0, g] + share * (beyond[0, g] - here[0, g])
            im = here[1, g] + share * (beyond[1, g] - here[1, g])
            total[0, g] += re * c - im * s
            total[1, g] += re * s + im * c
            total[2, g] += re * re + im * im


@njit(error_model="numpy", nogil=True, fastmath=True)
def _add_up_one(windows, cell, rest, cos, sin, total):  # type: ignore[no-untyped-def]
    """As `_add_up`, for a single gate: the inner loop runs over the pairs."""
    total_re, total_im, power = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for p in range(cell.size):
        c, share = cell[p], rest[p]
        re = windows[p, c, 0, 0] + share * (windows[p, c + 1, 0, 0] - windows[p, c, 0, 0])
        im = windows[p, c, 1, 0] + share * (windows[p, c + 1, 1, 0] - windows[p, c, 1, 0])
        total_re += re * cos[p] - im * sin[p]
        total_im += re * sin[p] + im * cos[p]
        power += re * re + im * im
    total[0, 0], total[1, 0], total[2, 0] = total_re, total_im, power


@njit(makes_arrays=True, error_model="numpy", nogil=True, fastmath=True)
def coherence(
    windows: NDArray[np.float32], step: float, shift: float, shape: int, tx: Array, rx: Array, tx_of: NDArray[np.int64],
    rx_of: NDArray[np.int64], centre: float, directions: Array, curvature: float, along: Array, ahead: Array,
    out: Array,
) -> None:  # fmt: skip
    """Raise out (gates,) to the largest ``|sum y|^2 / (n sum |y|^2)``, ``y = w(L + shift D) exp(j k_c D)``, over u.

    w is the range profile of a pair without its carrier, L the path of the gate, and n the number of pairs. D is the
    path of the pair by way of a point, a flat face or a corner, in the direction u at the distance rho = 1 / q, less
    2 rho. `shift` is 1, or -1 to try delays of the wrong sign. A contracting wave, of negative curvature q, is the time
    reversal of a wave from the opposite side. In single precision a path of a metre is off by a tenth of a micrometre.
    """
    pairs, size, _, gates = windows.shape
    sign = 1.0 if curvature >= 0.0 else -1.0
    sides, square = sides_of(tx, rx, tx_of, rx_of), np.empty((2, pairs), np.float32)
    squares(sides, shape, square)
    q, turns = np.float32(abs(curvature)), np.float32(sign * centre / (2.0 * np.pi))
    cells = np.float32(shift * sign / step)
    longer, cell, rest = np.empty(pairs, np.float32), np.empty(pairs, np.int32), np.empty(pairs, np.float32)
    cos, sin, total = np.empty(pairs, np.float32), np.empty(pairs, np.float32), np.empty((3, gates), np.float32)
    for u in sign * directions:
        direction = (u * along + np.sqrt(1.0 - u * u) * ahead).astype(np.float32)
        lengthen(sides, square, direction, q, shape, longer)
        look_up(longer, cells, np.float32(size // 2), np.float32(size - 2), turns, cell, rest, cos, sin)
        total[:] = 0.0
        if gates == 1:
            _add_up_one(windows, cell, rest, cos, sin, total)
        else:
            _add_up(windows, cell, rest, cos, sin, total)
        for g in range(gates):
            if total[2, g] > 0.0:
                out[g] = max(out[g], (total[0, g] ** 2 + total[1, g] ** 2) / (pairs * total[2, g]))
