"""The command line: exit codes, one sentence for each mistake, JSON for machines, and no file left behind."""

from __future__ import annotations

import importlib.util
import json
import os
import resource
import subprocess
import sys
import warnings

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import VERBS, hidden_dask, main
from mirrorfold.cli.schema import check
from mirrorfold.errors import EndedError

NEEDED = {
    "demo": [],
    "simulate": ["scene.toml", "-o", "out.nc"],
    "calibrate": ["sweep.nc", "-o", "out.nc"],
    "import": ["sweep.nc", "-o", "out.nc"],
    "export": ["sweep.nc", "-o", "out"],
    "focus": ["sweep.nc", "-o", "out.nc"],
    "fold": ["image.nc", "-o", "out.nc"],
    "reconstruct": ["sweep.nc", "-o", "out"],
    "score": ["reconstruction.nc", "scene.toml"],
    "show": ["image.nc", "-o", "out.png"],
    "view": ["sweep.nc"],
    "report": ["reconstruction.nc", "-o", "out.html"],
    "info": ["sweep.nc"],
    "plan": ["--band", "270e9:300e9", "--points", "401", "--aperture", "0.08", "--pitch", "0.5e-3", "--range", "4"],
}


def names(folder):
    return sorted(path.name for path in folder.rglob("*"))


def complaint(capsys, folder, *arguments, code=2):
    """The one line on stderr of a command that must fail and leave everything as it was."""
    before = names(folder)
    assert main(list(arguments)) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("mirrorfold: ")
    assert captured.err.count("\n") == 1
    assert captured.err.endswith("\n")
    assert names(folder) == before
    return captured.err


def run(*arguments, cwd):
    """The command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "mirrorfold", *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )


def test_help_lists_every_verb(capsys):
    for arguments in ([], ["--help"], ["-h"]):
        assert main(arguments) == 0
        printed = capsys.readouterr().out
        for name, verb in VERBS.items():
            assert f"  {name} " in printed
            assert verb.purpose in printed


@pytest.mark.parametrize("verb", VERBS)
def test_help_of_a_verb_has_its_purpose_and_its_example(verb, capsys):
    assert main([verb, "--help"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert VERBS[verb].purpose in printed
    assert VERBS[verb].example in printed
    assert "--json" in printed


@pytest.mark.slow
def test_examples_can_be_parsed(folder, capsys):
    from mirrorfold.cli.program import app

    for name, verb in VERBS.items():
        program, *arguments = verb.example.split()
        assert program == "mirrorfold"
        function, bound, *_ = app.parse_args(arguments, print_error=False, exit_on_error=False)
        assert function.__name__.rstrip("_") == name
        assert bound.args or bound.kwargs


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == mf.__version__


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["recontsruct", "sweep.nc"], "did you mean 'reconstruct'?"),
        (["focus"], "requires an argument"),
        (["focus", "sweep.nc"], "--output"),
        (["focus", "sweep.nc", "-o", "i.nc", "--tolerence", "1"], "--tolerance"),
        (["focus", "sweep.nc", "-o", "i.nc", "--tolerance", "small"], "small"),
        (["focus", "sweep.nc", "-o", "i.nc", "--x", "0:1"], "START:STOP:STEP"),
        (["focus", "sweep.nc", "-o", "i.nc", "--x", "1:0:0.1"], "STOP above START"),
        (["fold", "image.nc", "-o", "r.nc", "--preset", "best"], "published"),
        (["info", "sweep.nc", "image.nc"], "image.nc"),
    ],
)
def test_wrong_arguments_are_one_sentence(folder, capsys, arguments, words):
    assert words in complaint(capsys, folder, *arguments)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["info", "absent.nc"], "absent.nc: does not exist"),
        (["focus", "absent.nc", "-o", "i.nc"], "absent.nc: does not exist"),
        (["focus", "image.nc", "-o", "i.nc"], "is of kind image, expected sweep"),
        (["fold", "sweep.nc", "-o", "r.nc"], "is of kind sweep, expected image"),
        (["score", "image.nc", "scene.toml"], "expected reconstruction"),
        (["score", "reconstruction.nc", "sweep.nc"], "give the path of a scene file"),
        (["reconstruct", "scene.toml", "-o", "out"], "is of kind scene, expected sweep"),
        (["focus", "sweep.nc", "-o", "nowhere/i.nc"], "nowhere does not exist"),
        (["reconstruct", "sweep.nc", "-o", "nowhere/out"], "nowhere does not exist"),
        (["reconstruct", "sweep.nc", "-o", "image.nc"], "is a file"),
        (["focus", "sweep.nc", "-o", "sweep.nc"], "is the input itself"),
        (["fold", "image.nc", "-o", "./image.nc"], "is the input itself"),
        (["simulate", "scene.toml", "-o", "scene.toml"], "is the input itself"),
        (["simulate", "scene.toml", "-o", "s.nc", "--bounces", "-1"], "bounces"),
    ],
)
def test_wrong_input_is_one_sentence(folder, capsys, arguments, words):
    assert words in complaint(capsys, folder, *arguments)


@pytest.mark.slow
def test_an_input_in_the_output_directory_is_not_overwritten(folder, capsys):
    (folder / "out").mkdir()
    mf.save(mf.load("sweep.nc"), folder / "out" / "reconstruction.nc")
    assert "is the input itself" in complaint(capsys, folder, "reconstruct", "out/reconstruction.nc", "-o", "out")


@pytest.mark.slow
@pytest.mark.parametrize("verb", [["info"], ["focus", "-o", "i.nc"], ["reconstruct", "-o", "out"]])
def test_sweeps_that_cannot_be_used(folder, capsys, verb, sweep):
    whole = (folder / "sweep.nc").read_bytes()
    (folder / "broken.nc").write_bytes(whole[: len(whole) // 2])
    sweep.drop_vars("rx_position").to_netcdf(folder / "placeless.nc", engine="h5netcdf")
    samples = sweep["s"].values.copy()
    samples[0, 0, :3] = np.nan
    sweep.assign(s=sweep["s"].copy(data=samples)).to_netcdf(folder / "nan.nc", engine="h5netcdf")
    for name, words in (
        ("broken.nc", "is damaged"),
        ("placeless.nc", "no coordinate 'rx_position'"),
        ("nan.nc", "3 samples of 3321 that are not finite"),
    ):
        assert words in complaint(capsys, folder, verb[0], name, *verb[1:])


def test_a_typo_in_a_scene(folder, capsys):
    text = (folder / "scene.toml").read_text()
    (folder / "typo.toml").write_text(text.replace("pitch", "ptich"))
    for arguments in (["simulate", "typo.toml", "-o", "s.nc"], ["score", "reconstruction.nc", "typo.toml"]):
        printed = complaint(capsys, folder, *arguments)
        assert "array.ptich is not a known entry, did you mean 'pitch'?" in printed
        assert "array.pitch is missing" in printed


@pytest.mark.slow
def test_the_same_in_a_process_of_its_own(folder):
    (folder / "broken.nc").write_bytes((folder / "sweep.nc").read_bytes()[:3000])
    before = names(folder)
    result = run("reconstruct", "broken.nc", "-o", "out", cwd=folder)
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.startswith("mirrorfold: broken.nc: ")
    assert result.stderr.count("\n") == 1
    assert names(folder) == before


@pytest.mark.slow
def test_a_mistake_of_our_own_is_one_line_too(folder, capsys, monkeypatch):
    def fail(*arguments, **options):
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr(mf, "reconstruct", fail, raising=False)
    printed = complaint(capsys, folder, "reconstruct", "sweep.nc", "-o", "out", code=1)
    assert "ZeroDivisionError: division by zero" in printed
    monkeypatch.setenv("MIRRORFOLD_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        main(["reconstruct", "sweep.nc", "-o", "out"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (MemoryError(), 1, "not enough memory"),
        (OSError(28, "No space left on device"), 1, "No space left on device"),
    ],
)
def test_what_interrupts_the_writing_leaves_nothing(folder, capsys, monkeypatch, error, code, words):
    def fail(figure, file, **options):
        file.write(b"half of a picture")
        raise error

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    assert words in complaint(capsys, folder, "reconstruct", "sweep.nc", "-o", "out", code=code)


def parsed(capsys, *arguments):
    """The JSON object that a command prints, which must be all that it prints on stdout."""
    assert main([*arguments, "--json"]) == 0
    result = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert isinstance(result, dict)
    return result


@pytest.mark.slow
def test_info_of_each_kind(folder, capsys):
    for name, kind in (
        ("sweep.nc", "sweep"),
        ("image.nc", "image"),
        ("reconstruction.nc", "reconstruction"),
        ("scene.toml", "scene"),
    ):
        found = parsed(capsys, "info", name)
        assert found["kind"] == kind
        assert found["path"] == name
        assert main(["info", name]) == 0
        assert kind in capsys.readouterr().out


@pytest.mark.slow
def test_from_a_scene_to_a_score(folder, capsys):
    found = parsed(capsys, "simulate", "scene.toml", "-o", "s.nc", "--seed", "3", "--snr-db", "30")
    assert found["files"] == ["s.nc"]
    assert mf.load("s.nc").attrs["command"] == "mirrorfold simulate scene.toml -o s.nc --seed 3 --snr-db 30 --json"
    found = parsed(capsys, "focus", "s.nc", "-o", "i.nc", "--x", "-0.25:0.25:0.005", "--y", "0.2:0.45:0.005")
    assert found["dimensions"] == {"y": 51, "x": 101}
    assert found["extent"]["x"] == pytest.approx([-0.25, 0.25])
    found = parsed(capsys, "fold", "i.nc", "-o", "r.nc")
    assert found["kind"] == "reconstruction"
    assert {"accuracy_m", "hidden", "mirrors"} <= set(parsed(capsys, "score", "r.nc", "scene.toml"))
    assert main(["score", "r.nc", "scene.toml"]) == 0
    assert "F-score at 2 cm" in capsys.readouterr().out


@pytest.mark.slow
def test_reconstruct_leaves_the_reconstruction_and_its_picture(folder, capsys):
    found = parsed(capsys, "reconstruct", "sweep.nc", "-o", "out")
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "before_after.png",
        "reconstruction.nc",
        "report.html",
    ]
    assert found["files"] == ["out/reconstruction.nc", "out/before_after.png", "out/report.html"]
    assert (folder / "out" / "before_after.png").read_bytes().startswith(b"\x89PNG")
    result = mf.load(folder / "out" / "reconstruction.nc")
    assert isinstance(result, xr.DataTree)
    assert result.attrs["command"] == "mirrorfold reconstruct sweep.nc -o out --json"


@pytest.mark.slow
def test_an_image_without_any_mirror_is_unfolded_with_a_remark(folder, capsys):
    assert main(["fold", "image.nc", "-o", "r.nc"]) == 0
    captured = capsys.readouterr()
    assert "mirrorfold: note: No mirror was found" in captured.err
    assert "wrote r.nc" in captured.out
    result = mf.load("r.nc")
    assert result["mirrors"].sizes["mirror"] == 0
    np.testing.assert_array_equal(result["objects"]["x"], result["objects"]["x_initial"])


@pytest.mark.slow
@pytest.mark.usefixtures("remembered_rays")
def test_the_demonstration(folder, capsys):
    score = parsed(capsys, "demo", "--out", "shown")
    check("demo", json.dumps(score))
    expected = ["before_after.png", "hidden_corner.toml", "reconstruction.nc", "report.html", "score.json", "sweep.nc"]
    assert sorted(path.name for path in (folder / "shown").iterdir()) == expected
    written = json.loads((folder / "shown" / "score.json").read_text())
    assert {**written, "files": score["files"]} == score
    walls = {mirror["surface"]: mirror for mirror in score["mirrors"] if mirror["generation"] == 1}
    assert set(walls) == {"partition", "wall"}
    assert max(mirror["angle_error_deg"] for mirror in walls.values()) < 0.1
    assert max(mirror["offset_error_mm"] for mirror in walls.values()) < 1.5
    assert score["hidden"]["f_score_2cm"] > 0.9
    assert score["invented_fraction"] < 0.02


@pytest.mark.parametrize("arguments", [["-c", "import mirrorfold"], ["-m", "mirrorfold", "--help"]])
def test_nothing_heavy_is_imported_for_help(arguments):
    """Help comes at once because these are left alone."""
    code = [sys.executable, "-X", "importtime", *arguments]
    result = subprocess.run(code, capture_output=True, text=True, check=True)
    imported = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in result.stderr.splitlines()}
    assert "mirrorfold" in imported
    assert imported.isdisjoint(
        {"numpy", "scipy", "xarray", "numba", "matplotlib", "h5py", "pydantic", "cyclopts", "rich"}
    )


def test_help_needs_little_processor_time():
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "mirrorfold", "--help"], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.3


@pytest.mark.slow
def test_progress_is_shown_to_people_only(folder):
    quiet = {**os.environ, "NO_COLOR": "1"}
    result = subprocess.run(
        [sys.executable, "-m", "mirrorfold", "focus", "sweep.nc", "-o", "i.nc"],
        cwd=folder, capture_output=True, text=True, check=True, env=quiet,
    )  # fmt: skip
    assert result.stdout == "wrote i.nc\n"
    assert "%" not in result.stderr
    assert "\x1b" not in result.stderr


def test_a_remark_is_given_once_however_many_frames_have_it(monkeypatch, capsys):
    def frames(arguments):
        for _ in range(3):
            with warnings.catch_warnings():  # as each frame may open its own
                warnings.simplefilter("always")
                warnings.warn("y reaches beyond", stacklevel=1)

    monkeypatch.setattr("mirrorfold.cli.program.run", frames)
    assert main(["focus"]) == 0
    assert capsys.readouterr().err == "mirrorfold: note: y reaches beyond\n"


def test_a_process_that_ends_is_no_wrong_input(monkeypatch, capsys):
    def ended(arguments):
        raise EndedError("workers: a worker process has ended")

    monkeypatch.setattr("mirrorfold.cli.program.run", ended)
    assert main(["simulate"]) == 1
    assert capsys.readouterr().err == "mirrorfold: workers: a worker process has ended\n"


def test_dask_is_hidden_from_xarray_only_while_a_verb_runs(monkeypatch):
    monkeypatch.delitem(sys.modules, "dask", raising=False)
    with monkeypatch.context() as alone:
        alone.delitem(sys.modules, "xarray")
        with hidden_dask():
            assert importlib.util.find_spec("dask") is None
        assert "dask" not in sys.modules
    with hidden_dask():  # xarray may have found it before
        assert importlib.util.find_spec("dask") is not None


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:y reaches beyond the ambiguous range")
def test_the_focus_verb_takes_the_settings_of_focusing(tmp_path, sweep):
    path, image = tmp_path / "sweep.nc", tmp_path / "image.nc"
    mf.save(sweep, path)
    options = ["--x", "-0.1:0.1:0.02", "--y", "0.3:0.5:0.02", "--tolerance", "1e-3", "--taper", "uniform"]
    assert main(["focus", str(path), "-o", str(image), *options, "--wave-speed", "2e8", "--normalization", "r"]) == 0
    found = mf.load(image)
    assert [found.attrs[name] for name in ("wave_speed", "normalization", "taper")] == [2e8, "r", "uniform"]
    wanted = mf.focus(sweep, x=found.x, y=found.y, tolerance=1e-3, taper="uniform", wave_speed=2e8, normalization="r")
    np.testing.assert_array_equal(found, wanted)
    assert main(["focus", str(path), "-o", str(image), "--tolerance", "2"]) == 2
