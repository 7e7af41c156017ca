"""The kernels that try many half-transparent walls at once, against the formulas written out with arrays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import gammaln, logsumexp
from through_slabs import delay

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.tree.half_transparent.glint_likelihoods import GATE, GATE_SHARE, LEVELS, SCALES, UNLIKE
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


def averaged(misfit, noise, every, left):
    variance = SCALES[:, None] + noise
    each = left * (np.log(left / variance) - misfit / variance)
    return logsumexp(each, axis=0) - np.log(SCALES.size) + gammaln(every - left) - gammaln(every)


def cut_out(spectrum, delay):
    """An echo at some places beside its own, earlier by the delay [m], under the window of the gate."""
    turned = np.exp(2j * (K - K.mean()) * (GATE[:, None] * CELL + delay))
    return turned @ spectrum * np.cos(0.25 * np.pi * GATE) ** 2


@pytest.mark.parametrize("powers", [(0.0,), (0.0, -1.0, -2.0)])
def test_likelihoods_of_glints_and_rough_objects_are_those_of_the_formulas(pairs, powers):
    random = np.random.default_rng(3)
    taper = np.cos(np.pi * np.linspace(-0.4, 0.4, K.size)) ** 2
    whole, long = some(random, 2, 2, ECHOES, K.size)
    glints = Glints(pairs, whole, long, taper, np.zeros((ECHOES, 2)))
    tried = walls(3)
    found = glints.likelihoods(tried, powers)
    assert_allclose(glints.likelihoods(tried, powers, kinds=1)[0], found[0], rtol=1e-12)
    delays = 0.1 * np.arange(-15, 16) * CELL
    for kind, w, n in np.ndindex(found.shape):
        te, tm = waves(tried, pairs.angle)[:, kind, w, n]
        late = delay(tried.permittivity[w], tried.thickness[w], pairs.angle[n]) if kind else 0.0
        a, b = cut_out(tm * long[0, n], late), cut_out(te * long[1, n], late)
        size = np.linalg.norm(b) / np.linalg.norm(a)
        factor = size * np.exp(1j * np.angle(np.vdot(a, b)))
        # What is left of both sides at the best factor, weighted alike.
        singular = np.linalg.svd(np.stack([a / np.linalg.norm(a), b / np.linalg.norm(b)]), compute_uv=False)
        apart = 2.0 * np.prod(singular) ** 2 / (size + 1.0 / size) * np.linalg.norm(a) * np.linalg.norm(b)
        norm = np.sum(taper**2 * (np.abs(te) ** 2 + np.abs(tm) ** 2)) / np.sum(taper**2)
        power = sum(np.linalg.norm(cut_out(each, 0.0)) ** 2 for each in long[:, n])
        unlike = np.log(size) ** 2 + (np.angle(factor) - np.pi * np.round(np.angle(factor) / np.pi)) ** 2
        prior = np.log(np.mean(0.5 * LEVELS / UNLIKE**2 * np.exp(-0.5 * unlike / UNLIKE**2)) + 1e-300)
        every = 2.0 * GATE_SHARE * INDEPENDENT
        ratio = averaged(apart / norm / power, pairs.noise[n], every, 0.5 * every - 1.0) + prior
        # The part of the echo that is along the wave of the wall, and the share of it that the best glint leaves.
        tm = factor * tm
        strength = np.sqrt(np.abs(te) ** 2 + np.abs(tm) ** 2)
        along = (np.conj(te) * whole[0, n] + np.conj(tm) * whole[1, n]) / strength
        explained = np.empty((len(powers), delays.size))
        for p, d in np.ndindex(explained.shape):
            glint = strength * taper * (K / K.mean()) ** powers[p] * np.exp(-2j * (K - K.mean()) * delays[d])
            explained[p, d] = np.abs(np.vdot(glint, along)) ** 2 / np.sum(np.abs(glint) ** 2)
        tops = [explained.max()]
        for row in explained:
            i = int(np.clip(row.argmax(), 1, row.size - 2))
            a, b, c = np.polyfit([-1.0, 0.0, 1.0], row[i - 1 : i + 2], 2)
            if a < 0.0:
                at = np.clip(-0.5 * b / a, -0.5, 0.5)
                tops.append(c + 0.5 * b * at)  # the top of the parabola, where that is between the neighbours
        misfit = np.clip(1.0 - max(tops) / np.sum(np.abs(along) ** 2), 0.0, 1.0)
        glint = averaged(misfit, pairs.noise[n], INDEPENDENT, INDEPENDENT - 1.5)
        assert found[kind, w, n] == pytest.approx(ratio + np.logaddexp(glint, 0.0) - np.log(2.0), abs=0.02)


def test_what_goes_to_and_fro_in_the_wall_is_lost_at_no_edge_of_a_window():
    """A row of scatterers behind a wall tells 1 % of its thickness, though windows of one echo disturb the ratio."""
    random, cell, eps, thickness, angle = np.random.default_rng(4), 0.025, 4.9 - 0.06j, 6.4e-3, 0.9
    fine = 2.0 * np.pi * (122e9 + 12e9 * np.linspace(-0.5, 0.5, 241)) / 299792458.0
    k = np.interp(np.linspace(0.08, 0.92, 21), np.linspace(0.0, 1.0, 241), fine)
    depth = np.arange(-6.0, 6.0, 0.1) * cell
    row = some(random, 40) @ np.exp(-2j * np.outer(random.uniform(-1.5, 1.5, 40) * cell, fine - fine.mean()))
    row = row * np.hanning(241)

    def spectra(flat, edge):
        window = np.cos(0.5 * np.pi * np.clip((np.abs(depth) / cell - flat) / edge, 0.0, 1.0)) ** 2
        to_depth, back = (np.exp(2j * np.outer(depth, each - fine.mean())) for each in (fine, k))
        passed = [slab(eps, thickness, fine, angle, name)[1] ** 2 for name in POLARIZATIONS]
        return np.stack([(window * (to_depth @ (row * wave))) @ np.conj(back) for wave in passed])[:, None]

    short, whole, long = spectra(0.0, 3.0), spectra(2.0, 2.0), spectra(4.0, 2.0)
    pairs = Pairs(*short, np.array([angle]), k, np.full(1, 1e-7), INDEPENDENT, cell)
    taper = np.cos(np.pi * np.linspace(-0.42, 0.42, 21)) ** 2
    found = Glints(pairs, whole, long, taper, np.zeros((1, 2)))
    right, wrong = np.array([eps, eps, 1.02 * eps]), np.array([thickness, 1.01 * thickness, thickness])
    passed = found.likelihoods(Walls(right, wrong, np.zeros(3)))[1, :, 0]
    assert (passed[1:] < passed[0] - 20.0).all()
    assert pairs.misfits(right[:1], wrong[:1])[1][0, 0] > 1e-3
