"""The first day of a student: README and quickstart in an empty folder, from top to bottom."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from pages import play, steps

import mirrorfold as mf

FIRST_PICTURE = 120.0
"""Seconds of work until the first picture is there."""


def played(page, capsys, names):
    """Run all of a page but what installs and what waits for a browser; seconds of CPU of each command."""
    took = {}
    for step in steps(page):
        if step.kind == "console" and not step.text.startswith("mirrorfold"):
            continue
        if step.text.startswith("mirrorfold view"):
            assert Path(step.text.split()[2]).is_file()
            continue
        start = time.process_time()
        play(step, capsys, names)
        took[step.text] = time.process_time() - start
    return took


@pytest.mark.replay
@pytest.mark.slow
def test_the_quickstart_ends_in_pictures(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names = {}
    took = played("docs/quickstart.md", capsys, names)
    assert took["mirrorfold demo --out demo"] < FIRST_PICTURE * (os.cpu_count() or 1)
    for picture in ("demo/before_after.png", "out/before_after.png", "before_after.png"):
        assert Path(picture).stat().st_size > 10_000
    truth = mf.load_scene("demo/hidden_corner.toml")
    for path in ("demo/reconstruction.nc", "out/reconstruction.nc", "reconstruction.nc"):
        assert mf.score(mf.load(path), truth)["hidden"]["f_score_2cm"] > 0.9


@pytest.mark.replay
@pytest.mark.slow
def test_the_readme_runs_on_a_folder_of_touchstone_files(tmp_path, monkeypatch, capsys, scene_file):
    """`make demo` is the quickstart's first command; here is the rest, on a sweep of one's own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    mf.save_touchstone(mf.simulate(mf.load_scene(scene_file)), tmp_path / "scan")
    (tmp_path / "scan" / "positions.csv").rename("positions.csv")
    for step in steps("README.md"):
        if step.text.startswith(("mirrorfold demo", "mirrorfold view")):
            continue
        play(step, capsys, {})
    for picture in ("out/before_after.png", "out/report.html", "before_after.png"):
        assert Path(picture).stat().st_size > 10_000
