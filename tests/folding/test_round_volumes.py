"""Pillars and balls as mirrors before a raster scanner, from the sweep to the folded scene."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scans import NEAR_FOCUS, ROUGH, ball, box, panel, pillar, scene

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.detection import find_echoes, see
from mirrorfold.detection.mirrors.mirror import ChainFold
from mirrorfold.detection.mirrors.round_mirror import RoundMirror
from mirrorfold.detection.search.round_sheets import find_round_sheets, fitted
from mirrorfold.reconstruction import FoldPlan

pytestmark = pytest.mark.slow

RADIUS = 0.2
PILLAR = pillar(radius=RADIUS)
SLANTING = {**PILLAR, "start": [-0.3, 2.2, -0.9], "end": [0.3, 2.2, 0.9]}
BALL = ball("round", (0.0, 2.2, 0.0), RADIUS, diffuse_fraction=0.0, roughness=ROUGH)
MIRRORS = {"pillar": PILLAR, "slanting": SLANTING, "ball": BALL}


def world_of(*surfaces, **settings):
    return scene(*surfaces, half=9.0, beams=45, **NEAR_FOCUS, **settings)


def volume_of(world):
    return mf.focus(mf.simulate(world, bounces=1, seed=1, snr_db=20.0))


@pytest.fixture(scope="module", params=list(MIRRORS))
def shown(request):
    """Which mirror, the scene with a box beside the view, and its volume."""
    world = world_of(MIRRORS[request.param], box())
    return request.param, world, volume_of(world)


@pytest.fixture(scope="module")
def plan(shown):
    return FoldPlan(shown[2])


@pytest.fixture(scope="module")
def folded(plan):
    return plan.fold()


def test_what_only_a_round_mirror_shows_is_folded_to_its_place(shown, plan, folded):
    _, world, _ = shown
    hidden = mf.score(folded, world).hidden
    assert hidden.f_score_cells > 0.9
    assert hidden.accuracy_m < 0.04
    without = mf.score(plan.fold(curved=False), world).hidden
    assert without.f_score_cells == 0.0


def test_the_mirror_is_found_to_a_hundredth_of_its_radius(shown, folded):
    name, world, _ = shown
    mirrors = folded["mirrors"].dataset
    assert mirrors.sizes["mirror"] == 1
    assert 1.0 / float(mirrors["curvature"][0]) == pytest.approx(RADIUS, rel=0.02)
    axis = np.array([float(mirrors[f"axis_{i}"][0]) for i in "xyz"])
    surface = world.surface[0]
    if name == "ball":
        assert_allclose(axis, 0.0, atol=1e-9)
    else:
        true = np.subtract(surface.end, surface.start) / np.linalg.norm(np.subtract(surface.end, surface.start))
        assert abs(axis @ true) > np.cos(np.radians(0.5))


def test_the_cell_behind_it_grows_as_the_beam_does(shown, folded):
    """Of a convex mirror by far more than one, and the further what it shows stands from it the more."""
    objects = folded["objects"].dataset
    seen = objects["bounces"].values > 0
    assert objects["growth"].values[seen].min() > 1.5
    assert_allclose(objects["growth"].values[~seen], 1.0)
    assert set(objects["caustic"].values) == {""}


def test_the_picture_shows_it_where_it_stands(shown, folded):
    """The brightest pixels out of sight lie around the box."""
    picture = folded.dataset["intensity"]
    aside = picture.where(picture.x < -0.6, drop=True)
    at = np.unravel_index(int(aside.fillna(0.0).values.argmax()), aside.shape)
    place = float(aside.x[at[1]]), float(aside.y[at[0]])
    assert np.hypot(place[0] + 1.0, place[1] - 1.6) < 0.3
    assert float(aside.max()) > 3.0 * float(np.median(aside.values[aside.values > 0.0]))


def test_the_result_survives_its_file_and_is_drawn(shown, folded, tmp_path):
    mf.save(folded, tmp_path / "r.nc")
    again = mf.load(tmp_path / "r.nc")
    assert_allclose(again["mirrors"].dataset["axis_z"], folded["mirrors"].dataset["axis_z"])
    for what in ("space", "before-after"):
        assert main(["show", str(tmp_path / "r.nc"), "--what", what, "-o", str(tmp_path / f"{what}.png")]) == 0
    assert main(["report", str(tmp_path / "r.nc"), "-o", str(tmp_path / "r.html")]) == 0


def test_given_by_its_measures_it_shows_the_same(shown, plan, folded, tmp_path):
    name, world, _ = shown
    surface = world.surface[0]
    own = {"center": surface.center} if name == "ball" else {"start": surface.start, "end": surface.end}
    path = tmp_path / "mirrors.json"
    path.write_text(json.dumps({"mirrors": [{**own, "radius": RADIUS}]}))
    given = plan.fold(mirrors=path)
    assert mf.score(given, world).hidden.f_score_cells > 0.9
    tables = [r.children["objects"].to_dataset(inherit=False) for r in (given, folded)]
    seen, found = (table.isel(point=table["bounces"].values > 0) for table in tables)
    assert abs(seen.sizes["point"] - found.sizes["point"]) <= 0.1 * found.sizes["point"]
    middles = [[float(np.median(r[axis])) for axis in "xyz"] for r in (seen, found)]
    assert_allclose(*middles, atol=0.03)


@pytest.mark.parametrize(
    ("mirror", "said"),
    [
        ({"center": [0, 2, 0], "radius": -0.2}, "radius -0.2, expected a length above zero"),
        ({"start": [0, 2, -1], "end": [0, 2, 1], "radius": float("inf")}, "not finite"),
        ({"center": [0, 2], "radius": 0.2}, "expected for each mirror"),
        ({"center": [0, 2, 0], "radius": "wide"}, "expected for each mirror"),
    ],
)
def test_wrong_measures_are_told_in_one_sentence(mirror, said, tmp_path):
    path = tmp_path / "mirrors.json"
    path.write_text(json.dumps({"mirrors": [mirror]}))
    with pytest.raises(mf.InputError, match=said) as error:
        mf.detection.mirrors.known_mirrors.read_mirrors(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "surfaces",
    [(pillar(diffuse_fraction=1.0), box()), (BALL,), (panel("board", (0.0, 2.0, 0.0), (-0.7, -1.0, 0.0)), ball())],
    ids=["rough pillar", "ball that shows nothing", "plane"],
)
def test_nothing_else_becomes_a_round_mirror(surfaces):
    plan = FoldPlan(volume_of(world_of(*surfaces)))
    folded = plan.fold()
    assert "curvature" not in folded["mirrors"].dataset
    flat = plan.fold(curved=False)
    assert_allclose(folded["objects"].dataset["x"], flat["objects"].dataset["x"])


def test_a_plane_is_no_round_sheet():
    view = see(volume_of(world_of(panel("board", (0.0, 2.0, 0.0), (-0.5, -1.0, 0.0)))))
    echoes = find_echoes(view)
    assert len(echoes) > 500
    assert not find_round_sheets(view, echoes)


@pytest.mark.parametrize("kind", ["cylinder", "ball"])
def test_map_takes_the_image_of_a_point_back_to_it(kind):
    """By way of the place that Fermat's principle finds, at the length of the whole way."""
    shape = RoundSurface(np.array([0.1, 2.3, 0.0]), np.array([0.0, 0.0, 1.0]) * (kind == "cylinder"), 0.3)
    radar = np.array([0.02, 0.0, 0.01])
    points = np.random.default_rng(0).uniform([-1.2, 0.5, -0.5], [1.2, 1.7, 0.5], (50, 3))
    places, found = shape.reflection(radar, points)
    assert found.all()
    before = np.linalg.norm(places - radar, axis=1)
    length = before + np.linalg.norm(points - places, axis=1)
    image = radar + (length / before)[:, None] * (places - radar)
    mirror = RoundMirror(places, np.ones(1, bool), shape, radar)
    fold = ChainFold([mirror])
    assert_allclose(fold(image), points, atol=1e-9)
    # Thin pencils grow as the map stretches what is square to the line of sight.
    stretched = np.linalg.svd(fold.turn(image), compute_uv=False)
    growth = np.sort(np.column_stack([mirror.growth(image), np.ones(len(image))]), axis=1)[:, ::-1]
    assert_allclose(np.prod(stretched, axis=1), np.prod(growth, axis=1), rtol=1e-4)
    # Flat in the limit: nothing grows.
    wide = replace(shape, middle=shape.middle + np.array([0.0, 1e5, 0.0]), radius=shape.radius + 1e5)
    assert_allclose(RoundMirror(places, np.ones(1, bool), wide, radar).growth(image), 1.0, atol=1e-3)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["cylinder", "ball"])
def test_fit_finds_the_surface_that_points_lie_on(kind, tilt):
    """From a first guess that is a tenth off, to a fraction of the noise, for all that stands beside it."""
    axis = np.array([tilt, 0.0, 1.0]) / np.hypot(tilt, 1.0) * (kind == "cylinder")
    true = RoundSurface(np.array([0.0, 2.2, 0.0]), axis, 0.2)
    random = np.random.default_rng(0)
    points = true.nearest(random.uniform([-0.18, 1.9, -0.3], [0.18, 2.0, 0.3], (400, 3)))
    points += random.normal(scale=1e-3, size=points.shape)
    points[:20] += 0.05
    guess = RoundSurface(true.middle + 0.02, axis, 0.22)
    for _ in range(3):
        guess, trust, _ = fitted(guess, points, np.ones(len(points)))
    assert guess.radius == pytest.approx(0.2, abs=1e-3)
    assert_allclose(guess.beside(true.nearest(points)), 0.0, atol=1e-3)
    assert np.median(trust[:20]) < 0.1 * np.median(trust[20:])
