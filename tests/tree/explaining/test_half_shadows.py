"""What only some of the antennas see past the end of a mirror is told from what the mirror shows to the others."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.constants import speed_of_light
from synthetic import diffuse

import mirrorfold as mf
from mirrorfold.common.geometry import crossing
from mirrorfold.detection.finding import find_echoes, see, usual_settings
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding.earlier import known_overhangs
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.explaining.half_shadows import Overhangs, _in_half_shadow, _overhang, half_shadows
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.ordering import order_mirrors

pytestmark = pytest.mark.slow

SCREEN = np.array([0.07, 0.15]), np.array([0.21, 0.18])
"""A wall that is near the array, about as long as which it is."""

WALL = np.array([0.26, 0.70]), np.array([0.44, 0.51])
"""A wall behind it: half of the array sees past the screen where the middle of the array does not."""

ANTENNAS = np.column_stack([(np.arange(120) - 59.5) * 0.7e-3, np.zeros(120)])
FREQUENCY = np.linspace(220e9, 240e9, 201)


PIXELS = {"x": np.arange(-0.2, 0.7, 1.5e-3), "y": np.arange(0.08, 0.9, 1.5e-3)}


def meets(places):
    """Which antennas' lines to places (n, 2) meet the screen, (n, antennas)."""
    found = []
    for antenna in ANTENNAS:
        way, along = crossing(antenna, places, *SCREEN)
        found.append((way > 0.0) & (way < 1.0) & (along >= 0.0) & (along <= 1.0))
    return np.stack(found, axis=1)


def sweep_of(*parts):
    """A sweep of scatterers at (n, 2) [m], each heard by some of the antennas, (n, antennas)."""
    s = np.zeros((FREQUENCY.size, len(ANTENNAS), len(ANTENNAS)), dtype=np.complex128)
    for places, amplitude, heard in parts:
        path = np.linalg.norm(places[:, None] - ANTENNAS, axis=2)
        for number, frequency in enumerate(FREQUENCY):
            wave = heard * np.exp(-2j * np.pi * frequency / speed_of_light * path) / np.sqrt(path)
            s[number] += wave.T @ (amplitude[:, None] * wave)
    place = np.column_stack([ANTENNAS, np.zeros(len(ANTENNAS))])
    return mf.make_sweep(s, frequency=FREQUENCY, tx_position=place, rx_position=place)


def all_of_them(places):
    return np.ones((len(places), len(ANTENNAS)), dtype=bool)


@pytest.fixture(scope="module")
def screen():
    face = diffuse(*SCREEN, 0, spacing=1e-3)
    return *face, all_of_them(face[0])


def chains(result):
    return sorted(result["mirrors"]["chain"].values.tolist())


@pytest.fixture(scope="module")
def behind(screen):
    """The wall where it stands: the sweep, its image, and what comes of them."""
    wall = diffuse(*WALL, 1, spacing=1e-3)
    sweep = sweep_of(screen, (*wall, ~meets(wall[0])))
    image = mf.focus(sweep, **PIXELS)
    return sweep, image, mf.fold(image, sweep=sweep)


def test_what_stands_behind_is_not_seen_in_the_mirror(behind, monkeypatch):
    sweep, image, result = behind
    assert chains(result) == ["0", "1"]  # two walls, both in line of sight
    mirrors = result["mirrors"].to_dataset()
    beyond = np.minimum(mirrors["beyond_start"], mirrors["beyond_end"]).values
    assert (beyond < -0.005).tolist() == (np.abs(mirrors["y0"] - 0.165) < 0.03).values.tolist()
    monkeypatch.setattr("mirrorfold.tree.measured.half_shadows", lambda *given, **named: Overhangs())
    # By the middle of the array alone.
    assert any("/" in chain for chain in chains(mf.fold(image, sweep=sweep)))


def test_what_another_mirror_shows_past_the_end_tells_of_it_as_well(screen):
    """An object that a door shows to a part of the array, past the screen: known once it is seen in the door, too."""
    places, amplitude = diffuse(np.array([0.44, 0.91]), np.array([0.46, 0.89]), 1, spacing=1e-3)
    sweep = sweep_of(screen, (places, 3.0 * amplitude, ~meets(places)))
    view = see(mf.focus(sweep, **PIXELS))
    echoes, waves, known, overhangs = find_echoes(view), SweepWaves(sweep), {}, Overhangs()
    settings = FoldSettings().completed(**usual_settings(view, echoes))
    door = LineMirror(np.array([-0.10, 0.88]), np.array([0.50, 0.60]))
    for ordered in range(3):
        order = order_mirrors(overhangs.on([LineMirror(*SCREEN), door], view), view, echoes, settings)
        seen = order.seen(echoes)
        brightest = np.argmax(np.where(echoes.range > 0.95, echoes.amplitude, 0.0))
        way = order.way(int(order.shown_by(seen)[brightest]))
        assert (way[0].center[1] > 0.5) == (ordered > 0)  # first by way of the screen, then by way of the door alone
        overhangs = half_shadows(order, seen, waves, known)
        assert (overhangs.length < -0.005).tolist() == [True]


def test_two_mirrors_that_share_an_end_are_told_apart(behind):
    """The antennas that look into the one look past the other: what is known of the end holds for one direction."""
    sweep, image, _ = behind
    view = see(image)
    echoes, waves, known = find_echoes(view), SweepWaves(sweep), {}
    end, outward = SCREEN[0], SCREEN[0] - SCREEN[1]
    _, one = _in_half_shadow(echoes, view, end, outward, waves, known)
    _, other = _in_half_shadow(echoes, view, end, -outward, waves, known)
    assert len(one)
    np.testing.assert_allclose(one, -other, atol=1e-6)


def test_what_is_known_of_the_ends_is_in_the_file(behind):
    """So that the image is folded again without the sweep as it was."""
    result = behind[2]
    again = mf.fold(result)
    assert chains(again) == chains(result)
    for name in ("beyond_start", "beyond_end"):
        np.testing.assert_allclose(again["mirrors"][name], result["mirrors"][name])


def test_a_frame_that_tells_of_no_half_shadow_is_folded_again_too(behind):
    """In the table of a recording it has no number where another frame has one."""
    result = behind[2].copy()
    mirrors = result["mirrors"].to_dataset(inherit=False)
    nothing = {name: mirrors[name] * np.nan for name in ("beyond_start", "beyond_end")}
    result["/mirrors"] = xr.DataTree(mirrors.assign(nothing))
    assert known_overhangs(result).length.tolist() == [0.0] * 4
    assert "0" in chains(mf.fold(result))


def test_what_the_mirror_shows_is_seen_in_the_mirror(screen):
    """The same row, but shown by the screen: where its true wall stands, the array does not look."""
    image = diffuse(*WALL, 1, spacing=1e-3)
    sweep = sweep_of(screen, (*image, meets(image[0])))
    assert chains(mf.fold(mf.focus(sweep, **PIXELS), sweep=sweep))[:2] == ["0", "0/0"]


def test_the_overhang_puts_the_fewest_echoes_on_the_wrong_side():
    outside = np.array([-0.03, -0.02, -0.01, 0.01])
    assert _overhang(outside, np.array([True, False, False, False]), 0.004) == pytest.approx(-0.025)
    assert _overhang(outside, np.array([True] * 4), 0.004) == pytest.approx(0.014)
    assert _overhang(outside, np.array([False] * 4), 0.004) == pytest.approx(-0.034)
    assert _overhang(outside, np.array([True, True, True, False]), 0.004) == 0.0
    assert _overhang(np.empty(0), np.empty(0, dtype=bool), 0.004) == 0.0
