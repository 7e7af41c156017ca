"""Delays, gains and phase centres of elements: put into exact sweeps of a sphere, they must be found and removed."""

from __future__ import annotations

import json

import numpy as np
import pytest
from instruments import line
from point_sweeps import echoes, sweep_of, with_delays
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.reflectors import sphere_paths

MICROMETRE = 1e-6


def worst_error(found, tx_delay, rx_delay, good=slice(None)):
    """Largest error of the sums t + r over pairs of good transmitters [m]: nothing else can be observed."""
    found_sum = found.tx_delay[good, None] + found.rx_delay
    return np.abs(found_sum - (np.asarray(tx_delay)[good, None] + rx_delay)).max()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_element_delays_of_two_millimetres_are_recovered_to_20_micrometres(seed):
    """Random arrays, bands, spheres and places, at 20 dB SNR; echoes from elsewhere; broken transmitters."""
    random = np.random.default_rng(seed)
    n_tx, n_rx = random.integers(8, 60, 2)
    start = random.uniform(60e9, 290e9)
    frequency = np.linspace(start, start + random.choice([5e9, 10e9, 30e9]), int(random.choice([101, 201])))
    pitch = random.uniform(0.4e-3, 1.5e-3)
    tx = line(n_tx, pitch=pitch, centre=(-0.1, random.uniform(-0.02, 0.02), 0.0))
    rx = line(n_rx, pitch=pitch, centre=(0.1, 0.0, 0.0))
    centre, radius = (random.uniform(-0.4, 0.4), random.uniform(0.5, 2.0)), random.choice([0.0, 0.01, 0.025])
    tx_delay, rx_delay = random.uniform(-2e-3, 2e-3, n_tx), random.uniform(-2e-3, 2e-3, n_rx)
    k = 2 * np.pi * frequency / speed_of_light
    s = np.exp(-1j * k[:, None, None] * sphere_paths(tx, rx, centre, radius) + 2.1j)
    if seed % 3 == 1:
        away = [(centre[0] + random.uniform(-0.5, 0.5), centre[1] + random.uniform(0.2, 1.0)) for _ in range(4)]
        s += echoes(frequency, tx, rx, away, random.uniform(0.2, 1.0, 4))
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx)
    sweep = mf.add_noise(with_delays(sweep, tx_delay, rx_delay), snr_db=20.0, seed=seed)
    good = np.ones(n_tx, dtype=bool)
    if seed % 3 == 2:
        good[random.choice(n_tx, max(1, n_tx // 10), replace=False)] = False
        sweep["s"].values[:, ~good] = random.standard_normal((len(frequency), (~good).sum(), n_rx))
    found = mf.calibrate.estimate_elements(sweep, at=centre, radius=radius)
    np.testing.assert_array_equal(found.tx_valid, good)
    assert found.rx_valid.all()
    assert worst_error(found, tx_delay, rx_delay, good) < 20 * MICROMETRE
    assert np.mean(found.tx_delay[good]) == pytest.approx(np.mean(found.rx_delay), abs=1e-9)


@pytest.mark.parametrize("middle", [0.2, 0.5, 0.8])
def test_a_pulse_that_fills_a_part_of_the_band_tells_delays_by_its_own_carrier(middle):
    """Ultrasonic traces are often transformed up to the Nyquist frequency, far above the transducer's."""
    random = np.random.default_rng(0)
    speed, frequency = 6300.0, np.linspace(0.1e6, 25e6, 300)
    array = line(24, pitch=0.6e-3)
    delays = random.uniform(-0.25e-3, 0.25e-3, (2, 24))
    turn = -2j * np.pi * frequency[:, None, None] / speed
    s = np.exp(turn * (sphere_paths(array, array, (0.0, 0.02)) + delays[0][:, None] + delays[1]))
    s *= np.exp(-(((frequency - middle * 25e6) / 2e6) ** 2))[:, None, None]
    s += 0.02 * random.standard_normal((*s.shape, 2)).view(complex)[..., 0]
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=array, rx_position=array, wave_speed=speed)
    found = mf.calibrate.estimate_elements(sweep, at=(0.0, 0.02))
    error = found.tx_delay[:, None] + found.rx_delay - delays[0][:, None] - delays[1]
    assert np.abs(error - error.mean()).max() < 0.01 * speed / (middle * 25e6)


@pytest.mark.slow
def test_elements_with_phases_of_their_own_are_told_by_their_envelopes():
    random = np.random.default_rng(5)
    tx_delay, rx_delay = random.uniform(-2e-3, 2e-3, (2, 41))
    phases = np.exp(1j * random.uniform(0, 2 * np.pi, (2, 41)))
    clean = sweep_of([(0.1, 1.0)], elements=41, start=270e9, frequencies=401)
    sweep = mf.add_noise(with_delays(clean, tx_delay, rx_delay, *phases), snr_db=20.0, seed=1)
    found = mf.calibrate.estimate_elements(sweep, at=(0.1, 1.0))
    for delay, truth in ((found.tx_delay, tx_delay), (found.rx_delay, rx_delay)):
        error = delay - truth
        assert np.abs(error - error.mean()).max() < 20 * MICROMETRE
    repaired = mf.calibrate.apply_elements(sweep, found)
    ratio = repaired["s"].values / clean["s"].values
    assert abs(ratio.mean()) > 0.98 * np.sqrt(np.mean(np.abs(ratio) ** 2) - 0.01)


def test_a_calibration_from_a_sphere_repairs_another_scene(tmp_path):
    random = np.random.default_rng(2)
    tx_delay, rx_delay = random.uniform(-1e-3, 1e-3, (2, 15))
    sphere = mf.add_noise(with_delays(sweep_of([(0.0, 0.8)]), tx_delay, rx_delay), snr_db=20.0, seed=0)
    points = [(0.2, 1.0), (-0.1, 0.6)]
    scene = with_delays(sweep_of(points), tx_delay, rx_delay)
    path = mf.calibrate.save_elements(mf.calibrate.estimate_elements(sphere, at=(0.0, 0.8)), tmp_path / "array.json")
    repaired = mf.calibrate.apply_elements(scene, mf.calibrate.load_elements(path))
    ideal = sweep_of(points)["s"].values
    correlation = abs(np.vdot(repaired["s"].values, ideal)) / np.linalg.norm(repaired["s"]) / np.linalg.norm(ideal)
    assert correlation > 0.999
    assert "delays and gains of the elements removed" in repaired.attrs["processing"][-1]
    assert repaired.attrs["processing"][0] == "made"


@pytest.mark.parametrize("level", [1e-30, 1e25])
def test_delays_do_not_depend_on_the_level_of_the_samples(level):
    delays = np.random.default_rng(2).uniform(-1e-3, 1e-3, (2, 15))
    sphere = with_delays(sweep_of([(0.0, 0.8)]), *delays)
    sphere = sphere.assign(s=(sphere["s"].astype(complex) * level).astype(np.complex64))
    found = mf.calibrate.estimate_elements(sphere, at=(0.0, 0.8))
    assert np.abs(found.tx_delay[:, None] + found.rx_delay - delays[0][:, None] - delays[1]).max() < 1 * MICROMETRE


@pytest.mark.slow
def test_phase_centres_are_found_from_several_places():
    """An antenna that stands elsewhere than stated shows as a delay that depends on the direction."""
    random = np.random.default_rng(3)
    tx, rx = line(12, centre=(-0.05, 0, 0)), line(12, centre=(0.05, 0, 0))
    frequency = np.linspace(270e9, 300e9, 201)
    true_tx, true_rx = tx.copy(), rx.copy()
    true_tx[:, :2] += random.uniform(-0.3e-3, 0.3e-3, (12, 2))
    true_rx[:, :2] += random.uniform(-0.3e-3, 0.3e-3, (12, 2))
    places = [(-0.6, 0.7), (0.0, 1.0), (0.6, 0.7), (0.3, 1.2)]
    sweeps = [
        mf.add_noise(
            mf.make_sweep(
                echoes(frequency, true_tx, true_rx, [p]), frequency=frequency, tx_position=tx, rx_position=rx
            ),
            snr_db=20.0,
            seed=n,
        )
        for n, p in enumerate(places)
    ]
    found = mf.calibrate.estimate_elements(sweeps, at=places)
    # Along x the directions differ most. A common shift of all tx against all rx is a matter of the sharing.
    for offset, true, stated in ((found.tx_offset, true_tx, tx), (found.rx_offset, true_rx, rx)):
        error = offset[:, 0] - (true - stated)[:, 0]
        assert np.abs(error - error.mean()).max() < 20 * MICROMETRE
    repaired = mf.calibrate.apply_elements(sweeps[0], found)
    fresh = mf.calibrate.estimate_elements(repaired, at=places[0])
    assert np.abs(fresh.tx_delay[:, None] + fresh.rx_delay).max() < 20 * MICROMETRE


@pytest.mark.slow
def test_noise_is_not_taken_for_a_sphere():
    for seed in range(10):
        noise = mf.make_sweep(
            np.random.default_rng(seed).standard_normal((101, 15, 15, 2)).view(complex)[..., 0],
            frequency=np.linspace(290e9, 300e9, 101),
            tx_position=line(15),
            rx_position=line(15),
        )
        with pytest.raises(mf.InputError, match="not heard"):
            mf.calibrate.estimate_elements(noise, at=(0.0, 1.0))


def test_another_array_and_another_file_are_refused(tmp_path):
    calibration = mf.calibrate.estimate_elements(sweep_of([(0.0, 0.8)]), at=(0.0, 0.8))
    with pytest.raises(mf.InputError, match="same array"):
        mf.calibrate.apply_elements(sweep_of([(0.0, 0.8)], elements=9), calibration)
    with pytest.raises(mf.InputError, match="same array"):
        mf.calibrate.apply_elements(sweep_of([(0.0, 0.8)], shift=0.1), calibration)
    turned_around = sweep_of([(0.0, 0.8)], elements=9).isel(tx=slice(None, None, -1))
    calibration = mf.calibrate.estimate_elements(sweep_of([(0.0, 0.8)], elements=9), at=(0.0, 0.8))
    with pytest.raises(mf.InputError, match="tx position 0 of the sweep is that of another element"):
        mf.calibrate.apply_elements(turned_around, calibration)
    path = mf.calibrate.save_elements(calibration, tmp_path / "a.json")
    content = json.loads(path.read_text())
    for change in ({"tx_delay": [1.0]}, {"rx_gain": None}, {"tx_valid": "x"}, {"mirrorfold_kind": "sweep"}):
        path.write_text(json.dumps(content | change))
        with pytest.raises(mf.InputError, match="save-elements"):
            mf.calibrate.load_elements(path)
    path.write_text("[" * 100_000)
    with pytest.raises(mf.InputError, match="save-elements"):
        mf.calibrate.load_elements(path)
