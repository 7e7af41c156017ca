"""What casts no shadow on a wall behind it hides nothing that outshines it."""

from __future__ import annotations

import numpy as np
import pytest
from seen_scenes import wall
from synthetic import build_tree, diffuse, echoes_at, radar_view, together

from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.tree.explaining.shadowless import cast_no_shadow

WALL = wall((0.1, 1.2), 35.0, 0.9)
"""A wall in line of sight, whose echoes have amplitudes of about 4."""

BEFORE = np.array([[0.05, 0.7]])
"""A place before its middle."""

SHOWN = np.array([[0.15, 2.1]])
"""Where the wall shows something in the same direction."""


def shadowed(start, end, half=0.08):
    """The wall without what stands behind the place before it."""
    places, amplitude = diffuse(start, end, 3)
    lit = np.abs(places[:, 0] / places[:, 1] - BEFORE[0, 0] / BEFORE[0, 1]) > half
    return places[lit], amplitude[lit]


def seen(behind, level, shown=8.0):
    """Echoes of a wall, of a place before it of that level, and of what it shows behind."""
    return radar_view(*together(behind, (BEFORE, [level]), (SHOWN, [shown])), noise=1e-3)


def told_of(objects, mirrors, view):
    crossing = np.array([mirror.crossing(view) for mirror in mirrors]).reshape(len(mirrors), len(view.sight))
    return cast_no_shadow(objects, mirrors, crossing, view)


@pytest.mark.parametrize(
    ("behind", "level", "told"),
    [
        pytest.param(diffuse(*WALL, 3), 1.5, True, id="the wall goes on"),
        pytest.param(diffuse(*WALL, 3), 40.0, False, id="brighter than the wall"),
        pytest.param(shadowed(*WALL), 1.5, False, id="the wall is dark there"),
    ],
)
def test_what_a_wall_is_seen_behind_is_not_opaque(behind, level, told):
    view = seen(behind, level)
    echoes = find_ridges(view)
    near = np.linalg.norm(echoes.position - BEFORE, axis=1) < view.cell_at(BEFORE[0])
    line = LineMirror(*WALL, strength=4.0)
    found = told_of(echoes.take(near), [line], view)
    assert near.any()
    assert (found == told).all()


def shows_what_is_behind(behind, level, shown):
    """Whether what the wall shows is an object seen through a mirror."""
    view = seen(behind, level, shown)
    tree, _ = build_tree(find_ridges(view), view)
    through = [node.objects.position for node in tree.walk() if node.chain]
    return any(np.linalg.norm(places - SHOWN, axis=1).min(initial=np.inf) < 0.03 for places in through)


@pytest.mark.parametrize(("decibel", "kept"), [(3.0, False), (9.0, True)])
def test_what_outshines_it_is_seen_behind_it(decibel, kept):
    level = 1.5
    assert shows_what_is_behind(diffuse(*WALL, 3), level, level * 10.0 ** (decibel / 20.0)) == kept


def test_what_casts_a_shadow_hides_more():
    assert not shows_what_is_behind(shadowed(*WALL), 1.5, 8.0)


def test_nothing_is_told_without_mirrors_and_behind_them():
    view = seen(diffuse(*WALL, 3), 1.5)
    echoes = find_ridges(view)
    assert not told_of(echoes, [], view).any()
    line = LineMirror(*WALL, strength=4.0)
    deep = echoes.take(np.linalg.norm(echoes.position - SHOWN, axis=1) < view.cell_at(SHOWN[0]))
    assert len(deep)
    assert not told_of(deep, [line], view).any()
    assert not len(told_of(echoes.take(np.zeros(0, dtype=np.intp)), [line], view))


def test_a_wall_that_is_hardly_seen_past_objects_tells_nothing():
    """As of a wall that is seen edge-on, behind which its own reflections stand."""
    view, line = radar_view(*diffuse(*WALL, 3), noise=1e-3), LineMirror(*WALL, strength=4.0)
    before = 0.6 * (line.start + np.linspace(0.1, 0.9, 30)[:, None] * (line.end - line.start))
    assert not told_of(echoes_at(view, before, 0.5), [line], view).any()
    assert told_of(echoes_at(view, before[:2], 0.5), [line], view).all()
