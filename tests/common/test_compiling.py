"""Compiled kernels where nothing can be written, and where their files are damaged."""

from __future__ import annotations

import errno
import importlib.util
import os
import subprocess
import sys
import tempfile
import warnings

import numba
import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

from mirrorfold.common.kernels import njit

KERNEL = """
from mirrorfold.common.kernels import njit

@njit(nogil=True)
def double(x):
    return 2.0 * x
"""

SORTING = """
import numpy as np
from mirrorfold.common.kernels import njit

@njit(makes_arrays=True)
def smallest(x):
    return np.sort(x)[0]

@njit(makes_arrays=True)
def where_smallest(x):
    return np.argsort(x)[0]
"""

pytestmark = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")


@pytest.fixture
def hits(tmp_path, monkeypatch):
    """A function that imports a module with a kernel, as a new process does, and says how often its cache was hit."""
    for name in ("home", "temporary"):
        (tmp_path / name).mkdir()
    (tmp_path / "one.py").write_text(KERNEL)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))

    def hits():
        spec = importlib.util.spec_from_file_location("one", tmp_path / "one.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.double(21.0) == 42.0
        return sum(module.double.stats.cache_hits.values())

    return hits


def test_kernels_compile_where_nothing_can_be_written(hits, tmp_path, monkeypatch):
    # A file in the place of a folder stops the administrator, too, whom permissions do not.
    (tmp_path / "__pycache__").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "one.py"))
    with pytest.warns(UserWarning, match="NUMBA_CACHE_DIR chooses another place"):
        assert hits() == 0
    [folder] = (tmp_path / "temporary").iterdir()
    assert folder.stat().st_mode & 0o077 == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is said once
        assert hits() == 1
    # A folder that others may write to is not trusted.
    folder.chmod(0o777)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    with pytest.warns(UserWarning, match="they are kept in"):
        assert hits() == 0


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("length", [0, 20, -20])
def test_damaged_files_of_kernels_are_made_anew(hits, tmp_path, suffix, length):
    assert (hits(), hits()) == (0, 1)
    [file] = (tmp_path / "__pycache__").glob(f"one.double*.{suffix}")
    file.write_bytes(file.read_bytes()[:length])
    assert (hits(), hits()) == (0, 1)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_what_is_no_file_is_left_alone(hits, tmp_path):
    """Opening a pipe would wait for ever. The kernel is compiled, and not kept."""
    assert (hits(), hits()) == (0, 1)
    [index] = (tmp_path / "__pycache__").glob("one.double*.nbi")
    index.unlink()
    os.mkfifo(index)
    assert (hits(), hits()) == (0, 0)


@pytest.mark.parametrize("kept", [False, True])
def test_kernels_that_cannot_be_kept_are_compiled_all_the_same(hits, tmp_path, monkeypatch, kept):
    """As on a full disk, whether it has been full from the beginning, or damaged what was kept."""
    if kept:
        assert (hits(), hits()) == (0, 1)
        [file] = (tmp_path / "__pycache__").glob("one.double*.nbc")
        file.write_bytes(b"")

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for name in ("_save_index", "_save_data"):
        monkeypatch.setattr(IndexDataCacheFile, name, full)
    with pytest.warns(UserWarning, match=r"cannot be kept in .*__pycache__ \(No space left .*NUMBA_CACHE_DIR"):
        assert hits() == 0


@pytest.mark.parametrize(
    ("name", "old", "new", "result"),
    [("scale", "1.0", "1.5", 6.0), ("factor", "2.0", "3.0", 6.0), ("doubling", "FACTOR * x", "3.0 * x", 6.0)],
)
def test_kernels_are_compiled_anew_where_what_they_hold_has_changed(name, old, new, result, tmp_path, monkeypatch):
    """The kernel holds a kernel of another file and a constant of a third; the last change is one of its own."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python itself would not see a change within a second
    doubling = "from scale import scaled\nfrom factor import FACTOR\n" + KERNEL.replace("2.0 * x", "scaled(FACTOR * x)")
    texts = {
        "scale": KERNEL.replace("double", "scaled").replace("2.0 * x", "1.0 * x"),
        "factor": "FACTOR = 2.0\n",
        "doubling": doubling,
    }

    def doubled():
        for module, text in texts.items():
            path = tmp_path / f"{module}.py"
            if not path.exists() or path.read_text() != text:  # some versions of Numba look when a file was written
                path.write_text(text)
            sys.modules.pop(module, None)
        importlib.invalidate_caches()
        kernel = importlib.import_module("doubling").double
        return kernel(2.0), sum(kernel.stats.cache_hits.values())

    assert (doubled(), doubled()) == ((4.0, 0), (4.0, 1))
    texts[name] = texts[name].replace(old, new)
    assert (doubled(), doubled()) == ((result, 0), (result, 1))


def test_a_kernel_that_makes_arrays_must_say_so():
    @njit(makes_arrays=True)
    def twos(x):
        return 2.0 * np.ones(x)

    @njit()
    def threes(x):
        return 3.0 * np.ones(x)

    assert twos(2).tolist() == [2.0, 2.0]
    with pytest.raises(numba.TypingError):
        threes(2)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
def test_a_forked_process_numbers_its_functions_anew():
    number = "print(next(FunctionIdentity._unique_ids), flush=True)"
    begin = "import os\nimport mirrorfold.common.kernels\nfrom numba.core.bytecode import FunctionIdentity\n"
    program = f"{begin}if os.fork():\n    os.wait()\n{number}\n"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    one, other = map(int, run.stdout.split())
    assert abs(one - other) > 1000


@pytest.mark.slow
def test_kernels_that_two_processes_compiled_are_not_mistaken_for_each_other(tmp_path):
    """Both processes give the sorting functions within the kernels the same number, if each counts from one."""
    (tmp_path / "sorting.py").write_text(SORTING)
    begin = "import numpy as np, sorting\nfalling = np.arange(40.0)[::-1].copy()\n"
    skip = "from numba.core.bytecode import FunctionIdentity\n[next(FunctionIdentity._unique_ids) for _ in range(3)]\n"
    both = "print(sorting.smallest(falling), sorting.where_smallest(falling))"
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    for program in ("sorting.smallest(falling)", skip + "sorting.where_smallest(falling)", both):
        command = [sys.executable, "-c", begin + program]
        run = subprocess.run(command, env=os.environ | cache, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["0.0", "39"]
