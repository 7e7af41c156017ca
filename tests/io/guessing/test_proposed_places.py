"""What `import --guess` makes of places: lists of pairs of two arrays, and single numbers in units of their own."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from point_target import echo, line_of, same

import mirrorfold as mf
from mirrorfold.io.guessing.guess import guess_mapping

FREQUENCY = np.linspace(290e9, 300e9, 21)


def proposed(path, **variables):
    """The proposal for a file of these variables."""
    np.savez(path, **variables)
    return guess_mapping(path)


@pytest.mark.parametrize("receivers", [5, 16])
def test_pairs_of_two_arrays_keep_the_places_of_both(tmp_path, receivers):
    tx, rx = line_of(5, pitch=2e-3), line_of(receivers, 0.01)
    s = echo(FREQUENCY, tx, rx)
    guess = proposed(
        tmp_path / "mimo.npz", adc=s.reshape(FREQUENCY.size, -1), f=FREQUENCY, tx_pos_mm=tx * 1e3, rx_pos_mm=rx * 1e3,
        tx=np.repeat(np.arange(5), receivers) + 1, rx=np.tile(np.arange(receivers), 5) + 1,
    )  # fmt: skip
    assert f"sure: channels are pairs of 5 transmitters and {receivers} receivers" in guess.to_toml()
    same(mf.import_data(tmp_path / "mimo.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


def test_pairs_whose_receivers_stand_nowhere_are_not_put_at_the_transmitters(tmp_path):
    tx, rx = line_of(4), line_of(6)
    s = echo(FREQUENCY, tx, rx).reshape(FREQUENCY.size, -1)
    numbers = {"tx": np.repeat(np.arange(4), 6), "rx": np.tile(np.arange(6), 4)}
    guess = proposed(tmp_path / "mimo.npz", adc=s, f=FREQUENCY, tx_pos=tx, **numbers)
    assert any("the places of rx were not recognised" in sentence for sentence in guess.missing)
    assert not {"tx", "rx", "elements"} & set(guess.entries)


def test_pairs_of_the_same_elements_are_likely_only(tmp_path):
    places = line_of(6)
    one, other = np.triu_indices(6)
    s = echo(FREQUENCY, places, places)[:, one, other]
    guess = proposed(tmp_path / "fmc.npz", data=s, f=FREQUENCY, tx=one + 1, rx=other + 1, el_x=places[:, 0])
    assert "likely: channels are pairs of 6 elements" in guess.to_toml()
    same(mf.import_data(tmp_path / "fmc.npz", mapping=guess.entries), FREQUENCY, places, places,
         echo(FREQUENCY, places, places))  # fmt: skip


def test_single_numbers_keep_the_units_of_their_own_names(tmp_path):
    tx, rx = line_of(7), line_of(9, 0.01) + np.array([0.0, -0.005, 0.02])
    s = echo(FREQUENCY, tx, rx)
    guess = proposed(
        tmp_path / "d.npz", s=s, f=FREQUENCY, tx_x0_m=tx[0, 0], tx_dx_mm=0.5, rx_x0_cm=rx[0, 0] * 100, rx_dx_um=500.0,
        rx_y_m=-0.005, rx_z_cm=2.0,
    )  # fmt: skip
    assert guess.works, guess.to_toml()
    same(mf.import_data(tmp_path / "d.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


@pytest.mark.parametrize(
    ("band", "receivers"),
    [
        ({"f0_GHz": 290.0, "df_GHz": 0.5, "nf": 21}, 30),  # more receivers than frequencies
        ({"f0_GHz": 290.0, "df_MHz": 500.0}, 9),
        ({"f1": 300e9, "f0": 290e9, "nf": 21}, 9),
        ({"f1": 290.0, "f2": 300.0}, 9),
        ({"f_start_GHz": 290.0, "f_step": 0.5, "f_points": 21}, 30),
    ],
)
def test_single_numbers_describe_the_band(tmp_path, band, receivers):
    tx, rx = line_of(7), line_of(receivers, 0.01)
    s = echo(FREQUENCY, tx, rx)
    guess = proposed(tmp_path / "d.npz", s=s, tx_pos=1e3 * tx, rx_pos=1e3 * rx, **band)
    same(mf.import_data(tmp_path / "d.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


@pytest.mark.parametrize("first", ["tx_start_mm", "tx_first_mm", "tx_min_mm", "tx_x_start_mm", "start_tx_mm"])
def test_the_first_place_has_one_of_many_names(tmp_path, first):
    tx, rx = line_of(7, 0.02), line_of(9, 0.04) + np.array([0.0, 0.0, 0.015])
    s = echo(FREQUENCY, tx, rx)
    names = {first: tx[0, 0] * 1e3, first.replace("tx", "rx"): rx[0, 0] * 1e3}
    guess = proposed(
        tmp_path / "d.npz", s=s, fGHz=FREQUENCY / 1e9, tx_step_mm=0.5, rx_pitch_mm=0.5, rx_height_mm=15.0, **names,
        start=290.0, min=290.0, rx_depth_mm=3.0,
    )  # fmt: skip
    assert "a guess: 'rx_depth_mm' is not used" in guess.to_toml()
    same(mf.import_data(tmp_path / "d.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


def test_coordinates_one_by_one_keep_the_units_of_their_own_names(tmp_path):
    tx, rx = line_of(7), line_of(9, 0.01) + np.array([0.0, -0.005, 0.0])
    s = echo(FREQUENCY, tx, rx)
    guess = proposed(
        tmp_path / "d.npz", s=s, f=FREQUENCY, tx_x_cm=tx[:, 0] * 100, rx_x_mm=rx[:, 0] * 1e3, rx_y_m=rx[:, 1]
    )
    same(mf.import_data(tmp_path / "d.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


def test_the_few_transmitters_of_a_mimo_radar_are_in_millimetres_too(tmp_path):
    tx, rx = line_of(3, pitch=8e-3), line_of(5, 0.01)  # eight wavelengths apart
    s = echo(FREQUENCY, tx, rx)
    guess = proposed(tmp_path / "mimo.npz", adc=s, f=FREQUENCY, tx_pos=1e3 * tx, rx_pos=1e3 * rx)
    same(mf.import_data(tmp_path / "mimo.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


@pytest.mark.parametrize("transmitters", [1, 6])
@pytest.mark.parametrize("axis_of_one", [False, True])
def test_one_fixed_antenna_and_many_of_the_other_side_are_pairs(tmp_path, transmitters, axis_of_one):
    tx, rx = line_of(transmitters) + np.array([0.0, 0.0, 0.02]), line_of(7 - transmitters, 0.01)
    s = echo(FREQUENCY, tx, rx)
    measured = s if axis_of_one else s.reshape(FREQUENCY.size, -1)
    guess = proposed(tmp_path / "d.npz", s=measured, f=FREQUENCY, tx_pos=1e3 * tx, rx_pos=1e3 * rx)
    assert f"pairs of one {'tx and 6 rx' if transmitters == 1 else 'rx and 6 tx'}" in guess.to_toml()
    same(mf.import_data(tmp_path / "d.npz", mapping=guess.entries), FREQUENCY, tx, rx, s)


def test_lengths_of_netcdf_dimensions_are_no_places(tmp_path):
    tx, rx = line_of(5), line_of(9, 0.01)
    s = echo(FREQUENCY, tx, rx)
    path = tmp_path / "scan.nc"
    axes = ("f", "tx", "rx")  # the latter two have no values of their own: the file holds zeros for them
    xr.Dataset(
        {"S_re": (axes, s.real), "S_im": (axes, s.imag), "tx_x": ("tx", tx[:, 0]), "rx_x": ("rx", rx[:, 0])},
        coords={"f": ("f", FREQUENCY, {"units": "Hz"})},
    ).to_netcdf(path, engine="h5netcdf")
    guess = guess_mapping(path)
    assert [guess.entries[name]["x"] for name in ("tx", "rx")] == ["tx_x", "rx_x"]
    same(mf.import_data(path, mapping=guess.entries), FREQUENCY, tx, rx, s)
