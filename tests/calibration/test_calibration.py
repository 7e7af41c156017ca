"""Calibration: masking bad samples, gates, displaced apertures, autofocus, and repairs that undo themselves."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import xarray as xr
from instruments import line
from point_sweeps import echoes, sweep_of, with_delays
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.autofocus import entropy
from mirrorfold.calibration.displacement import fit_displacement
from mirrorfold.calibration.masking import find_bad
from mirrorfold.diagnosis.quality import sample_findings

MICROMETRE = 1e-6


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


def test_steps_for_pairs_say_what_to_leave_out_or_to_select():
    sweep = sweep_of([(0.0, 0.9)])
    recording = xr.concat([sweep, sweep], "frame").assign_coords(time=("frame", [0.0, 1.0]))
    with pytest.raises(mf.InputError, match=r"expected \(frequency, tx, rx\); select one frame$"):
        mf.calibrate.autofocus(recording)
    one = mf.make_monostatic_sweep(
        sweep["s"].values[:, :, 0], frequency=sweep["frequency"].values, antenna_position=sweep["tx_position"].values
    )
    with pytest.raises(mf.InputError, match=r"one moving antenna has no pairs, leave this step out$"):
        mf.calibrate.swap_tx_rx(one)


def test_weak_channels_of_a_coarse_converter_are_not_saturated():
    random = np.random.default_rng(0)
    s = random.standard_normal((401, 6, 6, 2)).view(complex)[..., 0]
    place = np.outer(np.arange(6) * 1e-3, [1.0, 0.0, 0.0])
    # Steps of the converter and its limits, against the standard deviation of the samples.
    for step, limit, expected in ((0.3, np.inf, 0), (0.7, np.inf, 0), (0.05, 1.5, 36), (0.1, 1.5, 36)):
        steps = np.clip(np.round(s.view(float) / step), -limit / step, limit / step)
        kept = steps.view(complex).astype(np.complex64)
        sweep = mf.make_sweep(kept, frequency=np.linspace(77e9, 81e9, 401), tx_position=place, rx_position=place)
        assert find_bad(sweep).saturated.sum() == expected
    saturated = [one for one in sample_findings(sweep) if one.name == "saturated-channels"]
    assert "measure again" in saturated[0].command()


def test_a_single_echo_whose_phases_repeat_is_not_saturated():
    """A path of a tenth of c / df turns the phase by 36 degrees from frequency to frequency: ten phases in all."""
    frequency = np.linspace(290e9, 300e9, 401)
    path = 0.1 * speed_of_light / 25e6
    place = np.array([[0.0, 0.0, 0.0], [0.003, 0.0, 0.0]])
    s = echoes(frequency, place, place, [(0.0, 0.5 * path)])
    pair = s[:, 0, 0]
    assert np.count_nonzero(np.abs(pair.real) > (1.0 - 1e-6) * np.abs(pair.real).max()) > 40
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=place, rx_position=place)
    assert not find_bad(sweep).saturated.any()
    clipped = s.copy()
    clipped[:, 0, 1] = np.sign(s[:, 0, 1].real) + 1j * np.sign(s[:, 0, 1].imag)
    found = find_bad(sweep.assign(s=sweep["s"].copy(data=clipped.astype(np.complex64)))).saturated
    np.testing.assert_array_equal(found, [[False, True], [False, False]])


@pytest.mark.parametrize("stop", [None, 5.99])
def test_a_gate_that_keeps_late_echoes_removes_leakage_at_no_range(stop):
    """The end of the ambiguous range, 5.996 m, and range zero are neighbours in the transform."""
    place = np.stack([np.linspace(-0.005, 0.005, 11), np.zeros(11), np.zeros(11)], axis=1)
    frequency = np.linspace(290e9, 300e9, 401)
    wavenumber = 2.0 * np.pi * frequency[:, None, None] / speed_of_light
    leakage = 10.0 * np.exp(-1j * wavenumber * np.linalg.norm(place[:, None] - place, axis=-1))
    echo = echoes(frequency, place, place, [(0.1, 1.0)])
    sweep = mf.make_sweep(leakage + echo, frequency=frequency, tx_position=place, rx_position=place)
    gated = mf.calibrate.time_gate(sweep, 0.3, stop)["s"].values
    inner = slice(100, -100)
    assert np.abs(gated - echo)[inner].mean() < 0.02 * np.abs(leakage).mean()


@pytest.mark.parametrize("monostatic", [True, False])
def test_the_time_gate_of_a_distant_scene_counts_around_its_centre(monostatic):
    """The ambiguous range is 1.5 m; the scene lies ten metres away and reaches 0.7 m to either side of its centre."""
    frequency = np.linspace(60e9, 64e9, 41)
    place = np.stack([np.linspace(-0.5, 0.5, 12), np.zeros(12), np.zeros(12)], axis=1)
    centre = np.array([0.0, 10.0, 0.0])

    def seen(y):
        s = echoes(frequency, place, place, [(0.0, y)])
        if monostatic:
            s = np.stack([s[:, n, n] for n in range(12)], axis=1)
            return mf.make_monostatic_sweep(s, frequency=frequency, antenna_position=place, scene_center=centre)
        return mf.make_sweep(s, frequency=frequency, tx_position=place, rx_position=place, scene_center=centre)

    near, late = seen(9.4), seen(10.6)
    both = near.assign(s=near["s"] + late["s"])
    np.testing.assert_allclose(mf.calibrate.time_gate(both)["s"], both["s"], atol=1e-5)
    inner = slice(8, -8)
    for gate, kept, cut in (({"start": 10.0}, late, near), ({"stop": 10.0}, near, late)):
        gated = mf.calibrate.time_gate(both, **gate)["s"][inner]
        assert np.abs(gated - kept["s"][inner]).mean() < 0.06
        assert np.abs(gated - cut["s"][inner]).mean() > 0.8
    for start, stop in ((0.0, 0.5), (9.0, None), (None, 10.8)):
        with pytest.raises(mf.InputError, match="the ambiguous range around the scene_center"):
            mf.calibrate.time_gate(both, start, stop)


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


@pytest.mark.slow
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
def test_errors_of_the_displacement_are_those_that_are_made():
    """Receivers have delays of their own of 0.1 mm, and the samples noise."""
    frequency, tx, rx = np.linspace(270e9, 300e9, 61), line(9, centre=(-0.05, 0, 0)), line(9, centre=(0.05, 0, 0))
    truth, places = np.array([3e-3, -2e-3, 0.0]), [(-0.5, 0.7), (0.5, 0.8), (0.0, 1.0)]
    ratios = []
    for seed in range(12):
        own = np.random.default_rng(seed).normal(0.0, 1e-4, 9)
        sweeps = [
            mf.add_noise(
                with_delays(
                    mf.make_sweep(
                        echoes(frequency, tx, rx + truth, [p]), frequency=frequency, tx_position=tx, rx_position=rx
                    ),
                    np.zeros(9), own,
                ),
                snr_db=10.0, seed=10 * seed + n,
            )
            for n, p in enumerate(places)
        ]  # fmt: skip
        found = fit_displacement(sweeps, at=places)
        assert found.error[2] == np.inf  # nothing tells of heights
        ratios.append((found.vector - truth)[:2] / found.error[:2])
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 2.0
    alone = fit_displacement(sweeps[0], at=places[0])
    assert alone.error[1] == np.inf  # a single place tells of the array's direction alone


@pytest.mark.slow
@pytest.mark.parametrize("truth", [(15e-3, -4e-3, 3e-3), (0.0, 8e-3, 0.0)])
def test_displacements_of_many_wavelengths_are_exact_and_metres_of_cable_are_none(truth):
    frequency, tx, rx = np.linspace(57e9, 64e9, 101), line(9, pitch=2e-3), line(9, pitch=2e-3, centre=(0, 0, 0.01))
    turn = np.exp(-2j * np.pi * frequency / speed_of_light * 0.7)[:, None, None]
    places = [(-0.3, 0.8), (0.3, 0.9), (0.0, 0.7, 0.2), (0.1, 1.0, -0.2)]
    sweeps = [
        mf.make_sweep(
            echoes(frequency, tx, rx + truth, [p]) * turn, frequency=frequency, tx_position=tx, rx_position=rx
        )
        for p in places
    ]
    found, length = mf.calibrate.estimate_displacement(sweeps, at=places, radius=0.0)
    assert np.abs(found - truth).max() < 1 * MICROMETRE
    assert length == pytest.approx(0.7, abs=1 * MICROMETRE)
    # A single place cannot tell the way along the line of sight from the cable, and gives the cable all of it.
    found, length = mf.calibrate.estimate_displacement(sweeps[0], at=places[0])
    assert np.linalg.norm(found) < 1.1 * np.linalg.norm(truth)
    assert length == pytest.approx(0.7, abs=np.linalg.norm(truth))
    with pytest.raises(mf.InputError, match="more than the 5 mm that are looked for"):
        mf.calibrate.estimate_displacement(sweeps, at=places, largest=5e-3)


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


@pytest.mark.slow
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


def test_bad_samples_are_looked_for_along_the_frequencies():
    sweep = xr.Dataset({"s": (("step", "tx", "rx"), np.ones((4, 2, 2), dtype=np.complex64))})
    with pytest.raises(mf.InputError, match="expected 'frequency' among them"):
        find_bad(sweep)


def test_what_was_masked_stays_silent_before_a_background_and_is_not_blamed_again():
    sweep = mf.add_noise(sweep_of([(0.1 * n - 0.3, 0.5 + 0.1 * n) for n in range(6)]), snr_db=30.0, seed=0)
    sweep["s"].values[:, 3] = np.nan
    masked = mf.calibrate.mask_bad(sweep)
    np.testing.assert_array_equal(masked["measured"].all("rx"), np.arange(15) != 3)
    assert [finding.name for finding in mf.info(masked).findings] == []
    assert "nothing bad" in mf.calibrate.mask_bad(masked).attrs["processing"][-1]
    left = mf.calibrate.subtract_background(masked, sweep_of([(0.2, 0.6)]))
    assert not left["s"].values[:, 3].any()
    with pytest.raises(mf.InputError, match="bad is that of a sweep of 101 frequencies and channels"):
        mf.calibrate.mask_bad(sweep_of([(0.0, 0.9)], elements=9), find_bad(sweep))


def test_where_echoes_cancel_each_other_in_all_channels_no_frequency_is_bad():
    """Two echoes of one strength, a range cell apart, cancel once within the band; a short array sees one of it."""
    clean = sweep_of([(0.0, 0.9), (0.0, 0.9151)], elements=9, frequencies=201)
    sweep = mf.add_noise(clean, snr_db=30.0, seed=0)
    level = np.abs(sweep["s"].values).mean(axis=(1, 2))
    null = int(np.argmin(level))
    assert 20 < null < 80
    assert level[null] < 0.5 * level[null - 5 : null + 6].mean()
    assert not mf.calibrate.find_bad(sweep).frequencies.any()
    sweep["s"].values[[100, 150]] *= 0.5
    assert list(np.flatnonzero(mf.calibrate.find_bad(sweep).frequencies)) == [100, 150]


def test_a_block_of_lost_samples_is_filled_in_and_zeros_at_the_ends_are_left():
    clean = sweep_of([(0.1 * n - 0.3, 0.5 + 0.1 * n) for n in range(6)], frequencies=201)
    sweep = clean.assign(s=clean["s"] * np.hanning(201)[:, None, None])
    assert not mf.calibrate.find_bad(sweep).frequencies.any()
    kept = sweep["s"].values.copy()
    sweep["s"].values[90:100] = 0.0
    assert list(np.flatnonzero(mf.calibrate.find_bad(sweep).frequencies)) == list(range(90, 100))
    filled = mf.calibrate.mask_bad(sweep)["s"].values
    assert np.linalg.norm(filled - kept) < 0.1 * np.linalg.norm(kept[90:100])


def test_a_frequency_that_one_frame_lacks_is_filled_in_from_that_frame():
    clean = sweep_of([(0.1 * n - 0.3, 0.5 + 0.1 * n) for n in range(6)])
    frames = np.stack([clean["s"].values * np.exp(0.3j * n) for n in range(4)])
    recording = clean.assign(s=(("frame", *clean["s"].dims), frames.copy()))
    recording["s"].values[2, 40] = np.nan
    filled = mf.calibrate.mask_bad(recording)
    assert "measured" not in filled.variables
    wrong = np.linalg.norm(filled["s"].values - frames, axis=(-2, -1)) / np.linalg.norm(frames, axis=(-2, -1))
    assert wrong[2, 40] < 0.02
    assert np.delete(wrong.ravel(), 2 * 101 + 40).max() < 1e-6
