"""Measuring less than the whole sweep: the operators, the choices, the solver, and the completed sweep."""

from __future__ import annotations

import numpy as np
import pylops
import pytest
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.reproducing.parts.sparse_imaging import Channels, Modes, random_channels, sparse_reflectivity

pytestmark = pytest.mark.filterwarnings("ignore:y reaches beyond the ambiguous range")

SHAPE = (24, 20, 20)
X, Y = np.arange(-0.5, 0.5, 0.03), np.arange(0.5, 1.3, 0.04)
POINTS = {(4, 6): 1.0, (15, 25): -0.3j, (8, 20): 0.05 + 0.05j}
"""Pixels (y, x) and their reflectivities, over 23 dB."""


@pytest.fixture(scope="module")
def sweep():
    place = np.zeros((20, 3))
    place[:, 0] = 1.9e-3 * (np.arange(20) - 9.5)
    frequency = np.linspace(77e9, 80e9, 24)
    return mf.make_sweep(np.ones(SHAPE, dtype=complex), frequency=frequency, tx_position=place, rx_position=place)


@pytest.fixture(scope="module")
def model(sweep):
    return mf.FocusOperator(sweep, x=X, y=Y)


@pytest.fixture(scope="module")
def truth():
    x = np.zeros((Y.size, X.size), dtype=np.complex64)
    for pixel, value in POINTS.items():
        x[pixel] = value
    return x


def focused(sweep, s):
    return mf.focus(sweep.assign(s=(sweep["s"].dims, s)), x=X, y=Y)


def ways(model, share):
    random = np.random.default_rng(2)
    kinds = ("channels", "frequencies", "elements")
    found = {kind: Channels(model, random_channels(kind, share, SHAPE, random)) for kind in kinds}
    return {**found, "modes": Modes(model, SHAPE, share, random)}


@pytest.mark.parametrize("kind", ["channels", "frequencies", "elements", "modes"])
def test_the_operators_are_adjoint_and_measure_what_is_chosen(model, kind):
    measurement = ways(model, 0.25)[kind]
    operator, rng = measurement.operator, np.random.default_rng(7)
    x, y = (rng.standard_normal((n, 2)) @ [1.0, 1.0j] for n in operator.shape[::-1])
    there, back = operator.matvec(x.astype(np.complex64)), operator.rmatvec(y.astype(np.complex64))
    assert abs(np.vdot(y, there) - np.vdot(back, x)) < 1e-6 * np.linalg.norm(y) * np.linalg.norm(there)
    # The random inner products of this one may cancel, so that it is no test of how exact the operator is.
    assert pylops.utils.dottest(pylops.aslinearoperator(operator), complexflag=3, rtol=1e-3)
    assert operator.shape[0] == pytest.approx(0.25 * np.prod(SHAPE), rel=1e-2)


@pytest.mark.parametrize("kind", ["channels", "frequencies", "elements"])
def test_the_completed_sweep_is_what_was_measured(model, kind):
    measurement = ways(model, 0.25)[kind]
    random = np.random.default_rng(3)
    s = (random.normal(size=SHAPE) + 1j * random.normal(size=SHAPE)).astype(np.complex64)
    x = random.normal(size=model.shape[1]).astype(np.complex64)
    y = measurement.measured(s)
    assert_allclose(measurement.measured(measurement.completed(y, x)), y, atol=2e-3)


@pytest.mark.parametrize("kind", ["channels", "frequencies", "elements", "modes"])
def test_a_true_model_completes_the_true_sweep(model, truth, kind):
    measurement = ways(model, 0.1)[kind]
    s = model.all_samples(truth)
    assert_allclose(measurement.completed(measurement.measured(s), truth.ravel()), s, atol=1e-4)


def test_what_a_model_of_modes_leaves_is_added_at_its_own_level(model):
    """Without a model the matched filter itself is left: in the mean as strong as the share of the samples."""
    modes = Modes(model, SHAPE, 0.25, np.random.default_rng(2))
    random = np.random.default_rng(3)
    s = (random.normal(size=SHAPE) + 1j * random.normal(size=SHAPE)).astype(np.complex64)
    left = modes.completed(modes.measured(s), np.zeros(model.shape[1], dtype=np.complex64))
    assert np.vdot(s, left).real / np.vdot(s, s).real == pytest.approx(0.25, rel=0.05)


def test_elements_and_frequencies_are_whole():
    random = np.random.default_rng(4)
    frequencies = random_channels("frequencies", 0.25, SHAPE, random)
    assert set(frequencies.sum(axis=(1, 2))) == {0, 400}
    elements = random_channels("elements", 0.25, SHAPE, random)
    assert (elements == elements[0]).all()
    assert elements[0].sum(axis=1).max() == elements[0].sum(axis=0).max() == 10
    channels = random_channels("channels", 0.1, SHAPE, random)
    assert channels.sum() == 960
    assert len(set(channels.sum(axis=(1, 2)))) > 3


@pytest.mark.parametrize("kind", ["channels", "elements", "modes"])
def test_few_reflectors_are_found_from_a_tenth(sweep, model, truth, kind):
    """The completed sweep gives the image of the whole one, with far less error than delay and sum."""
    measurement = ways(model, 0.1)[kind]
    s = model.all_samples(truth)
    y = measurement.measured(s)
    whole = focused(sweep, s)
    x = sparse_reflectivity(measurement, y, 60).x
    sparse = focused(sweep, measurement.completed(y, x))
    matched = focused(sweep, measurement.matched(y))
    # The matched filter has a scale of its own; the one nearest to the whole image is fair.
    matched = matched * (np.vdot(matched, whole) / np.vdot(matched, matched))
    assert np.linalg.norm(sparse - whole) < 0.2 * np.linalg.norm(matched - whole)
    brightest = np.unravel_index(np.argmax(np.abs(x)), truth.shape)
    assert brightest == (4, 6)


def test_phases_are_kept(model, truth):
    """The soft threshold shrinks the amplitude and leaves the phase."""
    measurement = ways(model, 0.5)["channels"]
    x = sparse_reflectivity(measurement, measurement.measured(model.all_samples(truth)), 60).x.reshape(truth.shape)
    assert np.angle(x[4, 6]) == pytest.approx(0.0, abs=0.02)
    assert np.angle(x[15, 25]) == pytest.approx(-np.pi / 2, abs=0.05)
