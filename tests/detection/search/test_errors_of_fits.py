"""Step 2, within the search: the standard errors of fitted lines are those that are made."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from mirrorfold.common.types import Array
from mirrorfold.detection.search.fit import fit_covariance, robust

SAMPLES_A_CELL = 8


def row(cells: int, seed: int) -> Array:
    """Points along the x axis, (n, 2), which stray to the sides together within a cell, as speckle has it."""
    noise = np.random.default_rng(seed).standard_normal(cells * SAMPLES_A_CELL)
    beside = 0.05 * gaussian_filter1d(noise, 0.4 * SAMPLES_A_CELL)
    return np.column_stack([np.arange(noise.size) / SAMPLES_A_CELL, beside])


@pytest.mark.parametrize("cells", [12, 24, 48, 160])
def test_errors_over_standard_errors_have_a_mean_square_of_one(cells: int) -> None:
    """From few cells and from many, with weights that depend on the residuals."""
    found = []
    for seed in range(400):
        points = row(cells, seed)
        fit = robust(points, np.ones(len(points)), cells)
        normal = fit.normal * np.sign(fit.normal[1])
        offset, angle = (fit.center - [points[:, 0].mean(), 0.0]) @ normal, np.degrees(np.arcsin(normal[0]))
        found.append((offset / fit.offset_error, angle / fit.angle_error))
    assert np.sqrt(np.mean(np.square(found), axis=0)) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("scale", [1e-4, 1e3])
def test_errors_of_curves_do_not_depend_on_the_unit_of_length(scale: float) -> None:
    along, beside = row(48, 0).T
    covariance = [
        fit_covariance(
            np.column_stack([np.ones(along.size), unit * along, 0.5 * (unit * along) ** 2]),
            *(unit * beside, np.ones(along.size), unit * along[:, None], 48),
        )
        for unit in (1.0, scale)
    ]
    units = scale ** np.array([1.0, 0.0, -1.0])
    np.testing.assert_allclose(covariance[1] / np.outer(units, units), covariance[0], rtol=1e-6)
