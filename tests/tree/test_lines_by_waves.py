"""Mirrors of the tree are moved onto the lines of their waves, and what they show with them."""

from __future__ import annotations

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.scenes.families import draw


def errors(family, seed):
    """Angles [degree] and offsets [mm] of the mirrors in line of sight, against the truth, (n, 2)."""
    scene = draw(family, seed)
    sweep = mf.simulate(scene, seed=seed)
    score = mf.score(mf.fold(mf.focus(sweep, tolerance=1e-3), sweep=sweep), scene)
    found = [mirror for mirror in score["mirrors"] if mirror["generation"] == 1]
    return np.array([[mirror["angle_error_deg"], mirror["offset_error_mm"]] for mirror in found])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2000, 2001])
def test_rough_walls_are_found_to_a_thousandth_of_a_cell(seed):
    """Range cells are 3 cm wide; centroids of power err by hundredths of a degree and tenths of a millimetre."""
    found = errors("one wall", seed)
    assert len(found) == 1
    assert (found < [0.01, 0.03]).all()


@pytest.mark.slow
def test_the_face_of_drywall_stays_before_what_scatters_inside():
    found = errors("drywall", 2000)
    assert len(found) == 2
    assert (found[:, 1] < 1.5).all()
