"""What comes from elsewhere and stands within a cell of a wall does not turn its line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import RANGE_CELL, diffuse, on_line, radar_view, together

from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.lines import find_lines
from mirrorfold.detection.search.remembered import remembered

START, END = np.array([-0.7, 1.3]), np.array([0.8, 1.3])
BEHIND = np.array([0.0, 0.6 * RANGE_CELL])


def found(spoilt, strength, seed, *, told, behind=BEHIND):
    """Angle [degree] and length [m] of the longest mirror, where a bright row stands behind a part of the wall.

    The view knows that the row comes from elsewhere if that is `told`.
    """
    ends = [START + share * (END - START) + behind for share in spoilt]
    view = radar_view(*together(diffuse(START, END, seed), diffuse(*ends, seed + 50, strength)), noise=1e-3)
    echoes = find_ridges(view)
    if told:
        first, last = (end[0] for end in ends)
        x, y = echoes.position.T
        mixed = (x > first - RANGE_CELL) & (x < last + RANGE_CELL) & (np.abs(y - START[1]) < 1.5 * RANGE_CELL)
        view = view.knowing(misplaced=echoes.position[mixed])
    longest = max(find_lines(echoes, view, minimum_length=0.25), key=lambda mirror: mirror.length)
    return abs(np.degrees(np.arctan2(*longest.direction[::-1]) % np.pi + 0.5 * np.pi) % 180.0 - 90.0), longest.length


@pytest.mark.parametrize("seed", range(3))
def test_a_bright_row_behind_a_part_of_a_wall_cuts_or_turns_it_until_the_sweep_tells(seed):
    turn, length = found((0.6, 0.95), 3.0, seed, told=False)
    assert turn > 0.1 or length < 1.2
    turn, length = found((0.6, 0.95), 3.0, seed, told=True)
    assert turn < 0.1
    assert length == pytest.approx(1.5, abs=0.1)


def test_places_are_blurred_in_the_beam_of_an_echo_from_elsewhere_alone():
    view = radar_view(*diffuse(START, END, 0))
    known = view.knowing(misplaced=np.array([[0.0, 1.3]]))
    wall = on_line(START, END)
    near = np.abs(view.to_polar(wall)[1]) <= 0.5 * view.u_cell
    assert known.near_misplaced(wall).tolist() == near.tolist()
    assert not known.near_misplaced(wall + np.array([0.0, 1.5 * RANGE_CELL])).any()
    assert not view.near_misplaced(wall).any()


def test_what_is_known_of_a_row_is_asked_again_once_an_echo_beside_it_is_misplaced():
    view = radar_view(*diffuse(START, END, 0))
    asked = []

    @remembered
    def length(mirror, view):
        asked.append(len(view.misplaced))
        return mirror.length

    row = LineMirror(START, END)
    assert [length(row, view), length(replace(row, fill=0.7), view)] == [pytest.approx(1.5)] * 2
    assert asked == [0]
    # Far from the row, it is no matter; in the same place as the row, it is.
    far, beside = np.array([[0.0, 0.7]]), np.array([[0.0, 1.3], [0.0, 0.7]])
    assert view.knowing(misplaced=far).misplaced_about(row.ends).tolist() == []
    length(row, view.knowing(misplaced=far))
    assert asked == [0]
    length(row, view.knowing(misplaced=beside))
    length(row, view.knowing(misplaced=beside))
    assert asked == [0, 2]
    length(LineMirror(START, 0.5 * (START + END)), view)
    assert asked == [0, 2, 0]
    # Wherever on the row it is.
    for share in np.random.default_rng(0).random(50):
        place = START + share * (END - START)
        count = len(asked)
        length(row, view.knowing(misplaced=place[None]))
        assert len(asked) == count + 1
