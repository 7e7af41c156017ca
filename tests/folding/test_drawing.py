"""Pixels look up the image where the mirrors show them: random views against array arithmetic, and known maps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import map_coordinates
from synthetic import empty_view

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.detection.views.volume_view import VolumeView
from mirrorfold.folding import pictures
from mirrorfold.folding.blocks import blocks
from mirrorfold.folding.drawing import _place
from mirrorfold.folding.pictures import BORDER_RADII, LARGEST_GROWTH, PIXEL_RADII, draw
from mirrorfold.tree.lines_of_sight import Cover, LinesOfSight


def image_view():
    """A coarse one, turned and shifted, of random amplitudes."""
    view = empty_view((0.1, -0.2), 20.0, reach=(0.4, 2.4), samples=1, widest=0.6)
    return replace(view, amplitude=np.random.default_rng(0).random(view.amplitude.shape))


def volume_view():
    random = np.random.default_rng(1)
    azimuth, elevation, range_ = np.linspace(-40, 40, 21), np.linspace(-20, 20, 9), np.linspace(0.4, 2.4, 41)
    return VolumeView(random.random((21, 9, 41), dtype=np.float32), range_, azimuth, elevation, 1.0 + range_, "r2", 0.0,
                      np.array([0.1, -0.2, 0.05]), 0.05)  # fmt: skip


VIEWS = pytest.mark.parametrize("view", [image_view(), volume_view()], ids=["image", "volume"])


def reflection(dimensions, angle, distance):
    """In a wall at a distance [m] from the origin, whose normal has an angle [degree] to y in the floor plan."""
    normal = np.zeros(dimensions)
    normal[:2] = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    return Isometry.reflection(distance * normal, normal)


@pytest.mark.nojit
@VIEWS
def test_places_are_those_of_the_view(view):
    """By way of any map, in steps of the angles and of range; outside where the view has nothing."""
    flat, aside = view.dimensions == 2, view.axes[0] if view.dimensions == 2 else view.axes[0] - view.middle
    grid = np.array([(a[0], a[1] - a[0], 1.5 * a[0] - 0.5 * a[1], 1.5 * a[-1] - 0.5 * a[-2])
                     for a in (aside, view.axes[-1], view.range)])  # fmt: skip
    frame = view.frame
    if not flat:  # azimuths by the tangent of half the angle, elevations by that of the whole
        grid[:2, 2:] = np.tan([[0.5], [1.0]] * grid[:2, 2:])
    fold = reflection(view.dimensions, 10.0, 0.3)
    random = np.random.default_rng(2)
    inside_ones = 0
    for place in random.uniform(-2.0, 2.0, (300, 3)):
        point = place[: view.dimensions]
        matrix = np.zeros((3, 4))
        matrix[: len(frame), : view.dimensions] = frame @ fold.linear
        matrix[: len(frame), 3] = frame @ (fold.shift - view.radar)
        range_, expected = view.indices(fold(point))
        inside = np.all((expected >= -0.5) & (expected <= np.array(view.shape) - 0.5))
        found = _place(matrix, *point, *([0.0] if flat else []), grid, flat)
        if not inside:
            assert found == (-1.0, -1.0, -1.0)
            continue
        inside_ones += 1
        assert_allclose(found[: expected.size], expected, atol=1e-9)
        assert_allclose(found[2], (range_ - view.range[0]) / view.dr, atol=1e-9)
    assert inside_ones > 20


def random_sight(view, random, axis, *reflections):
    """Two mirrors, the second seen in the first, objects that hide, ranges that are open, and owners; all random.

    The mirrors have these reflections, whatever the ranges at which lines of sight meet them.
    """
    count = len(view.sight)
    # Bands of three along one axis: neighbours along the other are alike, or every place would stand at an edge.
    bands = [1] * len(view.shape)
    bands[axis] = view.shape[axis]
    pick = (np.arange(view.shape[axis]) // 3 * 3).reshape(bands)
    pick = np.broadcast_to(pick, view.shape).ravel()
    crossing = np.where(random.random((2, count)) < 0.8, np.sort(random.uniform(0.6, 2.6, (2, count)), axis=0), np.inf)
    crossing[1] = np.where(np.isfinite(crossing[0]), crossing[1], np.inf)
    crossing = crossing[:, pick]
    cover = Cover(np.full((1, count), 1.8), np.full((1, count), np.inf), random.uniform(0.0, 3.0, (1, count)))
    mirrors = [SimpleNamespace(curved=False, reflection=one) for one in reflections]
    sight = LinesOfSight(view, mirrors, crossing, np.array([ROOT, 0]), cover,
                         empty_up_to=random.uniform(0.0, 1.5, count))  # fmt: skip
    blobs = random.choice([UNSEEN, ROOT, 0, 1], (count, view.range.size), p=[0.1, 0.1, 0.4, 0.4]).astype(np.int16)
    return sight, blobs


def slow_twin(view, sight, margin, blobs, points):
    """Amplitudes (n,) of points (n, d), by array arithmetic; and which of them stand on no border."""
    amplitude = view.amplitude.T if view.dimensions == 2 else view.amplitude.astype(float)
    gain = np.ones(view.range.size) if view.dimensions == 2 else view.gain
    found, clear = np.zeros(len(points)), np.ones(len(points), dtype=bool)
    for number in (ROOT, 0, 1):
        back = sight.fold(number).inverse(points)
        range_, place = view.indices(back)
        _, beam, _ = view.locate(back)
        index = np.column_stack([np.nan_to_num(place, nan=-9.0), (range_ - view.range[0]) / view.dr])
        sample = np.clip(np.rint(index[:, -1]), 0, view.range.size - 1).astype(int)
        inside = ((index >= 0.0) & (index <= np.array(amplitude.shape) - 1)).all(axis=1)
        value = map_coordinates(amplitude, index.T, order=1) * gain[np.clip(index[:, -1].astype(int), 0, gain.size - 1)]
        shown = inside & (sight.seen_through(range_ - margin, beam) == number) & sight.cover.clear(range_, beam, value)
        shown &= blobs[beam, sample] != UNSEEN
        if number != ROOT:
            shown &= blobs[beam, sample] == number
            own, ahead, looked = view.locate(points)
            alike = [sight.seen_through(range_ - margin, side) == number for side in view.beside(range_, beam)]
            shown &= ~(looked & (own < sight.empty_up_to[ahead])) | np.logical_and.reduce(alike)
        found = np.maximum(found, np.where(shown, value, 0.0))
        step = view.beside_steps(range_) != view.beside_steps(view.range)[np.clip(index[:, -1].astype(int), 0, None)
                                                                           % view.range.size]  # fmt: skip
        clear &= ~(np.abs(index % 1.0 - 0.5) < 0.01).any(axis=1) & ~step
    return found, clear


@pytest.mark.nojit
@pytest.mark.parametrize(("margin", "axis"), [(0.0, 0), (0.2, -1)])
@VIEWS
def test_a_picture_is_what_the_ways_show_at_every_pixel(view, margin, axis):
    random = np.random.default_rng(3)
    first, second = reflection(view.dimensions, 5.0, 0.9), reflection(view.dimensions, -20.0, 1.4)
    sight, blobs = random_sight(view, random, axis, first, second)
    x, y, z = np.linspace(-1.0, 1.2, 17), np.linspace(-1.0, 2.2, 21), np.linspace(-0.3, 0.35, 4)
    grid = (x, y) if view.dimensions == 2 else (x, y, z)
    drawn = draw(sight, margin, grid, blobs)
    points = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1)
    expected, clear = slow_twin(view, sight, margin, blobs, points.reshape(-1, view.dimensions))
    expected, clear = (part.reshape(points.shape[:-1]).T for part in (expected, clear))
    assert np.count_nonzero(expected) > 0.1 * expected.size
    assert clear.mean() > 0.5
    assert_allclose(drawn[clear], expected[clear], rtol=1e-4)
    strongest = draw(sight, margin, grid, blobs, strongest=True)
    assert_array_equal(strongest, drawn if view.dimensions == 2 else drawn.max(axis=0))
    # Where nothing is known to be empty, what stands beside a mirror's edge contradicts nothing.
    unknown = replace(sight, empty_up_to=np.zeros(0))
    nowhere = replace(sight, empty_up_to=np.zeros(len(view.sight)))
    assert_array_equal(draw(unknown, margin, grid, blobs), draw(nowhere, margin, grid, blobs))


@pytest.mark.parametrize("seed", range(3))
@VIEWS
def test_blocks_that_are_passed_over_show_nothing(view, seed, monkeypatch):
    """A few bright places in an image that is dark elsewhere, of which some belong to somebody."""
    random = np.random.default_rng(seed)
    sight, blobs = random_sight(view, random, 0)
    blobs = np.where(random.random(blobs.shape) < 0.02, blobs, UNSEEN).astype(np.int16)
    dark = np.where(random.random(view.amplitude.shape) < 0.1, view.amplitude, 1e-3 * view.amplitude)
    sight = replace(sight, view=replace(view, amplitude=dark.astype(view.amplitude.dtype)))
    mirrors = [SimpleNamespace(curved=False, reflection=reflection(view.dimensions, *one))
               for one in random.uniform((-40.0, 0.6), (40.0, 1.4), (2, 2))]  # fmt: skip
    sight = replace(sight, mirrors=mirrors)
    grid = np.linspace(-1.0, 1.2, 61), np.linspace(-1.0, 2.2, 53), np.linspace(-0.6, 0.7, 27)
    given = 0.1, grid[: view.dimensions], blobs
    drawn, strongest = draw(sight, *given), draw(sight, *given, strongest=True)
    passed_over = []

    def all_of_them(*arguments):
        found = blocks(*arguments)
        passed_over.append(np.mean(found.bound == 0.0))
        return found._replace(bound=np.full_like(found.bound, np.inf))

    monkeypatch.setattr(pictures, "blocks", all_of_them)
    assert_array_equal(drawn, draw(sight, *given))
    assert_array_equal(strongest, draw(sight, *given, strongest=True))
    assert np.count_nonzero(drawn) > 0
    assert min(passed_over) > 0.2


PILLAR = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2))
BAY = ArcMirror(middle=np.array([0.0, 0.4]), radius=0.6, first=np.pi / 3.0, span=np.pi / 3.0, radar=np.zeros(2))
"""With its middle before the radar; behind 0.86 m from its face images are upside down."""
BEFORE = LineMirror(np.array([-0.4, 0.8]), np.array([0.4, 0.8]))


@pytest.mark.nojit
@pytest.mark.parametrize("way", [(PILLAR,), (BAY,), (BEFORE, PILLAR)], ids=["pillar", "bay", "pillar in a wall"])
def test_what_a_curved_mirror_shows_is_drawn_where_its_lines_of_sight_lead(way):
    """Amplitudes that change evenly, one point after the other; nothing in front of the mirrors."""
    view = empty_view(widest=0.5)
    last = len(way) - 1
    level = np.where(view.range[:, None] > 1.05, 1.0 + 0.3 * view.range[:, None] + 2.0 * view.u, 0.0)
    view = replace(view, amplitude=level)
    crossing = np.stack([mirror.crossing(view) for mirror in way])
    sight = LinesOfSight(view, way, crossing, np.arange(len(way)) - 1, Cover.nothing(view.u.size))
    blobs = np.full((view.u.size, view.range.size), last, dtype=np.int16)
    seen = view.to_points(np.array([1.4, 1.7, 2.3, 1.9]), np.array([-0.07, 0.0203, 0.1, -0.031]))
    for place, true in zip(seen, fold_of(way, 2)(seen), strict=True):
        range_, u = view.to_polar(place)
        drawn = draw(sight, 0.0, (np.array([true[0]]), np.array([true[1]])), blobs)
        assert drawn.shape == (1, 1)
        if way[-1].convex:
            assert drawn[0, 0] == pytest.approx(1.0 + 0.3 * range_ + 2.0 * u, rel=2e-3)
        else:  # the strongest of several lines of sight
            assert drawn[0, 0] > (1.0 + 0.3 * range_ + 2.0 * u) * (1.0 - 2e-3)
        # What is doubted is not drawn; of what lies inside the wall only that which the radar sees there itself.
        pixel = true[:1], true[1:]
        assert draw(sight, 0.0, pixel, np.full_like(blobs, UNSEEN))[0, 0] == 0.0
        direct = draw(LinesOfSight.unfolded(view), 0.0, pixel, blobs)
        assert_array_equal(draw(sight, 3.0, pixel, blobs), direct)


@pytest.mark.nojit
def test_a_point_behind_a_caustic_is_drawn_where_it_stands():
    """By every line of sight that leads there: amplitudes of one spot of the image alone, near the axis."""
    view = empty_view(widest=0.5)
    spot = np.exp(-(((view.range[:, None] - 2.5) / 0.05) ** 2) - ((view.u - 0.05) / 0.01) ** 2)
    view = replace(view, amplitude=spot)
    crossing = BAY.crossing(view)[None]
    sight = LinesOfSight(view, [BAY], crossing, np.array([ROOT]), Cover.nothing(view.u.size))
    fold = fold_of([BAY], 2)
    blobs = np.zeros((view.u.size, view.range.size), dtype=np.int16)
    true = fold(view.to_points(np.array([2.5]), np.array([0.05])))[0]
    x, y = true[0] + 0.01 * np.arange(-5, 6), true[1] + 0.01 * np.arange(-5, 6)
    drawn = draw(sight, 0.0, (x, y), blobs)
    row, column = np.unravel_index(np.argmax(drawn), drawn.shape)
    assert abs(row - 5) <= 1
    assert abs(column - 5) <= 1
    assert drawn.max() == pytest.approx(1.0, abs=0.05)


def test_what_flat_mirrors_show_of_a_curved_one_is_drawn_and_the_reverse_is_not():
    """A flat mirror seen in a curved one is not flat: it is left out."""
    view = empty_view()
    assert pictures._bent(fold_of([PILLAR], 2), view)[1].tolist() == np.flatnonzero(
        np.isfinite(PILLAR.crossing(view))).tolist()  # fmt: skip
    assert pictures._bent(fold_of([BEFORE, PILLAR], 2), view) is not None
    assert pictures._bent(fold_of([PILLAR, BEFORE], 2), view) is None
    assert pictures._bent(fold_of([PILLAR, PILLAR], 2), view) is None


class Places:
    """Points, as far as grids ask for them."""

    def __init__(self, position, initial):
        self.position, self.initial = np.asarray(position, dtype=float), np.asarray(initial, dtype=float)


def test_a_grid_grows_in_its_own_steps_as_far_as_points_fold():
    image = xr.DataArray(np.zeros((5, 9)), {"y": np.linspace(1.0, 1.8, 5), "x": np.linspace(-0.4, 0.4, 9)}, ("y", "x"))
    inside = Places([[-0.4, 1.0], [0.4, 1.8]], [[0.0, 0.0]])
    for axis, name in zip(pictures._grown(image, inside), "xy", strict=True):
        assert_allclose(axis, image[name])
    x, y = pictures._grown(image, Places([[-0.55, 1.5], [0.41, 2.39]], [[0.0, 0.0]]))
    assert_allclose(x, np.arange(-6, 6) * 0.1, atol=1e-12)
    assert_allclose(y, 1.0 + 0.2 * np.arange(8))
    x, _ = pictures._grown(image, Places([[-50.0, 1.5], [50.0, 1.5]], [[0.0, 0.0]]))
    assert x.size == (1 + 2 * LARGEST_GROWTH) * 9
    assert_allclose(pictures._grown(image, Places(np.empty((0, 2)), np.empty((0, 2))))[0], image["x"])


def test_the_grid_of_a_volume_lies_about_all_points():
    """In pixels of the narrowest beam, vertically of twice that, with a border; coarser where it would be too large."""
    view = replace(volume_view(), beam=(0.01, 1.5, 1e-3))
    axes = pictures._around(Places([[0.0, 1.0, 0.1]], [[0.2, 2.0, -0.1]]), view)
    for axis, (low, high), factor in zip(axes, ((0.0, 0.2), (1.0, 2.0), (-0.1, 0.1)), (1, 1, 2), strict=True):
        step = factor * PIXEL_RADII * 0.01
        assert_allclose(np.diff(axis), step)
        assert 0.0 <= low - BORDER_RADII * 0.01 - axis[0] < step
        assert 0.0 <= axis[-1] - high - BORDER_RADII * 0.01 < step
    nothing = pictures._around(Places(np.empty((0, 3)), np.empty((0, 3))), view)
    assert_allclose([axis[0] for axis in nothing], 0.0, atol=0.02)
    assert_allclose([axis[-1] for axis in nothing], 1.0, atol=0.02)
    large = pictures._around(Places([[0.0, 0.0, 0.0]], [[10.0, 10.0, 10.0]]), view)
    voxels = np.prod([float(axis.size) for axis in large])
    assert voxels == pytest.approx(pictures.LARGEST_GRID, rel=0.02)
    # Where the beam is not known, it is as wide as the steps of the scan make it.
    unknown = pictures._around(Places([[0.0, 1.0, 0.1]], [[0.2, 2.0, -0.1]]), volume_view())
    assert_allclose(np.diff(unknown[0]), PIXEL_RADII * float(volume_view().width(0.4)))
    from_radar = replace(volume_view(), range=0.05 * np.arange(41))  # where such a beam has no width at all
    axes = pictures._around(Places([[0.0, 0.2, 0.0]], [[0.0, 0.2, 0.0]]), from_radar)
    assert_allclose(np.diff(axes[0]), PIXEL_RADII * float(from_radar.width(0.05)))
