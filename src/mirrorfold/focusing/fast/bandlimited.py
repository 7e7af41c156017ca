"""Band-limited functions on an interval, known from few of their samples.

A function on pixels over a length L whose spectrum lies within [-B, B] has about ``B L / pi`` degrees of freedom
(Slepian and Pollak 1961), however fine the pixels are. An interpolative decomposition (Cheng et al. 2005) of the
functions cos and sin picks as many pixels, whose values tell those of all other pixels.
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

EDGE, LEAST_AREA = 0.22, 4.0
"""More dimensions than ``B L / pi`` grow with the logarithms of the tolerance and of B L; fitted to both."""

RIDGE = 1e-14
"""Added to the diagonal of the Gram matrix, against rounding."""


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
        self._length = float(np.ptp(position))
        self._made: dict[int, Interpolator] = {}

    def step(self, band: float) -> int:
        """The number under which bands as wide as this [rad/m] share an interpolator."""
        # A band that turns by less than a hundredth of a radian over the axis counts as none.
        return int(np.ceil(np.log(max(band * self._length, 1e-2)) / np.log(BAND_STEP)))

    def count(self, step: int) -> int:
        """How many samples an interpolator will have, before it is made."""
        area = BAND_STEP**step if self._length > 0.0 else 0.0
        return int(min(self.position.size, np.ceil(dimensions(area, self.tolerance))))

    def work(self, step: int) -> float:
        """Multiplications that making an interpolator takes."""
        samples, pixels = self.count(step), self.position.size
        return 0.0 if samples >= pixels else samples**2 * (min(CANDIDATES * samples, pixels) + pixels)

    def interpolator(self, step: int) -> Interpolator:
        """For functions with the spectrum of a step."""
        if step not in self._made:
            self._made[step] = self._make(BAND_STEP**step / self._length if self._length > 0.0 else 0.0)
        return self._made[step]

    def interpolators(self) -> list[Interpolator]:
        """All that were made."""
        return list(self._made.values())

    def _make(self, band: float) -> Interpolator:
        """Samples by pivoted Cholesky decomposition of the functions' Gram matrix.

        Averaged over the band, the product of a function's values at two places is ``sin(B d) / (B d)`` of their
        distance d.
        """
        pixels = self.position.size
        wanted = dimensions(band * self._length, self.tolerance)
        if pixels <= wanted:
            return Interpolator(np.arange(pixels), np.eye(pixels, dtype=np.float32))
        few = np.unique(np.linspace(0, pixels - 1, min(pixels, int(CANDIDATES * wanted))).round().astype(np.intp))
        factor, order, _, _ = scipy.linalg.lapack.dpstrf(self._gram(band, few, few), tol=RIDGE, lower=1)
        factor = np.tril(factor)
        # What is left of all candidates after each pivot.
        rest = len(few) - np.cumsum((factor**2).sum(axis=0))
        enough = np.flatnonzero(rest <= self.tolerance**2 * len(few))
        index = few[order[: enough[0] + 1 if enough.size else len(few)] - 1]
        index = np.sort(index)
        gram = self._gram(band, index, index)
        gram[np.diag_indices(index.size)] += RIDGE
        solver = scipy.linalg.cho_factor(gram, lower=True)
        matrix = scipy.linalg.cho_solve(solver, self._gram(band, index, np.arange(pixels)))
        return Interpolator(index, matrix.astype(np.float32))

    def _gram(self, band: float, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
        """Gram matrix of two choices of pixels."""
        distance = self.position[rows][:, None] - self.position[columns][None, :]
        return np.asfortranarray(np.sinc(band / np.pi * distance))


def dimensions(area: float, tolerance: float) -> float:
    """Samples that functions of band B on a length L need, by ``area = B L`` (Landau and Widom 1980)."""
    return area / np.pi + EDGE * np.log(1.0 / tolerance) * np.log(area + LEAST_AREA) + 1.0
