"""Half-transparent walls: their permittivity and thickness, from echoes behind them in two polarizations.

An echo that the wall reflected on both ways is multiplied by R^2 of TE and of TM; an echo that passed through the wall,
by T^2. The object that scattered it is unknown. It is assumed to return both polarizations alike up to a phase (for
conductors: plus for one reflection, minus for two). So at every frequency the pair (TE, TM) should be parallel to
(R_TE^2, R_TM^2) or to (T_TE^2, T_TM^2). The share of its power, over all frequencies, that is not parallel is the
misfit of that kind. All echoes behind a wall, over angle and frequency, have the same permittivity and thickness: those
that maximise the likelihood of a mixture of reflected, transmitted and other echoes (Dempster, Laird and Rubin, J. R.
Stat. Soc. B 39, 1, 1977).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp

from mirrorfold.common.decibels import NEPER
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.tree.half_transparent.misfits import misfits

Spectra = NDArray[np.complex128]

PERMITTIVITY = 1.8, 10.0
"""Least and largest relative permittivity that is tried: between these, building materials lie at these frequencies,
wood and concrete at the ends (Recommendation ITU-R P.2040)."""

LOSSES = 0.002, 0.02, 0.06, 0.18
"""Loss tangents that are tried first."""

STEP = 0.6
"""Step between the thicknesses that are tried first: phase of one way through the wall and back [rad]."""

THINNEST, THICKEST = 0.15, 1.5
"""Least and largest optical thickness that is tried, in range cells: a thinner wall shows only the product of
permittivity and thickness, and the two faces of a thicker one have separate echoes."""

MISMATCH = 0.1
"""Amplitude of what the model leaves out, neighbours and side lobes, over that of the echo: 20 dB below it."""

OBJECT_DB, ECHO_DB = 2.0, 1.0
"""Standard deviations of the ratio of TM to TE of objects that a metal mirror shows [dB]: of a ratio that all echoes
share, and of another one of each echo, for which zero is tried, too."""

ECHOES_AS_ONE = 3.0
"""Number of neighbouring echoes that count as one independent echo: the windows that cut them out are six cells long
and overlap."""

OTHER_SHARE = 0.02
"""Share of other echoes, neither reflected nor transmitted, whose pair of amplitudes may be any."""

MOST_ODDS = -np.log(OTHER_SHARE)
"""Largest logarithm of the odds that a single echo may contribute."""

SHARES = 0.05, 0.2, 0.4, 0.6, 0.8, 0.95
"""Shares of passed echoes, among those behind a wall, that are tried."""

BATCH = 500
"""Number of walls that are tried at once: so few that the misfits of all echoes stay in a cache of a megabyte."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Echoes behind a wall in both polarizations.

    Attributes
    ----------
    te, tm : (n, m) complex arrays
        Spectra of the echoes.
    angle : (n,) array [rad]
        Angle of incidence on the wall.
    wavenumber : (m,) array [rad/m]
    noise : (n,) array
        Power of the noise over that of the echo, for one independent value.
    independent : float
        Number of independent values of each spectrum.
    cell : float [m]
        Range cell.
    """

    te: Spectra
    tm: Spectra
    angle: Array
    wavenumber: Array
    noise: Array
    independent: float
    cell: float

    def evenly(self, most: int) -> Index:
        """The numbers of at most so many of the echoes, evenly chosen by the angle of incidence, in ascending order."""
        count = self.angle.size
        return np.sort(np.argsort(self.angle)[np.linspace(0, count - 1, min(count, most)).astype(np.intp)])

    def take(self, which: Index) -> Pairs:
        """Some of the echoes."""
        each = {name: getattr(self, name)[which] for name in ("te", "tm", "angle", "noise")}
        return replace(self, **each)

    def misfits(self, permittivity: NDArray[np.complex128], thickness: Array) -> tuple[Array, Array]:
        """Misfits of reflection and of transmission, (w, n) each, at walls of permittivity and thickness [m], (w,)."""
        left = misfits(permittivity, thickness, self.wavenumber, self.angle, self.products) / sum(self.powers)
        return left[0], left[1]

    @cached_property
    def products(self) -> Spectra:
        """Powers of TE and of TM, and TM times the conjugate of TE, of every echo, (n, 3, m)."""
        mixed = np.conj(self.te) * self.tm
        return np.stack([power_of(self.te), power_of(self.tm), mixed], axis=1)

    @cached_property
    def powers(self) -> tuple[Array, Array]:
        """Power of every echo in TE and in TM, summed over all frequencies, (n,) each."""
        return power_of(self.te).sum(axis=-1), power_of(self.tm).sum(axis=-1)

    def log_likelihood(self, misfit: Array) -> Array:
        """Logarithm of the likelihood of a `misfit`, up to a constant."""
        return -self.independent * misfit / (MISMATCH**2 + self.noise)

    @property
    def other(self) -> Array:
        """`log_likelihood` of other echoes, (n,): its mean over all pairs of amplitudes, of a mean misfit of a half."""
        return np.log(OTHER_SHARE) - 0.5 * np.log(self.independent / (MISMATCH**2 + self.noise))

    def mixed(self, reflected: Array, passed: Array) -> tuple[Array, Array]:
        """Logarithm of the likelihood of a mixture of reflected, passed and other echoes, from the misfits (w, n) of
        the first two, summed over echoes, (w,); and the share of passed echoes that makes it largest, (w,).
        """
        kinds = self.log_likelihood(reflected), self.log_likelihood(passed)
        return best_mixture(*kinds, self.other, lambda each: each.sum(-1))

    def alone(self, misfit: Array) -> Array:
        """Logarithm of the likelihood of one kind, from its misfit (w, n), and of others, summed over echoes, (w,)."""
        return np.logaddexp(self.log_likelihood(misfit), self.other).sum(-1)

    def with_metal(self, spread_db: float, as_one: float = 1.0) -> float:
        """Logarithm of the likelihood of a metal mirror, whose objects may return one polarization stronger than the
        other: all of them by one ratio (`OBJECT_DB`), and each echo by another one of its own (`spread_db`). `as_one`
        neighbouring echoes count as one.
        """
        te, tm = self.powers
        ratio, variance = 0.5 * np.log(tm / te), self.ratio_variance
        own = variance + (NEPER * spread_db) ** 2
        sigmas = np.linspace(-3.0, 3.0, 61)
        preferred, prior = NEPER * OBJECT_DB * sigmas[:, None], -0.5 * sigmas**2
        each = self.log_likelihood(self.least_misfit) + 0.5 * np.log(variance / own)
        each = each - 0.5 * (ratio - preferred) ** 2 / own
        every = np.logaddexp(each, self.other).sum(axis=-1) / as_one
        return float(logsumexp(prior + every) - logsumexp(prior))

    @cached_property
    def least_misfit(self) -> Array:
        """Misfit of each echo at its best ratio of amplitudes, the same at all frequencies, (n,)."""
        te, tm = self.powers
        common = np.abs(np.sum(np.conj(self.te) * self.tm, axis=-1))
        # The smaller eigenvalue of their covariance.
        return np.asarray(0.5 * (1.0 - np.hypot(te - tm, 2.0 * common) / (te + tm)))

    @property
    def ratio_variance(self) -> Array:
        """Variance of the logarithm of the ratio of amplitudes of each echo, (n,).

        A ratio that is off by the factor exp(q) adds a misfit of (q / 2)^2.
        """
        return np.asarray(2.0 * (MISMATCH**2 + self.noise) / self.independent)

    def log_odds(self, pane: Pane) -> tuple[Array, Mask]:
        """Logarithm of the odds that each echo passed through the wall, against reflection; and whether each is more
        likely neither, (n,) each.

        Rough objects scatter TE and TM a little differently, so that a single echo may seem to be of the wrong kind.
        So the odds are limited to `MOST_ODDS`, as the share of other echoes demands.
        """
        misfits = self.misfits(np.array([pane.permittivity]), np.array([pane.thickness]))
        reflected, passed = (self.log_likelihood(misfit[0]) for misfit in misfits)
        reflected, passed = reflected + np.log1p(-pane.share), passed + np.log(pane.share)
        return np.clip(passed - reflected, -MOST_ODDS, MOST_ODDS), np.maximum(reflected, passed) < self.other


def best_mixture(
    reflected: Array, passed: Array, other: Array | float, total: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Logarithm of the likelihood of a mixture of kinds of echoes, for the best of `SHARES`; and that share, (w,) each.

    `reflected`, `passed` and `other` are the logarithms for each echo and kind, (w, n); `total` sums them over echoes.
    """
    largest = np.maximum(np.maximum(reflected, passed), other)
    reflects, passes, neither = (np.exp(kind - largest) for kind in (reflected, passed, other))
    each = np.stack([
        total(largest + np.log((1.0 - share) * reflects + share * passes + neither)) for share in SHARES
    ])  # fmt: skip
    return each.max(axis=0), np.array(SHARES)[each.argmax(axis=0)]


def power_of(values: Spectra) -> Array:
    """Squared magnitude, of the same shape."""
    return values.real**2 + values.imag**2


@dataclass(frozen=True)
class Pane:
    """A half-transparent wall: its material and thickness, and the evidence that it lets waves pass.

    Attributes
    ----------
    permittivity : complex
        Relative permittivity, ``eps' - j eps''``.
    thickness : float [m]
    permittivity_error, thickness_error : float
        Standard errors of the real part of the permittivity, and of the thickness [m].
    evidence, against_metal : float
        Logarithm of the likelihood of the echoes with this wall over that with a wall of the same kind that only
        reflects; and over that with a metal mirror, whose objects may return one polarization stronger.
    share : float
        Share of passed echoes among those behind the wall.
    against_alike : float
        As `against_metal`, if all objects that the metal mirror shows have the same ratio of TM to TE: echoes that
        passed a thin wall at small angles look the same as echoes in metal.
    rms_height : float [m]
        Roughness of both faces, as it dims the coherent wave.
    """

    permittivity: complex
    thickness: float
    permittivity_error: float
    thickness_error: float
    evidence: float
    against_metal: float
    share: float
    against_alike: float = np.inf
    rms_height: float = 0.0


def find_pane(pairs: Pairs) -> Pane:
    """The wall that explains all echoes best, and the evidence that it does not only reflect."""
    trials, thickness = walls_to_try(pairs)
    both, mirror = [], []
    for first in range(0, trials.size, BATCH):
        some = slice(first, first + BATCH)
        reflected, passed = pairs.misfits(trials[some], thickness[some])
        both.append(pairs.mixed(reflected, passed)[0])
        mirror.append(pairs.alone(reflected))
    score, opaque = np.concatenate(both), np.concatenate(mirror)
    peaks = [_polished(pairs, trials[i], thickness[i]) for i in _peaks(score, trials, thickness)]
    best, height, covariance = max(peaks, key=lambda peak: peak[1])
    # Other walls may be nearly as likely, such as those whose phases differ by whole turns: the errors include these.
    weight = np.exp((score - score.max()) / ECHOES_AS_ONE)
    real, width = (np.average((tried - at) ** 2, weights=weight) for tried, at in ((trials.real, best[0]),
                                                                                   (thickness, best[2])))  # fmt: skip
    error = np.sqrt(ECHOES_AS_ONE * np.diag(covariance)[[0, 2]] + [real, width])
    real, loss, width = best
    eps = complex(real, -real * max(loss, 0.0))
    share = pairs.mixed(*pairs.misfits(np.array([eps]), np.array([width])))[1][0]
    return Pane(
        permittivity=eps,
        thickness=float(width),
        permittivity_error=float(error[0]),
        thickness_error=float(error[1]),
        evidence=height - float(opaque.max()),
        against_metal=height - pairs.with_metal(ECHO_DB),
        share=float(share),
        against_alike=height - pairs.with_metal(0.0),
    )


def walls_to_try(pairs: Pairs) -> tuple[NDArray[np.complex128], Array]:
    """Permittivities and thicknesses [m] of walls to try, (w,) each."""
    real = np.geomspace(*PERMITTIVITY, 18)[:, None, None]
    optical = np.arange(THINNEST * pairs.cell, THICKEST * pairs.cell, STEP / (2.0 * float(pairs.wavenumber.mean())))
    eps = real * (1.0 - 1j * np.array(LOSSES)[:, None])
    every = np.broadcast_arrays(eps, optical / np.sqrt(real))
    return every[0].ravel(), every[1].ravel()


PEAKS = 12
"""Number of best trials from which a peak of the likelihood is searched."""

NEIGHBOURING = 0.1, 0.05
"""Trials closer than this are one peak: in the logarithm of permittivity, and in thickness over the mean thickness."""

BEYOND_TRIED = 1.2
"""Factor by which a fitted permittivity may leave the range `PERMITTIVITY` of those that are tried first."""

DERIVATIVE_STEP, LEAST_EIGENVALUE = 0.3, 1e-6
"""Step of numerical derivatives at a peak; and the least eigenvalue of the second derivatives that counts: smaller ones
mean that the data say nothing about that combination of numbers."""


def _peaks(score: Array, eps: NDArray[np.complex128], thickness: Array) -> list[int]:
    """Indices of the best trials, no two of them neighbours in permittivity and thickness."""
    found: list[int] = []
    place = np.stack([np.log(eps.real) / NEIGHBOURING[0], thickness / thickness.mean() / NEIGHBOURING[1]])
    for index in np.argsort(-score):
        if all(np.linalg.norm(place[:, index] - place[:, other]) > 1.0 for other in found):
            found.append(int(index))
        if len(found) == PEAKS:
            break
    return found


def _polished(pairs: Pairs, eps: complex, thickness: float) -> tuple[Array, float, Array]:
    """Permittivity, loss tangent and thickness [m] at the peak near a trial, (3,); the logarithm of the likelihood
    there; and the covariance of the three numbers, (3, 3).
    """
    scale = np.array([0.1, 0.01, 0.1 / (2.0 * float(pairs.wavenumber.mean()) * np.sqrt(eps.real))])
    start = np.array([eps.real, -eps.imag / eps.real, thickness])

    def cost(steps: Array) -> float:
        real, loss, width = start + steps * scale
        possible = PERMITTIVITY[0] / BEYOND_TRIED < real < BEYOND_TRIED * PERMITTIVITY[1]
        if not (possible and -0.01 <= loss < 0.5 and width > 0.0):
            return 1e9
        wall = np.array([real * (1.0 - 1j * max(loss, 0.0))]), np.array([width])
        return -float(pairs.mixed(*pairs.misfits(*wall))[0][0])

    corners = np.concatenate([np.zeros((1, 3)), np.diag([2.0, 2.0, 2.0])])
    options = {"initial_simplex": corners, "maxiter": 150, "xatol": 0.01, "fatol": 0.01}
    found = minimize(cost, np.zeros(3), method="Nelder-Mead", options=options)
    return start + found.x * scale, -float(found.fun), _covariance(cost, found.x) * np.outer(scale, scale)


def _covariance(cost: Callable[[Array], float], at: Array) -> Array:
    """Covariance of n numbers, (n, n): the inverse of the second derivatives of `cost`, the negative log-likelihood.

    Derivatives are differences over twice `DERIVATIVE_STEP`, their eigenvalues at least `LEAST_EIGENVALUE`.
    """
    units = DERIVATIVE_STEP * np.eye(at.size)
    slopes = np.array([
        [cost(at + a + b) - cost(at + a - b) - cost(at - a + b) + cost(at - a - b) for b in units] for a in units
    ]) / (4.0 * DERIVATIVE_STEP**2)  # fmt: skip
    value, vector = np.linalg.eigh(slopes)
    return (vector / np.maximum(value, LEAST_EIGENVALUE)) @ vector.T
