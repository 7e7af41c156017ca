"""How likely it is that echoes passed through a wall of which it is not known whether it lets waves pass.

The echoes may be reflected by metal, or by a dielectric wall that lets nothing pass, or be a mixture of reflected and
passed echoes of a half-transparent wall. The likelihood of each of the three is averaged over all walls, shares of
passed echoes, and preferences of objects for a polarization that are possible: what could have explained many other
echoes as well counts less (Jeffreys, Theory of Probability, 3rd ed., 1961, chapter 5). Where both polarizations are
nearly alike, as at small angles of incidence, the three stay about as likely as before the measurement, and it stays
open whether an echo passed.
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit, logsumexp

from mirrorfold.common.decibels import NEPER
from mirrorfold.common.types import Array, Mask
from mirrorfold.tree.half_transparent.panes import BATCH, ECHO_DB, ECHOES_AS_ONE, OBJECT_DB, SHARES, Pairs, walls_to_try

DOUBTFUL = 0.1, 0.9
"""Probabilities between which it is doubtful whether an echo passed."""


def doubtful(passed: Array) -> Mask:
    """Which echoes are doubtful by their probability to have passed, (n,)."""
    return (passed > DOUBTFUL[0]) & (passed < DOUBTFUL[1])


def passage_by_polarization(pairs: Pairs) -> tuple[float, Array]:
    """Probability that a wall lets waves pass, and that each echo behind it passed through it if it does, (n,).

    Before the measurement it is as likely as not that the wall lets waves pass; if it does not, that it is of metal.
    """
    permittivity, thickness = walls_to_try(pairs)
    share, other = np.array(SHARES)[:, None, None], np.exp(pairs.other)
    heights, alone, passed = list[Array](), list[Array](), np.zeros(pairs.angle.size)
    weight, largest = 0.0, -np.inf
    for first in range(0, permittivity.size, BATCH):
        some = slice(first, first + BATCH)
        reflects, passes = (np.exp(_likely(pairs, kind)) for kind in pairs.misfits(permittivity[some], thickness[some]))
        through, mixture = share * (passes + other), (1.0 - share) * reflects + share * passes + other
        height = np.log(mixture).sum(axis=-1) / ECHOES_AS_ONE
        heights.append(height.ravel())
        alone.append(np.log(reflects + other).sum(axis=-1) / ECHOES_AS_ONE)
        # The mean over walls and shares, with weights relative to the largest so far.
        higher = max(largest, float(height.max()))
        each = np.exp(height - higher)
        passed = passed * np.exp(largest - higher) + np.einsum("sw,swn->n", each, through / mixture)
        weight, largest = weight * np.exp(largest - higher) + each.sum(), higher
    metal = [pairs.with_metal(spread, ECHOES_AS_ONE) for spread in (0.0, ECHO_DB)]
    window, opaque = _log_mean(np.concatenate(heights)), _log_mean([_log_mean(np.concatenate(alone)), _log_mean(metal)])
    return float(expit(window - opaque)), np.asarray(passed / weight)


def _likely(pairs: Pairs, misfit: Array) -> Array:
    """`Pairs.log_likelihood` of misfits (w, n), if objects prefer a polarization as they do in a metal mirror.

    A preference by the factor exp(q) adds ``(q / 2)^2`` to what is left at the best constant ratio of polarizations.
    """
    variance, spread = pairs.ratio_variance, NEPER * np.hypot(OBJECT_DB, ECHO_DB)
    own = variance + spread**2
    beyond = np.maximum(misfit - pairs.least_misfit, 0.0)
    return np.asarray(pairs.log_likelihood(misfit - beyond) + 0.5 * np.log(variance / own) - 2.0 * beyond / own)


def _log_mean(logarithms: Array | list[float]) -> float:
    """Logarithm of the mean of numbers, from their logarithms (n,)."""
    return float(logsumexp(logarithms) - np.log(len(logarithms)))
