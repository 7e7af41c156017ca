"""Mixed-path echoes, synthesised from images of points: out in line of sight, back by way of a wall, or the reverse."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.constants import speed_of_light
from scipy.spatial.distance import cdist

from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.errors import InputError
from mirrorfold.sweep import make_sweep
from mirrorfold.tree.explaining import directions
from mirrorfold.tree.explaining.apertures import Aperture
from mirrorfold.tree.explaining.directions import PHASE_SPREAD, confocal_share, direction_ratio
from mirrorfold.tree.explaining.lobes import lobe_level
from mirrorfold.tree.explaining.misplaced import MIXED, SMALLEST_DIRECTION_RATIO, Known, misplaced
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.explaining.wrapped import wrapping_ratio
from mirrorfold.tree.measured import measured_by_sweep

FREQUENCY = np.linspace(290e9, 300e9, 61)
WAVELENGTH = speed_of_light / 295e9
RANGE = 1.0


def line(elements, pitch=1e-3, middle=(0.0, 0.0, 0.0)):
    """Elements along x, (n, 3) [m]."""
    return np.array(middle) + pitch * (np.arange(elements) - (elements - 1) / 2)[:, None] * [1.0, 0.0, 0.0]


def at(sine, range_=RANGE, height=0.0):
    """The place at a range [m] and a sine of the angle off broadside."""
    return np.array([range_ * sine, range_ * np.sqrt(1.0 - sine**2), height])


def sweep_of(tx, rx, *paths):
    """The sweep of echoes that leave towards one place and arrive from another one."""
    k = 2.0 * np.pi * FREQUENCY[:, None, None] / speed_of_light
    leaves, arrives = np.swapaxes(paths, 0, 1)
    out, back = (np.exp(-1j * k * cdist(side, places)) for side, places in ((tx, leaves), (rx, arrives)))
    s = out @ back.swapaxes(1, 2)
    return make_sweep(s, frequency=FREQUENCY, tx_position=tx, rx_position=rx)


def view_of(tx, rx):
    """The radar's view with the arrays along x, without any amplitudes."""
    lengths = [max(float(np.ptp(side[:, 0])), 0.01) / WAVELENGTH for side in (tx, rx)]
    radar = 0.5 * (tx.mean(axis=0) + rx.mean(axis=0))[:2]
    range_, u = np.linspace(0.5, 2.0, 10), np.linspace(-0.9, 0.9, 10)
    cell = speed_of_light / (FREQUENCY[-1] - FREQUENCY[0])
    return ImageView(
        radar, np.array([1.0, 0.0]), np.array([0.0, 1.0]), range_, u, np.zeros((10, 10)), 1.0, cell,
        1.207 / np.hypot(*lengths), *lengths,
    )  # fmt: skip


def echoes_at(view, u):
    """Echoes of equal amplitude in the directions u."""
    one = np.ones(u.size)
    return Echoes.found(view.to_points(RANGE * one, u), RANGE * one, view.column(u), one, one, 0.0 * one, 0.1, 1.0)


def ratio_of(tx, rx, leaves, arrives, u=None):
    """The ratio of one echo, tested in the middle between the sines of its two directions by default."""
    waves = SweepWaves(sweep_of(tx, rx, (leaves, arrives)))
    middle = 0.5 * (leaves[0] + arrives[0]) / RANGE
    return float(direction_ratio(waves, view_of(tx, rx), np.array([RANGE]), np.array([middle if u is None else u]))[0])


def mixed_pair(degrees, middle=10.0, height=0.0):
    """Two places at the same range, seen so many degrees apart."""
    return [at(np.sin(np.radians(middle + side * degrees / 2)), height=height) for side in (-1, 1)]


@pytest.mark.parametrize("sine", [-0.7, 0.0, 0.3])
def test_a_true_echo_has_a_ratio_near_one(sine):
    tx, rx = line(81), line(61)
    # Nothing louder stands in any other direction: only the steps between directions could exceed the echo itself.
    assert ratio_of(tx, rx, at(sine), at(sine)) > 0.99


@pytest.mark.parametrize("degrees", [2.0, 4.0, 15.0])
@pytest.mark.parametrize("reverse", [False, True])
def test_a_mixed_echo_is_far_below_a_half_whichever_way_it_went(degrees, reverse):
    tx, rx = line(101), line(101)
    leaves, arrives = mixed_pair(degrees)[:: -1 if reverse else 1]
    assert ratio_of(tx, rx, leaves, arrives) < 0.2


def test_the_ratio_falls_as_the_directions_part():
    tx, rx = line(81), line(81)
    ratio = [ratio_of(tx, rx, *mixed_pair(degrees)) for degrees in (0.0, 0.5, 1.0, 1.5, 2.0)]
    assert ratio[0] > 0.99
    assert np.all(np.diff(ratio) < 0.0)


@pytest.mark.parametrize("degrees", [0.0, 0.8])
class TestInvariance:
    """Of a true echo, and of a mixed one with a ratio that is neither one nor nought."""

    tx, rx = line(61), line(81)

    def test_under_the_order_of_the_elements(self, degrees):
        leaves, arrives = mixed_pair(degrees)
        random = np.random.default_rng(3)
        shuffled = random.permutation(self.tx), random.permutation(self.rx)
        assert_allclose(ratio_of(*shuffled, leaves, arrives), ratio_of(self.tx, self.rx, leaves, arrives), rtol=1e-4)

    @pytest.mark.parametrize("side", ["tx", "rx", "both"])
    def test_under_more_elements_at_the_same_place(self, degrees, side):
        leaves, arrives = mixed_pair(degrees)
        tx = self.tx if side == "rx" else self.tx[[0, 0, *range(61), 7, 7, 7]]
        rx = self.rx if side == "tx" else self.rx[[*range(81), 80, 3, 3]]
        # The view stays that of the radar: its middle is where the image was made around.
        sweeps = [sweep_of(*sides, (leaves, arrives)) for sides in ((tx, rx), (self.tx, self.rx))]
        place = np.array([RANGE]), np.array([0.5 * (leaves + arrives)[0]])
        found, expected = (direction_ratio(SweepWaves(sweep), view_of(self.tx, self.rx), *place) for sweep in sweeps)
        assert_allclose(found, expected, rtol=1e-4)

    def test_under_a_lift_of_array_and_echo(self, degrees):
        lift = np.array([0.0, 0.0, 1.7])
        found = ratio_of(self.tx + lift, self.rx + lift, *mixed_pair(degrees, height=1.7))
        assert_allclose(found, ratio_of(self.tx, self.rx, *mixed_pair(degrees)), rtol=1e-4)

    def test_under_an_exchange_of_the_sides(self, degrees):
        leaves, arrives = mixed_pair(degrees)
        equal = line(81)
        # The directions listened to are spread around broadside, not around the echo: equal but for their steps.
        assert_allclose(ratio_of(equal, equal, leaves, arrives), ratio_of(equal, equal, arrives, leaves), rtol=0.1)
        # Backwards along the same two ways, with sides of different lengths: the same verdict.
        forth = ratio_of(self.tx, self.rx, *mixed_pair(4.0 * degrees))
        back = ratio_of(self.rx, self.tx, *mixed_pair(4.0 * degrees)[::-1])
        assert (forth < SMALLEST_DIRECTION_RATIO) == (back < SMALLEST_DIRECTION_RATIO) == (degrees > 0.0)


def test_heights_of_the_elements_count():
    """Receivers on a slope in y and z: with their heights dropped, an echo off broadside would be called mixed."""
    tx = line(81)
    slope = np.array([[0.8, 0.0, 0.6]]) * line(81)[:, :1]
    place = at(0.0, range_=0.15)
    sweep = sweep_of(tx, slope, (place, place))
    assert direction_ratio(SweepWaves(sweep), view_of(tx, slope), np.array([0.15]), np.array([0.0]))[0] > 0.98


def test_two_echoes_at_one_range_are_told_apart():
    tx, rx = line(81), line(81)
    true, (leaves, arrives) = at(-0.4), mixed_pair(4.0, middle=20.0)
    sweep = sweep_of(tx, rx, (true, true), (leaves, arrives))
    u = np.array([-0.4, 0.5 * (leaves + arrives)[0]])
    view = view_of(tx, rx)
    echoes = echoes_at(view, u)
    known: Known = {}
    assert_array_equal(misplaced(echoes, SweepWaves(sweep), view, known), ["", MIXED])
    measured = [(direction_ratio, RANGE, -0.4), (direction_ratio, RANGE, float(u[1]))]
    others = (lobe_level, wrapping_ratio)
    assert set(known) == {*measured, *((measure, *place[1:]) for place in measured for measure in others)}
    known[measured[0]] = 0.1  # a ratio that is known is not measured again
    assert_array_equal(misplaced(echoes, SweepWaves(sweep), view, known), [MIXED, MIXED])


@pytest.mark.parametrize("lonely", ["tx", "rx"])
def test_nobody_is_accused_where_a_side_stands_at_one_place(lonely):
    tx = line(5, pitch=0.0) if lonely == "tx" else line(81)
    rx = line(5, pitch=0.0) if lonely == "rx" else line(81)
    leaves, arrives = mixed_pair(6.0)
    sweep = sweep_of(tx, rx, (leaves, arrives))
    u = 0.5 * (leaves + arrives)[:1]
    view = view_of(tx, rx)
    assert_array_equal(direction_ratio(SweepWaves(sweep), view, np.array([RANGE]), u), 1.0)


def test_frames_are_refused():
    tx, rx = line(5), line(5)
    sweep = sweep_of(tx, rx, (at(0.0), at(0.0))).expand_dims(frame=2)
    with pytest.raises(InputError, match=r"'frame', 'frequency', 'tx', 'rx'.*choose one frame"):
        measured_by_sweep(sweep)


def hann(n):
    """The window on a line of n equal steps that reaches half a mean pitch beyond either end."""
    margin = 0.5 * (n - 1) / n
    return np.sin(np.pi * (np.arange(n) + margin) / (n - 1 + 2.0 * margin)) ** 2


@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0], [0.48, 0.6, 0.64]])
def test_weights_are_hann_along_any_line(direction):
    position = 0.3 + line(41)[:, :1] * np.array([direction])
    assert_allclose(Aperture.of(position, WAVELENGTH).weight, hann(41), atol=2e-4)


def test_weights_of_a_planar_array_follow_its_longer_side():
    x, z = np.meshgrid(np.arange(20) * 1e-3, np.arange(5) * 1e-3)
    position = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    weight = Aperture.of(position, WAVELENGTH).weight.reshape(5, 20)
    assert_allclose(weight, np.broadcast_to(weight[0], (5, 20)), atol=1e-9)
    assert_allclose(weight[0], weight[0, ::-1], atol=1e-9)
    assert weight[0, 0] < 0.01 < 0.99 < weight[0, 9]


def test_elements_at_one_place_share_its_weight():
    position = line(21)
    doubled = position[[*range(21), 4, 4, 20]]
    weight, twice = Aperture.of(position, WAVELENGTH).weight, Aperture.of(doubled, WAVELENGTH).weight
    assert_allclose(np.bincount([*range(21), 4, 4, 20], weights=twice), weight, rtol=1e-12)
    assert_allclose(Aperture.of(np.full((4, 3), 0.2), WAVELENGTH).weight, 0.25)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spread", "error"),
    [
        pytest.param(1e-6, 1e-3, id="every frequency by itself"),
        # Phases up to 0.25 rad off their group's weigh up to 3% less at either end, in noise, the worst of data.
        pytest.param(PHASE_SPREAD, 0.05, id="frequencies in groups"),
    ],
)
def test_ratio_equals_the_sum_over_all_pairs(monkeypatch, spread, error):
    """The phases, the groups of frequencies and the weights, against a plain float64 double sum."""
    monkeypatch.setattr(directions, "PHASE_SPREAD", spread)
    tx, rx = line(21), line(31, middle=(0.0, 0.0, 0.01))
    random = np.random.default_rng(2)
    s = random.standard_normal((FREQUENCY.size, 21, 31)) + 1j * random.standard_normal((FREQUENCY.size, 21, 31))
    sweep = make_sweep(s, frequency=FREQUENCY, tx_position=tx, rx_position=rx)
    view = view_of(tx, rx)
    u = np.array([-0.5, 0.1, 0.63])
    k = 2.0 * np.pi * FREQUENCY / speed_of_light
    taper = np.sin(np.pi * np.arange(1, k.size + 1) / (k.size + 1)) ** 2
    ring = np.linspace(-0.985, 0.985, 2 * int(np.ceil(0.985 * 2.0 * view.aperture_rx)) + 1)
    expected = []
    for own in u:
        levels = []
        for sine in [*ring, own]:
            out = np.linalg.norm(at(own, height=0.005) - tx, axis=1)
            back = np.linalg.norm(at(sine, height=0.005) - rx, axis=1)
            phase = np.exp(1j * k[:, None, None] * (out[:, None] + back))
            weight = taper[:, None, None] * hann(21)[:, None] * hann(31)
            levels.append(abs(np.sum(weight * sweep["s"].values.astype(complex) * phase)))
        expected.append(levels[-1] / max(levels))
    assert_allclose(direction_ratio(SweepWaves(sweep), view, np.full(3, RANGE), u), expected, rtol=error)


def thinned(missing):
    """Elements half a wavelength apart, without every so manieth."""
    places = line(90, pitch=0.5 * WAVELENGTH)
    return places[np.arange(90) % missing != missing - 1] if missing else places


@pytest.mark.parametrize(("missing", "lobe"), [(None, 0.0), (3, 0.5)])
def test_the_lobes_of_missing_antennas_are_known(missing, lobe):
    """Two of three antennas: the phases of two neighbours are a third of a turn apart in the direction of the lobe."""
    antennas = thinned(missing)
    found = SweepWaves(sweep_of(antennas, antennas, (at(0.0), at(0.0)))).grating_lobe
    assert found == pytest.approx(lobe, abs=0.06)


def test_a_lobe_as_high_as_the_main_one_accuses_nobody():
    antennas = line(40, pitch=1.5 * WAVELENGTH)
    assert SweepWaves(sweep_of(antennas, antennas, (at(0.0), at(0.0)))).grating_lobe < 0.1


@pytest.mark.parametrize(
    "places",
    [
        pytest.param([0, 1, 2, 3, 8, 13, 17], id="least redundant"),
        pytest.param([*range(4), *range(11, 15), *range(46, 54)], id="four chips in cascade"),
    ],
)
def test_a_true_echo_stays_whatever_receivers_are_missing(places):
    """Their lobes are nearly as high as the main one, but a lone echo has the ratio one."""
    tx, rx = line(9, pitch=2.0 * WAVELENGTH), 0.5 * WAVELENGTH * (np.array(places)[:, None] * [1.0, 0.0, 0.0])
    sweep, view = sweep_of(tx, rx, (at(0.1), at(0.1))), view_of(tx, rx)
    assert_array_equal(misplaced(echoes_at(view, np.array([0.1])), SweepWaves(sweep), view, {}), [""])


@pytest.mark.parametrize("missing", [None, 3])
def test_the_ghost_in_a_grating_lobe_is_left_out_and_the_echo_stays(missing):
    antennas = thinned(missing)
    sweep, view = sweep_of(antennas, antennas, (at(-0.3), at(-0.3))), view_of(antennas, antennas)
    ghost = -0.3 + 2.0 / 3.0  # of places three half wavelengths apart
    found = misplaced(echoes_at(view, np.array([-0.3, ghost])), SweepWaves(sweep), view, {})
    assert found[0] == ""
    assert missing is None or found[1] == MIXED


class TestConfocalShare:
    """What returns the way it went, and what leaves and arrives anyhow."""

    tx, rx = line(41, 0.5e-3), line(41, 0.5e-3, (0.0, 5e-3, 0.0))

    def share(self, *paths, u=0.1):
        waves = SweepWaves(sweep_of(self.tx, self.rx, *paths))
        return float(confocal_share(waves, view_of(self.tx, self.rx), np.array([RANGE]), np.array([u]))[0])

    def rough(self, seed, spread=0.3, count=60):
        """Directions of objects all about an echo, at its range."""
        return [at(sine) for sine in 0.1 + spread * (np.random.default_rng(seed).random(count) - 0.5)]

    def test_a_point_and_a_rough_surface_send_all_back(self):
        assert self.share((at(0.1), at(0.1))) > 0.9
        assert np.mean([self.share(*((place, place) for place in self.rough(seed))) for seed in range(8)]) > 0.85

    def test_of_what_leaves_and_arrives_anyhow_nothing_comes_back_the_way_it_went(self):
        anyhow = [list(zip(self.rough(2 * seed), self.rough(2 * seed + 1), strict=True)) for seed in range(8)]
        assert np.mean([self.share(*paths) for paths in anyhow]) < 0.35

    @pytest.mark.slow
    def test_of_both_together_it_is_in_between(self):
        shares = []
        for seed in range(12):
            once = [(place, place) for place in self.rough(3 * seed)]
            anyhow = list(zip(self.rough(3 * seed + 1), self.rough(3 * seed + 2), strict=True))
            shares.append(self.share(*once, *anyhow))
        # Of paths that leave and arrive anyhow, a beam holds fewer than of those to where it looks.
        assert 0.5 < np.mean(shares) < 0.97
        assert np.mean(shares) < np.mean([self.share(*((p, p) for p in self.rough(3 * seed))) for seed in range(12)])

    def test_one_antenna_or_an_echo_too_near_tells_nothing(self):
        waves = SweepWaves(sweep_of(self.tx, self.rx[:1], (at(0.1), at(0.1))))
        assert np.isnan(confocal_share(waves, view_of(self.tx, self.rx), np.array([RANGE]), np.array([0.1]))).all()
        near = 3.0 * float(np.ptp(self.tx[:, 0]))
        waves = SweepWaves(sweep_of(self.tx, self.rx, (at(0.1, near), at(0.1, near))))
        assert np.isnan(confocal_share(waves, view_of(self.tx, self.rx), np.array([near]), np.array([0.1]))).all()


@pytest.mark.nojit
def test_what_receivers_hear_from_a_place_is_the_sum_over_groups_of_frequencies():
    rng = np.random.default_rng(0)
    # Receivers about the middle of places at the distance r.
    receivers, places, r = 0.05 * rng.normal(size=(7, 3)), rng.normal(size=(4, 3)), 0.7
    places *= r / np.linalg.norm(places, axis=1, keepdims=True)
    turns = np.array([900.0, 1.5])  # of the first group, and from one to the next, for each metre
    field = rng.normal(size=(2, 5, 2, 7)).astype(np.float32)
    heard = np.empty((4, 2))
    single = (value.astype(np.float32) for value in (places, np.ascontiguousarray(receivers.T), np.float64(r), turns))
    directions._receive(*single, field, heard)
    phase = 2.0 * np.pi * (turns[0] + np.arange(5)[:, None, None] * turns[1]) * (cdist(places, receivers) - r)
    expected = np.einsum("gnx,mgx->nm", np.exp(1j * phase), field[:, :, 0] + 1j * field[:, :, 1])
    assert_allclose(heard, np.abs(expected), rtol=1e-4)


def test_directions_are_the_same_from_windows_of_range_as_from_all_frequencies(monkeypatch):
    tx = rx = line(41)
    frequency = np.linspace(290e9, 300e9, 401)
    k = 2.0 * np.pi * frequency[:, None, None] / speed_of_light
    places = np.array([at(sine, range_) for sine, range_ in ((0.1, 0.8), (-0.4, 1.3), (0.3, 2.2), (0.3, 2.5))])
    out = np.exp(-1j * k * cdist(tx, places))
    sweep = make_sweep(out @ out.swapaxes(1, 2), frequency=frequency, tx_position=tx, rx_position=rx)
    view, u = view_of(tx, rx), np.repeat([0.1, -0.4, 0.31, 0.2], 10)
    range_ = np.repeat([0.8, 1.3, 2.2, 2.5], 10) + np.tile(np.linspace(-5e-3, 5e-3, 10), 4)
    found = direction_ratio(SweepWaves(sweep), view, range_, u), confocal_share(SweepWaves(sweep), view, range_, u)
    monkeypatch.setattr(directions, "WORTH_WINDOWS", np.inf)
    assert_allclose(found[0], direction_ratio(SweepWaves(sweep), view, range_, u), atol=2e-3)
    assert_allclose(found[1], confocal_share(SweepWaves(sweep), view, range_, u), atol=2e-3)
