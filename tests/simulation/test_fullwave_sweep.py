"""Full-wave sweeps as work: processes, clusters, resumption, estimates; and curves from files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import warnings

import numpy as np
import pytest
from fullwave_scenes import STRIP, scene_of, small_two_walls
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import EndedError, InputError
from mirrorfold.simulation.fullwave import sweep as fullwave
from mirrorfold.simulation.fullwave.estimate import estimate
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.tasks import solve_frequencies

pytestmark = pytest.mark.filterwarnings("ignore:.*strong echoes")


TOML = """
name = "wall and corner"
[array]
elements = 9
pitch = 0.5e-3
[band]
start = 290e9
stop = 300e9
points = 13
[[surface]]
name = "wall"
kind = "segment"
start = [-0.06, 0.1]
end = [0.06, 0.12]
roughness = {rms_height = 0.05e-3, correlation_length = 0.2e-3}
[[surface]]
name = "corner"
kind = "polyline"
points = [[0.02, 0.2], [0.04, 0.22], [0.06, 0.2]]
roughness = {rms_height = 0.1e-3, correlation_length = 0.2e-3}
"""


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(TOML)
    return path


@pytest.fixture(scope="module")
def uninterrupted(scene_file):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return mf.simulate(scene_file, solver="fullwave")["s"].values


def test_sweep_carries_what_it_was_made_with():
    sweep = mf.simulate(scene_of(STRIP), solver="fullwave", tolerance=3e-3, check_residual=True, seed=5)
    assert sweep["s"].dtype == np.complex64
    assert sweep["s"].dims == ("frequency", "tx", "rx")
    assert sweep.attrs["solver"] == "fullwave"
    assert sweep.attrs["tolerance"] == 3e-3
    assert sweep.attrs["seed"] == 5
    assert sweep.attrs["unknowns"] > 100
    assert sweep.attrs["residual"] < 1e-4
    assert "H0(2)(kd)" in sweep.attrs["source_field"]


@pytest.mark.slow
def test_direct_wave_is_the_field_of_a_line_source():
    without, with_ = (mf.simulate(scene_of(STRIP), solver="fullwave", direct=direct)["s"] for direct in (False, True))
    direct = (with_ - without).values
    apart = np.abs(np.arange(9)[:, None] - np.arange(9)) * 0.5e-3
    assert not direct[:, apart == 0].any()
    far = apart > 3.5e-3
    k = 2 * np.pi * without["frequency"].values / speed_of_light
    expected = np.exp(-1j * k[:, None] * apart[far]) / np.sqrt(apart[far])
    # The asymptotic field of the source is off by 1/(8 k d).
    np.testing.assert_allclose(direct[:, far], expected, rtol=1 / (8 * k[0] * 3.5e-3))


@pytest.mark.slow
def test_noise_is_added_by_its_level():
    clean, noisy = (mf.simulate(scene_of(STRIP), solver="fullwave", snr_db=snr)["s"].values for snr in (None, 10.0))
    measured = np.mean(np.abs(clean) ** 2) / np.mean(np.abs(noisy - clean) ** 2)
    assert 10 * np.log10(measured) == pytest.approx(10.0, abs=1.0)


@pytest.mark.slow
def test_processes_give_the_same_bytes(scene_file, uninterrupted):
    done = []
    s = mf.simulate(scene_file, solver="fullwave", workers=2, progress=lambda *state: done.append(state))["s"].values
    np.testing.assert_array_equal(s.view(np.uint64), uninterrupted.view(np.uint64))
    assert done == [(count, 13) for count in range(14)]


@pytest.mark.slow
def test_script_without_a_guard_is_told_so_instead_of_hanging(scene_file, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(f"import mirrorfold as mf\nmf.simulate({str(scene_file)!r}, solver='fullwave', workers=2)\n")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert "lacks `if __name__" in done.stderr.splitlines()[-1]
    assert "leaked" not in done.stderr


@pytest.mark.slow
def test_dask_cluster_of_two_workers_gives_the_same_bytes(scene_file, uninterrupted):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        s = mf.simulate(scene_file, solver="fullwave", scheduler=cluster.scheduler_address)["s"].values
    np.testing.assert_array_equal(s.view(np.uint64), uninterrupted.view(np.uint64))


@pytest.mark.slow
def test_a_lost_dask_worker_costs_time_alone(scene_file, uninterrupted):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        running = [worker.pid for worker in cluster.workers.values()]

        def kill_one(done, total):
            if done >= 2 and running:
                os.kill(running.pop(), signal.SIGKILL)
                running.clear()

        s = mf.simulate(scene_file, solver="fullwave", scheduler=cluster.scheduler_address, progress=kill_one)[
            "s"
        ].values
    assert not running
    np.testing.assert_array_equal(s.view(np.uint64), uninterrupted.view(np.uint64))


@pytest.mark.slow
def test_a_cluster_that_goes_is_told_in_a_sentence(scene_file):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        pytest.raises(EndedError, match=r"cluster at .* was lost, or its workers ended"),
    ):
        mf.simulate(
            scene_file, solver="fullwave", scheduler=cluster.scheduler_address,
            progress=lambda done, total: cluster.close() if done == 1 else None,
        )  # fmt: skip


@pytest.mark.slow
def test_killed_sweep_resumes_to_the_same_bytes(scene_file, uninterrupted, tmp_path, capsys, monkeypatch):
    out = tmp_path / "sweep.nc"
    results = tmp_path / "sweep.nc.frequencies"
    command = ["simulate", str(scene_file), "--solver", "fullwave", "-o", str(out), "--workers", "1"]
    in_two = [sys.executable, "-m", "mirrorfold", *command[:-1], "2"]
    place = tmp_path / "tmp"
    place.mkdir()
    process = subprocess.Popen(in_two, stderr=subprocess.DEVNULL, env=os.environ | {"TMPDIR": str(place)})
    while process.poll() is None and len(list(results.glob("*.npy"))) < 2:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = {path.name: path.stat().st_mtime_ns for path in results.glob("*.npy")}
    assert 2 <= len(kept) < 13
    assert not out.exists()
    # What the workers were given goes when the next ones are given something.
    assert len(list(place.iterdir())) == 1
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    assert list(solve_frequencies(None, None, [], direct=False, workers=2, scheduler=None)) == []
    assert list(place.iterdir()) == []
    monkeypatch.undo()
    # Without --resume the results are not thrown away, and other settings do not go on with them.
    assert main(command) == 2
    assert "resume it, or remove the folder" in capsys.readouterr().err
    assert main([*command, "--resume", "--tolerance", "1e-2"]) == 2
    assert "another scene or of other settings" in capsys.readouterr().err
    for name, written in kept.items():
        assert (results / name).stat().st_mtime_ns == written
    assert main([*command, "--resume"]) == 0
    np.testing.assert_array_equal(mf.load(out)["s"].values.view(np.uint64), uninterrupted.view(np.uint64))
    assert not results.exists()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs POSIX signals")
def test_a_closed_terminal_ends_all_processes_without_a_word_too_many(scene_file, tmp_path):
    """All processes of a terminal hear of its end, workers and Python's own helpers too."""
    results = tmp_path / "sweep.nc.frequencies"
    command = ["simulate", str(scene_file), "--solver", "fullwave", "-o", str(tmp_path / "sweep.nc"), "--workers", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "mirrorfold", *command], stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # nohup may have told these tests otherwise
    ) as process:  # fmt: skip
        while process.poll() is None and len(list(results.glob("*.npy"))) < 2:
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGHUP)
        said = process.communicate(timeout=120)[1]
    assert process.returncode == 129
    assert said == f"mirrorfold: interrupted; what is done is kept in {results}, --resume goes on\n"
    assert len(list(results.glob("*.npy"))) >= 2


@pytest.mark.slow
def test_resumption_solves_only_what_is_missing(scene_file, uninterrupted, tmp_path, monkeypatch):
    mf.simulate(scene_file, solver="fullwave", checkpoint=tmp_path / "done")
    for index in (0, 7, 12):
        (tmp_path / "done" / f"{index:05d}.npy").unlink()
    solved = []
    original = fullwave.solve_frequencies

    def watched(system, frequency, todo, **options):
        solved.extend(todo)
        return original(system, frequency, todo, **options)

    monkeypatch.setattr(fullwave, "solve_frequencies", watched)
    s = mf.simulate(scene_file, solver="fullwave", checkpoint=tmp_path / "done", resume=True)["s"].values
    assert solved == [0, 7, 12]
    np.testing.assert_array_equal(s.view(np.uint64), uninterrupted.view(np.uint64))


def spoil_middle(path):
    """Flip the lowest bit of a byte amid the samples: a tiny error, which no later check would notice."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def cut_short(path):
    path.write_bytes(path.read_bytes()[:-40])


def one_number(path):
    np.save(path.with_suffix(".npy"), np.ones((1, 1), dtype=np.complex64))


def of_its_neighbour(path):
    path.write_bytes((path.parent / "00001.npy").read_bytes())


def empty(path):
    path.write_bytes(b"")


def pipe(path):
    """As a pipe, which nobody will ever write to."""
    path.unlink()
    os.mkfifo(path)


@pytest.mark.slow
@pytest.mark.parametrize("damage", [spoil_middle, cut_short, one_number, of_its_neighbour, empty, pipe])
def test_a_result_that_cannot_be_trusted_is_solved_again_and_told_of(tmp_path, monkeypatch, damage):
    scene, folder = scene_of(STRIP, points=3), tmp_path / "done"
    whole = mf.simulate(scene, solver="fullwave", checkpoint=folder)["s"].values
    damage(folder / "00002.npy")
    solved = []
    original = fullwave.solve_frequencies
    monkeypatch.setattr(
        fullwave, "solve_frequencies", lambda *given, **more: solved.extend(given[2]) or original(*given, **more)
    )
    with pytest.warns(UserWarning, match=r"00002\.npy cannot be trusted, damaged or of another run"):
        again = mf.simulate(scene, solver="fullwave", checkpoint=folder, resume=True)["s"].values
    assert solved == [2]
    np.testing.assert_array_equal(again.view(np.uint64), whole.view(np.uint64))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["00000.npy", "sweep.sha256"])
def test_a_folder_in_the_place_of_a_result_is_refused_before_the_work(tmp_path, scene_file, capsys, name):
    (tmp_path / "sweep.nc.frequencies" / name / "mine").mkdir(parents=True)
    command = ["simulate", str(scene_file), "--solver", "fullwave", "--workers", "1", "-o", str(tmp_path / "sweep.nc")]
    assert main([*command, "--resume"]) == 2
    assert f"{name}: is a folder in the place of a file with results; move it away" in capsys.readouterr().err
    assert (tmp_path / "sweep.nc.frequencies" / name / "mine").is_dir()


@pytest.mark.slow
def test_a_pipe_in_the_place_of_the_mark_is_replaced(tmp_path):
    scene, folder = scene_of(STRIP, points=3), tmp_path / "done"
    folder.mkdir()
    os.mkfifo(folder / "sweep.sha256")
    mf.simulate(scene, solver="fullwave", checkpoint=folder)
    assert (folder / "sweep.sha256").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("mark", [None, "", "no fingerprint"])
def test_results_of_another_scene_are_not_mixed_in_though_the_mark_is_lost(tmp_path, mark):
    other = scene_of({**STRIP, "start": [-0.01, 0.06]}, points=3)
    scene, folder = scene_of(STRIP, points=3), tmp_path / "done"
    mf.simulate(other, solver="fullwave", checkpoint=folder)
    (folder / "sweep.sha256").unlink()
    if mark is not None:
        (folder / "sweep.sha256").write_text(mark)
    with pytest.raises(InputError, match="holds the results of an unfinished sweep"):
        mf.simulate(scene, solver="fullwave", checkpoint=folder)
    with pytest.warns(UserWarning, match="00000.npy, 00001.npy, 00002.npy cannot be trusted"):
        s = mf.simulate(scene, solver="fullwave", checkpoint=folder, resume=True)["s"].values
    np.testing.assert_array_equal(s.view(np.uint64), mf.simulate(scene, solver="fullwave")["s"].values.view(np.uint64))


@pytest.mark.slow
def test_the_folder_of_results_loses_nothing_of_others(tmp_path, scene_file, capsys):
    """What lies in a folder that is given for the results stays, whether the work fails or ends well."""
    folder = tmp_path / "sweep.nc.frequencies"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    command = ["simulate", str(scene_file), "--solver", "fullwave", "--workers", "1", "-o", str(tmp_path / "sweep.nc")]
    assert main([*command, "--scheduler", "nonsense"]) == 2
    assert main(command) == 0
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]


@pytest.mark.slow
def test_dry_run_estimates_and_writes_nothing(scene_file, tmp_path, capsys):
    assert main(["simulate", str(scene_file), "--solver", "fullwave", "--dry-run", "--json", "--workers", "2"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["frequencies"] == 13
    assert found["workers"] == 2
    assert 0 < found["minutes"] < 1
    assert 0.1 < found["memory_gb"] < 1.0
    assert found["disk_gb"] == pytest.approx(2 * 13 * 81 * 8 / 1e9)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_estimate_grows_with_the_scene():
    small, large = (estimate(prepare(small_two_walls(scale)), 100) for scale in (0.06, 0.12))
    assert 1.7 < large.unknowns / small.unknowns < 2.3
    assert small.skeletons < large.skeletons < 2.5 * small.skeletons
    assert large.seconds_per_frequency > 1.3 * small.seconds_per_frequency


@pytest.mark.slow
def test_what_fails_before_its_first_result_leaves_no_folder(scene_file, tmp_path, monkeypatch):
    def fail(*_: object, **__: object):
        raise InputError("no cluster")
        yield

    monkeypatch.setattr(fullwave, "solve_frequencies", fail)
    with pytest.raises(InputError, match="no cluster"):
        mf.simulate(scene_file, solver="fullwave", checkpoint=tmp_path / "done")
    assert not list(tmp_path.iterdir())


# Curves from files


@pytest.mark.parametrize("suffix", [".csv", ".npy"])
def test_curve_from_a_file_beside_the_scene(tmp_path, suffix):
    x = np.linspace(-0.02, 0.02, 41)
    points = np.stack([x, 0.05 + 0.003 * np.sin(200 * x)], axis=1)
    if suffix == ".npy":
        np.save(tmp_path / "profile.npy", points)
    else:
        np.savetxt(tmp_path / "profile.csv", points, delimiter=",", header="x [m], y [m]", comments="")
    (tmp_path / "scene.toml").write_text(
        'name = "measured"\n[array]\nelements = 3\npitch = 0.5e-3\n[band]\nstart = 290e9\nstop = 300e9\npoints = 3\n'
        f'[[surface]]\nname = "profile"\nkind = "curve"\nfile = "profile{suffix}"\n'
    )
    scene = mf.load_scene(tmp_path / "scene.toml")
    assert scene.surface[0].points[0] == (-0.02, pytest.approx(points[0, 1]))
    nodes = prepare(scene).nodes
    assert np.abs(nodes.position[:, 1] - 0.05 - 0.003 * np.sin(200 * nodes.position[:, 0])).max() < 1e-5
    with pytest.raises(InputError, match="is a curve, which rays cannot follow"):
        mf.simulate(scene)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"surface\[0\].file: .*profile.csv: does not exist"),
        ("1,2,3\n4,5,6\n", r"holds an array of shape \(2, 3\), expected an .npy or .csv"),
        ("1;2\n", "cannot be read"),
        ("0,0\n1,1\n", "points"),
        ("0,0\n0,0\n1,1\n2,2\n", "two consecutive points are the same"),
    ],
)
def test_bad_files_of_points(tmp_path, content, message):
    if content is not None:
        (tmp_path / "profile.csv").write_text(content)
    (tmp_path / "scene.toml").write_text(TOML + '[[surface]]\nname = "p"\nkind = "curve"\nfile = "profile.csv"\n')
    with pytest.raises(InputError, match=message.replace("surface\\[0\\]", "surface\\[2\\]")):
        mf.load_scene(tmp_path / "scene.toml")
