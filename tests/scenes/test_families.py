"""Families of random scenes: the same scene for the same seed, hidden what shall be hidden, plain words otherwise."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mirrorfold.errors import InputError
from mirrorfold.scenes import families
from mirrorfold.scenes.families import FAMILIES, RADARS, Family, draw, radars_of
from mirrorfold.scenes.families.drawing import good
from mirrorfold.scenes.families.parts import arc, circle, wall
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.visibility import visible_truth

HASHES = {
    ("one wall", 0): "35315392d0a8",
    ("two walls", 7): "bc058ded4fa0",
    ("SNR 0 dB", 7): "bc058ded4fa0",
    ("corridor", 0): "8c347c905168",
    ("three bounces", 7): "4679e1aca52a",
    ("drywall", 0): "45b85f7be546",
    ("discs", 7): "652abdc4a817",
    ("empty", 0): "4f53cda18c2b",
}
"""Of scenes that published tables were made with: they must stay comparable."""

IN_PLANE = [radar for radar in RADARS.values() if radar.array]


def outline_hash(scene):
    outlines = [(s.name, s.kind, [np.round(p, 9).tolist() for p in s.pieces(0.05)]) for s in scene.surface]
    return hashlib.sha256(json.dumps(outlines).encode()).hexdigest()[:12]


@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed"), HASHES)
def test_a_seed_gives_the_scene_that_it_always_gave(family, seed):
    assert outline_hash(draw(family, seed)) == HASHES[family, seed]


@pytest.mark.slow
def test_all_radars_of_the_plane_see_the_same_scene():
    scenes = [draw("two-walls", 3, radar=radar) for radar in IN_PLANE]
    assert len({outline_hash(scene) for scene in scenes}) == 1
    assert len({scene.band.stop for scene in scenes}) == 4


@pytest.mark.parametrize("radar", IN_PLANE, ids=lambda radar: radar.name)
def test_a_radar_samples_its_aperture_and_holds_the_scene(radar):
    scene = draw("empty", radar=radar)
    wavelength = 299792458.0 / scene.band.stop
    place = scene.array.tx_position[:, 0]
    assert np.min(np.diff(place)) <= 0.501 * wavelength
    assert scene.band.ambiguous_range == pytest.approx(6.0, rel=1e-3)
    assert radar.cell == pytest.approx(scene.band.ambiguous_range / (scene.band.points - 1))
    assert f"{np.ptp(place) * 100:.0f} cm" in radar.what or "every third" in radar.what


def test_the_thinned_array_lacks_every_third_antenna():
    whole, thinned = (draw("empty", radar=name).array.tx_position for name in ("300 GHz", "300 GHz thinned"))
    there = np.array([bool(np.isclose(thinned[:, 0], x, atol=1e-9).any()) for x in whole[:, 0]])
    assert np.array_equal(np.flatnonzero(~there), np.arange(2, 161, 3))


@pytest.mark.parametrize("name", ["one wall", "corridor", "three bounces"])
def test_hidden_objects_are_out_of_sight_and_shown_by_mirrors(name):
    scene = draw(name, 11)
    assert isinstance(scene, Scene)
    for surface in scene.surface:
        if surface.name in ("corner", "arc", "disc", "target"):
            points, normals, _ = surface.sample(0.004)
            direct, reachable = visible_truth(scene, points, normals, bounces=FAMILIES[name].bounces)
            assert not direct.any()
            assert reachable.mean() > 0.15


def two_scene(*surfaces):
    return parse_scene(
        {"name": "test", "array": RADARS["300 GHz"].array, "band": RADARS["300 GHz"].band, "surface": surfaces}
    )


def test_what_is_in_sight_or_near_or_not_shown_is_no_scene():
    shows = wall("wall", (0.7, 1.4), 105.0, 1.1)
    hides = wall("screen", (-0.4, 1.0), 170.0, 1.0)
    target = arc("arc", (-0.4, 1.9), 0.2, -15.0, 120.0)
    assert good(two_scene(hides, shows, target), 1)
    assert not good(two_scene(shows, target), 1)  # nothing hides it
    assert not good(two_scene(hides, target), 1)  # nothing shows it
    assert not good(two_scene(hides, shows, target, circle("pillar", (-0.4, 2.15), 0.1)), 1)  # something touches it


def never(random, radar):
    return [wall("wall", (0.0, 1.0), 0.0, 1.0), circle("disc", (0.0, 0.5), 0.05)]


def nonsense(random, radar):
    return [{"name": "wall", "kind": "sgment"}]


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda: draw("two wals"), "family is 'two wals', expected one of: one wall, two walls"),
        (lambda: draw("two walls", radar="60 GHz"), "radar is '60 GHz', expected one of: 300 GHz"),
        (lambda: draw("two walls", -1), "seed is -1"),
        (lambda: draw("two walls", radar="scanner"), "radar 'scanner' cannot see family 'two walls'"),
        (lambda: draw(3), "family"),
        (lambda: draw(Family(name="n", what="", engine="rays", make=nonsense)), "surface[0].kind is 'sgment'"),
    ],
)
def test_wrong_words_get_one_sentence(call, expected):
    with pytest.raises(InputError) as caught:
        call()
    assert expected in str(caught.value)


def test_impossible_ranges_get_one_sentence(monkeypatch):
    monkeypatch.setattr(families.drawing, "DRAWS", 20)
    with pytest.raises(InputError, match="seed 0: none of 20 draws hides its objects"):
        draw(Family(name="never", what="a disc in sight", engine="rays", make=never))


def test_every_family_says_what_it_is():
    assert all(family.what and radars_of(family) for family in FAMILIES.values())
    assert set(FAMILIES) == {family.name for family in FAMILIES.values()}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"engine": "foo"}, "engine is 'foo', expected one of rays, fullwave, raster"),
        ({"bounces": -1}, "bounces is -1"),
        ({"name": ""}, "family: name"),
        ({"make": None}, "make: got None"),
        ({"options": None}, "options: got None"),
        ({"options": {"seed": 3}}, "options hold seed, which a benchmark sets"),
        ({"snr_db": "20"}, "snr_db is '20', expected a number of decibels"),
        ({"polarization": "VV"}, "polarization is 'VV', expected one of TE, TM, both"),
        ({"curved": "no"}, "curved is 'no', expected True or False"),
        ({"radar": 300}, "radar: got the number 300"),
    ],
)
def test_families_that_no_scene_can_be_drawn_from_are_refused(changed, said):
    with pytest.raises(InputError, match=said):
        replace(FAMILIES["empty"], **changed)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"name": None}, "radar: name: got None"),
        ({"array": {}}, "radar '300 GHz': has neither an array nor a scanner"),
        ({"scanner": RADARS["scanner"].scanner}, "radar '300 GHz': has both an array and a scanner"),
    ],
)
def test_radars_that_are_none_are_refused(changed, said):
    with pytest.raises(InputError, match=said):
        replace(RADARS["300 GHz"], **changed)


def test_a_function_without_a_name_makes_scenes_too():
    made_by = replace(FAMILIES["two walls"], make=partial(FAMILIES["two walls"].make, material="glass"))
    scene = draw(made_by, np.int64(3))
    assert {surface.material for surface in scene.surface[:2]} == {"glass"}
    assert scene == draw(made_by, 3)


def test_a_surface_without_a_name_need_not_be_hidden():
    family = Family(name="unnamed", what="", engine="rays", make=lambda random, radar: [wall("", (0.0, 1.0), 0.0, 1.0)])
    assert len(draw(family).surface) == 1


def test_a_radar_that_sees_too_little_is_told_from_a_family_that_is_impossible(monkeypatch):
    monkeypatch.setattr(families.drawing, "DRAWS", 20)
    near = replace(RADARS["300 GHz"], name="near", band={"start": 290e9, "stop": 300e9, "points": 31})
    with pytest.raises(InputError, match="radar 'near' cannot see family 'two walls': in each of 20 draws"):
        draw("two walls", radar=near)
