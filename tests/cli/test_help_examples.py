"""The example in the help of each verb works, and nothing is remarked."""

from __future__ import annotations

import shlex
from importlib.resources import files

import pytest

import mirrorfold as mf
from mirrorfold.cli import VERBS, main

CHAIN = ("simulate", "info", "focus", "fold", "reconstruct", "score", "report", "show", "export", "import")
"""In this order each finds what those before it have written."""


def run(verb, capsys):
    """The example of a verb; nothing on stderr but what it overwrites, and which of four parameters it takes."""
    program, *arguments = shlex.split(VERBS[verb].example)
    assert program == "mirrorfold"
    assert main(arguments) == 0
    printed = capsys.readouterr()
    remarks = [
        line for line in printed.err.splitlines() if "note: has overwritten" not in line and "S21 was taken" not in line
    ]
    assert remarks == []
    return printed.out


@pytest.mark.parametrize("verb", ["plan", "completion", "schema"])
def test_the_example_works_without_a_remark(verb, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "! " not in run(verb, capsys)


@pytest.mark.replay
@pytest.mark.slow
def test_the_examples_work_one_after_the_other(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = files("mirrorfold").joinpath("scenes", "shipped", "hidden_corner.toml").read_text(encoding="utf-8")
    assert "elements = 161" in text
    # Half the array finds the same; the demonstration is run at full size by a test of its own.
    text = text.replace("elements = 161", "elements = 91")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    for verb in CHAIN:
        if verb == "import":  # of few antennas, so that a folder of files does not take minutes
            mf.save(mf.load("sweep.nc").isel(tx=slice(0, 9), rx=slice(0, 9)), "sweep.nc")
            assert main(["export", "sweep.nc", "-o", "scan"]) == 0
            capsys.readouterr()
            (tmp_path / "scan" / "positions.csv").rename(tmp_path / "positions.csv")
        assert "! " not in run(verb, capsys)


def test_every_verb_has_an_example_that_is_tested_here_or_takes_long():
    assert set(VERBS) - {*CHAIN, "plan", "completion", "schema"} <= {
        "calibrate",  # the guide for a network analyser is run by a test of its own
        "demo",
        "view",
        "benchmark",
        "compare",
        "reproduce",
    }
