"""Images in strips: where the memory is short, the same image to the same tolerance."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.focusing import imaging
from mirrorfold.focusing.checks import make_problem
from mirrorfold.focusing.choosing.caching import PlanCache
from mirrorfold.focusing.choosing.choice import options
from mirrorfold.focusing.choosing.strips import divide, table_bytes
from mirrorfold.focusing.settings import FocusSettings

TOLERANCE = 1e-3
GRID = {"x": np.linspace(-0.4, 0.4, 700), "y": np.linspace(0.15, 1.0, 500)}


@pytest.fixture(scope="module")
def echoes():
    """Two points, one near and strong and one far, seen by 61 antennas."""
    position = np.outer(0.5e-3 * (np.arange(61) - 30), [1.0, 0.0, 0.0])
    frequency = np.linspace(290e9, 300e9, 101)
    k = 2.0 * np.pi * frequency / 299792458.0
    s = np.zeros((101, 61, 61), dtype=complex)
    for point, strength in (([0.05, 0.3, 0.0], 1.0), ([-0.2, 0.8, 0.0], 0.01)):
        way = np.exp(-1j * k[:, None] * np.linalg.norm(position - point, axis=1))
        s += strength * way[:, :, None] * way[:, None, :]
    return mf.make_sweep(s, frequency=frequency, tx_position=position, rx_position=position)


@pytest.fixture(scope="module")
def problem(echoes):
    return make_problem(echoes, FocusSettings(**GRID, tolerance=TOLERANCE))[1].in_wavelengths


@pytest.fixture(scope="module")
def whole(echoes):
    return mf.focus(echoes, **GRID, tolerance=TOLERANCE, plans=PlanCache())


def options_of(problem):
    return options(problem, TOLERANCE)


def test_strips_cover_the_image_once_and_fit(problem):
    needed = table_bytes(problem, options_of(problem)[0])
    assert len(divide(problem, options_of, needed)) == 1
    strips = divide(problem, options_of, 0.7 * needed)
    assert len(strips) > 1
    assert all(table_bytes(strip.problem, strip.option) <= 0.7 * needed for strip in strips)
    np.testing.assert_array_equal(np.concatenate([strip.problem.y for strip in strips]), problem.y)
    assert [strip.rows[1].start for strip in strips[1:]] == [strip.rows[1].stop for strip in strips[:-1]]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.8, 0.65])
def test_strips_make_the_same_image_to_the_tolerance(echoes, problem, whole, monkeypatch, share):
    room = share * table_bytes(problem, options_of(problem)[0])
    monkeypatch.setattr(imaging, "room_for_tables", lambda *_, **__: room)
    with pytest.warns(UserWarning, match=r"it is made in \d+ strips"):
        found = mf.focus(echoes, **GRID, tolerance=TOLERANCE, plans=PlanCache())
    assert found.attrs["strips"] > 1
    assert whole.attrs["algorithm"] == "polar"
    assert found.attrs["error"] <= TOLERANCE
    apart = np.linalg.norm(found.values - whole.values) / np.linalg.norm(whole.values)
    assert 0.0 < apart < 2.0 * TOLERANCE


def test_a_volume_is_cut_along_its_height(problem):
    volume = problem.on(problem.x, problem.y, np.linspace(-40.0, 40.0, 8))
    needed = table_bytes(volume, options_of(volume)[0])
    strips = divide(volume, options_of, 0.8 * needed)
    assert sum(strip.problem.z.size for strip in strips) == 8
    assert all(strip.problem.y.size == problem.y.size for strip in strips)


def test_what_does_not_fit_in_strips_either_is_refused(echoes):
    with pytest.raises(mf.InputError, match=r"needs .* GB more than it may have, though it is made in strips"):
        mf.focus(echoes, **GRID, tolerance=TOLERANCE, memory_limit=1e6)


@pytest.mark.slow
def test_a_dry_run_says_so_and_the_limit_may_have_a_unit(echoes, tmp_path, capsys, monkeypatch):
    path = mf.save(echoes, tmp_path / "sweep.nc")
    grid = ["--x", "-0.4:0.4:0.0012", "--y", "0.15:1:0.0017", "--tolerance", "1e-3"]
    assert main(["focus", str(path), "--dry-run", "--memory-limit", "1 MB", *grid]) == 2
    assert "ask for fewer pixels, close other programs, or raise the limit" in capsys.readouterr().err
    assert main(["focus", str(path), "--dry-run", "--json", "--memory-limit", "900GB", *grid]) == 0
    plenty = check("focus", capsys.readouterr().out)
    from mirrorfold.focusing import forecast

    room = 20e6
    monkeypatch.setattr(forecast, "room_for_tables", lambda *_, **__: room)
    assert main(["focus", str(path), "--dry-run", "--json", *grid]) == 0
    found = json.loads(capsys.readouterr().out)
    assert plenty.remarks == []
    assert found["remarks"][0].startswith("The memory does not hold the tables of the whole image: it is made in")
    assert found["memory_gb"] < plenty.memory_gb


HARD = """
import resource, sys, warnings
import numpy as np
import mirrorfold as mf
from mirrorfold.common.memory import _number, PROC
warnings.simplefilter("ignore")
sweep = mf.load(sys.argv[1])
mf.focus(sweep, x=np.linspace(-0.1, 0.1, 150), y=np.linspace(0.2, 0.3, 240), tolerance=1e-3)  # loads the kernels
mf.focusing.plan_cache.clear()
most = int(1024 * _number(PROC / "self/status", "VmSize:") + float(sys.argv[2]))
resource.setrlimit(resource.RLIMIT_AS, (most, most))
image = mf.focus(sweep, x=np.linspace(-0.4, 0.4, 1200), y=np.linspace(0.15, 1.0, 800), tolerance=1e-3)
print(image.attrs["strips"], image.attrs["error"])
"""


@pytest.mark.slow
def test_under_a_hard_limit_the_image_is_made_nevertheless(echoes, tmp_path):
    pytest.importorskip("resource")
    path = mf.save(echoes, tmp_path / "sweep.nc")
    done = subprocess.run(
        [sys.executable, "-c", HARD, str(path), "1.65e8"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    strips, error = done.stdout.split()
    assert int(strips) > 1
    assert float(error) <= TOLERANCE


MEASURED = """
import sys
from pathlib import Path
import numpy as np
import mirrorfold as mf
from mirrorfold.common.memory import PROC, _number
sweep = mf.load(sys.argv[1])
tiny = sweep.isel(frequency=slice(0, 21), tx=slice(0, 3), rx=slice(0, 3)).copy(deep=True)
mf.focus(tiny, x=np.linspace(-0.1, 0.1, 30), y=np.linspace(0.3, 0.5, 30), tolerance=1e-3)  # loads the exact kernels
Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here on
before = _number(PROC / "self/status", "VmRSS:")
found = mf.focusing.choose_algorithm(sweep, tolerance=1e-3)
mf.focus(sweep, tolerance=1e-3)
print(1e9 * found.memory_gb - sweep["s"].nbytes, 1024.0 * (_number(PROC / "self/status", "VmHWM:") - before))
"""


@pytest.mark.timing  # how many blocks are in memory at once depends on what else runs
@pytest.mark.parametrize(("elements", "frequencies"), [(81, 201), (121, 401)])
def test_the_memory_that_is_forecast_is_taken(tmp_path, elements, frequencies):
    if not sys.platform.startswith("linux"):
        pytest.skip("the peak of a process can be counted anew on Linux alone")
    position = np.outer(0.5e-3 * (np.arange(elements) - (elements - 1) / 2), [1.0, 0.0, 0.0])
    frequency = np.linspace(290e9, 300e9, frequencies)
    s = np.random.default_rng(0).standard_normal((frequencies, elements, 2 * elements)).astype(np.float32)
    sweep = mf.make_sweep(s.view(np.complex64), frequency=frequency, tx_position=position, rx_position=position)
    path = mf.save(sweep, tmp_path / "sweep.nc")
    done = subprocess.run([sys.executable, "-c", MEASURED, str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    forecast, taken = map(float, done.stdout.split())
    assert taken == pytest.approx(forecast, rel=0.25)
