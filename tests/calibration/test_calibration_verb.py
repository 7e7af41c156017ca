"""The verb `calibrate`: a session of files in, a calibrated sweep with its history out, and nothing where it fails."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from point_sweeps import sweep_of, with_delays

import mirrorfold as mf
from mirrorfold.cli import main


@pytest.fixture
def session(tmp_path, monkeypatch):
    """A scene, the empty room and a sphere, measured by elements with delays of their own."""
    monkeypatch.chdir(tmp_path)
    random = np.random.default_rng(0)
    delays = random.uniform(-1e-3, 1e-3, (2, 15))
    wall = [(0.2, 1.2)]
    for name, points in (
        ("empty", wall),
        ("sphere", [*wall, (0.0, 0.8)]),
        ("scene", [*wall, (-0.1, 0.6), (0.15, 0.9)]),
    ):
        sweep = mf.calibrate.remove_cable(with_delays(sweep_of(points), *delays), -0.7)
        mf.save(sweep, f"{name}.nc")
    return tmp_path


@pytest.mark.slow
def test_a_session_from_raw_files_to_a_calibrated_sweep(session, capsys):
    options = ["--background", "empty.nc", "--cable-length", "0.7"]
    sphere = ["--sphere", "sphere.nc", "--sphere-at", "0,0.8", "--save-elements", "array.json"]
    assert main(["calibrate", "scene.nc", "-o", "clean.nc", *options, *sphere, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["files"] == ["clean.nc", "array.json"]
    assert found["elements_residual_m"] < 2e-6
    ideal = sweep_of([(-0.1, 0.6), (0.15, 0.9)])["s"].values
    clean = mf.load("clean.nc")
    error = np.abs(np.vdot(clean["s"].values, ideal)) / np.linalg.norm(clean["s"]) / np.linalg.norm(ideal)
    assert error > 0.999
    assert [step.split()[0] for step in clean.attrs["processing"][-3:]] == ["background", "cable", "delays"]
    assert clean.attrs["command"].startswith("mirrorfold calibrate scene.nc")
    assert main(["calibrate", "scene.nc", "-o", "again.nc", *options, "--elements", "array.json"]) == 0
    np.testing.assert_allclose(mf.load("again.nc")["s"], clean["s"], atol=1e-5)


@pytest.mark.slow
def test_a_calibrated_sweep_is_not_calibrated_again_with_raw_ones(session, capsys):
    sphere = ["--sphere", "sphere.nc", "--sphere-at", "0,0.8"]
    assert main(["calibrate", "scene.nc", "-o", "clean.nc", "--background", "empty.nc", *sphere]) == 0
    for options in (["--background", "empty.nc"], sphere):
        assert main(["calibrate", "clean.nc", "-o", "twice.nc", *options]) == 2
        assert "has been through the step 'background subtracted: empty.nc'" in capsys.readouterr().err
        assert not (session / "twice.nc").exists()


@pytest.mark.slow
def test_the_sphere_tells_the_cable_by_itself(session, capsys):
    given = ["--background", "empty.nc", "--sphere", "sphere.nc", "--sphere-at", "0,0.8"]
    assert main(["calibrate", "scene.nc", "-o", "clean.nc", *given, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["cable_period_m"] == pytest.approx(2.99792458)
    delays = np.random.default_rng(0).uniform(-1e-3, 1e-3, (2, 15))
    assert found["cable_length_m"] == pytest.approx(0.7 + delays.mean(axis=1).sum(), abs=1e-5)
    # Stated to a tenth it is the same, and then the sphere is not looked for elsewhere.
    assert main(["calibrate", "scene.nc", "-o", "again.nc", *given, "--cable-length", "0.65"]) == 0
    assert "(modulo 2.99792 m)" in capsys.readouterr().out
    np.testing.assert_allclose(mf.load("again.nc")["s"], mf.load("clean.nc")["s"], atol=1e-3)
    assert main(["calibrate", "scene.nc", "-o", "moved.nc", *given, "--find-displacement"]) == 2
    assert "more than the 20 mm" in capsys.readouterr().err  # delays of single elements are no displacement of all
    mf.save(mf.calibrate.remove_cable(sweep_of([(0.0, 0.8)]), -0.7), "sphere.nc")
    assert main(["calibrate", "scene.nc", "-o", "moved.nc", *given[2:], "--find-displacement"]) == 0
    printed = capsys.readouterr().out
    assert "known modulo 2.99792 m" in printed
    assert re.search(r"standard errors of the displacement: \S+, unknown, unknown mm", printed)
    np.testing.assert_allclose(mf.load("moved.nc")["rx_position"], mf.load("scene.nc")["rx_position"], atol=1e-5)


@pytest.mark.slow
def test_a_gate_and_the_displacement_are_applied(session):
    assert main(["calibrate", "scene.nc", "-o", "gated.nc", "--gate", "0.3:", "--rx-displacement", "0.001,0"]) == 0
    gated, raw = mf.load("gated.nc"), mf.load("scene.nc")
    np.testing.assert_allclose(gated["rx_position"] - raw["rx_position"], np.tile([1e-3, 0, 0], (15, 1)), atol=1e-12)
    assert "time gate from 0.3" in gated.attrs["processing"][-1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--sphere", "sphere.nc"], "--sphere needs --sphere-at"),
        (["--sphere-at", "0,1"], "--sphere-at needs --sphere"),
        (["--sphere", "sphere.nc", "--sphere-at", "0"], "expected X,Y"),
        (["--sphere", "sphere.nc", "--sphere-at", "0,1", "--sphere-at", "0,2"], "one place for each sweep"),
        (["--reference", "sphere.nc"], "--reference needs --reference-at"),
        (["--match-background"], "--match-background needs --background"),
        (["--save-elements", "a.json"], "--save-elements needs --sphere"),
        (["--gate", "0.3"], "START:STOP"),
        (["--gate", "9:1"], "expected 0 <= start < stop"),
        (["--elements", "scene.nc"], "is no text"),
        (["--elements", "absent.json"], "absent.json"),
        (["--background", "absent.nc"], "absent.nc: does not exist"),
        (["--background", "scene.nc"], "nothing is left"),
        (["--position-unit", "parsec"], "parsec"),
        (["--cable-length", "nan"], "cable-length"),
        (["--sphere", "sphere.nc", "--sphere-at", "0,3", "--cable-length", "0.7"], "not heard"),
    ],
)
def test_wrong_options_are_one_sentence_and_leave_nothing(session, capsys, options, words):
    before = sorted(path.name for path in session.iterdir())
    assert main(["calibrate", "scene.nc", "-o", "out.nc", *options]) == 2
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.err.count("\n") == 1
    assert sorted(path.name for path in session.iterdir()) == before


def test_no_file_is_named_for_two_outputs(session, capsys):
    sphere = ["--sphere", "sphere.nc", "--sphere-at", "0,0.8", "--save-elements", "./out.nc"]
    assert main(["calibrate", "scene.nc", "-o", "out.nc", *sphere]) == 2
    assert "out.nc: is named for two outputs" in capsys.readouterr().err


def test_autofocus_of_a_raster_scan_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    axes = {"frequency": np.linspace(290e9, 300e9, 16), "azimuth": np.arange(4.0), "elevation": np.arange(2.0)}
    mf.save(mf.make_raster_sweep(np.ones((16, 4, 2), np.complex64), **axes), "scan.nc")
    assert main(["calibrate", "scan.nc", "-o", "out.nc", "--autofocus"]) == 2
    assert "autofocus: is a raster scan, expected a sweep with s(frequency, tx, rx)" in capsys.readouterr().err


def test_the_raw_file_is_never_overwritten(session, capsys):
    assert main(["calibrate", "scene.nc", "-o", "scene.nc", "--conjugate"]) == 2
    assert main(["calibrate", "scene.nc", "-o", "empty.nc", "--background", "empty.nc"]) == 2
    assert "is the input itself" in capsys.readouterr().err
