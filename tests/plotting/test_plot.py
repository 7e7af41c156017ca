"""Pictures: that what is drawn is what the data say, at the right place and in the right colour."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scans
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.common.decibels import COLOURS, TRUTH_COLOUR, decibels
from mirrorfold.plotting.comparison import content_extent


@pytest.fixture
def ax():
    return Figure().subplots()


def test_pixels_are_drawn_around_their_centres(image, ax):
    drawn = mf.plot.image(image, ax, normalization="none").images[0]
    assert_allclose(drawn.get_extent(), [-0.41, 0.59, 0.79, 1.59])
    level = np.asarray(drawn.get_array())
    assert level.max() == 0.0
    assert level.min() >= -40.0
    assert np.unravel_index(level.argmax(), level.shape) == (20, 25)


def test_range_normalization_undoes_the_spreading_of_a_line_source():
    y, x = np.linspace(1.0, 4.0, 31), np.linspace(-1.0, 1.0, 21)
    spread = xr.DataArray(1.0 / np.hypot(x, y[:, None] - 0.5), dims=("y", "x"), coords={"y": y, "x": x})
    level = mf.plot.image(spread, radar=(0.0, 0.5)).images[0].get_array()
    assert_allclose(level, 0.0, atol=1e-9)


def test_decibels_are_clipped_at_the_floor_and_do_not_follow_one_glint():
    amplitude = np.ones((100, 100))
    amplitude[0, 0], amplitude[0, 1], amplitude[0, 2] = 1e4, 0.1, 0.0
    level = decibels(amplitude, -40.0)
    assert_allclose(level[0, :4], [0.0, -20.0, -40.0, 0.0], atol=1e-9)
    assert_allclose(decibels(np.zeros((3, 3)), -40.0), -40.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"floor_db": 40.0}, "floor_db is 40.0"), ({"normalization": "r3"}, "normalization is 'r3'")],
)
def test_wrong_options_are_refused(image, options, words):
    with pytest.raises(mf.InputError, match=words):
        mf.plot.image(image, **options)
    with pytest.raises(mf.InputError, match="expected an image"):
        mf.plot.image(image.isel(x=0))


def test_mirrors_are_numbered_and_coloured_by_bounces(reconstruction, ax):
    mf.plot.mirrors(reconstruction, ax)
    assert_allclose(ax.lines[0].get_xydata(), [[0.4, 1.6], [0.6, 0.9]])
    assert to_hex(ax.lines[0].get_color()) == COLOURS[0].lower()
    assert [text.get_text() for text in ax.texts] == ["0"]


def test_the_shadow_holds_the_ghosts_and_nothing_in_line_of_sight(reconstruction, ax):
    mf.plot.shadows(reconstruction, ax, reach=10.0)
    shadow = ax.patches[0].get_path()
    objects = reconstruction["objects"]
    initial = np.column_stack([objects["x_initial"], objects["y_initial"]])
    assert shadow.contains_points(initial).tolist() == [False, False, True, True, True]


def test_objects_are_drawn_where_they_stand_in_the_colour_of_their_bounces(reconstruction, ax):
    mf.plot.corrected(reconstruction, ax)
    points = {to_hex(line.get_color()): line.get_xydata() for line in ax.lines if line.get_marker() == "o"}
    assert_allclose(points[COLOURS[0].lower()], [[-0.1, 0.9], [-0.12, 0.95]])
    assert_allclose(points[COLOURS[1].lower()], [[0.1, 1.5], [0.12, 1.52], [0.14, 1.54]])


def test_the_picture_is_cropped_to_what_it_shows(reconstruction):
    x0, x1, y0, y1 = content_extent(reconstruction, folded=True)
    margin = 0.12 * 1.6
    assert_allclose([x0, x1, y0, y1], [-0.12 - margin, 0.6 + margin, -margin, 1.6 + margin])
    assert content_extent(reconstruction, folded=False)[1] > x1  # the ghosts stand beyond the wall


@pytest.mark.slow
def test_before_and_after_have_one_scale_and_equal_axes(reconstruction, scene_file, tmp_path):
    figure = mf.plot.before_after(reconstruction, mf.load(scene_file))
    path = tmp_path / "picture.png"
    figure.savefig(path)
    left, right = figure.axes[:2]
    scale = [panel.bbox.width / np.ptp(panel.get_xlim()) for panel in (left, right)]
    scale += [panel.bbox.height / np.ptp(panel.get_ylim()) for panel in (left, right)]
    assert_allclose(scale, scale[0], rtol=1e-6)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["in line of sight", "1 bounce", "truth"]
    assert path.stat().st_size > 10_000


@pytest.mark.slow
def test_an_empty_reconstruction_can_be_drawn(reconstruction, tmp_path):
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    groups["/mirrors"] = groups["/mirrors"].isel(mirror=slice(0))
    groups["/objects"] = groups["/objects"].isel(point=slice(0))
    groups["/"]["intensity"] = 0 * groups["/"]["intensity"]
    empty = xr.DataTree.from_dict(groups)
    x0, x1, y0, y1 = content_extent(empty, folded=True)
    assert x0 < -0.5 < 1.5 < x1
    assert y0 < 0.5 < 2.0 < y1
    mf.plot.before_after(empty).savefig(tmp_path / "empty.png")


def test_scenes_are_drawn_with_all_their_surfaces(scene_file, ax):
    mf.plot.scene(mf.load(scene_file), ax)
    assert_allclose(ax.lines[0].get_xydata(), [[-0.2, 0.3], [0.2, 0.34]])
    assert ax.get_aspect() == 1.0
    assert "[m]" in ax.get_xlabel()
    assert "[m]" in ax.get_ylabel()


def test_before_and_after_show_all_that_is_folded(reconstruction, folded_scan):
    """Every point, as it seemed and as it stands, with room for the blob around it, and every mirror."""
    for result in (reconstruction, folded_scan):
        objects = result.children["objects"].to_dataset(inherit=False)
        figure = mf.plot.before_after(result)
        for axes, suffix in zip(figure.axes[:2], ("_initial", ""), strict=True):
            assert axes.get_xlabel()
            room = 0.1 * (axes.get_ylim()[1] - axes.get_ylim()[0]) - 0.04
            for axis, (low, high) in (("x", axes.get_xlim()), ("y", axes.get_ylim())):
                values = objects[f"{axis}{suffix}"].values
                assert low < values.min() - room / 2
                assert high > values.max() + room / 2


def test_the_plan_of_a_volume_shows_its_ghosts_and_the_truth(folded_scan):
    world = scans.scene(scans.panel("wall", (0.4, 2.0, 0.0), (-1.0, 0.0, 0.0), 1.0, 1.2), scans.ball())
    left, right = mf.plot.before_after(folded_scan, world).axes[:2]
    objects = folded_scan.children["objects"].to_dataset(inherit=False)
    for axes, suffix in ((left, "_initial"), (right, "")):
        drawn = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
        places = np.column_stack([objects[f"x{suffix}"], objects[f"y{suffix}"]])
        assert_allclose(np.sort(np.concatenate(drawn), axis=0), np.sort(places, axis=0))
        truth = [line for line in axes.lines if line.get_color() == TRUTH_COLOUR]
        # The wall as a line, the ball as a circle: over the mirrors, with a rim.
        assert len(truth) == 2
        assert all(line.get_path_effects() for line in truth)
        mirrors = [line for line in axes.lines if line.get_linewidth() > 3.0]
        assert min(line.get_zorder() for line in truth) > max(line.get_zorder() for line in mirrors)


@pytest.mark.parametrize("along", ["y", "x"])
def test_an_image_of_one_column_or_row_is_a_line(image, along):
    """The ranges that a single antenna sees: as a picture it would be too narrow to be seen."""
    across = "x" if along == "y" else "y"
    one = image.isel({across: [20]})
    axes = mf.plot.image(one, normalization="none", floor_db=-40)
    (line,) = axes.lines
    level = 20 * np.log10(np.abs(one.values).ravel() / np.abs(one.values).max())
    assert_allclose(line.get_xdata(), image[along])
    assert np.argmax(line.get_ydata()) == np.argmax(level)
    assert np.ptp(line.get_ydata()) == pytest.approx(np.ptp(np.maximum(level, -40)), abs=0.7)
    assert along in axes.get_xlabel()
    assert "dB" in axes.get_ylabel()


@pytest.mark.slow
def test_titles_and_ticks_of_a_narrow_scan_have_room(reconstruction):
    objects, mirrors = (reconstruction[name].to_dataset(inherit=False) for name in ("objects", "mirrors"))
    for table in (objects, mirrors):
        for name in table.variables:
            if name in ("x", "x_initial", "x0", "x1", "folded_x0", "folded_x1"):
                table[name].values[:] *= 0.1
    reconstruction["objects"], reconstruction["mirrors"] = objects, mirrors
    figure = mf.plot.before_after(reconstruction)
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    left, right = (ax.title.get_window_extent(renderer) for ax in figure.axes[:2])
    assert left.x1 < right.x0
    for ax in figure.axes[:2]:
        low, high = ax.get_xlim()
        labels = [tick.label1 for tick in ax.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]
        boxes = [label.get_window_extent(renderer) for label in labels]
        assert len(boxes) > 1
        assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
