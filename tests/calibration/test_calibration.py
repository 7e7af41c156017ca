"""Calibration: known errors of an instrument are put into exact sweeps, and must be found and removed."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.autofocus import entropy
from mirrorfold.calibration.masking import find_bad
from mirrorfold.calibration.reflectors import plate_paths, sphere_paths

MICROMETRE = 1e-6


def line(elements, *, pitch=0.5e-3, centre=(0.0, 0.0, 0.0)):
    """Antennas on a line along x, (elements, 3)."""
    return np.asarray(centre) + np.outer(pitch * (np.arange(elements) - (elements - 1) / 2), [1.0, 0.0, 0.0])


def echoes(frequency, tx, rx, points, amplitude=None):
    """Samples of point scatterers, (frequencies, tx, rx)."""
    k = 2 * np.pi * frequency / speed_of_light
    s = np.zeros((len(frequency), len(tx), len(rx)), dtype=complex)
    for point, a in zip(points, np.ones(len(points)) if amplitude is None else amplitude, strict=True):
        s += a * np.exp(-1j * k[:, None, None] * sphere_paths(tx, rx, point))
    return s


def sweep_of(points, amplitude=None, *, elements=15, start=290e9, stop=300e9, frequencies=101, shift=0.0):
    """The exact sweep of points, seen by two arrays that may be displaced."""
    frequency = np.linspace(start, stop, frequencies)
    tx, rx = line(elements, centre=(-shift / 2, 0, 0)), line(elements, centre=(shift / 2, 0, 0))
    s = echoes(frequency, tx, rx, points, amplitude)
    return mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx, processing=["made"])


def with_delays(sweep, tx_delay, rx_delay, tx_gain=1.0, rx_gain=1.0):
    """The sweep as elements with delays [m] and gains of their own measure it."""
    k = 2 * np.pi * sweep["frequency"].values / speed_of_light
    turn = np.exp(-1j * k[:, None, None] * (np.asarray(tx_delay)[:, None] + rx_delay))
    gain = np.broadcast_to(tx_gain, len(tx_delay))[:, None] * np.broadcast_to(rx_gain, len(rx_delay))
    return sweep.assign(s=sweep["s"].copy(data=(sweep["s"].values * turn * gain).astype(np.complex64)))


def worst_error(found, tx_delay, rx_delay, good=slice(None)):
    """Largest error of the sums t + r over pairs of good transmitters [m]: nothing else can be observed."""
    found_sum = found.tx_delay[good, None] + found.rx_delay
    return np.abs(found_sum - (np.asarray(tx_delay)[good, None] + rx_delay)).max()


# ---------------------------------------------------------------- elements


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
    path = mf.calibrate.save_elements(calibration, tmp_path / "a.json")
    content = json.loads(path.read_text())
    for change in ({"tx_delay": [1.0]}, {"rx_gain": None}, {"tx_valid": "x"}, {"mirrorfold_kind": "sweep"}):
        path.write_text(json.dumps(content | change))
        with pytest.raises(mf.InputError, match="save-elements"):
            mf.calibrate.load_elements(path)
    path.write_text("[" * 100_000)
    with pytest.raises(mf.InputError, match="save-elements"):
        mf.calibrate.load_elements(path)


# ---------------------------------------------------------------- background, reference, gate


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


def test_the_time_gate_cuts_what_it_should_and_nothing_late_by_default():
    near, late = sweep_of([(0.0, 0.3)]), sweep_of([(0.0, 1.3)])
    both = near.assign(s=near["s"] + late["s"])
    np.testing.assert_allclose(mf.calibrate.time_gate(both)["s"], both["s"], atol=1e-5)
    inner = slice(10, -10)  # an echo between two bins leaks into the gate's other side at the ends of the band
    kept = mf.calibrate.time_gate(both, start=0.6)["s"][inner]
    assert np.abs(kept - late["s"][inner]).mean() < 0.03
    kept = mf.calibrate.time_gate(both, stop=0.6)["s"][inner]
    assert np.abs(kept - near["s"][inner]).mean() < 0.03
    for start, stop in ((1.0, 0.5), (-0.1, None), (None, 7.0)):
        with pytest.raises(mf.InputError, match="expected 0 <= start < stop"):
            mf.calibrate.time_gate(both, start, stop)


# ---------------------------------------------------------------- masking


def test_bad_channels_and_frequencies_are_found_and_filled():
    random = np.random.default_rng(4)
    clean = sweep_of([(0.1 * n - 0.3, 0.5 + 0.1 * n) for n in range(6)], frequencies=201)
    sweep = mf.add_noise(clean, snr_db=30.0, seed=0)
    s = sweep["s"].values
    s[:, 7, 9] = np.nan
    limit = 0.3 * np.abs(s[:, 5, 5]).max()
    s[:, 5, 5] = np.clip(s[:, 5, 5].real, -limit, limit) + 1j * np.clip(s[:, 5, 5].imag, -limit, limit)
    s[:, :, 11] = 2.0 * random.standard_normal((201, 15, 2)).view(complex)[..., 0]
    s[:, 3] = 0.0
    s[[40, 120]] = 50.0 * random.standard_normal((2, 15, 15))
    bad = mf.calibrate.find_bad(sweep)
    assert set(np.flatnonzero(bad.frequencies)) == {40, 120}
    assert bad.dead[3].all()
    assert bad.dead.sum() == 15
    assert bad.undefined[7, 9]
    assert bad.undefined.sum() == 1
    assert bad.saturated[5, 5]
    assert bad.saturated.sum() == 1
    assert bad.noise[:, 11].sum() == 14
    assert bad.noise.sum() == 14
    masked = mf.calibrate.mask_bad(sweep)
    good = ~bad.channels
    wrong = masked["s"].values[[40, 120]][:, good] - clean["s"].values[[40, 120]][:, good]
    # The page on calibration promises 4 %.
    assert np.linalg.norm(wrong) < 0.04 * np.linalg.norm(clean["s"].values[[40, 120]][:, good])
    assert not masked["s"].values[:, ~good].any()
    assert "2 bad frequencies" in masked.attrs["processing"][-1]


def test_nothing_is_bad_in_good_sweeps():
    for seed in range(5):
        random = np.random.default_rng(seed)
        points = np.column_stack([random.uniform(-0.5, 0.5, 8), random.uniform(0.3, 1.3, 8)])
        sweep = mf.add_noise(sweep_of(points, random.uniform(0.01, 1.0, 8)), snr_db=10.0, seed=seed)
        bad = mf.calibrate.find_bad(sweep)
        assert not bad.channels.any()
        assert not bad.frequencies.any()


# ---------------------------------------------------------------- displacement, autofocus, repairs


def test_the_displacement_of_the_apertures_is_found_from_two_places():
    truth, cable = np.array([3e-3, -2e-3, 0.0]), 0.011
    frequency = np.linspace(270e9, 300e9, 201)
    tx, rx = line(21, centre=(-0.05, 0, 0)), line(21, centre=(0.05, 0, 0))
    k = 2 * np.pi * frequency / speed_of_light
    places, sweeps = [(-0.5, 0.7), (0.5, 0.8), (0.0, 1.0)], []
    for n, p in enumerate(places):
        s = echoes(frequency, tx, rx + truth, [p]) * np.exp(-1j * k * cable)[:, None, None]
        sweeps.append(
            mf.add_noise(mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx), snr_db=20.0, seed=n)
        )
    found, length = mf.calibrate.estimate_displacement(sweeps, at=places)
    assert np.abs(found - truth).max() < 20 * MICROMETRE
    assert length == pytest.approx(cable, abs=20 * MICROMETRE)
    moved = mf.calibrate.displace_receivers(sweeps[0], found)
    np.testing.assert_allclose(moved["rx_position"], rx + found)


@pytest.mark.slow
def test_autofocus_removes_small_errors_of_the_positions():
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(-0.4, 0.4, 8), random.uniform(0.4, 1.2, 8)])
    ideal = sweep_of(points, elements=31)
    tx_delay, rx_delay = random.uniform(-0.15e-3, 0.15e-3, (2, 31))
    blurred = mf.add_noise(with_delays(ideal, tx_delay, rx_delay), snr_db=20.0, seed=0)
    grid = {"x": np.arange(-0.6, 0.6, 0.005), "y": np.arange(0.3, 1.35, 0.005)}
    steps: list[tuple[int, int]] = []
    sharp = mf.calibrate.autofocus(blurred, **grid, progress=lambda *step: steps.append(step))
    assert [done for done, _ in steps] == list(range(1, len(steps) + 1))
    assert 1 < len(steps) <= steps[0][1]
    figures = [entropy(np.abs(mf.focus(one, **grid).values)) for one in (ideal, blurred, sharp)]
    assert figures[2] < figures[0] + 0.1 * (figures[1] - figures[0])
    assert "entropy" in sharp.attrs["processing"][-1]
    left = sharp.attrs["autofocus_tx_delay"] - tx_delay
    left -= np.polyval(np.polyfit(np.arange(31), left, 1), np.arange(31))
    assert left.std() < 1 * MICROMETRE


def test_autofocus_leaves_a_sharp_image_sharp():
    ideal = mf.add_noise(sweep_of([(0.1, 0.6), (-0.2, 0.9), (0.3, 1.2)], elements=21), snr_db=20.0, seed=0)
    grid = {"x": np.arange(-0.5, 0.5, 0.005), "y": np.arange(0.4, 1.35, 0.005)}
    sharp = mf.calibrate.autofocus(ideal, **grid)
    delays = np.atleast_1d(sharp.attrs.get("autofocus_tx_delay", 0.0))
    assert np.abs(delays).max() < 20 * MICROMETRE


def test_other_waves_of_the_same_length_are_calibrated_alike():
    """Half the frequency at half the speed is the same wave: in water, ultrasound or dielectrics too."""
    random = np.random.default_rng(5)
    fast = with_delays(
        sweep_of([(0.1, 0.9), (-0.2, 1.3)], shift=0.05), *random.uniform(-1e-4, 1e-4, (2, 15)), tx_gain=1.0 + 0.2j
    )
    slow = fast.assign_coords(frequency=0.5 * fast["frequency"]).assign_attrs(wave_speed=0.5 * speed_of_light)
    reference = {"fast": sweep_of([(0.0, 1.0)], shift=0.05)}
    reference["slow"] = reference["fast"].assign_coords(slow.coords).assign_attrs(wave_speed=0.5 * speed_of_light)

    def calibrated(sweep, other):
        found = mf.calibrate.estimate_elements(other, at=(0.0, 1.0))
        yield mf.calibrate.time_gate(sweep, start=0.7, stop=1.1)
        yield mf.calibrate.apply_elements(sweep, found)
        yield mf.calibrate.normalise_by_reference(sweep, other, at=(0.0, 1.0), gate=0.2)
        yield mf.calibrate.autofocus(sweep, x=np.linspace(-0.4, 0.4, 81), y=np.linspace(0.6, 1.4, 81))

    for one, other in zip(calibrated(fast, reference["fast"]), calibrated(slow, reference["slow"]), strict=True):
        assert np.any(one["s"].values)
        np.testing.assert_allclose(other["s"].values, one["s"].values, atol=1e-4 * np.abs(one["s"].values).max())
    told = [mf.info(sweep, diagnose=False) for sweep in (fast, slow)]
    for name in ("range_resolution_m", "ambiguous_range_m", "field_of_view_deg", "cross_range_resolution_m"):
        assert told[1][name] == pytest.approx(told[0][name])


def test_every_repair_is_undone_by_itself_and_is_recorded():
    sweep = sweep_of([(0.1, 0.7)], shift=0.1)
    for repair in (
        mf.calibrate.conjugate,
        mf.calibrate.reverse_frequency,
        mf.calibrate.swap_tx_rx,
        mf.calibrate.swap_iq,
    ):
        once = repair(sweep)
        assert not once.identical(sweep)
        assert len(once.attrs["processing"]) == 2
        np.testing.assert_allclose(repair(once)["s"], sweep["s"])
        np.testing.assert_allclose(repair(once)["tx_position"], sweep["tx_position"])
    back = mf.calibrate.remove_cable(mf.calibrate.remove_cable(sweep, 2.5), -2.5)
    np.testing.assert_allclose(back["s"], sweep["s"], atol=1e-5)
    in_mm = sweep.assign_coords({f"{a}_position": sweep[f"{a}_position"] * 1e3 for a in ("tx", "rx")})
    np.testing.assert_allclose(mf.calibrate.scale_positions(in_mm, "mm")["rx_position"], sweep["rx_position"])


def test_a_removed_cable_moves_echoes_nearer_by_half_of_it():
    shorter = mf.calibrate.remove_cable(sweep_of([(0.0, 1.0)], elements=1), 0.6)
    profile = np.abs(np.fft.ifft(shorter["s"].values[:, 0, 0], 4096))
    step = np.diff(shorter["frequency"].values).mean()
    assert profile.argmax() / 4096 * speed_of_light / (2 * step) == pytest.approx(0.7, abs=0.002)


@pytest.mark.slow
def test_looking_for_bad_samples_takes_less_than_another_sweep():
    s = np.random.default_rng(0).standard_normal((400, 160, 320), dtype=np.float32).view(np.complex64)
    sweep = xr.Dataset({"s": (("frequency", "tx", "rx"), s)})
    tracemalloc.start()
    try:
        find_bad(sweep)
        assert tracemalloc.get_traced_memory()[1] < 0.8 * s.nbytes
    finally:
        tracemalloc.stop()
