"""Signals: what ends the program cleans up as Ctrl-C does, and waits where nothing may interrupt."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.signals import ended_as_by_ctrl_c, held_signals
from mirrorfold.io import files
from mirrorfold.io.files import written_atomically

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")


@posix
def test_held_signals_come_when_the_context_ends():
    done = []
    with pytest.raises(KeyboardInterrupt), held_signals():
        signal.raise_signal(signal.SIGINT)
        done.append("went on")
    assert done == ["went on"]


@posix
def test_signals_that_are_ignored_stay_so():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with ended_as_by_ctrl_c() as came:
            signal.raise_signal(signal.SIGHUP)
        assert came == []
    finally:
        signal.signal(signal.SIGHUP, before)
    with suppress(KeyboardInterrupt), ended_as_by_ctrl_c() as came:
        signal.raise_signal(signal.SIGTERM)
    assert came == [signal.SIGTERM]
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def hear_hang_up():
    """Whoever runs these tests may have told them not to, by nohup."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


WAITING = """
import time
import mirrorfold as mf
from mirrorfold.cli import main

def simulate(scene, **options):
    print("at work", flush=True)
    exec("time.sleep(60)")  # as the standard library does to make classes

mf.simulate = simulate
raise SystemExit(main())
"""


@posix
@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGINT", 130), ("SIGKILL", -9)])
def test_what_ends_the_program_leaves_nothing(tmp_path, number, code):
    """The command itself, at work in its temporary folder; what a kill leaves goes when the next file is written."""
    out = tmp_path / "out"
    out.mkdir()
    (tmp_path / "waiting.py").write_text(WAITING)
    (out / "sweep.nc").write_text("old")
    with subprocess.Popen(
        [sys.executable, "-m", "waiting", "demo", "--out", str(out)], cwd=tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=hear_hang_up,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        while "at work" not in process.stdout.readline():
            assert process.poll() is None
        assert len(os.listdir(out)) == 2
        process.send_signal(getattr(signal, number))
        said = process.communicate(timeout=120)[1]
    assert process.returncode == code
    if number == "SIGKILL":
        assert len(os.listdir(out)) == 2
        with written_atomically(out / "another") as temporary:
            temporary.write_text("x")
        assert sorted(os.listdir(out)) == ["another", "sweep.nc"]
        return
    assert said.splitlines()[-1] == "mirrorfold: interrupted; nothing was written"
    assert "Traceback" not in said
    assert sorted(os.listdir(out)) == ["sweep.nc"]


@posix
@pytest.mark.parametrize("there", [True, False])
def test_a_signal_while_files_are_replaced_waits_until_all_are(sweep, tmp_path, monkeypatch, capsys, there):
    """All of the new files are written then, which is what the message says."""
    source, folder = mf.save(sweep, tmp_path / "sweep.nc"), tmp_path / "scan"
    if there:
        assert main(["export", str(source), "-o", str(folder)]) == 0
    before = sorted(os.listdir(folder)) if there else []
    sync = files._sync

    def interrupt(path):
        if path in (folder, tmp_path):  # the files are at their places
            signal.raise_signal(signal.SIGTERM)
        sync(path)

    monkeypatch.setattr(files, "_sync", interrupt)
    capsys.readouterr()
    assert main(["export", str(source), "-o", str(folder)]) == 143
    assert f"mirrorfold: interrupted; {folder} was written before" in capsys.readouterr().err
    assert not [name for name in os.listdir(folder) if name.startswith(".")]
    assert sorted(os.listdir(folder)) == before or not there
    assert len(os.listdir(folder)) > 2
