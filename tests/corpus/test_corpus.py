"""What once escaped is refused in its sentence, in little time; a few new cases of `make fuzz` beside it."""

from __future__ import annotations

import importlib
import shlex
import shutil
import time
import tomllib
from pathlib import Path

import pytest

from mirrorfold.cli import main

FOLDER = Path(__file__).parent

CASES = tomllib.loads((FOLDER / "cases.toml").read_text(encoding="utf-8"))["case"]

LONGEST = 2100
"""Letters of a sentence that somebody reads, with the name of the program before it."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["file"])
def test_what_once_escaped_is_refused(folder, capsys, case):
    shutil.copy(FOLDER / case["file"], folder)
    files = set(folder.iterdir())
    start = time.process_time()
    assert main(shlex.split(case["command"].replace("NAME", case["file"]))) == 2
    assert time.process_time() - start < 5.0  # of which imports may take most
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert case["says"] in said
    assert len(said) < LONGEST
    assert set(folder.iterdir()) == files


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "cases"), [("readers", 1500), ("scenes", 1000), ("descriptions", 1000), ("results", 8), ("page", 300)]
)
def test_damaged_input_is_refused_or_read(tmp_path, monkeypatch, target, cases):
    monkeypatch.syspath_prepend(str(FOLDER.parents[1] / "benchmarks"))
    fuzz = importlib.import_module("fuzz")
    folder = tmp_path / "files"
    folder.mkdir()
    counts = fuzz.run_cases(target, folder, cases=cases)  # which raises what escapes
    assert sum(counts.values()) == cases
    assert sum(count for name, count in counts.items() if name.endswith("refused")) > cases / 2
    assert any(name.endswith("read") for name in counts)


def test_every_file_is_a_case():
    files = {path.name for path in FOLDER.iterdir() if path.is_file()} - {"cases.toml", "test_corpus.py"}
    assert files == {case["file"] for case in CASES}
