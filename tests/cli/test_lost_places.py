"""Places that are there and cannot be used: a working folder that was deleted, files that only seem to be files."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import mirrorfold as mf
from mirrorfold.cli import main


@pytest.mark.skipif(sys.platform != "linux", reason="other systems keep the folder, or have no such files")
class TestOnLinux:
    """What Linux allows, and others do not."""

    def test_a_working_folder_that_was_deleted_is_named(self, sweep, tmp_path, monkeypatch, capsys):
        path, gone = mf.save(sweep, tmp_path / "a.nc"), tmp_path / "gone"
        gone.mkdir()
        monkeypatch.chdir(gone)
        gone.rmdir()
        for command in (["info", str(path)], ["focus", str(path), "-o", "b.nc"]):
            assert main(command) == 2
            assert capsys.readouterr().err == (
                "mirrorfold: the folder that you are in was deleted; change to another one with cd\n"
            )
        assert main(["--help"]) == 0

    @pytest.mark.parametrize("verb", ["info", "focus", "fold"])
    @pytest.mark.parametrize("suffix", [".nc", ".mat"])
    def test_a_file_that_cannot_be_read_is_wrong_input(self, tmp_path, capsys, verb, suffix):
        path = tmp_path / f"a{suffix}"
        path.symlink_to("/proc/self/mem")
        assert main([verb, str(path), *(["-o", str(tmp_path / "b.nc")] if verb != "info" else [])]) == 2
        assert f"{path}: cannot be read (Input/output error)" in capsys.readouterr().err
        assert list(Path(tmp_path).iterdir()) == [path]
