"""The Sweep contract: what is accepted, what is refused and in which words, what it resolves, noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from mirrorfold.errors import InputError
from mirrorfold.sweep import (
    add_noise,
    ambiguous_range,
    check_sweep,
    frequency_step,
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
        (lambda s: s.assign(s=abs(s["s"])), "expected complex numbers"),
        (lambda s: s.isel(axis=slice(2)), "three axes"),
        (lambda s: s.assign_coords(tx_position=s["tx_position"] * np.nan), "tx_position holds values"),
        (lambda s: s.assign_coords(frequency=-s["frequency"]), "not positive"),
        (lambda s: s.isel(frequency=slice(None, None, -1)), "equal rising steps"),
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


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="shapes do not fit"):
        make_sweep(np.ones((3, 2, 2)), frequency=[1, 2, 3], tx_position=np.zeros((5, 3)), rx_position=np.zeros((2, 3)))


def test_the_other_time_convention_is_conjugated(sweep):
    other = sweep.assign(s=np.conj(sweep["s"])).assign_attrs(time_convention="exp(-jwt)")
    converted = check_sweep(other)
    assert converted.attrs["time_convention"] == "exp(+jwt)"
    assert_array_equal(converted["s"].values, sweep["s"].values)


def test_what_a_band_resolves(sweep):
    assert frequency_step(sweep) == pytest.approx(250e6)
    assert ambiguous_range(sweep) == pytest.approx(0.59958492)
    assert range_resolution(sweep) == pytest.approx(0.59958492 / 41)
    assert ambiguous_range(sweep.isel(frequency=[0])) == 0.0


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


def test_noise_is_reproducible_and_leaves_the_sweep_alone(sweep):
    before = sweep["s"].values.copy()
    first, again, other = (add_noise(sweep, snr_db=10, seed=seed)["s"].values for seed in (1, 1, 2))
    assert_array_equal(first, again)
    assert (first != other).any()
    assert_array_equal(sweep["s"].values, before)
