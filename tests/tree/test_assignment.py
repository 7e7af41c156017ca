"""Every echo belongs to the mirror through which it is seen: a few echoes, mirrors drawn by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import echoes_at, empty_view

from mirrorfold.common.types import UNSEEN
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.assignment import assign_echoes, radar_itself
from mirrorfold.tree.ordering import order_mirrors

NEAR = LineMirror(np.array([-0.3, 1.0]), np.array([0.3, 1.0]))
FAR = LineMirror(np.array([-0.5, 2.0]), np.array([0.5, 2.0]))
SIDE = LineMirror(np.array([0.7, 0.7]), np.array([1.1, 1.3]))

PLACES = {
    "direct": [-0.9, 0.9],
    "on the near one": [0.1, 1.01],
    "behind it": [0.1, 1.5],
    "on the far one": [0.05, 2.0],
    "behind both": [0.05, 2.6],
    "behind the one aside": [1.2, 1.3],
}


@pytest.fixture(scope="module")
def view():
    return replace(empty_view(), wavelength=1e-3)


def assigned(view, places, amplitude=1.0, marks=None, **given):
    echoes = replace(echoes_at(view, places, amplitude), **(marks or {}))
    settings = FoldSettings(minimum_length=0.1, wall_margin=0.0, opaque=False)
    order = order_mirrors([SIDE, FAR, NEAR], view, echoes, settings)
    return *assign_echoes(order, echoes, **given), echoes


def held(tree):
    """Where the objects of every node stand."""
    return {node.chain: node.objects.position.round(6).tolist() for node in tree.walk()}


def test_every_echo_is_held_by_the_node_that_it_is_seen_by(view):
    tree, sight, _ = assigned(view, list(PLACES.values()), opaque=False)
    assert [child.mirror for child in tree.mirrors] == [SIDE, NEAR]
    assert sight.chain == ((0,), (1, 0), (1,))
    assert held(tree) == {
        (): [PLACES["direct"]], (0,): [PLACES["behind the one aside"]], (1,): [PLACES["behind it"]],
        (1, 0): [PLACES["behind both"]],
    }  # fmt: skip
    near = tree.mirrors[1]
    # Faces are moved onto their lines; the radar itself has none.
    assert_allclose(near.face.position, [[0.1, 1.0]])
    assert_allclose(near.mirrors[0].face.position, [[0.05, 2.0]])
    assert len(tree.face) == len(tree.mirrors[0].face) == 0


@pytest.mark.parametrize("mark", ["visible", "strong"])
def test_what_is_hidden_or_faint_is_no_object(view, mark):
    marks = {mark: np.arange(len(PLACES)) < 3}
    tree, *_ = assigned(view, list(PLACES.values()), opaque=False, marks=marks)
    assert held(tree) == {(): [PLACES["direct"]], (0,): [], (1,): [PLACES["behind it"]], (1, 0): []}
    # A faint echo may be a part of a wall, a hidden one not.
    assert len(tree.mirrors[1].mirrors[0].face) == (mark == "strong")


def test_what_the_radars_own_view_contradicts_is_left_out_where_objects_are_opaque(view):
    """It would stand half a metre before the radar, which sees nothing there; at the edge a beam shows both."""
    edge, aside = [0.3 * 1.5 - 0.005, 1.5], [-0.9, 0.9]
    for given, kept in (({}, []), ({"opaque": False}, [edge])):
        tree, sight, _ = assigned(view, [edge, aside], **given)
        assert held(tree)[(1,)] == np.round(kept, 6).tolist()
        assert bool(sight.empty_up_to.size) == (not given)


def test_echoes_that_objects_hide_do_not_close_the_radars_view(view):
    """A hidden echo at the place that the other would fold to proves nothing."""
    edge, there, aside = [0.3 * 1.5 - 0.005, 1.5], [0.445, 0.5], [-0.9, 0.9]
    for visible, kept in ((True, [edge]), (False, [])):
        marks = {"visible": np.array([True, visible, True])}
        tree, *_ = assigned(view, [edge, there, aside], marks=marks)
        assert held(tree)[(1,)] == np.round(kept, 6).tolist()


def test_the_radars_own_antennas_are_no_object(view):
    own, beside = [0.0, 1.98], [0.2, 1.8]
    for opaque, kept in ((True, [beside]), (False, [own, beside])):
        order = [SIDE, NEAR]
        echoes = echoes_at(view, [own, beside])
        settings = FoldSettings(minimum_length=0.1, wall_margin=0.0, opaque=False)
        tree, sight = assign_echoes(order_mirrors(order, view, echoes, settings), echoes, opaque=opaque)
        assert held(tree)[(1,)] == kept
    assert_array_equal(radar_itself(sight, echoes), [True, False])
    for mark in ("visible", "strong"):
        none = replace(echoes, **{mark: np.zeros(2, dtype=bool)})
        assert_array_equal(radar_itself(sight, none), [False, False])


def test_what_the_radar_sees_directly_is_not_itself(view):
    """Nor what a mirror without a node in the tree shows."""
    _, sight, echoes = assigned(view, [[0.0, 1.98], [0.0, 0.4]], opaque=False)
    assert_array_equal(radar_itself(sight, echoes), [True, False])
    nowhere, behind_two = replace(sight, parent=np.full(3, UNSEEN)), echoes_at(view, [0.0, 3.98])
    assert not radar_itself(nowhere, echoes).any()
    assert not radar_itself(nowhere, behind_two).any()
