"""The model of the measurement and its adjoint: against the formula, each other, `focus`, and PyLops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pylops
import pytest
from focusing_problems import line, literal_sum, noise, plane, problem
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.focusing.fast.line_array import LineArrayPlan, lay_out
from mirrorfold.focusing.operator import APPLICATIONS, _Exact, _Fast
from mirrorfold.focusing.predicting.cost import pair_sums_cost

BAND = np.linspace(78e9, 80e9, 31)
X, Y = np.arange(-0.8, 0.8, 0.02), np.arange(0.4, 1.9, 0.03)
PITCH = 1.85e-3

LINES = {
    "one array": problem(line(31, PITCH), line(31, PITCH), BAND, X, Y, taper="uniform"),
    "thinned": problem(line(31, PITCH)[[0, 3, 4, 9, 17, 22, 30]], line(31, PITCH), BAND, X, Y, taper="uniform"),
    "displaced": problem(line(31, PITCH), line(24, PITCH, x=0.1, y=0.01), BAND, X, Y),
    "at a height": problem(line(31, PITCH), line(31, PITCH, z=0.02), BAND, X, Y, taper="uniform"),
    "one moving antenna": problem(line(61, PITCH), line(61, PITCH), BAND, X, Y, monostatic=True),
    "with near pixels": problem(line(31, PITCH), line(31, PITCH), BAND, X, np.arange(0.03, 1.2, 0.03), taper="uniform"),
    "a volume": problem(line(31, PITCH), line(31, PITCH), BAND, X[::4], Y[::4], [-0.1, 0.0, 0.2]),
}
"""Measurements that the fast path serves."""

OTHERS = {
    "a plane of antennas": problem(plane(5, 4, PITCH), plane(3, 3, PITCH), BAND[:6], X[::4], Y[::4]),
    "two arrays": problem(line(7, PITCH), line(5, PITCH, x=0.05), BAND[:6], X[::4], Y[::4]),
    "one moving antenna": problem(line(9, PITCH), line(9, PITCH), BAND[:6], X[::4], Y[::4], monostatic=True),
}


def weighted(p, seed=3):
    """With complex weights, whose conjugates the transpose must have."""
    random = np.random.default_rng(seed)
    tx, rx = (random.normal(size=n) + 1j * random.normal(size=n) for n in (len(p.tx), len(p.rx)))
    return replace(p, tx_weight=tx, rx_weight=tx if p.coincident else rx)


def fast(p, tolerance=1e-4):
    return _Fast(LineArrayPlan(p, tolerance, lay_out(p, tolerance, pair_sums_cost, 10**6)))


def inner(a, b):
    return np.vdot(a.astype(complex), b.astype(complex))


def assert_adjoint(way, p):
    """<y, A x> = <A^H y, x>: for white x and y, and for y = A x, where nothing cancels."""
    x, y = noise(p.shape, 1), noise(p.data_shape, 2)
    samples, image = way.samples(x), way.focus(y)
    scale = np.linalg.norm(samples) * np.linalg.norm(y)
    assert abs(inner(y, samples) - inner(image, x)) < 1e-7 * scale
    assert abs(inner(samples, samples) - inner(way.focus(samples), x)) < 1e-6 * np.linalg.norm(samples) ** 2


@pytest.mark.parametrize("name", LINES)
def test_the_fast_path_and_its_transpose_are_adjoint(name):
    p = LINES[name]
    way = fast(p)
    if name == "with near pixels":
        assert all(near.any() for near, _ in way._near)
    assert_adjoint(way, p)


@pytest.mark.parametrize("name", ["one array", "displaced", "one moving antenna"])
def test_complex_weights_are_conjugated(name):
    p = weighted(LINES[name])
    assert_adjoint(fast(p), p)


@pytest.mark.parametrize("name", OTHERS)
def test_the_sums_over_all_pairs_are_adjoint(name):
    assert_adjoint(_Exact(OTHERS[name]), OTHERS[name])
    assert_adjoint(_Exact(weighted(OTHERS[name])), weighted(OTHERS[name]))


@pytest.mark.parametrize("name", OTHERS)
def test_the_sums_over_all_pairs_are_the_formula(name):
    p = weighted(OTHERS[name])
    s = noise(p.data_shape)
    literal = literal_sum(p, s, p.points(np.arange(p.pixels))).reshape(p.shape)
    assert np.linalg.norm(_Exact(p).focus(s) - literal) < 1e-6 * np.linalg.norm(literal)


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_both_directions_are_as_exact(name):
    """The tables of both are the same, and so is the error, in the mean over white images and white samples."""
    p = LINES[name]
    way, exact = fast(p), _Exact(p)
    x, s = noise(p.shape, 4), noise(p.data_shape, 5)
    image, samples = exact.focus(s), exact.samples(x)
    image_error = np.linalg.norm(way.focus(s) - image) / np.linalg.norm(image)
    samples_error = np.linalg.norm(way.samples(x) - samples) / np.linalg.norm(samples)
    assert 1e-7 < image_error < 3e-4
    assert 0.6 < samples_error / image_error < 1.6


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_the_error_keeps_to_the_tolerance(tolerance):
    p = LINES["one moving antenna"]
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y, tolerance=tolerance)
    x = noise(p.shape, 4)
    exact = _Exact(replace(p, taper=np.ones(p.k.size, dtype=complex))).samples(x)
    assert operator.error < tolerance
    assert np.linalg.norm(operator.all_samples(x) - exact) < 1.5 * tolerance * np.linalg.norm(exact)


def swept(p):
    """A sweep of ones with a problem's geometry."""
    frequency = p.k * 299_792_458.0 / (2.0 * np.pi)
    if p.monostatic:
        return mf.make_monostatic_sweep(
            np.ones(p.data_shape, dtype=complex), frequency=frequency, antenna_position=p.tx
        )
    return mf.make_sweep(np.ones(p.data_shape, dtype=complex), frequency=frequency, tx_position=p.tx, rx_position=p.rx)


def point_samples(p, place, amplitude):
    """What a point reflector makes, written out."""
    tx, rx = (np.linalg.norm(each - place, axis=1) for each in (p.tx, p.rx))
    return amplitude * np.exp(-1j * p.k[:, None, None] * (tx[:, None] + rx))


@pytest.mark.parametrize("p", [LINES["displaced"], OTHERS["two arrays"]], ids=["fast", "exact"])
def test_a_point_reflector(p):
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y, tolerance=1e-5)
    x = np.zeros(p.shape, dtype=complex)
    x[0, 7, 5] = 2.0 - 1.0j
    made = operator.matvec(x.ravel()).reshape(p.data_shape)
    expected = point_samples(p, [p.x[5], p.y[7], 0.0], 2.0 - 1.0j)
    assert_allclose(made, expected, atol=1e-3)


def test_the_fast_path_is_taken_where_it_pays():
    def taken(p):
        return mf.FocusOperator(swept(p), x=p.x, y=p.y).algorithm

    assert taken(LINES["one array"]) == "polar"
    assert taken(OTHERS["a plane of antennas"]) == "exact"
    assert APPLICATIONS > 1


@pytest.mark.parametrize("p", [LINES["one array"], OTHERS["one moving antenna"]], ids=["fast", "exact"])
def test_the_adjoint_is_focus_without_weights(p):
    sweep = swept(p)
    sweep["s"] = sweep["s"].dims, noise(p.data_shape)
    operator = mf.FocusOperator(sweep, x=p.x, y=p.y)
    image = operator.image(operator.rmatvec(operator.samples(sweep)))
    focused = mf.focus(sweep, x=p.x, y=p.y, taper="uniform")
    assert np.linalg.norm(image - focused) < 2e-4 * np.linalg.norm(focused)
    assert image.dims == focused.dims
    kept = set(focused.attrs) - {"algorithm", "error"}
    assert all(np.array_equal(image.attrs[name], focused.attrs[name]) for name in kept)


def test_channels_choose_rows_of_the_matrix():
    p = LINES["one array"]
    random = np.random.default_rng(0)
    mask = random.random(p.data_shape) < 0.2
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y, channels=mask)
    assert operator.shape == (mask.sum(), p.pixels)
    x = noise((p.pixels,), 1)
    assert_allclose(operator.matvec(x), operator.all_samples(x)[mask])
    y = noise((int(mask.sum()),), 2)
    everything = np.zeros(p.data_shape, dtype=np.complex64)
    everything[mask] = y
    whole = mf.FocusOperator(swept(p), x=p.x, y=p.y)
    assert_allclose(operator.rmatvec(y), whole.rmatvec(everything.ravel()))


def test_frequencies_and_elements_are_broadcast_and_pairs_not_measured_left_out():
    p = LINES["one array"]
    some = np.arange(p.k.size) % 3 == 0
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y, channels=some[:, None, None])
    assert operator.shape[0] == some.sum() * p.pairs
    measured = np.eye(len(p.tx), dtype=bool)
    sweep = swept(p).assign_coords(measured=(("tx", "rx"), measured))
    assert mf.FocusOperator(sweep, x=p.x, y=p.y).shape[0] == p.k.size * len(p.tx)


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_pylops_finds_them_adjoint(name):
    p = LINES[name]
    mask = np.random.default_rng(5).random(p.data_shape) < 0.5
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y, z=p.z if p.z.size > 1 else None, channels=mask)
    # Random inner products may cancel; how exact it is, relative to the norms, is asserted by itself.
    assert pylops.utils.dottest(pylops.aslinearoperator(operator), complexflag=3, rtol=1e-3)


def test_frames_are_columns():
    p = OTHERS["two arrays"]
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y)
    x = noise((p.pixels, 3), 1)
    assert_allclose(operator @ x, np.stack([operator @ column for column in x.T], axis=1))


@pytest.mark.parametrize(
    ("channels", "said"),
    [(np.ones(3), "true and false"), (np.ones((2, 2), dtype=bool), "broadcast"), (np.zeros(1, dtype=bool), "none")],
)
def test_channels_that_cannot_be(channels, said):
    p = OTHERS["two arrays"]
    with pytest.raises(mf.InputError, match=said):
        mf.FocusOperator(swept(p), x=p.x, y=p.y, channels=channels)


def test_wrong_shapes_are_told():
    p = OTHERS["two arrays"]
    operator = mf.FocusOperator(swept(p), x=p.x, y=p.y)
    with pytest.raises(mf.InputError, match="expected"):
        operator.samples(np.zeros((2, 3, 4)))
    with pytest.raises(mf.InputError, match="pixels"):
        operator.image(np.zeros(3))
