"""What `-o` may and may not replace, what is said of it, and failures for machines."""

from __future__ import annotations

import json
import os
import socket
import stat

import pytest

import mirrorfold as mf
from mirrorfold.cli import VERBS, main
from mirrorfold.io.files import check_output, directory_written_atomically, written_atomically

PLAN = ["plan", "--band", "270e9:300e9", "--points", "401", "--aperture", "0.08", "--pitch", "0.5e-3", "--range", "4"]


@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "link to a device", "folder"])
def test_nothing_but_files_is_replaced(tmp_path, kind):
    path = tmp_path / "out.nc"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    elif kind == "device":
        path = type(path)("/dev/null")
    elif kind == "link to a device":
        path.symlink_to("/dev/null")
    else:
        path.mkdir()
    before = os.lstat(path)
    with pytest.raises(mf.InputError, match="is a directory" if kind == "folder" else "would be replaced"):
        check_output(path)
    with pytest.raises(mf.InputError), written_atomically(path) as temporary:
        temporary.write_text("x")
    after = os.lstat(path)
    assert stat.S_IFMT(after.st_mode) == stat.S_IFMT(before.st_mode)
    assert after.st_ino == before.st_ino


def test_a_folder_of_results_replaces_no_pipe_either(tmp_path):
    os.mkfifo(tmp_path / "report.html")
    with pytest.raises(mf.InputError, match="would be replaced"), directory_written_atomically(tmp_path) as directory:
        (directory / "a.txt").write_text("x")
        (directory / "report.html").write_text("x")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert stat.S_ISFIFO(os.lstat(tmp_path / "report.html").st_mode)


def test_links_are_followed(tmp_path):
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "true.txt", tmp_path / "link.txt"
    link.symlink_to(target)
    for text in ("made", "overwritten"):  # the link leads nowhere at first
        with written_atomically(link) as temporary:
            assert temporary.parent == target.parent  # on the same disk, so that renaming is atomic
            temporary.write_text(text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert sorted(path.name for path in target.parent.iterdir()) == ["true.txt"]
    with directory_written_atomically(tmp_path) as directory:
        (directory / "link.txt").write_text("of a folder")
    assert link.is_symlink()
    assert target.read_text() == "of a folder"
    (tmp_path / "loose").symlink_to(tmp_path / "absent" / "file")
    with pytest.raises(mf.InputError, match="does not exist; make it first"):
        check_output(tmp_path / "loose")


@pytest.mark.slow
def test_what_is_overwritten_is_said_and_no_clobber_refuses(folder, capsys):
    arguments = ["export", "sweep.nc", "-o", "scan"]
    assert main(arguments) == 0
    assert capsys.readouterr().err == ""
    assert main(arguments) == 0
    assert capsys.readouterr().err == "mirrorfold: note: has overwritten scan/positions.csv, scan/scan.toml\n"
    before = {path: path.stat().st_mtime_ns for path in (folder / "scan").iterdir()}
    assert main([*arguments, "--no-clobber"]) == 2
    assert "positions.csv: is there already" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in (folder / "scan").iterdir()} == before
    assert main(["export", "sweep.nc", "-o", "other", "--no-clobber"]) == 0
    mf.save(mf.load("sweep.nc"), "sweep.nc")  # only the command line is careful


def test_every_verb_that_writes_takes_no_clobber(folder, capsys):
    for name in ("out.nc", "out.png", "out.html"):
        (folder / name).write_text("mine")
    (folder / "out").mkdir()
    (folder / "out" / "report.html").write_text("mine")
    (folder / "positions.csv").write_text("mine")
    for arguments in (
        ["simulate", "scene.toml", "-o", "out.nc"],
        ["calibrate", "sweep.nc", "-o", "out.nc"],
        ["import", "sweep.nc", "-o", "out.nc"],
        ["export", "sweep.nc", "-o", "."],
        ["focus", "sweep.nc", "-o", "out.nc"],
        ["fold", "image.nc", "-o", "out.nc"],
        ["reconstruct", "sweep.nc", "-o", "out"],
        ["demo", "--out", "out"],
        ["show", "image.nc", "-o", "out.png"],
        ["report", "reconstruction.nc", "-o", "out.html"],
        [*PLAN, "-o", "out.png"],
    ):
        assert main([*arguments, "--no-clobber"]) == 2, arguments
        assert "is there already, and --no-clobber is given" in capsys.readouterr().err
    assert {path.read_text() for path in folder.glob("out.*")} == {"mine"}


def test_a_page_is_no_pdf(folder, capsys):
    assert main(["report", "reconstruction.nc", "-o", "r.pdf"]) == 2
    assert "r.pdf: has the suffix '.pdf', expected .html or .htm" in capsys.readouterr().err
    with pytest.raises(mf.InputError, match=r"expected \.html"):
        mf.report(mf.load("reconstruction.nc"), "r.pdf")
    assert not (folder / "r.pdf").exists()


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb not in ("completion", "schema", "plan", "demo")])
def test_failures_of_every_verb_are_json_for_those_who_ask(folder, capsys, verb):
    other = {"score": ["scene.toml"], "report": ["-o", "o.html"], "show": ["-o", "o.png"], "view": [], "info": []}
    other["compare"] = ["image.nc"]
    assert main([verb, "absent.nc", *other.get(verb, ["-o", "o"]), "--json"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    failure = json.loads(printed.err)
    assert failure["exit_code"] == 2
    assert "absent.nc" in failure["error"]
    assert failure["remarks"] == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nope"], "'nope' is no verb, expected one of demo, simulate, import, "),
        (["infoo", "s.nc"], "'infoo' is no verb, did you mean 'info'?"),
        (["--json"], "completion, schema; options follow the verb"),
        ([""], "'' is no verb"),
    ],
)
def test_a_word_that_is_no_verb_is_answered_with_those_that_are(capsys, words, said):
    assert main(words) == 2
    found = capsys.readouterr().err
    assert said in found
    assert ", ;" not in found


def test_wrong_arguments_and_remarks_are_part_of_the_json(folder, capsys):
    for arguments in (["plan"], ["schema", "nonsense"], ["completion"], ["nonsense"], ["demo", "--out", "scene.toml"]):
        assert main([*arguments, "--json"]) == 2
        assert json.loads(capsys.readouterr().err)["exit_code"] == 2
    (folder / "out.nc").write_text("old")
    assert main(["fold", "sweep.nc", "-o", "out.nc", "--json"]) == 2  # a sweep is no image
    failure = json.loads(capsys.readouterr().err)
    assert failure["remarks"] == []
    assert (folder / "out.nc").read_text() == "old"
    assert "expected image or reconstruction" in failure["error"]


def test_what_was_overwritten_is_said_of_failures_after_that(folder, capsys, monkeypatch):
    (folder / "out.nc").write_text("old")
    (folder / "link.nc").symlink_to("out.nc")
    monkeypatch.setattr("mirrorfold.cli.importing.show_info", lambda _: 1 / 0)
    assert main(["import", "sweep.nc", "-o", "link.nc"]) == 1
    said = f"mirrorfold: note: has overwritten link.nc (a link to {folder / 'out.nc'})\n"
    assert said in capsys.readouterr().err


def test_a_failure_of_ours_is_json_too(folder, capsys, monkeypatch):
    monkeypatch.setattr("mirrorfold.describing.info.load", lambda _: 1 / 0)
    assert main(["info", "sweep.nc", "--json"]) == 1
    failure = json.loads(capsys.readouterr().err)
    assert failure["exit_code"] == 1
    assert "ZeroDivisionError" in failure["error"]
