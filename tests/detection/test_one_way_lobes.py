"""Side lobes of a synthetic aperture, which lie on circles about the ends of the part that sees an echo."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from moving_antenna import PATH, sweep_of_point
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.detection import image_echoes
from mirrorfold.detection.finding import find_echoes, see
from mirrorfold.tree.explaining.outshone import outshone

POINT = np.array([-0.42, 1.67])
GRID = {"x": np.arange(-1.6, 1.6, 0.01), "y": np.arange(0.4, 2.4, 0.01)}


def far_from(point, position, view):
    """Whether echoes are farther from the point than 1.5 cells."""
    return np.linalg.norm(position - point, axis=1) > 1.5 * view.cell_at(point)


def test_distances_from_a_place_along_the_array_are_those_in_space():
    view = see(mf.focus(sweep_of_point(POINT), **GRID))
    row, column, place = 40, 60, 0.2
    point = view.to_points(view.range[row], view.u[column])
    distance = view.distance_along(place)[row, column]
    assert distance == pytest.approx(np.linalg.norm(point - view.radar - place * view.along))
    # From the place, the amplitude of the point is found at this distance.
    amplitude = np.zeros_like(view.amplitude)
    amplitude[row, column] = 1.0
    seen = replace(view, amplitude=amplitude).from_along(place)
    found, at = np.nonzero(seen.amplitude)
    assert set(at) == {column}
    assert_allclose(seen.range[found], distance, atol=view.dr)


def test_each_place_along_an_array_is_less_than_a_range_cell_from_a_chosen_one():
    view = see(mf.focus(sweep_of_point(POINT), **GRID))
    assert_allclose(view.places_along[[0, -1]], [-0.5 * PATH, 0.5 * PATH], rtol=0.01)
    assert np.diff(view.places_along).max() <= 2.0 * view.range_cell
    assert replace(view, wavelength=np.inf).places_along.tolist() == [0.0]


def test_side_lobes_of_a_near_point_lie_below_their_bound_on_two_circles():
    view = see(mf.focus(sweep_of_point(POINT), **GRID))
    _, u = view.to_polar(POINT)
    aside = np.abs(view.u - u)
    beside = (aside > 3.0 * view.u_cell) & (aside < 0.8)
    circles = [np.linalg.norm(POINT - (end, 0.0)) for end in (-0.5 * PATH, 0.5 * PATH)]
    for circle, end in zip(circles, (-0.5 * PATH, 0.5 * PATH), strict=True):
        there = view.row((end * view.u + np.sqrt(circle**2 - end**2 * (1.0 - view.u**2)))[beside]), beside.nonzero()[0]
        envelope = view.amplitude.max() * 0.5 / (np.pi * view.aperture_tx * aside[beside])
        apart = np.abs(view.range[there[0]] - np.linalg.norm(POINT)) > view.range_cell
        assert apart.mean() > 0.2
        # Both the lobes and their bound are there.
        assert np.median(view.amplitude[there][apart] / envelope[apart]) == pytest.approx(1.0, rel=0.3)
        assert (view.side_lobes[there] * 2.0 > view.amplitude[there]).all()


def test_the_side_lobes_of_a_near_point_are_no_echoes():
    image = mf.focus(sweep_of_point(POINT), **GRID)
    echoes = find_echoes(see(image))
    assert len(echoes) > 0
    # Where u differs by more than one, antennas a quarter wavelength apart have higher lobes than a whole line.
    near = np.abs(echoes.position[:, 0]) < 0.7
    assert not far_from(POINT, echoes.position[near], see(image)).any()


@pytest.mark.parametrize("seen_below", [0.06, 0.12])
def test_the_ring_of_a_glint_that_part_of_the_path_sees_is_no_object(seen_below):
    view = see(mf.focus(sweep_of_point(POINT, seen_below=seen_below), **GRID))
    assert far_from(POINT, find_echoes(view).position, view).sum() < 5
    # What would pass the limit for all directions is told once the tree is known.
    with patch.object(image_echoes, "ring_floor", lambda view: np.zeros_like(view.amplitude)):
        echoes = find_echoes(view)
    ring = far_from(POINT, echoes.position, view)
    assert ring.sum() > 50
    # The ring consists of circles about both ends of the part of the path that sees the glint.
    ends = np.array([[-0.5 * PATH, 0.0], [seen_below, 0.0]])
    off = np.linalg.norm(echoes.position[:, None] - ends, axis=2) - np.linalg.norm(POINT - ends, axis=1)
    assert np.median(np.abs(off[ring]).min(axis=1)) < 0.2 * view.range_cell
    told = outshone(echoes, view)
    assert told[ring].mean() > 0.95
    assert not told[np.argmax(echoes.amplitude)]


def test_an_object_that_no_place_along_the_path_has_at_the_distance_of_the_glint_is_kept():
    """Farther from all of the path than the glint by more than a cell."""
    view = see(mf.focus(sweep_of_point(POINT), **GRID))
    echoes = find_echoes(view)
    lone = echoes.take(np.array([np.argmax(echoes.amplitude)]))
    place = np.array([0.3, 2.2])
    range_, u = view.to_polar(place)
    weak = replace(lone, position=place[None], range=np.array([range_]), direction=np.array([view.column(u)]),
                   amplitude=lone.amplitude * 1e-3)  # fmt: skip
    assert not outshone(weak, view).any()


def test_lobes_of_an_array_with_errors_are_no_echoes_and_a_wall_that_faces_it_is_one():
    """Errors of phase make lobes like noise, at the range of the glint in all directions."""
    sweep, rng = sweep_of_point(POINT), np.random.default_rng(0)
    turned = sweep.assign(s=sweep["s"] * np.exp(0.25j * rng.standard_normal(sweep.sizes["position"])).astype("c8"))
    view = see(mf.focus(turned, **GRID))
    with patch.object(image_echoes, "ring_floor", lambda view: np.zeros_like(view.amplitude)):
        assert far_from(POINT, find_echoes(view).position, view).sum() > 50
    assert not far_from(POINT, find_echoes(view).position, view).any()
    wall = np.abs(view.range[:, None] * np.sqrt(1.0 - view.u**2) - 1.0) < 0.5 * view.range_cell
    limit = image_echoes.ring_floor(replace(view, amplitude=np.where(wall, 1.0, 0.0).astype(np.float32)))
    assert limit.max() == 0.0


def test_what_fills_a_narrow_image_may_be_a_wall_and_sets_no_limit():
    """The same rows, in all directions alike, are lobes in a wide image."""
    least = []
    for x in (GRID["x"], np.arange(-0.3, 0.3, 0.01)):
        view = see(mf.focus(sweep_of_point((0.0, 1.0)), x=x, y=GRID["y"]))
        limit = image_echoes.ring_floor(replace(view, amplitude=np.ones_like(view.amplitude)))
        least.append(limit[view.row(0.9)].min())
    wide, narrow = least
    assert wide > 1.0
    assert narrow == 0.0
