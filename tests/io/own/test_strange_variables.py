"""What netCDF cannot hold is left out with a remark when a file is read, and refused when one is written."""

from __future__ import annotations

import warnings

import h5py
import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import InputError

RECORD = np.dtype([("a", "f4"), ("b", "i4")])

STRANGE = {
    "opaque": lambda file: file.create_dataset("more", data=np.zeros(3, "V7")),
    "records": lambda file: file.create_dataset("more", data=np.zeros(3, RECORD)),
    "object": lambda file: file.create_dataset("more", data=np.array([file.ref] * 3, h5py.ref_dtype)),
    "region": lambda file: file.create_dataset(
        "more", data=np.array([file["s"].regionref[0:1]] * 3, h5py.regionref_dtype)
    ),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_variables_that_netcdf_cannot_hold_are_left_out(sweep, tmp_path, kind, capsys):
    path = mf.save(sweep, tmp_path / "a.nc")
    with h5py.File(path, "r+") as file:
        STRANGE[kind](file)
    with pytest.warns(UserWarning, match=r"a\.nc: 'more' holds neither numbers nor texts, and is left out"):
        found = mf.load(path)
    assert "more" not in found
    np.testing.assert_array_equal(found["s"], sweep["s"])
    warnings.simplefilter("default")
    assert main(["calibrate", str(path), "--cable-length", "0.1", "-o", str(tmp_path / "b.nc")]) == 0, (
        capsys.readouterr().err
    )
    assert "'more' holds neither" in capsys.readouterr().err


@pytest.mark.parametrize("values", [np.zeros(3, RECORD), np.array([{}, None])])
def test_variables_that_netcdf_cannot_hold_are_not_written(sweep, tmp_path, values):
    with pytest.raises(InputError, match="netCDF holds numbers and texts, and 'more' is neither; drop it"):
        mf.save(sweep.assign(more=("k", values)), tmp_path / "a.nc")
    assert not (tmp_path / "a.nc").exists()


def test_texts_and_numbers_are_written(sweep, tmp_path):
    for n, values in enumerate((np.array(["a", "bc"]), np.array(["a", "bc"], object), np.arange(2), [True, False])):
        found = mf.load(mf.save(sweep.assign(more=("k", values)), tmp_path / f"{n}.nc"))
        assert list(found["more"].values) == list(values)
