"""The synthetic-aperture experiment in small: calibration is what makes the scene appear."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.scenes.arrays import Band
from mirrorfold.scenes.floor_plan import load_scene
from mirrorfold.scenes.surfaces import Circle

SPHERE, RADIUS = (0.03, 0.9), 0.02
CABLE = 1.7

PIXELS = {"x": np.arange(-1.0, 1.4, 3e-3), "y": np.arange(0.6, 3.2, 3e-3)}
"""Over the scene and its ghosts [m], in steps as by default; by default they would cover all ranges and angles."""


@pytest.fixture(scope="module")
def truth():
    return load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", "synthetic_aperture.toml"))))


def measured(scene, tx_delay, rx_delay, seed):
    """The sweep of an instrument with errors, at 20 dB SNR per sample."""
    sweep = mf.simulate(scene, seed=seed, bounces=2)
    k = 2 * np.pi * sweep["frequency"].values / speed_of_light
    turn = np.exp(-1j * k[:, None, None] * (tx_delay[:, None] + rx_delay + CABLE))
    wrong = sweep.assign(s=sweep["s"].copy(data=(sweep["s"].values * turn).astype(np.complex64)))
    return mf.add_noise(wrong, snr_db=20.0, seed=seed)


def test_the_scene_is_as_described(truth):
    assert truth.array.elements == truth.array.rx.elements == 81
    assert truth.band.frequency[[0, -1]].tolist() == [270e9, 300e9]
    assert truth.array.horn == pytest.approx(1.5e-3)
    assert not np.intersect1d(truth.array.tx_position[:, 0], truth.array.rx_position[:, 0]).size
    assert [surface.name for surface in truth.surface][2:] == ["carpet roll", "box 1", "box 2"]


@pytest.mark.slow
def test_a_sphere_calibrates_the_elements_through_their_horns(truth):
    random = np.random.default_rng(0)
    tx_delay, rx_delay = random.uniform(-2e-3, 2e-3, (2, 81))
    alone = replace(
        truth,
        surface=(Circle(name="sphere", center=SPHERE, radius=RADIUS),),
        band=Band(start=270e9, stop=300e9, points=201),
    )
    sphere = mf.calibrate.remove_cable(measured(alone, tx_delay, rx_delay, 0), CABLE)
    found = mf.calibrate.estimate_elements(sphere, at=SPHERE, radius=RADIUS)
    assert found.tx_valid.all()
    assert found.rx_valid.all()
    for delay, stated in ((found.tx_delay, tx_delay), (found.rx_delay, rx_delay)):
        error = delay - stated
        assert np.abs(error - error.mean()).max() < 20e-6
    assert abs(found.tx_delay.mean() + found.rx_delay.mean() - tx_delay.mean() - rx_delay.mean()) < 20e-6


@pytest.mark.replay
@pytest.mark.slow
def test_calibration_makes_the_hidden_things_appear(truth):
    random = np.random.default_rng(1)
    tx_delay, rx_delay = random.uniform(-2e-3, 2e-3, (2, 81))
    raw = mf.calibrate.remove_cable(measured(truth, tx_delay, rx_delay, 1), CABLE)
    alone = replace(truth, surface=(Circle(name="sphere", center=SPHERE, radius=RADIUS),))
    sphere = mf.calibrate.remove_cable(measured(alone, tx_delay, rx_delay, 2), CABLE)
    repaired = mf.calibrate.apply_elements(raw, mf.calibrate.estimate_elements(sphere, at=SPHERE, radius=RADIUS))
    # Short mirrors, for which a smeared image has candidates without end, are not sought before.
    before = mf.score(mf.fold(mf.focus(raw, **PIXELS, tolerance=1e-3), minimum_length=0.3), truth)
    after = mf.score(mf.reconstruct(repaired, **PIXELS), truth)
    assert (before["hidden"]["f_score_2cm"] or 0.0) < 0.3
    assert after["f_score_2cm"] > 0.8
    assert after["hidden"]["f_score_2cm"] > 0.6
    wall = next(mirror for mirror in after["mirrors"] if mirror["surface"] == "drywall")
    assert wall["angle_error_deg"] < 0.5
    assert wall["offset_error_mm"] < 3.5
