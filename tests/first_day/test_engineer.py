"""The first day of an engineer who feeds results onward: JSON, point clouds, tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pages import play, steps

import mirrorfold as mf


@pytest.mark.slow
def test_results_go_to_other_programs(tmp_path, monkeypatch, capsys, scene_file):
    monkeypatch.chdir(tmp_path)
    mf.save(mf.simulate(mf.load_scene(scene_file)), "sweep.nc")
    names = {}
    for step in steps("docs/howto/programs.md"):
        printed = play(step, capsys, names)
        if "--json" in step.text:
            found = json.loads(printed)
            if "reconstruct" in step.text.split():
                assert set(map(str, found["files"])) >= {"out/reconstruction.nc"}
    points, mirrors = names["points"], names["mirrors"]
    assert len(points) > 3
    assert {"x0", "folded_x0", "chain", "generation"} <= set(mirrors)  # the wall of this scene is too short for one
    assert Path("points.csv").read_text().count("\n") == len(points) + 1
    for cloud in ("cloud.ply", "cloud.pcd"):
        assert Path(cloud).stat().st_size > 100
    image = mf.load("image.nc")
    brightest = np.unravel_index(np.abs(image.values).argmax(), image.shape)
    place = float(image["x"][brightest[1]]), float(image["y"][brightest[0]])
    assert np.hypot(points["x"] - place[0], points["y"] - place[1]).min() < 0.05


@pytest.mark.slow
def test_tables_have_a_row_for_each_point_and_each_mirror(tmp_path, monkeypatch, capsys, reconstruction):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    names = {"reconstruction": mf.load("r.nc")}
    (step,) = (step for step in steps("docs/howto/programs.md") if "mirrors.csv" in step.text)
    play(step, capsys, names)
    assert (len(names["points"]), len(names["mirrors"])) == (5, 1)
    assert Path("mirrors.csv").read_text().count("\n") == 2
