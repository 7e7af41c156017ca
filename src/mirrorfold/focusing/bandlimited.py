"""Band-limited functions on an interval, known from few of their samples.

A function on pixels over a length L whose spectrum lies within [-B, B] is one of about ``B L / pi`` dimensions (Slepian
and Pollak 1961), however fine the pixels are. An interpolative decomposition (Cheng et al. 2005) of the functions cos
and sin picks as many pixels, whose values tell all others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from mirrorfold.common.types import Array

BAND_STEP = 1.12
"""Bands are rounded up to powers of this, so that many blocks share one interpolator."""

CANDIDATES = 3.0
"""Pixels among which samples are picked, over the number of dimensions."""

SPARE_DIMENSIONS = 24
"""More dimensions than ``B L / pi`` that a tight tolerance may take: they grow with its logarithm only."""


@dataclass(frozen=True, eq=False)
class Interpolator:
    """Samples of an axis, and the matrix from them to all of it.

    Attributes
    ----------
    index : (samples,) int array
        Which pixels are sampled, rising.
    matrix : (samples, pixels) float32 array
    """

    index: NDArray[np.intp]
    matrix: NDArray[np.float32]

    def onto(self, index: NDArray[np.intp]) -> NDArray[np.float32] | None:
        """The matrix to some of the pixels; None if these are the samples themselves."""
        if np.array_equal(index, self.index):
            return None
        return np.ascontiguousarray(self.matrix[:, index])


class Axis:
    """Interpolators for one row of pixels, made when first asked for.

    Parameters
    ----------
    position : (pixels,) array [m]
    tolerance : float
        Root-mean-square error of interpolation, over all frequencies of the band.
    """

    def __init__(self, position: Array, tolerance: float) -> None:
        self.position = position
        self.tolerance = tolerance
        self._made: dict[int, Interpolator] = {}

    def interpolator(self, band: float) -> Interpolator:
        """For functions with spectrum within +-band [rad/m]."""
        length = float(np.ptp(self.position))
        # A band that turns by less than a hundredth of a radian over the axis is as good as none.
        step = int(np.ceil(np.log(max(band * length, 1e-2)) / np.log(BAND_STEP)))
        if step not in self._made:
            self._made[step] = self._make(BAND_STEP**step / length if length > 0.0 else 0.0)
        return self._made[step]

    def interpolators(self) -> list[Interpolator]:
        """All that were made."""
        return list(self._made.values())

    def _make(self, band: float) -> Interpolator:
        pixels = self.position.size
        centred = self.position - 0.5 * (self.position[0] + self.position[-1])
        dimensions = band * float(np.ptp(self.position)) / np.pi + SPARE_DIMENSIONS
        if pixels <= dimensions / 2.0:
            return Interpolator(np.arange(pixels), np.eye(pixels, dtype=np.float32))
        waves = int(np.ceil(2.0 * dimensions))
        turn = np.multiply.outer(band * (np.arange(waves) + 0.5) / waves, centred)
        functions = np.concatenate([np.cos(turn), np.sin(turn)])
        few = np.unique(np.linspace(0, pixels - 1, min(pixels, int(CANDIDATES * dimensions))).round().astype(np.intp))
        triangle, order = scipy.linalg.qr(functions[:, few], mode="r", pivoting=True)
        rest = np.sqrt(np.cumsum((np.abs(np.triu(triangle)) ** 2).sum(axis=1)[::-1])[::-1])
        enough = np.flatnonzero(rest <= self.tolerance * rest[0])
        index = np.sort(few[order[: enough[0] if enough.size else len(order)]])
        matrix = scipy.linalg.lstsq(functions[:, index], functions, lapack_driver="gelsy")[0]
        return Interpolator(index, matrix.astype(np.float32))
