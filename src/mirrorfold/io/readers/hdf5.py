"""HDF5 files of any origin: MATLAB 7.3, netCDF-4, and files of instruments.

Links to other files, and data in other files, are refused: a file may only show what is in it. The HDF5 library runs in
a process of its own (`hdf5_process`), because damaged files can crash it or make it run for ever.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import subprocess
import sys
import threading
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader
from mirrorfold.io.readers.contents import Contents, Variable, check_expansion, check_memory, nbytes

SIGNATURE = b"\x89HDF\r\n\x1a\n"

COMPLEX_FIELDS = (("real", "imag"), ("r", "i"), ("re", "im"))
"""Names of real and imaginary part in compound types: of MATLAB 7.3, of h5py and h5netcdf, and of others."""

PATIENCE = 20.0
"""Longest time that the library may take to list the content of a file, also on a slow network [s]."""

SLOWEST = 10e6
"""Slowest rate of reading for which is waited [bytes/s]."""

SUFFIXES = (".h5", ".hdf5", ".he5")


class _Library:
    """The process that runs the library. It is started when needed, or when it has died, and ends with this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        atexit.register(self._stop)

    def start(self) -> None:
        """Start the process, if it does not run yet."""
        with self._lock:
            self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        """The process, which is started if it does not run yet."""
        if self._process is None:
            # The process can import from the same places as this one.
            environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "mirrorfold.io.readers.hdf5_process"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment,
            )  # fmt: skip
        return self._process

    def ask(self, question: dict[str, Any], expected: int = 0) -> tuple[dict[str, Any], bytearray]:
        """The answer to a question, and the bytes that follow it; `expected` is about their number.

        Raises
        ------
        InputError
            If the library crashes twice, or takes too long.
        """
        with self._lock:
            for _ in range(2):  # the first failure may come from an earlier file
                try:
                    return self._ask(question, PATIENCE + expected / SLOWEST)
                except TimeoutError:
                    raise InputError(
                        f"{question['path']}: is damaged: reading it does not end; copy it again"
                    ) from None
                except (OSError, EOFError, ValueError):
                    self._stop()
        raise InputError(f"{question['path']}: is damaged so that it stops the HDF5 library; copy or export it again")

    def _ask(self, question: dict[str, Any], patience: float) -> tuple[dict[str, Any], bytearray]:
        """The answer to a question; the process is killed, with a TimeoutError, after `patience` seconds."""
        process, late = self._start(), threading.Event()

        def end() -> None:
            late.set()
            process.kill()

        clock = threading.Timer(patience, end)
        clock.start()
        try:
            return self._talk(process, question)
        except (OSError, EOFError, ValueError):
            if not late.is_set():
                raise
            self._stop()
            raise TimeoutError from None
        finally:
            clock.cancel()

    @staticmethod
    def _talk(process: subprocess.Popen[bytes], question: dict[str, Any]) -> tuple[dict[str, Any], bytearray]:
        """Send a question to the process, and read the answer."""
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(question).encode() + b"\n")
        process.stdin.flush()
        answer = json.loads(process.stdout.readline())  # of a process that has died: an empty line, no JSON
        if not isinstance(answer, dict):
            raise ValueError("the answer is no object")
        body = bytearray(int(answer.get("bytes", 0)))
        view, at = memoryview(body), 0
        while at < len(body):
            found = process.stdout.readinto(view[at:])  # type: ignore[attr-defined]
            if not found:
                raise EOFError
            at += found
        return answer, body

    def _stop(self) -> None:
        """End the process, if it runs."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()


_library = _Library()


def prepare() -> None:
    """Start the process with the library, because a file will be read soon."""
    _library.start()


def check_netcdf(path: Path) -> None:
    """Check a netCDF-4 file before the library opens it in this process.

    Raises
    ------
    InputError
        If the file would crash or block the process that opens it; if it shows data of other files, by external links,
        external storage or virtual arrays; if its groups are no tree; if its texts or the blocks of its arrays would
        fill the memory; if it is damaged.
    """
    state = path.stat()
    answer = _checked(str(path.absolute()), state.st_mtime_ns, state.st_size)
    _check_answer(path, answer)
    check_memory(path, answer["varying"], "its texts")


@lru_cache(maxsize=16)
def _checked(path: str, changed: int, size: int) -> dict[str, Any]:
    """The answer of the library's process about a netCDF file, which is asked once as long as the file is the same."""
    return _library.ask({"path": path, "netcdf": True})[0]


def _check_answer(path: Path, answer: dict[str, Any]) -> None:
    """Refuse a file that the library's process refuses.

    Raises
    ------
    InputError
        With the reason in the answer.
    """
    if "refused" in answer:
        raise InputError(f"{path}: {answer['refused']}")
    if "damaged" in answer:
        raise InputError(f"{path}: is damaged or no HDF5 file ({answer['damaged']}); copy or export it again")


def read(path: Path) -> Contents:
    """Read an HDF5 file: all its arrays, each of which is read when it is needed; groups are joined by dots.

    MATLAB 7.3 stores arrays with reversed axes; here they have the order in which MATLAB shows them.
    """
    path = Path(path)
    answer, _ = _library.ask({"path": str(path.absolute())})
    _check_answer(path, answer)
    variables: dict[str, Variable] = {}
    for entry in answer["arrays"]:
        variable = _variable(path, entry, matlab=bool(answer["matlab"] or entry["matlab"]))
        if variable is not None:
            variables[entry["name"].replace("/", ".")] = variable
    if not variables:
        raise InputError(f"{path}: holds no array of numbers; save the measured variables into it")
    return Contents(path, READER.name, variables, answer["attrs"])


def _variable(path: Path, entry: dict[str, Any], *, matlab: bool) -> Variable | None:
    """An array that the library's process reads when it is needed; None for one that holds no numbers."""
    if "text" in entry:
        return Variable.of(np.array(entry["text"]))
    name, shape, stored = entry["name"], tuple(entry["shape"]), max(entry["stored"], 1)
    descr: Any = entry["descr"]
    parts: Any = descr if isinstance(descr, str) else [_field(field) for field in descr]
    dtype = np.lib.format.descr_to_dtype(parts)
    fields = complex_fields(dtype)
    if fields is None and dtype.kind not in "fciub":
        return None

    def load() -> NDArray:
        size = nbytes(shape, dtype.itemsize)
        check_expansion(path, stored, size, f"its variable {name!r}")
        answer, body = _library.ask({"path": str(path.absolute()), "name": name}, size)
        if "damaged" in answer or len(body) != size:
            raise InputError(f"{path}: {name!r} is damaged ({answer.get('damaged', 'cut off')}); copy it again")
        values = np.frombuffer(body, dtype).reshape(shape)
        if fields is not None:
            values = to_complex(values, fields)
        return values.T if matlab else values

    kind = dtype
    if fields is not None:
        kind = np.dtype(np.complex64 if dtype[fields[0]].itemsize <= 4 else np.complex128)
    dims = tuple(entry["dims"])
    return Variable(shape[::-1] if matlab else shape, kind, load, dims[::-1] if matlab else dims, entry["attrs"])


def _field(field: list[Any]) -> tuple[Any, ...]:
    """A field of a compound type, with the tuples that JSON has turned into lists."""
    return tuple(tuple(part) if isinstance(part, list) and n != 1 else part for n, part in enumerate(field))


def complex_fields(dtype: np.dtype) -> tuple[str, str] | None:
    """The names of real and imaginary part, if a compound type represents complex numbers; else None."""
    for real, imaginary in COMPLEX_FIELDS:
        if (
            dtype.names is not None
            and set(dtype.names) == {real, imaginary}
            and all(dtype[name].kind in "fiu" and dtype[name].shape == () for name in (real, imaginary))
        ):
            return real, imaginary
    return None


def to_complex(values: NDArray, fields: tuple[str, str]) -> NDArray:
    """Complex numbers from a structured array."""
    single = values.dtype[fields[0]].itemsize <= 4
    result = np.empty(values.shape, np.complex64 if single else np.complex128)
    result.real, result.imag = values[fields[0]], values[fields[1]]
    return result


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file has the signature of HDF5, at its beginning or after a user block."""
    if head[:8] == SIGNATURE or any(head[at : at + 8] == SIGNATURE for at in (512, 1024, 2048)):
        return True
    if path.suffix.lower() in SUFFIXES or head[:19] == b"MATLAB 7.3 MAT-file":
        raise InputError(f"{path}: seems to be HDF5 by its name or header and is not; copy it again")
    return False


READER = Reader("hdf5", "HDF5, netCDF-4 and MATLAB 7.3", recognises, read, SUFFIXES)
