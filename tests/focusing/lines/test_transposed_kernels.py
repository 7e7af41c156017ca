"""Every loop nest backwards is the transpose of the one forwards: <y, K x> = <K^H y, x> for any x and y.

As plain Python too: then indices are checked, which compiled loops do not do.
"""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import noise

from mirrorfold.focusing.exact import pair_sums
from mirrorfold.focusing.lines import kernels as line_kernels
from mirrorfold.focusing.lines import transposed_kernels

pytestmark = pytest.mark.nojit


def single(rng, *shape):
    return rng.uniform(-1.0, 1.0, shape).astype(np.float32)


def assert_transposed(y, forward, backward, x):
    """Sums in float64 of products that single precision has made."""
    left, right = np.vdot(y.astype(complex), forward), np.vdot(backward, x.astype(complex))
    assert abs(left - right) < 1e-5 * np.linalg.norm(y) * np.linalg.norm(forward)


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("apart", [0.0, 0.07])
@pytest.mark.parametrize("taps", [4, 8])
def test_spread_is_interpolate_transposed(run, rng, taps, apart, planar):
    x, y, z = np.linspace(-0.3, 0.3, 5), np.linspace(0.8, 1.0, 3), np.array([0.1] if planar else [0.0, 0.1])
    centre = np.array([0.01, 0.0, 0.1 if planar else 0.02])
    frame = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0]] if planar else [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0]])
    foci = centre + apart * np.array([[-0.3, 0.2, 0.5], [1.0, -0.6, 0.2]])
    rows = 3 * z.size
    runs = np.array([[row, 1, 4] for row in range(rows)])
    where = x, y, z, centre, frame, foci, planar, 20.0, 4, 12.0, -20, 30.0, 1e-3
    kernels = single(rng, taps, 5), single(rng, 4, 5)
    polar, pixels = noise((45, 40)), np.zeros((rows, 5), np.complex64)
    run(line_kernels.interpolator(taps), runs, where, polar, kernels, pixels)
    image, back = noise((rows, 5), 1), np.zeros((45, 40), np.complex64)
    image[0, 2] = 0.0  # as most pixels of a sparse image
    run(transposed_kernels.interpolate_transposed, runs, where, image, kernels, back)
    inside = np.zeros((rows, 5))
    inside[:, 1:4] = 1.0
    assert_transposed(image * inside, pixels, back, polar)


def test_share_out_is_combine_transposed(run):
    profile, value, polar = noise((7, 3, 5)), noise((3, 10, 5), 1), np.empty((3, 10), np.complex64)
    run(line_kernels.combine, profile, value, 4, polar)
    y, back = noise((3, 10), 2), np.zeros((7, 3, 5), np.complex64)
    run(transposed_kernels.combine_transposed, y, value, 4, back)
    assert_transposed(y, polar, back, profile)


def test_unstretch_is_stretch_transposed(run, rng):
    spectrum, weight, beams = single(rng, 2, 9, 6), single(rng, 2, 5, 4), np.empty((2, 5, 6), np.float32)
    cell = rng.integers(0, 9, (2, 5)).astype(np.int32)
    run(line_kernels.stretcher(4), spectrum, cell, weight, beams)
    y, back = single(rng, 2, 5, 6), np.zeros((2, 9, 6), np.float32)
    run(transposed_kernels.stretch_transposed, y, cell, weight, back)
    assert_transposed(y, beams, back, spectrum)


@pytest.mark.parametrize("folded", [False, True])
def test_hand_back_is_gather_transposed(run, folded):
    data, pair, partner, first = noise((3, 8)), np.array([1, 0, 4, 2]), np.array([5, 6, 3, 7]), np.array([0, 1, 4])
    out = np.empty(12, np.complex64)
    run(line_kernels.gather, data, pair, partner, folded, first, out)
    y, back = noise((12,), 1), np.zeros((3, 8), np.complex64)
    run(transposed_kernels.gather_transposed, y, pair, partner, folded, first, back)
    assert_transposed(y, out, back, data)


def test_expand_is_collapse_transposed(run, rng):
    first, frequencies = np.array([0, 1, 1, 4]), 3
    gathered, factor = single(rng, 2 * 4 * frequencies), single(rng, 8, 10)
    out = np.zeros((3, frequencies, 10), np.float32)
    run(line_kernels.collapse, gathered, factor, first, frequencies, out)
    y, back = single(rng, 3, frequencies, 10), np.zeros(24, np.float32)
    y[1] = 0.0  # a block without pairs
    run(transposed_kernels.collapse_transposed, y, factor, first, frequencies, back)
    assert_transposed(y, out, back, gathered)


def test_fill_phases(run, rng):
    path, out = rng.uniform(0.5, 2.0, (3, 7)), np.empty((3, 7), np.complex64)
    run(pair_sums.fill_phases, path, 300.0, out)
    np.testing.assert_allclose(out, np.exp(2j * np.pi * 300.0 * path), atol=3e-6)
