"""Streams for output that are closed, full, broken, or cannot say every letter."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys

import pytest

import mirrorfold as mf

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="needs a shell and /dev/full")]

PROGRAM = f'"{sys.executable}" -m mirrorfold'

IN_TURN = """
import sys
from mirrorfold.cli import main
codes = []
for line in sys.argv[1:]:
    sys.argv[1:] = line.split()
    codes.append(main())
sys.exit(sum(codes))
"""
"""Runs several command lines in one process, as the program does; most of the time of a process is that of imports."""


def shell(line, **environment):
    """What a line says in a shell, which runs the program in place of PROGRAM."""
    command = ["bash", "-o", "pipefail", "-c", line.replace("PROGRAM", PROGRAM)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=os.environ | environment)
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert "mistake of its own" not in done.stderr
    return done


@pytest.fixture
def file(sweep, tmp_path):
    return mf.save(sweep.assign_attrs(title="Zürich \N{SNOWMAN}"), tmp_path / "s.nc")


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&- <&-"])
def test_a_closed_stream_is_in_nobodys_way(file, closed):
    before = file.read_bytes()
    lines = f"info {file}", f"import {file} -o {file}.copy.nc"
    assert shell(f"{shlex.join([sys.executable, '-c', IN_TURN, *lines])} {closed}").returncode == 0
    assert shell(f"PROGRAM nope {closed}").returncode == 2
    assert shell(f"PROGRAM {closed}").returncode == 0
    assert file.read_bytes() == before
    assert mf.load(f"{file}.copy.nc").attrs["title"] == "Zürich \N{SNOWMAN}"


@pytest.mark.parametrize("arguments", ["--version", "--help", "info FILE", "info FILE --json", "schema info"])
def test_a_full_disk_under_stdout_is_one_sentence(file, arguments):
    done = shell(f"PROGRAM {arguments.replace('FILE', str(file))} > /dev/full")
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_full_disk_under_stderr_changes_nothing(file):
    assert shell("PROGRAM nope 2> /dev/full").returncode == 2
    assert shell("PROGRAM info nope.nc --json 2> /dev/full").returncode == 2


@pytest.mark.parametrize("arguments", ["--help", "--version", "schema info"])
def test_a_reader_that_has_gone_is_no_matter_of_words(arguments):
    done = shell(f"(sleep 1; PROGRAM {arguments}) | true")
    assert done.returncode == 1
    assert done.stderr == ""
    assert shell("(sleep 1; PROGRAM nope 2>&1 >/dev/null) | true").returncode == 2


@pytest.mark.parametrize("size", [100_000, 250_000, 600_000, 1_000_000])
def test_an_address_space_that_is_too_small_is_refused_before_the_libraries(file, size):
    """With some sizes a library waited for ever, with others it took the process down."""
    done = shell(f"ulimit -v {size}; PROGRAM info {file}")
    assert done.returncode == 2
    assert done.stderr.endswith("allowed (ulimit -v), and 1100 MB are needed to begin with; allow more\n")
    assert shell(f"ulimit -v {size}; PROGRAM --help").returncode == 0


def test_letters_that_the_encoding_lacks_are_spelled(file):
    done = shell(f"PROGRAM info {file}", PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert r"Z\xfcrich \u2603" in done.stdout
    assert r"\u2603.nc: does not exist" in shell("PROGRAM info ☃.nc", PYTHONIOENCODING="ascii").stderr
    assert shell("PROGRAM info --help", PYTHONIOENCODING="ascii").returncode == 0
