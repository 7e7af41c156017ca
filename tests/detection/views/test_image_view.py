"""The radar's own view: that resampling moves nothing, and that cells are as wide as the physics makes them.

`radar_view` and `radar_image` build what a radar would see of given scatterers from its point-spread function alone;
the tests of the later steps use them too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.constants import speed_of_light
from synthetic import RANGE_CELL, U_CELL, WAVELENGTH, empty_view, radar_image, radar_view

import mirrorfold as mf
from mirrorfold.detection.views.image_to_view import to_image_view
from mirrorfold.detection.views.image_view import LARGEST_SINE, ImageView
from mirrorfold.detection.views.view import check_samples
from mirrorfold.sweep import make_sweep


def peak(view, range_, u):
    """Place and height of the maximum near (range, u), by parabolas through the logarithm: exact for Gaussians."""
    row, column = round((range_ - view.range[0]) / view.dr), round((u - view.u[0]) / view.du)
    around = view.amplitude[row - 3 : row + 4, column - 3 : column + 4]
    i, j = np.unravel_index(np.argmax(around), around.shape)
    i, j = i + row - 3, j + column - 3
    height = np.log(view.amplitude[i, j])
    place = []
    for before, after in (
        np.log(view.amplitude[[i - 1, i + 1], j]),
        np.log(view.amplitude[i, [j - 1, j + 1]]),
    ):
        offset = 0.5 * (before - after) / (before - 2.0 * np.log(view.amplitude[i, j]) + after)
        height -= 0.25 * (before - after) * offset
        place.append(offset)
    return view.range[i] + place[0] * view.dr, view.u[j] + place[1] * view.du, np.exp(height)


def gaussian_image(targets, x, y, **attrs):
    """Gaussian echoes of half-amplitude widths RANGE_CELL and U_CELL at (range, u, height), with the carrier."""
    image = radar_image(np.empty((0, 2)), np.empty(0), x, y)
    image.attrs |= attrs
    view = empty_view(image.attrs["radar_position"][:2])
    range_, u = view.to_polar(np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1))
    values = np.zeros(image.shape, dtype=complex)
    for r0, u0, height in targets:
        exponent = 4.0 * np.log(2.0) * (((range_ - r0) / RANGE_CELL) ** 2 + ((u - u0) / U_CELL) ** 2)
        values += height * np.exp(-exponent) * np.exp(4j * np.pi / WAVELENGTH * (range_ - r0))
    return image.copy(data=values.astype(np.complex64))


GRID = np.arange(-0.5, 0.5, 0.004), np.arange(0.5, 1.4, 0.004)


@given(
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.floats(-180.0, 180.0),
    st.floats(0.1, 10.0),
    st.floats(-LARGEST_SINE, LARGEST_SINE),
)
def test_points_survive_the_way_to_the_radars_view_and_back(radar, direction, range_, u):
    view = empty_view(radar, direction)
    point = view.to_points(range_, u)
    assert_allclose(np.linalg.norm(point - view.radar), range_, rtol=1e-12)
    assert_allclose(view.to_polar(point), (range_, u), rtol=0, atol=1e-12)


def test_a_point_on_the_right_of_broadside_has_a_positive_u_and_one_behind_the_array_none():
    view = empty_view(radar=(1.0, 2.0), direction=90.0)  # looks along -x
    range_, u = view.to_polar([[-1.0, 4.0], [0.0, 1.0], [3.0, 2.0]])
    assert_allclose(range_, np.sqrt([8.0, 2.0, 4.0]))
    assert_allclose(u[:2], [np.sqrt(0.5), -np.sqrt(0.5)])
    assert np.isnan(u[2])


def test_the_cell_across_the_line_of_sight_is_what_a_step_in_u_spans():
    view = empty_view()
    for range_, u in ((0.7, 0.0), (2.0, 0.6), (1.3, -0.9)):
        ends = view.to_points(np.full(2, range_), np.array([u - 0.5e-3, u + 0.5e-3]))
        point = view.to_points([range_], [u])
        assert_allclose(view.cross_cell(point), np.linalg.norm(ends[1] - ends[0]) / 1e-3 * view.u_cell, rtol=1e-4)


@pytest.mark.slow
def test_power_is_smooth_between_samples_of_speckle_and_zero_outside_of_the_view():
    """To a few percent of the brightest, of speckle that was sampled eight times as finely."""
    random = np.random.default_rng(0)
    points = empty_view().to_points(random.uniform(0.9, 1.1, 40), random.uniform(-0.1, 0.1, 40))
    amplitude = random.standard_normal(40) + 1j * random.standard_normal(40)
    coarse, fine = (radar_view(points, amplitude, samples=samples) for samples in (3, 24))
    range_, u = np.meshgrid(fine.range[(fine.range > 0.9) & (fine.range < 1.1)], fine.u[abs(fine.u) < 0.1])
    true = fine.amplitude[np.ix_((fine.range > 0.9) & (fine.range < 1.1), abs(fine.u) < 0.1)].T ** 2
    assert_allclose(coarse.power_at(range_, u), true, atol=0.05 * true.max())
    assert_allclose(coarse.power_at([0.1, 9.0, 1.0, 1.0], [0.0, 0.0, 0.99, np.nan]), 0.0)


def test_resampling_keeps_place_and_height_of_echoes_whatever_the_carrier_does():
    targets = [(0.83, 0.12, 1.0), (1.1, -0.3, 3.0), (1.26, 0.05, 0.5)]
    view = to_image_view(gaussian_image(targets, *GRID), normalization="none")
    assert view.range_cell == pytest.approx(RANGE_CELL)
    assert view.u_cell == pytest.approx(U_CELL)
    for r0, u0, height in targets:
        range_, u, found = peak(view, r0, u0)
        assert abs(range_ - r0) < 0.01 * view.range_cell
        assert abs(u - u0) < 0.01 * view.u_cell
        assert found == pytest.approx(height, rel=0.01)


def test_the_radars_place_and_the_turn_of_its_array_are_those_of_the_attrs():
    points = np.array([[0.1, 1.0], [-0.2, 1.2]])
    x, y = np.arange(-0.5, 0.5, 0.004), np.arange(0.8, 1.4, 0.004)
    image = radar_image(points, np.array([1.0, 1.0]), x, y, radar=(0.3, 0.1), direction=25.0)
    view = to_image_view(image)
    assert_allclose(view.radar, [0.3, 0.1])
    assert_allclose(view.along, [np.cos(np.radians(25.0)), np.sin(np.radians(25.0))])
    for point in points:
        range_, u, height = peak(view, *(float(v) for v in view.to_polar(point)))
        assert_allclose(view.to_points(range_, u), point, atol=5e-4)
        assert height == pytest.approx(1.0, rel=0.03)


def test_the_radar_looks_to_the_side_where_the_image_is():
    x, y = np.arange(-0.5, 0.5, 0.004), np.arange(-1.4, -0.5, 0.004)
    values = np.zeros((y.size, x.size))
    values[100, 150] = 1.0
    view = to_image_view(xr.DataArray(values, dims=("y", "x"), coords={"y": y, "x": x}), normalization="none")
    assert_allclose(view.broadside, [0.0, -1.0])
    i, j = np.unravel_index(np.argmax(view.amplitude), view.amplitude.shape)
    assert_allclose(view.to_points(view.range[i], view.u[j]), [x[150], y[100]], atol=0.008)


@pytest.mark.parametrize(("normalization", "power"), [("none", 0), ("r", 1), ("r2", 2)])
def test_normalization_multiplies_with_a_power_of_range(normalization, power):
    image = gaussian_image([(0.9, 0.1, 1.0), (1.2, -0.2, 1.0)], *GRID)
    plain = to_image_view(image, normalization="none")
    view = to_image_view(image, normalization=normalization)
    assert view.power == power
    assert plain.amplitude.max() > 0.9
    assert_allclose(view.amplitude, plain.amplitude * plain.range[:, None] ** power, rtol=1e-12)


def test_by_default_spreading_is_undone_as_in_two_dimensions():
    image = gaussian_image([(0.9, 0.1, 1.0 / 0.9), (1.2, -0.2, 1.0 / 1.2)], *GRID)
    view = to_image_view(image)
    assert_allclose([peak(view, 0.9, 0.1)[2], peak(view, 1.2, -0.2)[2]], 1.0, rtol=0.015)


def test_the_view_ends_at_the_ambiguous_range_and_at_the_image():
    image = gaussian_image([], *GRID)
    farthest = np.hypot(GRID[0][0], GRID[1][-1])
    assert to_image_view(image).range[-1] == pytest.approx(farthest, abs=0.011)
    wrapped = to_image_view(image.assign_attrs(ambiguous_range=1.0))
    assert wrapped.range[-1] == pytest.approx(1.0 - wrapped.range_cell, abs=wrapped.dr)
    assert to_image_view(image).range[0] == pytest.approx(0.5, abs=0.011)
    assert np.abs(to_image_view(image).u).max() <= LARGEST_SINE


def test_an_image_that_knows_nothing_of_its_radar_is_seen_from_the_origin():
    x, y = np.linspace(-0.5, 0.5, 101), np.linspace(0.5, 1.5, 101)
    values = np.exp(-(((x - 0.2) / 0.03) ** 2) - ((y[:, None] - 1.1) / 0.03) ** 2)
    view = to_image_view(xr.DataArray(values, dims=("y", "x"), coords={"y": y, "x": x}), normalization="none")
    assert_allclose(view.radar, 0.0)
    assert view.range_cell == pytest.approx(0.02)
    i, j = np.unravel_index(np.argmax(view.amplitude), view.amplitude.shape)
    assert_allclose(view.to_points(view.range[i], view.u[j]), [0.2, 1.1], atol=0.005)
    assert view.amplitude.max() == pytest.approx(1.0, rel=0.05)


def focused_point(elements, pitch, points, x, y, **given):
    """The view of a point 1.2 m before an array, 10 GHz wide, and the range, the u and the height of its echo."""
    position, target = np.zeros((elements, 3)), np.array([0.0, 1.2])
    position[:, 0] = pitch * (np.arange(elements) - elements // 2)
    frequency = np.linspace(290e9, 300e9, points)
    distance = np.linalg.norm(position[:, :2] - target, axis=1)
    s = np.exp(-2j * np.pi * frequency[:, None, None] / speed_of_light * (distance[:, None] + distance))
    sweep = make_sweep(s, frequency=frequency, tx_position=position, rx_position=position)
    view = to_image_view(mf.focus(sweep, x=x, y=y, **given), normalization="none")
    return view, *peak(view, 1.2, 0.0)


def widths(view, range_, u, height):
    """Widths of an echo between half amplitudes in range and in u, in resolution cells."""
    fine = np.linspace(-1.0, 1.0, 2001)
    lobes = (
        view.power_at(range_ + fine * view.range_cell, np.full(2001, u)),
        view.power_at(np.full(2001, range_), u + fine * view.u_cell),
    )
    return [np.ptp(fine[lobe >= (0.5 * height) ** 2]) for lobe in lobes]


@pytest.mark.slow
def test_the_resolution_cells_are_those_of_a_focused_point_target():
    x, y = np.arange(-0.1, 0.1, 0.002), np.arange(1.1, 1.3, 0.002)
    view, range_, u, height = focused_point(81, 0.5e-3, 201, x, y)
    assert abs(range_ - 1.2) < 0.01 * view.range_cell
    assert abs(u) < 0.01 * view.u_cell
    assert widths(view, range_, u, height) == pytest.approx([1.0, 1.0], abs=0.1)


@pytest.mark.parametrize("apodization", ["uniform", "hann"])
@pytest.mark.parametrize("taper", ["uniform", "taylor", "triangular", "hann"])
def test_the_cells_are_those_of_the_windows(taper, apodization):
    """Of a point before a short array, near broadside."""
    x, y = np.arange(-0.15, 0.15, 0.003), np.arange(1.1, 1.3, 0.002)
    view, *echo = focused_point(41, 1e-3, 101, x, y, taper=taper, apodization=apodization)
    in_range, in_u = widths(view, *echo)
    assert in_range == pytest.approx(1.0, abs=0.06)
    assert in_u == pytest.approx(1.0, abs=0.08)
    assert view.range_unit == pytest.approx(0.5 * speed_of_light / 10.1e9, rel=1e-3)


@pytest.mark.parametrize("step", [1.0, 1.0 + 1e-15, 1.0 - 1e-15])
def test_side_lobes_are_the_same_to_both_sides_whatever_rounding_did(step):
    """Of a view, and of the same with left and right exchanged."""
    amplitude = np.random.default_rng(1).rayleigh(size=(12, 81))
    u = 0.004 * step * (np.arange(81) - 40)
    view = ImageView(np.zeros(2), np.array([1.0, 0.0]), np.array([0.0, 1.0]), 1.0 + 0.005 * np.arange(12), u, amplitude,
                     1.0, 0.015, 0.012 * step, 80.0, 80.0)  # fmt: skip
    turned = replace(view, amplitude=amplitude[:, ::-1])
    np.testing.assert_array_equal(turned.side_lobes, view.side_lobes[:, ::-1])
    one = replace(view, amplitude=np.where(np.arange(81) == 40, 1.0, 0.0) * np.ones((12, 1))).side_lobes[0]
    assert (one[37:44] == 0.0).all()
    assert one[36] == one[44] > 0.0


def broken(image, **what):
    values, x = image.values.copy(), image["x"].values.copy()
    if "value" in what:
        values[3, 4] = what["value"]
    if "bend" in what:
        x[10] += what["bend"] * (x[1] - x[0])
    if "flip" in what:
        x = x[::-1]
    return xr.DataArray(values, dims=("y", "x"), coords={"y": image["y"].values, "x": x})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda i: broken(i, value=np.nan), "1 of 2000 pixels are not finite"),
        (lambda i: broken(i, value=np.inf), "1 of 2000 pixels are not finite"),
        (lambda i: broken(i, bend=0.3), "coordinate x does not rise in equal steps"),
        (lambda i: broken(i, flip=True), "coordinate x does not rise in equal steps"),
        (lambda i: i.expand_dims("z"), "has dimensions .*z.*expected an image"),
        (lambda i: i.transpose("x", "y"), "has dimensions"),
        (lambda i: i.values, "has dimensions ndarray"),
        (lambda i: i[:3], "axis y needs a coordinate .* at least 4 pixels"),
        (lambda i: i.drop_vars("x"), "axis x needs a coordinate"),
        (lambda i: 20 * np.log10(abs(i) / abs(i).max() + 1e-6), "nearly all values are negative, as levels in dB are"),
        (lambda i: i.real > 0, "holds values of type bool"),
    ],
)
def test_what_is_no_image_is_refused_in_one_sentence(image, change, message):
    with pytest.raises(mf.InputError, match=message) as caught:
        check_samples(change(image), ("y", "x"))
    assert str(caught.value).startswith("image: ")
    assert "\n" not in str(caught.value)


def test_a_valid_image_passes_unchanged(image):
    for valid in (image, image.real):
        before = valid.copy(deep=True)
        check_samples(valid, ("y", "x"))
        xr.testing.assert_identical(valid, before)


def test_an_image_smaller_than_a_resolution_cell_is_refused():
    x = y = np.linspace(1.0, 1.003, 5)
    with pytest.raises(mf.InputError, match="too small"):
        to_image_view(gaussian_image([], x, y))


def test_an_unknown_normalization_is_refused_with_the_known_ones(image):
    with pytest.raises(mf.InputError, match=r"'r3', expected one of none, r, r2"):
        to_image_view(image, normalization="r3")


def test_an_image_with_a_normalization_that_is_unknown_is_refused(image):
    with pytest.raises(mf.InputError, match=r"image: normalization is 'r4', expected one of none, r, r2"):
        to_image_view(image.assign_attrs(normalization="r4"))


def test_a_scene_far_away_is_seen_in_the_cells_of_its_ground():
    """From 45 degrees above, ranges differ by less than distances on the ground; ranges count from the scene's own."""
    x = y = np.arange(-40.0, 40.0, 0.25)
    known = {"frequency_start": 9.3e9, "frequency_stop": 9.9e9, "frequency_points": 401, "tx_aperture": 400.0}
    known |= {"rx_aperture": 400.0, "ambiguous_range": 100.0, "array_direction": (1.0, 0.0, 0.0)}
    image = xr.DataArray(np.ones((y.size, x.size)), dims=("y", "x"), coords={"y": y, "x": x}, attrs=known)
    flat, steep = (to_image_view(image.assign_attrs(radar_position=(0.0, -5000.0, h))) for h in (0.0, 5000.0))
    assert flat.range[[0, -1]] == pytest.approx([4960.0, 5040.0], abs=1.0)
    assert steep.range_cell / flat.range_cell == pytest.approx(np.sqrt(2.0), rel=0.01)
    assert np.abs(flat.to_points(flat.range[-1], flat.u[[0, -1]])[:, 0]) == pytest.approx(40.0, abs=1.0)


def test_one_antenna_that_sends_and_hears_resolves_as_one_array_of_twice_the_length():
    image = gaussian_image([], *GRID).assign_attrs(frequency_start=290e9, frequency_stop=300e9, frequency_points=401,
                                                   tx_aperture=0.08, rx_aperture=0.08)  # fmt: skip
    two, one = to_image_view(image), to_image_view(image.assign_attrs(monostatic=True))
    assert two.u_cell / one.u_cell == pytest.approx(np.sqrt(2.0))
    aside = np.array([0.1, 0.15, 0.2, 0.25, 0.3, 0.4])
    over = {}
    for view, lobes in ((two, lambda x: x**-2), (one, lambda x: 0.5 / x)):
        seen = replace(view, range=view.range[:3], amplitude=np.zeros((3, view.u.size)))
        seen.amplitude[1, view.column(np.array(-0.1))] = 1.0
        envelope = lobes(np.pi * 0.08 / view.wavelength * aside)
        over[view.one_way] = seen.side_lobes[1, view.column(-0.1 + aside)] / envelope
    # A bound on lobes is no lower than their envelope, and no higher than that 30 % nearer to the echo.
    for one_way, highest in ((False, 1.3**2), (True, 1.3)):
        assert over[one_way].min() >= 1.0
        assert over[one_way].max() <= highest


def test_one_transmitter_or_one_receiver_resolves_as_the_other_array_does():
    """The band tells the range cell as before, and one aperture is wider in u than two by the square root of two."""
    image = gaussian_image([], *GRID).assign_attrs(frequency_start=290e9, frequency_stop=300e9, frequency_points=401,
                                                   tx_aperture=0.08, rx_aperture=0.08)  # fmt: skip
    both = to_image_view(image)
    for single in ("tx_aperture", "rx_aperture"):
        one = to_image_view(image.assign_attrs({single: 0.0}))
        assert (one.range_cell, one.wavelength) == (both.range_cell, both.wavelength)
        assert one.u_cell / both.u_cell == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize("missing", ["frequency_start", "frequency_stop", "frequency_points"])
def test_an_image_that_tells_a_part_of_its_band_is_seen_as_one_that_tells_nothing(missing):
    image = gaussian_image([], *GRID).assign_attrs(frequency_start=290e9, frequency_stop=300e9, frequency_points=401,
                                                   tx_aperture=0.08, rx_aperture=0.08)  # fmt: skip
    bare = image.copy()
    bare.attrs = {"radar_position": image.attrs["radar_position"]}
    del image.attrs[missing]
    view, bare = to_image_view(image), to_image_view(bare)
    assert np.isinf(view.wavelength)
    assert (view.range_cell, view.u_cell, view.window.size) == (bare.range_cell, bare.u_cell, 0)


@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.int16, np.uint32, np.int64])
def test_integer_pixels_are_seen_as_the_same_numbers_with_a_point(dtype):
    image = np.abs(gaussian_image([(0.9, 0.1, 1.0), (1.1, -0.2, 0.3)], *GRID))
    signs = np.where(np.arange(image.sizes["x"]) % 2, -1.0, 1.0) if np.dtype(dtype).kind == "i" else 1.0
    few = np.rint(60.0 * signs * image / image.max())
    seen, expected = (to_image_view(few.astype(kind)).amplitude for kind in (dtype, float))
    assert_allclose(seen, expected, rtol=1e-6)
    assert (seen != np.rint(seen)).any()


def test_an_image_aside_of_where_the_array_looks_is_refused():
    image = radar_image(np.empty((0, 2)), np.empty(0), np.arange(5.0, 6.0, 0.02), np.arange(0.02, 0.9, 0.02))
    with pytest.raises(mf.InputError, match=r"80 degrees aside .* focus a larger grid ahead"):
        to_image_view(image)


@pytest.mark.parametrize(
    ("taper", "count"),
    [
        ("hann", 401),
        ("kaiser", 0),
        (np.linspace(0.5, 1.0, 401), 401),
        (np.linspace(0.5, 1.0, 401) * 1j, 401),
        (np.ones(400), 0),
        (np.zeros(401), 0),
        (["a", "b"], 0),
    ],
)
def test_weights_over_frequency_are_those_of_the_image_if_they_are_known(taper, count):
    image = gaussian_image([], *GRID).assign_attrs(frequency_start=290e9, frequency_stop=300e9, frequency_points=401,
                                                   tx_aperture=0.08, rx_aperture=0.08, taper=taper)  # fmt: skip
    assert to_image_view(image).window.shape == (count,)
    assert to_image_view(image.assign_attrs(frequency_points=10**12, taper="hann")).window.size < 10_000


def test_an_image_without_a_band_has_no_weights_over_frequency():
    assert to_image_view(gaussian_image([], *GRID).drop_attrs()).window.size == 0
