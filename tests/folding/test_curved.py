"""Curved mirrors from the sweep to the score: a pillar shows what a screen hides."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
import xarray as xr
from serving import WALLS, two_walls

import mirrorfold as mf
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.views.image_to_view import to_image_view
from mirrorfold.folding.magnification import BEYOND, NEAR, magnified
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.scenes.families import draw
from mirrorfold.scoring.cells import point_cells


def shallower(scene: mf.Scene) -> mf.Scene:
    """The scene at fewer frequencies, unambiguous up to 4.5 m, which the longest way in it does not reach."""
    return replace(scene, band=replace(scene.band, points=301))


@pytest.fixture(scope="module")
def scene() -> mf.Scene:
    scene = shallower(mf.load_scene(files("mirrorfold") / "scenes/shipped/pillar.toml"))
    return replace(scene, array=replace(scene.array, elements=121))


@pytest.fixture(scope="module")
def plan(scene: mf.Scene) -> FoldPlan:
    sweep = mf.simulate(scene)
    return FoldPlan(mf.focus(sweep, tolerance=1e-3), sweep=sweep)


@pytest.fixture(scope="module")
def folded(plan: FoldPlan) -> xr.DataTree:
    return plan.fold()


@pytest.mark.slow
def test_pillar_shows_what_is_hidden_and_keeps_its_radius(scene: mf.Scene, folded: xr.DataTree) -> None:
    mirrors = folded.children["mirrors"].dataset
    bent = mirrors["curvature"].values != 0.0
    assert np.count_nonzero(bent) == 1
    assert abs(1.0 / (0.35 * mirrors["curvature"].values[bent][0]) - 1.0) < 0.03
    score = mf.score(folded, scene)
    assert score.hidden.f_score_cells is not None
    assert score.hidden.f_score_cells > 0.9
    assert score.hidden.accuracy_m is not None
    assert score.hidden.accuracy_m < 0.05
    # The picture shows it, too, and nothing where nothing stands: between the radar and the screen.
    picture = folded["intensity"]
    peak = float(picture.sel(x=slice(-0.5, -0.2), y=slice(1.3, 1.7)).max())
    assert peak > 0.0
    assert float(picture.sel(x=slice(-0.4, 0.4), y=slice(0.3, 0.8)).max()) < 1e-3 * peak


@pytest.mark.slow
def test_switched_off_the_pillar_is_an_object(scene: mf.Scene, plan: FoldPlan) -> None:
    flat = plan.fold(curved=False)
    assert "curvature" not in flat.children["mirrors"].dataset
    assert "growth" not in flat.children["objects"].dataset
    assert not (flat.children["objects"].dataset["bounces"].values > 0).any()
    assert mf.score(flat, scene).hidden.completeness_cells == 0.0


@pytest.mark.slow
def test_a_pillar_of_ten_centimetres_shows_what_is_hidden() -> None:
    """Behind it, cells are wider than the way from known things to hidden ones."""
    scene = shallower(draw("pillar", 624))
    sweep = mf.simulate(scene, seed=624)
    score = mf.score(mf.fold(mf.focus(sweep, tolerance=1e-3), sweep=sweep), scene)
    assert score.hidden.f_score_cells is not None
    assert score.hidden.f_score_cells > 0.9


@pytest.mark.slow
def test_what_is_folded_is_saved_loaded_and_scored_in_grown_cells(folded: xr.DataTree, tmp_path: object) -> None:
    mf.save(folded, f"{tmp_path}/folded.nc")
    again = mf.load(f"{tmp_path}/folded.nc")
    objects = again.children["objects"].dataset
    grown, plain = point_cells(objects, again.attrs), point_cells(objects, again.attrs, grown=False)
    assert grown is not None
    assert plain is not None
    behind = objects["chain"].values == "1"
    np.testing.assert_array_equal(grown[~behind], plain[~behind])
    assert (grown[behind] > 2.0 * plain[behind]).all()


def test_points_near_and_beyond_a_caustic_are_marked() -> None:
    attrs = {"frequency_start": 290e9, "frequency_stop": 300e9, "frequency_points": 401, "tx_aperture": 0.04,
             "rx_aperture": 0.04}  # fmt: skip
    axes = {"y": np.linspace(0.1, 3.0, 60), "x": np.linspace(-1.0, 2.0, 60)}
    view = to_image_view(xr.DataArray(np.ones((60, 60)), axes, ("y", "x"), attrs=attrs))
    bay = ArcMirror(
        middle=np.array([0.0, 1.0]), radius=1.0, first=np.radians(60.0), span=np.radians(60.0), radar=np.zeros(2)
    )
    # Straight ahead, at 2 m: with the radar 1 m before the center the caustic lies 2/3 m from the face.
    image = np.array([[0.0, 2.0 + s] for s in (1e-3, 0.66, 0.9, 6.0)])
    growth, caustic = magnified([bay], image, view)
    assert list(caustic) == ["", NEAR, BEYOND, BEYOND]
    assert growth[0] == pytest.approx(1.0, abs=0.05)
    width, bend = bay.spread(image)
    assert abs(width[1]) < 0.02
    # What the pencil loses, the blur of the aperture makes up for: half of 4 cm, in cells.
    blur = 0.5 * view.glint * abs(bend[1] - width[1]) / float(view.width(2.66))
    assert growth[1] == pytest.approx(np.hypot(width[1], blur), rel=1e-6)
    assert growth[1] > 5.0 * abs(width[1])


@pytest.mark.slow
def test_a_caustic_inside_the_scene_is_told_in_one_sentence() -> None:
    bay = np.array([WALLS[0][0], np.add(WALLS[0].mean(axis=0), [0.137, 0.061]), WALLS[0][1]])
    folded = mf.fold(two_walls(), mirrors=[bay, [WALLS[1][0], WALLS[1].mean(axis=0), WALLS[1][1]]])
    objects = folded["objects"].to_dataset(inherit=False)
    shown = objects["confidence"].values >= folded.attrs["fold_min_confidence"]
    count = int(np.count_nonzero((objects["caustic"].values != "") & shown))
    assert count > 1
    sentence = f"{count} points lie near or beyond a caustic of a concave mirror, where the image is out of focus"
    assert folded.attrs["remark"] == sentence
    assert mf.info(folded).remarks == [f"{sentence}."]
