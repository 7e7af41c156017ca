"""Many sweeps in one command: each in its own folder, one summary, and a bad one spoils nothing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.many import folder_names
from mirrorfold.cli.schema import check

GRID = ["--x", "-0.2:0.2:0.01", "--y", "0.2:0.55:0.01"]


@pytest.fixture
def folder(tmp_path, monkeypatch, sweep):
    monkeypatch.chdir(tmp_path)
    for name in ("a.nc", "b.nc"):
        mf.save(sweep, name)
    (tmp_path / "bad.nc").write_text("no sweep")
    return tmp_path


@pytest.mark.slow
def test_a_bad_file_is_named_and_the_others_are_done(folder, capsys):
    assert main(["reconstruct", "a.nc", "bad.nc", "b.nc", "-o", "out", *GRID, "--json"]) == 2
    printed = capsys.readouterr()
    assert json.loads(printed.err)["error"] == "1 of 3 sweeps could not be reconstructed: bad.nc"
    found = check("reconstruct", printed.out)
    assert [result.sweep for result in found.results] == ["a.nc", "bad.nc", "b.nc"]
    assert "not a netCDF-4 file" in found.results[1].error
    assert found.results[1].files == []
    alone = mf.reconstruct(mf.load("a.nc"), x=mf.load("out/a/reconstruction.nc")["x"].values, y=mf.load(
        "out/a/reconstruction.nc")["y"].values)  # fmt: skip
    for result in (found.results[0], found.results[2]):
        assert result.error is None
        assert result.points == alone["objects"].sizes["point"] > 0
        assert all(Path(file).is_file() for file in result.files)
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["a", "b"]


@pytest.mark.slow
def test_the_summary_is_a_table(folder, capsys):
    assert main(["reconstruct", "a.nc", "b.nc", "-o", "out", *GRID]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["sweep", "mirrors", "points", "by", "mirrors", "result"]
    assert [line.split()[0] for line in lines[2:]] == ["a.nc", "b.nc"]
    assert lines[2].split()[-1] == "out/a"


@pytest.mark.slow
def test_an_interrupted_command_says_what_is_done(folder, capsys, monkeypatch):
    real, calls = mf.reconstruct, []

    def once(sweep, **given):
        if calls:
            raise KeyboardInterrupt
        calls.append(1)
        return real(sweep, **given)

    monkeypatch.setattr(mf, "reconstruct", once)
    assert main(["reconstruct", "a.nc", "b.nc", "-o", "out", *GRID]) == 130
    assert "1 of 2 sweeps are done, in out" in capsys.readouterr().err
    assert (folder / "out/a/report.html").is_file()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "there is not enough memory"),
        (OSError(28, "No space left on device", "out/a/x"), r"out/a/x: cannot be read .*\(No space .*make room"),
    ],
)
def test_trouble_of_the_machine_is_a_sentence_in_the_summary_too(folder, capsys, monkeypatch, error, words):
    def fail(sweep, **given):
        raise error

    monkeypatch.setattr(mf, "reconstruct", fail)
    assert main(["reconstruct", "a.nc", "b.nc", "-o", "out", *GRID, "--json"]) == 2
    found = check("reconstruct", capsys.readouterr().out)
    assert all(re.match(words, result.error) for result in found.results)


def test_files_of_one_name_get_the_names_of_their_folders(folder):
    assert folder_names([Path("x/day 1/s.nc"), Path("x/day 2/s.nc")]) == ["day 1-s", "day 2-s"]
    assert folder_names([Path("x/s.nc"), Path("s.nc")]) == ["x-s", "s"]
    with pytest.raises(mf.InputError, match="each sweep once"):
        folder_names([Path("s.nc"), Path("s.nc")])


def test_one_file_for_all_is_refused(folder, capsys):
    assert main(["reconstruct", "a.nc", "b.nc", "-o", "out", "--export", "c.ply"]) == 2
    assert "several sweeps" in capsys.readouterr().err
    assert main(["reconstruct", "-o", "out"]) == 2
    assert not (folder / "out").exists()
