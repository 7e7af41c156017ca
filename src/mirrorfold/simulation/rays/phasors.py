"""Phasors of paths, stepped from frequency to frequency, and the fields that they add up to.

An exponential for each path at each frequency would be slow. Instead the phasor of a path is multiplied, from one
frequency to the next, by a complex factor that itself changes by a constant factor per step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import in_shares
from mirrorfold.common.types import Array, Complex
from mirrorfold.scenes.arrays import Band

TILE = 256
"""Number of paths that are taken through a block of frequencies at a time: their phasors fit the first-level cache."""


FEW = 50_000
"""So many steps of phasors take a tenth of a millisecond, less than sharing them among the cores would take."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Some paths, sorted by antenna, and the phasor of each at the next frequency.

    The amplitude a of a path is evaluated at the two ends of the band and at its middle. In between, its logarithm is
    interpolated by a parabola in frequency, which is nearly exact for the loss by roughness. From each frequency to the
    next, the phasor ``a exp(-j k d)`` of a path of length d is then multiplied by a factor, `turn`, which is itself
    multiplied by a constant, ``1 + bend``.

    Attributes
    ----------
    start : (n + 1,) array of int
        Index of the first path of each antenna, and the number of paths at the end.
    point : (paths,) array of int
        Column of each path's point in the table of fields.
    phasor : (paths,) complex array
        Phasor at the next frequency.
    turn : (paths,) complex array
        Factor that leads from the next frequency to the one after it.
    bend : (paths,) complex array
        Relative change of that factor from step to step. It is small, so that complex64 is exact enough.
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
        """The phasors of paths at the first frequency of the band.

        Parameters
        ----------
        band : Band
        antennas : int
            Number of antennas.
        antenna, point : (paths,) arrays of int
            Numbers of the antenna and of the point of each path; sorted by antenna.
        length : (paths,) array [m]
        amplitude : (3, paths) complex array
            Amplitudes at the start, the middle and the end of the band, the `_knots` of `returns`. Paths with an
            amplitude of zero are left out.
        """
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
        """Add the phasors to the fields (frequencies, n, points), and step to the frequency after these."""
        step = partial(_proceed, self.start, self.point, self.phasor, self.turn, self.bend, field)
        if self.point.size * len(field) < FEW:
            step(0, field.shape[1])
        else:
            in_shares(step, field.shape[1])

    def renumbered(self, points: NDArray[np.int32]) -> Paths:
        """The paths to some of the points only; these points, given in rising order, become columns 0, 1, 2 ..."""
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
    """Numbers of the points that any path leads to, in rising order."""
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
    """Add the phasors of some antennas to the field (frequencies, n, points), stepping them through the frequencies.

    The antennas are `first_antenna` up to, but without, `last_antenna`. Real and imaginary parts are kept in separate
    arrays, of which processors multiply several values at a time.
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
