"""Small valid files of all formats that mirrorfold reads, other than its own."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np


def seeds(folder: Path) -> dict[str, bytes]:
    """A small valid file of every format, by name."""
    import h5py
    from scipy.io import netcdf_file, savemat

    rng = np.random.default_rng(0)
    s = (rng.standard_normal((7, 3)) + 1j * rng.standard_normal((7, 3))).astype(np.complex64)
    f = np.linspace(1e9, 2e9, 7)
    place = rng.standard_normal((3, 3))
    found: dict[str, bytes] = {}
    for name, compressed in (("plain.mat", False), ("packed.mat", True)):
        file = io.BytesIO()
        inner = {"fp": s, "freq": f, "x": place[:, 0], "y": place[:, 1], "z": place[:, 2], "label": "abc"}
        savemat(file, {"data": inner, "cells": np.array([1.0, "two"], dtype=object), "n": 3}, do_compression=compressed)
        found[name] = file.getvalue()
    for name, block in (("new.mat", 512), ("data.h5", 0), ("netcdf4.nc", 0)):
        path = folder / name
        with h5py.File(path, "w", userblock_size=block) as hdf:
            pair = np.dtype([("real", "<f4"), ("imag", "<f4")])
            hdf["s"] = s.view(pair) if block else s
            hdf["frequency"] = f
            group = hdf.create_group("array")
            group.create_dataset("position", data=place, compression="gzip")
            hdf.attrs["title"] = "seed"
            if name.endswith(".nc"):
                hdf["frequency"].make_scale("frequency")
                hdf["s"].dims[0].attach_scale(hdf["frequency"])
        raw = bytearray(path.read_bytes())
        if block:
            raw[:21] = b"MATLAB 7.3 MAT-file, "
            raw[124:128] = b"\x00\x02IM"
        found[name] = bytes(raw)
    path = folder / "session.h5"
    with h5py.File(path, "w") as hdf:
        subsweep = {"start_point": 24, "num_points": 6, "step_length": 4}
        hdf["generation"] = "a121"
        hdf["sessions/session_0/session_config"] = json.dumps({"groups": [{"1": {"subsweeps": [subsweep] * 2}}]})
        entry = hdf.create_group("sessions/session_0/group_0/entry_0")
        entry["metadata"] = json.dumps(
            {"base_step_length_m": 0.0025, "subsweep_data_offset": [0, 6], "subsweep_data_length": [6, 6]}
        )
        entry["result/frame"] = np.zeros((4, 1, 12), dtype=[("real", "<i2"), ("imag", "<i2")])
    found["session.h5"] = path.read_bytes()
    file = io.BytesIO()
    with netcdf_file(file, "w") as nc:
        nc.createDimension("record", None)
        nc.createDimension("frequency", 7)
        nc.createVariable("frequency", "f8", ("frequency",))[:] = f
        nc.createVariable("s_re", "f4", ("record", "frequency"))[:] = s.real.T
        nc.flush()
        found["classic.nc"] = file.getvalue()
    for name, values in (("array.npy", s), ("fields.npy", np.zeros(4, [("real", "f4"), ("imag", "f4")]))):
        file = io.BytesIO()
        np.save(file, values)
        found[name] = file.getvalue()
    for name, save in (("many.npz", np.savez), ("packed.npz", np.savez_compressed)):
        file = io.BytesIO()
        save(file, s=s, frequency=f, tx=place, rx=place)
        found[name] = file.getvalue()
    rows = [",".join(f"{z.real:.6g}{z.imag:+.6g}i" for z in row) for row in s]
    found["complex.csv"] = "\n".join(rows).encode()
    re_im = [f"{hz:.6g},{z.real:.6g},{z.imag:.6g}" for hz, z in zip(f, s[:, 0], strict=True)]
    found["parts.csv"] = "\n".join(["frequency [Hz],re,im", *re_im]).encode()
    found["rs.csv"] = "\n".join(
        ["freq[Hz];re:Trc1_S21;im:Trc1_S21;", *(r.replace(",", ";") + ";" for r in re_im)]
    ).encode()
    head = ["!CSV A.10.45.04", "!Date: Monday", "BEGIN CH1_DATA", "Freq(Hz),S11 Log Mag(dB),S11 Phase(deg)"]
    found["pna.csv"] = "\n".join([*head, *re_im, "END"]).encode()
    citi = ["CITIFILE A.01.00", "NAME DATA", "VAR FREQ MAG 7", "DATA S[1,1] RI", "SEG_LIST_BEGIN", "SEG 1E9 2E9 7"]
    citi += ["SEG_LIST_END", "BEGIN", *(r.split(",", 1)[1] for r in re_im), "END"]
    found["trace.cti"] = "\n".join(citi).encode()
    found["one.s1p"] = "\n".join(["! made", "# Hz S RI R 50", *(r.replace(",", " ") for r in re_im)]).encode()
    two = [r.replace(",", " ") + " 0 0 0 0 0 0" for r in re_im]
    found["two.s2p"] = "\n".join(["# GHz S MA R 50", *two]).encode()
    version2 = ["[Version] 2.0", "# Hz S RI R 50", "[Number of Ports] 1", "[Number of Frequencies] 7", "[Network Data]"]
    found["new.ts"] = "\n".join([*version2, *(r.replace(",", " ") for r in re_im), "[End]"]).encode()
    ply = ["ply", "format {}", "element vertex 3", *(f"property float {a}" for a in "xyz"), "end_header", ""]
    text = "\n".join(" ".join(map(str, row)) for row in place)
    found["cloud.ply"] = ("\n".join(ply).format("ascii 1.0") + text).encode()
    found["binary.ply"] = "\n".join(ply).format("binary_little_endian 1.0").encode() + place.astype("<f4").tobytes()
    pcd = ["VERSION .7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", "WIDTH 3", "HEIGHT 1", "POINTS 3"]
    found["cloud.pcd"] = "\n".join([*pcd, "DATA binary", ""]).encode() + place.astype("<f4").tobytes()
    found["text.pcd"] = "\n".join([*pcd, "DATA ascii", text]).encode()
    lines = [f"one.s1p,{row[0]:.6g},{row[1]:.6g},{row[2]:.6g}" for row in place[:1]]
    found["positions.csv"] = "\n".join(["file,x_mm,y_mm,z_mm", *lines]).encode()
    found["scan.toml"] = b'file = [{file = "one.s1p", position = [0.0, 0.0, 0.0]}]\nunit = "mm"\ntitle = "seed"\n'
    found["scan.json"] = json.dumps({"measurements": [{"filename": "one.s1p", "azimuth": 1, "elevation": 2}]}).encode()
    mapping = 's = {variable = "s", dims = ["frequency", "position"]}\nfrequency = "frequency"\n'
    mapping += 'antenna = {position = "tx"}\n'
    found["mapping.toml"] = mapping.encode()
    return found
