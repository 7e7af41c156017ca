"""Every compiled loop nest of focusing against the formula in its docstring, written out in float64.

Each runs compiled and as plain Python; ``NUMBA_DISABLE_JIT=1 pytest tests/focusing/test_kernels.py`` runs all of them
and all that they call as plain Python.
"""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import noise

from mirrorfold.common import phasor
from mirrorfold.focusing.exact import direct_sum, range_tables
from mirrorfold.focusing.exact import kernels as exact_kernels
from mirrorfold.focusing.lines import interpolation, nodes
from mirrorfold.focusing.lines import kernels as line_kernels
from mirrorfold.focusing.scans import gridding, range_profiles

pytestmark = pytest.mark.nojit

SINGLE = {"rtol": 2e-6, "atol": 2e-6}
"""What a few operations in single precision leave of numbers of order one."""


def uniform(rng, *shape):
    return rng.uniform(-1.0, 1.0, shape)


def single(rng, *shape):
    return uniform(rng, *shape).astype(np.float32)


def test_unit_phasor(run, rng):
    turns = rng.uniform(-1e4, 1e4, 1000)
    found = np.array([complex(*run(phasor.unit_phasor, each)) for each in turns])
    error = np.abs(found - np.exp(2j * np.pi * (turns - np.round(turns))))
    assert np.sqrt(np.mean(error**2)) < 1.6e-7
    assert error.max() < 8.5e-7


def test_unfold_spectrum(run):
    data, weight, spectrum = noise((7, 3)), noise((4, 7), 1), noise((3, 4, 16), 2)
    run(range_tables.unfold_spectrum, data, weight, spectrum)
    wanted = np.zeros((3, 4, 16), complex)
    for m in range(7):
        wanted[:, :, (m - 3) % 16] = data[m, :, None] * weight[None, :, m]
    np.testing.assert_allclose(spectrum, wanted, **SINGLE)


def test_lay_out(run):
    profile, table = noise((3, 4, 5)), np.empty((3, 12, 4), np.complex64)
    run(range_tables.interleave_coefficients, profile, table)
    np.testing.assert_array_equal(table, np.moveaxis(profile, 1, 2)[:, np.arange(12) % 5])


def test_tile_tables(run, rng):
    x, y, z = uniform(rng, 6), 2.0 + uniform(rng, 6), uniform(rng, 6)
    element, reference = 0.1 * uniform(rng, 3, 3), uniform(rng, 3)
    delay, re, im = (np.empty((3, 6), np.float32) for _ in range(3))
    run(exact_kernels.tile_tables, x, y, z, element, 5.0, 300.0, reference, delay, re, im)
    r = np.linalg.norm(np.stack([x, y, z], axis=-1) - element[:, None], axis=-1)
    np.testing.assert_allclose(delay, 5.0 * r - reference[:, None], rtol=1e-6)
    np.testing.assert_allclose(re + 1j * im, np.exp(300j * r), atol=1e-6)


def cubic(table, position):
    """The tabulated polynomial at positions [cells]: sum_q table[cell, q] u^q."""
    cell = np.floor(position).astype(int)
    u = 2.0 * (position - cell) - 1.0
    return sum(table[cell, q].astype(complex) * u**q for q in range(4))


def test_sum_pairs(run, rng):
    table, first, offset = noise((3, 30, 4)), np.array([2, 0, 5]), rng.uniform(0.0, 4.0, 3).astype(np.float32)
    tx_delay, rx_delay = (rng.uniform(0.0, 5.0, shape).astype(np.float32) for shape in (6, (3, 6)))
    rx_re, rx_im, sum_re, sum_im = single(rng, 3, 6), single(rng, 3, 6), single(rng, 6), single(rng, 6)
    wanted = sum_re + 1j * sum_im
    for k in range(3):
        value = cubic(table[k], first[k] + (tx_delay + rx_delay[k] + offset[k]).astype(float))
        wanted = wanted + (rx_re[k] + 1j * rx_im[k]) * value
    flat = table.view(np.float32).reshape(3, -1)
    run(exact_kernels.sum_pairs, flat, first, offset, tx_delay, rx_delay, rx_re, rx_im, sum_re, sum_im)
    np.testing.assert_allclose(sum_re + 1j * sum_im, wanted, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("folded", [False, True])
def test_sum_transmitters(run, rng, folded):
    cells, margin, elements, pixels = 20, 6, 4, 5
    reference, delay = rng.uniform(0.0, 40.0, elements), single(rng, elements, pixels)
    re, im = single(rng, elements, pixels), single(rng, elements, pixels)
    pairs = [(i, k) for i in range(1, elements) for k in range(i if folded else 0, elements)]
    start = np.array([0, *np.cumsum([sum(i == n for i, _ in pairs) for n in range(1, elements)])[:-1]])
    profile = noise((len(pairs), cells, 4))
    table = profile[:, np.arange(cells + 2 * margin) % cells].copy()
    out = np.zeros(pixels, np.complex64)
    antennas = (reference, delay, re, im)
    flat = table.view(np.float32).reshape(len(pairs), -1)
    run(exact_kernels.sum_transmitters, flat, start, np.arange(1, elements), folded, cells, margin, *antennas,
        *antennas, out)  # fmt: skip
    wanted = np.zeros(pixels, complex)
    for n, (i, k) in enumerate(pairs):
        path = reference[i] + delay[i] + reference[k] + delay[k]
        wanted += (re[i] + 1j * im[i]) * (re[k] + 1j * im[k]) * cubic(profile[n], path % cells)
    np.testing.assert_allclose(out, wanted, rtol=1e-4, atol=1e-4)


def test_sum_frequency(run, rng):
    data, tx, rx = noise((3, 4)), *(uniform(rng, 6, n) + 1j * uniform(rng, 6, n) for n in (3, 4))
    out, parts = np.empty(6, complex), [np.ascontiguousarray(a) for a in (tx.real, tx.imag, rx.real, rx.imag)]
    run(direct_sum.sum_frequency, data, *parts, out)
    np.testing.assert_allclose(out, np.einsum("pi,ik,pk->p", tx, data.astype(complex), rx), rtol=1e-12)


def test_sum_positions(run, rng):
    data, weight, taper = noise((5, 4)), noise((4,), 1).astype(complex), noise((5,), 2).astype(complex)
    k, path = rng.uniform(100, 200, 5), rng.uniform(1, 2, 4)
    found = run(direct_sum.sum_positions, data, weight, taper, k, path)
    wanted = np.einsum("m,mi,i,mi->", taper, data.astype(complex), weight, np.exp(1j * np.outer(k, path)))
    assert found == pytest.approx(wanted, rel=1e-12)


def test_kernel_weights(run, rng):
    coefficients, fraction, weights = single(rng, 6, 5), rng.random(7).astype(np.float32), np.empty((6, 7), np.float32)
    run(interpolation.kernel_weights, coefficients, fraction, weights)
    powers = (2.0 * fraction.astype(float) - 1.0) ** np.arange(5)[:, None]
    np.testing.assert_allclose(weights, coefficients @ powers, **SINGLE)


@pytest.mark.parametrize("folded", [False, True])
def test_gather(run, folded):
    data, pair, partner, first = noise((3, 8)), np.array([1, 0, 4, 2]), np.array([5, 6, 3, 7]), np.array([0, 1, 4])
    out = np.empty(12, np.complex64)
    run(line_kernels.gather, data, pair, partner, folded, first, out)
    sums = data[:, pair] + folded * data[:, partner]
    np.testing.assert_allclose(out, np.concatenate([sums[:, :1].ravel(), sums[:, 1:].ravel()]), **SINGLE)


@pytest.mark.slow
def test_collapse(run, rng):
    first, frequencies = np.array([0, 1, 1, 4]), 3
    gathered, factor = single(rng, 2 * 4 * frequencies), single(rng, 8, 10)
    out = single(rng, 3, frequencies, 10)
    run(line_kernels.collapse, gathered, factor, first, frequencies, out)
    for n, (a, b) in enumerate(((0, 1), (1, 1), (1, 4))):
        block = gathered[2 * a * frequencies : 2 * b * frequencies].reshape(frequencies, 2 * (b - a)).astype(float)
        np.testing.assert_allclose(out[n], block @ factor[2 * a : 2 * b], **SINGLE)


def test_stretch(run, rng):
    spectrum, weight, out = single(rng, 2, 9, 6), single(rng, 2, 5, 4), np.empty((2, 5, 6), np.float32)
    cell = rng.integers(0, 9, (2, 5)).astype(np.int32)
    run(line_kernels.stretcher(4), spectrum, cell, weight, out)
    for m in range(2):
        taps = spectrum[m, (cell[m][:, None] + np.arange(4)) % 9]
        np.testing.assert_allclose(out[m], np.einsum("la,lan->ln", weight[m].astype(float), taps), **SINGLE)


def test_combine(run):
    profile, value, out = noise((7, 3, 5)), noise((3, 10, 5), 1), np.empty((3, 10), np.complex64)
    run(line_kernels.combine, profile, value, 4, out)
    rows = profile[(4 + np.arange(10)) % 7].astype(complex)
    np.testing.assert_allclose(out, np.einsum("ljq,jlq->lj", value, rows), rtol=1e-5, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("apart", [0.0, 0.07])
@pytest.mark.parametrize("taps", [2, 4, 6, 8, 10, 12])
def test_interpolate(run, rng, taps, apart, planar):
    x, y, z = np.linspace(-0.3, 0.3, 5), np.linspace(0.8, 1.0, 3), np.array([0.1] if planar else [0.0, 0.1])
    centre, per_range, per_direction = np.array([0.01, 0.0, 0.1 if planar else 0.02]), 20.0, 12.0
    frame = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0]] if planar else [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0]])
    foci = centre + apart * np.array([[-0.3, 0.2, 0.5], [1.0, -0.6, 0.2]])
    row_first, line_first, turns, curvature = 4, -20, 30.0, 1e-3
    rows = 3 * z.size
    polar, image = noise((45, 40)), np.full((rows, 5), 2.0 + 1.0j, np.complex64)
    range_taps, direction_taps = single(rng, taps, 5), single(rng, 4, 5)
    runs = np.array([[row, 1, 4] for row in range(rows)])
    pixels = x, y, z, centre, frame, foci, planar, per_range, row_first, per_direction, line_first, turns, curvature
    run(line_kernels.interpolator(taps), runs, pixels, polar, (range_taps, direction_taps), image)
    wanted = np.full((rows, 5), 2.0 + 1.0j)
    for row in range(rows):
        for p in range(1, 4):
            place = np.array([x[p], y[row % 3], z[row // 3]])
            r = 0.5 * sum(np.linalg.norm(place - focus) for focus in foci)
            along, ahead = frame @ (place - centre)
            u = along / np.linalg.norm(place - centre)
            w = np.arctan2(along, ahead) if planar else u
            a, b = r * per_range - row_first, w * per_direction - line_first
            weights = []
            for kernel, at in ((direction_taps, b), (range_taps, a)):
                weights.append(kernel.astype(float) @ (2.0 * (at - np.floor(at)) - 1.0) ** np.arange(5))
            lines = int(np.floor(b)) + 1 - 2 + np.arange(4)
            cells = int(np.floor(a)) + 1 - taps // 2 + np.arange(taps)
            value = weights[0] @ polar[np.ix_(lines, cells)].astype(complex) @ weights[1]
            wanted[row, p] += value * np.exp(2j * np.pi * turns * (r + curvature * (1.0 - u * u) / r))
    np.testing.assert_allclose(image, wanted, rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_pivoted_rows(run):
    rows = noise((12, 3)).astype(complex) @ noise((3, 9), 1).astype(complex)
    picked = run(nodes.pivoted_rows, rows.copy(), 1e-9, 12)
    assert picked.size == 3  # as many as the rank
    assert picked[0] == np.argmax(np.linalg.norm(rows, axis=1))
    basis = np.linalg.qr(rows[picked].T)[0]
    np.testing.assert_allclose(rows @ basis.conj() @ basis.T, rows, atol=1e-10)


@pytest.mark.slow
def test_rounding_does_not_pick_among_rows_as_long_as_each_other(run):
    rows = np.exp(2j * np.pi * uniform(np.random.default_rng(0), 40, 60))
    picked = run(nodes.pivoted_rows, rows.copy(), 1e-6, 40)
    for seed in range(1, 6):
        rounded = rows * (1.0 + 1e-15 * uniform(np.random.default_rng(seed), 40, 1))
        np.testing.assert_array_equal(run(nodes.pivoted_rows, rounded, 1e-6, 40), picked)


@pytest.mark.slow
def test_turn(run, rng):
    x, y, z, centres, turns = (
        uniform(rng, 6),
        1.0 + rng.random(6),
        0.2,
        0.1 * uniform(rng, 3, 3),
        40.0 * uniform(rng, 3),
    )
    re, im, total_re, total_im = (single(rng, 6) for _ in range(4))
    r = np.linalg.norm(np.stack([x, y, np.full(6, z)], axis=-1) - centres[:, None], axis=-1)
    wanted = total_re + 1j * total_im + (re + 1j * im) * np.exp(2j * np.pi * turns @ r)
    run(phasor.turn, re, im, x, y, z, centres, turns, total_re, total_im)
    np.testing.assert_allclose(total_re + 1j * total_im, wanted, **SINGLE)


def linear(profile, position):
    """Linear interpolation between samples at whole positions; zero where there is no sample on either side."""
    below = int(np.floor(position))
    if below < 0 or below + 1 >= len(profile):
        return 0.0
    return profile[below] + (position - below) * (profile[below + 1] - profile[below])


@pytest.mark.slow
def test_strongest(run, rng):
    profile, cosine, out = rng.random((3, 9)).astype(np.float32), np.array([0.9, 1.0, 0.8]), np.zeros(9, np.float32)
    run(gridding.strongest, profile, cosine, 0.5, 0.1, out)
    ground = 0.5 + 0.1 * np.arange(9)
    for k in range(8):
        heights = [linear(profile[e].astype(float), (ground[k] / cosine[e] - 0.5) / 0.1 + 1e-9) for e in range(3)]
        assert out[k] == pytest.approx(max(heights), rel=1e-5)


@pytest.mark.slow
def test_polar_to_plan(run, rng):
    polar, x, y = rng.random((4, 9)).astype(np.float32), np.linspace(-0.4, 0.4, 5), np.linspace(0.3, 1.6, 6)
    angle, out = rng.uniform(-1.0, 3.0, (6, 5)), np.zeros((6, 5), np.float32)
    run(gridding.polar_to_plan, polar, x, y, angle, 0.5, 0.1, out)
    for i in range(6):
        for j in range(5):
            at = (np.hypot(x[j], y[i]) - 0.5) / 0.1
            ranges = [linear(row.astype(float), at) for row in polar]
            assert out[i, j] == pytest.approx(linear(ranges, angle[i, j]), rel=1e-5, abs=1e-7)


def trilinear(volume, a, e, k):
    """Linear interpolation along each axis; zero outside."""
    return linear([linear([linear(profile.astype(float), k) for profile in plane], e) for plane in volume], a)


@pytest.mark.slow
def test_at_point(run, rng):
    volume = rng.random((3, 4, 5)).astype(np.float32)
    for place in rng.uniform(-0.5, 4.5, (100, 3)):
        assert run(range_profiles.at_point, volume, *place) == pytest.approx(trilinear(volume, *place), abs=1e-6)


@pytest.mark.slow
def test_grid_row(run, rng):
    volume, x, z = rng.random((4, 5, 9)).astype(np.float32), np.linspace(-0.5, 0.5, 7), np.linspace(-0.3, 0.3, 6)
    azimuth, elevation, out = np.array([-0.3, 0.2]), np.array([-0.2, 0.1]), np.zeros((7, 6), np.float32)
    run(gridding.grid_row, volume, 0, 4, x, 0.9, z, azimuth, elevation, 0.7, 0.06, out)
    for j in range(7):
        for i in range(6):
            flat = np.hypot(x[j], 0.9)
            a = (np.arctan2(x[j], 0.9) - azimuth[0]) / azimuth[1]
            e = (np.arctan2(z[i], flat) - elevation[0]) / elevation[1]
            wanted = trilinear(volume, a, e, (np.hypot(flat, z[i]) - 0.7) / 0.06)
            assert out[j, i] == pytest.approx(wanted, abs=1e-5)


def test_magnitude(run):
    values, out = noise((9,)), np.empty(9, np.float32)
    run(range_profiles.magnitude, values, out)
    np.testing.assert_allclose(out, np.abs(values.astype(complex)), **SINGLE)
