"""What may be a side lobe of a far brighter echo at the same range is no object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from partial_glint import GLINT, HALF, PART, glint_image
from synthetic import diffuse, radar_image, radar_view, together

import mirrorfold as mf
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.tree.explaining.outshone import OUTSHONE, OUTSHONE_DB, outshone

BRIGHT, SAME_RANGE, ELSEWHERE = np.array([0.3, 0.8]), np.array([-0.3, 0.8]), np.array([-0.3, 0.95])


@pytest.mark.parametrize(
    ("place", "below_db", "told"),
    [
        pytest.param(SAME_RANGE, OUTSHONE_DB + 3.0, True, id="weaker"),
        pytest.param(SAME_RANGE, OUTSHONE_DB - 3.0, False, id="not so much weaker"),
        pytest.param(ELSEWHERE, OUTSHONE_DB + 3.0, False, id="at another range"),
    ],
)
def test_only_what_is_far_weaker_than_another_at_its_range(place, below_db, told):
    level = 100.0 * 10.0 ** (-below_db / 20.0)
    view = radar_view(np.array([BRIGHT, place]), np.array([100.0, level]), noise=1e-4)
    echoes = find_ridges(view, threshold_db=-60.0)
    distance = np.linalg.norm(echoes.position - place, axis=1)
    its_peak = echoes.take(np.array([np.argmin(distance)]))
    assert distance.min() < view.cell_at(place)
    assert outshone(its_peak, view).tolist() == [told]
    assert outshone(its_peak.take(np.zeros(1, dtype=bool)), view).tolist() == []


def explained(below_db):
    """What explains a point that is weaker by that than a glint at its range, in an image with a wall beside."""
    wall = diffuse((0.1, 1.3), (0.9, 1.5), 3)
    points, amplitude = together(wall, (np.array([BRIGHT, SAME_RANGE]), [400.0, 400.0 * 10.0 ** (-below_db / 20.0)]))
    image = radar_image(points, amplitude, np.arange(-0.9, 1.2, 0.005), np.arange(0.2, 1.7, 0.005))
    objects = mf.fold(image)["objects"].to_dataset(inherit=False)
    distance = np.hypot(objects["x_initial"] - SAME_RANGE[0], objects["y_initial"] - SAME_RANGE[1]).values
    return set(objects["explanation"].values[distance < 0.02].tolist())


@pytest.mark.slow
@pytest.mark.parametrize(("below_db", "told"), [(24.0, {""}), (43.0, {OUTSHONE})])
def test_a_point_beside_a_glint_is_explained_by_it_if_it_is_far_weaker(below_db, told):
    assert explained(below_db) == told


@pytest.mark.slow
@pytest.mark.parametrize(("below", "count", "missed"), [(np.inf, 0, 0), (HALF, 500, 0), (PART, 520, 25)])
def test_a_glint_that_some_of_the_pairs_see_is_no_ring_of_objects(below, count, missed):
    """Of lobes that few pairs see, the ends and what stands beside them in range are told in part."""
    objects = mf.fold(glint_image(seen_below=below))["objects"].to_dataset(inherit=False)
    away = np.hypot(objects["x_initial"] - GLINT[0], objects["y_initial"] - GLINT[1]).values > 0.1
    assert np.count_nonzero(away) == pytest.approx(count, abs=150 if count else 0)
    told = (objects["explanation"].values == OUTSHONE)[away]
    assert np.count_nonzero(~told) <= missed
    doubted = (objects["confidence"].values < 0.5)[away]
    assert np.count_nonzero(~(told | doubted)) <= missed // 2
    assert "" in objects["explanation"].values[~away]


@pytest.mark.parametrize(("gap", "told"), [(False, True), (True, False)])
def test_lobes_grow_towards_their_glint_and_objects_end(gap, told):
    """A weak echo at the range of a glint is an object of its own if the image is dark between both."""
    view = radar_view(np.array([BRIGHT]), np.array([100.0]))
    range_, u = view.to_polar(BRIGHT)
    ring = view.part_lobes(100.0, view.u - u) * 0.9
    ring[np.abs(view.u - u + 0.15) < 2.0 * view.u_cell] *= 0.1 if gap else 1.0
    amplitude = np.maximum(view.amplitude, np.exp(-(((view.range - range_) / view.range_cell) ** 2))[:, None] * ring)
    view = replace(view, amplitude=amplitude)
    echoes = find_ridges(view, threshold_db=-60.0)
    beyond = echoes.take(np.abs(view.u[echoes.direction] - u + 0.25) < 0.05)
    assert len(beyond) > 0
    assert (outshone(beyond, view) == told).all()


@pytest.mark.parametrize(
    ("cells", "below_db", "told"),
    [
        pytest.param(30.0, 15.0, True, id="ring"),
        pytest.param(10.0, 15.0, False, id="short row"),
        pytest.param(30.0, 9.0, False, id="wall around the radar"),
    ],
)
def test_a_long_row_at_one_range_is_a_ring_if_it_is_weaker_than_a_glint_there(cells, below_db, told):
    """The image is dark between the row and the glint."""
    view = radar_view(np.array([BRIGHT]), np.array([100.0]))
    range_, u = view.to_polar(BRIGHT)
    middle = u - (0.5 * cells + 8.0) * view.u_cell
    level = view.amplitude.max() * 10.0 ** (-below_db / 20.0)
    ring = np.where(np.abs(view.u - middle) < 0.5 * cells * view.u_cell, level, 0.0)
    depth = np.exp(-(((view.range - range_) / view.range_cell) ** 2))[:, None]
    view = replace(view, amplitude=np.maximum(view.amplitude, depth * ring))
    echoes = find_ridges(view, threshold_db=-60.0)
    inside = np.abs(view.u[echoes.direction] - middle) < (0.5 * cells - 2.0) * view.u_cell
    row = echoes.take(inside & (np.abs(echoes.range - range_) < 0.1 * view.range_cell))
    assert len(row) > cells
    assert (outshone(row, view)[3:-3] == told).all()  # a row is told by both its sides
