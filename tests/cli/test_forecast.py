"""Dry runs say what focusing and reconstructing would take, in numbers that its schema knows, and write nothing."""

from __future__ import annotations

import json

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.cli.terminal import duration


@pytest.fixture
def sweep(tmp_path):
    position = np.zeros((9, 3))
    position[:, 0] = 0.5e-3 * np.arange(9)
    rng = np.random.default_rng(0)
    s = rng.standard_normal((21, 9, 9)) + 1j
    made = mf.make_sweep(s, frequency=np.linspace(296e9, 300e9, 21), tx_position=position, rx_position=position)
    return mf.save(made, tmp_path / "sweep.nc")


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["focus", "reconstruct"])
def test_a_dry_run_says_what_it_would_take(verb, sweep, capsys):
    given = [verb, str(sweep), "--x", "-0.2:0.2:0.01", "--y", "0.2:0.5:0.01", "--dry-run"]
    assert main([*given, "--json"]) == 0
    printed = capsys.readouterr().out
    check(verb, printed)
    found = json.loads(printed)
    assert found["algorithm"] == "exact"
    assert found["pixels"] == 41 * 31
    assert found["focusing_s"] > 0.0
    assert ("folding_s" in found) == (verb == "reconstruct")
    assert main(given) == 0
    assert "no plan pays" in capsys.readouterr().out
    assert [path.name for path in sweep.parent.iterdir()] == ["sweep.nc"]


def test_a_dry_run_refuses_a_scan_of_one_row_as_the_run_does(tmp_path, capsys):
    s = np.ones((21, 9, 1)) + 1j * np.linspace(0.0, 1.0, 9)[:, None]
    scan = mf.make_raster_sweep(s, frequency=np.linspace(90e9, 91e9, 21), azimuth=np.arange(9.0), elevation=np.zeros(1))
    given = ["reconstruct", str(mf.save(scan, tmp_path / "row.nc"))]
    assert main([*given, "--dry-run"]) == 2
    foreseen = capsys.readouterr().err
    assert main([*given, "-o", str(tmp_path / "out")]) == 2
    assert foreseen.strip().splitlines()[-1] == capsys.readouterr().err.strip().splitlines()[-1]
    volume = mf.save(mf.focus(scan), tmp_path / "volume.nc")
    assert main(["fold", str(volume), "--dry-run"]) == 2
    assert "axis elevation needs a coordinate [m or degree] with at least 4 pixels" in capsys.readouterr().err


def test_without_a_dry_run_an_output_is_needed(sweep, capsys):
    assert main(["focus", str(sweep)]) == 2
    assert "--output is missing" in capsys.readouterr().err


def test_times_are_said_as_people_say_them():
    assert duration(1560.0) == "26 min"
    assert duration(0.35) == "0.35 s"
