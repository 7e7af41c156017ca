"""Two results side by side: what is the same, what has come, what has gone, and by how much."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.describing.comparison import cells, find_changes
from mirrorfold.folding.frames import join_frames


def changed(reconstruction, group, **values):
    """The same with other values in a group."""
    nodes = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    table = nodes[group]
    nodes[group] = table.assign({name: (table[name].dims, np.asarray(value)) for name, value in values.items()})
    if group == "/objects":
        nodes[group] = nodes[group].set_coords(["x", "y"])
    return xr.DataTree.from_dict(nodes)


def test_a_result_does_not_differ_from_itself(reconstruction, folded_scan, image):
    for one in (reconstruction, folded_scan):
        found = mf.compare(one, one)
        assert (found.levels.rms_db, found.points.gained, found.points.lost) == (0.0, 0, 0)
        assert found.points.kept == found.points.first == one["objects"].sizes["point"]
        assert [(pair.first, pair.second, round(pair.offset_m, 9)) for pair in found.mirrors] == [(0, 0, 0.0)]
        assert found.levels.correlation == pytest.approx(1.0)
        assert found.remarks == []
    same = mf.compare(image, image)
    assert "points" not in same
    assert same.levels.median_db == 0.0


def test_twice_the_amplitude_is_six_decibels_more(image):
    found = mf.compare(image, 2.0 * image)
    assert found.levels.median_db == pytest.approx(20.0 * np.log10(2.0), abs=0.01)
    assert found.levels.correlation == pytest.approx(1.0)
    back = mf.compare(2.0 * image, image)
    assert back.levels.median_db == pytest.approx(-found.levels.median_db)


def test_nothing_below_the_floor_counts(image):
    """What lies 60 dB below the brightest pixel may change as it likes."""
    weak = image.copy()
    weak[0, 0] = 1e-3 * abs(image).max()
    weaker = image.copy()
    weaker[0, 0] = 0.0
    assert mf.compare(weak, weaker).levels.rms_db == 0.0


def test_other_grids_are_interpolated_where_both_have_pixels(image):
    magnitude = abs(image)
    part = magnitude.interp(x=np.arange(-0.2, 0.5, 0.013), y=np.arange(0.9, 1.5, 0.017))
    found = mf.compare(magnitude, part)
    assert found.levels.rms_db < 0.2
    assert found.levels.pixels < magnitude.size
    with pytest.raises(mf.InputError, match="no pixel in common"):
        mf.compare(image, image.assign_coords(x=image["x"] + 10.0))


def test_points_are_kept_within_one_and_a_half_cells(reconstruction):
    objects = reconstruction["objects"]
    reach = np.hypot(objects["x_initial"], objects["y_initial"]).values
    cell = cells(reconstruction, reach)
    for share, gained in ((1.4, 0), (1.6, 1)):
        # The first point moves away from all the others.
        y = objects["y"].values.copy()
        y[0] -= share * cell[0]
        moved = changed(reconstruction, "/objects", y=y)
        found = mf.compare(reconstruction, moved)
        assert found.points.gained == gained
        assert found.points.kept == 5 - gained
    assert find_changes(reconstruction, moved).gained.tolist() == [True, False, False, False, False]


def test_mirrors_are_matched_with_angle_and_offset(reconstruction):
    held = reconstruction["mirrors"].to_dataset(inherit=False)
    start, end = (np.array([held[f"folded_x{i}"].item(), held[f"folded_y{i}"].item()]) for i in (0, 1))
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    normal = np.array([-half[1], half[0]]) / np.linalg.norm(half)
    turn = np.radians(2.0)
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ half
    moved = np.array([middle - turned, middle + turned]) + 0.01 * normal
    names = ("folded_x0", "folded_y0", "folded_x1", "folded_y1")
    other = changed(
        reconstruction, "/mirrors", **{name: [value] for name, value in zip(names, moved.ravel(), strict=True)}
    )
    (pair,) = mf.compare(reconstruction, other).mirrors
    assert pair.angle_deg == pytest.approx(2.0)
    assert pair.offset_m == pytest.approx(0.01)
    far = changed(reconstruction, "/mirrors", **{name: held[name].values + 1.0 for name in names})
    found = mf.compare(reconstruction, far)
    assert [(pair.first, pair.second) for pair in found.mirrors] == [(0, None), (None, 0)]
    assert len(found.remarks) == 2


def with_arc(reconstruction, radius, depth=0.0, half=0.3):
    """The same with one mirror: an arc, its middle at (0, 2 + depth), that bulges towards the radar at the origin."""
    rise = radius - np.sign(radius) * np.sqrt(radius**2 - half**2)
    y = 2.0 + depth
    ends = dict(zip(("x0", "y0", "x1", "y1"), (-half, y + rise, half, y + rise), strict=True))
    values = {**{f"folded_{name}": [value] for name, value in ends.items()}, "curvature": [1.0 / radius]}
    values |= {"xm": [0.0], "ym": [y], "folded_xm": [0.0], "folded_ym": [y]}
    nodes = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    nodes["/mirrors"] = nodes["/mirrors"].assign({name: ("mirror", value) for name, value in values.items()})
    return xr.DataTree.from_dict(nodes)


def test_arcs_are_compared_as_arcs(reconstruction):
    """By their middles, not their chords: that of a deeper arc lies farther behind."""
    (pair,) = mf.compare(with_arc(reconstruction, 1.0), with_arc(reconstruction, 0.5, depth=0.02)).mirrors
    assert (pair.first, pair.second) == (0, 0)
    assert (pair.first_radius_m, pair.second_radius_m) == (pytest.approx(1.0), pytest.approx(0.5))
    assert pair.offset_m == pytest.approx(0.02, abs=1e-6)
    assert pair.angle_deg == pytest.approx(0.0, abs=0.05)
    bulges = [radius - np.sqrt(radius**2 - 0.09) for radius in (0.5, 1.0)]
    assert pair.sagitta_m == pytest.approx(bulges[0] - bulges[1])
    (shorter,) = mf.compare(with_arc(reconstruction, 1.0), with_arc(reconstruction, 1.0, half=0.1)).mirrors
    assert (shorter.offset_m, shorter.sagitta_m) == (pytest.approx(0.0, abs=1e-6), pytest.approx(0.0, abs=1e-12))


def test_an_arc_that_bends_the_other_way_on_the_same_chord_is_another_mirror(reconstruction):
    deep = 1.0 - np.sqrt(1.0 - 0.09)
    pairs = mf.compare(with_arc(reconstruction, 1.0), with_arc(reconstruction, -1.0, depth=2 * deep + 0.05)).mirrors
    assert [(pair.first, pair.second) for pair in pairs] == [(0, None), (None, 0)]
    assert "sagitta_m" not in pairs[0]


def test_what_cannot_be_compared_is_refused(reconstruction, folded_scan, image, sweep):
    for first, second, word in (
        (reconstruction, image, "two of one kind"),
        (reconstruction, folded_scan, "has heights"),
        (sweep, image, "Dataset"),
        (image, image.expand_dims(z=[0.0]), "dimensions"),
        (join_frames([reconstruction] * 2, {}), reconstruction, "2 frames"),
    ):
        with pytest.raises(mf.InputError, match=word):
            mf.compare(first, second)


@pytest.mark.slow
def test_the_command_line_prints_figures_and_a_page(reconstruction, image, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "a.nc")
    other = changed(reconstruction, "/objects", x=reconstruction["objects/x"].values + 0.5)
    other.attrs["title"] = "<b>moved</b>"
    mf.save(other, "b.nc")
    mf.save(image, "i.nc")
    assert main(["compare", "a.nc", "b.nc", "--json", "-o", "c.html"]) == 0
    found = check("compare", capsys.readouterr().out)
    assert (found.first, found.second, found.files) == ("a.nc", "b.nc", ["c.html"])
    assert found.points.gained == found.points.lost == 5
    page = (tmp_path / "c.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert "data:image/png;base64," in page
    assert "<td>gained</td><td>5</td>" in page
    for name in ("c.png", "c.pdf", "c.svg"):
        assert main(["compare", "i.nc", "i.nc", "-o", name]) == 0
        assert (tmp_path / name).stat().st_size > 1000
    assert "correlation" in capsys.readouterr().out
    assert main(["compare", "a.nc", "i.nc"]) == 2
    assert main(["compare", "a.nc", "b.nc", "-o", "c.txt"]) == 2
    assert main(["compare", "a.nc", "b.nc", "-o", "a.nc"]) == 2


def test_a_frame_is_compared_with_a_single_result(reconstruction, tmp_path, monkeypatch, capsys):
    """Without --frame a frame was asked for, and with it, it was asked to be left out."""
    monkeypatch.chdir(tmp_path)
    mf.save(join_frames([reconstruction, reconstruction], {}), "recording.nc")
    mf.save(reconstruction, "single.nc")
    for names in (["recording.nc", "single.nc"], ["single.nc", "recording.nc"]):
        assert main(["compare", *names, "--frame", "1", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["points"]["gained"] == 0
    assert main(["compare", "single.nc", "single.nc", "--frame", "1"]) == 2
    assert main(["compare", "recording.nc", "single.nc"]) == 2
