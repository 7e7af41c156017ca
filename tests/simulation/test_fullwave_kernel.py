"""The fast Hankel function against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j0, y0

from mirrorfold.simulation.fullwave.kernel import NEAR, hankel

pytestmark = pytest.mark.nojit


def exact(x: np.ndarray) -> np.ndarray:
    return j0(x) - 1j * y0(x)


@pytest.mark.parametrize(
    "x",
    [
        np.geomspace(1e-6, 1e-2, 500),
        np.linspace(0.01, 1.5 * NEAR, 5001),
        np.linspace(NEAR, 60.0, 20001),
        np.geomspace(60.0, 1e5, 5001),
    ],
    ids=["tiny", "around the change of formula", "waves", "far"],
)
def test_relative_error(x):
    values = hankel(np.zeros((1, 2)), np.stack([x, np.zeros_like(x)], axis=1), 1.0)[0]
    assert values.dtype == np.complex64
    assert np.max(np.abs(values - exact(x)) / np.abs(exact(x))) < 1e-6


def test_matrix_of_random_points_at_300_ghz():
    rng = np.random.default_rng(0)
    targets, sources = rng.random((40, 2)), rng.random((70, 2))
    k = 2 * np.pi * 300e9 / 299792458.0
    reference = exact(k * np.linalg.norm(targets[:, None] - sources, axis=2))
    np.testing.assert_allclose(hankel(targets, sources, k), reference, rtol=1e-6)


def test_is_symmetric_and_depends_on_distances_alone():
    rng = np.random.default_rng(1)
    points = rng.random((30, 2))
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    off_diagonal = ~np.eye(30, dtype=bool)
    values = hankel(points, points, 500.0)
    np.testing.assert_array_equal(values, values.T)
    moved = hankel(points @ turn.T + 0.3, points @ turn.T + 0.3, 500.0)
    np.testing.assert_allclose(moved[off_diagonal], values[off_diagonal], rtol=1e-6)
    assert not np.isfinite(values[~off_diagonal]).any()
