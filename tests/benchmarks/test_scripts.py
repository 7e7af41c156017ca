"""Benchmarks are no part of the package, but go with it: each says what it does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

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
@pytest.mark.parametrize("script", ["from_file_to_report", "looking", "touchstone"])
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
