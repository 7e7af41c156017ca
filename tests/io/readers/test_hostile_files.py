"""Hostile files: empty, cut off, too large, or made to hurt, they are refused in a sentence, with little memory."""

from __future__ import annotations

import io
import os
import signal
import struct
import sys
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from reading import refused
from scipy.io import savemat

import mirrorfold as mf
from mirrorfold.common import memory
from mirrorfold.errors import InputError
from mirrorfold.io.readers import hdf5, read_contents


@pytest.mark.parametrize(
    "suffix", [".mat", ".h5", ".nc", ".npz", ".npy", ".csv", ".s2p", ".ts", ".cti", ".ply", ".pcd", ".x"]
)
def test_empty_and_mislabelled_files_are_refused(tmp_path, suffix):
    path = tmp_path / f"file{suffix}"
    path.write_bytes(b"")
    refused(path, "empty")
    path.write_bytes(b"\x00\x01\x02 this is none of the formats" * 20)
    refused(path)


def test_the_system_is_asked_for_free_memory_for_large_content_alone(tmp_path, monkeypatch):
    """To ask takes a millisecond, and a scan may be thousands of files of a few kilobytes."""
    asked = []
    monkeypatch.setattr(memory, "available_memory", lambda: asked.append(1) or 1e12)
    head, row = "# Hz S RI R 50\n", "%d 0 0\n"
    for rows, times in ((400, 0), (40_000, 1)):
        path = tmp_path / f"{rows}.s1p"
        path.write_text(head + "".join(row % (1 + n) for n in range(rows)))
        assert len(read_contents(path).spectra.frequency) == rows
        assert len(asked) == times


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


@pytest.mark.slow
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
