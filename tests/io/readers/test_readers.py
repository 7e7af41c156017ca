"""Readers of measured data: every format gives back what was written, and other packages may add theirs."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples
from reading import refused
from scipy.io import loadmat, netcdf_file, savemat

from mirrorfold.errors import InputError
from mirrorfold.io import readers
from mirrorfold.io.readers import Reader, read_contents
from mirrorfold.io.readers.contents import Contents, Variable
from mirrorfold.io.readers.lines import parse_number

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(40))


@pytest.mark.parametrize("compression", [False, True])
def test_matlab_arrays_are_read_as_scipy_reads_them(tmp_path, rng, samples, compression):
    content = {
        "s": samples,
        "single": samples.astype(np.complex64),
        "counts": rng.integers(0, 200, (3, 2)).astype(np.uint8),
        "cube": rng.standard_normal((2, 3, 4)),
        "signed": np.array([[-5, 300]], dtype=np.int16),
        "scan": {"freq": np.arange(5.0), "inner": {"x": np.arange(3.0)}, "name": "corner"},
        "cells": np.array([np.arange(3.0), "two"], dtype=object),
    }
    savemat(tmp_path / "data.mat", content, do_compression=compression)
    contents = read_contents(tmp_path / "data.mat")
    theirs = loadmat(tmp_path / "data.mat")
    for name in ("s", "single", "counts", "cube", "signed"):
        np.testing.assert_array_equal(contents.array(name), theirs[name])
        assert contents.array(name).dtype.kind == theirs[name].dtype.kind
    np.testing.assert_array_equal(contents.array("scan.freq").ravel(), content["scan"]["freq"])
    np.testing.assert_array_equal(contents.array("scan.inner.x").ravel(), np.arange(3.0))
    np.testing.assert_array_equal(contents.array("cells[0]").ravel(), np.arange(3.0))
    assert str(contents.array("scan.name")) == "corner"


@pytest.mark.slow
@ONE_FILE
@given(shape=st.lists(st.integers(1, 5), min_size=2, max_size=4), seed=st.integers(0, 1000), packed=st.booleans())
def test_any_complex_matlab_array_comes_back(tmp_path, shape, seed, packed):
    rng = np.random.default_rng(seed)
    values = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    savemat(tmp_path / "data.mat", {"v": values}, do_compression=packed)
    np.testing.assert_array_equal(read_contents(tmp_path / "data.mat").array("v"), values)


def write_matlab_73(path, samples, **others):
    """As MATLAB writes it: a block of its own before HDF5, compounds for complex numbers, axes in the other order."""
    with h5py.File(path, "w", userblock_size=512) as file:
        pair = np.zeros(samples.T.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
        pair["real"], pair["imag"] = samples.T.real, samples.T.imag
        file["scan/s"] = pair
        file["scan/s"].attrs["MATLAB_class"] = np.bytes_("double")
        for name, values in others.items():
            file[f"scan/{name}"] = np.asarray(values).T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def test_matlab_73_complex_arrays_have_their_axes_as_in_matlab(tmp_path, samples):
    write_matlab_73(tmp_path / "new.mat", samples, freq=np.arange(6.0)[None])
    contents = read_contents(tmp_path / "new.mat")
    assert contents.variables["scan.s"].shape == samples.shape
    np.testing.assert_array_equal(contents.array("scan.s"), samples)
    assert contents.array("scan.freq").shape == (1, 6)


def test_hdf5_groups_native_complex_and_compounds_are_read(tmp_path, samples):
    with h5py.File(tmp_path / "data.h5", "w") as file:
        file["a/native"] = samples
        file["a/single"] = samples.astype(np.complex64)
        file.create_dataset("packed", data=samples.real, compression="gzip")
        file["short"] = np.array([(1, -2)], dtype=[("real", "<i2"), ("imag", "<i2")])
        file["soft"] = h5py.SoftLink("/packed")
    contents = read_contents(tmp_path / "data.h5")
    np.testing.assert_array_equal(contents.array("a.native"), samples)
    np.testing.assert_array_equal(contents.array("a.single"), samples.astype(np.complex64))
    np.testing.assert_array_equal(contents.array("packed"), samples.real)
    np.testing.assert_array_equal(contents.array("short"), [1 - 2j])


def test_classic_netcdf_is_read_with_its_dimensions(tmp_path, samples):
    with netcdf_file(tmp_path / "old.nc", "w") as file:
        file.createDimension("frequency", 6)
        file.createDimension("position", 4)
        for name, values in (("s_re", samples.real), ("s_im", samples.imag)):
            file.createVariable(name, "f8", ("frequency", "position"))[:] = values
            file.variables[name].Unit = "V"
    contents = read_contents(tmp_path / "old.nc")
    np.testing.assert_array_equal(contents.array("s_re") + 1j * contents.array("s_im"), samples)
    assert contents.variables["s_re"].dims == ("frequency", "position")
    assert contents.variables["s_re"].attrs == {"units": "V"}


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_numpy_archives_are_read(tmp_path, samples, save):
    save(tmp_path / "data.npz", s=samples, f=np.asfortranarray(samples.real), n=np.arange(3))
    contents = read_contents(tmp_path / "data.npz")
    np.testing.assert_array_equal(contents.array("s"), samples)
    np.testing.assert_array_equal(contents.array("f"), samples.real)
    np.save(tmp_path / "one.npy", samples)
    np.testing.assert_array_equal(read_contents(tmp_path / "one.npy").array("array"), samples)


NUMBERS = st.complex_numbers(allow_nan=False, allow_infinity=False, max_magnitude=1e6)


@ONE_FILE
@given(value=NUMBERS, unit=st.sampled_from("ij"), parentheses=st.booleans())
def test_complex_numbers_are_understood_as_matlab_and_python_write_them(value, unit, parentheses):
    text = f"{value.real!r}{value.imag:+}{unit}"
    assert parse_number(f"({text})" if parentheses else text) == value


@pytest.mark.parametrize("text", ["", "a", "1+", "1_000", "1+2k", "++1", "i2", "1,5", "0x10", "\u0661", "12-5-"])
def test_what_is_no_number_is_none(text):
    assert parse_number(text) is None


def test_a_complex_table_comes_back(tmp_path, samples):
    rows = [",".join(f"{z.real!r}{z.imag:+}i" for z in row) for row in samples.tolist()]
    (tmp_path / "s.csv").write_text("\n".join(rows))
    np.testing.assert_array_equal(read_contents(tmp_path / "s.csv").array("table"), samples)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_clouds_are_read(tmp_path, rng, form):
    points = rng.standard_normal((5, 4)).astype(np.float32)
    fields = ("x", "y", "z", "intensity")
    head = ["ply", f"format {form} 1.0", "comment made", "element vertex 5", *(f"property float {n}" for n in fields)]
    body = "\n".join(" ".join(map(repr, row)) for row in points.tolist()).encode()
    if form != "ascii":
        body = points.astype("<f4" if "little" in form else ">f4").tobytes()
    (tmp_path / "cloud.ply").write_bytes("\n".join([*head, "end_header", ""]).encode() + body)
    contents = read_contents(tmp_path / "cloud.ply")
    for n, name in enumerate(fields):
        np.testing.assert_allclose(contents.array(name), points[:, n], rtol=1e-6)


def test_other_packages_add_readers_by_entry_points(tmp_path, monkeypatch):
    def read(path):
        return Contents(path, "mine", {"s": Variable.of(np.arange(3.0))})

    mine = Reader("mine", "my own", lambda path, head: head.startswith(b"MINE"), read)

    class Point:
        name, value = "mine", "my_package:READER"

        def load(self):
            return mine

    monkeypatch.setattr(readers, "entry_points", lambda group: [Point()] if group == "mirrorfold.readers" else [])
    readers.readers.cache_clear()
    try:
        (tmp_path / "data.xyz").write_bytes(b"MINE")
        np.testing.assert_array_equal(read_contents(tmp_path / "data.xyz").array("s"), np.arange(3.0))
    finally:
        readers.readers.cache_clear()


def test_a_broken_entry_point_is_named(monkeypatch):
    class Point:
        name, value = "broken", "nowhere:READER"

        def load(self):
            raise ImportError("no module named nowhere")

    monkeypatch.setattr(readers, "entry_points", lambda group: [Point()])
    readers.readers.cache_clear()
    try:
        with pytest.raises(InputError, match="'broken' of nowhere:READER"):
            readers.readers()
    finally:
        readers.readers.cache_clear()


def test_a_reader_that_fails_in_its_own_way_still_says_one_sentence(tmp_path, monkeypatch):
    def read(path):
        raise KeyError("what")

    mine = Reader("mine", "my own", lambda path, head: True, read)
    monkeypatch.setattr(readers, "readers", lambda: {"mine": mine})
    (tmp_path / "data").write_bytes(b"1")
    refused(tmp_path / "data", "damaged")
