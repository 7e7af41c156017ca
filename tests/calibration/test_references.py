"""What a second measurement takes away: the empty scene, the mean of a scan, the response to a corner or a plate."""

from __future__ import annotations

import numpy as np
import pytest
from instruments import line
from point_sweeps import sweep_of
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.reflectors import plate_paths, sphere_paths


def test_subtracting_the_empty_scene_leaves_the_target():
    walls, target = [(0.1, 0.5), (-0.2, 1.1)], [(0.0, 0.9)]
    left = mf.calibrate.subtract_background(sweep_of(walls + target), sweep_of(walls))
    np.testing.assert_allclose(left["s"], sweep_of(target)["s"], atol=1e-5)
    drifted = sweep_of(walls) * (1.1 * np.exp(0.3j))
    drifted.attrs = sweep_of(walls).attrs
    weak = sweep_of(walls + target, [1.0, 1.0, 0.01])
    left = mf.calibrate.subtract_background(weak, drifted.astype(np.complex64), match=True)
    assert np.linalg.norm(left["s"]) < 1.01 * np.linalg.norm(sweep_of(target, [0.01])["s"])


def test_a_background_of_another_band_or_array_is_refused():
    with pytest.raises(mf.InputError, match="frequency"):
        mf.calibrate.subtract_background(sweep_of([(0, 1)]), sweep_of([(0, 1)], start=280e9))
    with pytest.raises(mf.InputError, match="tx_position"):
        mf.calibrate.subtract_background(sweep_of([(0, 1)]), sweep_of([(0, 1)], shift=0.02))
    with pytest.raises(mf.InputError, match="nothing is left"):
        mf.calibrate.subtract_background(sweep_of([(0, 1)]), sweep_of([(0, 1)]))


def test_the_mean_of_a_scan_is_its_leakage():
    clean = sweep_of([(0.3, 0.5)], elements=41, shift=0.02)
    leakage = 30.0 * np.exp(-2j * np.pi / speed_of_light * clean["frequency"].values * 0.2)
    leaking = clean.assign(s=clean["s"] + leakage.astype(np.complex64)[:, None, None])
    left = mf.calibrate.subtract_mean(leaking)
    assert np.linalg.norm(left["s"] - clean["s"]) < 0.01 * np.linalg.norm(clean["s"])


@pytest.mark.parametrize("kind", ["corner", "plate"])
@pytest.mark.parametrize("per_channel", [False, True])
def test_the_reference_takes_the_instrument_away(kind, per_channel):
    random = np.random.default_rng(0)
    target = sweep_of([(0.1, 0.8)])
    tx, rx, k = target["tx_position"].values, target["rx_position"].values, target["frequency"].values
    k = 2 * np.pi * k / speed_of_light
    normal = None if kind == "corner" else (0.2, -1.0)
    paths = sphere_paths(tx, rx, (0.0, 1.0)) if kind == "corner" else plate_paths(tx, rx, (0.0, 1.0), normal)
    response = (1.0 + 0.5 * np.sin(k * 0.03)) * np.exp(-1j * k * 1.7 + 0.4j * np.cos(k * 0.1))
    per_pair = np.exp(2j * np.pi * random.random((15, 15))) if per_channel else np.ones((15, 15))
    response = response[:, None, None] * per_pair
    reference = target.assign(s=target["s"].copy(data=response * np.exp(-1j * k[:, None, None] * paths)))
    measured = target.assign(s=target["s"] * response)
    found = mf.calibrate.normalise_by_reference(
        measured, reference, at=(0.0, 1.0), normal=normal, per_channel=per_channel
    )
    np.testing.assert_allclose(found["s"], target["s"], atol=2e-4)


def test_plate_paths_are_the_shortest_by_way_of_the_plate():
    tx, rx = line(3), line(4, centre=(0.1, 0.02, 0.0))
    along = np.linspace(-1, 1, 20001)[:, None] * np.array([1.0, 0.3, 0.0]) + [0.0, 1.0, 0.0]
    walk = np.linalg.norm(along - tx[0], axis=1) + np.linalg.norm(along - rx[3], axis=1)
    assert plate_paths(tx, rx, (0.0, 1.0), (0.3, -1.0))[0, 3] == pytest.approx(walk.min(), abs=1e-8)


def test_sphere_paths_are_the_shortest_by_way_of_the_sphere():
    tx, rx = line(2, centre=(-0.2, 0, 0)), line(2, centre=(0.3, 0.1, 0))
    angle = np.linspace(0, 2 * np.pi, 200001)
    surface = np.array([0.1, 0.9]) + 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    walk = np.linalg.norm(surface - tx[0, :2], axis=1) + np.linalg.norm(surface - rx[1, :2], axis=1)
    assert sphere_paths(tx, rx, (0.1, 0.9), 0.05)[0, 1] == pytest.approx(walk.min(), abs=1e-9)
