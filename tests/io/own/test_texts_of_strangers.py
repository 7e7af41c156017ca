"""Texts in files, and names of files, may hold what no terminal, page or other file should get."""

from __future__ import annotations

import json
import os
import sys

import h5py
import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.io.own.attributes import DEEPEST, decoded, storable

BAD = b"ab\xff \x1b]0;owned\x07\x1b[2J"
SAID = "ab\ufffd \ufffd]0;owned\ufffd\ufffd[2J"


def set_title(path, value):
    with h5py.File(path, "a") as file:
        file.attrs.pop("title", None)
        file.attrs.create("title", value, dtype=h5py.string_dtype())


@pytest.mark.slow
@pytest.mark.parametrize("depth", [1, 70, 5000])
def test_a_title_that_looks_like_deep_lists_is_a_text(folder, depth):
    title = "[" * depth + "]" * depth
    for name in ("s.nc", "i.nc", "r.nc"):
        set_title(name, title)
        found = mf.load(name)
        assert isinstance(found.attrs["title"], str)
        mf.save(found, name)
    assert main(["focus", "s.nc", "-o", "o.nc"]) == 0
    assert main(["fold", "i.nc", "-o", "p.nc"]) == 0
    assert main(["info", "r.nc"]) == 0


def test_lists_and_objects_of_usual_depth_come_back():
    value = {"a": [1, {"b": [None, True, "text"]}]}
    assert decoded(storable(value)) == value
    for _ in range(DEEPEST):
        value = [value]
    assert decoded(storable(value)) == json.dumps(value)


@pytest.mark.slow
def test_a_title_that_is_no_utf8_is_read_and_written(folder, capsys):
    for name in ("s.nc", "i.nc", "r.nc"):
        set_title(name, BAD)
        assert mf.load(name).attrs["title"] == SAID
    assert main(["focus", "s.nc", "-o", "o.nc"]) == 0
    assert main(["fold", "i.nc", "-o", "p.nc"]) == 0
    assert main(["report", "r.nc", "-o", "r.html"]) == 0
    assert main(["export", "s.nc", "-o", "scan"]) == 0
    assert main(["import", "scan", "-o", "t.nc"]) == 0
    assert mf.load("t.nc").attrs["title"] == SAID
    capsys.readouterr()
    assert main(["info", "s.nc"]) == 0
    assert "\x1b" not in capsys.readouterr().out


@pytest.mark.slow
def test_variables_whose_names_are_no_utf8_are_imported_by_a_clean_name(measured, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    f, tx, rx, s = measured
    for name in ("a.h5", "a.nc"):
        with h5py.File(name, "w") as file:
            file.create_dataset(b"S\xff\x1b[2J", data=s)
            for key, values in {"f": f, "tx": tx, "rx": rx}.items():
                file[key] = values
        assert main(["import", "--guess", name, "-o", "map.toml"]) == 0
        assert main(["import", name, "--mapping", "map.toml", "-o", "o.nc"]) == 0
        np.testing.assert_allclose(mf.load("o.nc")["s"], s, atol=1e-5)
    assert main(["info", "a.nc"]) == 2
    said = capsys.readouterr()
    assert "is no UTF-8, which netCDF demands; rename it" in said.err
    assert "\x1b" not in said.out + said.err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_names_of_files_that_are_no_utf8(folder):
    name = os.fsdecode(b"a\xff.nc")
    os.rename("s.nc", name)
    assert main(["focus", name, "-o", "o.nc"]) == 0
    assert "a\ufffd.nc" in mf.load("o.nc").attrs["command"]
    assert main(["reconstruct", name, "-o", os.fsdecode(b"out\xff")]) == 0
    os.rename("r.nc", name)
    assert main(["compare", name, name, "-o", "c.html"]) == 0
    assert main(["compare", name, name, "-o", "c.png"]) == 0
    assert main(["show", name, "-o", "c.pdf"]) == 0


def test_what_a_complaint_or_a_table_quotes_steers_no_terminal(folder, scene_file, capsys):
    text = scene_file.read_text()
    scene_file.write_text(text.replace('name = "', r'name = "\u001b[2J', 1))
    assert main(["info", str(scene_file)]) == 0
    scene_file.write_text(text + '\n"\\u001b[2J" = 1\n')
    assert main(["info", str(scene_file)]) == 2
    assert main(["info", "\x1b[2J.nc"]) == 2
    assert main(["\x1b[2J"]) == 2
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert "\ufffd[2J" in said.out
