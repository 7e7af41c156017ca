"""Echoes from beyond the ambiguous range, told by the curvature of their waves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from echo_shapes import BAND, PERIOD, STEP, array, corner, face, point, sweep_of, view_of
from numpy.testing import assert_allclose, assert_array_equal
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.detection.views.image_view import LARGEST_SINE
from mirrorfold.folding.confident import confident_points
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.tree.explaining import waves, wrapped
from mirrorfold.tree.explaining.misplaced import LATE
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.explaining.wrapped import MOST_PERIODS, wrapping_ratio


@pytest.mark.slow
@pytest.mark.parametrize("shape", [point, face, corner])
@pytest.mark.parametrize("behind", [0.0, 0.02])
@pytest.mark.parametrize("range_", [0.35, 0.6])
def test_the_curvature_of_the_waves_tells_how_far_they_come(shape, behind, range_):
    """Points, flat faces and corners, near ones and those from one ambiguous range farther away."""
    u = -0.3
    tx, rx = array(), array(behind)
    view = view_of(tx, rx)
    for far in (False, True):
        sweep = sweep_of([shape(range_ + far * PERIOD, u, tx, rx)], tx, rx)
        ratio = wrapping_ratio(SweepWaves(sweep), view, np.array([range_]), np.array([u]))
        assert ratio[0] > 2.0 if far else ratio[0] < 0.6


@pytest.mark.parametrize("shape", [point, face, corner])
def test_waves_from_later_periods_fit_better_than_those_from_the_first(monkeypatch, shape):
    """So that other echoes at its range hide less easily how late an echo is."""
    tx = rx = array()
    view, place = view_of(tx, rx), (np.array([0.6]), np.array([-0.3]))
    for periods, least in ((0, 0.0), (1, 0.99), (2, 1.2), (3, 1.5)):
        late = SweepWaves(sweep_of([shape(0.6 + periods * PERIOD, -0.3, tx, rx)], tx, rx))
        ratio = wrapping_ratio(late, view, *place)[0]
        with monkeypatch.context() as patch:
            patch.setattr(wrapped, "MOST_PERIODS", 1)
            first = wrapping_ratio(late, view, *place)[0]
        assert ratio > least * first if periods else ratio < 0.6


@pytest.mark.slow
def test_a_late_echo_is_left_out_and_a_near_one_stays():
    tx = rx = array()
    sweep = sweep_of([point(0.5, -0.2, tx, rx), point(0.6 + PERIOD, 0.3, tx, rx)], tx, rx)
    image = mf.focus(sweep, x=np.linspace(-0.5, 0.5, 251), y=np.linspace(0.2, 0.9, 176))
    with_sweep, alone = (FoldPlan(image, sweep=known).fold() for known in (sweep, None))
    assert (alone["objects"]["x"].values > 0.1).any()
    shown, every = confident_points(with_sweep), with_sweep["objects"]
    np.testing.assert_allclose(shown["x"].values, -0.1, atol=0.01)
    assert shown.sizes["point"]
    # What is left out stays in the file, with the reason.
    reasons = every["explanation"].values[every["x"].values > 0.1]
    assert "" not in reasons
    assert LATE in reasons
    # It is drawn in the unfolded image, as it was measured, and nowhere in the corrected one.
    late = {"x": slice(0.1, 0.3), "y": slice(0.5, 0.65)}
    before, after = (picture.sel(late).max() / picture.max() for picture in
                     (with_sweep["initial"]["initial"], with_sweep["intensity"]))  # fmt: skip
    assert before > 0.1
    assert after < 0.1 * before


def test_faint_echoes_beside_a_bright_one_at_their_range_are_told_by_more_pairs(monkeypatch):
    """23 dB below it, a thousand random pairs do not suppress it enough."""
    tx = rx = array()
    view = view_of(tx, rx)
    near, late = point(0.5, -0.2, tx, rx), point(0.5 + PERIOD, 0.4, tx, rx)
    k = 2.0 * np.pi * BAND[:, None, None] / speed_of_light
    s = np.exp(-1j * k * near) + 0.07 * np.exp(-1j * k * late)
    sweep = mf.make_sweep(s.astype(np.complex64), frequency=BAND, tx_position=tx, rx_position=rx)
    echoes = np.array([0.5, 0.5]), np.array([-0.2, 0.4])
    bright, faint = wrapping_ratio(SweepWaves(sweep), view, *echoes)
    assert bright <= 1.0
    assert faint > 1.8
    monkeypatch.setattr(waves, "PAIRS", (1000, 1000))
    assert wrapping_ratio(SweepWaves(sweep), view, *echoes)[1] == 1.0


def test_waves_that_are_flat_either_way_prove_nothing():
    """Far away a short array cannot tell one distance from twice as much."""
    tx = rx = array()[48:65]
    sweep = sweep_of([point(1.1 + PERIOD, 0.1, tx, rx)], tx, rx)
    view = view_of(tx, rx)
    ratio = wrapping_ratio(SweepWaves(sweep), view, np.array([1.1]), np.array([0.1]))
    assert ratio[0] == 1.0
    assert_array_equal(wrapping_ratio(SweepWaves(sweep), view, np.zeros(0), np.zeros(0)), [])


def short_array(elements=41):
    position = np.zeros((elements, 3))
    position[:, 0] = 3.5e-3 * (np.arange(elements) - 0.5 * (elements - 1))
    return position


@pytest.mark.parametrize("shape", [point, face, corner])
def test_late_echoes_are_told_from_near_ones_by_a_thinned_array(shape):
    """A few antennas along the same length; two echoes at once, in other directions, in noise as strong as they."""
    tx = rx = short_array()
    view = view_of(tx, rx)
    sweep = sweep_of([shape(0.4, -0.3, tx, rx), shape(0.5 + PERIOD, 0.2, tx, rx)], tx, rx, noise=0.7)
    near, late = wrapping_ratio(SweepWaves(sweep), view, np.array([0.4, 0.5]), np.array([-0.3, 0.2]))
    assert near <= 1.0
    assert late > 1.8


@pytest.mark.parametrize(("range_", "u"), [(0.4, -0.3), (0.9, 0.97)])
def test_both_distances_are_tried_in_all_directions_that_the_error_of_focus_spreads_to(monkeypatch, range_, u):
    """From either end of an array an echo that is focused at the wrong distance seems to come from another side."""
    tx, rx = short_array(), short_array(21) + np.array([0.0, 0.02, 0.0])
    asked = []

    def coherence(windows, step, shift, shape, tx, rx, tx_of, rx_of, centre, directions, curvature, along, ahead, out):
        asked.append((shape, 1.0 / curvature, directions, windows))
        assert shift == 1.0  # the window is read where the path of each pair ends
        out[0] = 1.0

    monkeypatch.setattr(waves, "coherence", coherence)
    # A spike in every pair at the path of the echo, so that the window shows where it was cut out.
    path = np.full((len(tx), len(rx)), 2.0 * range_)
    wrapping_ratio(SweepWaves(sweep_of([path], tx, rx)), view_of(tx, rx), np.array([range_]), np.array([u]))
    *late, own = [distance for _, distance, *_ in asked[::3]]
    assert [shape for shape, *_ in asked] == [waves.POINT, waves.FACE, waves.CORNER] * (len(late) + 1)
    wavelength = speed_of_light / BAND.mean()
    # From the middle of both arrays, half-way between them.
    cell, reach = 0.5 * wavelength / np.ptp(tx[:, 0]), np.hypot(np.abs(tx[:, 0]).max(), 0.01)
    assert own == pytest.approx(range_)
    assert late[0] == pytest.approx(range_ + PERIOD)
    assert_allclose((np.array(late) - range_) / PERIOD, np.rint((np.array(late) - range_) / PERIOD))
    # Waves bend apart by a quarter of a wavelength from one to the next, over both antennas half of that each.
    assert (np.diff(1.0 / np.array(late)) * reach**2 < -0.25 * wavelength).all()
    assert len(late) <= MOST_PERIODS
    spread = reach * (1.0 / range_ - 1.0 / late[-1]) + cell
    for *_, directions, window in asked:
        expected = np.clip([u - spread, u + spread], -LARGEST_SINE, LARGEST_SINE)
        assert_allclose(directions[[0, -1]], expected, rtol=1e-6)
        assert 0.2 * cell < np.diff(directions).max() <= 0.5 * cell
        # Paths are longer or shorter by the way to the farthest antenna and back, at most.
        power = (window**2).sum(axis=(0, 2, 3))
        assert power.size == 2 * (int(np.ceil(2.0 * reach / STEP)) + 2) + 1
        assert np.argmax(power) == power.size // 2


def test_where_no_waves_arrive_in_phase_nothing_is_said():
    """Of noise, and of an echo from elsewhere."""
    tx = rx = short_array()
    random = np.random.default_rng(0)
    sweep = sweep_of([point(0.4, -0.3, tx, rx)], tx, rx)
    noise = sweep.assign(s=(sweep["s"].dims, random.standard_normal((*sweep["s"].shape, 2)) @ [1.0, 1.0j]))
    assert_array_equal(
        wrapping_ratio(SweepWaves(noise), view_of(tx, rx), np.array([0.4, 0.8]), np.array([-0.3, 0.5])), 1.0
    )
    assert_array_equal(wrapping_ratio(SweepWaves(sweep), view_of(tx, rx), np.array([0.8]), np.array([0.5])), 1.0)


def test_the_verdict_is_the_same_wherever_the_array_stands_and_points():
    """Turned in the floor plan with its echoes."""
    tx = rx = short_array()
    sweep = sweep_of([point(0.5 + PERIOD, 0.2, tx, rx)], tx, rx)
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    expected = wrapping_ratio(SweepWaves(sweep), view_of(tx, rx), np.array([0.5]), np.array([0.2]))
    turned = tx.copy()
    turned[:, :2] = tx[:, :2] @ turn
    view = replace(view_of(tx, rx), along=turn[0], broadside=turn[1])
    moved = sweep.assign_coords(
        {f"{side}_position": sweep[f"{side}_position"].copy(data=turned) for side in ("tx", "rx")}
    )
    np.testing.assert_allclose(
        wrapping_ratio(SweepWaves(moved), view, np.array([0.5]), np.array([0.2])), expected, rtol=1e-3
    )


def test_a_window_may_reach_over_the_end_of_the_ambiguous_range():
    """Of some pairs the echo stands at its end, of others at its beginning: in phase all the same."""
    tx = rx = short_array()
    sweep = sweep_of([point(0.9995 * PERIOD, 0.6, tx, rx)], tx, rx, noise=0.3)
    path = point(0.9995 * PERIOD, 0.6, tx, rx)
    assert path.min() < 2.0 * PERIOD < path.max()
    ratio = wrapping_ratio(SweepWaves(sweep), view_of(tx, rx), np.array([0.9995 * PERIOD]), np.array([0.6]))
    assert ratio[0] < 0.95


def test_antennas_at_one_place_tell_no_distances():
    """The curvature of waves does not show at a point."""
    tx = rx = np.zeros((1, 3))
    sweep, view = sweep_of([point(0.5, 0.2, tx, rx)], tx, rx), view_of(array(), array())
    assert_array_equal(wrapping_ratio(SweepWaves(sweep), view, np.array([0.5]), np.array([0.2])), 1.0)
