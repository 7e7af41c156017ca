"""Memory: what each heavy verb is forecast to take, what it takes, and what it does where there is less."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.calibration.memory import calibration_parts
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.common.forecasts import total
from mirrorfold.focusing.scans import imaging as scans
from mirrorfold.simulation import estimate
from mirrorfold.simulation.rays import sweep as rays
from mirrorfold.sweep import make_raster_sweep

C = 299792458.0


def rough(name, start, end):
    """A rough wall of plasterboard."""
    return {"name": name, "kind": "segment", "start": start, "end": end, "material": "plasterboard",
            "roughness": {"rms_height": 5e-5, "correlation_length": 2e-4}}  # fmt: skip


def room(elements, points):
    """A scene of two rough walls."""
    return mf.parse_scene({
        "name": "room", "array": {"elements": elements, "pitch": 5e-4},
        "band": {"start": 290e9, "stop": 300e9, "points": points},
        "surface": [rough("a", [-1.0, 2.0], [1.0, 2.2]), rough("b", [1.1, 0.5], [1.3, 2.5])],
    })  # fmt: skip


def sphere(elements, points):
    """The echoes of a point at one metre, in a little noise."""
    position = np.outer(5e-4 * (np.arange(elements) - (elements - 1) / 2), [1.0, 0.0, 0.0])
    frequency = 290e9 + 50e6 * np.arange(points)  # unambiguous to 3 m
    way = np.exp(-2j * np.pi / C * frequency[:, None] * np.linalg.norm(position - [0.0, 1.0, 0.0], axis=1))
    s = (way[:, :, None] * way[:, None, :]).astype(np.complex64)
    random = np.random.default_rng(0)
    s += 1e-2 * random.standard_normal((*s.shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    return mf.make_sweep(s, frequency=frequency, tx_position=position, rx_position=position)


def scan(columns, rows, points):
    """A raster scan of a wall at 1.5 m, in a little noise."""
    azimuth, elevation = np.linspace(-20.0, 20.0, columns), np.linspace(-15.0, 15.0, rows)
    frequency = 220e9 + 50e6 * np.arange(points)  # unambiguous to 3 m
    range_ = 1.5 / (np.cos(np.radians(azimuth))[:, None] * np.cos(np.radians(elevation)))
    s = np.exp(-4j * np.pi / C * frequency[:, None, None] * range_).astype(np.complex64)
    random = np.random.default_rng(0)
    s += 1e-3 * random.standard_normal((*s.shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    return make_raster_sweep(s, frequency=frequency, azimuth=azimuth, elevation=elevation, origin=(0.0, 0.0, 0.0),
                             spot_radius=0.01, focus_distance=1.5)  # fmt: skip


VOXELS = {"x": np.linspace(-0.4, 0.4, 41), "y": np.linspace(1.2, 1.8, 31), "z": np.linspace(-0.3, 0.3, 21)}


def test_voxels_made_in_tiles_are_the_same_to_the_bit(monkeypatch):
    sweep = scan(40, 30, 101)
    whole = mf.focus(sweep, **VOXELS)
    tiles = []
    monkeypatch.setattr(scans, "_tiles", lambda profiles, room: tiles.extend(scans._cut(40, 7)) or tiles)
    found = mf.focus(sweep, **VOXELS)
    assert len(tiles) == 7
    assert [tile.start for tile in tiles[1:]] == [tile.stop - 1 for tile in tiles[:-1]]
    np.testing.assert_array_equal(found.values, whole.values)
    np.testing.assert_array_equal(whole.values, mf.to_voxels(mf.focus(sweep), **VOXELS).values)
    assert whole.values.max() > 0.0


@pytest.mark.slow
def test_a_scan_is_folded_by_its_amplitude_as_by_its_volume():
    sweep = scan(40, 30, 101)
    volume = mf.focus(sweep)
    folded, reconstructed = mf.fold(volume), mf.reconstruct(sweep)
    for path in ("/", "/objects", "/mirrors"):
        for name, values in folded[path].to_dataset(inherit=False).variables.items():
            np.testing.assert_array_equal(values, reconstructed[path].to_dataset(inherit=False).variables[name])
    assert folded["objects"].sizes["point"] > 0


def test_a_limit_tells_how_many_tiles_there_are_or_refuses():
    sweep = scan(40, 30, 101)
    free = scans.choose_scan(sweep, scans.FocusSettings(**VOXELS))
    assert free.remarks == []
    with pytest.raises(mf.InputError, match=r"sweep: the range profiles of 40 x 30 beams need about .* GB"):
        mf.focus(sweep, memory_limit=1e6)
    with pytest.raises(mf.InputError, match=r"voxels need|made in tiles"):
        mf.focus(sweep, **VOXELS, memory_limit=1e6)


@pytest.mark.slow
def test_rays_in_tiles_give_the_same_sweep(monkeypatch):
    scene = room(11, 21)
    whole = mf.simulate(scene)["s"].values
    for count, nbytes in ((1, 1e4), (5, 1e5)):
        monkeypatch.setattr(rays, "tiles_that_fit", lambda visible, limit, found=(count, nbytes): found)
        tiled = mf.simulate(scene)["s"].values
        assert np.linalg.norm(tiled - whole) <= 1e-6 * np.linalg.norm(whole)
    assert np.abs(whole).max() > 0.0


def test_the_paths_that_are_counted_are_traced():
    scene = room(11, 21)
    found = estimate(scene)
    visible = rays.find_visible(scene, bounces=3, seed=0)
    diffuse = rays.diffuse_paths(scene, visible.outline, visible.to_tx, visible.scatterers)
    traced = sum(paths.point.size for paths in [*diffuse, *rays.specular_paths(visible)])
    assert found.paths == pytest.approx(traced, rel=0.05)
    assert found.scatterers == len(visible.scatterers)
    assert sum(len(tile) for tile in visible.scatterers.tiles(7)) == found.scatterers
    assert found.tiles == 1


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A folder with an image, a sweep and a scene."""
    monkeypatch.chdir(tmp_path)
    sweep = sphere(61, 101)
    mf.save(sweep, "sweep.nc")
    mf.save(mf.focus(sweep, x=np.linspace(-0.2, 0.2, 400), y=np.linspace(0.6, 1.2, 300)), "image.nc")
    (tmp_path / "scene.toml").write_text(
        'name = "wall"\narray = {elements = 11, pitch = 5e-4}\nband = {start = 290e9, stop = 300e9, points = 11}\n'
        '[[surface]]\nname = "wall"\nkind = "segment"\nstart = [-1, 1]\nend = [1, 1]\nmaterial = "plasterboard"\n'
        "roughness = {rms_height = 5e-5, correlation_length = 2e-4}\n"
    )
    return tmp_path


COMMANDS = {"fold": "image.nc", "calibrate": "sweep.nc", "simulate": "scene.toml"}


@pytest.mark.parametrize("verb", COMMANDS)
def test_a_dry_run_names_what_takes_the_memory(verb, files, capsys):
    before = sorted(files.iterdir())
    assert main([verb, COMMANDS[verb], "--dry-run", "--json"]) == 0
    found = check(verb, capsys.readouterr().out)
    assert found.memory_gb == pytest.approx(sum(found.parts_gb.values()))
    assert main([verb, COMMANDS[verb], "--dry-run"]) == 0
    assert "memory" in capsys.readouterr().out
    assert sorted(files.iterdir()) == before


@pytest.mark.parametrize("verb", COMMANDS)
def test_what_does_not_fit_is_refused_in_a_sentence(verb, files, capsys):
    before = sorted(files.iterdir())
    assert main([verb, COMMANDS[verb], "-o", "out.nc", "--memory-limit", "2MB"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "GB" in said
    assert "raise the limit" in said
    assert sorted(files.iterdir()) == before


def test_full_waves_take_no_limit(files, capsys):
    assert main(["simulate", "scene.toml", "-o", "out.nc", "--solver", "fullwave", "--memory-limit", "2GB"]) == 2
    assert "memory_limit is an option of the solver 'rays'" in capsys.readouterr().err


@pytest.mark.slow
def test_the_forecast_is_told_before_the_work(files, capsys):
    assert main(["calibrate", "sweep.nc", "-o", "out.nc", "--conjugate", "--verbose"]) == 0
    assert "of memory are forecast (sweep" in capsys.readouterr().err
    assert main(["calibrate", "sweep.nc", "-o", "out.nc", "--conjugate"]) == 0
    assert "forecast" not in capsys.readouterr().err


def test_a_calibration_is_forecast_by_its_largest_step():
    sweep = sphere(21, 41)
    samples = sweep["s"].nbytes
    assert total(calibration_parts(sweep)) < total(calibration_parts(sweep, changed=True))
    assert calibration_parts(sweep, spheres=2)["aligned echoes"] == 2 * samples
    assert calibration_parts(sweep, spheres=2)["spheres"] == 2 * samples
    assert total(calibration_parts(sweep, autofocus=True)) > 4 * samples


MEASURED = """
import sys, json, shlex, io, contextlib, gc, warnings
from pathlib import Path
from mirrorfold.cli import main
from mirrorfold.common.memory import PROC, _number
warnings.simplefilter("ignore")

def call(line):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(shlex.split(line)) == 0
    return out.getvalue()

call(sys.argv[1])  # loads libraries and kernels
forecast = json.loads(call(sys.argv[2] + " --dry-run --json"))["memory_gb"]
gc.collect()
Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here on
before = _number(PROC / "self/status", "VmRSS:")
call(sys.argv[2] + " -o out.nc")
print(1e9 * forecast, 1024.0 * (_number(PROC / "self/status", "VmHWM:") - before))
"""


def image(pixels):
    """An image of noise that fills a quarter of a million cells."""
    found = mf.focus(sphere(61, 101), x=np.linspace(-0.6, 0.6, pixels), y=np.linspace(0.3, 1.4, pixels), tolerance=1e-3)
    return found


TOML = (
    'name = "room"\narray = {{elements = {}, pitch = 5e-4}}\nband = {{start = 290e9, stop = 300e9, points = {}}}\n'
    + "".join(
        f'[[surface]]\nname = "{name}"\nkind = "segment"\nstart = {start}\nend = {end}\nmaterial = "plasterboard"\n'
        "roughness = {{rms_height = 5e-5, correlation_length = 2e-4}}\n"
        for name, start, end in (("a", [-1.0, 2.0], [1.0, 2.2]), ("b", [1.1, 0.5], [1.3, 2.5]))
    )
)


CASES = {
    "fold an image": ("fold", image, (300,), [(1500,), (2200,)], ""),
    "fold a volume": ("fold", lambda *size: mf.focus(scan(*size)), (12, 10, 41), [(80, 60, 301), (120, 90, 301)], ""),
    "calibrate by background": ("calibrate", sphere, (7, 21), [(101, 201), (131, 301)], "--background {}"),
    "calibrate by sphere": ("calibrate", sphere, (7, 21), [(81, 201), (121, 301)], "--sphere {} --sphere-at 0,1"),
    "simulate": ("simulate", None, (5, 5), [(61, 101), (101, 201)], ""),
}


@pytest.mark.slow
@pytest.mark.timing  # how many blocks are in memory at once depends on what else runs
@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("case", CASES)
def test_the_memory_that_is_forecast_is_taken(case, which, tmp_path):
    if not sys.platform.startswith("linux"):
        pytest.skip("the peak of a process can be counted anew on Linux alone")
    verb, make, tiny, sizes, options = CASES[case]
    lines = []
    for name, size in (("tiny", tiny), ("real", sizes[which])):
        path = tmp_path / f"{name}.{'toml' if make is None else 'nc'}"
        if make is None:
            path.write_text(TOML.format(*size))
        else:
            mf.save(make(*size), path)
        given = options.format(path) if "sphere" in options else options.format(tmp_path / "other.nc")
        if "background" in options:
            other = make(*size)
            mf.save(other.assign(s=0.5 * other["s"]), path.with_name(f"other_{name}.nc"))
            given = options.format(path.with_name(f"other_{name}.nc"))
        lines.append(f"{verb} {path} {given}")
    lines[0] += " -o tiny_out.nc"
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *lines], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    forecast, taken = map(float, done.stdout.split())
    print(f"{case}: forecast {forecast / 1e6:.0f} MB, taken {taken / 1e6:.0f} MB")
    assert taken == pytest.approx(forecast, rel=0.25)


HARD = """
import resource, sys
import numpy as np
import mirrorfold as mf
from mirrorfold.common.memory import _number, PROC
sys.path.insert(0, sys.argv[1])
from test_forecasts import VOXELS, room, scan, rays

tiles = []
counted = rays.tiles_that_fit
def count(*given):
    tiles.append(counted(*given))
    return tiles[-1]
rays.tiles_that_fit = count

def limited(work, nbytes):
    work(True)  # loads kernels and starts threads
    most = int(1024 * _number(PROC / "self/status", "VmSize:") + nbytes)
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
    try:
        return work(False)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))

small, large = scan(8, 6, 41), scan(160, 120, 201)
scene = room(61, 101)
voxels = limited(lambda warm: mf.focus(small if warm else large, **VOXELS), 2.2e7)
swept = limited(lambda warm: mf.simulate(room(5, 5) if warm else scene)["s"].values, 8e7)
print(tiles[-1][0], np.array_equal(voxels, mf.focus(large, **VOXELS)))
whole = mf.simulate(scene)["s"].values
print(np.linalg.norm(swept - whole) / np.linalg.norm(whole))
"""


@pytest.mark.slow
def test_under_a_hard_limit_tiles_give_the_same(tmp_path):
    pytest.importorskip("resource")
    folder = Path(__file__).parent
    done = subprocess.run([sys.executable, "-c", HARD, str(folder)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    tiles, same, apart = done.stdout.split()
    assert int(tiles) > 1
    assert same == "True"
    assert float(apart) < 1e-6


def test_a_forecast_is_plain_json(files, capsys):
    assert main(["fold", "image.nc", "--dry-run", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kind"] == "forecast"
    assert "image" in found["parts_gb"]
