"""Readers of measured data: every format gives back what was written, and hostile files are refused unread."""

from __future__ import annotations

import io
import os
import signal
import struct
import sys
import tracemalloc
import warnings
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples
from scipy.io import loadmat, netcdf_file, savemat

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.io import readers
from mirrorfold.io.readers import Reader, hdf5, read_contents, touchstone
from mirrorfold.io.readers.contents import Contents, Variable
from mirrorfold.io.readers.table import parse_number

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(40))

LARGE = 32 << 20
"""No refused file may make a reader allocate so many bytes."""


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.fixture
def samples(rng):
    return rng.standard_normal((6, 4)) + 1j * rng.standard_normal((6, 4))


def refused(path: Path, *words: str) -> str:
    """The sentence with which a file is refused, having taken little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            contents = read_contents(path)
            for name in contents.variables:
                contents.array(name)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    sentence = str(caught.value)
    assert peak < LARGE
    assert str(path) in sentence
    assert "\n" not in sentence
    for word in words:
        assert word in sentence
    return sentence


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
    contents = read_contents(tmp_path / "old.nc")
    np.testing.assert_array_equal(contents.array("s_re") + 1j * contents.array("s_im"), samples)
    assert contents.variables["s_re"].dims == ("frequency", "position")


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


@pytest.mark.parametrize(
    ("heading", "parts", "delimiter"),
    [
        ("freq[Hz];re:Trc1_S21;im:Trc1_S21;", "ri", ";"),  # Rohde & Schwarz
        ("freq[Hz];db:Trc1_S21;ang:Trc1_S21;", "db", ";"),
        ("freq[Hz];mag:Trc1_S21;ang:Trc1_S21", "ma", ";"),
        ("Freq(Hz),S21(REAL),S21(IMAG)", "ri", ","),  # Keysight
        ("Freq(Hz),S21(DB),S21(DEG)", "db", ","),
        ("Freq(Hz),S21 Log Mag(dB),S21 Phase(deg)", "db", ","),
        ("Frequency (Hz),Re(S21),Im(S21)", "ri", ","),
        ("frequency\tS21_mag\tS21_phase_rad", "mr", "\t"),
        ("freq_Hz,S21_re,S21_im", "ri", ","),
        ("Frequency/Hz,dB(S(2,1)),ang(S(2,1))", "db", ","),
        ("Stimulus [Hz];Trc1_S21[re];Trc1_S21[im]", "ri", ";"),
        ("# Freq,Real,Imag\nFreq. [Hz],Real(S21),Imag(S21)", "ri", ","),
    ],
)
def test_tables_of_network_analysers_describe_themselves(tmp_path, rng, heading, parts, delimiter):
    s = rng.standard_normal(5) + 1j * rng.standard_normal(5)
    f = np.linspace(270e9, 300e9, 5)
    angle = np.angle(s) if parts == "mr" else np.degrees(np.angle(s))
    size = 20 * np.log10(np.abs(s)) if parts == "db" else np.abs(s)
    columns = (s.real, s.imag) if parts == "ri" else (size, angle)
    lines = [delimiter.join(f"{v:.15g}" for v in row) for row in zip(f, *columns, strict=True)]
    text = "\n".join(["!CSV A.10.45.04", "BEGIN CH1_DATA", heading, *lines, "END"])
    (tmp_path / "trace.csv").write_text(text)
    spectra = read_contents(tmp_path / "trace.csv").spectra
    np.testing.assert_allclose(spectra.frequency, f)
    np.testing.assert_allclose(spectra.parameters["S21"], s, rtol=1e-12)


def test_decimal_commas_and_gigahertz_are_understood(tmp_path):
    (tmp_path / "trace.csv").write_text("freq[GHz];re:S11;im:S11\n1,5;0,25;-1\n2,0;0,5;1e-3\n")
    spectra = read_contents(tmp_path / "trace.csv").spectra
    np.testing.assert_allclose(spectra.frequency, [1.5e9, 2e9])
    np.testing.assert_allclose(spectra.parameters["S11"], [0.25 - 1j, 0.5 + 1e-3j])


def test_a_table_says_the_line_of_its_mistake(tmp_path):
    (tmp_path / "a.csv").write_text("1,2\n3,4\n5,x6\n")
    refused(tmp_path / "a.csv", "line 3", "'x6'")
    (tmp_path / "b.csv").write_text("1,2\n3,4,5\n")
    refused(tmp_path / "b.csv", "line 2", "3 columns")


CITI = """CITIFILE A.01.01
#NA VERSION HP8510XF.01.02
NAME RAW_DATA
VAR FREQ MAG {points}
DATA S[1,1] RI
DATA S[2,1] {form}
{axis}
BEGIN
{first}
END
BEGIN
{second}
END
"""


@pytest.mark.parametrize("form", ["RI", "MAGANGLE", "DBANGLE"])
@pytest.mark.parametrize("listed", [False, True])
def test_citi_files_are_read(tmp_path, rng, form, listed):
    s = rng.standard_normal((2, 4)) + 1j * rng.standard_normal((2, 4))
    f = np.linspace(1e9, 4e9, 4)
    angle = np.degrees(np.angle(s[1]))
    size = 20 * np.log10(np.abs(s[1])) if form == "DBANGLE" else np.abs(s[1])
    second = (s[1].real, s[1].imag) if form == "RI" else (size, angle)

    def block(columns):
        return "\n".join(f"{a!r},{b!r}" for a, b in zip(*(c.tolist() for c in columns), strict=True))

    segments = "SEG_LIST_BEGIN\nSEG 1000000000 4000000000 4\nSEG_LIST_END"
    values = "\n".join(["VAR_LIST_BEGIN", *map(str, f), "VAR_LIST_END"])
    text = CITI.format(points=4, form=form, axis=values if listed else segments, first=block((s[0].real, s[0].imag)),
                       second=block(second))  # fmt: skip
    (tmp_path / "raw.cti").write_text(text)
    spectra = read_contents(tmp_path / "raw.cti").spectra
    np.testing.assert_allclose(spectra.frequency, f)
    np.testing.assert_allclose(spectra.parameters["S11"], s[0])
    np.testing.assert_allclose(spectra.parameters["S21"], s[1], rtol=1e-12)


def test_a_citi_file_that_announces_more_than_it_holds_is_refused(tmp_path):
    text = CITI.format(
        points=10**17,
        form="RI",
        axis="SEG_LIST_BEGIN\nSEG 1 2 99999999999999999\nSEG_LIST_END",
        first="1,2",
        second="1,2",
    )
    (tmp_path / "raw.cti").write_text(text)
    refused(tmp_path / "raw.cti")


def by_library(path):
    """The same file by way of scikit-rf."""
    from skrf import Network

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Network(str(path))


@ONE_FILE
@given(
    ports=st.integers(1, 5),
    form=st.sampled_from(["RI", "MA", "DB"]),
    unit=st.sampled_from(["Hz", "kHz", "MHz", "GHz"]),
    seed=st.integers(0, 10_000),
)
def test_touchstone_files_are_read_as_scikit_rf_reads_them(tmp_path, ports, form, unit, seed):
    rng = np.random.default_rng(seed)
    points = int(rng.integers(2, 7))
    s = rng.standard_normal((points, ports**2)) + 1j * rng.standard_normal((points, ports**2))
    f = np.linspace(1.0, 2.0, points)
    pairs = {
        "RI": (s.real, s.imag),
        "MA": (np.abs(s), np.degrees(np.angle(s))),
        "DB": (20 * np.log10(np.abs(s)), np.degrees(np.angle(s))),
    }[form]
    lines = ["! a comment", f"# {unit} S {form} R 50"]
    for n in range(points):
        words = [f"{f[n]:.12g}", *(f"{v:.15g}" for pair in zip(pairs[0][n], pairs[1][n], strict=True) for v in pair)]
        if ports > 2:  # wrapped, a row of the matrix in a line and four pairs at most, as the specification says
            rows = [words[1 + 2 * ports * i : 1 + 2 * ports * (i + 1)] for i in range(ports)]
            words = words[:1]
            for row in rows:
                words += [*row[:8], "\n", *row[8:], "\n"]
        lines.append(" ".join(words).strip() + "  ! remark")
    path = tmp_path / f"n.s{ports}p"
    path.write_text("\n".join(lines) + "\n")
    spectra, network = touchstone.read_spectra(path), by_library(path)
    np.testing.assert_allclose(spectra.frequency, network.f, rtol=1e-12)
    for i in range(ports):
        for j in range(ports):
            np.testing.assert_allclose(
                spectra.parameters[f"S{i + 1}{j + 1}"], network.s[:, i, j], rtol=1e-9, atol=1e-12
            )


def test_noise_data_after_a_two_port_are_passed_over(tmp_path):
    row = "0.1 0 0.2 0 0.3 0 0.4 0"
    text = f"# GHz S RI R 50\n1 {row}\n2 {row}\n! noise\n0.5 1 0.5 60 0.3\n1.5 1 0.5 60 0.3\n"
    (tmp_path / "amplifier.s2p").write_text(text)
    spectra = touchstone.read_spectra(tmp_path / "amplifier.s2p")
    np.testing.assert_allclose(spectra.frequency, [1e9, 2e9])
    np.testing.assert_allclose(spectra.parameters["S21"], 0.2)
    np.testing.assert_allclose(spectra.parameters["S12"], 0.3)


VERSION_2 = """[Version] 2.0
# GHz S RI R 50
[Number of Ports] 2
[Two-Port Data Order] 12_21
[Number of Frequencies] 2
[Network Data]
1 0.1 0 0.2 0 0.3 0 0.4 0
2 0.1 0 0.2 0 0.3 0 0.4 0
[End]
"""


@pytest.mark.parametrize("name", ["new.ts", "new.s2p"])
def test_touchstone_version_2_goes_through_scikit_rf(tmp_path, name):
    (tmp_path / name).write_text(VERSION_2)
    spectra = touchstone.read_spectra(tmp_path / name)
    np.testing.assert_allclose(spectra.frequency, [1e9, 2e9])
    np.testing.assert_allclose(spectra.parameters["S12"], 0.2)  # in the order 12, 21
    np.testing.assert_allclose(spectra.parameters["S21"], 0.3)


def test_a_touchstone_file_of_many_announced_ports_is_refused(tmp_path):
    (tmp_path / "new.ts").write_text(VERSION_2.replace("Ports] 2", "Ports] 200000"))
    refused(tmp_path / "new.ts", "cut off")


def test_a_touchstone_file_says_the_line_of_its_mistake(tmp_path):
    (tmp_path / "bad.s1p").write_text("# Hz S RI R 50\n1e9 0.1 0.2\n2e9 0.l 0.2\n")
    refused(tmp_path / "bad.s1p", "line 3", "'0.l'")
    (tmp_path / "short.s2p").write_text("# Hz S RI R 50\n1e9 0.1 0.2\n")
    refused(tmp_path / "short.s2p", "cut off")


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


# --- hostile files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "suffix", [".mat", ".h5", ".nc", ".npz", ".npy", ".csv", ".s2p", ".ts", ".cti", ".ply", ".pcd", ".x"]
)
def test_empty_and_mislabelled_files_are_refused(tmp_path, suffix):
    path = tmp_path / f"file{suffix}"
    path.write_bytes(b"")
    refused(path, "empty")
    path.write_bytes(b"\x00\x01\x02 this is none of the formats" * 20)
    refused(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    refused(tmp_path / "none.mat", "does not exist")
    refused(tmp_path, "is a directory")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("suffix", [".mat", ".h5", ".csv", ".s2p"])
def test_pipes_and_devices_are_not_waited_for(tmp_path, suffix):
    os.mkfifo(tmp_path / f"pipe{suffix}")
    refused(tmp_path / f"pipe{suffix}", "pipe")
    with pytest.raises(InputError, match="no file"):
        mf.import_data(tmp_path, positions=tmp_path / f"pipe{suffix}")


@pytest.mark.parametrize(
    ("suffix", "head"),
    [
        (".mat", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"),
        (".csv", b"1,2\n"),
        (".s2p", b"# Hz S RI R 50\n"),
        (".cti", b"CITIFILE A.01.00\n"),
        (".npy", b"\x93NUMPY\x01\x00"),
        (".npz", b"PK\x03\x04"),
        (".nc", b"CDF\x01"),
        (".ply", b"ply\nformat ascii 1.0\n"),
    ],
)
def test_files_larger_than_the_memory_are_refused_unread(tmp_path, suffix, head):
    path = tmp_path / f"huge{suffix}"
    with path.open("wb") as file:
        file.write(head * 2000 if suffix in (".csv", ".s2p", ".cti", ".ply") else head)
        file.truncate(1 << 42)  # takes no room on the disk
    refused(path, "memory")


class Bomb:
    """A pickle that would leave a file behind."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_pickles_are_never_loaded(tmp_path, suffix):
    mark = tmp_path / "executed"
    path = tmp_path / f"evil{suffix}"
    values = np.array([Bomb(mark)], dtype=object)
    if suffix == ".npy":
        np.save(path, values, allow_pickle=True)
    else:
        np.savez(path, s=values)
    refused(path, "pickled")
    assert not mark.exists()


@pytest.mark.slow
def test_zip_bombs_are_refused(tmp_path):
    path = tmp_path / "bomb.npz"
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (40_000_000,)})
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("s.npy", "w", force_zip64=True) as file,
    ):
        file.write(head.getvalue())
        for _ in range(320):
            file.write(bytes(1_000_000))
    assert path.stat().st_size < 500_000
    refused(path, "expand")


def test_zip_members_that_lie_about_their_size_are_refused(tmp_path):
    path = tmp_path / "liar.npz"
    np.savez_compressed(path, s=np.zeros(100_000))
    raw = path.read_bytes()
    at = raw.rfind(b"PK\x01\x02")
    (tmp_path / "small.npz").write_bytes(raw[: at + 24] + struct.pack("<I", 100) + raw[at + 28 :])
    refused(tmp_path / "small.npz")


@pytest.mark.parametrize("shape", [(2**40,), (10**9, 10**9), (2**62, 4)])
def test_absurd_numpy_shapes_are_refused(tmp_path, shape):
    path = tmp_path / "huge.npy"
    with path.open("wb") as file:
        np.lib.format.write_array_header_2_0(file, {"descr": "<c16", "fortran_order": False, "shape": shape})
    refused(path, "announces")


def matlab_element(kind, body):
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def matlab_array(dims, data, flags=6):
    parts = [matlab_element(6, struct.pack("<II", flags, 0)), matlab_element(5, struct.pack(f"<{len(dims)}i", *dims))]
    return matlab_element(14, b"".join([*parts, matlab_element(1, b"s"), data]))


MATLAB_HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


@pytest.mark.parametrize("dims", [(2**31 - 1, 2**31 - 1), (-1, 4), (100, 100)])
def test_absurd_matlab_dimensions_are_refused(tmp_path, dims):
    for flags in (6, 1, 2):  # numbers, cells, structures
        path = tmp_path / f"huge{flags}.mat"
        path.write_bytes(MATLAB_HEAD + matlab_array(dims, matlab_element(9, bytes(16)), flags))
        refused(path)


def test_a_compressed_matlab_bomb_is_refused(tmp_path):
    size = 600_000_000
    pack = zlib.compressobj(9)
    body = pack.compress(struct.pack("<II", 14, size)) + pack.compress(bytes(50_000_000)) + pack.flush()
    (tmp_path / "bomb.mat").write_bytes(MATLAB_HEAD + struct.pack("<II", 15, len(body)) + body)
    refused(tmp_path / "bomb.mat", "expand")


def test_matlab_structures_without_end_are_refused(tmp_path):
    body = matlab_array((1, 1), matlab_element(9, bytes(8)))
    for _ in range(200):
        body = matlab_array((1, 1), body, flags=1)
    (tmp_path / "deep.mat").write_bytes(MATLAB_HEAD + body)
    refused(tmp_path / "deep.mat", "nested")


@pytest.mark.slow
def test_absurd_hdf5_shapes_are_refused(tmp_path):
    with h5py.File(tmp_path / "huge.h5", "w") as file:
        file.create_dataset("s", shape=(10**7, 10**7), dtype="c16", chunks=(100, 100))
    refused(tmp_path / "huge.h5", "memory")
    with h5py.File(tmp_path / "bomb.h5", "w") as file:
        file.create_dataset("s", data=np.zeros(20_000_000), chunks=(1_000_000,), compression="gzip")
    refused(tmp_path / "bomb.h5", "expand")


def test_hdf5_links_to_other_files_are_refused(tmp_path):
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["s"] = np.arange(5.0)
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["s"] = h5py.ExternalLink("secret.h5", "/s")
    refused(tmp_path / "link.h5", "link to another file")
    (tmp_path / "raw.bin").write_bytes(bytes(80))
    with h5py.File(tmp_path / "external.h5", "w") as file:
        file.create_dataset("s", shape=(10,), dtype="f8", external=[(str(tmp_path / "raw.bin"), 0, 80)])
    refused(tmp_path / "external.h5", "another file")
    layout = h5py.VirtualLayout(shape=(5,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "s", shape=(5,))
    with h5py.File(tmp_path / "virtual.h5", "w") as file:
        file.create_virtual_dataset("s", layout)
    refused(tmp_path / "virtual.h5", "another file")


def test_hdf5_groups_that_hold_themselves_end(tmp_path):
    with h5py.File(tmp_path / "loop.h5", "w") as file:
        file["s"] = np.arange(5.0)
        file["a/b"] = h5py.SoftLink("/a")
        file["a/c"] = file["a"]
    assert "s" in read_contents(tmp_path / "loop.h5").variables


@pytest.mark.slow
def test_a_file_that_hangs_or_kills_the_hdf5_library_is_refused_and_the_next_one_read(tmp_path, monkeypatch, samples):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["s"] = samples
    read_contents(path)
    hdf5._library._process.kill()  # as an earlier file might have done
    np.testing.assert_array_equal(read_contents(path).array("s"), samples)
    hdf5._library._process.send_signal(signal.SIGSTOP)
    monkeypatch.setattr(hdf5, "PATIENCE", 0.2)
    refused(path, "does not end")
    monkeypatch.undo()
    np.testing.assert_array_equal(read_contents(path).array("s"), samples)
    monkeypatch.setattr(sys, "executable", "/bin/false")  # whatever is asked, it dies
    hdf5._library._stop()
    refused(path, "stops the HDF5 library")
    monkeypatch.undo()
    np.testing.assert_array_equal(read_contents(path).array("s"), samples)


def test_clouds_that_announce_more_than_they_hold_are_refused(tmp_path):
    head = "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nend_header\n"
    for count in (10**15, 3):
        (tmp_path / "cloud.ply").write_bytes(head.format(count).encode() + bytes(16))
        refused(tmp_path / "cloud.ply", "cut off")


def test_every_truncation_of_every_format_is_refused_or_read(tmp_path, samples):
    savemat(tmp_path / "a.mat", {"s": samples}, do_compression=True)
    np.savez(tmp_path / "a.npz", s=samples)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["s"] = samples
    for source in ("a.mat", "a.npz", "a.h5"):
        raw = (tmp_path / source).read_bytes()
        for end in range(1, len(raw), max(1, len(raw) // 100)):
            path = tmp_path / f"cut-{source}"
            path.write_bytes(raw[:end])
            with pytest.raises(InputError):
                read_contents(path).array("s")


# --- the registry ----------------------------------------------------------------------------------------------------


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
