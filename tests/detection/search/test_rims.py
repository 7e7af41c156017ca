"""Where a plane mirror ends in a scan with a wide beam, and things that are seen past its edge."""

from __future__ import annotations

import numpy as np
import pytest
from scans import ball, content, panel, pillar

import mirrorfold as mf
from mirrorfold.common.geometry import reflect, unit
from mirrorfold.detection import Echoes, find_echoes, find_mirrors, see
from mirrorfold.detection.views.volume_view import VolumeView
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.tree.lines_of_sight import ROOT, Cover, LinesOfSight

CENTER, ANGLE = np.array([0.0, 2.9, 0.0]), np.radians(50.0)
NORMAL, ALONG = np.array([[np.sin(ANGLE), -np.cos(ANGLE), 0.0], [np.cos(ANGLE), np.sin(ANGLE), 0.0]])
WIDTH, HEIGHT = 1.8, 1.5


@pytest.fixture(scope="module")
def world():
    """A wall at 77 GHz that is seen as a whole, a ball that it shows, and a pillar past its near edge.

    The beam is 6 cm wide on the wall, and 1.7 times as wide as the steps of the scan.
    """
    edge = CENTER - 0.5 * WIDTH * ALONG
    past = edge - 0.1 * ALONG + 0.5 * unit(edge)
    things = [
        panel("wall", CENTER, NORMAL.tolist(), WIDTH, HEIGHT, material="pec", diffuse_fraction=0.2),
        pillar((past[0], past[1]), 0.12, "past", material="pec", diffuse_fraction=1.0),
        ball("hidden", reflect(CENTER + np.array([0.0, 1.6, 0.0]), CENTER, NORMAL).tolist(), 0.15),
    ]
    given = content(*things, half=22.0, beams=67, spot_radius=0.06, focus_distance=3.0)
    given["band"] = {"start": 76e9, "stop": 81e9, "points": 301}
    return parse_scene(given)


@pytest.fixture(scope="module")
def volume(world):
    return mf.focus(mf.simulate(world, seed=1, snr_db=30.0))


@pytest.mark.slow
def test_a_mirror_ends_where_half_of_a_beam_falls_on_it(volume):
    """Sheets of echoes reach half a beam radius beyond the wall, a tenth of all of its beams."""
    view = see(volume)
    (mirror,) = find_mirrors(view, find_echoes(view))
    place = view.points(view.meets(NORMAL, CENTER), np.arange(len(view.sight))) - CENTER
    on_wall = (np.abs(place @ ALONG) < 0.5 * WIDTH) & (np.abs(place[:, 2]) < 0.5 * HEIGHT)
    count = np.count_nonzero(on_wall)
    assert np.count_nonzero(mirror.beams) == pytest.approx(count, rel=0.05)
    assert np.count_nonzero(mirror.beams & ~on_wall) < 0.05 * count


@pytest.mark.slow
def test_what_is_seen_past_the_edge_of_a_mirror_is_not_folded(world, volume):
    """A third of all that was folded was the pillar, which the scan sees itself."""
    result = mf.fold(volume)
    score = mf.score(result, world)
    assert score["hidden"]["false_fraction"] == 0.0
    assert score["hidden"]["completeness_cells"] == 1.0
    objects = result.children["objects"].dataset
    direct = (objects["bounces"] == 0) & (objects["surface"] == "object") & (objects["explanation"] == "")
    assert np.count_nonzero(direct) > 100


def test_echoes_within_a_beam_of_the_edge_of_a_mirror_are_undecided():
    """A mirror fills all beams to the left; echoes before it, and farther than a beam from its edge, are decided."""
    angle, range_ = np.linspace(-5.0, 5.0, 41), np.linspace(0.5, 5.0, 91)
    radius = 0.06  # about the focus, the beam is nearly as wide as in it
    amplitude = np.ones((angle.size, angle.size, range_.size), dtype=np.float32)
    view = VolumeView(
        amplitude, range_, angle, angle, np.ones(range_.size), "none", 0.0, np.zeros(3), 0.06, (radius, 3.0, 3.8e-3)
    )
    azimuth = np.repeat(angle, angle.size)
    crossing = np.where(azimuth < 0.0, 2.5, np.inf)[None]
    sight = LinesOfSight(view, (), crossing, np.array([ROOT]), Cover.nothing(azimuth.size))
    beam = np.arange(azimuth.size)
    last_inside = azimuth[azimuth < 0.0].max()
    for far, width in ((3.0, np.degrees(radius / 3.0)), (2.0, 0.0)):
        place = np.full(beam.size, far)
        echoes = Echoes.found(view.points(place, beam), place, beam, np.ones(beam.size), np.ones(beam.size),
                              np.zeros(beam.size), 0.5, 1.0)  # fmt: skip
        expected = (azimuth > -width) & (azimuth < last_inside + width)
        assert np.array_equal(sight.undecided(echoes), expected)
