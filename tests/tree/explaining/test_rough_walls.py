"""What a rough wall scatters towards another wall and back is no object that stands between them."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import RANGE_CELL, U_CELL, build_tree, diffuse, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal, signed_distance
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.tree.measured import Measured

ROUGH = np.array([0.2, 1.0]), np.array([1.0, 1.1])
"""The wall that the radar looks at askew."""

OTHER = np.array([0.6, 0.39]), np.array([1.5, 0.45])
"""The wall before it, of which the radar sees the image only."""

WEAKER = 0.3
"""What is scattered twice, of what is scattered once."""

REACH = 0.5 * RANGE_CELL


def seen_in(wall, points):
    return reflect(points, wall[0], segment_normal(*wall))


def scattered(places):
    """Where the image shows places of the rough wall once more, when the other wall has sent their waves back."""
    distance = np.abs(signed_distance(places, OTHER[0], segment_normal(*OTHER)))
    return places * (1.0 + distance / np.linalg.norm(places, axis=1))[:, None]


def found(*parts, **settings):
    """Nodes of the tree of a scene of both walls and more: the view, the rough wall, the other one in it."""
    face, image = diffuse(*ROUGH, 0), diffuse(*(seen_in(ROUGH, end) for end in OTHER), 1)
    view = radar_view(*together(face, image, *parts), noise=1e-3)
    tree, _ = build_tree(find_ridges(view), view, opaque=False, **settings)
    return list(tree.walk())


def shown(nodes):
    """Where the image shows all that is found, but the rough wall and the other one in it."""
    assert [node.chain for node in nodes[:3]] == [(), (0,), (0, 0)]
    points = [node.objects.position for node in nodes] + [node.face.position for node in nodes[3:]]
    return np.concatenate(points)


def near(points, places, reach=REACH):
    """Which of the places have a point near them."""
    return np.linalg.norm(points[:, None] - places, axis=-1).min(axis=0, initial=np.inf) < reach


@pytest.fixture(scope="module")
def twice():
    """Places of the rough wall, whose waves the other wall sends back."""
    places, amplitude = diffuse([0.6, 1.05], ROUGH[1], 0)
    return scattered(places), WEAKER * np.abs(amplitude) * amplitude / np.sqrt(2.0)


def test_it_is_seen_where_nothing_stands(twice):
    assert near(shown(found(twice, rough_walls=False)), twice[0]).mean() > 0.5
    assert near(shown(found(twice)), twice[0]).mean() < 0.05


def test_what_stands_between_the_walls_stays(twice):
    post = seen_in(ROUGH, np.array([[0.8, 0.8], [1.0, 0.7]]))
    assert near(shown(found(twice, (post, np.full(2, 40.0 + 0j)))), post).all()


@pytest.mark.slow
def test_it_is_no_wall_either(twice):
    """As it lies in a row, it would pass for one."""
    assert len(found(twice, rough_walls=False)) > len(found(twice)) == len(found()) == 3


@pytest.mark.slow
@pytest.mark.parametrize("farther", [True, False], ids=["farther", "beside"])
def test_a_bright_object_is_not_seen_again_all_along_the_wall(farther):
    """Where the wall reflects it, it stays: up to some cells farther and to either side."""
    corner = np.array([[0.95, 0.75]])
    image, (rough, speckle) = seen_in(ROUGH, corner), diffuse(*ROUGH, 0)
    away = np.linalg.norm(rough - corner, axis=1) / np.linalg.norm(rough, axis=1)
    again = rough * (1.0 + away)[:, None], 0.3 * np.abs(speckle) * speckle
    (range_, *_), sine = np.linalg.norm(image, axis=1), again[0][:, 0] / np.linalg.norm(again[0], axis=1)
    far = np.linalg.norm(again[0], axis=1) > range_ + 3.0 * RANGE_CELL
    if not farther:
        far = ~far & (np.abs(sine - image[0, 0] / range_) > 3.0 * U_CELL)
    bright = image, np.array([150.0 + 0j])
    far &= rough[:, 0] < 0.9  # not at the end of the wall, where a half of each beam passes it by
    assert far.sum() > (30 if farther else 5)
    assert near(shown(found(bright, again, rough_walls=False)), again[0][far]).mean() > 0.3
    points = shown(found(bright, again))
    assert near(points, again[0][far]).mean() < 0.05
    assert near(points, image).all()


@pytest.mark.parametrize("farther", [True, False], ids=["farther", "beside"])
def test_what_stands_alone_where_a_wall_might_show_a_bright_object_once_more_is_an_object(farther):
    """All along the wall else the image is empty there."""
    corner = np.array([[0.95, 0.75]])
    image = seen_in(ROUGH, corner)
    along = ROUGH[0] + np.linspace(0.0, 1.0, 201)[:, None] * (ROUGH[1] - ROUGH[0])
    again = along * (1.0 + np.linalg.norm(along - corner, axis=1) / np.linalg.norm(along, axis=1))[:, None]
    later = np.linalg.norm(again, axis=1) - np.linalg.norm(image)
    beside = np.abs(again[:, 0] / np.linalg.norm(again, axis=1) - image[0, 0] / np.linalg.norm(image))
    fits = later > 2.5 * RANGE_CELL if farther else (later > 0.5 * RANGE_CELL) & (later < RANGE_CELL)
    fits &= (beside > 3.0 * U_CELL) & (along[:, 0] > 0.5)  # not at the end of the wall
    post = again[fits][:1]
    amplitude = 3.0 if farther else 0.72  # 30 dB above the noise would be more
    parts = (image, np.array([150.0 + 0j])), (post, np.array([amplitude + 0j]))
    assert near(shown(found(*parts)), post).all()
    # Each leg of a right-angled corner is a mirror for some place of the wall.
    corners = Measured(corners=lambda places: near(image, places, 2.0 * RANGE_CELL))
    assert not near(shown(found(*parts, measured=corners)), post).any()
    nothing = Measured(corners=lambda places: np.zeros(len(places), dtype=bool))
    assert near(shown(found(*parts, measured=nothing)), post).all()
