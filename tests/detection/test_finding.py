"""What remembers the mirrors of a view gives those that a new search would find, and searches for nothing twice."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from synthetic import diffuse, radar_view, together

from mirrorfold.detection import ArcMirror, LineMirror, find_echoes, find_mirrors, finding


def lines(mirrors):
    return [mirror.ends.tolist() for mirror in mirrors]


@pytest.fixture(scope="module")
def seen():
    view = radar_view(*together(diffuse((-0.5, 1.2), (0.5, 1.3), 0), diffuse((0.9, 0.9), (0.7, 1.9), 1)))
    return view, find_echoes(view)


@pytest.mark.slow
def test_the_same_question_is_answered_once_and_any_other_anew(seen, monkeypatch):
    view, asked, search = replace(seen[0]), [], finding.lines.find_lines
    echoes = seen[1]

    def counted(echoes, view, **options):
        asked.append(options)
        return search(echoes, view, **options)

    hidden = replace(echoes, visible=echoes.position[:, 0] < 0.6)
    questions = [
        (echoes, {}), (echoes, {"minimum_length": 0.3}), (hidden, {"minimum_length": 0.3}),
        (echoes, {"minimum_length": 0.3, "tested": False}),
    ]  # fmt: skip
    anew = [lines(find_mirrors(replace(view), which, **options)) for which, options in questions]
    monkeypatch.setattr(finding.lines, "find_lines", counted)
    for again in range(2):
        assert [lines(find_mirrors(view, which, **options)) for which, options in questions] == anew
        assert len(asked) == len(questions), again
    # Equal echoes are the same question, whichever object holds them.
    find_mirrors(view, replace(echoes, position=echoes.position.copy())).clear()
    assert len(find_mirrors(view, echoes)) == 2
    assert len(asked) == len(questions)
    assert len(find_mirrors(view, hidden, minimum_length=0.3)) == 1


def test_given_mirrors_are_never_remembered(seen):
    view, echoes = seen
    for start in (-0.5, -0.4):
        given = np.array([[[start, 1.2], [0.5, 1.3]]])
        assert find_mirrors(view, echoes, known=given)[0].ends[0, 0] == pytest.approx(start, abs=0.02)


def test_flat_mirrors_dim_no_echoes_and_curved_ones_do(seen):
    view, echoes = seen
    flat = LineMirror(np.array([-0.5, 1.2]), np.array([0.5, 1.3]))
    for field in fields(echoes):
        found = getattr(find_echoes(view, through=[flat]), field.name)
        np.testing.assert_array_equal(found, getattr(echoes, field.name))
    pillar = ArcMirror(np.array([0.8, 1.0]), 0.2, np.pi, np.pi, view.radar)
    assert find_echoes(view, through=[flat, pillar]).limit.min() < echoes.limit.min()
