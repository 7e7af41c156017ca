"""Antennas of an array: horns with a beam of the right width, the same both ways, and antennas that are missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.simulation.horns import point_sources

FREQUENCY = 300e9


def scene(horn=None, *, elements=5, pitch=0.5e-3, surface=(), rx_horn=None):
    array = {"elements": elements, "pitch": pitch}
    array |= {"horn": horn} if horn else {}
    if rx_horn:
        array["rx"] = {"elements": elements, "pitch": pitch, "horn": rx_horn, "center": [0.02, 0.0]}
    band = {"start": 0.9 * FREQUENCY, "stop": FREQUENCY, "points": 2}
    return parse_scene({"name": "horns", "array": array, "band": band, "surface": list(surface)})


def pattern(horn, pitch, angle, frequency=FREQUENCY):
    """Far-field amplitude of the middle horn against the angle off broadside [rad], from its sources."""
    seen, gather = point_sources(scene(horn, elements=1, pitch=pitch))
    x = seen.array.tx_position[:, 0]
    wave = np.exp(2j * np.pi * frequency / speed_of_light * np.sin(angle)[:, None] * x)
    return np.array([abs(gather(np.outer(one, one).astype(np.complex64)[None])[0, 0, 0]) ** 0.5 for one in wave])


@pytest.mark.parametrize(("horn", "pitch", "error"), [(1.5e-3, 0.5e-3, 0.09), (3e-3, 0.4e-3, 0.01), (2e-3, 1e-3, 0.09)])
def test_the_beam_is_that_of_a_cosine_aperture(horn, pitch, error):
    """``cos(X) / (1 - (2 X / pi)^2)`` with ``X = pi w sin(t) / lambda`` (Balanis, table 12.1).

    Two or three sources make a coarse aperture, seven or eight a fine one.
    """
    angle = np.radians(np.linspace(0.0, 60.0, 61))
    x = np.pi * horn * np.sin(angle) * FREQUENCY / speed_of_light
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.abs(np.where(np.isclose(x, np.pi / 2), np.pi / 4, np.cos(x) / (1.0 - (2.0 * x / np.pi) ** 2)))
    np.testing.assert_allclose(pattern(horn, pitch, angle), exact, atol=error)


def test_neighbouring_horns_share_their_sources():
    seen, _ = point_sources(scene(1.5e-3, elements=81))
    assert seen.array.elements == 83
    assert np.ptp(seen.array.tx_position[:, 0]) == pytest.approx(82 * 0.5e-3)


def test_what_stands_aside_is_dimmed_and_what_stands_ahead_is_not():
    rough = {"rms_height": 1e-4, "correlation_length": 2e-4}
    levels = []
    for x, y in ((0.0, 1.0), (0.8, 0.6)):
        disc = {"name": "disc", "kind": "circle", "center": [x, y], "radius": 0.05, "roughness": rough}
        dish, point = (mf.simulate(scene(horn, surface=[disc])) for horn in (1.5e-3, None))
        assert dish["s"].shape == point["s"].shape == (2, 5, 5)
        levels.append(np.linalg.norm(dish["s"]) / np.linalg.norm(point["s"]))
    assert levels[0] == pytest.approx(1.0, abs=0.01)
    angle = np.array([np.arctan2(0.8, 0.6)])
    aside = [float(pattern(1.5e-3, 0.5e-3, angle, scale * FREQUENCY)[0]) ** 2 for scale in (0.9, 1.0)]
    assert levels[1] == pytest.approx(np.sqrt(np.mean(np.square(aside))), rel=0.2)


def test_a_mirror_shows_the_beam_too():
    """A plane mirror at broadside returns the beam's middle, one aside what the beam has there, twice."""
    levels = []
    for angle in (0.0, np.radians(30.0)):
        middle = np.array([np.sin(angle), np.cos(angle)])
        along = np.array([np.cos(angle), -np.sin(angle)])
        ends = {"start": (middle - 2 * along).tolist(), "end": (middle + 2 * along).tolist()}
        mirror = {"name": "mirror", "kind": "segment", **ends}
        one, other = (
            mf.simulate(scene(horn, elements=1, surface=[mirror]))["s"].values[1, 0, 0] for horn in (2e-3, None)
        )
        levels.append(abs(one / other))
    assert levels[0] == pytest.approx(1.0, abs=0.01)
    assert levels[1] == pytest.approx(float(pattern(2e-3, 0.5e-3, np.array([np.radians(30.0)]))[0]) ** 2, abs=0.01)


def test_transmitters_and_receivers_may_have_different_horns():
    seen, gather = point_sources(scene(1.5e-3, rx_horn=3e-3, elements=4))
    receivers = seen.array.rx
    assert receivers is not None
    assert seen.array.elements == 6
    assert receivers.elements == 4 + 2 * 2
    assert gather(np.ones((2, 6, 8), np.complex64)).shape == (2, 4, 4)
    np.testing.assert_allclose(gather(np.ones((2, 6, 8), np.complex64)), 1.0, rtol=1e-5)


def test_the_sweep_knows_the_antennas_and_not_the_sources():
    rough = {"rms_height": 1e-4, "correlation_length": 2e-4}
    disc = {"name": "disc", "kind": "circle", "center": [0.0, 1.0], "radius": 0.05, "roughness": rough}
    stated = scene(1.5e-3, surface=[disc])
    np.testing.assert_allclose(mf.simulate(stated)["tx_position"], stated.array.tx_position)


WALL = [{"name": "wall", "kind": "segment", "start": [-0.1, 0.5], "end": [0.2, 0.6]}]


@pytest.mark.parametrize("horn", [None, 2e-3])
def test_a_missing_antenna_takes_nothing_from_the_others(horn):
    whole = scene(horn, surface=WALL)
    thinned = replace(whole, array=replace(whole.array, missing=(1, 3)))
    there = [0, 2, 4]
    assert np.array_equal(thinned.array.tx_position, whole.array.tx_position[there])
    every, some = (mf.simulate(one)["s"].values for one in (whole, thinned))
    assert_allclose(some, every[:, there][:, :, there], rtol=0, atol=1e-5 * np.abs(every).max())


@pytest.mark.parametrize(
    ("missing", "expected"),
    [([5], "missing names antenna 5, but they count from 0 to 4"), ([0, 1, 2, 3, 4], "leave one at least"),
     ([-1], "array.missing[0] is -1")],
)  # fmt: skip
def test_antennas_that_cannot_be_missing_are_refused(missing, expected):
    array = {"elements": 5, "pitch": 0.5e-3, "missing": missing}
    band = {"start": 290e9, "stop": 300e9, "points": 2}
    with pytest.raises(mf.InputError) as caught:
        parse_scene({"name": "thinned", "array": array, "band": band})
    assert expected in str(caught.value)


def test_the_pitch_of_a_single_horn_may_be_anything():
    np.testing.assert_allclose(pattern(3e-3, 1e-6, np.zeros(1)), 1.0, rtol=1e-5)
