"""Texts of variable length may share one place in a file, which a small file can use to fill the memory."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.io.readers import hdf5, hdf5_varying
from mirrorfold.io.readers.hdf5 import check_netcdf
from mirrorfold.io.readers.hdf5_varying import OBJECT_BYTES, Budget, RefusedError, varies

LONG, MANY = 100_000, 2000
"""Letters of the text that is shared, and how often: 200 MB, of a file of 130 kB."""

REFERENCE = 16
"""Bytes that a text of variable length takes in an array: where it lies."""


def share(path, at):
    """Have all texts of a list, which begins at a place in the file, lie where the first one does."""
    content = bytearray(path.read_bytes())
    content[at : at + MANY * REFERENCE] = content[at : at + REFERENCE] * MANY
    path.write_bytes(content)


@pytest.fixture
def saved(sweep, tmp_path):
    return mf.save(sweep, tmp_path / "a.nc")


def test_an_array_of_texts_that_share_a_place_is_refused(saved):
    with h5py.File(saved, "a") as file:
        file.create_dataset("note", (MANY,), h5py.string_dtype())[0] = "A" * LONG
        at = file["note"].id.get_offset()
    share(saved, at)
    with pytest.raises(InputError, match=r"its variable 'note' would expand to more than .* made to fill the memory"):
        mf.load(saved)


@pytest.mark.parametrize("place", ["/", "s"])
def test_an_attribute_of_texts_that_share_a_place_is_refused(tmp_path, place):
    saved = tmp_path / "a.nc"
    with h5py.File(saved, "w") as file:
        file["s"] = np.zeros(3)
        texts = np.array(["A" * LONG, *["QQQQ"] * (MANY - 1)], dtype=object)
        file[place].attrs.create("note", texts, dtype=h5py.string_dtype())
    content = saved.read_bytes()
    second, third = ((4).to_bytes(4, "little"),) * 2
    at = next(
        at
        for at in range(len(content))
        if content[at : at + 4] == LONG.to_bytes(4, "little")
        and content[at + REFERENCE :].startswith(second)
        and content[at + 2 * REFERENCE :].startswith(third)
    )
    share(saved, at)
    with pytest.raises(InputError, match="attribute 'note' is a list of 2000 texts; shorten it"):
        check_netcdf(saved)


def taken(path):
    """Memory that the texts and rows of a file take, as its check counts it [bytes]."""
    return hdf5._checked(str(path), path.stat().st_mtime_ns, path.stat().st_size)["varying"]


def test_texts_and_rows_of_usual_length_are_read(saved):
    before = taken(saved)
    with h5py.File(saved, "a") as file:
        file["names"] = np.array([["a", "b"], ["c", "d"]], dtype=object)
        file.attrs["authors"] = np.array(["A", "B"], dtype=object)
        file.create_dataset("rows", (3,), h5py.vlen_dtype("f8"))[1] = np.arange(5.0)
    check_netcdf(saved)
    added = 6 * (OBJECT_BYTES + 1) + 5 * np.dtype("f8").itemsize
    assert added <= taken(saved) - before < 2 * added


def test_rows_are_counted_and_what_is_read_adds_up(tmp_path, monkeypatch):
    monkeypatch.setattr(hdf5_varying, "HARMLESS_BYTES", 0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        rows = file.create_dataset("rows", (3,), h5py.vlen_dtype("f8"))
        rows[0] = rows[2] = np.arange(100.0)
        budget = Budget(5)
        with pytest.raises(RefusedError, match="its variable 'rows' would expand to more than 1e"):
            budget.read("rows", rows)
        budget = Budget(20)
        for _ in range(2):
            budget.read("rows", rows)
        with pytest.raises(RefusedError):
            budget.read("rows", rows)


def test_rows_of_texts_are_refused():
    text = h5py.string_dtype()
    assert varies(text)
    assert not varies(h5py.string_dtype(length=3))
    assert varies(h5py.vlen_dtype(h5py.ref_dtype))
    for nested in (h5py.vlen_dtype(text), np.dtype([("name", text), ("x", "f8")]), np.dtype((text, (2,)))):
        with pytest.raises(RefusedError, match="records or rows of texts"):
            varies(nested)
