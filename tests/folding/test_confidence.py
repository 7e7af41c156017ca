"""Confidence and standard errors of points, and what doubted ones are left out of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection.finding import find_echoes, see, usual_settings
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.errors import InputError
from mirrorfold.folding import fold_back
from mirrorfold.folding.confidence import errors, mirror_confidence, multiply_by_mirrors, with_confidence
from mirrorfold.folding.confident import confident_points
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.tree.rounds import find_tree

WALL = (0.55, 1.9), (0.85, 0.95)
OBJECT = np.array([[-0.4, 1.4], [-0.25, 1.45]])
LONE = [[-0.9, 0.7]]


def all_points(reconstruction):
    return reconstruction.children["objects"].to_dataset(inherit=False)


@pytest.fixture(scope="module")
def image():
    """A wall, an object that it shows, and a weak echo beside all of them."""
    ghost = reflect(OBJECT, WALL[0], segment_normal(*WALL))
    parts = diffuse(*WALL, seed=1), diffuse(*ghost, seed=2), (LONE, [0.3])
    return radar_image(*together(*parts), np.linspace(-1.2, 2.6, 381), np.linspace(0.3, 2.6, 231))


@pytest.fixture(scope="module")
def found(image):
    view = see(image)
    echoes = find_echoes(view)
    return find_tree(view, echoes, FoldSettings().completed(**usual_settings(view, echoes)))


def with_mirror(found, **changes):
    """The same, with one mirror changed."""
    node = found.tree.mirrors[0]
    return found._replace(tree=replace(found.tree, mirrors=(replace(node, way=(replace(node.mirror, **changes),)),)))


def test_what_was_folded_by_a_mirror_that_is_hardly_known_is_doubted(found):
    points = fold_back(found.tree)
    hidden = points.bounces > 0
    sure = with_confidence(points, with_mirror(found, angle_error=0.01, offset_error=1e-4)).confidence
    unsure = with_confidence(points, with_mirror(found, angle_error=4.0, offset_error=1e-4)).confidence
    assert sure[hidden].mean() > 0.8
    assert unsure[hidden].mean() < 0.2
    assert_allclose(sure[~hidden], unsure[~hidden])


def test_standard_errors_hold_those_of_the_mirror(found):
    """Against mirrors that are moved and turned at random."""
    angle, offset, random = 0.3, 2e-3, np.random.default_rng(0)
    points = fold_back(found.tree)
    stated = errors(points, with_mirror(found, angle_error=angle, offset_error=offset).tree, found.sight.view)[0]
    own = errors(points, with_mirror(found, angle_error=0.0, offset_error=0.0).tree, found.sight.view)[0]
    mirror = found.tree.mirrors[0].mirror
    assert isinstance(mirror, LineMirror)
    hidden = points.bounces > 0
    places = []
    for _ in range(2000):
        turn = np.radians(angle) * random.normal()
        normal = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ mirror.normal
        places.append(reflect(points.initial[hidden], mirror.center + offset * random.normal() * mirror.normal, normal))
    assert_allclose(stated[hidden] ** 2 - own[hidden] ** 2, np.var(places, axis=0), rtol=0.15)


@pytest.mark.slow
def test_a_given_mirror_is_taken_to_stand_where_it_is_drawn(image):
    given = all_points(mf.fold(image, mirrors=[WALL]))
    assert np.isfinite(given["confidence"]).all()
    assert (given["confidence"].values[given["bounces"] > 0] > 0.5).mean() > 0.9


@pytest.mark.slow
def test_doubted_points_stay_in_the_file_alone(image, tmp_path):
    every = all_points(mf.fold(image))
    least = float(np.quantile(every["confidence"], 0.2))
    drawn = mf.fold(image, min_confidence=least)
    assert_allclose(all_points(drawn)["x"], every["x"])
    kept = (every["confidence"] >= least).values
    assert 0 < kept.sum() < kept.size
    doubted = {"x": every["x_initial"][~kept], "y": every["y_initial"][~kept], "method": "nearest"}
    assert (drawn["intensity"].sel(**doubted) == 0.0).any()
    lines = [len(mf.export(drawn, tmp_path / "a.csv", min_confidence=least).read_text().splitlines()) - 1
             for least in (None, 0.0)]  # fmt: skip
    assert lines == [kept.sum(), kept.size]
    about = mf.info(drawn)
    assert (about.points, about.doubted) == (kept.sum(), kept.size - kept.sum())


@pytest.mark.slow
def test_scores_leave_doubted_points_out_unless_they_are_asked_for(image):
    scene = parse_scene({"name": "wall", "dimensions": 2, "array": {"kind": "linear", "elements": 8, "pitch": 5e-4},
                           "band": {"start": 290e9, "stop": 300e9, "points": 11}, "surface": [
                               {"name": "wall", "kind": "segment", "start": WALL[0], "end": WALL[1]}]})  # fmt: skip
    middle = float(np.median(all_points(mf.fold(image))["confidence"]))
    folded = mf.fold(image, min_confidence=middle)
    counts = [mf.score(folded, scene, min_confidence=least).points for least in (None, 0.0, middle)]
    assert counts[0] == counts[2] < counts[1] == all_points(folded).sizes["point"]


@pytest.mark.slow
def test_files_of_earlier_versions_show_all_their_points(image):
    folded = mf.fold(image)
    del folded.attrs["fold_min_confidence"]
    assert confident_points(folded).sizes == all_points(folded).sizes


@pytest.mark.slow
@pytest.mark.parametrize("least", [-0.1, 1.5, float("nan"), "half"])
def test_what_is_no_probability_is_refused(image, least):
    with pytest.raises(InputError, match=r"min_confidence is .*at least 0 and up to 1"):
        confident_points(mf.fold(image), least)


def test_each_mirror_on_the_way_counts_once(found):
    """A second mirror is seen in the first: the echoes on its face have the first on their way already."""
    points = fold_back(found.tree).take(np.arange(6))
    points = replace(points, interpolated=np.zeros(6, dtype=bool), confidence=np.full(6, 0.9))
    points = replace(points, chain=np.array(["", "", "0", "0", "0/1", "0/2"]))
    points = replace(points, mirror=np.array(["", "0", "", "0/1", "", ""]))
    first = found.tree.mirrors[0]
    others = tuple(replace(first, chain=(0, number), mirrors=()) for number in (1, 2))
    multiply_by_mirrors(points, replace(found.tree, mirrors=(replace(first, chain=(0,), mirrors=others),)))
    # Without an echo on its own face, a mirror is as likely as the one that shows it.
    assert_allclose(points.confidence, [0.9, 0.9, 0.81, 0.81, 0.9 * 0.81, 0.81])
    assert mirror_confidence(points, "0/2") == 0.9
