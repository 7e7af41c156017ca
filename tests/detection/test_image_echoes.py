"""Echoes: none in noise, none in side lobes, every point where it is, and nothing that depends on the units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import APERTURE, WAVELENGTH, diffuse, empty_view, radar_image, radar_view, together

from mirrorfold.common.decibels import ratio_of
from mirrorfold.detection.echoes import FALSE_ALARMS, noise_level, reference_echo
from mirrorfold.detection.image_echoes import (
    FAINT_DB,
    THRESHOLD_DB,
    _reference,
    find_pixels,
    find_ridges,
    noise_floor,
)
from mirrorfold.detection.views.image_to_view import to_image_view


def decibel(ratio):
    return 20.0 * np.log10(ratio)


def off(view, echoes, point):
    """Distance of echoes from a point in range cells and in cells of u, two arrays."""
    range_, u = view.to_polar(np.asarray(point))
    return np.abs(echoes.range - range_) / view.range_cell, np.abs(view.to_polar(echoes.position)[1] - u) / view.u_cell


@pytest.mark.parametrize("seed", range(8))
def test_noise_alone_holds_no_echo(seed):
    view = radar_view(np.empty((0, 2)), np.empty(0), noise=1.0, seed=seed)
    assert view.amplitude.size > 100_000
    echoes = find_ridges(view)
    assert echoes.range.size == 0
    assert echoes.reference == 0.0


def test_a_complex_image_of_noise_alone_holds_no_echo():
    x, y = np.arange(-0.8, 0.8, 0.006), np.arange(0.4, 1.8, 0.006)
    image = radar_image(np.empty((0, 2)), np.empty(0), x, y)
    random = np.random.default_rng(4)
    for _ in range(3):
        noise = random.standard_normal(image.shape) + 1j * random.standard_normal(image.shape)
        assert find_ridges(to_image_view(image.copy(data=noise))).range.size == 0


def test_the_noise_floor_is_where_rayleigh_noise_is_expected_to_exceed_it_a_thousandth_of_a_time():
    view = radar_view(np.empty((0, 2)), np.empty(0), noise=0.3)
    k = np.sqrt(2.0 * np.log(view.amplitude.size / FALSE_ALARMS))
    assert view.amplitude.size * np.exp(-(k**2) / 2) == pytest.approx(1e-3)
    # `noise` is the standard deviation of the complex samples.
    assert_allclose(noise_floor(view), k * 0.3 / np.sqrt(2.0) * view.range, rtol=0.02)


@pytest.mark.parametrize(("range_", "u", "seed"), [(0.8, 0.0, 0), (1.533, 0.347, 1), (2.217, -0.611, 2)])
def test_a_point_in_noise_is_found_within_a_fraction_of_a_cell(range_, u, seed):
    point = empty_view().to_points(range_, u)
    # 26 dB above the mean power of the noise at its range.
    view = radar_view(point[None], np.array([1.0]), noise=0.05 / range_, seed=seed)
    echoes = find_ridges(view)
    assert echoes.range.size > 0
    in_range, in_u = off(view, echoes, point)
    assert in_range.max() < 1.0
    assert in_u.max() < 1.0
    best = np.argmax(echoes.amplitude)
    assert in_range[best] < 0.1
    assert in_u[best] < 0.1
    assert echoes.amplitude[best] == pytest.approx(1.0, rel=0.2)
    assert_allclose(echoes.position[best], view.to_points(echoes.range[best], view.to_polar(echoes.position)[1][best]))


def test_side_lobes_of_a_bright_point_are_not_echoes_but_weak_points_are():
    bright = np.array([0.05, 1.5])
    u = np.linspace(-0.75, 0.75, 24)
    weak = empty_view().to_points(np.tile([0.9, 1.9, 1.2, 2.3], 6), u)
    points = np.concatenate([bright[None], weak])
    # A glint 35 dB brighter than the rest.
    view = radar_view(points, np.array([56.0, *np.ones(24)]))
    echoes = find_ridges(view)
    row = np.argmin(np.abs(view.range - np.linalg.norm(bright)))
    _, u = view.to_polar(bright)
    first_lobe = np.abs(view.u - u) * view.aperture_tx
    assert view.amplitude[row, (first_lobe > 1.2) & (first_lobe < 1.8)].max() > 2.0 * echoes.threshold
    nearest = np.full(echoes.range.size, np.inf)
    for point in points:
        nearest = np.minimum(nearest, np.maximum(*off(view, echoes, point)))
    # Faint echoes may be lobes in range, which are 31 dB down and more.
    assert nearest[echoes.strong].max() < 1.0
    for point in points:
        assert np.maximum(*off(view, echoes, point)).min() < 0.1


def test_the_bound_on_side_lobes_lies_above_them_but_not_far():
    view = radar_view(np.array([[0.0, 1.5]]), np.array([1.0]))
    claim = view.side_lobes
    row = np.argmin(np.abs(view.range - 1.5))
    distance = np.abs(view.u)
    beside = (distance > 2.0 * view.u_cell) & (distance < 0.6)
    true = view.amplitude[row, beside]
    envelope = view.amplitude[row].max() / (np.pi * APERTURE / WAVELENGTH * distance[beside]) ** 2
    assert (claim[row, beside] >= 0.999 * true).all()
    # Steps in distance are a factor of 1.3, and the envelope falls with its square.
    assert (claim[row, beside] >= 0.99 * envelope).all()
    assert (claim[row, beside] <= 2.0 * envelope).all()
    assert claim[row, distance < view.u_cell].max() < 0.1


def test_side_lobes_stay_at_their_range_and_in_their_direction():
    view = empty_view()
    amplitude = view.amplitude.copy()
    amplitude[100, 200] = 1.0
    claim = replace(view, amplitude=amplitude).side_lobes
    assert claim[100].max() > 0.0
    assert claim[:, 200].max() > 0.0
    assert not np.delete(np.delete(claim, 100, axis=0), 200, axis=1).any()
    square = replace(view, range=view.range[:200], u=view.u[100:300], amplitude=amplitude[:200, 100:300]).side_lobes
    assert_allclose(square[:, 100], claim[:200, 200], rtol=1e-9)
    unknown = replace(view, amplitude=amplitude, window=np.zeros(0)).side_lobes
    np.testing.assert_array_equal(unknown[100], claim[100])
    assert not np.delete(unknown, 100, axis=0).any()


def test_the_bound_on_side_lobes_in_range_lies_above_them_but_not_far():
    view = radar_view(np.array([[0.0, 1.5]]), np.array([1.0]))
    column = int(view.column(np.array(0.0)))
    distance = np.abs(view.range - 1.5)
    beside = (distance > 2.0 * view.range_cell) & (distance < 0.4)
    true, claim = view.amplitude[beside, column], view.side_lobes[beside, column]
    x = 2.0 * distance[beside] / view.range_cell
    envelope = view.amplitude[:, column].max() / (np.pi * x * (x**2 - 1.0))
    assert (claim >= 0.9 * true).all()  # the peak lies between two samples
    # Steps in distance are a factor of 1.1, and the envelope falls with its cube.
    assert (claim >= 0.75 * envelope).all()
    assert (claim <= 1.7 * envelope).all()


@pytest.mark.slow
def test_side_lobes_in_range_of_a_glint_are_no_echoes_and_a_weak_point_beside_them_is_one():
    """A glint 45 dB over the wall, as of a corner, is not surrounded by echoes; one 30 dB below it is found."""
    wall, glint, weak = diffuse((-0.9, 1.2), (-0.3, 1.3), 1), np.array([0.2, 2.0]), np.array([0.2, 2.2])
    level = 180.0 * 3.0
    view = radar_view(*together(wall, (np.array([glint, weak]), level * np.array([1.0, 10.0**-1.5]))), noise=1e-4)
    echoes = find_ridges(view)
    away = [np.hypot(*np.array(off(view, echoes, place))) for place in (glint, weak)]
    beyond = echoes.position[:, 0] > 0.0
    assert away[1].min() < 0.5
    assert np.minimum(*away)[beyond].max() < 2.0
    blind = find_ridges(replace(view, window=np.zeros(0)))
    assert np.count_nonzero(blind.position[:, 0] > 0.0) > 1.5 * np.count_nonzero(beyond)


@pytest.fixture
def usual():
    """Brightest echoes of 300 directions, spread as diffuse surfaces are."""
    return np.random.default_rng(3).rayleigh(size=300)


def test_a_few_glints_do_not_raise_the_reference(usual):
    glints = np.full(4, 56.0 * np.median(usual))
    assert abs(decibel(reference_echo(np.concatenate([usual, glints])) / reference_echo(usual))) < 1.0


def test_many_faint_directions_do_not_lower_the_reference(usual):
    """As many directions with multiple scattering alone move it by less than a fifth of the threshold."""
    faint = np.full(300, 0.03 * np.median(usual))
    assert abs(decibel(reference_echo(np.concatenate([usual, faint])) / reference_echo(usual))) < -0.2 * THRESHOLD_DB


def test_glints_in_a_fifth_of_few_directions_do_not_set_the_reference():
    """As where the beam is wide: of a wall straight ahead and of objects, 35 dB over what is diffuse."""
    diffuse, glints = np.random.default_rng(4).rayleigh(size=40), np.full(10, 56.0)
    assert abs(decibel(reference_echo(np.concatenate([diffuse, glints])) / reference_echo(diffuse))) < 10.0


def test_the_reference_is_among_the_usual_echoes_and_scales_with_them(usual):
    reference = reference_echo(usual)
    assert np.median(usual) <= reference < np.quantile(usual, 0.8)
    assert reference_echo(1e-7 * usual) == pytest.approx(1e-7 * reference)
    assert reference_echo(np.concatenate([usual, np.zeros(1000)])) == reference
    assert reference_echo(np.zeros(5)) == 0.0
    assert reference_echo(np.full(9, 2.5)) == 2.5


def test_directions_in_which_noise_hides_echoes_count_with_its_level():
    """Glints and their lobes in twelve directions, some of a rough wall above the noise, and nothing in all others."""
    seen = np.concatenate([np.full(12, 10.0), np.full(12, 0.6), np.zeros(276)])
    alone = reference_echo(seen)
    assert alone > 5.0
    for level, expected in ((0.5 * ratio_of(THRESHOLD_DB + FAINT_DB) * alone, alone), (0.55, 0.55)):
        assert _reference(seen, np.linspace(0.5, 1.5, 9) * level, THRESHOLD_DB) == expected
    assert _reference(np.zeros(9), np.ones(3), THRESHOLD_DB) == 0.0


@pytest.fixture(scope="module")
def wall():
    """A rough wall with a weak point before it, in noise."""
    points, amplitude = together(diffuse((-0.5, 1.4), (0.4, 1.7), seed=1), ([[-0.3, 0.9]], [1.0]))
    return radar_view(points, amplitude, noise=0.02)


@pytest.mark.parametrize("factor", [1e-9, 3.7, 2.0**40])
def test_only_amplitudes_depend_on_the_unit_of_the_image(wall, factor):
    one, other = find_ridges(wall), find_ridges(replace(wall, amplitude=factor * wall.amplitude))
    assert one.range.size > 100
    for name in ("position", "range", "direction", "length"):
        assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9, atol=1e-9)
    assert_array_equal(other.strong, one.strong)
    for name in ("amplitude", "threshold", "reference"):
        assert_allclose(getattr(other, name), factor * np.asarray(getattr(one, name)), rtol=1e-12)


def test_strong_echoes_are_those_above_the_threshold_and_faint_ones_end_below_it(wall):
    echoes = find_ridges(wall)
    assert decibel(echoes.threshold / echoes.reference) == pytest.approx(THRESHOLD_DB)
    assert_array_equal(echoes.strong, echoes.amplitude >= echoes.threshold)
    assert not echoes.strong.all()
    assert decibel(echoes.amplitude.min() / echoes.threshold) >= FAINT_DB


def test_a_deeper_threshold_only_adds_echoes(wall):
    high, low = find_ridges(wall, threshold_db=-6.0), find_ridges(wall, threshold_db=-12.0)
    assert 0 < high.strong.sum() < low.strong.sum()
    low_places = {tuple(p) for p in low.position[low.strong]}
    assert {tuple(p) for p in high.position[high.strong]} <= low_places


def test_the_echoes_of_a_wall_lie_on_it_and_their_lengths_add_up_to_it(wall):
    echoes = find_ridges(wall)
    direction = np.array([0.9, 0.3]) / np.hypot(0.9, 0.3)
    offset = echoes.position - [-0.5, 1.4]
    along, beside = offset @ direction, offset @ [-direction[1], direction[0]]
    on_it = np.abs(beside) < 0.03
    # All but the point in front of it.
    assert on_it.sum() > 0.8 * on_it.size
    assert along[on_it].min() > -0.05
    assert along[on_it].max() < 1.0
    assert np.abs(np.average(beside[on_it], weights=echoes.amplitude[on_it])) < 0.003
    assert 0.7 < echoes.length[on_it].sum() / np.hypot(0.9, 0.3) < 2.0


def test_taking_echoes_takes_the_same_ones_of_every_array(wall):
    echoes = find_ridges(wall)
    some = echoes.take(np.array([5, 2]))
    assert_array_equal(some.position, echoes.position[[5, 2]])
    for name in ("range", "direction", "amplitude", "length", "strong", "visible", "noise", "limit"):
        assert_array_equal(getattr(some, name), getattr(echoes, name)[[5, 2]])
    assert (some.threshold, some.reference) == (echoes.threshold, echoes.reference)
    assert_array_equal(echoes.take(echoes.strong).amplitude, echoes.amplitude[echoes.strong])


def test_as_published_every_pixel_above_the_threshold_counts_and_counts_alike(wall):
    found = find_pixels(wall, threshold_db=-20.0)
    brightest = wall.amplitude.max()
    assert found.reference == brightest
    assert found.threshold == pytest.approx(0.1 * brightest)
    assert found.range.size == np.count_nonzero(wall.amplitude >= 0.1 * brightest)
    assert_array_equal(found.amplitude, 1.0)
    assert found.strong.all()
    assert_allclose(wall.power_at(*wall.to_polar(found.position)).min(), 0.01 * brightest**2, rtol=0.1)
    assert find_pixels(wall, threshold_db=-30.0).range.size > found.range.size


def test_published_pixels_weigh_with_their_area_on_the_floor_plan():
    view = empty_view()
    amplitude = view.amplitude.copy()
    rows, columns = slice(30, 200), slice(10, -10)
    amplitude[rows, columns] = 1.0
    found = find_pixels(replace(view, amplitude=amplitude), threshold_db=-10.0)
    first, last = view.range[rows][0] - 0.5 * view.dr, view.range[rows][-1] + 0.5 * view.dr
    angle = np.arcsin(view.u[columns][-1] + 0.5 * view.du) - np.arcsin(view.u[columns][0] - 0.5 * view.du)
    area = 0.5 * angle * (last**2 - first**2)
    assert found.length.sum() * view.range_cell == pytest.approx(area, rel=0.01)


def test_an_empty_image_holds_nothing():
    assert find_ridges(empty_view()).range.size == 0
    assert find_pixels(empty_view(), threshold_db=-30.0).range.size == 0


@pytest.mark.parametrize("cut_db", [-60.0, -45.0, -30.0])
def test_where_faint_pixels_were_set_to_zero_all_others_are_heard(cut_db):
    """As other programs store images: what is left is no noise, and no reason to hear less."""
    x, y = np.arange(-0.8, 0.8, 0.006), np.arange(0.4, 1.8, 0.006)
    random = np.random.default_rng(1)
    places = np.column_stack([random.uniform(-0.6, 0.6, 40), random.uniform(0.6, 1.6, 40)])
    image = np.abs(radar_image(places, np.ones(40), x, y))
    cut = image.where(image >= float(image.max()) * 10.0 ** (cut_db / 20.0), 0.0)
    assert (cut == 0.0).mean() > 0.1
    whole, left = (find_ridges(to_image_view(one)) for one in (image, cut))
    loud = whole.amplitude > whole.amplitude.max() * 10.0 ** (max(cut_db + 6.0, -20.0) / 20.0)
    away = np.linalg.norm(whole.position[loud][:, None] - left.position, axis=2).min(axis=1)
    assert loud.sum() > 20
    assert np.mean(away < 0.012) > 0.9


@pytest.mark.parametrize("share", [0.1, 0.6, 0.9])
def test_pixels_that_were_masked_do_not_change_the_noise(share):
    x, y = np.arange(-0.8, 0.8, 0.006), np.arange(0.4, 1.8, 0.006)
    image = radar_image(np.empty((0, 2)), np.empty(0), x, y)
    random = np.random.default_rng(4)
    noise = image.copy(data=random.standard_normal(image.shape) + 1j * random.standard_normal(image.shape))
    masked = noise.where(image.y < np.quantile(y, 1.0 - share), 0.0)
    assert noise_level(masked.values) == pytest.approx(1.0, rel=0.02)
    assert noise_level(np.zeros((5, 5))) == 0.0
    assert find_ridges(to_image_view(masked)).range.size == 0
