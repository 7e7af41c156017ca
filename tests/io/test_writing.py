"""Writing: what is there stays until the new is whole, and places where nothing can be written are refused."""

from __future__ import annotations

import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.io.files import check_output, check_output_directory, directory_written_atomically, written_atomically


def test_a_failed_write_leaves_what_was_there(sweep, tmp_path, monkeypatch):
    path = tmp_path / "sweep.nc"
    mf.save(sweep, path)
    before = path.read_bytes()

    def fail(self, temporary, **options):
        temporary.write(b"half of a file")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.DataTree, "to_netcdf", fail)
    with pytest.raises(OSError, match="No space left"):
        mf.save(sweep, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_appears_only_when_it_is_complete(tmp_path):
    with written_atomically(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "a.txt").exists()
        assert temporary.suffix == ".txt"
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert len(list(tmp_path.iterdir())) == 1


def test_places_where_nothing_can_be_written_are_refused(sweep, tmp_path):
    with pytest.raises(InputError, match=r"the directory \S*nowhere does not exist"):
        mf.save(sweep, tmp_path / "nowhere" / "sweep.nc")
    with pytest.raises(InputError, match="is a directory"):
        mf.save(sweep, tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        check_output_directory(tmp_path / "nowhere" / "out", names=())
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file"):
        check_output_directory(tmp_path / "file", names=())


def test_a_read_only_directory_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(InputError, match="is read-only"):
        check_output(tmp_path / "sweep.nc")
    with pytest.raises(InputError, match="is read-only"):
        check_output_directory(tmp_path, names=())


def test_an_input_is_never_overwritten_whatever_it_is_called(tmp_path):
    source = tmp_path / "sweep.nc"
    source.touch()
    (tmp_path / "link.nc").symlink_to(source)
    for name in ("sweep.nc", "link.nc", f"../{tmp_path.name}/sweep.nc"):
        with pytest.raises(InputError, match="is the input itself"):
            check_output(tmp_path / name, inputs=[source])
    with pytest.raises(InputError, match="is the input itself"):
        check_output_directory(tmp_path, names=["sweep.nc"], inputs=[source])
    assert check_output(tmp_path / "other.nc", inputs=[source]) == tmp_path / "other.nc"


def test_a_directory_appears_only_when_it_is_complete(tmp_path):
    target = tmp_path / "out"
    with pytest.raises(RuntimeError, match="half way"), directory_written_atomically(target) as temporary:
        (temporary / "a").write_text("1")
        raise RuntimeError("half way")
    assert list(tmp_path.iterdir()) == []
    with directory_written_atomically(target) as temporary:
        (temporary / "a").write_text("1")
    assert [path.name for path in target.iterdir()] == ["a"]


def test_a_directory_that_exists_keeps_its_other_files(tmp_path):
    (tmp_path / "notes").write_text("mine")
    (tmp_path / "a").write_text("old")
    with pytest.raises(RuntimeError, match="half way"), directory_written_atomically(tmp_path) as temporary:
        (temporary / "a").write_text("new")
        raise RuntimeError("half way")
    assert (tmp_path / "a").read_text() == "old"
    with directory_written_atomically(tmp_path) as temporary:
        (temporary / "a").write_text("new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"notes": "mine", "a": "new"}
