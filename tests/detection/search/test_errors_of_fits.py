"""Step 2, within the search: the standard errors of fitted lines are those that are made."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from mirrorfold.common.types import Array
from mirrorfold.detection.search.fit import robust

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
