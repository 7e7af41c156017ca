"""A file of our own format shows what is in it, and nothing of the user's other files."""

from __future__ import annotations

import os
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.io import load_geometry
from mirrorfold.io.own.netcdf import read_unchecked

VARIABLE = {"sweep": "s", "image": "image", "reconstruction": "objects/amplitude"}

LEAKS = {
    "external storage": "the values of .* lie in another file",
    "external link": "is a link to another file",
    "virtual": "the values of .* lie in another file",
    "soft link to an external link": "is a link to another file",
    "attached": "the values of 'measured' lie in another file",
}


@pytest.fixture(params=VARIABLE)
def saved(request, tmp_path) -> tuple[Path, str]:
    """A file of each kind, and its most telling variable."""
    return mf.save(request.getfixturevalue(request.param), tmp_path / "a.nc"), VARIABLE[request.param]


def leak(path: Path, name: str, way: str) -> None:
    """Have a variable of a file show what lies in `secret.bin` or `secret.nc` beside it."""
    secret = path.with_name("secret.nc")
    secret.write_bytes(path.read_bytes())
    with h5py.File(path, "r+") as file:
        values = file[name]
        shape, dtype = values.shape, values.dtype
        secret.with_suffix(".bin").write_bytes(bytes(values.nbytes))
        if way == "attached":
            file.create_dataset("measured", (2,), "f4", external=[(str(secret.with_suffix(".bin")), 0, 8)])
            return
        del file[name]
        if way == "external storage":
            outside = [(str(secret.with_suffix(".bin")), 0, h5py.h5f.UNLIMITED)]
            file.create_dataset(name, shape, dtype, external=outside)
        elif way == "external link":
            file[name] = h5py.ExternalLink(str(secret), name)
        elif way == "virtual":
            layout = h5py.VirtualLayout(shape, dtype)
            layout[...] = h5py.VirtualSource(str(secret), name, shape, dtype)
            file.create_virtual_dataset(name, layout)
        else:
            file["elsewhere"] = h5py.ExternalLink(str(secret), "/")
            file[name] = h5py.SoftLink(f"/elsewhere/{name}")


@pytest.mark.parametrize("way", LEAKS)
def test_a_file_that_shows_another_file_is_refused(saved, way):
    path, name = saved
    leak(path, name, way)
    for reader in (mf.load, load_geometry, read_unchecked):
        with pytest.raises(InputError, match=rf"{re.escape(str(path))}: .*{LEAKS[way]}"):
            reader(path)


def test_the_samples_of_a_file_with_an_external_link_are_not_even_looked_at(sweep, tmp_path):
    """A link may lead to a pipe, which would keep its reader waiting for ever."""
    path = mf.save(sweep, tmp_path / "a.nc")
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(path, "r+") as file:
        file["more"] = h5py.ExternalLink(str(tmp_path / "pipe"), "/s")
    with pytest.raises(InputError, match="is a link to another file"):
        mf.load(path)


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_groups_in_groups_without_end_are_refused(reconstruction, tmp_path, kind):
    """Thirty groups, each in the one before under two names, make 2^30 paths."""
    path = mf.save(reconstruction, tmp_path / "a.nc")
    with h5py.File(path, "r+") as file:
        group = file.create_group("g")
        for _ in range(30 if kind == "hard" else 12):
            within = group.create_group("a")
            for name in "bcdef":
                group[name] = within if kind == "hard" else h5py.SoftLink(within.name)
            group = within
    with pytest.raises(InputError, match="is there under another name too"):
        mf.load(path)


def test_links_that_lead_to_each_other_are_refused(sweep, tmp_path):
    path = mf.save(sweep, tmp_path / "a.nc")
    with h5py.File(path, "r+") as file:
        del file["s"]
        file["s"], file["loop"] = h5py.SoftLink("/loop"), h5py.SoftLink("/s")
    with pytest.raises(InputError, match=r"a\.nc: is damaged"):
        mf.load(path)


def test_references_are_no_samples(sweep, tmp_path):
    path = mf.save(sweep, tmp_path / "a.nc")
    with h5py.File(path, "r+") as file:
        del file["s"]
        file.create_dataset("s", data=np.array([file["frequency"].ref], dtype=h5py.ref_dtype))
        file["s"].dims[0].attach_scale(file["frequency"])
    with pytest.raises(InputError, match=r"a\.nc: "):
        mf.load(path)


def test_a_pipe_is_no_file_to_read(tmp_path):
    os.mkfifo(tmp_path / "a.nc")
    with pytest.raises(InputError, match="is no file but a device, a pipe or a socket"):
        mf.load(tmp_path / "a.nc")


def test_files_are_opened_behind_the_gate_alone():
    source = Path(mf.__file__).parent
    opening = re.compile(
        r"h5py\.File\(|h5netcdf\.File\(|open_dataset\(|open_datatree\(|load_dataset\(|open_mfdataset\("
    )
    found = {str(path.relative_to(source)) for path in source.rglob("*.py") if opening.search(path.read_text("utf-8"))}
    assert found == {"io/own/netcdf.py", "io/readers/hdf5_process.py"}
