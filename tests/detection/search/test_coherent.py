"""The line of a rough wall is found from its waves, to a hundredth of what speckle moves centroids of power by; so is
where the wall ends, if something else stands in line with it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from point_sweeps import echoes
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.detection import LineMirror, see
from mirrorfold.detection.search.coherent import (
    FARTHEST_CELLS,
    Row,
    doubtful_rows,
    fitted,
    responses,
    shown_part,
    trimmed,
)
from mirrorfold.detection.views.complex_image import ComplexImage

START, END = np.array([-0.15, 0.5]), np.array([0.25, 0.62])
"""Ends of the wall [m]: it is seen aslant, so that its resolution cells lie askew to it."""

FREQUENCY = np.linspace(116e9, 128e9, 61)

ARRAYS = {
    "two lines": ((-0.05, 0.05, 41), (-0.05, 0.05, 41)),
    "lines of two lengths": ((-0.05, 0.05, 41), (-0.03, 0.03, 25)),
    "one transmitter": ((0.0, 0.0, 1), (-0.05, 0.05, 41)),
}


def line(first, last, count):
    """Places of antennas along x, (n, 3) [m]."""
    return np.linspace([first, 0.0, 0.0], [last, 0.0, 0.0], count)


@cache
def image_of(arrays="two lines", *, seed=0, scale=1.0, besides=(), **given):
    """The complex image of a rough wall, and of points `besides` it, all lengths times a scale."""
    random = np.random.default_rng(seed)
    count = 400
    places = START + np.sort(random.random(count))[:, None] * (END - START)
    amplitude = random.standard_normal(count) + 1j * random.standard_normal(count)
    places = scale * np.concatenate([places, np.reshape(besides, (-1, 2))])
    amplitude = np.concatenate([amplitude, np.full(len(places) - count, 5.0)])
    tx, rx = (scale * line(*array) for array in ARRAYS[arrays])
    places = np.column_stack([places, np.zeros(len(places))])
    samples = echoes(FREQUENCY / scale, tx, rx, places, amplitude)
    sweep = mf.make_sweep(samples, frequency=FREQUENCY / scale, tx_position=tx, rx_position=rx)
    x, y = scale * np.arange(-0.25, 0.45, 0.002), scale * np.arange(0.4, 0.75, 0.003)
    return mf.focus(sweep, x=x, y=y, **given)


@cache
def moving_image():
    """The same wall, seen by one antenna that moves, and receives only what it sent."""
    random = np.random.default_rng(1)
    places = np.column_stack([START + np.sort(random.random(400))[:, None] * (END - START), np.zeros(400)])
    amplitude = random.standard_normal(400) + 1j * random.standard_normal(400)
    place = line(-0.05, 0.05, 81)
    way = 2.0 * np.linalg.norm(place[:, None] - places, axis=2)
    samples = np.stack([np.exp(-2j * np.pi * f / speed_of_light * way) @ amplitude for f in FREQUENCY])
    sweep = mf.make_monostatic_sweep(samples, frequency=FREQUENCY, antenna_position=place)
    return mf.focus(sweep, x=np.arange(-0.25, 0.35, 0.002), y=np.arange(0.4, 0.75, 0.003))


def errors(image, *, turned=0.4, moved=0.001, scale=1.0):
    """How far a line that is turned [degree] and moved [m] from the wall is off it once fitted; and as was stated."""
    wall = LineMirror(scale * START, scale * END)
    turn = np.tan(np.radians(turned))
    beside = (moved * scale + turn * 0.5 * wall.length * np.array([[-1.0], [1.0]])) * wall.normal
    askew = LineMirror(*(wall.ends + beside))
    found = fitted(askew, see(image))
    angle = np.degrees(np.arcsin(wall.direction @ found.normal))
    offset = (found.center - wall.center) @ wall.normal
    return angle, offset, found.angle_error, found.offset_error


@pytest.mark.parametrize("arrays", ["two lines", "lines of two lengths"])
def test_speckle_does_not_move_the_line(arrays):
    angle, offset, *_ = errors(image_of(arrays))
    assert abs(angle) < 0.01
    assert abs(offset) < 5e-5


@pytest.mark.parametrize("image", [lambda: image_of("one transmitter"), moving_image])
def test_where_one_array_tells_directions_its_side_lobes_remain(image):
    """Its far side lobes, 25 dB below the peak, are left out."""
    angle, offset, *_ = errors(image())
    assert abs(angle) < 0.05
    assert abs(offset) < 2e-4


@pytest.mark.parametrize("windows", [{"taper": "uniform"}, {"apodization": "hann"}, {"normalization": "r2"}])
def test_windows_and_normalization_of_the_image_are_known(windows):
    angle, offset, *_ = errors(image_of(**windows))
    assert abs(angle) < 0.02
    assert abs(offset) < 5e-5


def test_stated_errors_are_those_of_foreign_echoes():
    """Twelve walls, each with two objects close to it that are five times as bright as its own scatterers."""
    found = []
    for seed in range(12):
        random = np.random.default_rng(100 + seed)
        share, away = random.uniform(0.1, 0.9, 2), random.choice([-1.0, 1.0], 2) * random.uniform(0.01, 0.03, 2)
        places = START + share[:, None] * (END - START) + away[:, None] * LineMirror(START, END).normal
        angle, offset, angle_error, offset_error = errors(image_of(seed=seed, besides=tuple(map(tuple, places))))
        found.append((angle / angle_error, offset / offset_error))
    assert 0.5 < np.sqrt(np.mean(np.square(found))) < 1.5


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_no_length_has_a_meaning_of_its_own(scale):
    """To the accuracy of samples in single precision."""
    angle, offset, angle_error, _ = errors(image_of(scale=scale), scale=scale)
    one = errors(image_of())
    np.testing.assert_allclose([angle, offset / scale, angle_error], one[:3], atol=1e-4, rtol=0.02)


def test_a_line_that_would_leave_its_row_stays():
    wall = LineMirror(START, END)
    image = image_of()
    view = see(image)
    across = float(view.extent(wall.center[None], wall.normal)[0])
    far = wall.moved(wall.normal, wall.center + 1.2 * FARTHEST_CELLS * across * wall.normal)
    assert fitted(far, view) is far


def test_masked_pixels_are_left_out():
    image = image_of()
    masked = image.where((image["x"] < 0.02) | (image["x"] > 0.05), 0.0)
    masked[:, :20] = np.nan
    view = see(image)
    wall = LineMirror(START, END)
    near = LineMirror(*(wall.ends + 0.001 * wall.normal))
    found = fitted(near, replace(view, waves=ComplexImage.of(masked, view)))
    assert abs((found.center - wall.center) @ wall.normal) < 5e-5
    blank = image.copy(data=np.zeros_like(image.values))
    assert fitted(near, replace(view, waves=ComplexImage.of(blank, view))) is near


def test_images_that_do_not_tell_their_waves_are_not_used():
    image = image_of()
    view = see(image)
    assert ComplexImage.of(abs(image), view) is None
    assert ComplexImage.of(image, replace(view, aperture_filled=40.0)) is None
    assert ComplexImage.of(image.assign_attrs(apodization=np.hanning(41)), view) is None
    bare = image.copy()
    bare.attrs = {}
    assert ComplexImage.of(bare, see(bare)) is None
    wall, blind = LineMirror(START, END), see(abs(image))
    assert fitted(wall, blind) is shown_part(wall, blind) is wall


def in_line(*, gap, aside, length=0.1, seed=0):
    """The image of the wall and, in line with its end, beyond a gap [m], of another one that stands aside [m] of its
    line at the far end, and on it at the near end.
    """
    wall = LineMirror(START, END)
    random = np.random.default_rng(seed)
    along = np.sort(random.random(120))
    places = END + (gap + length * along)[:, None] * wall.direction + (aside * along**2)[:, None] * wall.normal
    return image_of(seed=seed, besides=tuple(map(tuple, places)))


def test_what_bends_away_from_the_line_of_a_wall_is_no_part_of_it():
    """By one resolution cell at its end; where it leaves the line by half a cell, the wall may end."""
    wall = LineMirror(START, END)
    for seed in range(3):
        view = see(in_line(gap=0.04, aside=0.02, seed=seed))
        whole = LineMirror(START, END + 0.14 * wall.direction)
        part = shown_part(whole, view)
        cell = float(whole.section(view, END[None])[0])
        assert wall.length - cell < part.length < wall.length + 0.04 + 0.7 * 0.1 + cell
        np.testing.assert_allclose(part.start, START, atol=1e-12)


def test_a_wall_that_goes_on_behind_a_gap_stays_whole():
    wall = LineMirror(START, END)
    whole = LineMirror(START, END + 0.14 * wall.direction)
    for seed in range(3):
        assert shown_part(whole, see(in_line(gap=0.04, aside=0.0, seed=seed))) is whole


def test_only_mirrors_on_doubtful_rows_are_trimmed():
    wall = LineMirror(START, END)
    whole = LineMirror(START, END + 0.14 * wall.direction)
    view = see(in_line(gap=0.04, aside=0.02))
    assert trimmed(whole, view) is whole
    rows = doubtful_rows([whole, wall], view)
    np.testing.assert_array_equal(rows, whole.ends[None])
    doubtful = view.knowing(doubtful=rows)
    assert not len(doubtful_rows([whole], doubtful))
    np.testing.assert_array_equal(trimmed(whole, doubtful).ends, shown_part(whole, view).ends)
    beside = whole.moved(whole.normal, whole.center + 0.1 * whole.normal)
    assert trimmed(beside, doubtful) is beside


@pytest.mark.nojit
@pytest.mark.parametrize("arrays", ["two lines", "lines of two lengths"])
def test_the_response_to_a_point_is_its_focused_image(arrays):
    """Pixel by pixel, the same sum over all frequencies and antennas as focusing takes, to the accuracy of ten each."""
    point = 0.5 * (START + END)
    pixels = point + np.array([[0.0, 0.0], [0.006, 0.002], [-0.01, 0.004], [0.003, -0.012], [0.02, 0.006]])
    x, y = np.arange(-0.1, 0.2, 0.005), np.arange(0.45, 0.7, 0.005)
    lengths = [last - first for first, last, _ in ARRAYS[arrays]]
    attrs = {
        "frequency_start": FREQUENCY[0], "frequency_stop": FREQUENCY[-1], "frequency_points": FREQUENCY.size,
        "tx_aperture": lengths[0], "rx_aperture": lengths[1], "taper": "hann", "radar_position": np.zeros(3),
    }  # fmt: skip
    image = xr.DataArray(np.ones((y.size, x.size), complex), {"y": y, "x": x}, ("y", "x"), attrs=attrs)
    view = see(image)
    waves = view.waves
    wall = LineMirror(START, END)
    along = (pixels - wall.center) @ wall.direction
    row = Row(pixels, np.zeros(len(pixels), dtype=complex), along, np.zeros(1))
    found = responses(row, wall, view, np.zeros(2)).toarray()[:, 0]
    k = 2.0 * np.pi * FREQUENCY / speed_of_light
    middle = 0.5 * (waves.k[0] + waves.k[-1])
    expected = np.zeros(len(pixels), dtype=complex)
    taper = np.interp(np.linspace(0, 1, k.size), np.linspace(0, 1, view.window.size), view.window)
    for share, one in zip(taper / taper.sum(), k, strict=True):
        sums = []
        for array in ARRAYS[arrays]:
            places = line(*array)[:, :2]
            way = np.linalg.norm(pixels[:, None] - places, axis=2) - np.linalg.norm(point - places, axis=1)
            sums.append(np.exp(1j * one * way).mean(axis=1))
        expected += share * sums[0] * sums[1]
    deeper = np.linalg.norm(pixels, axis=1) - np.linalg.norm(point)
    np.testing.assert_allclose(found, expected * np.exp(-2j * middle * deeper), atol=0.02)
