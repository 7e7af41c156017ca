"""The options of the verbs that focus and fold: they are the declared settings, and reach the functions unchanged."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.options import Preset
from mirrorfold.detection.mirrors.known_mirrors import read_mirrors, write_mirrors
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD, FocusSettings
from mirrorfold.folding import PRESETS, FoldSettings

OFFERED = {name for name, rule in FoldSettings.rules().items() if rule.option}

MIRROR = [[[0.4, 1.6], [0.6, 0.9]]]


@pytest.fixture
def given(tmp_path, monkeypatch, sweep, image, reconstruction):
    """The keywords that the verbs call `fold` and `reconstruct` with, in a folder with a file of each kind."""
    monkeypatch.chdir(tmp_path)
    mf.save(sweep, "sweep.nc")
    mf.save(image, "image.nc")
    write_mirrors(np.array(MIRROR), tmp_path / "mirrors.json")
    found = {}

    def record(data, **keywords):
        found.clear()
        found.update(keywords)
        return reconstruction

    monkeypatch.setattr(mf, "fold", record)
    monkeypatch.setattr(mf, "reconstruct", record)
    return found


def options_of(verb):
    from mirrorfold.cli.program import app

    arguments = app[verb].assemble_argument_collection(parse_docstring=True)
    return {argument.names[0].removeprefix("--").replace("-", "_"): argument for argument in arguments}


def test_the_verbs_offer_every_setting_with_its_meaning():
    focused = {name for name, rule in FocusSettings.rules().items() if rule.option} | {"x", "y", "z"}
    assert set(options_of("fold")) >= OFFERED | {"mirrors", "preset"}
    assert set(options_of("reconstruct")) >= OFFERED | focused | {"mirrors", "preset"}
    for verb in ("fold", "reconstruct"):
        for name, rule in FoldSettings.rules().items():
            if rule.option:
                assert rule.meaning.rstrip(".") in " ".join(options_of(verb)[name].parameter.help.split())
            else:
                assert name not in options_of(verb)


def test_the_presets_of_the_command_line_are_those_of_folding():
    assert get_args(get_args(Preset)[0]) == tuple(PRESETS)


@pytest.mark.slow
def test_only_given_settings_reach_fold(given):
    assert main(["fold", "image.nc", "-o", "out.nc"]) == 0
    assert set(given) == {"sweep", "mirrors", "preset", "progress"}
    assert given["preset"] == "default"
    options = ["--threshold-db", "-20.5", "--generations", "2", "--normalization", "r2", "--preset", "published"]
    assert main(["fold", "image.nc", "-o", "out.nc", "--mirrors", "mirrors.json", *options]) == 0
    assert given["threshold_db"] == -20.5
    assert given["generations"] == 2
    assert given["normalization"] == "r2"
    assert given["preset"] == "published"
    np.testing.assert_array_equal(given["mirrors"], MIRROR)


@pytest.mark.slow
def test_reconstruct_takes_the_settings_of_focusing_and_of_folding(given):
    assert main(["reconstruct", "sweep.nc", "-o", "out"]) == 0
    assert set(given) == {"mirrors", "preset", "progress", "tolerance"}
    assert given["tolerance"] == TOLERANCE_TO_FOLD
    grid = ["--x", "-0.1:0.1:0.02", "--y", "0.3:0.4:0.02", "--z", "0.1"]
    focused = ["--tolerance", "1e-4", "--taper", "taylor", "--wave-speed", "343"]
    folded = ["--threshold-db", "-20", "--wall-margin", "0.03", "--normalization", "none"]
    command = ["reconstruct", "sweep.nc", "-o", "out", "--mirrors", "mirrors.json", *grid, *focused, *folded]
    assert main(command) == 0
    np.testing.assert_allclose(given["x"], np.linspace(-0.1, 0.1, 11), atol=1e-12)
    np.testing.assert_allclose(given["y"], np.linspace(0.3, 0.4, 6), atol=1e-12)
    np.testing.assert_array_equal(given["z"], [0.1])
    assert [given[name] for name in ("tolerance", "taper", "wave_speed")] == [1e-4, "taylor", 343.0]
    assert [given[name] for name in ("threshold_db", "wall_margin", "normalization")] == [-20.0, 0.03, "none"]
    np.testing.assert_array_equal(given["mirrors"], MIRROR)


@pytest.mark.slow
def test_opacity_can_be_switched_on_and_off(given):
    for flag, wanted in (("--opaque", True), ("--no-opaque", False)):
        for verb, file in (("fold", "image.nc"), ("reconstruct", "sweep.nc")):
            assert main([verb, file, "-o", "out.nc" if verb == "fold" else "out", flag]) == 0
            assert given["opaque"] is wanted


def test_a_mirror_file_is_not_overwritten(given, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "mirrors.json").rename(tmp_path / "out" / "report.html")
    assert main(["reconstruct", "sweep.nc", "-o", "out", "--mirrors", "out/report.html"]) == 2
    np.testing.assert_array_equal(read_mirrors(tmp_path / "out" / "report.html"), MIRROR)


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["fold", "reconstruct"])
def test_help_compiles_and_reads_nothing(verb):
    """The settings of folding are imported for help, the kernels and the file formats are not."""
    code = [sys.executable, "-X", "importtime", "-m", "mirrorfold", verb, "--help"]
    result = subprocess.run(code, capture_output=True, text=True, check=True)
    imported = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in result.stderr.splitlines()}
    assert "cyclopts" in imported
    assert imported.isdisjoint({"numpy", "scipy", "xarray", "numba", "matplotlib", "h5py"})


IMPORTS_OF_OTHER_THREADS = """
import sys, threading
found = []
class Watch:
    def find_spec(self, name, path=None, target=None):
        if name.startswith("mirrorfold") and threading.current_thread() is not threading.main_thread():
            found.append(name)
sys.meta_path.insert(0, Watch())
from mirrorfold.cli import main
assert main(sys.argv[1:]) == 0
print("imported beside:", *found)
"""


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "output"), [("focus", "image.nc"), ("reconstruct", "out")])
def test_the_thread_that_reads_beside_imports_no_module_of_ours(tmp_path, sweep, verb, output):
    """Imports of two threads at once may meet modules that are only half loaded."""
    path = mf.save(sweep, tmp_path / "sweep.nc")
    grid = ["--x", "-0.2:0.2:0.01", "--y", "0.2:0.55:0.01"]
    code = [sys.executable, "-c", IMPORTS_OF_OTHER_THREADS, verb, str(path), "-o", str(tmp_path / output), *grid]
    result = subprocess.run(code, capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "imported beside:"


@pytest.fixture
def recordings(tmp_path, monkeypatch, sweep):
    """A recording of two frames as a sweep, its image, and the second frame alone, in a folder."""
    monkeypatch.chdir(tmp_path)
    both = xr.concat([sweep.assign(s=sweep["s"][::-1]), sweep], "frame", data_vars=["s"])
    mf.save(both, "both.nc")
    mf.save(mf.focus(both), "both_image.nc")
    mf.save(sweep, "alone.nc")
    mf.save(mf.focus(sweep), "alone_image.nc")


@pytest.mark.slow
def test_one_frame_of_a_recording_is_treated_as_it_would_be_alone(recordings):
    verbs = [
        ["focus", "both.nc", "-o", "one.nc", "--frame", "1"],
        ["focus", "alone.nc", "-o", "other.nc"],
        ["fold", "both_image.nc", "--sweep", "both.nc", "-o", "folded.nc", "--frame", "1"],
        ["fold", "alone_image.nc", "--sweep", "both.nc", "-o", "mixed.nc", "--frame", "1"],
        ["reconstruct", "both.nc", "-o", "results", "--frame", "1"],
        ["reconstruct", "alone.nc", "-o", "expected"],
    ]
    assert [main(words) for words in verbs] == [0] * len(verbs)
    xr.testing.assert_allclose(mf.load("one.nc"), mf.load("other.nc"))
    expected = mf.load("expected/reconstruction.nc")
    for file in ("folded.nc", "mixed.nc", "results/reconstruction.nc"):
        found = mf.load(file)
        assert found["intensity"].dims == ("y", "x")
        assert found["objects"].sizes["point"] == expected["objects"].sizes["point"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["focus", "both.nc", "-o", "one.nc", "--frame", "2"], "frame is 2, but there are 2 frames"),
        (["fold", "both_image.nc", "-o", "one.nc", "--frame", "-1"], "frame is -1"),
        (["fold", "alone_image.nc", "-o", "one.nc", "--frame", "1"], "there are no frames; leave --frame out"),
        (["reconstruct", "both.nc", "--dry-run", "--frame", "5"], "frame is 5, but there are 2 frames"),
    ],
)
def test_a_frame_that_is_not_there_is_refused(recordings, capsys, words, reason):
    assert main(words) == 2
    assert reason in capsys.readouterr().err
    assert not Path("one.nc").exists()
