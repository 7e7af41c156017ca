"""Kernels are compiled by a second process, in time for the first one."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from scipy.spatial import cKDTree

import mirrorfold as mf
from mirrorfold.cli import compiling
from mirrorfold.cli.compiling import THING, WALL, kernels_compiled_beside, small_sweep
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.common.kernels import is_compiled, njit

COUNTED = """
import sys
from numba.core import dispatcher
import mirrorfold as mf

compiled, compile = [], dispatcher._FunctionCompiler.compile

def counted(self, *arguments):
    if self.py_func.__module__.startswith("mirrorfold"):
        compiled.append(self.py_func.__qualname__)
    return compile(self, *arguments)

dispatcher._FunctionCompiler.compile = counted
mf.reconstruct(mf.load(sys.argv[1]))
print(*compiled)
"""


@pytest.mark.slow
def test_the_small_sweep_shows_a_wall_and_a_thing_in_it():
    found = mf.reconstruct(small_sweep())
    wall, thing = np.array(WALL), np.array(THING)
    (mirror,) = mf.info(found).mirrors
    ends = np.array([mirror.start_m, mirror.end_m])
    assert np.hypot(*(ends[1] - ends[0])) == pytest.approx(np.hypot(*(wall[1] - wall[0])), abs=0.1)
    folded = reflect(
        thing[0] + np.linspace(0.0, 1.0, 50)[:, None] * (thing[1] - thing[0]), wall[0], segment_normal(*wall)
    )
    objects = found["objects"].to_dataset()
    points = np.stack([objects["x"], objects["y"]], axis=-1)[objects["bounces"].values == 1]
    assert cKDTree(points).query(folded)[0].max() < 0.03


@pytest.mark.replay
def test_the_other_process_compiles_all_that_a_reconstruction_needs(tmp_path):
    mf.save(mf.simulate(mf.load_scene("src/mirrorfold/scenes/shipped/hidden_corner.toml")), tmp_path / "sweep.nc")
    cold = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    subprocess.run([sys.executable, "-P", "-m", "mirrorfold.cli.compiling"], env=cold, check=True)
    words = [sys.executable, "-c", COUNTED, str(tmp_path / "sweep.nc")]
    done = subprocess.run(words, env=cold, check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize(("compiled", "cores"), [(True, 2), (False, 1)])
def test_no_process_is_started_where_it_is_of_no_use(monkeypatch, compiled, cores):
    monkeypatch.setattr("mirrorfold.common.kernels.is_compiled", lambda kernel: compiled)
    monkeypatch.setattr("mirrorfold.common.threads.cpu_count", lambda: cores)
    started, run = [], []
    monkeypatch.setattr(compiling.subprocess, "Popen", lambda *words, **options: nullcontext(started.append(words)))
    with kernels_compiled_beside():
        run.append(1)
    assert run == [1]
    assert started == []


def test_the_other_process_ends_with_the_first(monkeypatch):
    started = []

    class Process(subprocess.Popen):
        def __init__(self, words, **options):
            super().__init__([sys.executable, "-c", "import time; time.sleep(60)"], **options)
            started.append(self)

    monkeypatch.setattr("mirrorfold.common.kernels.is_compiled", lambda kernel: False)
    monkeypatch.setattr("mirrorfold.common.threads.cpu_count", lambda: 2)
    monkeypatch.setattr(compiling.subprocess, "Popen", Process)
    with pytest.raises(KeyboardInterrupt), kernels_compiled_beside():
        raise KeyboardInterrupt
    (process,) = started
    assert process.returncode is not None


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="nothing is compiled")
def test_a_kernel_is_compiled_once_it_was_called(tmp_path, monkeypatch):
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path))
    kernel = njit()(_twice)
    assert not is_compiled(kernel)
    assert kernel(2.0) == 4.0
    assert is_compiled(kernel)


def _twice(number):
    return 2.0 * number
