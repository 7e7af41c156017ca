"""Folding with mirrors that are given: the same physics, no search; and the plan that folds again and again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose
from scipy.ndimage import map_coordinates
from synthetic import RANGE_CELL, diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.common.types import ROOT
from mirrorfold.detection.mirrors.known_mirrors import check_mirrors, read_mirrors, write_mirrors
from mirrorfold.folding.earlier import initial_image
from mirrorfold.folding.pictures import draw
from mirrorfold.folding.points import fold_back, owned_blobs
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.tree.explaining.misplaced import MIXED
from mirrorfold.tree.lines_of_sight import LinesOfSight

WALL = np.array([[0.5, 1.8], [0.9, 0.9]])
"""A wall in line of sight, and what it shows of the object."""

OBJECT = np.array([[-0.2, 1.9], [-0.06, 1.95]])


def ghost(points, wall=WALL):
    return reflect(points, wall[0], segment_normal(*wall))


def ends(reconstruction, prefix=""):
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    return np.stack([held[f"{prefix}{name}"].values for name in ("x0", "y0", "x1", "y1")], -1).reshape(-1, 2, 2)


def points(reconstruction):
    return reconstruction.children["objects"].to_dataset(inherit=False)


@pytest.fixture(scope="module")
def scatterers():
    return together(diffuse(*WALL, seed=1), diffuse(*ghost(OBJECT), seed=2))


@pytest.fixture(scope="module")
def view(scatterers):
    return radar_image(*scatterers, np.linspace(-1.0, 2.2, 401), np.linspace(0.3, 2.6, 288))


@pytest.mark.slow
def test_the_mirrors_that_were_found_fold_to_the_same_scene_when_they_are_given(view):
    found = mf.fold(view)
    given = mf.fold(view, mirrors=ends(found))
    assert len(ends(found)) == 1
    assert_allclose(ends(given), ends(found))
    assert_allclose(given["intensity"], found["intensity"])
    # Echoes of a wall found are moved onto the line of their power's centroids first, then onto that of its waves.
    for name in ("x", "y", "bounces"):
        assert_allclose(points(given)[name], points(found)[name], atol=1e-6)
    # A given mirror is taken to stand where it is drawn.
    assert_allclose(points(given)["confidence"], points(found)["confidence"], atol=0.05)
    assert given.attrs["mirrors_given"]
    assert not found.attrs["mirrors_given"]


def test_without_mirrors_the_scene_is_unfolded(view):
    for unfolded in (mf.fold(view, mirrors=[]), mf.fold(view, generations=0)):
        assert not len(ends(unfolded))
        assert (points(unfolded)["bounces"] == 0).all()
        assert unfolded.attrs["remark"] == ""


@pytest.mark.slow
def test_a_moved_mirror_moves_what_it_shows_by_twice_as_much(view):
    line = ends(mf.fold(view))
    normal = segment_normal(*line[0])
    moved = line + 0.01 * normal
    hidden = []
    for mirrors in (line, moved):
        objects = points(mf.fold(view, mirrors=mirrors))
        chosen = (objects["bounces"].values == 1) & (objects["surface"].values == "object")
        hidden.append({tuple(np.round(p, 9)): q for p, q in zip(
            np.column_stack([objects["x_initial"], objects["y_initial"]])[chosen],
            np.column_stack([objects["x"], objects["y"]])[chosen], strict=True)})  # fmt: skip
    both = hidden[0].keys() & hidden[1].keys()
    assert len(both) > 10
    assert_allclose([hidden[1][p] - hidden[0][p] for p in both], [0.02 * normal] * len(both), atol=1e-9)


@pytest.mark.slow
def test_generations_end_the_chains():
    second = np.array([[-0.75, 1.0], [-0.55, 2.2]])
    in_first = ghost(second)
    deep = np.array([[1.55, 3.2], [1.68, 3.26]])
    target = ghost(ghost(deep), second)
    parts = together(diffuse(*WALL, seed=1), diffuse(*in_first, seed=2), diffuse(*deep, seed=3))
    image = radar_image(*parts, np.linspace(-1.2, 4.0, 521), np.linspace(0.3, 4.5, 421))
    lines = np.stack([WALL, in_first])
    full = mf.fold(image, mirrors=lines)
    once = mf.fold(image, mirrors=lines, generations=1)
    assert full.children["mirrors"].to_dataset(inherit=False)["generation"].values.tolist() == [1, 2]
    assert once.children["mirrors"].to_dataset(inherit=False)["generation"].values.tolist() == [1]
    objects = points(full).isel(point=points(full)["chain"].values == "0/0")
    assert objects.sizes["point"] > 5
    assert_allclose(np.column_stack([objects["x"], objects["y"]]).mean(axis=0), target.mean(axis=0), atol=0.02)
    assert points(once)["bounces"].values.max() == 1
    # The second wall is an object now, where it stands, and hides what it showed.
    shown = points(once).isel(point=points(once)["chain"].values == "0")
    thing = shown.isel(point=shown["surface"].values == "object")
    beside = np.abs((np.column_stack([thing["x"], thing["y"]]) - second[0]) @ segment_normal(*second))
    assert np.median(beside) < 0.002
    assert beside.max() < RANGE_CELL


@pytest.mark.slow
def test_the_plan_folds_as_the_function_does_and_remembers(view):
    plan = FoldPlan(view)
    for settings in ({}, {"threshold_db": -12.0}, {"wall_margin": 0.1}, {"normalization": "none"}, {}):
        first, second = plan.fold(**settings), mf.fold(view, **settings)
        assert_allclose(first["intensity"], second["intensity"])
        assert_allclose(points(first)["x"], points(second)["x"])


@pytest.mark.slow
def test_another_grid_shows_the_same_scene(view):
    plan = FoldPlan(view)
    x, y = view["x"].values[20:180:2], view["y"].values[10:250:3]
    whole, part = plan.fold(grid=(view["x"].values, view["y"].values)), plan.fold(grid=(x, y))
    assert_allclose(part["intensity"], whole["intensity"].sel(x=x, y=y, method="nearest"), rtol=1e-5, atol=1e-7)


def test_a_reconstruction_folds_again_as_before(view):
    first = mf.fold(view)
    again = mf.fold(first, mirrors=ends(first))
    assert_allclose(ends(again), ends(first))

    def hidden(reconstruction):
        held = points(reconstruction)
        chosen = (held["bounces"].values > 0) & (held["surface"].values == "object")
        return np.column_stack([held["x"], held["y"]])[chosen]

    assert_allclose(hidden(again).mean(axis=0), hidden(first).mean(axis=0), atol=0.005)
    assert initial_image(first).attrs["normalization"] == "r"


@pytest.mark.slow
def test_known_mixed_path_ghosts_stay_out_when_a_reconstruction_is_folded_again(view):
    first = mf.fold(view)
    held = points(first)
    victim = int(np.flatnonzero((held["bounces"].values == 1) & (held["surface"].values == "object"))[0])
    place = [float(held["x_initial"][victim]), float(held["y_initial"][victim])]
    why = np.where(np.arange(held.sizes["point"]) == victim, MIXED, "")
    first["/objects"] = xr.DataTree(held.assign(explanation=("point", why)))
    again = points(mf.fold(first, mirrors=ends(first)))
    there = np.hypot(again["x_initial"] - place[0], again["y_initial"] - place[1]).values <= 0.004
    assert there.any()
    assert set(again["explanation"].values[there]) == {MIXED}
    assert (again["confidence"].values[there] < 0.5).all()


def between_samples(view, points):
    """Amplitude at points (..., 2) [m], linear between samples; zero outside."""
    range_, u = view.to_polar(points)
    place = (range_ - view.range[0]) / view.dr, (np.nan_to_num(u, nan=-9.0) - view.u[0]) / view.du
    return map_coordinates(view.amplitude, place, order=1)


def test_the_kernel_renders_what_its_slow_twin_does(view):
    """The picture by array arithmetic, pixel for pixel, in float64."""
    from synthetic import build_tree

    from mirrorfold.detection.image_echoes import find_ridges
    from mirrorfold.detection.views.image_to_view import to_image_view

    polar = to_image_view(view)
    tree, sight = build_tree(find_ridges(polar), polar)
    x, y = view["x"].values, view["y"].values
    grid = np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)
    expected = np.zeros(grid.shape[:2])
    mirrors = [(number, sight.fold(number)) for number in (ROOT, *sight.ways)]
    blobs = owned_blobs(fold_back(tree), sight)
    own, ahead, looked = polar.locate(grid)
    empty = looked & (own < sight.empty_up_to[ahead])
    for mirror, fold in mirrors:
        range_, column, inside = polar.locate(fold.inverse(grid))
        amplitude = np.where(inside, between_samples(polar, fold.inverse(grid)), 0.0)
        through = [sight.seen_through(range_ - 0.04, c) for c in (column, *polar.beside(range_, column))]
        seen = inside & sight.cover.clear(range_, column, amplitude) & (through[0] == mirror)
        if mirror != ROOT:
            seen &= ~empty | ((through[1] == mirror) & (through[2] == mirror))
            sample = np.clip(np.rint((range_ - polar.range[0]) / polar.dr).astype(int), 0, polar.range.size - 1)
            seen &= blobs[column, sample] == mirror
        expected = np.maximum(expected, np.where(seen, amplitude, 0.0))
    intensity, initial = (draw(s, 0.04, (x, y), blobs) for s in (sight, LinesOfSight.unfolded(polar)))
    assert len(mirrors) == 2
    assert_allclose(intensity, expected, rtol=1e-5, atol=1e-6 * expected.max())
    assert_allclose(initial, between_samples(polar, grid), rtol=1e-5, atol=1e-6 * expected.max())


def test_files_of_mirrors_keep_every_bit(tmp_path):
    lines = np.random.default_rng(0).normal(size=(5, 2, 2))
    assert np.array_equal(read_mirrors(write_mirrors(lines, tmp_path / "mirrors.json")), lines)
    assert read_mirrors(write_mirrors([], tmp_path / "none.json")).shape == (0, 2, 2)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[", "is not valid JSON"),
        ("[]", "holds no list 'mirrors'"),
        ('{"mirrors": [{"start": [0, 1]}]}', "mirror 0 has the entries 'start', expected 'start' and 'end'"),
        (
            '{"mirrors": [{"start": [0.45, 1.5], "trough": [0.6, 1.2], "end": [0.9, 1.5]}]}',
            "mirror 0 has the entries 'start', 'trough', 'end', expected",
        ),
        ('{"mirrors": [[[0, 1], [1, 1]], {"start": [0, 1], "end": [1, 1]}]}', "mirror 0 has no entries, expected"),
        (
            '{"mirrors": [{"start": [0, 1], "through": [2, 1], "end": [1, 1]}]}',
            "in line with its ends, but not between",
        ),
        (
            '{"mirrors": [{"start": [0, 1], "through": [0, 1], "end": [1, 1]}]}',
            "in line with its ends, but not between",
        ),
        ('{"mirrors": [{"start": [0, 1], "through": [1, 2], "end": [0, 1]}]}', "mirror 0 starts where it ends"),
        ('{"mirrors": [{"start": [0, 1], "end": [0, 1]}]}', "mirror 0 has no length"),
        (
            '{"mirrors": [{"start": [0, 1], "end": [1, 1]}, {"start": [1, 1], "end": [-0.0, 1]}]}',
            "mirror 1 is mirror 0 once more",
        ),
        ('{"mirrors": [{"start": [0, 1], "end": [0, NaN]}]}', "not finite"),
        ('{"mirrors": [{"start": [0, 1], "end": "x"}]}', "two ends"),
        ('{"mirrors": [{"start": [0, "1"], "end": [1, 1]}]}', "two ends.* got .*'start': .0, '1'"),
        ('{"mirrors": [{"start": [0, "1 m"], "end": [1, 1]}]}', "mirror 0 has numbers with a unit and others without"),
        ('{"mirrors": [{"start": [0, "1 s"], "end": [0, "2 m"]}]}', "mirror 0: '1 s' is no length, expected a number"),
        ('{"mirrors": [{"start": [true, false], "end": [true, true]}]}', "two ends"),
        ('{"mirrors": [{"start": [0, 1, 2], "end": [0, 1, 3]}]}', "two ends"),
        (
            '{"mirrors": [{"corners": [[0, 2, 0], [1, 2, 1], [1, 2, 0], [0, 2, 1]]}]}',
            "mirror 0 has no convex outline; give its corners in their order around the face",
        ),
        ('{"mirrors": [{"corners": [[0, 2, 0], [1, 2, 0], [0.2, 2, 0.2], [0, 2, 1]]}]}', "no convex outline"),
    ],
)
def test_wrong_files_of_mirrors_are_refused_by_name(tmp_path, content, words):
    path = tmp_path / "mirrors.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(mf.InputError, match=words) as caught:
        read_mirrors(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        (
            {"start": ["-13cm", "98 cm"], "end": [0, "1.21m"]},
            {"start": [-0.13, 0.98], "end": [0, 1.21]},
        ),
        (
            {"center": ["500 mm", "2 m", "1ft"], "radius": "3 in"},
            {"center": [0.5, 2, 0.3048], "radius": 0.0762},
        ),
    ],
)
def test_lengths_in_a_file_of_mirrors_may_have_units(tmp_path, said, meant):
    path = tmp_path / "mirrors.json"
    path.write_text(json.dumps({"mirrors": [said]}))
    assert_allclose(read_mirrors(path), check_mirrors([meant]), rtol=1e-12)


def test_corners_may_go_round_either_way_from_any_of_them():
    corners = np.array([[0.0, 2.0, 0.0], [1.0, 1.5, 0.0], [1.0, 1.5, 1.0], [0.0, 2.0, 0.8]])
    for turned in (np.roll(corners, first, axis=0)[::step] for first in range(4) for step in (1, -1)):
        assert np.array_equal(check_mirrors([turned]), [turned])


def test_a_mirror_that_stands_there_twice_is_noticed_in_every_order():
    """Planes and cylinders were only noticed if their points came in the same order."""
    corners = np.array([[0.0, 2.0, 0.0], [1.0, 1.5, 0.0], [1.0, 1.5, 1.0], [0.0, 2.0, 1.0]])
    for again in (np.roll(corners, 1, axis=0), np.roll(corners[::-1], 2, axis=0)):
        with pytest.raises(mf.InputError, match="mirror 1 is mirror 0 once more"):
            check_mirrors([corners, again])
    cylinder = {"start": [0, 2, -1], "end": [0, 2, 1], "radius": 0.2}
    with pytest.raises(mf.InputError, match="mirror 1 is mirror 0 once more"):
        check_mirrors([cylinder, {"start": [0, 2, 1], "end": [0, 2, -1], "radius": 0.2}])
    assert len(check_mirrors([cylinder, cylinder | {"radius": 0.3}])) == 2


def test_wrong_settings_are_refused(view):
    with pytest.raises(mf.InputError, match="generations is -1"):
        mf.fold(view, generations=-1)
    with pytest.raises(mf.InputError, match="two ends"):
        mf.fold(view, mirrors=[1.0, 2.0])
    with pytest.raises(mf.InputError, match="round in space, cylinders or spheres"):
        mf.fold(view, mirrors=[{"start": [0, 1, 0], "end": [0, 1, 1], "radius": 0.1}])


@pytest.mark.slow
def test_mirrors_may_be_given_as_the_file_has_them(view):
    rows = [{"start": start, "end": end} for start, end in (WALL.tolist(),)]
    assert_allclose(ends(mf.fold(view, mirrors=rows)), ends(mf.fold(view, mirrors=WALL[None])))
    arc = [*rows, {"start": [-0.5, 1.8], "through": [-0.6, 1.4], "end": [-0.5, 1.0]}]
    assert "curvature" in mf.fold(view, mirrors=arc).children["mirrors"].dataset


@pytest.mark.slow
def test_the_command_line_folds_with_given_mirrors(view, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(view, "image.nc")
    line = ends(mf.fold(view)) + 0.01
    write_mirrors(line, "mirrors.json")
    options = ["--mirrors", "mirrors.json", "--wall-margin", "0.05", "--generations", "1"]
    assert main(["fold", "image.nc", "-o", "out.nc", "--json", *options]) == 0
    assert json.loads(capsys.readouterr().out)["mirrors"][0]["start_m"] == pytest.approx(line[0, 0].tolist())
    written, expected = mf.load("out.nc"), mf.fold(view, mirrors=line, wall_margin=0.05, generations=1)
    assert_allclose(written["intensity"], expected["intensity"])
    assert main(["fold", "out.nc", "-o", "again.nc", "--mirrors", "mirrors.json"]) == 0
    assert_allclose(ends(mf.load("again.nc")), line)
    assert main(["fold", "image.nc", "-o", "x.nc", "--mirrors", "absent.json"]) == 2
