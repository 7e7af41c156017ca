"""What stands behind objects is multiple scattering, unless it outshines them."""

from __future__ import annotations

import numpy as np
import pytest
from seen_scenes import behind, line_errors, nearest, seen_by, tree_of, wall
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.common.geometry import segment_normal

MIRROR = wall((0.1, 1.2), 35.0, 0.9)
"""A mirror that all of the following is seen through."""


@pytest.fixture(scope="module")
def clutter_behind_an_object():
    """A mirror; in it an object at 1.8 m; behind that along the same rays clutter, and beside it a free point."""
    return [
        diffuse(*MIRROR, 3),
        (behind(1.8, 0.12), np.full(7, 5.0)),
        (behind(2.15, 0.08, number=4), np.full(4, 2.5)),
        (behind(2.2, 0.0, u=-0.15, number=1), np.array([3.0])),
    ]


def counts(tree, range_, u=0.02):
    """Number of object echoes seen through the only mirror near a range and direction."""
    (node,) = tree.mirrors
    sine = node.objects.position[:, 0] / node.objects.range  # the radar stands at the origin, its array along x
    near = (np.abs(node.objects.range - range_) < 0.04) & (np.abs(sine - u) < 0.08)
    return int(np.count_nonzero(near))


@pytest.mark.slow
def test_what_is_behind_an_object_is_multiple_scattering(clutter_behind_an_object):
    tree, *_ = tree_of(*clutter_behind_an_object)
    assert counts(tree, 1.8) > 10
    assert counts(tree, 2.15) == 0
    assert counts(tree, 2.2, u=-0.15) > 0


@pytest.mark.slow
def test_transparent_objects_hide_nothing(clutter_behind_an_object):
    opaque, *_ = tree_of(*clutter_behind_an_object)
    clear, *_ = tree_of(*clutter_behind_an_object, opaque=False)
    assert counts(clear, 1.8) == counts(opaque, 1.8)
    assert counts(clear, 2.15) > 4
    places = clear.mirrors[0].fold(clear.mirrors[0].objects.position)
    assert nearest(seen_by([MIRROR], behind(2.15, 0.08, number=4)), places).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("decibel", "kept"), [(14.0, False), (26.0, True)])
def test_what_is_much_stronger_than_all_before_it_is_an_object_all_the_same(decibel, kept):
    glint = behind(2.15, 0.0, number=1)
    tree, *_ = tree_of(
        diffuse(*MIRROR, 3), (behind(1.8, 0.12), np.full(7, 5.0)), (glint, np.array([5.0 * 10.0 ** (decibel / 20.0)]))
    )
    assert (counts(tree, 2.15) > 0) == kept


@pytest.mark.parametrize(("depth", "kept"), [(0.045, True), (0.15, False)])
def test_an_object_hides_what_is_more_than_its_own_depth_behind_it(depth, kept):
    """The object is 7.5 cm deep: 2.5 range cells."""
    tree, *_ = tree_of(
        diffuse(*MIRROR, 3), (behind(1.8, 0.12), np.full(7, 5.0)), (behind(1.8 + depth, 0.02, number=1), [5.0])
    )
    (node,) = tree.mirrors
    assert (node.objects.range.max() > 1.8 + 0.75 * depth) == kept


def test_objects_in_line_of_sight_hide_what_is_behind_them_too():
    parts = [(behind(1.0, 0.12), np.full(7, 5.0)), (behind(1.4, 0.08, number=4), np.full(4, 2.5))]
    opaque, *_ = tree_of(*parts)
    clear, *_ = tree_of(*parts, opaque=False)
    assert opaque.mirrors == clear.mirrors == ()
    assert opaque.objects.range.max() < 1.1
    assert clear.objects.range.max() > 1.35


@pytest.mark.slow
def test_a_row_of_clutter_behind_objects_is_no_mirror():
    screen = np.concatenate([behind(r, 0.2, u=u, number=5) for r, u in ((1.6, 0.01), (1.73, 0.02), (1.86, 0.03))])
    row = behind(2.3, 0.16, number=2)
    parts = [diffuse(*MIRROR, 3), (screen, np.full(15, 20.0)), diffuse(*row, 5)]
    opaque, *_ = tree_of(*parts)
    clear, *_ = tree_of(*parts, opaque=False)
    assert [node.chain for node in opaque.walk()] == [(), (0,)]
    assert [node.chain for node in clear.walk()] == [(), (0,), (0, 0)]
    image = clear.mirrors[0].mirrors[0].mirror
    assert line_errors(np.stack([image.start, image.end]), row)[1] < 1


def beyond(distance):
    """A point on the line of sight that meets MIRROR in its middle, that far square behind it."""
    middle = MIRROR.mean(axis=0)
    away = segment_normal(*MIRROR)
    cosine = float(middle @ away) / np.linalg.norm(middle)
    return (middle * (1.0 + distance / abs(cosine) / np.linalg.norm(middle)))[None]


@pytest.mark.parametrize(
    ("distance", "margin", "kept"), [(0.05, 0.04, False), (0.05, 0.0, True), (0.12, 0.04, True), (0.12, 0.15, False)]
)
def test_echoes_from_inside_a_wall_are_nothing(distance, margin, kept):
    """The margin begins where the wall's own resolution cell ends, 2.6 cm behind it."""
    tree, *_ = tree_of(diffuse(*MIRROR, 3), (beyond(distance), [6.0]), wall_margin=margin)
    assert len(tree.mirrors) == 1
    assert (tree.mirrors[0].objects.range.size > 0) == kept
    assert tree.objects.range.size == 0


@pytest.mark.slow
def test_the_folded_image_leaves_out_what_is_inside_a_wall():
    x, y = np.arange(-0.7, 0.8, 0.006), np.arange(0.5, 1.8, 0.006)
    image = radar_image(*together(diffuse(*MIRROR, 3), (beyond(0.05), [6.0])), x, y)
    place = seen_by([MIRROR], beyond(0.05))[0]
    thin, thick = (mf.fold(image, wall_margin=margin) for margin in (0.0, 0.1))
    for result, bright in ((thin, True), (thick, False)):
        assert (float(result["intensity"].interp(x=place[0], y=place[1])) > 4.0) == bright
