"""Sparse imaging: few channels or modes, l1 reconstruction, and the whole sweep that it predicts.

A measurement of fewer numbers than the whole sweep is explained by as few bright pixels as possible. From these pixels
the samples of the whole sweep are predicted, which can be focused and folded as usual.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

import mirrorfold as mf
from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Mask

Samples = NDArray[np.complex64]

LEVEL_DB = -60.0
"""Threshold of the l1 penalty, relative to the brightest pixel of the matched filter [dB]: near the noise of the
weakest measurement here, and as far below the brightest pixel as `mirrorfold.fold` looks for echoes."""

POWER_ITERATIONS, STEP_SHARE = 6, 0.85
"""Number of power iterations for the largest eigenvalue of ``A^H A``, and step of FISTA as a share of its inverse. The
share is below 1 because the iterations approach the eigenvalue from below."""


class Measurement(Protocol):
    """A way to measure less than the whole sweep; `operator` is the map A from reflectivities to measurements."""

    operator: LinearOperator

    def measured(self, s: Samples) -> Samples:
        """The measurements, one vector, of the samples of a whole sweep."""

    def matched(self, y: Samples) -> Samples:
        """The matched filter of measurements: samples (frequency, tx, rx) to be focused."""

    def completed(self, y: Samples, x: Samples) -> Samples:
        """The whole sweep that reflectivities x predict, corrected by the measurements y."""


class Channels:
    """A measurement of some channels (frequency, tx, rx) of the sweep.

    Parameters
    ----------
    model : FocusOperator
        Map from reflectivities to the samples of all channels.
    chosen : (frequency, tx, rx) bool array
        The channels that are measured.
    """

    def __init__(self, model: mf.FocusOperator, chosen: Mask) -> None:
        self._model, self._chosen = model, chosen
        self.operator = LinearOperator(
            shape=(int(chosen.sum()), model.shape[1]),
            matvec=lambda x: model.all_samples(x)[chosen],
            rmatvec=lambda y: model.rmatvec(self.matched(y).ravel()),
            dtype=np.complex64,
        )

    def measured(self, s: Samples) -> Samples:
        """The chosen samples."""
        return s[self._chosen]

    def matched(self, y: Samples) -> Samples:
        """The chosen samples in their places, and zero elsewhere."""
        s = np.zeros(self._chosen.shape, dtype=np.complex64)
        s[self._chosen] = np.ravel(y)
        return s

    def completed(self, y: Samples, x: Samples) -> Samples:
        """The measured samples, and in all other channels the samples that x predicts."""
        s = self._model.all_samples(x)
        s[self._chosen] = y
        return s


class Modes:
    """Modes of two random-phase apertures: in each mode all elements are active, each with a random phase.

    At each frequency m the measurements are ``Y_m = T_m S_m R_m^T``. A row of T or R has the phases of one mode; there
    are fewer modes than elements.

    Parameters
    ----------
    model : FocusOperator
        Map from reflectivities to the samples of all channels.
    shape : (frequency, tx, rx)
    share : float
        Number of measurements over the number of channels. Either side has ``sqrt(share)`` times as many modes as
        elements.
    random : numpy.random.Generator
    """

    def __init__(self, model: mf.FocusOperator, shape: tuple[int, ...], share: float, random: np.random.Generator):
        self._model, self._shape = model, shape
        self._tx, self._rx = (_phases(random, shape[0], round(np.sqrt(share) * n), n) for n in shape[1:])
        self.size = (shape[0], self._tx.shape[1], self._rx.shape[1])
        self.operator = LinearOperator(
            shape=(int(np.prod(self.size)), model.shape[1]),
            matvec=lambda x: self.measured(model.all_samples(x)),
            rmatvec=lambda y: model.rmatvec(self.matched(y).ravel()),
            dtype=np.complex64,
        )

    def measured(self, s: Samples) -> Samples:
        """``T S R^T`` at every frequency, one vector."""
        return np.ravel(np.asarray(self._tx @ s @ self._rx.swapaxes(1, 2), dtype=np.complex64))

    def matched(self, y: Samples) -> Samples:
        """``T^H Y conj(R)`` at every frequency."""
        return np.asarray(self._tx.conj().swapaxes(1, 2) @ y.reshape(self.size) @ self._rx.conj())

    def completed(self, y: Samples, x: Samples) -> Samples:
        """The samples that x predicts, plus the matched filter of the measurements that x leaves unexplained.

        The smallest correction that reproduces the measurements exactly would amplify noise if there are nearly as many
        modes as elements. ``T^H / n``, for n elements, is the inverse of T up to the overlap of the modes.
        """
        s = self._model.all_samples(x)
        elements = self._shape[1] * self._shape[2]
        return np.asarray(s + self.matched(y - self.measured(s)) / np.float32(elements), dtype=np.complex64)


def random_channels(kind: str, share: float, shape: tuple[int, ...], random: np.random.Generator) -> Mask:
    """A random choice of channels (frequency, tx, rx).

    Parameters
    ----------
    kind : {"channels", "frequencies", "elements"}
        Any channels; all pairs at some frequencies; or some transmitters with some receivers at all frequencies, the
        same share of both.
    share : float
        Number of chosen channels over that of all channels.
    shape : (frequencies, transmitters, receivers)
    random : numpy.random.Generator
    """
    chosen = np.zeros(shape, dtype=bool)
    if kind == "channels":
        chosen.flat[random.permutation(chosen.size)[: round(share * chosen.size)]] = True
    elif kind == "frequencies":
        chosen[random.permutation(shape[0])[: round(share * shape[0])]] = True
    else:
        tx, rx = (random.permutation(n)[: round(np.sqrt(share) * n)] for n in shape[1:])
        chosen[:, tx[:, None], rx] = True
    return chosen


class Sparse(NamedTuple):
    """A sparse reconstruction, as `sparse_reflectivity` describes it."""

    x: Samples
    falls: float


def sparse_reflectivity(measurement: Measurement, y: Samples, iterations: int) -> Sparse:
    """The reflectivities that minimise ``|y - A x|^2 / 2 + t |x|_1``, by FISTA (Beck and Teboulle 2009).

    Returns
    -------
    x : (pixels,) array
    falls : float
        Share by which the cost still fell in the second half of the iterations.
    """
    import pylops
    from pylops.optimization.sparsity import fista

    operator = measurement.operator
    random = np.random.default_rng(0)
    v, largest = random.standard_normal(operator.shape[1]).astype(np.complex64), 0.0
    for _ in range(POWER_ITERATIONS):
        v = operator.rmatvec(operator.matvec(v))
        largest = float(np.linalg.norm(v))
        v = v / np.float32(largest)
    threshold = ratio_of(LEVEL_DB) * float(np.abs(operator.rmatvec(y)).max())
    # PyLops minimises twice our cost.
    x, _, cost = fista(
        pylops.aslinearoperator(operator), y, niter=iterations, eps=2.0 * threshold, alpha=STEP_SHARE / largest, tol=0.0
    )
    return Sparse(np.asarray(x, dtype=np.complex64), float(cost[len(cost) // 2] / cost[-1] - 1.0))


def _phases(random: np.random.Generator, frequencies: int, modes: int, elements: int) -> Samples:
    """Random phase factors, (frequencies, modes, elements)."""
    factors = np.exp(2j * np.pi * random.random((frequencies, modes, elements)))
    return np.asarray(factors, dtype=np.complex64)
