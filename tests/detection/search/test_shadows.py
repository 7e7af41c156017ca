"""A wall behind an object goes on where the object's shadow ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import diffuse, radar_image, radar_view, together

from mirrorfold.detection.finding import find_echoes, see
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search import shadows
from mirrorfold.detection.search.shadows import beyond_shadows, goes_on, joined

START, END = np.array([-0.5, 1.4]), np.array([0.5, 1.3])
GAP = 0.42, 0.62
"""The wall, and from which share of its length to which it is hidden."""

OBLIQUE, FAINT = np.array([[-0.6, 1.0], [0.1, 1.7]]), (0.3, 0.75)
"""Another wall, and from which share of its length to which it is faint."""


def at(share):
    return START + share * (END - START)


def seen(end=1.0):
    """The view and the echoes of the wall, without what is hidden."""
    parts = diffuse(START, at(GAP[0]), seed=1), diffuse(at(GAP[1]), at(end), seed=2)
    view = see(radar_image(*together(*parts), np.linspace(-0.9, 0.9, 181), np.linspace(0.8, 1.8, 101)))
    return view, find_echoes(view)


def hidden(view, first=GAP[0], last=GAP[1]):
    """What tells which echoes are clear: all but those in the directions between two places of the wall."""
    left, right = (view.column(view.to_polar(at(share)[None])[1])[0] for share in (first, last))
    return lambda range_, direction, amplitude: (direction < left) | (direction > right)


def all_clear(range_, direction, amplitude):
    return np.ones(np.shape(range_), dtype=bool)


@pytest.mark.parametrize("swap", [False, True])
def test_a_wall_goes_on_behind_an_object(swap):
    view, echoes = seen()
    part = LineMirror(at(GAP[0]), START) if swap else LineMirror(START, at(GAP[0]))
    longer = beyond_shadows(part, view, echoes, hidden(view))
    assert np.linalg.norm((longer.start if swap else longer.end) - END) < 0.05
    assert np.abs(longer.beside(part.ends)).max() < 1e-12  # its line stays


def test_a_gap_that_nothing_hides_is_the_end_of_a_wall():
    view, echoes = seen()
    part = LineMirror(START, at(GAP[0]))
    longer = beyond_shadows(part, view, echoes, all_clear)
    assert longer.length == pytest.approx(part.length, abs=0.05)


def test_a_wall_goes_on_where_echoes_from_elsewhere_blur_it():
    view, echoes = seen()
    part = LineMirror(START, at(GAP[0]))
    over = at(np.linspace(*GAP, 21)[:, None])
    longer = beyond_shadows(part, view.knowing(misplaced=over), echoes, all_clear)
    assert np.linalg.norm(longer.end - END) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("cells", [3.6, 4.5])
def test_nor_is_a_narrow_gap_bridged_that_nothing_hides(cells):
    """Half hidden are cells beside a shadow, of which there is none."""
    view, _ = seen()
    along = END - START
    length = np.linalg.norm(along)
    gap = cells * view.extent(np.stack([START, at(GAP[0])]), along / length).max() / length
    parts = diffuse(START, at(GAP[0]), seed=1), diffuse(at(GAP[0] + gap), END, seed=2)
    view = see(radar_image(*together(*parts), np.linspace(-0.9, 0.9, 181), np.linspace(0.8, 1.8, 101)))
    part = LineMirror(START, at(GAP[0]))
    assert beyond_shadows(part, view, find_echoes(view), all_clear).length == pytest.approx(part.length, abs=0.05)


def test_a_lone_echo_beyond_the_shadow_is_no_wall():
    view, echoes = seen(end=GAP[1] + 0.005)
    part = LineMirror(START, at(GAP[0]))
    longer = beyond_shadows(part, view, echoes, hidden(view))
    assert longer.length == pytest.approx(part.length, abs=0.05)


def test_two_rows_too_short_alone_are_one_wall():
    view, echoes = seen()
    rows = [LineMirror(START, at(GAP[0])), LineMirror(at(GAP[1]), END)]
    together = sum(row.length for row in rows)
    (wall,) = joined(rows, view, echoes, hidden(view), 0.9 * together)  # once, whichever row one begins with
    assert max(np.abs(wall.beside(np.stack([START, END])))) < 5e-3
    assert wall.length == pytest.approx(np.linalg.norm(END - START), abs=0.1)
    true = np.degrees(np.arccos(min(1.0, abs(wall.direction @ (END - START)) / np.linalg.norm(END - START))))
    assert true < 0.3
    assert true < 3.0 * wall.angle_error
    assert joined(rows, view, echoes, hidden(view), 1.2 * together) == []
    assert joined(rows, view, echoes, all_clear, 0.9 * together) == []


def faint(strength):
    """The view and the echoes of an oblique wall whose middle is fainter by a factor, and the parts before and behind.

    Noise is 30 dB below the wall.
    """
    first, last = (OBLIQUE[0] + share * (OBLIQUE[1] - OBLIQUE[0]) for share in FAINT)
    parts = (
        diffuse(OBLIQUE[0], first, seed=1),
        diffuse(first, last, seed=2, strength=strength),
        diffuse(last, OBLIQUE[1], seed=3),
    )
    view = radar_view(*together(*parts), noise=0.02)
    rows = [replace(LineMirror(*ends), strength=1.0) for ends in ((OBLIQUE[0], first), (last, OBLIQUE[1]))]
    return view, find_ridges(view), rows


@pytest.mark.parametrize(("strength", "goes_on"), [(0.03, True), (0.0, False)])
def test_a_wall_goes_on_where_it_is_faint_but_brighter_than_what_is_beside_it(strength, goes_on, monkeypatch):
    view, echoes, (part, _) = faint(strength)
    longer = beyond_shadows(part, view, echoes, all_clear, [part])
    assert np.linalg.norm(longer.end - (OBLIQUE[1] if goes_on else part.end)) < 0.05
    with monkeypatch.context() as context:  # it is not the few echoes between that continue it
        context.setattr(shadows, "goes_on", lambda gap, view: False)
        assert beyond_shadows(part, view, echoes, all_clear, [part]).length < part.length + 0.05
    # Only mirrors are continued so, not rows that are too short for mirrors.
    assert beyond_shadows(part, view, echoes, all_clear).length < part.length + 0.05


def test_two_mirrors_of_one_faint_wall_meet_halfway():
    view, echoes, parts = faint(0.03)
    left, right = (beyond_shadows(part, view, echoes, all_clear, parts) for part in parts)
    assert np.linalg.norm(left.end - right.start) < 1e-3
    assert np.linalg.norm(left.end - 0.5 * (parts[0].end + parts[1].start)) < 1e-3


def test_side_lobes_of_a_glint_do_not_continue_a_wall():
    """They lie in a row that faces the radar, as the wall does."""
    ends = (-0.5, 1.4), (-0.1, 1.4), (0.1, 1.4), (0.5, 1.4)
    glint = np.array([[-0.12, 1.4]]), np.array([3e3 + 0j])
    parts = diffuse(ends[0], ends[1], seed=1), diffuse(ends[2], ends[3], seed=2), glint
    view = radar_view(*together(*parts), noise=1e-3)
    part = replace(LineMirror(*np.array(ends[:2])), strength=1.0)
    assert not goes_on(part.part(part.length + 0.02, part.length + 0.18), view)


def test_a_row_between_two_others_is_one_wall_with_both():
    shares = [(0.0, 0.2), (0.38, 0.68), (0.86, 1.0)]
    parts = [diffuse(at(first), at(last), seed=seed) for seed, (first, last) in enumerate(shares)]
    view = see(radar_image(*together(*parts), np.linspace(-0.9, 0.9, 181), np.linspace(0.8, 1.8, 101)))
    gaps = [hidden(view, first, last) for first, last in ((0.2, 0.38), (0.68, 0.86))]
    rows = [LineMirror(at(first), at(last)) for first, last in shares]
    shortest = 1.1 * rows[1].length

    def clear(*echoes):
        return gaps[0](*echoes) & gaps[1](*echoes)

    (wall,) = joined(rows, view, find_echoes(view), clear, shortest)
    assert wall.length == pytest.approx(np.linalg.norm(END - START), abs=0.1)
