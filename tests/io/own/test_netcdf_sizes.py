"""Our own files are refused before they are read where their content would fill the memory."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.io import load_geometry
from mirrorfold.io.readers import read_contents

VALUES = 1_000_000
"""Values of an array of which the file holds none: they take 8 MB when it is read."""


@pytest.fixture
def saved(sweep, tmp_path):
    return mf.save(sweep, tmp_path / "a.nc")


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_an_array_under_many_names_counts_for_each_of_them(saved, kind):
    with h5py.File(saved, "a") as file:
        values = file.create_dataset("more", (VALUES,), "f8", chunks=(VALUES,), compression="gzip")
        for n in range(100):
            file[f"name{n}"] = values if kind == "hard" else h5py.SoftLink("/more")
    with pytest.raises(InputError, match="made to fill the memory"):
        mf.load(saved)


def test_a_second_name_of_a_small_array_does_no_harm(saved):
    with h5py.File(saved, "a") as file:
        file["note"] = np.arange(3.0)
        file["again"], file["link"] = file["note"], h5py.SoftLink("/note")
    np.testing.assert_array_equal(mf.load(saved)["link"], [0.0, 1.0, 2.0])
    assert "frequency" in load_geometry(saved)


@pytest.mark.parametrize("name", ["a.nc", "a.h5"])
def test_blocks_much_larger_than_the_file_are_refused_unread(saved, tmp_path, name):
    """A block is expanded as a whole, however few values of it the array holds."""
    path = saved.rename(tmp_path / name)
    with h5py.File(path, "a") as file:
        file.create_dataset("few", (10,), "f8", maxshape=(None,), chunks=(250_000_000,), compression="gzip")
    with pytest.raises(InputError, match=r"its variable 'few' is stored in blocks of 2e\+09 bytes"):
        mf.load(path) if name == "a.nc" else read_contents(path)
