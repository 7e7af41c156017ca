"""Proposals of mappings: what is recognised by its name and shape, what is said to be missing, and the command."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from point_target import AXES, echo, line_of, same
from profiles import examples
from scipy.io import savemat

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.io.guessing.guess import guess_mapping
from mirrorfold.io.guessing.proposal import Guess

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(30))


@pytest.mark.slow
@ONE_FILE
@given(
    names=st.sampled_from(
        [
            ("S", "freq", "tx_pos", "rx_pos"),
            ("data", "f", "txLocations", "rxLocations"),
            ("meas.s21", "meas.frequency", "meas.tx_position", "meas.rx_position"),
        ]
    ),
    order=st.permutations(AXES),
    unit=st.sampled_from([1.0, 1e9]),
)
def test_a_proposal_for_a_plain_file_makes_the_right_sweep(tmp_path, measured, names, order, unit):
    f, tx, rx, s = measured
    values = (s.transpose([AXES.index(name) for name in order]), f / unit, tx, rx)
    content: dict = {}
    for name, value in zip(names, values, strict=True):
        group, _, leaf = name.rpartition(".")
        (content.setdefault(group, {}) if group else content)[leaf] = value
    savemat(tmp_path / "d.mat", content)
    guess = guess_mapping(tmp_path / "d.mat")
    assert guess.works
    (tmp_path / "m.toml").write_text(guess.to_toml())
    same(mf.import_data(tmp_path / "d.mat", mapping=tmp_path / "m.toml"), f, tx, rx, s)


def test_proposals_recognise_magnitudes_and_phases_millimetres_and_coordinates_one_by_one(tmp_path, measured):
    f, tx, rx, s = measured
    content = {
        "S21_dB": 20 * np.log10(2 * np.abs(s)),
        "S21_phase": np.degrees(np.angle(s)),
        "f_start": 290.0,
        "f_stop": 300.0,
    }
    content |= {"tx_x": tx[:, 0] * 1e3, "rx_x": rx[:, 0] * 1e3, "tx_y": tx[:, 1], "rx_y": rx[:, 1]}
    savemat(tmp_path / "d.mat", content)
    guess = guess_mapping(tmp_path / "d.mat")
    assert guess.works, guess.to_toml()
    same(mf.import_data(tmp_path / "d.mat", mapping=guess.entries), f, tx, rx, 2 * s)


@pytest.mark.parametrize("unit", ["degree", "radian"])
def test_proposals_recognise_raster_scans(tmp_path, unit):
    rng = np.random.default_rng(1)
    azimuth, elevation, f = np.linspace(-15, 15, 7), np.linspace(-10, 10, 5), np.linspace(270e9, 300e9, 9)
    s = rng.standard_normal((7, 5, 9)) + 1j * rng.standard_normal((7, 5, 9))
    turn = np.radians if unit == "radian" else np.asarray
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["raw/s11"], file["raw/az"], file["raw/el"], file["raw/frequencies"] = s, turn(azimuth), turn(elevation), f
    guess = guess_mapping(tmp_path / "d.h5")
    assert guess.works, guess.to_toml()
    sweep = mf.import_data(tmp_path / "d.h5", mapping=guess.entries)
    np.testing.assert_allclose(sweep["azimuth"], azimuth)
    np.testing.assert_allclose(sweep["s"].values, s.transpose(2, 0, 1), rtol=1e-5)


def test_a_proposal_says_what_it_does_not_know(tmp_path, measured):
    _, _, _, s = measured
    np.savez(tmp_path / "d.npz", s=s)
    guess = guess_mapping(tmp_path / "d.npz")
    assert not guess.works
    assert any("band" in sentence for sentence in guess.missing)
    assert "TO DO" in guess.to_toml()
    assert all(finding.sure in ("sure", "likely", "a guess") for finding in guess.findings)


def test_what_a_proposal_lacks_can_be_added_at_its_end(tmp_path, measured):
    f, tx, rx, s = measured
    np.savez(tmp_path / "d.npz", s=s, tx_pos=tx, rx_pos=rx)
    guess = guess_mapping(tmp_path / "d.npz")
    assert any("[frequency]" in sentence for sentence in guess.missing)
    band = '[frequency]\nstart = 290.0\nstop = 300.0\npoints = 21\nunit = "GHz"\n'
    (tmp_path / "m.toml").write_text(guess.to_toml() + band)
    same(mf.import_data(tmp_path / "d.npz", mapping=tmp_path / "m.toml"), f, tx, rx, s)


def test_a_proposal_writes_any_name_so_that_it_is_read_again():
    name = 'a "quoted"\\path\n\x7f\u00fc'
    guess = Guess(Path("d.npz"), entries={"s": {"variable": name, "dims": ["frequency"]}, "reciprocal": True})
    assert tomllib.loads(guess.to_toml()) == guess.entries


@pytest.mark.slow
def test_proposals_for_real_files_make_sweeps(shared_data, tmp_path):
    for name in ("arim/contact_notch_aluminium.mat", "gotcha/data_3dsar_pass1_az001_HH.mat", "merit/B0_P3_p000.csv",
                 "acconeer/corner-reflector.h5"):  # fmt: skip
        guess = guess_mapping(shared_data / name)
        assert guess.works, guess.to_toml()
        (tmp_path / "m.toml").write_text(guess.to_toml())
        assert mf.import_data(shared_data / name, mapping=tmp_path / "m.toml").sizes["frequency"] > 20
    arim = guess_mapping(shared_data / "arim/contact_notch_aluminium.mat")
    assert arim.entries["pairs"] == {"tx": "exp_data.tx", "rx": "exp_data.rx", "base": 1}
    assert arim.entries["wave_speed"] == "exp_data.ph_velocity"
    gotcha = guess_mapping(shared_data / "gotcha/data_3dsar_pass1_az001_HH.mat")
    assert gotcha.entries["compensation"] == {"range": "data.r0"}


def test_the_command_imports_by_a_proposed_mapping(npz, tmp_path, capsys):
    assert main(["import", "--guess", str(npz), "-o", str(tmp_path / "m.toml")]) == 0
    assert "dims" in capsys.readouterr().out
    out = tmp_path / "s.nc"
    assert main(["import", str(npz), "--mapping", str(tmp_path / "m.toml"), "-o", str(out), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["dimensions"] == {"frequency": 21, "tx": 5, "rx": 7}
    assert mf.load(out).attrs["command"].startswith("mirrorfold import ")
    assert main(["import", "--guess", str(npz), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["works"].startswith("s(frequency 21, tx 5, rx 7)")


@pytest.mark.parametrize("axis", [0, -1])
def test_a_proposal_knows_an_axis_of_real_and_imaginary_parts(tmp_path, measured, axis):
    f, tx, rx, s = measured
    np.savez(tmp_path / "d.npz", cube=np.stack([s.real, s.imag], axis), f=f, tx=tx, rx=rx)
    guess = guess_mapping(tmp_path / "d.npz")
    assert not guess.missing
    same(mf.import_data(tmp_path / "d.npz", mapping=guess.entries), f, tx, rx, s)


def test_a_proposal_is_not_sure_of_axes_of_equal_length(tmp_path, measured):
    f, tx, _, _ = measured
    rx = line_of(f.size)
    np.savez(tmp_path / "d.npz", s=echo(f, tx, rx), f=f, tx_pos=tx, rx_pos=rx)
    text = guess_mapping(tmp_path / "d.npz").to_toml()
    assert "a guess: axis 0 is frequency" in text
    assert "sure: axis 0" not in text
    np.savez(tmp_path / "d.npz", s=echo(f, tx, tx), f=f, tx_pos=tx, rx_pos=tx)
    text = guess_mapping(tmp_path / "d.npz").to_toml()
    assert "sure: axis 0 is frequency" in text
    assert "a guess: axis 1 is tx and axis 2 rx" in text
