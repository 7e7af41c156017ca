"""Edge waves of the ray solver against full waves, and mirrors that end exactly where an antenna sees itself."""

from __future__ import annotations

import numpy as np
import pytest
from floor_plans import make_scene, segment

from mirrorfold.simulation import simulate

BAND = {"start": 28e9, "stop": 30e9, "points": 2}


@pytest.mark.filterwarnings("ignore:.*unambiguous")
@pytest.mark.parametrize(("degrees", "error"), [(0.0, 0.25), (45.0, 0.06), (60.0, 0.04), (80.0, 0.02)])
def test_the_end_of_a_wall_shines_as_in_full_waves_up_to_a_view_along_the_wall(degrees: float, error: float) -> None:
    along = np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    wall = segment((0.1, 0.4), tuple(np.array([0.1, 0.4]) + along))
    scenes = [make_scene(wall, elements=3, pitch=5e-3, band=BAND, polarization=one) for one in ("TE", "TM")]
    te, tm = (simulate(scene, solver="fullwave")["s"].values for scene in scenes)
    # Keller's wave of an end has a part of the shadow, which is the same for TE and TM and which rays leave out, and a
    # part of the reflection, which changes its sign.
    expected = 0.5 * (te - tm)
    found = simulate(scenes[0], bounces=1)["s"].values
    assert np.abs(found - expected).max() < error * np.abs(expected).max()


def test_the_end_of_a_wall_does_not_shine_more_the_more_exactly_an_antenna_looks_along_it() -> None:
    beside = [
        float(np.abs(simulate(make_scene(segment((x, 0.3), (x, 0.4)), elements=1, band=BAND))["s"]).max())
        for x in (1e-5, 1e-4, 1e-3, 1e-2)
    ]
    # Keller's wave of one end, 0.3 m away at 30 GHz; the two ends of the wall return less than two of them.
    assert max(beside) < 2.0 * np.sqrt(0.01) / (4.0 * np.pi * 0.3)


@pytest.mark.parametrize("elements", [1, 3])
def test_a_wall_that_ends_in_the_middle_of_the_view_returns_the_same_as_a_hair_to_the_side(elements: int) -> None:
    at, beside = (
        simulate(make_scene(segment((x, 0.3), (0.2, 0.3)), elements=elements, pitch=5e-3, band=BAND))["s"].values
        for x in (0.0, 1e-7)
    )
    np.testing.assert_allclose(at, beside, rtol=1e-4)


def test_a_wall_of_two_pieces_returns_what_it_returns_in_one() -> None:
    pieces = {"kind": "polyline", "points": [(-0.2, 0.3), (0.0, 0.3), (0.2, 0.3)]}
    parts = segment((-0.2, 0.3), (0.0, 0.3)), segment((0.0, 0.3), (0.2, 0.3))
    whole, bent, apart = (
        simulate(make_scene(*surfaces, elements=3, pitch=5e-3, band=BAND))["s"].values
        for surfaces in ([segment((-0.2, 0.3), (0.2, 0.3))], [pieces], parts)
    )
    np.testing.assert_allclose(bent, whole, rtol=1e-5)
    np.testing.assert_allclose(apart, whole, rtol=1e-5)
