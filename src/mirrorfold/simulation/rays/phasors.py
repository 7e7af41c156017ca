"""Paths as phasors that proceed from frequency to frequency, and the fields that they add up to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array, Complex
from mirrorfold.scenes.arrays import Band

TILE = 256
"""Paths that are taken through a block at a time; their phasors stay in the first-level cache."""


@dataclass(frozen=True, eq=False)
class Paths:
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
    ) -> Paths:
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

    def renumbered(self, points: NDArray[np.int32]) -> Paths:
        """The paths to the given points (sorted) alone, which become columns 0, 1, 2 ..."""
        column = np.minimum(np.searchsorted(points, self.point), max(points.size - 1, 0)).astype(np.int32)
        keep = points[column] == self.point if points.size else np.zeros(self.point.size, dtype=bool)
        return Paths(
            start=np.concatenate([[0], np.cumsum(keep)])[self.start],
            point=column[keep],
            phasor=self.phasor[keep],
            turn=self.turn[keep],
            bend=self.bend[keep],
        )


def points_of(pieces: Sequence[Paths]) -> NDArray[np.int32]:
    """The points to which any path leads, in rising order."""
    return np.unique(np.concatenate([np.unique(paths.point) for paths in pieces]))


def next_fields(pieces: Sequence[Paths], field: NDArray[np.complex64]) -> NDArray[np.complex64]:
    """Fill in the fields (frequencies, n, points) at the next frequencies; the paths then stand at the one after."""
    field.fill(0.0)
    for paths in pieces:
        paths.proceed(field)
    return field


@njit(makes_arrays=True, error_model="numpy", nogil=True)
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

    For the antennas n from the first up to, and without, the last. Real and imaginary parts lie in arrays of their own,
    which processors multiply several at a time.
    """
    real, imag, turn_real, turn_imag, bend_real, bend_imag = np.empty((6, TILE))
    for n in range(first_antenna, last_antenna):
        for first in range(start[n], start[n + 1], TILE):
            count = min(TILE, start[n + 1] - first)
            for i in range(count):
                real[i], imag[i] = phasor[first + i].real, phasor[first + i].imag
                turn_real[i], turn_imag[i] = turn[first + i].real, turn[first + i].imag
                bend_real[i], bend_imag[i] = 1.0 + bend[first + i].real, bend[first + i].imag
            for f in range(field.shape[0]):
                for i in range(count):
                    field[f, n, point[first + i]] += complex(real[i], imag[i])
                for i in range(count):
                    a, b, c, d = real[i], imag[i], turn_real[i], turn_imag[i]
                    real[i], imag[i] = a * c - b * d, a * d + b * c
                    turn_real[i] = c * bend_real[i] - d * bend_imag[i]
                    turn_imag[i] = c * bend_imag[i] + d * bend_real[i]
            for i in range(count):
                phasor[first + i] = complex(real[i], imag[i])
                turn[first + i] = complex(turn_real[i], turn_imag[i])
