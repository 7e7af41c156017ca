"""Families of full waves with a round pillar or a half-transparent wall: what is hidden, shown, and seen through it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mirrorfold.scenes.arrays import LinearArray
from mirrorfold.scenes.families import draw
from mirrorfold.scenes.families.parts import corner
from mirrorfold.scenes.families.wave_mirrors import FAMILIES, rounded
from mirrorfold.scenes.families.waves import HIDDEN, IN_SIGHT
from mirrorfold.scenes.surfaces import Curve
from mirrorfold.scenes.visibility import visible_truth
from mirrorfold.simulation.fullwave.contours import contours


@pytest.mark.parametrize("seed", [100, 101])
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_hidden_things_are_seen_in_the_mirror_and_others_through_it(family, seed):
    scene = draw(family, seed)
    places = scene.array.tx_position[:, :2]
    hidden = [surface for surface in scene.surface if surface.name.startswith(HIDDEN)]
    assert hidden
    for surface in hidden:
        points, normals, _ = surface.sample(0.002)
        assert visible_truth(scene, points, normals, bounces=1)[1].mean() > 0.1
        for place in places[[0, -1]]:  # no more than the sliver between two samples
            eye = replace(scene, array=LinearArray(elements=1, pitch=1.0, center=tuple(place)))
            assert visible_truth(eye, points, normals, bounces=0)[0].mean() < 0.05
    behind = [surface for surface in scene.surface if surface.name.startswith("behind")]
    assert bool(behind) == (scene.polarization == "both")
    for surface in behind:
        points, normals, _ = surface.sample(0.002)
        assert visible_truth(scene, points, normals, bounces=0)[0].mean() >= IN_SIGHT - 0.05


def test_only_the_pillar_shows_what_is_hidden():
    scene = draw("full-wave pillar", 100)
    hidden = [surface for surface in scene.surface if surface.name.startswith(HIDDEN)]
    assert hidden
    for surface in hidden:
        points, normals, _ = surface.sample(0.002)
        assert not visible_truth(scene, points, normals, bounces=2, curved=False)[1].any()


def test_both_polarizations_can_be_solved_and_the_pane_counts_by_its_unknowns():
    scene = draw("full-wave glass door", 100)
    assert not any("vertex" in arm.ends for arm in contours(scene, seed=0))
    door = next(surface for surface in scene.surface if getattr(surface, "thickness", None))
    assert 4e-3 <= door.thickness <= 10e-3
    wavelength = 299792458.0 / scene.band.stop
    length = np.hypot(door.end[0] - door.start[0], door.end[1] - door.start[1])
    assert 80.0 < length / wavelength < 180.0


def test_a_corner_is_rounded_between_its_legs():
    sharp = corner("target 1", (0.1, 1.0), 30.0, 0.2)
    curve = Curve(name="rounded", points=rounded(sharp)["points"])
    first, vertex, last = np.array(sharp["points"])
    place = np.concatenate(curve.pieces(0.001))
    np.testing.assert_allclose(place[[0, -1]], [first, last], atol=1e-12)
    # A fillet of radius r stays (sqrt(2) - 1) r off the vertex; elsewhere the curve lies on the legs.
    assert np.linalg.norm(place - vertex, axis=1).min() == pytest.approx((np.sqrt(2.0) - 1.0) * 0.02, rel=0.01)
    legs = [(leg - vertex) / np.linalg.norm(leg - vertex) for leg in (first, last)]
    off = np.min([np.abs((place - vertex) @ leg) for leg in legs], axis=0)
    away = np.linalg.norm(place - vertex, axis=1) > 0.03
    assert off[away].max() < 1e-4
    straight = corner("target 1", (0.1, 1.0), 30.0, 0.2) | {"kind": "segment"}
    assert rounded(straight) is straight
