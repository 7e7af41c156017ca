"""The profile of a wall's face alone, against the sum over beam and window written out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import diffuse, radar_view

from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.fronts import LOBE, STEP, cell_across

pytestmark = pytest.mark.nojit

WALL = LineMirror(np.array([-0.6, 1.2]), np.array([0.7, 1.6]))
SPREAD = 0.006


def test_a_face_is_seen_as_wide_as_window_and_beam_make_it():
    view = radar_view(*diffuse(*WALL.ends, 0))
    places = WALL.ends[0] + np.array([[0.2], [0.55], [0.9]]) * (WALL.ends[1] - WALL.ends[0])
    offset = places - view.radar
    cosine = np.abs(offset @ WALL.normal) / np.linalg.norm(offset, axis=1)
    depth = SPREAD * STEP * np.arange(-round(LOBE / STEP), round(LOBE / STEP) + 1)
    aside = np.linspace(-2.5, 2.5, 161)
    expected = []
    for width, c in zip(view.cross_cell(places), cosine, strict=True):
        farther = width * aside * np.sqrt(1.0 - c**2) / c
        q = 2.0 * (depth[:, None] / c + farther) / view.range_cell + 1e-9
        power = (np.sinc(q) / (1.0 - q**2)) ** 2 @ view.beam_power(aside)
        expected.append(power / power.sum())
    assert_allclose(cell_across(WALL, view, places, SPREAD), np.mean(expected, axis=0), atol=1e-6)
