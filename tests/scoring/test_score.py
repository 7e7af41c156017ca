"""Scores of made-up reconstructions whose distances from the truth are known."""

from __future__ import annotations

from dataclasses import fields
from functools import partial

import floor_plans
import numpy as np
import pytest
import xarray as xr
from floor_plans import HIDDEN, MIRROR, SCREEN, segment
from numpy.testing import assert_allclose
from scans import panel, scene
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli.terminal import show_score
from mirrorfold.scoring import volumes
from mirrorfold.scoring.figures import CELL, Figures, thinned
from mirrorfold.scoring.floor_plans import truth as plan_truth

make_scene = partial(floor_plans.make_scene, band={"start": 290e9, "stop": 300e9, "points": 401})


def rebuilt(points, bounces=0, mirrors=()):
    """A Reconstruction of points and mirrors; each mirror is a pair of ends, or of ends and a generation."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    ends = np.array([m[:2] for m in mirrors], dtype=float).reshape(-1, 2, 2)
    columns = {
        f"{p}{a}{e}": ("mirror", ends[:, e, i]) for p in ("", "folded_") for i, a in enumerate("xy") for e in (0, 1)
    }
    columns["generation"] = ("mirror", np.array([m[2] if len(m) > 2 else 1 for m in mirrors], dtype=np.int32))
    objects = {
        "x": ("point", points[:, 0]),
        "y": ("point", points[:, 1]),
        "bounces": ("point", np.broadcast_to(np.int32(bounces), len(points))),
    }
    return xr.DataTree.from_dict(
        {"/": xr.Dataset(), "/objects": xr.Dataset(objects).set_coords(["x", "y"]), "/mirrors": xr.Dataset(columns)}
    )


WALL = segment((-0.3, 1.0), (0.3, 1.0))
ON_WALL = np.stack([np.arange(-0.295, 0.3, 0.01), np.full(60, 1.0)], axis=1)
"""In the middle of each cell of a centimetre, so that thinning leaves them alone."""


def test_points_on_the_truth_score_one_and_no_distance():
    result = mf.score(rebuilt(ON_WALL), make_scene(WALL))
    assert result["points"] == 60
    # The truth is known every 2 mm.
    assert result["accuracy_m"] < 0.001
    assert result["chamfer_m"] < 0.004
    for name in ("precision", "completeness", "f_score"):
        assert result[f"{name}_2cm"] == result[f"{name}_5cm"] == 1.0
    assert result["invented_fraction"] == 0.0
    assert result["reachable_m"] == pytest.approx(0.6)


@pytest.mark.parametrize("shift", [0.01, -0.01])
def test_points_a_centimetre_beside_the_truth_are_a_centimetre_off(shift):
    result = mf.score(rebuilt(ON_WALL + np.array([0.0, shift])), make_scene(WALL))
    assert result["accuracy_m"] == pytest.approx(0.01, rel=0.02)
    assert result["chamfer_m"] == pytest.approx(0.01, rel=0.08)
    assert result["precision_2cm"] == result["completeness_2cm"] == 1.0


@pytest.mark.parametrize(("shift", "two", "five", "invented"), [(0.03, 0, 1, 0), (0.07, 0, 0, 0), (0.12, 0, 0, 1)])
def test_good_fair_and_invented_points_differ_by_their_distance(shift, two, five, invented):
    result = mf.score(rebuilt(ON_WALL + np.array([0.0, shift])), make_scene(WALL))
    for name in ("precision", "completeness", "f_score"):
        assert result[f"{name}_2cm"] == two
        assert result[f"{name}_5cm"] == five
    assert result["invented_fraction"] == invented
    assert result["accuracy_m"] == pytest.approx(shift, rel=0.01)


def test_invented_points_cost_precision_and_missing_ones_completeness():
    invented = np.stack([np.arange(-0.295, -0.2, 0.01), np.full(10, 0.5)], axis=1)
    half = ON_WALL[:30]
    result = mf.score(rebuilt(np.concatenate([half, invented])), make_scene(WALL))
    assert result["points"] == 40
    assert result["precision_2cm"] == pytest.approx(0.75)
    assert result["invented_fraction"] == pytest.approx(0.25)
    # The last point reaches 2 cm further: 295 + 20 + 5 of 600 mm.
    assert result["completeness_2cm"] == pytest.approx(0.5 + 0.015 / 0.6, abs=0.005)
    precision, completeness = result["precision_2cm"], result["completeness_2cm"]
    assert result["f_score_2cm"] == pytest.approx(2 * precision * completeness / (precision + completeness))
    assert result["accuracy_m"] == pytest.approx(0.25 * 0.5, rel=0.01)


def test_a_dense_blob_counts_once():
    random = np.random.default_rng(0)
    blob = np.array([0.105, 0.505]) + 0.004 * random.uniform(-1, 1, (1000, 2))
    result = mf.score(rebuilt(np.concatenate([ON_WALL, blob])), make_scene(WALL))
    assert (result["points"], result["cells"]) == (1060, 61)
    assert result["invented_fraction"] == pytest.approx(1 / 61)


def test_thinning_leaves_one_mean_a_cell():
    points = np.array([[0.001, 0.001], [0.003, 0.009], [0.0101, 0.001], [-0.001, 0.001]])
    means, counts = thinned(points)
    order = np.argsort(means[:, 0])
    assert_allclose(means[order], [[-0.001, 0.001], [0.002, 0.005], [0.0101, 0.001]])
    assert counts[order].tolist() == [1, 2, 1]
    assert thinned(np.empty((0, 2)))[0].shape == (0, 2)


def test_thinning_means_the_same_in_space():
    """On a plane z = 0 cells are those of the floor plan; off the plane there are others."""
    points = np.random.default_rng(2).uniform(-0.05, 0.05, (500, 2))
    flat = np.column_stack([points, np.full(500, 0.004)])
    plan, space = thinned(points)[0], thinned(flat)[0]
    assert_allclose(space, np.column_stack([plan, np.full(len(plan), 0.004)]))
    assert len(thinned(np.concatenate([flat, flat + np.array([0.0, 0.0, CELL])]))[0]) == 2 * len(plan)


PANEL = panel("wall", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 0.3, 0.3)


def rebuilt_in_space(points, bounces=0):
    """A reconstruction of points in three dimensions, without mirrors."""
    objects = {axis: ("point", points[:, i]) for i, axis in enumerate("xyz")}
    objects |= {"bounces": ("point", np.full(len(points), bounces)), "amplitude": ("point", np.ones(len(points)))}
    return xr.DataTree.from_dict({"/": xr.Dataset(), "/objects": xr.Dataset(objects), "/mirrors": xr.Dataset({
        "generation": ("mirror", np.empty(0, dtype=int))})})  # fmt: skip


@pytest.mark.parametrize("shift", [0.0, 0.01, 0.028, 0.12, 0.2])
def test_the_figures_of_space_are_those_of_the_plan(shift):
    """The same points before a wall, in line in the plan and as a square in space, each twice in its cell."""
    line = np.arange(-0.145, 0.15, 0.01)
    flat = np.stack([line, np.full(line.size, 2.0005 - shift)], axis=1)
    square = np.stack(np.meshgrid(line, [2.0005 - shift], line, indexing="ij"), axis=-1).reshape(-1, 3)
    plan = mf.score(rebuilt(np.tile(flat, (2, 1))), make_scene(segment((-0.15, 2.0), (0.15, 2.0))))
    space = mf.score(rebuilt_in_space(np.tile(square, (2, 1))), scene(PANEL, half=8.0))
    assert (plan.cells, space.cells) == (30, 900)
    assert plan.reachable_m**2 == pytest.approx(space.reachable_m2, rel=0.01)
    names = [item.name for item in fields(Figures) if item.name not in ("points", "cells", "chamfer_m")]
    assert {name: plan[name] for name in names} == pytest.approx({name: space[name] for name in names}, abs=1e-9)
    assert plan.chamfer_m == pytest.approx(space.chamfer_m, abs=0.002)
    assert (plan.invented_fraction, plan.false_fraction) == (float(shift > 0.1), float(shift > 0.15))
    assert plan.completeness_3cm == float(shift < 0.03)


def test_between_samples_a_surface_is_flat_and_at_its_end_it_ends():
    points = np.array([[0.0007, 1.002], [0.2991, 1.0], [0.31, 1.0], [0.3, 1.004]])
    judged = plan_truth(make_scene(WALL))
    assert_allclose(judged.distances(points)[0], [0.002, 0.0, 0.01, 0.004], atol=1e-9)
    assert judged.distances(np.empty((0, 2)))[0].shape == (0,)


def test_thinning_again_changes_little_and_never_adds_points():
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (3000, 2))
    once, _ = thinned(points)
    assert len(once) == len(np.unique(np.floor(points / CELL), axis=0))
    assert_allclose(thinned(once)[0], once)


def test_without_points_what_is_undefined_is_none_and_nothing_is_complete():
    result = mf.score(rebuilt([]), make_scene(WALL))
    for part in (result, result["hidden"]):
        assert part["points"] == 0
        assert part["accuracy_m"] is part["chamfer_m"] is part["precision_2cm"] is part["precision_5cm"] is None
        assert part["invented_fraction"] == 0.0
    assert result["completeness_2cm"] == result["f_score_2cm"] == result["f_score_5cm"] == 0.0
    # Nothing is hidden in this scene.
    assert result["hidden"]["completeness_2cm"] is result["hidden"]["f_score_2cm"] is None
    assert result["mirrors"] == []


def test_in_an_empty_scene_every_point_is_invented():
    nothing = mf.score(rebuilt([]), make_scene())
    assert nothing["invented_fraction"] == nothing["reachable_m"] == 0.0
    assert nothing["completeness_2cm"] is None
    result = mf.score(rebuilt(ON_WALL, mirrors=[((0, 1), (1, 1))]), make_scene())
    assert result["invented_fraction"] == 1.0
    assert result["precision_2cm"] == 0.0
    assert result["accuracy_m"] is None
    assert result["mirrors"][0]["surface"] is None


def test_a_mirror_that_is_none_of_the_walls_is_a_dash_in_the_table(capsys):
    show_score(mf.score(rebuilt(ON_WALL, mirrors=[((0, 1), (1, 1))]), make_scene()))
    assert "None" not in capsys.readouterr().out


def test_the_scene_may_be_a_file(scene_file, reconstruction):
    by_path = mf.score(reconstruction, scene_file)
    assert by_path == mf.score(reconstruction, str(scene_file)) == mf.score(reconstruction, mf.load_scene(scene_file))
    assert by_path["points"] == 5


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (xr.Dataset(), "got a Dataset, expected a reconstruction"),
        (xr.DataTree(), "no group 'objects'"),
        (xr.DataTree(children={"objects": rebuilt([])["objects"]}), "no group 'mirrors'"),
        (rebuilt([(0.0, np.nan)]), "holds a point that is not finite"),
        (rebuilt([(1e20, 0.0)]), "holds a point that is farther away than"),
    ],
)
def test_what_is_no_reconstruction_is_refused(what, words):
    with pytest.raises(mf.InputError, match=words):
        mf.score(what, make_scene(WALL))


def test_points_without_confidence_cannot_be_chosen_by_it():
    with pytest.raises(mf.InputError, match="have no confidence"):
        mf.score(rebuilt(ON_WALL), make_scene(WALL), min_confidence=0.5)


def test_hidden_figures_are_of_hidden_surfaces_and_of_all_points_away_from_what_is_in_sight():
    scene = make_scene(SCREEN, MIRROR, HIDDEN)
    on_screen = np.stack([np.arange(-0.495, 0.1, 0.01), np.full(60, 1.0)], axis=1)
    on_hidden = np.stack([np.full(20, -0.205), np.arange(1.605, 1.8, 0.01)], axis=1)
    points = np.concatenate([on_screen, on_hidden + np.array([0.01, 0.0])])
    result = mf.score(rebuilt(points, np.repeat([0, 1], [60, 20])), scene)
    hidden = result["hidden"]
    assert hidden["surfaces"] == ["surface 2"]
    assert hidden["points"] == 20
    assert hidden["accuracy_m"] == pytest.approx(0.005, rel=0.05)
    assert hidden["precision_2cm"] == hidden["completeness_2cm"] == hidden["f_score_2cm"] == 1.0
    assert hidden["reachable_m"] == pytest.approx(0.2, abs=0.01)
    assert result["points"] == 80
    assert result["precision_2cm"] == 1.0
    # Whichever way a point is said to be seen: what counts is where it claims that something stands.
    assert mf.score(rebuilt(points, 0), scene)["hidden"] == hidden
    # Ten points in mid-air are invented, in line of sight as elsewhere; near the screen they are but inaccurate.
    in_air, near_screen = (np.stack([np.arange(-0.495, -0.4, 0.01), np.full(10, y)], axis=1) for y in (0.7, 0.96))
    for more, claims in ((in_air, 30), (near_screen, 20)):
        worse = mf.score(rebuilt(np.concatenate([points, more]), 0), scene)["hidden"]
        assert worse["points"] == claims
        assert worse["precision_2cm"] == pytest.approx(20 / claims)
        assert worse["completeness_2cm"] == 1.0


def test_each_hidden_surface_is_judged_by_the_points_nearest_to_it():
    other = segment((-0.4, 1.6), (-0.4, 1.8))
    truth = make_scene(SCREEN, MIRROR, HIDDEN, other)
    on_hidden = np.stack([np.full(20, -0.19), np.arange(1.605, 1.8, 0.01)], axis=1)
    result = mf.score(rebuilt(np.concatenate([on_hidden, [[-0.405, 1.705]]]), 1), truth)
    assert result.hidden.surfaces == list(result.surfaces) == ["surface 2", "surface 3"]
    assert [result.surfaces[name].points for name in result.hidden.surfaces] == [20, 1]
    assert result.surfaces["surface 2"].accuracy_m == pytest.approx(0.01)
    assert result.surfaces["surface 3"].accuracy_m == pytest.approx(0.005)
    assert result.surfaces["surface 2"].completeness_2cm == 1.0
    assert sum(part.reachable_m for part in result.surfaces.values()) == pytest.approx(result.hidden.reachable_m)


def turned(segment_ends, degrees, shift):
    """A wall turned about its middle and moved along its normal."""
    start, end = np.array(segment_ends, dtype=float)
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    half_turned = np.array([[c, -s], [s, c]]) @ half
    normal = np.array([-half[1], half[0]]) / np.linalg.norm(half)
    return middle - half_turned + shift * normal, middle + half_turned + shift * normal


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(("degrees", "shift"), [(0.0, 0.0), (0.5, 0.002), (-3.0, -0.01)])
def test_errors_of_a_mirror_are_its_turn_and_its_shift(degrees, shift, swap):
    ends = turned(((-0.5, 1.0), (0.1, 1.2)), degrees, shift)
    found = rebuilt(ON_WALL, mirrors=[ends[::-1] if swap else ends])
    (mirror,) = mf.score(found, make_scene(MIRROR, segment((-0.5, 1.0), (0.1, 1.2))))["mirrors"]
    assert mirror["surface"] == "surface 1"
    assert mirror["angle_error_deg"] == pytest.approx(abs(degrees), abs=1e-6)
    assert mirror["offset_error_mm"] == pytest.approx(1e3 * abs(shift), abs=1e-6)
    assert mirror["generation"] == 1
    assert mirror["length_m"] == pytest.approx(np.hypot(0.6, 0.2))


@pytest.mark.parametrize(
    "ends",
    [
        turned(((-0.5, 1.0), (0.1, 1.0)), 12.0, 0.0),  # too far turned
        turned(((-0.5, 1.0), (0.1, 1.0)), 0.0, 0.12),  # too far beside
        ((0.45, 1.0), (0.75, 1.0)),  # in line with the wall, but too far beyond its end
    ],
)
def test_a_mirror_far_from_all_walls_is_none_of_them(ends):
    (mirror,) = mf.score(rebuilt(ON_WALL, mirrors=[ends]), make_scene(SCREEN))["mirrors"]
    assert mirror["surface"] is mirror["angle_error_deg"] is mirror["offset_error_mm"] is None


def test_each_leg_of_a_polyline_can_be_a_mirror_and_an_arc_cannot():
    corner = {"kind": "polyline", "points": [[-0.5, 1.5], [0.5, 1.5], [0.5, 0.8]]}
    arc = {"kind": "arc", "center": [0.0, 3.0], "radius": 1.0, "start_angle": 225.0, "stop_angle": 315.0}
    legs = [((-0.4, 1.501), (0.4, 1.501)), ((0.502, 0.9), (0.502, 1.4)), ((-0.3, 2.0), (0.3, 2.0), 2)]
    result = mf.score(rebuilt(ON_WALL, mirrors=legs), make_scene(corner, arc))
    assert [m["surface"] for m in result["mirrors"]] == ["surface 0", "surface 0", None]
    assert_allclose([m["offset_error_mm"] for m in result["mirrors"][:2]], [1.0, 2.0])
    assert [m["generation"] for m in result["hidden"]["mirrors"]] == [2]


MEASURED = {
    "image_range_resolution": 0.015,
    "image_frequency_start": 290e9,
    "image_frequency_stop": 300e9,
    "image_tx_aperture": 0.08,
    "image_rx_aperture": 0.08,
}
CELL_AT_3_M = np.hypot(0.015, 3.0 * speed_of_light / 295e9 / 0.08)
"""Range resolution and wavelength over aperture, 3 m along the way."""


def measured(points, initial, **attrs):
    """A Reconstruction that says how it was measured, and where its points stood in the image."""
    tree = rebuilt(points)
    held = tree["objects"].to_dataset(inherit=False)
    tree["objects"] = xr.DataTree(
        held.assign({f"{a}_initial": ("point", np.asarray(initial, dtype=float)[:, i]) for i, a in enumerate("xy")})
    )
    tree.attrs.update(attrs)
    return tree


@pytest.mark.parametrize(("aside", "precision"), [(1.45, 1.0), (1.55, 0.0)])
def test_a_point_is_good_within_one_and_a_half_cells_of_its_own_way(aside, precision):
    """Its place is a metre away, but it was seen by way of mirrors 3 m long."""
    points = ON_WALL + np.array([0.0, aside * CELL_AT_3_M])
    found = mf.score(measured(points, np.full_like(points, 3.0) * [0.0, 1.0], **MEASURED), make_scene(WALL))
    assert found.cell_m == pytest.approx(CELL_AT_3_M, rel=1e-6)
    assert found.precision_cells == precision
    assert found.completeness_cells == precision
    assert found.f_score_cells == precision


def test_cells_are_unknown_where_nothing_tells_them():
    without = {name: value for name, value in MEASURED.items() if "aperture" not in name}
    for attrs in ({}, without):
        found = mf.score(measured(ON_WALL, ON_WALL, **attrs), make_scene(WALL))
        assert (found.precision_cells, found.f_score_cells, found.cell_m) == (None, None, None)


def test_no_points_score_nothing_in_cells_either():
    found = mf.score(measured(np.empty((0, 2)), np.empty((0, 2)), **MEASURED), make_scene(WALL))
    assert (found.precision_cells, found.completeness_cells, found.f_score_cells, found.cell_m) == (
        None,
        0.0,
        0.0,
        None,
    )


FOIL = {
    "name": "foil", "kind": "patch", "on": "board", "material": "pec",
    "outline": [[-0.15, -0.15], [0.15, -0.15], [0.15, 0.15], [-0.15, 0.15]],
}  # fmt: skip


@pytest.mark.slow
def test_the_contrast_of_a_patch_is_the_power_on_it_over_that_around_it():
    """Amplitudes twice as large on the patch: 6 dB. Points before the board, and far aside, do not count."""
    board = {"name": "board", "kind": "box", "center": [0.0, 2.5, 0.0], "size": [1.0, 1.0, 1.0], "material": "pec"}
    truth = scene(board, FOIL | {"direction": [0, -1, 0], "center": [0, -0.5, 0]})
    x, z = np.meshgrid(np.arange(-0.4, 0.4, 0.01), np.arange(-0.4, 0.4, 0.01))
    points = np.stack([x.ravel(), np.full(x.size, 2.0), z.ravel()], axis=-1)
    on_it = (np.abs(points[:, 0]) < 0.15) & (np.abs(points[:, 2]) < 0.15)
    amplitude = np.where(on_it, 2.0, 1.0)
    amplitude[np.abs(points[:, 0]) > 0.3] = 100.0  # farther aside than what surrounds the patch
    stray, bright = np.column_stack([points[:, 0], points[:, 1] - 0.4, points[:, 2]]), np.full(len(points), 100.0)
    points, amplitude = np.concatenate([points, stray]), np.concatenate([amplitude, bright])
    assert volumes.patch_contrasts(truth, points, amplitude) == {"foil": pytest.approx(20 * np.log10(2.0), abs=1e-6)}
    patch = truth.surface[1]
    assert volumes.patch_contrast(truth, patch, np.empty((0, 3)), np.empty(0)) is None
    assert volumes.patch_contrast(truth, patch, stray, bright) is None
