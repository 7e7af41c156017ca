"""Benchmarks: every method on the same scenes, failures told and survived, interrupted runs that go on."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import small_benchmark
import xarray as xr
from scans import ball, content, panel
from small_benchmark import IMPOSSIBLE, RADAR, WALL

import mirrorfold as mf
from mirrorfold import benchmarking
from mirrorfold.benchmarking import scenes
from mirrorfold.benchmarking.methods import as_reconstruction, load_method
from mirrorfold.benchmarking.results import _text, read_lines
from mirrorfold.benchmarking.scenes import Line
from mirrorfold.scenes.families import Family, Radar, draw, drawing
from mirrorfold.scenes.families.parts import wall


def run(*methods, seeds=range(2), families=WALL, **more):
    names = [name if name in ("ours", "published") else f"small_benchmark:{name}" for name in methods]
    return mf.benchmark(families, radars=RADAR, methods=names, seeds=seeds, **more)


@pytest.fixture(autouse=True)
def forget():
    small_benchmark.calls.clear()


@pytest.mark.slow
def test_every_method_is_judged_on_every_scene():
    found = run("strongest", "nothing")
    assert found.seeds == [0, 1]
    assert [(one.family, one.radar, one.method) for one in found.results] == [
        ("small wall", "small", "small_benchmark:strongest"),
        ("small wall", "small", "small_benchmark:nothing"),
    ]
    strongest, nothing = (one.figures for one in found.results)
    # A wall's strongest echo is its specular point, on it; one point covers 4 cm of 30.
    assert 0.15 < strongest["f_all"].mean < 0.35
    assert strongest["invented_cells"].worst == 0.0
    assert nothing["f_all"].mean == nothing["f_all"].worst == 0.0
    # Nothing is hidden, so there is no hidden figure.
    assert (strongest["f_hidden"].scenes, strongest["f_hidden"].mean) == (0, None)
    assert strongest["f_all_cells"].mean > 0.0
    assert set(found.results[0].seconds) == {"simulate", "focus", "fold", "score"}


@pytest.mark.slow
def test_ours_finds_the_wall():
    ours = run("ours").results[0]
    assert ours.figures["f_all"].worst > 0.9
    assert ours.figures["angle_deg"].worst < 0.5


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("raises", "the method raised RuntimeError: out of luck"),
        ("leaves", "the method raised SystemExit: 3"),
        ("a_number", "the method returned the number 3.0, expected a reconstruction"),
        ("flat", "the method returned points of shape (2,), expected (n, 2)"),
        ("infinite", "the method returned points that are not finite"),
        ("other_words", "the method returned a mapping with point, expected points"),
        ("short", "the method returned bounces of shape (2,), expected (1)"),
        ("in_words", "the method returned points that are no real numbers: the text 'everywhere'"),
        ("imaginary", "the method returned points that are no real numbers: a list"),
        ("half_a_bounce", "the method returned bounces that are no whole numbers of at least 0"),
        ("far_away", "reconstruction: holds a point that is farther away than 1e+07 m"),
        ("raises_its_own", "the method raised OfItsOwn"),
    ],
)
def test_a_method_that_fails_is_told_and_hurts_no_other(method, expected):
    found = run(method, "strongest", seeds=[0])
    failed, other = found.results
    assert (failed.scenes, failed.failures, other.failures) == (1, 1, 0)
    assert failed.errors[0].startswith(expected)
    assert "\n" not in failed.errors[0]
    assert not failed.errors[0].endswith(":")
    assert other.figures["f_all"].mean > 0.0
    assert found.remarks == [f"small_benchmark:{method} failed on 1 of 1 scenes, most often so: {failed.errors[0]}"]


def test_a_method_that_spoils_its_input_spoils_it_for_itself_alone():
    alone, after = run("strongest", seeds=[0]), run("spoils", "strongest", seeds=[0])
    assert after.results[1].figures == alone.results[0].figures


def test_a_method_that_prints_and_wanders_does_so_apart(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = np.geterr()
    run("wanders", seeds=[0], output="out")
    assert (tmp_path / "out/scenes.jsonl").is_file()
    assert np.geterr() == before
    assert capsys.readouterr() == ("", "where am I?\n")


def test_a_family_with_impossible_ranges_fails_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(drawing, "DRAWS", 5)
    found = run("strongest", families=[IMPOSSIBLE, WALL], seeds=[0])
    assert [one.failures for one in found.results] == [1, 0]
    assert "none of 5 draws hides its objects" in found.results[0].errors[0]


def broken(random, radar):
    raise ZeroDivisionError("half a wall")


def test_a_family_that_raises_fails_too():
    family = replace(WALL, name="broken", make=broken)
    assert run("strongest", families=family, seeds=[0]).results[0].errors == [
        "there is no image, ZeroDivisionError: half a wall"
    ]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"families": "thre bounces"}, "family is 'thre bounces', expected one of: one wall"),
        ({"radars": "60 GHz"}, "radar is '60 GHz', expected one of: 300 GHz"),
        ({"families": "corridor", "radars": "scanner"}, "radar 'scanner' cannot see family 'corridor'"),
        ({"methods": "theirs"}, "method is 'theirs', expected ours, flat, opaque, published or MODULE:FUNCTION"),
        ({"methods": "absent_module:fold"}, "the module 'absent_module' cannot be imported (ModuleNotFoundError"),
        ({"methods": "small_benchmark:fold"}, "has no function 'fold'"),
        ({"methods": "small_benchmark:NOT_CALLABLE"}, "no function, 'NOT_CALLABLE'"),
        ({"methods": [3]}, "methods: got the number 3, expected ours"),
        ({"seeds": [-1]}, "seeds holds -1"),
        ({"seeds": 3}, "seeds: got the number 3, expected whole numbers"),
        ({"seeds": []}, "has no family, radar, method or seed"),
        ({"jobs": 0}, "jobs is 0"),
        ({"sweeps": __file__}, "is no folder; give the path of one"),
    ],
)
def test_what_cannot_be_run_is_refused_before_any_work(arguments, expected):
    with pytest.raises(mf.InputError) as caught:
        mf.benchmark(**{"families": "corridor", "methods": "ours", "seeds": [0], **arguments})
    assert expected in str(caught.value)


def test_an_interrupted_run_goes_on_from_whole_lines(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run("interrupted", "nothing", seeds=range(4), output=tmp_path)
    text = (tmp_path / "scenes.jsonl").read_text()
    assert text.endswith("\n")
    assert [json.loads(line)["seed"] for line in text.splitlines()] == [0, 0]
    small_benchmark.calls.clear()
    seen = []
    found = run("nothing", seeds=range(4), output=tmp_path, progress=lambda done, total: seen.append((done, total)))
    assert found.results[0].scenes == 4
    assert small_benchmark.calls == ["nothing"] * 3
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_what_is_done_is_not_done_again_but_failures_are(tmp_path, monkeypatch):
    before = run("strongest", "raises", seeds=[0], output=tmp_path)
    monkeypatch.setattr(small_benchmark, "raises", small_benchmark.nothing)
    after = run("strongest", "raises", seeds=[0], output=tmp_path)
    assert small_benchmark.calls == ["strongest", "nothing"]
    assert [one.failures for one in before.results] == [0, 1]
    assert [one.failures for one in after.results] == [0, 0]
    assert after.results[0].figures == before.results[0].figures
    monkeypatch.setattr(scenes, "simulate", None)  # there is nothing left to do
    assert run("strongest", "raises", seeds=[0], output=tmp_path).results == after.results


def test_a_line_that_was_cut_off_is_made_again(tmp_path):
    whole = run("nothing", output=tmp_path)
    file = tmp_path / "scenes.jsonl"
    file.write_text(file.read_text()[:-40])
    small_benchmark.calls.clear()
    with pytest.warns(UserWarning, match="1 of 2 lines are damaged"):
        again = run("nothing", output=tmp_path)
    assert again.results[0].figures == whole.results[0].figures
    assert small_benchmark.calls == ["nothing"]
    assert len(read_lines(file)) == len(file.read_text().splitlines()) == 2


def of_another_version(text):
    items = json.loads(text)
    items.pop("sha256")
    return _text(Line(**{**items, "version": "0.0.1"}))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda text: "{}\n", "holds no whole result of `mirrorfold benchmark`"),
        (of_another_version, "holds results of mirrorfold 0.0.1"),
    ],
)
def test_a_file_of_others_is_refused_and_left_alone(tmp_path, change, expected):
    run("nothing", seeds=[0], output=tmp_path)
    file = tmp_path / "scenes.jsonl"
    file.write_text(change(file.read_text()))
    before = file.read_text()
    with pytest.raises(mf.InputError) as caught:
        run("nothing", seeds=[0], output=tmp_path)
    assert expected in str(caught.value)
    assert file.read_text() == before


def test_a_result_that_has_changed_is_made_again_and_told_of(tmp_path):
    whole = run("strongest", output=tmp_path)
    file = tmp_path / "scenes.jsonl"
    first, second = file.read_text().splitlines(keepends=True)
    file.write_text(re.sub(r'"f_score_2cm": 0\.\d', '"f_score_2cm": 0.9', first, count=1) + second)
    assert file.read_text() != first + second
    with pytest.raises(mf.InputError, match="line 1 has changed since it was written"):
        read_lines(file)
    small_benchmark.calls.clear()
    with pytest.warns(UserWarning, match="1 of 2 lines are damaged, and are made again"):
        again = run("strongest", output=tmp_path)
    assert small_benchmark.calls == ["strongest"]
    assert again.results[0].figures == whole.results[0].figures


@pytest.mark.slow
def test_results_of_another_family_of_the_same_name_are_made_again(tmp_path):
    run("strongest", output=tmp_path)
    other = replace(WALL, make=lambda random, radar: [wall("wall", (0.0, 0.5), 0.0, 0.3)])
    small_benchmark.calls.clear()
    with pytest.warns(UserWarning, match="2 results are of other scenes"):
        mixed = run("strongest", families=other, output=tmp_path)
    assert small_benchmark.calls == ["strongest"] * 2
    assert mixed.results[0].figures == run("strongest", families=other).results[0].figures


def test_kept_sweeps_are_not_simulated_again(tmp_path, monkeypatch):
    first = run("strongest", seeds=[0], sweeps=tmp_path)
    monkeypatch.setattr(scenes, "simulate", None)
    assert run("strongest", seeds=[0], sweeps=tmp_path).results[0].figures == first.results[0].figures
    other = run("strongest", seeds=[0], sweeps=tmp_path, families=replace(WALL, snr_db=3.0))
    assert other.results[0].failures == 1  # with other noise it is another sweep


def test_a_kept_sweep_that_is_damaged_is_simulated_again(tmp_path):
    first = run("strongest", seeds=[0], sweeps=tmp_path)
    [path] = tmp_path.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.warns(UserWarning, match="is damaged or was not written by a benchmark, and is simulated again"):
        again = run("strongest", seeds=[0], sweeps=tmp_path)
    assert again.results[0].failures == 0
    assert again.results[0].figures == first.results[0].figures
    assert isinstance(mf.load(path), xr.Dataset)


@pytest.mark.slow
def test_several_processes_find_the_same(tmp_path):
    one = run("strongest", "raises", seeds=range(3))
    several = run("strongest", "raises", seeds=range(3), jobs=2, output=tmp_path)
    assert [result.figures for result in several.results] == [result.figures for result in one.results]
    assert several.results[1].failures == 3
    assert len(read_lines(tmp_path / "scenes.jsonl")) == 6


@pytest.mark.slow
def test_a_method_that_ends_its_process_is_told_of():
    with pytest.raises(mf.InputError, match="because a method crashed or ended it"):
        run("crashes", seeds=range(2), jobs=2)


def test_points_in_a_dict_are_scored_like_a_reconstruction():
    scene = draw(WALL, 0, radar=RADAR)
    points, _, _ = scene.surface[0].sample(0.005)
    ends = np.array([[scene.surface[0].start, scene.surface[0].end]])
    image = mf.focus(mf.simulate(scene))
    exact = as_reconstruction({"points": points, "bounces": np.ones(len(points)), "mirrors": ends}, image)
    found = mf.score(exact, scene)
    assert found.f_score_2cm == found.f_score_cells == 1.0
    assert (found.points, found.hidden.points) == (len(points), 0)  # the wall is in sight
    assert found.mirrors[0].angle_error_deg == pytest.approx(0.0, abs=1e-4)
    assert found.mirrors[0].offset_error_mm == pytest.approx(0.0, abs=1e-6)
    # Seen over a longer way, the cell is larger: as in a reconstruction, it follows from where the points stood.
    longer = as_reconstruction({"points": points, "initial": 3.0 * points}, image)
    assert mf.score(longer, scene).cell_m > 1.5 * found.cell_m


def strip(random, radar):
    return [wall("strip", (0.0, 0.1), 0.0, 0.04)]


@pytest.mark.slow
def test_a_family_of_full_waves_is_solved_and_judged():
    radar = replace(RADAR, band={"start": 90e9, "stop": 100e9, "points": 21},
                    array={"elements": 9, "pitch": 1.5e-3})  # fmt: skip
    family = Family(name="strip", what="a strip", engine="fullwave", make=strip, options={"tolerance": 1e-2})
    found = mf.benchmark(family, radars=radar, methods="small_benchmark:strongest", seeds=[0]).results[0]
    assert found.errors == []
    assert found.figures["f_all_cells"].mean > 0.5  # a strip of a few cells, and one point on it


def panel_and_ball(random, radar):
    return [panel(width=0.8, height=0.8), ball()]


def strongest_voxel(volume, sweep):
    """The strongest voxel of a scan, which comes without its sweep."""
    assert sweep is None
    at = dict(zip(volume.dims, np.unravel_index(np.abs(volume.values).argmax(), volume.shape), strict=True))
    range_, azimuth, elevation = (float(volume[name][at[name]]) for name in ("range", "azimuth", "elevation"))
    az, el = np.radians([azimuth, elevation])
    sight = np.array([np.sin(az) * np.cos(el), np.cos(az) * np.cos(el), np.sin(el)])
    return {"points": [range_ * sight]}


@pytest.mark.slow
def test_a_family_in_space_is_scanned_and_judged(monkeypatch):
    monkeypatch.setattr(small_benchmark, "strongest", strongest_voxel)
    held = content(half=4.0, beams=15, points=801)
    radar = Radar(name="small scan", what="", band=held["band"], scanner=held["scanner"])
    family = Family(name="panel", what="", engine="raster", make=panel_and_ball, options={"force": True})
    found = mf.benchmark(family, radars=radar, methods="small_benchmark:strongest", seeds=[0]).results[0]
    assert found.errors == []
    # The wall's strongest echo lies on it, or within its depth of 15 mm.
    assert (found.figures["invented_cells"].mean, found.figures["f_all"].mean) == (0.0, pytest.approx(0.0, abs=0.05))
    assert found.figures["f_all"].mean > 0.0


def test_errors_that_nobody_knows_are_no_fault_of_a_reconstruction(reconstruction, image):
    unknown = reconstruction.copy()
    for group, name in (("objects", "x_error"), ("mirrors", "folded_angle_error")):
        table = unknown[group].to_dataset(inherit=False)
        some = next(column for column in table.variables.values() if column.ndim == 1)
        unknown[group] = xr.DataTree(table.assign({name: (some.dims, np.full(some.shape, np.nan))}))
    assert as_reconstruction(unknown, image) is unknown


def test_a_scan_of_two_polarizations_is_in_space():
    scan = xr.DataArray(np.zeros((2, 1, 1, 1)), dims=("polarization", "range", "azimuth", "elevation"))
    assert as_reconstruction({"points": [[0.0, 1.0, 2.0]]}, scan)["objects"]["z"].values.tolist() == [2.0]


def test_a_reconstruction_that_is_not_finite_is_no_result(reconstruction, image):
    assert as_reconstruction(reconstruction, image) is reconstruction
    objects = reconstruction["objects"].to_dataset(inherit=False)
    reconstruction["objects"] = xr.DataTree(objects.assign_coords(x=objects["x"] * np.nan))
    with pytest.raises(mf.InputError, match="objects that are not finite"):
        as_reconstruction(reconstruction, image)


def test_methods_of_the_working_directory_are_found(tmp_path, monkeypatch):
    (tmp_path / "method_of_mine.py").write_text("def fold(image, sweep):\n    return {'points': []}\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [path for path in __import__("sys").path if path])
    assert load_method("method_of_mine:fold")(None, None) == {"points": []}


def test_the_method_of_the_documentation_works(tmp_path, monkeypatch):
    page = (Path(__file__).parents[2] / "docs/benchmarks.md").read_text(encoding="utf-8")
    (tmp_path / "my_method.py").write_text(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1])
    monkeypatch.syspath_prepend(str(tmp_path))
    found = mf.benchmark(WALL, radars=RADAR, methods="my_method:strongest", seeds=[0]).results[0]
    assert found.errors == []
    assert found.figures["f_all"].mean > 0.1


def test_the_public_face():
    assert mf.benchmark is benchmarking.benchmark


def test_a_scene_that_is_named_twice_is_one_scene():
    found = run("nothing", seeds=[1, 1, 0, 1])
    assert found.seeds == [0, 1]
    assert small_benchmark.calls == ["nothing", "nothing"]


@pytest.mark.parametrize("lines", ["import sys; sys.exit(0)", "raise KeyError('no such thing')"])
def test_modules_that_end_on_import_are_refused(tmp_path, monkeypatch, lines):
    """A script without the usual guard runs, and ends the program, when it is imported."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "ending.py").write_text(lines)
    with pytest.raises(mf.InputError, match="method 'ending:f': the module 'ending' cannot be imported"):
        mf.benchmark(WALL, radars=RADAR, methods="ending:f", seeds=[0])


def test_what_modules_print_on_import_is_not_among_the_figures(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "talking.py").write_text("print('hello')\ndef f(image, sweep): return {'points': []}\n")
    load_method("talking:f")
    assert capsys.readouterr() == ("", "hello\n")


def test_errors_that_cannot_be_told_are_failures_like_others():
    found = run("unspeakable", "nothing", seeds=[0])
    assert [family.failures for family in found.results] == [1, 0]


@pytest.mark.parametrize("name", ["output", "sweeps"])
def test_folders_of_the_wrong_kind_are_refused(name):
    with pytest.raises(mf.InputError, match=f"{name}: got the number 3, expected the path of a folder"):
        run("nothing", seeds=[0], **{name: 3})
