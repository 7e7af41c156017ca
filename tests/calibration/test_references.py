"""What a second measurement takes away: the empty scene, the mean of a scan, the response to a corner or a plate."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from instruments import line
from point_sweeps import sweep_of, with_delays
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


STEPS = {
    "background": lambda sweep: mf.calibrate.subtract_background(sweep, sweep_of([(0.3, 0.4)])),
    "elements": lambda sweep: mf.calibrate.apply_elements(
        sweep, mf.calibrate.estimate_elements(sweep_of([(0.0, 0.9)]), at=(0.0, 0.9))
    ),
    "reference": lambda sweep: mf.calibrate.normalise_by_reference(sweep, sweep_of([(0.0, 1.0)]), at=(0.0, 1.0)),
    "cable": lambda sweep: mf.calibrate.remove_cable(sweep, 0.2),
}


@pytest.mark.parametrize("step", STEPS)
def test_no_step_that_takes_the_instrument_away_is_undone_by_a_raw_background(step):
    scene, empty = sweep_of([(0.0, 0.9), (0.1, 0.5)]), sweep_of([(0.1, 0.5)])
    done = STEPS[step](scene)
    with pytest.raises(mf.InputError, match="background: the sweep has been through the step"):
        mf.calibrate.subtract_background(done, empty)
    assert mf.calibrate.subtract_background(done, STEPS[step](empty))["s"].values.any()


@pytest.mark.parametrize("step", ["elements", "reference", "cable"])
def test_no_step_that_takes_the_instrument_away_is_undone_by_a_raw_reference(step):
    scene, corner = sweep_of([(0.0, 0.9), (0.1, 0.5)]), sweep_of([(0.0, 1.2)])
    done = STEPS[step](scene)
    with pytest.raises(mf.InputError, match="reference: the sweep has been through the step"):
        mf.calibrate.normalise_by_reference(done, corner, at=(0.0, 1.2))
    assert mf.calibrate.normalise_by_reference(done, STEPS[step](corner), at=(0.0, 1.2))["s"].values.any()
    clean = STEPS["background"](scene)  # what was added to the scene is no factor of the reference
    assert mf.calibrate.normalise_by_reference(clean, corner, at=(0.0, 1.2))["s"].values.any()


def test_no_calibration_of_elements_is_applied_twice():
    once = STEPS["elements"](sweep_of([(0.0, 0.9), (0.1, 0.5)]))
    with pytest.raises(mf.InputError, match=r"has been through 'delays and gains of the elements removed.* before"):
        STEPS["elements"](once)


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


@pytest.mark.parametrize("at", [(30.0, 900.0), (0.03, 0.9, 900.0)])
def test_places_in_millimetres_are_refused(at):
    measured = sweep_of([(0.03, 0.9)])
    with pytest.raises(mf.InputError, match=r"perhaps 90.* mm were meant"):
        mf.calibrate.normalise_by_reference(measured, measured, at=at)
    with pytest.raises(mf.InputError, match=r"perhaps 90.* mm were meant"):
        mf.calibrate.estimate_elements(measured, at=at)
    with pytest.raises(mf.InputError, match="perhaps 15 mm were meant"):
        mf.calibrate.displace_receivers(measured, (15.0, 0.0))


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


@pytest.mark.parametrize("match", [False, True])
@pytest.mark.parametrize("elements", [15, 50])  # frames below and above a block of samples
def test_one_background_serves_every_frame_of_a_recording(elements, match):
    coupling, target = sweep_of([(0.1, 0.5)], elements=elements), sweep_of([(0.0, 0.9)], [0.01], elements=elements)
    frames = target["s"] * xr.DataArray(np.arange(1.0, 4.0), dims="frame") + coupling["s"]
    recording = coupling.assign(s=frames.transpose("frame", ...).astype(np.complex64))
    left = mf.calibrate.subtract_background(recording, coupling, match=match)
    for frame in range(3):
        expected = (frame + 1) * target["s"].values
        assert np.linalg.norm(left["s"][frame] - expected) < (0.1 if match else 1e-4) * np.linalg.norm(expected)
    with pytest.raises(mf.InputError, match="recording of 3 frames, and the sweep has none"):
        mf.calibrate.subtract_background(coupling, recording)


def test_pairs_that_were_not_measured_stay_silent_without_background_and_leakage():
    there = np.ones((41, 41), dtype=bool)
    there[2:29, 3:] = False
    coupling, target = sweep_of([(0.1, 0.5)], elements=41), sweep_of([(0.3, 0.5)], elements=41)
    leakage = (5.0 * np.exp(1j * np.arange(101)))[:, None, None].astype(np.complex64)
    thinned = target.assign_coords(measured=(("tx", "rx"), there))
    for full, clean in (
        (target["s"] + coupling["s"], lambda sweep: mf.calibrate.subtract_background(sweep, coupling)),
        (target["s"] + leakage, mf.calibrate.subtract_mean),
    ):
        left = clean(thinned.assign(s=full * there.astype(np.complex64)))
        assert not left["s"].values[:, ~there].any()
        assert np.abs(left["s"].values[:, there] - target["s"].values[:, there]).mean() < 0.2
    drifted = thinned.assign(s=(0.8j * coupling["s"] + 1e-3 * target["s"]) * there.astype(np.complex64))
    left = mf.calibrate.subtract_background(drifted, coupling, match=True)
    assert "times 0.8" in left.attrs["processing"][-1]
    unknown = mf.calibrate.subtract_background(
        target.assign(s=target["s"] + coupling["s"]), coupling.assign_coords(measured=(("tx", "rx"), there))
    )
    assert not unknown["s"].values[:, ~there].any()  # of these the background was not measured
    np.testing.assert_array_equal(unknown["measured"], there)


def test_a_moving_antenna_has_its_leakage_at_every_frequency_and_a_background_of_its_own():
    frequency, places = np.linspace(77e9, 81e9, 64), line(41, pitch=2e-3)
    k = 2 * np.pi / speed_of_light * frequency[:, None]
    echo = 0.1 * np.exp(-2j * k * np.linalg.norm(places - [0.1, 1.0, 0.0], axis=1))
    leakage = np.exp(-1j * k * 0.3)
    leaking = mf.make_monostatic_sweep(echo + leakage, frequency=frequency, antenna_position=places)
    left = mf.calibrate.subtract_mean(leaking)["s"].values
    assert np.linalg.norm(left - echo) < 0.5 * np.linalg.norm(echo)
    elsewhere = leaking.assign_coords(antenna_position=leaking["antenna_position"] + 0.1)
    with pytest.raises(mf.InputError, match="antenna_position differs"):
        mf.calibrate.subtract_background(leaking, elsewhere)


@pytest.mark.slow
def test_each_step_does_with_every_frame_of_a_recording_what_it_does_with_one():
    random = np.random.default_rng(0)
    one = sweep_of([(0.1, 0.8), (-0.2, 1.1)], shift=0.04)
    recording = one.assign(s=one["s"] * xr.DataArray(np.exp(0.4j * np.arange(3)), dims="frame"))
    recording["s"] = recording["s"].transpose("frame", ...).astype(np.complex64)
    delays = random.uniform(-1e-4, 1e-4, (2, 15))
    other = with_delays(sweep_of([(0.0, 1.0)], shift=0.04), *delays, tx_gain=1.0 + 0.2j)
    elements = mf.calibrate.estimate_elements(other, at=(0.0, 1.0))
    steps = [
        mf.calibrate.conjugate,
        mf.calibrate.swap_tx_rx,
        mf.calibrate.subtract_mean,
        lambda sweep: mf.calibrate.subtract_background(sweep, other),
        lambda sweep: mf.calibrate.remove_cable(sweep, 0.4),
        lambda sweep: mf.calibrate.time_gate(sweep, 0.5, 1.0),
        lambda sweep: mf.calibrate.displace_receivers(sweep, (1e-3, 0.0)),
        lambda sweep: mf.calibrate.apply_elements(sweep, elements),
        lambda sweep: mf.calibrate.normalise_by_reference(sweep, other, at=(0.0, 1.0)),
        lambda sweep: mf.calibrate.normalise_by_reference(sweep, other, at=(0.0, 1.0), per_channel=True),
    ]
    for step in steps:
        together = step(recording)
        for frame in range(3):
            alone = step(recording.isel(frame=frame))
            np.testing.assert_allclose(together["s"][frame], alone["s"], atol=1e-6 * np.abs(alone["s"].values).max())
            np.testing.assert_array_equal(together["rx_position"], alone["rx_position"])


@pytest.mark.parametrize("scale", [1e-20, 1e-10, 1e11])
def test_the_unit_of_the_samples_does_not_matter(scale):
    """An instrument may state powers, or amplitudes far from one: the delay is found, and the quotient is the same."""
    sweep, reference = sweep_of([(0.1, 0.8)]), sweep_of([(0.0, 1.0)])
    wanted = mf.calibrate.normalise_by_reference(sweep, reference, at=(0.0, 1.0), gate=0.1)
    scaled = (one.assign(s=(scale * one["s"].astype(complex)).astype(np.complex64)) for one in (sweep, reference))
    found = mf.calibrate.normalise_by_reference(*scaled, at=(0.0, 1.0), gate=0.1)
    np.testing.assert_allclose(found["s"], wanted["s"], atol=1e-4 * float(np.abs(wanted["s"]).max()))
