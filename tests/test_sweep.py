"""The Sweep contract: what is accepted, what is refused and in which words, what it resolves, noise."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.units import UNITS
from mirrorfold.errors import InputError
from mirrorfold.sweep import (
    add_noise,
    ambiguous_range,
    check_sweep,
    frequency_step,
    is_monostatic,
    make_monostatic_sweep,
    make_sweep,
    radar_position,
    range_resolution,
)


def with_sample(sweep, value):
    s = sweep["s"].values.copy()
    s[3, 2, 1] = value
    return sweep.assign(s=sweep["s"].copy(data=s))


def with_frequency(sweep, index, change):
    frequency = sweep["frequency"].values.copy()
    frequency[index] += change
    return sweep.assign_coords(frequency=frequency)


def test_a_valid_sweep_passes_unchanged(sweep):
    assert check_sweep(sweep) is sweep
    assert sweep["s"].dtype == np.complex64
    assert sweep.attrs["mirrorfold_kind"] == "sweep"
    assert sweep.attrs["title"] == "point target"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda s: s.rename(s="data"), "no variable 's'"),
        (lambda s: s.drop_vars("tx_position"), "no coordinate 'tx_position'"),
        (lambda s: s.drop_vars("rx_position"), "no coordinate 'rx_position'"),
        (lambda s: s.drop_vars("frequency"), "no coordinate 'frequency'"),
        (lambda s: s.transpose("tx", "frequency", "rx", "axis"), r"expected \(frequency, tx, rx\)"),
        (lambda s: s.isel(frequency=slice(0)), "s is empty"),
        (lambda s: s.assign_coords(frequency=s["frequency"] + 0.0 * s["tx"]), "frequency has dimensions"),
        (lambda s: s.assign(s=abs(s["s"])), "expected complex numbers"),
        (lambda s: s.isel(axis=slice(2)), "three axes"),
        (
            lambda s: s.assign_coords(tx_position=s["tx_position"] * np.nan),
            "tx_position holds a coordinate that is not finite",
        ),
        (lambda s: s.assign_coords(frequency=-s["frequency"]), "not positive"),
        (lambda s: s.isel(frequency=slice(None, None, -1)), "equal rising steps; they fall: turn frequency and s over"),
        (lambda s: with_frequency(s, 5, 1e7), "equal rising steps"),
        (lambda s: with_sample(s, np.nan), "1 samples of 3321 that are not finite"),
        (lambda s: with_sample(s, np.inf), "1 samples of 3321 that are not finite"),
        (lambda s: s.assign(s=0 * s["s"]), "every sample of s is zero"),
        (lambda s: s.assign_attrs(time_convention="e^jwt"), "time_convention is 'e\\^jwt'"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(sweep, spoil, words):
    with pytest.raises(InputError, match=words) as caught:
        check_sweep(spoil(sweep), source="measured.nc")
    assert str(caught.value).startswith("measured.nc: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", [("azimuth", "elevation", "frequency"), ("frequency", "elevation", "azimuth")])
def test_scans_in_another_order_are_told_how_to_sort_them(order):
    """They were asked for positions of transmitters."""
    beams = {"azimuth": np.linspace(-5.0, 5.0, 3), "elevation": [0.0, 1.0]}
    scan = mf.make_raster_sweep(np.ones((4, 3, 2), complex), frequency=290e9 + 1e8 * np.arange(4), **beams)
    with pytest.raises(InputError, match=r"expected \(frequency, azimuth, elevation\)") as refused:
        check_sweep(scan.transpose(*order))
    call = str(refused.value).rpartition("sweep.transpose")[2]
    assert eval(f"scan.transpose{call}")["s"].dims == ("frequency", "azimuth", "elevation")  # as it says


@pytest.mark.parametrize("points", [41, 5001])
def test_frequencies_in_single_precision_lose_their_rounding(points):
    """They were refused, as uneven or because the image was not exact enough; 5001 are 2 MHz apart, rounding 16 kHz."""
    exact = np.linspace(290.1e9, 300.2e9, points)
    places = {"tx_position": np.zeros((2, 3)), "rx_position": [[0.0, 0.0, 0.0], [5e-4, 0.0, 0.0]]}
    s = np.ones((points, 2, 2), complex)
    s[0] += 1j
    sweep = make_sweep(s, frequency=exact.astype(np.float32), **places)
    assert_allclose(np.diff(sweep["frequency"]), np.diff(exact), rtol=2e-5)
    assert np.ptp(np.diff(sweep["frequency"])) < 1e-9 * np.diff(exact).mean()
    loaded = make_sweep(s, frequency=exact, **places).assign_coords(frequency=exact.astype(np.float32))
    assert_array_equal(check_sweep(loaded)["frequency"], sweep["frequency"])
    assert not [finding for finding in mf.info(loaded).findings if "steps" in finding.name]


def test_a_sweep_in_single_precision_is_imaged_as_exactly_as_another(sweep):
    axes = {"x": np.linspace(-0.02, 0.06, 21), "y": np.linspace(0.2, 0.4, 21)}
    rough = sweep.assign_coords(frequency=sweep["frequency"].astype(np.float32))
    found, expected = (mf.focus(one, tolerance=1e-5, **axes) for one in (rough, sweep))
    assert abs(found - expected).max() < 1e-4 * abs(expected).max()


def test_exact_frequencies_and_uneven_ones_are_kept(sweep):
    assert check_sweep(sweep)["frequency"].identical(sweep["frequency"])
    bent = sweep["frequency"].values + 8e5 * np.sin(np.linspace(0.0, np.pi, 41))  # a chirp that is no line
    assert_array_equal(check_sweep(sweep.assign_coords(frequency=bent))["frequency"], bent)


def test_samples_beyond_single_precision_are_refused_as_such(sweep):
    places = {name: sweep[name] for name in ("frequency", "tx_position", "rx_position")}
    with pytest.raises(InputError, match="more than single precision holds"):
        make_sweep(sweep["s"].values.astype(complex) * 1e39, **places)
    with pytest.raises(InputError, match="larger than single precision holds"):
        add_noise(sweep, snr_db=-1000.0, seed=0)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="shapes do not fit"):
        make_sweep(
            np.ones((3, 2, 2), complex), frequency=[1, 2, 3], tx_position=np.zeros((5, 3)), rx_position=np.zeros((2, 3))
        )


def test_the_other_time_convention_is_conjugated(sweep):
    other = sweep.assign(s=np.conj(sweep["s"])).assign_attrs(time_convention="exp(-jwt)")
    converted = check_sweep(other)
    assert converted.attrs["time_convention"] == "exp(+jwt)"
    assert_array_equal(converted["s"].values, sweep["s"].values)


def test_conjugated_samples_stay_where_frequencies_lose_their_rounding(sweep):
    """Most of them became NaN, as the frequencies of the sweep were no longer theirs."""
    rough = sweep.assign_coords(frequency=sweep["frequency"].astype(np.float32))
    other = rough.assign(s=np.conj(rough["s"])).assign_attrs(time_convention="exp(-jwt)")
    converted = check_sweep(other)
    assert_array_equal(converted["s"].values, sweep["s"].values)
    assert_array_equal(converted["frequency"], check_sweep(rough)["frequency"])


def test_what_a_band_resolves(sweep):
    assert frequency_step(sweep) == pytest.approx(250e6)
    assert ambiguous_range(sweep) == pytest.approx(0.59958492)
    assert range_resolution(sweep) == pytest.approx(0.59958492 / 41)


def test_the_radar_stands_between_its_arrays(sweep):
    moved = sweep.assign_coords(rx_position=sweep["rx_position"] + [0.2, 0.0, 0.1])
    assert_allclose(radar_position(moved), [0.1, 0.0, 0.05], atol=1e-15)


@pytest.mark.parametrize("snr_db", [20.0, 0.0, -10.0])
def test_noise_has_the_power_asked_for_and_is_white(sweep, snr_db):
    noise = add_noise(sweep, snr_db=snr_db, seed=1)["s"].values - sweep["s"].values
    power = np.mean(np.abs(noise) ** 2)
    count = noise.size
    assert power == pytest.approx(10 ** (-snr_db / 10), rel=5 / np.sqrt(count))
    assert abs(np.mean(noise**2)) < 5 * power / np.sqrt(count)  # circular: real and imaginary part alike
    assert abs(np.mean(noise[1:] * np.conj(noise[:-1]))) < 5 * power / np.sqrt(count)


def test_noise_follows_the_time_convention_of_the_sweep(sweep):
    """Told the other way, the same sweep gets the same noise."""
    told = sweep.copy(data={"s": np.conj(sweep["s"].values)}).assign_attrs(time_convention="exp(-jwt)")
    one, other = (add_noise(held, snr_db=200.0, seed=1) for held in (sweep, told))
    assert_allclose(check_sweep(other)["s"].values, one["s"].values, rtol=1e-6)


def test_noise_is_on_measured_pairs_alone(sweep):
    measured = np.ones((sweep.sizes["tx"], sweep.sizes["rx"]), dtype=bool)
    measured[0] = False
    part = sweep.assign_coords(measured=(("tx", "rx"), measured))
    part = part.assign(s=part["s"] * part["measured"])
    noise = add_noise(part, snr_db=10.0, seed=1)["s"].values - part["s"].values
    assert_array_equal(noise[:, ~measured], 0.0)
    power = np.mean(np.abs(part["s"].values[:, measured]) ** 2)
    assert np.mean(np.abs(noise[:, measured]) ** 2) == pytest.approx(0.1 * power, rel=5 / np.sqrt(noise.size))


def test_a_single_frequency_resolves_no_range(sweep):
    one = sweep.isel(frequency=[0])
    assert (ambiguous_range(one), range_resolution(one)) == (np.inf, np.inf)
    assert range_resolution(sweep) == pytest.approx(ambiguous_range(sweep) / sweep.sizes["frequency"])


def test_falling_frequencies_are_refused_of_whatever_type(sweep):
    falling = sweep.isel(frequency=slice(None, None, -1))
    frequency = np.rint(falling["frequency"].values).astype(np.uint64)
    with pytest.raises(mf.InputError, match="expected equal rising steps"):
        check_sweep(falling.assign_coords(frequency=frequency))


def test_noise_is_reproducible_and_leaves_the_sweep_alone(sweep):
    before = sweep["s"].values.copy()
    first, again, other = (add_noise(sweep, snr_db=10, seed=seed)["s"].values for seed in (1, 1, 2))
    assert_array_equal(first, again)
    assert (first != other).any()
    assert_array_equal(sweep["s"].values, before)


def moving(positions=24, **attrs):
    """The sweep of a target at (0.1, 1.0) m from one moving antenna."""
    place = np.zeros((positions, 3))
    place[:, 0] = 2e-3 * (np.arange(positions) - positions / 2)
    frequency = np.linspace(60e9, 64e9, 41)
    speed = attrs.get("wave_speed", speed_of_light)
    d = np.linalg.norm(place - [0.1, 1.0, 0.0], axis=1)
    s = np.exp(-4j * np.pi * frequency[:, None] / speed * d)
    return make_monostatic_sweep(s, frequency=frequency, antenna_position=place, **attrs)


def test_a_moving_antenna_makes_a_sweep_that_is_saved_described_and_imaged(tmp_path):
    sweep = moving()
    assert is_monostatic(sweep)
    xr.testing.assert_identical(mf.load(mf.save(sweep, tmp_path / "m.nc")), sweep)
    assert mf.info(sweep)["dimensions"] == {"frequency": 41, "position": 24}
    x, y = np.arange(0.0, 0.2, 0.01), np.arange(0.9, 1.1, 0.01)
    image = mf.focus(sweep, x=x, y=y)
    peak = np.unravel_index(np.abs(image.values).argmax(), image.shape)
    assert (x[peak[1]], y[peak[0]]) == (pytest.approx(0.1, abs=0.011), pytest.approx(1.0, abs=0.011))
    np.testing.assert_allclose(radar_position(sweep), sweep["antenna_position"].mean("position"))
    assert mf.reconstruct(sweep.isel(position=slice(0, 12))).attrs["mirrorfold_kind"] == "reconstruction"


def test_the_other_time_convention_is_conjugated_for_a_moving_antenna_too():
    sweep = moving()
    other = sweep.assign(s=np.conj(sweep["s"])).assign_attrs(time_convention="exp(-jwt)")
    xr.testing.assert_identical(check_sweep(other), sweep)


@pytest.mark.filterwarnings("ignore:y reaches beyond the ambiguous range")
def test_the_wave_speed_of_a_sweep_is_that_of_its_image():
    sweep = moving(wave_speed=2e8)
    x, y = np.arange(0.0, 0.2, 0.01), np.arange(0.9, 1.1, 0.01)
    image = mf.focus(sweep, x=x, y=y)
    assert image.attrs["wave_speed"] == 2e8
    assert ambiguous_range(sweep) == pytest.approx(2e8 / (2 * 0.1e9))
    np.testing.assert_array_equal(image, mf.focus(sweep, x=x, y=y, wave_speed=2e8))
    peak = np.unravel_index(np.abs(image.values).argmax(), image.shape)
    assert y[peak[0]] == pytest.approx(1.0, abs=0.011)


def test_one_element_sees_ranges_and_nothing_else():
    sweep = moving(positions=1)
    y = np.arange(0.5, 1.4, 0.002)
    profile = np.abs(mf.focus(sweep, x=0.0, y=y).values[:, 0])
    assert y[profile.argmax()] == pytest.approx(np.hypot(0.101, 1.0), abs=0.006)
    with pytest.raises(InputError, match="one element"):
        mf.focus(sweep, x=[0.0, 0.1], y=y)
    with pytest.raises(InputError, match="one element"):
        mf.focus(sweep)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"wave_speed": -1.0}, "wave_speed is -1.0"),
        ({"wave_speed": 1e-300}, "wave_speed is 1e-300, expected a number of at least 1"),
        ({"polarization": np.array([1.0, 2.0])}, "polarization is an array"),
        ({"polarization": ["TE"]}, "polarization is"),
        ({"wave_speed": True}, "wave_speed is True"),
        ({"wave_speed": "fast"}, "wave_speed is 'fast'"),
        ({"scene_center": [1.0, 2.0]}, "scene_center"),
        ({"scene_center": "here"}, "scene_center"),
    ],
)
def test_attrs_that_make_no_sense_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        check_sweep(moving().assign_attrs(change))


@pytest.mark.parametrize(
    ("name", "said", "unit"), [("frequency", "GHz", "Hz"), ("tx_position", "mm", "m"), ("rx_position", "inch", "m")]
)
def test_coordinates_whose_own_unit_is_another_are_refused_and_repaired(sweep, name, said, unit, tmp_path, capsys):
    told = sweep.assign_coords({name: sweep[name].assign_attrs(units=said)})
    with pytest.raises(InputError, match=rf"{name} is in {said}, .* expected {unit}"):
        check_sweep(told)
    factor = UNITS[said]
    told = told.assign_coords({name: told[name].copy(data=told[name].values / factor)})
    if name != "frequency":  # both sides are in millimetres
        other = {"tx_position": "rx_position", "rx_position": "tx_position"}[name]
        told = told.assign_coords({other: told[other].copy(data=told[other].values / factor)})
    told.to_netcdf(tmp_path / "told.nc", engine="h5netcdf")
    kind = "frequency" if name == "frequency" else "position"
    command = ["calibrate", str(tmp_path / "told.nc"), f"--{kind}-unit", said, "-o", str(tmp_path / "out.nc")]
    assert main(command) == 0, capsys.readouterr().err
    np.testing.assert_allclose(mf.load(tmp_path / "out.nc")[name], sweep[name], rtol=1e-12)


def test_a_moving_antenna_without_places_is_refused():
    with pytest.raises(InputError, match="antenna_position"):
        check_sweep(moving().drop_vars("antenna_position"))
    with pytest.raises(InputError, match="shapes"):
        make_monostatic_sweep(np.ones((3, 4), complex), frequency=[1.0, 2.0, 3.0], antenna_position=np.zeros((5, 3)))


def test_the_beam_of_a_scan_may_be_written_with_units():
    given = {"frequency": 290e9 + 1e8 * np.arange(4), "azimuth": [-4.0, 0.0, 4.0], "elevation": [-2.0, 2.0]}
    samples = np.exp(1j * np.arange(24)).reshape(4, 3, 2)
    scan = mf.make_raster_sweep(samples, **given, spot_radius="17 mm", focus_distance="3 m")
    assert (scan.attrs["spot_radius"], scan.attrs["focus_distance"]) == (0.017, 3.0)
    with pytest.raises(InputError, match="spot_radius: '17 GHz' is no length"):
        mf.make_raster_sweep(samples, **given, spot_radius="17 GHz")
    for wrong in ("wide", -0.01, np.nan, [0.01, 0.02]):
        with pytest.raises(InputError, match=r"attr spot_radius is .* expected a positive number of metres"):
            check_sweep(scan.assign_attrs(spot_radius=wrong))


@pytest.mark.parametrize(
    ("azimuth", "elevation", "said"),
    [
        ([0.0, -1.0, 2.0], [0.0, 1.0], "azimuth must rise from beam to beam; sort the beams"),
        ([0.0, 180.0, 360.0], [0.0, 1.0], "azimuth goes from 0 to 360, expected less than a full turn"),
        ([170.0, 180.0, 190.0], [80.0, 90.0], "elevation goes from 80 to 90, expected .* less than 90"),
    ],
)
def test_directions_that_no_scan_has_are_refused(azimuth, elevation, said):
    samples, frequency = np.ones((4, 3, 2), complex), 290e9 + 1e8 * np.arange(4)
    with pytest.raises(InputError, match=said):
        mf.make_raster_sweep(samples, frequency=frequency, azimuth=azimuth, elevation=elevation)


@pytest.mark.parametrize("middle", [90.0, 180.0, 359.0])
def test_a_scan_may_look_anywhere(middle):
    """A turntable counts from 0 to 360 degrees; the radar may look back."""
    frequency, azimuth = 290e9 + 1e8 * np.arange(64), np.linspace(-2.0, 2.0, 5)
    samples = np.exp(-4j * np.pi / 299792458.0 * frequency[:, None, None] * 0.8) * np.ones((5, 5))
    given = {"frequency": frequency, "elevation": azimuth}
    ahead, there = (mf.focus(mf.make_raster_sweep(samples, azimuth=azimuth + turn, **given)) for turn in (0.0, middle))
    np.testing.assert_array_equal(there.values, ahead.values)
    np.testing.assert_allclose(there["azimuth"], azimuth + middle)
