"""The kernels that try many half-transparent walls at once, against the formulas written out with arrays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import gammaln, logsumexp

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.tree.half_transparent.glint_likelihoods import LEVELS, SCALES, UNLIKE
from mirrorfold.tree.half_transparent.misfits import WORTH_SHARING
from mirrorfold.tree.half_transparent.panes import Pairs
from mirrorfold.tree.half_transparent.wall_glints import Glints, Walls

pytestmark = pytest.mark.nojit

ECHOES, K = 7, 2.0 * np.pi * np.linspace(113e9, 127e9, 15) / 299792458.0
CELL, INDEPENDENT = 0.019, 5.0


def some(random, *shape):
    return random.standard_normal(shape) + 1j * random.standard_normal(shape)


@pytest.fixture
def pairs():
    random = np.random.default_rng(1)
    te, tm = some(random, 2, ECHOES, K.size)
    return Pairs(te, tm, random.uniform(0.1, 1.4, ECHOES), K, random.uniform(0.0, 0.1, ECHOES), INDEPENDENT, CELL)


def walls(count):
    random = np.random.default_rng(2)
    eps = random.uniform(1.8, 10.0, count) * (1.0 - 1j * random.uniform(0.0, 0.18, count))
    return Walls(eps, random.uniform(1e-4, 2e-2, count), random.choice([0.0, 5e-5, 1e-4], count))


def waves(tried, angle):
    """R^2 and T^2 in TE and TM, (2, 2, w, n, m)."""
    eps, thickness, height = (each[:, None, None] for each in tried)
    return np.square([slab(eps, thickness, K, angle[:, None], name, rms_height=height) for name in POLARIZATIONS])


def unparallel(pairs, te, tm):
    """Share of the power of each echo that is not along (te, tm), where both polarizations share one spectrum."""
    norm = np.abs(te) ** 2 + np.abs(tm) ** 2
    along = (np.conj(te) * pairs.te + np.conj(tm) * pairs.tm) / np.sqrt(norm)
    opposite = (np.conj(te) * pairs.te - np.conj(tm) * pairs.tm) / np.sqrt(norm)
    # Up to a phase between both polarizations that is the same for all frequencies: the best of all phases.
    phases = np.exp(2j * np.pi * np.arange(720) / 720.0)
    turned = np.abs(0.5 * ((1 + phases) * along[..., None] + (1 - phases) * opposite[..., None])) ** 2
    power = np.sum(np.abs(pairs.te) ** 2 + np.abs(pairs.tm) ** 2, axis=1)
    return 1.0 - turned.sum(axis=-2).max(axis=-1) / power


@pytest.mark.parametrize("count", [1, WORTH_SHARING])
def test_misfits_are_the_shares_of_power_that_a_wall_leaves_unexplained(pairs, count):
    tried = walls(count)._replace(rms_height=np.zeros(count))
    found = pairs.misfits(tried.permittivity, tried.thickness)
    (r_te, t_te), (r_tm, t_tm) = waves(tried, pairs.angle)
    for misfit, te, tm in zip(found, (r_te, t_te), (r_tm, t_tm), strict=True):
        assert_allclose(misfit, unparallel(pairs, te, tm), atol=2e-5)


def averaged(misfit, noise, free):
    left = 2.0 * INDEPENDENT - free
    variance = SCALES[:, None] + noise
    each = left * (np.log(left / variance) - misfit / variance)
    return logsumexp(each, axis=0) - np.log(SCALES.size) + gammaln(free) - gammaln(2.0 * INDEPENDENT)


@pytest.mark.parametrize("powers", [(0.0,), (0.0, -1.0, -2.0)])
def test_likelihoods_of_glints_and_rough_objects_are_those_of_the_formulas(pairs, powers):
    random = np.random.default_rng(3)
    taper = np.cos(np.pi * np.linspace(-0.4, 0.4, K.size)) ** 2
    whole = some(random, 2, ECHOES, K.size)
    glints = Glints(pairs, *whole, taper, np.zeros((ECHOES, 2)))
    tried = walls(3)
    found = glints.likelihoods(tried, powers)
    assert_allclose(glints.likelihoods(tried, powers, kinds=1)[0], found[0], rtol=1e-12)
    delays = 0.1 * np.arange(-15, 16) * CELL
    for kind, w, n in np.ndindex(found.shape):
        te, tm = waves(tried, pairs.angle)[:, kind, w, n]
        explained, levels = np.empty((len(powers), delays.size)), np.empty((len(powers), delays.size), complex)
        for p, d in np.ndindex(explained.shape):
            glint = taper * (K / K.mean()) ** powers[p] * np.exp(-2j * (K - K.mean()) * delays[d])
            models = np.array([te, tm]) * glint
            sent = np.sum(np.conj(models) * whole[:, n], axis=1)
            norm = np.sum(np.abs(models) ** 2, axis=1)
            explained[p, d] = np.sum(np.abs(sent) ** 2 / norm)
            levels[p, d] = (sent[0] / norm[0]) / (sent[1] / norm[1])
        tops = [explained.max()]
        for row in explained:
            i = int(np.clip(row.argmax(), 1, row.size - 2))
            a, b, c = np.polyfit([-1.0, 0.0, 1.0], row[i - 1 : i + 2], 2)
            if a < 0.0:
                at = np.clip(-0.5 * b / a, -0.5, 0.5)
                tops.append(c + 0.5 * b * at)  # the top of the parabola, where that is between the neighbours
        misfit = np.clip(1.0 - max(tops) / np.sum(np.abs(whole[:, n]) ** 2), 0.0, 1.0)
        differ = np.log(levels.ravel()[explained.argmax()])
        unlike = differ.real**2 + (differ.imag - np.pi * np.round(differ.imag / np.pi)) ** 2
        prior = np.log(np.mean(0.5 * LEVELS / UNLIKE**2 * np.exp(-0.5 * unlike / UNLIKE**2)) + 1e-300)
        ratio = unparallel(pairs, te, tm)[n]
        both = (
            averaged(misfit, pairs.noise[n], 2.5) + prior,
            averaged(ratio, pairs.noise[n], INDEPENDENT + 0.5),
        )
        assert found[kind, w, n] == pytest.approx(logsumexp(both) - np.log(2.0), abs=0.02)
