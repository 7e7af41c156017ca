"""Benchmarks are no part of the package, but go with it: each says what it does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.scenes.families import FAMILIES, draw, radars_of

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.slow
@pytest.mark.parametrize("script", ["ablation", "confidence"])
def test_what_a_benchmark_imports_is_there(script):
    done = subprocess.run(
        [sys.executable, str(FOLDER / f"{script}.py"), "--help"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "--sweeps" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("script", ["from_file_to_report", "looking", "physical_optics", "touchstone"])
def test_a_benchmark_without_options_says_what_it_does_and_does_nothing(script):
    run = [sys.executable, str(FOLDER / f"{script}.py"), "--help"]
    done = subprocess.run(run, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout[:6]) == (0, "usage:"), done.stderr


@pytest.mark.slow
def test_a_mutant_is_tried_where_the_tests_accept_the_module_as_it_is():
    module, tests = "src/mirrorfold/tree/completion.py", "tests/tree/test_completion.py"
    words = [sys.executable, "benchmarks/mutants.py", module, "--tests", tests, "--sample", "1"]
    done = subprocess.run(words, cwd=FOLDER.parent, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout
    assert f"{module}: 1 of " in done.stdout


def test_an_ablation_leaves_out_what_steps_2_to_4_use(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    from ablation import WITHOUT

    replaced = [(home, name) for instead, _ in WITHOUT.values() for home, names in instead.items() for name in names]
    assert len(replaced) >= 6
    for home, name in replaced:
        assert hasattr(home, name), f"{home.__name__} does not use {name}"


@pytest.mark.slow
def test_a_scene_is_folded_without_all_parts_at_once(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    from ablation import WITHOUT

    for instead, _ in WITHOUT.values():
        for home, names in instead.items():
            for name, other in names.items():
                monkeypatch.setattr(home, name, other)
    scene = draw(FAMILIES["two walls"], 0, radar=radars_of(FAMILIES["two walls"])[2])
    sweep = mf.simulate(scene)
    assert mf.score(mf.fold(mf.focus(sweep), sweep=sweep), scene).points > 0


@pytest.mark.slow
def test_another_generator_shows_a_disc_where_it_stands_and_its_side_in_a_wall(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    from physical_optics import Radar, outline, simulated, wall

    disc = outline(np.array([0.0, 1.0]), np.full(2, 0.1), 0.0, 48)
    beside = wall(np.array([0.4, 0.8]), 1.0, np.pi / 2.0)
    radar = Radar(76e9, 81e9, 81, 0.06)
    sweep, found, seen = simulated(([beside], [disc]), radar, 0.5, np.random.default_rng(0))
    s = sweep["s"].values
    assert np.abs(s - s.swapaxes(1, 2)).max() < 0.2 * np.abs(s).max()  # but for noise, both ways are the same
    image = abs(mf.focus(sweep, x=np.arange(-0.3, 0.3, 0.01), y=np.arange(0.5, 1.3, 0.01)))
    brightest = image.isel(image.argmax(...))
    assert float(brightest.y) == pytest.approx(0.9, abs=0.03)
    assert float(brightest.x) == pytest.approx(0.0, abs=0.03)
    on_disc = found.strip >= found.walls
    assert found.place[on_disc & seen[()], 1].max() < 1.05
    in_wall = on_disc & seen[(0,)]
    assert found.place[in_wall, 0].min() > -0.08
    assert np.any(in_wall & ~seen[()])
