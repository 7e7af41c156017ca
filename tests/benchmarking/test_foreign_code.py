"""Families and methods of others: what they print stays off stdout, and what cannot work is refused before any work."""

from __future__ import annotations

import os
import sys
from dataclasses import replace

import pytest
import small_benchmark
from small_benchmark import RADAR, WALL, one_wall

import mirrorfold as mf
from mirrorfold.scenes.families import drawing


def run(*methods, families=WALL, **more):
    names = [f"small_benchmark:{name}" for name in methods]
    return mf.benchmark(families, radars=RADAR, methods=names, seeds=[0], **more)


@pytest.fixture(autouse=True)
def forget():
    small_benchmark.calls.clear()


def test_what_compiled_code_and_programs_print_is_not_on_stdout(capfd):
    print("before", file=sys.__stdout__)
    assert run("shouts").results[0].errors == []
    os.write(1, b"after\n")
    out, err = capfd.readouterr()
    assert out == "before\nafter\n"
    assert sorted(err.split()) == ["back", "compiled", "held", "program"]


def speaking_wall(random, radar):
    print("a family speaks")
    return one_wall(random, radar)


def test_what_a_family_prints_is_not_on_stdout(capsys):
    assert run("nothing", families=replace(WALL, make=speaking_wall)).results[0].errors == []
    out, err = capsys.readouterr()
    assert (out, set(err.splitlines())) == ("", {"a family speaks"})


def test_a_radar_that_sees_too_little_is_refused(monkeypatch):
    """RADAR is unambiguous up to 0.9 m, and the objects between two walls are farther away."""
    monkeypatch.setattr(drawing, "DRAWS", 20)
    with pytest.raises(mf.InputError, match="radar 'small' cannot see family 'two walls': in each of 20 draws"):
        run("nothing", families=[WALL, "two walls"])
    assert small_benchmark.calls == []


def test_a_family_with_a_radar_of_the_other_kind_is_refused():
    with pytest.raises(mf.InputError, match="radar 'scanner' cannot see family 'small wall', expected one of: 300 GHz"):
        run("nothing", families=replace(WALL, radar="scanner"))


def test_a_family_that_other_processes_cannot_get_is_refused():
    family = replace(WALL, make=lambda random, radar: one_wall(random, radar))
    assert run("nothing", families=family).results[0].errors == []
    with pytest.raises(mf.InputError, match="family 'small wall': cannot be sent to another process"):
        run("nothing", families=family, jobs=2)


def test_nothing_is_made_where_a_folder_is_refused(tmp_path):
    with pytest.raises(mf.InputError, match="is no folder"):
        run("nothing", output=tmp_path / "out", sweeps=__file__)
    assert not (tmp_path / "out").exists()


def test_a_line_that_is_nested_too_deeply_is_made_again(tmp_path):
    run("nothing", output=tmp_path)
    file = tmp_path / "scenes.jsonl"
    file.write_text("[" * 100_000 + "\n" + file.read_text())
    with pytest.warns(UserWarning, match="1 of 2 lines are damaged"):
        run("nothing", output=tmp_path)
