"""Feed every reader with damaged files: nothing but InputError may come out, in little time and memory.

    python benchmarks/fuzz_readers.py --cases 1000000 --seed 1

Valid files of every format are mutated - bits, bytes, lengths, numbers, pieces cut, doubled, exchanged between files,
names of other formats - and read in a process of their own, which a crash of a library would end. `tests` run a small
part of it.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

SECONDS_A_CASE = 20.0
"""A case that takes more CPU time has hung."""

SECONDS_FOR_HDF5 = 5.0
"""How long the library may take for the small files here; a file that hangs it costs this."""

PEAK_BYTES = 1 << 30
"""What the whole process may take at its peak."""

SPECIAL = [
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\0",
    b"\x80\0\0\0",
    b"\xff" * 8,
    b"\0" * 8,
]
NUMBERS = [b"-1", b"0", b"1e999", b"nan", b"99999999999999999999", b"4294967296", b"1e-320", b"x", b"", b"1_0", b"0x10"]


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


def mutate(raw: bytes, others: list[bytes], rng: np.random.Generator) -> bytes:
    """The file with a few mistakes."""
    data = bytearray(raw)
    for _ in range(int(rng.integers(1, 5))):
        if not data:
            break
        kind, at = int(rng.integers(0, 12)), int(rng.integers(0, len(data)))
        length = int(rng.integers(1, 33))
        if kind <= 1:
            data[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 2:
            data[at] = int(rng.integers(0, 256))
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            del data[at : at + length]
        elif kind == 5:
            data[at:at] = data[at : at + length]
        elif kind == 6:
            special = SPECIAL[int(rng.integers(0, len(SPECIAL)))]
            data[at : at + len(special)] = special
        elif kind == 7:
            data[at:at] = rng.bytes(length)
        elif kind == 8:
            data[at : at + 4] = struct.pack("<I", int(rng.integers(0, 1 << 32)))
        elif kind == 9:
            other = others[int(rng.integers(0, len(others)))]
            start = int(rng.integers(0, len(other)))
            data[at : at + length] = other[start : start + length]
        elif kind == 10:
            digits = [n for n in range(at, min(at + 200, len(data))) if 48 <= data[n] <= 57]
            if digits:
                end = digits[0]
                while end < len(data) and 48 <= data[end] <= 57:
                    end += 1
                data[digits[0] : end] = NUMBERS[int(rng.integers(0, len(NUMBERS)))]
        else:
            data += data[at : at + length]
    return bytes(data)


class Hung(BaseException):
    """A case takes too long; no reader may catch this."""


def feed(path: Path, choice: int) -> str:
    """Read a file in all ways that its name allows; says what came of it.

    Raises
    ------
    Exception
        Whatever is no InputError.
    """
    from mirrorfold.errors import InputError
    from mirrorfold.io.guess import guess_mapping
    from mirrorfold.io.images import import_image
    from mirrorfold.io.importing import import_data
    from mirrorfold.io.mapping import load_mapping
    from mirrorfold.io.readers import read_contents

    try:
        if path.name.startswith(("positions", "scan")):
            import_data(path.parent / "one.s1p", positions=path)
        elif path.name.startswith("mapping"):
            import_data(path.parent / "many.npz", mapping=load_mapping(path))
        elif choice == 0:
            guess_mapping(path)
        elif choice == 1:
            import_image(path)
        elif choice == 2:
            import_data(path)
        else:
            contents = read_contents(path)
            for name in contents.variables:
                contents.array(name)
        return "read"
    except InputError as error:
        if len(str(error)) > 2000:
            raise ValueError(f"the message has {len(str(error))} letters") from error
        return "refused"


def run_cases(seed: int, first: int, cases: int, folder: Path, formats: list[str] | None = None) -> Counter[str]:
    """Feed so many cases, numbered from `first`; each depends on the seed and its number alone."""
    from mirrorfold.io.readers import hdf5

    patience, hdf5.PATIENCE = hdf5.PATIENCE, SECONDS_FOR_HDF5
    files = seeds(folder)
    for name in ("one.s1p", "many.npz"):
        (folder / name).write_bytes(files[name])
    names = [name for name in files if formats is None or any(part in name for part in formats)]
    counts: Counter[str] = Counter()

    def hang(*_: object) -> None:
        raise Hung

    previous = signal.signal(signal.SIGPROF, hang)
    try:
        for case in range(first, first + cases):
            rng = np.random.default_rng([seed, case])
            name = names[case % len(names)]
            raw = mutate(files[name], list(files.values()), rng)
            if rng.random() < 0.05:  # a file by the name of another format
                name = f"other{Path(names[int(rng.integers(0, len(names)))]).suffix}"
            path = folder / (f"case-{name}" if not name.startswith(("positions", "scan", "mapping")) else name)
            path.write_bytes(raw)
            signal.setitimer(signal.ITIMER_PROF, SECONDS_A_CASE)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    counts[f"{Path(name).suffix} {feed(path, int(rng.integers(0, 6)))}"] += 1
            except (Exception, Hung) as error:
                path.rename(path.with_name(f"failed-{seed}-{case}-{name}"))
                raise AssertionError(f"seed {seed}, case {case}, {name}: {type(error).__name__}: {error}") from error
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
                path.unlink(missing_ok=True)
    finally:
        signal.signal(signal.SIGPROF, previous)
        hdf5.PATIENCE = patience
    return counts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--formats", nargs="*", help="only names that hold one of these")
    parser.add_argument("--block", type=int, default=10_000, help="cases in each process")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        import faulthandler

        faulthandler.enable()
        base = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
        folder = Path(tempfile.mkdtemp(dir=base, prefix="fuzz"))
        print(folder, file=sys.stderr)
        counts = run_cases(options.seed, options.first, options.cases, folder, options.formats)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        assert peak < PEAK_BYTES, f"the readers took {peak / 2**20:.0f} MiB"
        print(json.dumps({"counts": counts, "peak": peak}))
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
        return 0
    total: Counter[str] = Counter()
    start, peak, failed = time.perf_counter(), 0, 0
    for first in range(options.first, options.first + options.cases, options.block):
        cases = min(options.block, options.first + options.cases - first)
        command = [
            sys.executable,
            __file__,
            "--child",
            f"--seed={options.seed}",
            f"--first={first}",
            f"--cases={cases}",
        ]
        command += ["--formats", *options.formats] if options.formats else []
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            failed += 1
            print(f"cases {first} to {first + cases} failed ({done.returncode}):\n{done.stderr[-3000:]}", flush=True)
            continue
        found = json.loads(done.stdout)
        total.update(found["counts"])
        peak = max(peak, found["peak"])
        seconds = time.perf_counter() - start
        print(
            f"{sum(total.values())} cases, {failed} blocks failed, {seconds:.0f} s, peak {peak / 2**20:.0f} MiB",
            flush=True,
        )
    print("\n| files | cases | refused | read |\n|---|---|---|---|")
    for suffix in sorted({key.split()[0] for key in total}):
        refused, read = total[f"{suffix} refused"], total[f"{suffix} read"]
        print(f"| {suffix} | {refused + read} | {refused} | {read} |")
    print(f"| all | {sum(total.values())} | | |")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
