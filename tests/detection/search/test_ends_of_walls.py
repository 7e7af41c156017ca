"""Where walls end, and what is two though it looks like one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from straight_walls import NOISE, errors, look, random_wall, thick, wall_at
from synthetic import RANGE_CELL, WAVELENGTH, diffuse, empty_view, envelope, radar_view, together

from mirrorfold.detection import find_mirrors
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.fit import parabola_residual, split_in_two
from mirrorfold.detection.search.growing import NO_BOW, lies_on
from mirrorfold.detection.search.lines import _Lines


@pytest.mark.parametrize(("incidence", "count"), [(0.0, 1), (20.0, 0)])
def test_a_short_row_is_a_mirror_where_it_faces_a_long_array(incidence, count):
    """16 cm, 5 cells: the glint of a smooth wall before an array of 15 cm; too little for a wall that is seen askew."""
    view = replace(empty_view(), wavelength=WAVELENGTH)
    aperture = 0.15 / WAVELENGTH
    view = replace(view, aperture_tx=aperture, aperture_rx=aperture, u_cell=1.207 / np.hypot(aperture, aperture))
    ends = wall_at(np.array([0.0, 1.0]), incidence, 0.16)
    seen = np.abs(envelope(view, *diffuse(*ends, seed=3)))
    noise = NOISE * np.abs(np.random.default_rng(2).standard_normal(seen.shape)) * view.range[:, None]
    view = replace(view, amplitude=seen + noise)
    assert len(find_mirrors(view, find_ridges(view))) == count


def test_what_stands_at_the_end_of_a_wall_does_not_turn_it(monkeypatch):
    """A short piece, askew and less than a cell off the line, that goes on where the wall ends."""
    start, end = wall_at(np.array([0.2, 1.2]), 50.0, 0.8)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([-along[1], along[0]])
    begin = end + 0.02 * along - 0.012 * across
    piece = diffuse(begin, begin + 0.25 * along + 0.04 * across, 50, strength=2.0)
    scene = together(diffuse(start, end, 0), piece)
    mirror = look(*scene)[2][0]
    angle, offset = errors(mirror, start, end)
    assert angle < 0.3
    assert offset < 1.5
    monkeypatch.setattr("mirrorfold.detection.search.lines.BREAK", np.inf)
    assert errors(look(*scene)[2][0], start, end)[0] > 2.0 * angle


@pytest.mark.parametrize("seed", range(3))
def test_a_wall_ends_at_its_last_echo_where_another_object_goes_on_beyond_a_gap(seed):
    """Not within the gap: what is seen beside the object would pass for seen in the wall."""
    start, end = wall_at(np.array([0.2, 1.2]), 70.0, 0.8)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([-along[1], along[0]])
    begin = end + 2.2 * RANGE_CELL * along - 0.012 * across
    piece = diffuse(begin, begin + 0.25 * along + 0.04 * across, 50 + seed, strength=2.0)
    mirror = look(*together(diffuse(start, end, seed), piece))[2][0]
    assert np.linalg.norm(mirror.ends - end, axis=1).min() < 0.6 * RANGE_CELL


@pytest.mark.parametrize(("level", "whole"), [(-8.0, True), (-22.0, False)])
@pytest.mark.parametrize("first", [False, True], ids=["beyond its end", "before its start"])
@pytest.mark.parametrize("seed", range(3))
def test_a_wall_goes_on_only_where_its_row_is_not_too_faint(seed, first, level, whole):
    """Walls fade slowly; what is 20 dB fainter from one cell to the next is something else."""
    start, end = wall_at(np.array([0.2, 1.3]), 20.0, 0.8)
    if first:
        start, end = end, start
    middle, faint = start + 0.6 * (end - start), 10.0 ** (level / 20.0)
    view, echoes, _ = look(*together(diffuse(start, middle, seed), diffuse(middle, end, 9 + seed, strength=faint)))
    along = (echoes.position - start) @ (end - start) / 0.8
    (mirror,) = find_mirrors(view, replace(echoes, strong=echoes.strong & (along < 0.48)))
    assert mirror.length == pytest.approx(0.8 if whole else 0.48, abs=0.06)


@pytest.mark.parametrize("both", [False, True], ids=["one end", "both ends"])
@pytest.mark.parametrize("seed", range(3))
def test_a_long_wall_is_told_from_what_goes_on_a_quarter_of_a_cell_beside_it(seed, both):
    """The longer the row, the less of its squares two lines save: what they save counts for each of its places."""
    start, end = wall_at(np.array([0.2, 1.4]), 50.0, 1.0)
    along = end - start
    across = np.array([-along[1], along[0]])
    pieces = [end + step * along - 0.01 * across for step in (0.02, 0.32)]
    scene = [diffuse(start, end, seed), diffuse(*pieces, 50 + seed)]
    if both:
        pieces = [start - step * along + 0.012 * across for step in (0.02, 0.32)]
        scene.append(diffuse(*pieces, 150 + seed))
    mirror = max(look(*together(*scene), seed=seed)[2], key=lambda mirror: mirror.length)
    angle, offset = errors(mirror, start, end)
    assert angle < 0.1
    assert offset < 0.5
    assert mirror.length == pytest.approx(1.0, abs=0.05)


def test_a_wall_with_something_at_its_end_that_makes_its_row_bulge_is_found(monkeypatch):
    """The row as a whole is bent, and no wall."""
    start, end = wall_at(np.array([0.0, 1.3]), 20.0, 0.7)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([-along[1], along[0]])
    things = [
        diffuse(end + 0.02 * along + bend * across, end + 0.3 * along + 3.0 * bend * across, 50) for bend in (0.016,)
    ]
    scene = together(diffuse(start, end, 0), *things)
    found = look(*scene)[2]
    assert any(errors(mirror, start, end)[0] < 0.5 and 0.6 < mirror.length < 0.9 for mirror in found)
    monkeypatch.setattr(_Lines, "straight_part", lambda *arguments: None)
    assert not any(errors(mirror, start, end)[0] < 0.5 for mirror in look(*scene)[2])


def test_two_lines_fit_a_bow_no_better_than_a_bow():
    """But what breaks off they fit much better."""
    random = np.random.default_rng(0)
    along, weight = np.sort(random.uniform(0.0, 1.0, 200)), random.uniform(0.5, 2.0, 200)
    noise = 1e-3 * random.standard_normal(200)
    bow, kink = 0.02 * along**2 + noise, 0.03 * np.maximum(along - 0.8, 0.0) + noise
    assert split_in_two(along, bow, weight)[1] > NO_BOW * parabola_residual(along, bow, weight)
    assert split_in_two(along, kink, weight)[1] < NO_BOW * parabola_residual(along, kink, weight)


def test_a_row_of_side_lobes_on_a_wall_is_the_wall():
    view = empty_view()
    wall = LineMirror(np.array([-0.4, 1.2]), np.array([0.5, 1.3]))
    assert lies_on(wall.part(0.1, 0.6), wall, view)
    assert lies_on(wall.part(-0.1, wall.length), wall, view)
    assert not lies_on(wall, wall.part(0.0, 0.3), view)  # its middle lies beyond
    assert not lies_on(wall.moved(wall.normal, wall.center + 0.1 * wall.normal), wall, view)


def test_two_lines_are_told_from_one():
    random = np.random.default_rng(0)
    along, noise = np.linspace(0.0, 1.0, 80), 1e-3 * random.standard_normal(80)
    weight = np.ones(80)
    assert split_in_two(along, noise, weight)[1] > 0.8
    place, left, apart = split_in_two(along, noise + np.where(along > 0.7, 0.01, 0.0), weight)
    assert place == pytest.approx(0.7, abs=0.03)
    assert left < 0.2
    assert apart == pytest.approx(0.01, rel=0.2)
    turned = split_in_two(along, noise + 0.05 * np.maximum(0.3 - along, 0.0), weight)
    assert turned[0] == pytest.approx(0.3, abs=0.05)
    assert turned[2] == pytest.approx(0.05 * 0.3, rel=0.2)
    assert split_in_two(along[:3], noise[:3], weight[:3]) == (along[2], 1.0, 0.0)


@pytest.mark.parametrize(("off", "whole"), [(0.1, True), (0.4, False)])
def test_only_what_leaves_the_line_of_a_wall_is_cut_off(off, whole, monkeypatch):
    """Whatever the residuals say: a tenth of a cell is no other object."""
    monkeypatch.setattr("mirrorfold.detection.search.lines.BREAK", 0.0)
    start, end = wall_at(np.array([0.2, 1.3]), 0.0, 0.8)
    middle, beside = start + 0.75 * (end - start), off * RANGE_CELL * np.array([0.0, 1.0])
    mirror = look(*together(diffuse(start, middle, 3), diffuse(middle + beside, end + beside, 4)))[2][0]
    assert mirror.length == pytest.approx(0.8 if whole else 0.6, abs=0.06)


def lengths(seed, inside):
    """Of the mirrors [decimetre] that a metre of a thick wall shows."""
    start, end = random_wall(seed, length=1.0)
    _, _, mirrors = look(*thick(start, end, seed, 0.01, inside), seed=seed)
    return [round(10.0 * mirror.length) for mirror in mirrors]


@pytest.mark.slow
@pytest.mark.parametrize("inside", ["uniform", "front and back"])
def test_a_wall_that_scatters_from_inside_is_one(inside, monkeypatch):
    """Its centres of power stray by its depth, and would sometimes lie on two lines."""
    assert all(lengths(seed, inside) == [10] for seed in range(16))
    monkeypatch.setattr("mirrorfold.detection.search.lines.LOBE_SPREAD", np.inf)
    assert any(lengths(seed, inside) != [10] for seed in range(16))


@pytest.mark.parametrize(("level", "before", "whole"), [(8.0, False, False), (1.0, False, True), (8.0, True, True)],
                         ids=["shines", "as the wall", "behind something"])  # fmt: skip
@pytest.mark.parametrize("seed", range(2))
def test_what_shines_beyond_a_gap_at_the_end_of_a_wall_is_no_part_of_it(seed, level, before, whole):
    """It may be a curved wall there; behind other objects, gaps are the shadows of those."""
    start, end = wall_at(np.array([-0.1, 1.4]), 60.0, 1.0)
    direction = end - start
    beyond = diffuse(end + 0.06 * direction, end + 0.2 * direction, 7 + seed, strength=level)
    screen = diffuse(0.6 * (end + 0.05 * direction), 0.6 * (end + 0.25 * direction), 9 + seed, strength=2.0)
    parts = [diffuse(start, end, seed), beyond, *([screen] if before else [])]
    view = replace(radar_view(*together(*parts), noise=NOISE, seed=seed), wavelength=WAVELENGTH)
    longest = max(find_mirrors(view, find_ridges(view)), key=lambda mirror: mirror.length)
    assert longest.length == pytest.approx(1.2 if whole else 1.0, abs=RANGE_CELL)
    assert errors(longest, start, end)[0] < 0.3


@pytest.mark.parametrize(("turn", "mirrors"), [(0.0, 1), (3.0, 1), (15.0, 0)])
def test_a_line_that_leaves_the_row_it_is_fitted_to_is_no_mirror(monkeypatch, turn, mirrors):
    """Half a metre, fifteen cells: at its ends, a line turned by 3 degrees is half a cell off, by 15 degrees two."""
    start, end = wall_at(np.array([0.2, 1.2]), 30.0, 0.5)
    view, echoes, _ = look(*diffuse(start, end, 0))
    cosine, sine = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turning = np.array([[cosine, -sine], [sine, cosine]])

    def askew(mirror, view):
        half = turning @ (mirror.end - mirror.center)
        return replace(mirror, start=mirror.center - half, end=mirror.center + half), 1e-3

    monkeypatch.setattr("mirrorfold.detection.search.lines._fit", askew)
    monkeypatch.setattr(_Lines, "_unbroken", lambda search, mirror, own: mirror)
    assert len(find_mirrors(replace(view), echoes)) == mirrors
