"""Interpolation of band-limited functions on a row of pixels, from few of their samples.

A function over a length L whose spectrum lies within [-B, B] has about ``B L / pi`` degrees of freedom (Slepian and
Pollak 1961), however many pixels there are. An interpolative decomposition (Cheng et al. 2005) of all cosines and sines
of the band picks that many pixels, and gives the matrix from the values at these to the values at all others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from mirrorfold.common.types import Array

BAND_STEP = 1.12
"""Bands (times the length of the row) are rounded up to powers of this, so that many blocks share one interpolator."""

CANDIDATES = 3.0
"""Number of pixels among which samples are picked, over the number of samples needed."""

EDGE, LEAST_AREA = 0.22, 4.0
"""Coefficients of `dimensions`: what is needed beyond ``B L / pi`` grows with the logarithms of 1/tolerance and of B L.
They were fitted."""

RIDGE = 1e-14
"""Number added to the diagonal of the Gram matrix, which is one, against rounding."""


@dataclass(frozen=True, eq=False)
class Interpolator:
    """Sample pixels of an axis, and the matrix from the values at them to the values at all its pixels.

    Attributes
    ----------
    index : (samples,) int array
        Indices of the sample pixels, rising.
    matrix : (samples, pixels) float32 array
    """

    index: NDArray[np.intp]
    matrix: NDArray[np.float32]

    def onto(self, index: NDArray[np.intp]) -> NDArray[np.float32] | None:
        """The matrix from the samples to some of the pixels; None if these pixels are the samples themselves."""
        if np.array_equal(index, self.index):
            return None
        return np.ascontiguousarray(self.matrix[:, index])


class Axis:
    """Interpolators for one row of pixels, made when first asked for.

    Parameters
    ----------
    position : (pixels,) array [m]
    tolerance : float
        Relative root-mean-square error of interpolation, over all spatial frequencies of the band.
    """

    def __init__(self, position: Array, tolerance: float) -> None:
        self.position = position
        self.tolerance = tolerance
        self._length = float(np.ptp(position))
        self._made: dict[int, Interpolator] = {}
        self._counts: dict[int, int] = {}

    def step(self, band: float) -> int:
        """Exponent of BAND_STEP to which a band [rad/m] is rounded up; bands of one step share an interpolator."""
        # A band whose phases turn by less than a hundredth of a radian over the axis counts as that wide.
        return int(np.ceil(np.log(max(band * self._length, 1e-2)) / np.log(BAND_STEP)))

    def count(self, step: int) -> int:
        """Number of samples that the interpolator of a step will have, predicted."""
        if step not in self._counts:
            area = BAND_STEP**step if self._length > 0.0 else 0.0
            self._counts[step] = int(min(self.position.size, np.ceil(dimensions(area, self.tolerance))))
        return self._counts[step]

    def work(self, step: int) -> float:
        """Number of multiplications for making the interpolator of a step, predicted."""
        samples, pixels = self.count(step), self.position.size
        return 0.0 if samples >= pixels else samples**2 * (min(CANDIDATES * samples, pixels) + pixels)

    def interpolator(self, step: int) -> Interpolator:
        """The interpolator of functions with the band of a step."""
        if step not in self._made:
            self._made[step] = self._make(BAND_STEP**step / self._length if self._length > 0.0 else 0.0)
        return self._made[step]

    def interpolators(self) -> list[Interpolator]:
        """All interpolators that have been made."""
        return list(self._made.values())

    def _make(self, band: float) -> Interpolator:
        """Pick the samples by pivoted Cholesky decomposition of the functions' Gram matrix.

        The mean, over all waves of the band, of the product of the values at two pixels is ``sin(B d) / (B d)``, with
        the distance d of the pixels: an element of the Gram matrix.
        """
        pixels = self.position.size
        wanted = dimensions(band * self._length, self.tolerance)
        if pixels <= wanted:
            return Interpolator(np.arange(pixels), np.eye(pixels, dtype=np.float32))
        few = np.unique(np.linspace(0, pixels - 1, min(pixels, int(CANDIDATES * wanted))).round().astype(np.intp))
        factor, order, _, _ = scipy.linalg.lapack.dpstrf(self._gram(band, few, few), tol=RIDGE, lower=1)
        factor = np.tril(factor)
        # Squared error that is left, summed over all candidates, after each pivot.
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
        """Gram matrix between two choices of pixels."""
        distance = self.position[rows][:, None] - self.position[columns][None, :]
        return np.asfortranarray(np.sinc(band / np.pi * distance))


def dimensions(area: float, tolerance: float) -> float:
    """Number of samples that functions of band B on a length L need, from ``area = B L`` (Landau and Widom 1980)."""
    return area / np.pi + EDGE * np.log(1.0 / tolerance) * np.log(area + LEAST_AREA) + 1.0
