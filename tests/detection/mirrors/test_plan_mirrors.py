"""What a radar sees of a known floor plan, and where: by image sources, for which the answer is known."""

from __future__ import annotations

import json

import numpy as np
import pytest
from synthetic import RANGE_CELL, diffuse, empty_view, radar_image, together

import mirrorfold as mf
from mirrorfold.common.arcs import circle_through, in_line
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.common.plans import FloorPlan
from mirrorfold.detection.mirrors.plan_mirrors import mirrors_of_plan

FRONT = np.array([[0.9, 0.9], [0.3, 1.9]])
HIDDEN = np.array([[-0.7, 1.0], [-0.7, 1.9]])


def image_of(wall, mirror):
    return reflect(wall, mirror[0], segment_normal(*mirror))


def test_a_wall_in_line_of_sight_is_its_own_mirror():
    found = mirrors_of_plan(FloorPlan((FRONT,)), empty_view())
    np.testing.assert_array_equal(found, [FRONT])
    np.testing.assert_array_equal(mirrors_of_plan(FloorPlan((FRONT[::-1],)), empty_view()), [FRONT[::-1]])


def test_a_wall_behind_another_shows_what_is_left_of_it():
    """The near wall hides the middle of the far one, which is seen to both sides of it."""
    near, far = np.array([[-0.2, 1.0], [0.2, 1.0]]), np.array([[-1.0, 2.0], [1.0, 2.0]])
    found = mirrors_of_plan(FloorPlan((near, far)), empty_view(), generations=1)
    assert len(found) == 3
    left, right = sorted((one for one in found if one[0, 1] > 1.5), key=lambda ends: ends[0, 0])
    np.testing.assert_allclose([left[0], right[1]], far)
    # Behind a wall of 0.4 m at half the range stand 0.8 m.
    np.testing.assert_allclose([left[1, 0], right[0, 0]], [-0.4, 0.4], atol=0.03)


def test_a_wall_around_the_corner_appears_behind_its_mirror():
    plan = FloorPlan((FRONT, HIDDEN))
    # A screen before the hidden wall, so that it is seen by way of the other alone.
    screen = np.array([[-0.25, 0.3], [-0.25, 0.75]])
    found = mirrors_of_plan(FloorPlan((*plan.lines, screen)), empty_view(reach=(0.3, 4.0)), generations=2)
    ghost = image_of(HIDDEN, FRONT)
    normal = segment_normal(*ghost)
    on_it = [one for one in found if np.abs((one - ghost[0]) @ normal).max() < 1e-9]
    assert len(on_it) == 1
    along = (on_it[0] - ghost[0]) @ (ghost[1] - ghost[0]) / np.sum((ghost[1] - ghost[0]) ** 2)
    assert np.ptp(along) > 0.3
    assert along.min() > -1e-9
    assert along.max() < 1.0 + 1e-9
    # Lines of sight to both of its ends pass through the mirror.
    for end in on_it[0]:
        t = np.cross([*FRONT[0], 0.0], [*end, 0.0])[2] / np.cross([*end, 0.0], [*(FRONT[1] - FRONT[0]), 0.0])[2]
        assert -0.01 < t < 1.01


def test_images_of_a_file_are_taken_as_they_are():
    images = np.array([[[0.0, 1.0], [1.0, 1.0]]])
    np.testing.assert_array_equal(mirrors_of_plan(FloorPlan((FRONT,), images), empty_view()), images)


def test_walls_fold_an_image_as_well_as_mirrors_that_are_found(tmp_path):
    body, amplitude = diffuse([-0.4, 1.2], [-0.3, 1.25], seed=2, strength=3.0)
    scatterers = together(diffuse(*FRONT, seed=1), (image_of(body, FRONT), amplitude))
    image = radar_image(*scatterers, np.arange(-0.7, 1.7, 0.02), np.arange(0.3, 2.7, 0.02))
    path = tmp_path / "plan.geojson"
    path.write_text(f'{{"type": "LineString", "coordinates": {FRONT.tolist()}}}')
    folded = mf.fold(image, mirrors=path)
    objects = folded["objects"].to_dataset(inherit=False)
    hidden = objects["bounces"].values > 0
    assert hidden.sum() >= 5
    place = np.median(objects["x"].values[hidden]), np.median(objects["y"].values[hidden])
    np.testing.assert_allclose(place, [-0.35, 1.225], atol=0.03)


PILLAR = np.array([0.3, 1.6]), 0.3


def circle(count=49, turn=0.0):
    """The outline of the pillar, a closed polyline."""
    angle = turn + np.linspace(0.0, 2.0 * np.pi, count)
    return PILLAR[0] + PILLAR[1] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
def test_of_a_pillar_the_radar_sees_the_near_side_as_arcs(turn):
    """Its pieces were flat mirrors, each too short for more than one or two lines of sight."""
    view = empty_view()
    found = mirrors_of_plan(FloorPlan((circle(turn=turn),)), view)
    assert found.shape[1:] == (3, 2)
    center, radius = circle_through(*np.moveaxis(found, 1, 0))
    np.testing.assert_allclose(center, [PILLAR[0]] * len(found), atol=1e-9)
    np.testing.assert_allclose(radius, PILLAR[1], atol=1e-9)
    distance = np.linalg.norm(PILLAR[0])
    assert np.linalg.norm(found, axis=-1).max() <= np.sqrt(distance**2 - PILLAR[1] ** 2)  # where rays touch it
    u = np.sort(view.to_polar(found[:, [0, -1]].reshape(-1, 2))[1])
    middle, half = np.arctan2(*PILLAR[0]), np.arcsin(PILLAR[1] / distance)
    np.testing.assert_allclose(u[[0, -1]], np.sin([middle - half, middle + half]), atol=view.du)


def test_a_pillar_around_the_corner_appears_behind_its_mirror():
    hidden = circle() - [0.9, 0.0]
    screen = np.array([[-0.45, 0.9], [-0.2, 0.9]])
    found = mirrors_of_plan(FloorPlan((FRONT, hidden, screen)), empty_view(), generations=2)
    bent = [one for one in found if not in_line(*one)]
    center, radius = circle_through(*np.moveaxis(np.array(bent), 1, 0))
    np.testing.assert_allclose(radius, PILLAR[1], atol=1e-9)
    expected = image_of(PILLAR[0] - [0.9, 0.0], FRONT)
    assert min(np.linalg.norm(center - expected, axis=1)) < 1e-9


def test_the_inner_face_of_a_bay_is_seen_through_its_opening():
    bay = circle()[4:21]  # its upper side, of which the radar sees the far one
    (found,) = mirrors_of_plan(FloorPlan((bay,)), empty_view())
    assert np.linalg.norm(found, axis=-1).min() > np.linalg.norm(PILLAR[0])


def test_a_pillar_of_a_plan_folds_as_the_arc_that_it_is(tmp_path):
    """As flat pieces, what it shows was folded half a metre off."""
    face = circle()[[24, 30, 36, 40, 44]]
    shown, amplitude = diffuse([0.45, 1.95], [0.55, 1.9], seed=3)
    scatterers = np.concatenate([face, shown]), np.concatenate([np.ones(len(face)), amplitude])
    image = radar_image(*scatterers, np.linspace(-0.4, 1.2, 161), np.linspace(0.8, 2.4, 161))
    path = tmp_path / "plan.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [circle().tolist()]}))
    arc = circle(3600)[[1500, 2500, 3500]]
    np.testing.assert_allclose(
        *(hidden_in(mf.fold(image, mirrors=mirrors)) for mirrors in (path, [arc.tolist()])), atol=0.2 * RANGE_CELL
    )


def hidden_in(reconstruction):
    """Places (n, 2) [m] of the echoes that a mirror shows, from left to right."""
    points = reconstruction.children["objects"].to_dataset(inherit=False).to_dataframe()
    points = points[(points["bounces"] > 0) & ~points["interpolated"]]
    assert len(points) > 3
    return points[["x", "y"]].sort_values("x").to_numpy()


def test_a_plan_has_no_heights(tmp_path, folded_scan):
    from mirrorfold.detection.views.volume_view import VolumeView

    view = object.__new__(VolumeView)
    with pytest.raises(mf.InputError, match="no heights"):
        mirrors_of_plan(FloorPlan((FRONT,)), view)
