"""Planes of walls whose edges the scan sees: the errors that are told are those that are made."""

from __future__ import annotations

import numpy as np
import pytest
from scans import STEEL, content, panel, point_sweep

import mirrorfold as mf
from mirrorfold.common.geometry import unit
from mirrorfold.detection import find_echoes, find_mirrors, see
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.search.fit import flat
from mirrorfold.detection.search.planes import _Planes
from mirrorfold.scenes.floor_plan import parse_scene

NORMAL = unit(np.array([np.sin(np.radians(50.0)), -np.cos(np.radians(50.0)), 0.0]))
"""Normal of the wall, at 50 degrees from the line of sight: one edge is seen at 31 degrees, the other one at 62."""

NORMAL_ON_FLOOR = unit(np.array([-0.472, -0.877]))
"""Normal, in the floor plan, of a wall that stands on a floor."""

SIDES = np.array([[-NORMAL[1], NORMAL[0], 0.0], [0.0, 0.0, 1.0]])


def turns(seed):
    """By how much the plane of a wall at 77 GHz is turned about its two sides [degree], (2,); and its standard error.

    The beam is 5 to 6 cm wide, and the whole edge of the wall is in view.
    """
    wall = panel("wall", (0.0, 2.9, 0.0), NORMAL.tolist(), 2.4, 2.2, material="pec", diffuse_fraction=0.2)
    given = content(wall, half=22.0, beams=55, spot_radius=0.05, focus_distance=4.0)
    given["band"] = {"start": 76e9, "stop": 81e9, "points": 301}
    view = see(mf.focus(mf.simulate(parse_scene(given), bounces=0, seed=seed, snr_db=30.0)))
    (mirror,) = find_mirrors(view, find_echoes(view))
    return np.degrees(SIDES @ (mirror.normal - NORMAL)), mirror.angle_error


@pytest.mark.slow
def test_the_edges_of_a_wall_do_not_turn_its_plane():
    """Half of a footprint misses the wall at its edges, which turned the plane by six standard errors."""
    found = [turns(seed) for seed in range(5)]
    error = np.array([turn / told for turn, told in found])
    assert np.abs(error.mean(axis=0)).max() < 1.0
    assert 0.3 < np.sqrt(np.mean(error**2)) < 1.3


@pytest.mark.parametrize("lean", [-5.0, 4.0])
def test_a_wall_that_leans_over_a_floor_ends_where_the_floor_shows_it(lean):
    """Wall and image are one sheet with a kink, which is no bow."""
    tilt = np.radians(lean)
    normal = (*(np.cos(tilt) * NORMAL_ON_FLOOR), np.sin(tilt))
    wall = panel("wall", (0.0, 3.9, -0.13), normal, 1.5, 1.6, **STEEL)
    given = content(wall, panel("floor", (0.0, 2.9, -0.88), (0, 0, 1), 4.8, 4.2, **STEEL), half=16.0, beams=37)
    given["scanner"] |= {"elevation": {"start": -22.0, "stop": 8.0, "points": 33}, "spot_radius": 0.06}
    given["band"] = {"start": 77e9, "stop": 81e9, "points": 256}
    view = see(mf.focus(mf.simulate(parse_scene(given), seed=1, snr_db=20.0)))
    upright = [mirror for mirror in find_mirrors(view, find_echoes(view)) if abs(mirror.normal[2]) < 0.5]
    assert len(upright) == 1
    assert np.degrees(np.arccos(upright[0].normal @ normal)) < 0.5


def test_of_a_kinked_sheet_whose_longer_part_is_seen_edge_on_nothing_is_kept():
    """Few columns of beams show that part, too few for a sheet: a plane without any beams broke the search."""
    view = see(mf.focus(point_sweep((0.0, 1.5, 0.0), half=10.0, beams=41)))
    along, up = (place.ravel() for place in np.meshgrid(np.linspace(-0.2, 0.8, 101), np.linspace(-0.15, 0.15, 31)))
    points = np.column_stack([np.minimum(along, 0.0), 1.0 + np.maximum(along, 0.0), up])
    range_, beam, _ = view.locate(points)
    one = np.ones(len(points))
    search = _Planes(Echoes.found(points, range_, beam, one, one, 0.0 * one, 0.5, 1.0), view, 0.1, True)
    mirror, _ = search.patch(*flat(points, one), np.arange(len(points)))
    assert search.straight_part(mirror, np.arange(len(points))) is None
