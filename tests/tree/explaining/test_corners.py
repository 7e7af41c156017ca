"""Right-angled corners, told by the curvature of their waves; their legs are mirrors, and the legs' images are not."""

from __future__ import annotations

import numpy as np
import pytest
from echo_shapes import array, corner, face, point, sweep_of, view_of
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import diffuse, on_line, radar_view, together

import mirrorfold as mf
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.tree.explaining.corners import bright_places, row_crossings
from mirrorfold.tree.explaining.misplaced import are_corners
from mirrorfold.tree.explaining.waves import SweepWaves

RANGE, SINE = 0.6, -0.3


@pytest.mark.parametrize("shape", [point, face, corner])
def test_a_corner_is_told_from_a_point_and_a_face(shape):
    tx, rx = array(), array(0.02)
    view = view_of(tx, rx)
    sweep = sweep_of([shape(RANGE, SINE, tx, rx), point(RANGE + 0.1, 0.4, tx, rx)], tx, rx, noise=0.3)
    places = view.to_points(np.array([RANGE]), np.array([SINE]))
    assert_array_equal(are_corners(places, SweepWaves(sweep), view, {}), [shape is corner])
    assert are_corners(np.zeros((0, 2)), SweepWaves(sweep), view, {}).shape == (0,)


def test_one_transmitter_tells_no_corner():
    tx, rx = array()[56:57], array()
    view = view_of(tx, rx)
    sweep = sweep_of([corner(RANGE, SINE, tx, rx)], tx, rx)
    assert_array_equal(
        are_corners(view.to_points(np.array([RANGE]), np.array([SINE])), SweepWaves(sweep), view, {}), [False]
    )


def test_rows_that_cross_have_a_vertex():
    rows = [([-0.2, 1.0], [0.2, 1.4]), ([0.1, 1.1], [-0.1, 1.3]), ([0.3, 1.0], [0.3, 2.0]), ([0.15, 1.9], [0.35, 1.7])]
    crossed = row_crossings([LineMirror(np.array(start), np.array(end)) for start, end in rows])
    assert_allclose(crossed, [[0.0, 1.2], [0.3, 1.75]], atol=1e-12)
    assert row_crossings([]).shape == (0, 2)


@pytest.mark.parametrize(("db", "bright"), [(12.0, False), (22.0, True)])
def test_a_row_has_a_bright_place_where_a_vertex_may_be(db, bright):
    start, end = np.array([-0.2, 1.1]), np.array([0.15, 1.25])
    place = start + 0.4 * (end - start)
    rough = diffuse(start, end, 3)
    usual = radar_view(*rough)
    power = usual.power_at(*usual.to_polar(on_line(start, end)))
    row = LineMirror(start, end, strength=float(np.sqrt(np.median(power))))
    level = row.strength / radar_view(place[None], np.ones(1)).amplitude.max() * 10.0 ** (db / 20.0)
    view = radar_view(*together(rough, (place[None], [level])))
    found = bright_places([row], view)
    assert len(found) == bright
    assert_allclose(found, np.reshape([place] * bright, (-1, 2)), atol=0.02)


@pytest.mark.slow
def test_the_legs_of_a_corner_that_a_wall_shows_are_told_from_their_images():
    """The corner opens to the wall. Taken for mirrors as a whole, the rows of its cross would fold each other."""
    rough = {"rms_height": 0.1e-3, "correlation_length": 0.2e-3}
    wall = {"name": "wall", "kind": "segment", "start": [1.007, 0.797], "end": [0.659, 2.048]}
    open_corner = {"kind": "polyline", "points": [[0.072, 1.697], [-0.135, 1.65], [-0.088, 1.443]]}
    disc = {"name": "disc", "kind": "circle", "center": [-0.091, 0.931], "radius": 0.197}
    surfaces = [{**shape, "roughness": rough} for shape in (wall, {**open_corner, "name": "corner"}, disc)]
    scene = mf.Scene(
        name="an open corner",
        array={"kind": "linear", "elements": 161, "pitch": 0.5e-3},
        band={"start": 290e9, "stop": 300e9, "points": 201},
        surface=surfaces,
    )
    precision = []
    for seed in range(511, 514):
        sweep = mf.simulate(scene, seed=seed)
        found = mf.reconstruct(sweep)
        hidden = mf.score(found, scene).hidden
        assert hidden.completeness_cells > 0.9
        precision.append(hidden.precision_cells)
    assert np.mean(precision) > 0.9
