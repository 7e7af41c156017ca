"""The line through a wall that scatters from inside is turned to the wall's face."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import diffuse, radar_view, together

from mirrorfold.common.geometry import unit
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.thick_walls import normal_by_speckle

START, END = np.array([-0.7, 1.3]), np.array([0.8, 1.2])


def turn_left(turn):
    """Angle [degree] between the wall's normal and what is found from a line that is turned by so many degrees."""
    inward = unit(np.array([[0.1, 1.5]]))[0]
    sheets = [diffuse(START + z * inward, END + z * inward, 20 + i) for i, z in enumerate(np.linspace(0.0, 0.02, 6))]
    view = radar_view(*together(*sheets), noise=1e-3)
    a = np.radians(turn)
    along = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ (0.5 * (END - START))
    middle = 0.5 * (START + END)
    normal = normal_by_speckle(LineMirror(middle - along, middle + along), view)
    return None if normal is None else np.degrees(np.arccos(min(1.0, abs(normal @ inward))))


@pytest.mark.parametrize("turn", [-0.4, 0.0, 0.5])
def test_a_line_that_speckle_has_turned_is_turned_back(turn):
    assert turn_left(turn) < 0.15


@pytest.mark.parametrize("turn", [-3.0, 3.0])
def test_a_line_that_is_farther_off_was_turned_by_something_else(turn):
    assert turn_left(turn) is None
