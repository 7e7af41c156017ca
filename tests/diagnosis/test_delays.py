"""A delay that is left in a sweep is told by the curvature of the waves; speckle does not feign one."""

from __future__ import annotations

import numpy as np
import pytest
from point_sweeps import sweep_of
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis import diagnose
from mirrorfold.diagnosis.midpoints import midpoint_coherence
from mirrorfold.diagnosis.wavefronts import wavefronts
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.sweep.pairs import pairs_of

pytestmark = pytest.mark.slow

WALLS = (([-0.2, 0.3], [0.2, 0.34]), ([-0.3, 0.5], [0.2, 0.8]))


def rough_wall(wall, elements, points, seed):
    """A sweep of one diffuse wall by a short array, correct."""
    start, end = WALLS[wall]
    roughness = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
    surface = {"name": "wall", "kind": "segment", "start": start, "end": end, "roughness": roughness}
    array = {"kind": "linear", "elements": elements, "pitch": 0.5e-3}
    band = {"start": 290e9, "stop": 300e9, "points": points}
    scene = parse_scene({"name": "one wall", "array": array, "band": band, "surface": [surface]})
    return mf.simulate(scene, seed=seed, snr_db=30.0)


def cables(sweep):
    """Lengths of the cables that are said to be left in a sweep [m]."""
    return [float(one.remedy.split()[-1]) for one in diagnose(sweep)[0] if one.name == "range-offset"]


@pytest.mark.parametrize("wall", range(len(WALLS)))
@pytest.mark.parametrize("points", [41, 101])
def test_the_speckle_of_a_rough_wall_feigns_no_delay(wall, points):
    for elements in (9, 11, 13, 17, 25):
        for seed in range(3):
            assert cables(rough_wall(wall, elements, points, seed)) == []


@pytest.mark.parametrize("wall", range(len(WALLS)))
def test_two_centimetres_tell_a_delay_that_changes_the_curvature_enough(wall):
    sweep = mf.calibrate.remove_cable(rough_wall(wall, 41, 101, 0), -0.8)
    assert cables(sweep) == [pytest.approx(0.8, abs=0.1)]


@pytest.mark.parametrize("seed", range(4))
def test_echoes_that_have_wrapped_around_twice_feign_no_cable(seed):
    """The ambiguous range is 0.48 m, and two points stand 0.9 to 1.6 m away."""
    random = np.random.default_rng(seed)
    points = np.stack([random.uniform(-0.2, 0.2, 2), random.uniform(0.9, 1.6, 2), np.zeros(2)], axis=1)
    assert cables(mf.add_noise(sweep_of(points, elements=33, frequencies=33), snr_db=30.0, seed=seed)) == []


def speckle(distance):
    """Many points at one distance, of random amplitudes and phases, within 20 degrees of broadside."""
    random = np.random.default_rng(0)
    place = np.outer(0.5e-3 * (np.arange(41) - 20.0), [1.0, 0.0, 0.0])
    frequency = np.linspace(290e9, 300e9, 101)
    angle = np.radians(random.uniform(-20.0, 20.0, 40))
    points = distance * np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    wavenumber = 2.0 * np.pi / speed_of_light * frequency
    ways = np.exp(-1j * wavenumber[:, None, None] * np.linalg.norm(place[:, None] - points, axis=2))
    echoes = random.standard_normal((40, 2)).view(complex)[:, 0]
    s = np.einsum("fip,p,fkp->fik", ways, echoes, ways, optimize=True)
    return mf.make_sweep(s, frequency=frequency, tx_position=place, rx_position=place)


@pytest.mark.parametrize("distance", [0.3, 0.45, 0.7])
def test_pairs_of_the_same_midpoint_tell_the_distance_whatever_the_speckle(distance):
    pairs = pairs_of(speckle(distance))
    waves = wavefronts(pairs, exchange=False)
    expanding = waves.one_sign(contracting=False)
    measured = midpoint_coherence(pairs, waves, contracting=False, reversed_=False)
    gate = int(np.argmin(np.abs(waves.range - distance)))
    coherence = measured.coherence[gate]
    at = np.interp(1.0 / distance, expanding, coherence)
    assert at > 0.95
    # All directions together are far from in phase.
    together = waves.coherence[0, 0, gate].max()
    assert together < 0.7
    # A wrong curvature takes what its phase over the array takes; waves from the side have 12 % less of that phase.
    wrong = measured.lost(expanding - 1.0 / distance)[gate]
    np.testing.assert_allclose(1.0 - coherence / at, wrong, atol=0.12 * wrong.max())
    assert wrong[-1] > 0.1


DRIFT = 1.0
"""Phase by which the analyser drifts during a scan, rising from pair to pair [rad]."""


def faults(sweep):
    """Sweeps with a fault that is no delay, and bends waves a little."""
    pairs = sweep["s"].shape[1:]
    turn = np.exp(1j * np.linspace(0.0, DRIFT, np.prod(pairs))).reshape(pairs)
    yield "drift", sweep.assign(s=sweep["s"].copy(data=(sweep["s"].values * turn).astype(np.complex64)))
    aside = sweep["rx_position"] + np.array([5e-3, 0.0, 0.0])
    yield "receivers 5 mm aside", sweep.assign_coords(rx_position=aside)
    wide = {name: 2.0 * sweep[name] for name in ("tx_position", "rx_position")}
    yield "twice the pitch", sweep.assign_coords(wide)
    frequency = sweep["frequency"]
    yield "twice the step", sweep.assign_coords(frequency=2.0 * frequency - frequency[0])


POINTS = np.array([[-0.2, 0.6], [0.05, 0.75], [0.3, 0.9], [-0.3, 1.1], [0.1, 1.3], [-0.05, 1.45]])


def points_ahead(tx, rx, points=POINTS):
    """A sweep of some points, correct, with noise."""
    frequency = np.linspace(215e9, 230e9, 301)
    wavenumber = 2.0 * np.pi / speed_of_light * frequency[:, None, None]
    out, back = (np.exp(-1j * wavenumber * np.hypot(*(p[:, None, :2] - points).T).T) for p in (tx, rx))
    s = np.einsum("fip,fkp->fik", out, back)
    s += 0.05 * np.random.default_rng(0).standard_normal((*s.shape, 2)).view(complex)[..., 0]
    return mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx)


PLACE = np.outer(0.65e-3 * (np.arange(41) - 20.0), [1.0, 0.0, 0.0])
"""Of antennas in a row [m]."""


def test_other_faults_are_not_taken_for_cables():
    sweep = points_ahead(PLACE, PLACE)
    assert cables(sweep) == []
    assert cables(mf.calibrate.remove_cable(sweep, -1.5)) == [pytest.approx(1.5, abs=0.1)]
    assert {name: cables(wrong) for name, wrong in faults(sweep)} == {name: [] for name, _ in faults(sweep)}


@pytest.mark.parametrize("seed", range(4))
def test_a_halved_pitch_is_named_and_is_not_taken_for_a_cable(seed):
    """Waves seem four times as near as they are, at all ranges; a cable takes the same length off all of them."""
    random = np.random.default_rng(seed)
    points = random.uniform([-0.3, 0.8], [0.3, 2.4], (8, 2))
    sweep = points_ahead(PLACE, PLACE + np.array([0.0, 0.0, 0.015 * (seed % 2)]), points)
    half = {name: 0.5 * sweep[name] for name in ("tx_position", "rx_position")}
    assert [one.name for one in diagnose(sweep)[0]] == []
    assert [one.name for one in diagnose(sweep.assign_coords(half))[0]] == ["pitch-halved"]
    assert cables(mf.calibrate.remove_cable(sweep, -1.5)) == [pytest.approx(1.5, abs=0.1)]


@pytest.mark.parametrize("cable", [3.8, 4.5, 4.95])
def test_a_cable_of_most_of_the_ambiguous_path_is_no_other_mistake(cable):
    """The ambiguous path is 6.0 m. Zeros before the echoes of a measurement over time are such a delay, too."""
    sweep = mf.calibrate.remove_cable(points_ahead(PLACE, PLACE), -cable)
    assert [one.name for one in diagnose(sweep)[0]] == ["range-offset"]
    assert cables(sweep) == [pytest.approx(cable, abs=0.1)]


def test_the_length_of_a_cable_is_told_within_its_error():
    """The error is half the width that holds 80 % of the draws: 0.78 of it is one standard deviation."""
    misses = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        points = random.uniform([-0.4, 0.3], [0.4, 1.0], (6, 2))
        wall = np.linspace([-0.5, 0.8], [0.4, 1.1], 150) + random.normal(0.0, 1e-3, (150, 2))
        sweep = points_ahead(PLACE, PLACE + np.array([0.0, 0.0, 0.015]), np.concatenate([points, wall]))
        length = random.uniform(0.6, 1.2)
        found, _ = diagnose(mf.calibrate.remove_cable(sweep, -length))
        assert [one.name for one in found] == ["range-offset"]
        error = 2.0 * float(found[0].what.partition("+-")[2].split()[0])
        misses.append((float(found[0].remedy.split()[-1]) - length) / error)
    assert np.sqrt(np.mean(np.square(misses))) < 1.0


def test_a_nearer_wave_from_the_side_is_not_taken_for_one_from_ahead():
    """A wave from the direction u bends by 1 - u^2, so that only one direction of an echo tells how far it has come."""
    pairs = pairs_of(points_ahead(2.0 * PLACE, 2.0 * PLACE, np.array([[0.0, 0.7]])))
    waves = wavefronts(pairs, exchange=False)
    expanding = waves.one_sign(contracting=False)
    measured = midpoint_coherence(pairs, waves, contracting=False, reversed_=False)
    gate = int(np.argmin(np.abs(waves.range - 0.7)))
    assert np.interp(1.0 / 0.7, expanding, measured.coherence[gate]) > 0.95
    assert measured.coherence[gate][expanding > 3.0 / 0.7].max() < 0.5


def test_places_that_are_known_to_a_thirtieth_of_a_wavelength_tell_of_no_exchange():
    above = PLACE + np.array([0.0, 0.0, 0.015])
    sweep = points_ahead(PLACE, above)
    for seed in range(4):
        random = np.random.default_rng(seed)
        given = {name: sweep[name] + random.normal(0.0, 40e-6, (41, 3)) for name in ("tx_position", "rx_position")}
        found, judged = diagnose(sweep.assign_coords(given))
        assert ([one.name for one in found], judged["exchange"]) == ([], False)


def test_what_moves_alone_has_no_midpoint_twice_and_tells_no_delay():
    sweep = rough_wall(0, 41, 101, 0)
    assert cables(mf.calibrate.remove_cable(sweep.isel(tx=slice(20, 21)), -0.8)) == []
