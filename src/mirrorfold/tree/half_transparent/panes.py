"""Half-transparent walls: their permittivity and thickness, from echoes behind them in two polarizations.

Of an echo that the wall reflected on both ways, TE and TM bear its coefficients R^2; of one that passed through it,
T^2. What scattered it is unknown, and taken to send both polarizations back alike up to a phase (of conductors: plus
for one reflection, minus for two). So at every frequency the pair (TE, TM) should be parallel to (R_TE^2, R_TM^2) or
to (T_TE^2, T_TM^2); the share of its power that is not, for all frequencies, is the misfit of either. One wall has to
serve all echoes behind it, over angle and frequency: its permittivity and thickness are those that make the likelihood
largest of a mixture of reflected, transmitted and other echoes (Dempster, Laird and Rubin, J. R. Stat. Soc. B 39, 1,
1977).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp

from mirrorfold.common.slabs import both_polarizations
from mirrorfold.common.types import Array, Index, Mask

Spectra = NDArray[np.complex128]

PERMITTIVITY = 1.8, 10.0
"""Between which the permittivity of building materials lies at these frequencies: wood and concrete at the ends
(Recommendation ITU-R P.2040)."""

LOSSES = 0.002, 0.02, 0.06, 0.18
"""Loss tangents that are tried first."""

STEP = 0.6
"""Of the phase of one way through the wall and back, between thicknesses that are tried first [rad]."""

THINNEST, THICKEST = 0.15, 1.5
"""Optical thickness that is looked for, in range cells: of a thinner wall only the permittivity times the thickness is
told, and the two faces of a thicker one have echoes of their own."""

MISMATCH = 0.1
"""Amplitude of what is not as the model says, over that of the echo: 20 dB, neighbours and side lobes."""

OBJECT_DB, ECHO_DB = 2.0, 1.0
"""How much stronger one polarization may come back than the other from what a metal mirror shows [dB]: by the same
number for all echoes; and besides by a number of its own for each echo, which is tried with zero, too."""

SHARED = 3.0
"""Neighbouring echoes share so much of their spectra: the windows that cut them out are six cells long and overlap."""

OTHER = 0.02
"""Share of echoes that are neither reflected nor transmitted, and whose pairs of amplitudes may be any."""

MOST_ODDS = -np.log(OTHER)
"""Largest logarithm of the odds that a single echo may give."""

SHARES = 0.05, 0.2, 0.4, 0.6, 0.8, 0.95
"""Of the echoes behind a wall that passed through it, that are tried."""

BATCH = 400
"""Walls that are tried at once; bounds the memory."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Echoes behind a wall in both polarizations.

    Attributes
    ----------
    te, tm : (n, m) complex arrays
        Spectra.
    angle : (n,) array [rad]
        Of incidence on the wall.
    wavenumber : (m,) array [rad/m]
    noise : (n,) array
        Power of the noise over that of the echo, of one independent value.
    independent : float
        Values of each spectrum.
    cell : float [m]
        Of range.
    """

    te: Spectra
    tm: Spectra
    angle: Array
    wavenumber: Array
    noise: Array
    independent: float
    cell: float

    def some(self, most: int) -> Pairs:
        """No more than so many echoes, evenly chosen by the angle of incidence."""
        if self.angle.size <= most:
            return self
        return self.take(np.sort(np.argsort(self.angle)[np.linspace(0, self.angle.size - 1, most).astype(np.intp)]))

    def take(self, which: Index) -> Pairs:
        """Some of the echoes."""
        each = {name: getattr(self, name)[which] for name in ("te", "tm", "angle", "noise")}
        return replace(self, **each)

    def misfits(self, permittivity: NDArray[np.complex128], thickness: Array) -> tuple[Array, Array]:
        """The misfits of reflection and of transmission at walls (w,), (w, n) each."""
        walls = permittivity[:, None, None], thickness[:, None, None]
        te, tm = both_polarizations(*walls, self.wavenumber, self.angle[:, None])
        reflected, passed = (parallel_misfit(self.te, self.tm, a**2, b**2) for a, b in zip(te, tm, strict=True))
        return reflected, passed

    def log_likelihood(self, misfit: Array) -> Array:
        """Logarithm of the likelihood of a misfit, without a constant."""
        return np.asarray(-self.independent * misfit / (MISMATCH**2 + self.noise))

    @property
    def other(self) -> Array:
        """`log_likelihood` for echoes of any amplitudes, (n,): the mean over all pairs of two, of misfit a half."""
        return np.asarray(np.log(OTHER) - 0.5 * np.log(self.independent / (MISMATCH**2 + self.noise)))

    def mixed(self, reflected: Array, passed: Array) -> tuple[Array, Array]:
        """Logarithm of the likelihood of a mixture of both, by their misfits (w, n), and of others, summed, (w,); and
        the share of what passed with which it is largest.
        """
        kinds = self.log_likelihood(reflected), self.log_likelihood(passed)
        return best_mixture(*kinds, self.other, lambda each: each.sum(-1))

    def alone(self, misfit: Array) -> Array:
        """Logarithm of the likelihood of one kind, by its misfit (w, n), and of others, summed, (w,)."""
        return np.asarray(np.logaddexp(self.log_likelihood(misfit), self.other).sum(-1))

    def with_metal(self, spread_db: float) -> float:
        """Logarithm of the likelihood of a metal mirror, whose objects may send one polarization back stronger than the
        other: all alike, and each echo by so many decibels more.
        """
        te, tm = (np.sum(np.abs(each) ** 2, axis=-1) for each in (self.te, self.tm))
        common = np.abs(np.sum(np.conj(self.te) * self.tm, axis=-1))
        # At its best ratio of amplitudes, the misfit is the smaller eigenvalue of their covariance.
        least = 0.5 * (1.0 - np.hypot(te - tm, 2.0 * common) / (te + tm))
        ratio = 0.5 * np.log(tm / te)
        # A ratio that is off by the factor exp(q) has a misfit of (q / 2)^2: the standard error of its logarithm.
        variance = 2.0 * (MISMATCH**2 + self.noise) / self.independent
        own = variance + (spread_db / 20.0 * np.log(10.0)) ** 2
        sigmas = np.linspace(-3.0, 3.0, 61)
        preferred, prior = OBJECT_DB / 20.0 * np.log(10.0) * sigmas[:, None], -0.5 * sigmas**2
        each = self.log_likelihood(least) + 0.5 * np.log(variance / own) - 0.5 * (ratio - preferred) ** 2 / own
        return float(logsumexp(prior + np.logaddexp(each, self.other).sum(axis=-1)) - logsumexp(prior))

    def log_odds(self, pane: Pane) -> tuple[Array, Mask]:
        """Logarithm of the odds of each echo that it passed through the wall instead of being reflected; and whether it
        is like neither, (n,) each.

        Rough objects scatter TE and TM a little differently, so that a single echo may seem to be of the wrong kind:
        none tells more than the share of other echoes allows.
        """
        misfits = self.misfits(np.array([pane.permittivity]), np.array([pane.thickness]))
        reflected, passed = (self.log_likelihood(misfit[0]) for misfit in misfits)
        reflected, passed = reflected + np.log1p(-pane.share), passed + np.log(pane.share)
        return np.clip(passed - reflected, -MOST_ODDS, MOST_ODDS), np.maximum(reflected, passed) < self.other


def best_mixture(
    reflected: Array, passed: Array, other: Array | float, total: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Logarithm of the likelihood of echoes of which a share passed, and that of `SHARES` with which it is largest.

    `reflected`, `passed` and `other` are the logarithms for each echo (w, n), which `total` sums up to (w,).
    """
    each = np.stack([
        total(np.logaddexp(np.logaddexp(reflected + np.log1p(-share), passed + np.log(share)), other))
        for share in SHARES
    ])  # fmt: skip
    return each.max(axis=0), np.array(SHARES)[each.argmax(axis=0)]


def parallel_misfit(echo_te: Spectra, echo_tm: Spectra, te: Spectra, tm: Spectra) -> Array:
    """The share of the power of echoes (n, m) that is not parallel to the pair (te, tm) of walls, (w, n)."""
    size = np.maximum(np.abs(te) ** 2 + np.abs(tm) ** 2, np.finfo(float).tiny)
    one, other = tm * echo_te, te * echo_tm
    left = np.sum((np.abs(one) ** 2 + np.abs(other) ** 2) / size, axis=-1)
    left = left - 2.0 * np.abs(np.sum(np.conj(one) * other / size, axis=-1))
    return np.asarray(left / np.sum(np.abs(echo_te) ** 2 + np.abs(echo_tm) ** 2, axis=-1))


@dataclass(frozen=True)
class Pane:
    """A wall that lets waves through.

    Attributes
    ----------
    permittivity : complex
        Relative, ``eps' - j eps''``.
    thickness : float [m]
    permittivity_error, thickness_error : float
        Standard errors, of the real part and [m].
    evidence, against_metal : float
        Logarithm of how much more likely the echoes are with it than with a wall of it that only reflects; and than
        with one of metal, whose objects may prefer one polarization.
    share : float
        Of the echoes behind it that passed through it.
    against_alike : float
        The same as `against_metal`, if what metal shows sends both polarizations back by one ratio: what passes a thin
        wall at small angles may be shown by metal as well.
    rms_height : float [m]
        Of the roughness of both faces, as it dims the coherent wave.
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
    """The wall that serves all echoes best, and how much better than one that only reflects."""
    trials, thickness = _trials(pairs)
    both, mirror = [], []
    for first in range(0, trials.size, BATCH):
        some = slice(first, first + BATCH)
        reflected, passed = pairs.misfits(trials[some], thickness[some])
        both.append(pairs.mixed(reflected, passed)[0])
        mirror.append(pairs.alone(reflected))
    score, opaque = np.concatenate(both), np.concatenate(mirror)
    peaks = [_polished(pairs, trials[i], thickness[i]) for i in _peaks(score, trials, thickness)]
    best, height, covariance = max(peaks, key=lambda peak: peak[1])
    # Other walls may be nearly as likely, such as those whose phases differ by whole turns: the errors hold them all.
    weight = np.exp((score - score.max()) / SHARED)
    real, width = (np.average((tried - at) ** 2, weights=weight) for tried, at in ((trials.real, best[0]),
                                                                                   (thickness, best[2])))  # fmt: skip
    error = np.sqrt(SHARED * np.diag(covariance)[[0, 2]] + [real, width])
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


def _trials(pairs: Pairs) -> tuple[NDArray[np.complex128], Array]:
    """Permittivities and thicknesses of walls to try, (w,) each."""
    middle = float(pairs.wavenumber.mean())
    found: list[tuple[Array, Array]] = []
    for real in np.geomspace(*PERMITTIVITY, 18):
        optical = np.arange(THINNEST * pairs.cell, THICKEST * pairs.cell, STEP / (2.0 * middle))
        for loss in LOSSES:
            found.append((np.full(optical.size, real * (1.0 - 1j * loss)), optical / np.sqrt(real)))
    eps, thickness = (np.concatenate(column) for column in zip(*found, strict=True))
    return eps, thickness


PEAKS = 12
"""Best trials from which the likelihood is climbed."""


def _peaks(score: Array, eps: NDArray[np.complex128], thickness: Array) -> list[int]:
    """The best trials, no two of them neighbours."""
    found: list[int] = []
    place = np.stack([np.log(eps.real) / 0.1, thickness / thickness.mean() / 0.05])
    for index in np.argsort(-score):
        if all(np.linalg.norm(place[:, index] - place[:, other]) > 1.0 for other in found):
            found.append(int(index))
        if len(found) == PEAKS:
            break
    return found


def _polished(pairs: Pairs, eps: complex, thickness: float) -> tuple[Array, float, Array]:
    """Permittivity, loss tangent and thickness of the peak near a trial; its likelihood; and their covariance."""
    scale = np.array([0.1, 0.01, 0.1 / (2.0 * float(pairs.wavenumber.mean()) * np.sqrt(eps.real))])
    start = np.array([eps.real, -eps.imag / eps.real, thickness])

    def cost(steps: Array) -> float:
        real, loss, width = start + steps * scale
        if not (PERMITTIVITY[0] / 1.2 < real < 1.2 * PERMITTIVITY[1] and -0.01 <= loss < 0.5 and width > 0.0):
            return 1e9
        wall = np.array([real * (1.0 - 1j * max(loss, 0.0))]), np.array([width])
        return -float(pairs.mixed(*pairs.misfits(*wall))[0][0])

    corners = np.concatenate([np.zeros((1, 3)), np.diag([2.0, 2.0, 2.0])])
    options = {"initial_simplex": corners, "maxiter": 150, "xatol": 0.01, "fatol": 0.01}
    found = minimize(cost, np.zeros(3), method="Nelder-Mead", options=options)
    return start + found.x * scale, -float(found.fun), covariance(cost, found.x) * np.outer(scale, scale)


def covariance(cost: Callable[[Array], float], at: Array, *, step: float = 0.3, least: float = 1e-6) -> Array:
    """Inverse of the second derivatives of a negative logarithm of a likelihood of n numbers, (n, n).

    They are differences over twice a `step`, and taken for no smaller than the `least`, where nothing tells.
    """
    units = step * np.eye(at.size)
    slopes = np.array([
        [cost(at + a + b) - cost(at + a - b) - cost(at - a + b) + cost(at - a - b) for b in units] for a in units
    ]) / (4.0 * step**2)  # fmt: skip
    value, vector = np.linalg.eigh(slopes)
    return np.asarray((vector / np.maximum(value, least)) @ vector.T)
