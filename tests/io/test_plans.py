"""Floor plans of CAD programs and maps: read, laid over pictures, and given as mirrors."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.arcs import circle_through
from mirrorfold.folding.frames import join_frames
from mirrorfold.io.plans import read_plan

ezdxf = pytest.importorskip("ezdxf", reason="the extra mirrorfold[cad] has ezdxf, which is absent")

WALL = np.array([[0.4, 1.6], [0.6, 0.9]])


def drawing(tmp_path, *, units=6, scale=1.0):
    """A room: a wall as a line, a closed polyline, an arc, a block with a line, and a layer that is switched off."""
    document = ezdxf.new("R2010", units=units)
    space = document.modelspace()
    space.add_line(*(WALL * scale))
    space.add_lwpolyline(np.array([[0, 0], [1, 0], [1, 2]]) * scale, close=True)
    space.add_arc((0, 0), radius=2.0 * scale, start_angle=0, end_angle=90)
    block = document.blocks.new("door")
    block.add_line((0, 0), (0.9 * scale, 0))
    space.add_blockref("door", (1 * scale, 1 * scale), dxfattribs={"rotation": 90})
    document.layers.add("furniture").off()
    space.add_line((5, 5), (6, 6), {"layer": "furniture"})
    space.add_text("room 1")
    path = tmp_path / f"plan{units}.dxf"
    document.saveas(path)
    return path


@pytest.mark.parametrize(("units", "scale"), [(6, 1.0), (4, 1e3), (5, 1e2), (1, 1 / 0.0254), (0, 1.0)])
def test_lines_are_metres_whatever_the_drawing_has(tmp_path, units, scale):
    line, outline, arc, door = read_plan(drawing(tmp_path, units=units, scale=scale)).lines
    np.testing.assert_allclose(line, WALL, rtol=1e-9)  # ezdxf has an inch to that many digits
    np.testing.assert_allclose(outline, [[0, 0], [1, 0], [1, 2], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(door, [[1, 1], [1, 1.9]], atol=1e-12)
    np.testing.assert_allclose(np.hypot(*arc.T), 2.0, atol=1e-3)
    middle = 0.5 * (arc[1:] + arc[:-1])
    assert 2.0 - np.hypot(*middle.T).min() < 2e-3


@pytest.mark.parametrize(("units", "metre"), [(8, 1e6 / 0.0254), (21, 3937 / 1200), (22, 39.37), (24, 3937 / 6336000)])
def test_units_of_surveys_and_machines_are_known(tmp_path, units, metre):
    np.testing.assert_allclose(read_plan(drawing(tmp_path, units=units, scale=metre)).lines[0], WALL, rtol=1e-12)


def test_what_is_hidden_or_no_wall_is_left_out(tmp_path):
    """Furniture is mostly drawn on layer 0 of a block, and lies on the layer where the block was inserted."""
    document = ezdxf.new("R2010", units=6)
    space = document.modelspace()
    document.layers.add("furniture").off()
    document.layers.add("old").freeze()
    document.layers.add("walls")
    chair = document.blocks.new("chair")
    chair.add_line((0, 0), (0.5, 0))
    chair.add_line((0, 0.1), (0.6, 0.1), {"layer": "walls"})
    group = document.blocks.new("group")
    group.add_blockref("chair", (0, 1))
    for at, layer in enumerate(("0", "furniture", "old")):
        space.add_blockref("chair", (at, 2), {"layer": layer})
        space.add_blockref("group", (at, 3), {"layer": layer})
    space.add_line((5, 5), (6, 6), {"invisible": 1})
    space.add_linear_dim(base=(0, 7), p1=(0, 0), p2=(3, 0)).render()
    space.add_mline([(0, 9), (4, 9)])
    document.saveas(tmp_path / "plan.dxf")
    found = {tuple(np.round(line.ravel(), 9).tolist()) for line in read_plan(tmp_path / "plan.dxf").lines}
    seen = {(0, 2, 0.5, 2), (0, 4, 0.5, 4), (0, 2.1, 0.6, 2.1), (0, 4.1, 0.6, 4.1)}
    assert found == {*seen, (1, 2.1, 1.6, 2.1), (1, 4.1, 1.6, 4.1), (0, 9, 4, 9), (0, 8, 4, 8)}


def test_lines_without_length_are_left_out(tmp_path):
    lines = [[], [[1, 2]], [[1, 2], [1, 2]], WALL.tolist()]
    (tmp_path / "plan.geojson").write_text(json.dumps({"type": "MultiLineString", "coordinates": lines}))
    np.testing.assert_array_equal(read_plan(tmp_path / "plan.geojson").lines, [WALL])
    (tmp_path / "plan.geojson").write_text(json.dumps({"type": "MultiLineString", "coordinates": lines[:3]}))
    with pytest.raises(mf.InputError, match="holds no line"):
        read_plan(tmp_path / "plan.geojson")


def endless(document):
    document.blocks.new("a").add_blockref("a", (1, 1))
    document.modelspace().add_blockref("a", (0, 0))


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda document: document.modelspace().add_circle((0, 0), 1e15), "farther away than 1e[+]07 m"),
        (endless, "no DXF file that can be read .*recursion"),
        (lambda document: document.modelspace().add_blockref("gone", (0, 0)), 'no DXF file that can be read .*"gone"'),
        (lambda document: document.header.__setitem__("$INSUNITS", 99), "INSUNITS is 99, expected 0 to 24"),
    ],
)
def test_drawings_that_cannot_be_drawn_are_refused(tmp_path, draw, words):
    document = ezdxf.new("R2010", units=6)
    document.modelspace().add_line(*WALL)
    draw(document)
    document.saveas(tmp_path / "plan.dxf")
    with pytest.raises(mf.InputError, match=words):
        read_plan(tmp_path / "plan.dxf")


@pytest.mark.parametrize("radius", [0.03, 0.35, 5.0])
def test_circles_of_a_drawing_are_curves(tmp_path, radius):
    document = ezdxf.new("R2010", units=6)
    document.modelspace().add_circle((1.0, 2.0), radius)
    document.modelspace().add_line(*WALL)
    document.saveas(tmp_path / "plan.dxf")
    plan = read_plan(tmp_path / "plan.dxf")
    np.testing.assert_allclose(plan.walls, [WALL], rtol=1e-12)
    center, found = circle_through(*np.moveaxis(plan.curves, 1, 0))
    np.testing.assert_allclose(center, [[1.0, 2.0]] * len(plan.curves), atol=1e-9)
    np.testing.assert_allclose(found, radius, rtol=1e-9)


def test_geojson_of_every_geometry(tmp_path):
    content = {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": None, "geometry": {"type": "LineString", "coordinates": WALL.tolist()}},
            {"type": "Feature", "properties": {}, "geometry": {"type": "GeometryCollection", "geometries": [
                {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]},
                {"type": "MultiLineString", "coordinates": [[[2, 2, 9], [3, 3, 9]]]}]}},
            {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [7, 7]}},
            {"type": "Feature", "properties": {}, "geometry": None},
        ],
    }  # fmt: skip
    path = tmp_path / "plan.geojson"
    path.write_text(json.dumps(content))
    plan = mf.load(path)
    assert [len(line) for line in plan.lines] == [2, 4, 2]
    np.testing.assert_array_equal(plan.lines[2], [[2, 2], [3, 3]])
    assert plan.walls.shape == (5, 2, 2)
    path.write_text(json.dumps(content | {"units": "millimetres"}))
    np.testing.assert_allclose(mf.load(path).lines[2], [[2e-3, 2e-3], [3e-3, 3e-3]])


@pytest.mark.parametrize("name", ["plan.dxf", "plan.geojson"])
def test_the_plan_of_a_reconstruction_comes_back(reconstruction, tmp_path, name):
    plan = read_plan(mf.export(reconstruction, tmp_path / name))
    np.testing.assert_allclose(plan.lines, [WALL], rtol=1e-12)
    np.testing.assert_allclose(plan.images, [WALL], rtol=1e-12)
    again = mf.fold(reconstruction, mirrors=tmp_path / name)
    ends = [again[f"mirrors/{key}"].item() for key in ("x0", "y0", "x1", "y1")]
    np.testing.assert_allclose(ends, WALL.ravel(), rtol=1e-12)
    assert again.attrs["mirrors_given"]


@pytest.mark.parametrize("name", ["plan.dxf", "plan.geojson"])
def test_the_plan_of_a_recording_gives_each_wall_as_one_mirror(reconstruction, tmp_path, name):
    recording = join_frames([reconstruction] * 2, {})
    plan = read_plan(mf.export(recording, tmp_path / name))
    assert len(plan.lines) == 2
    assert plan.images is None  # those of each frame would be mirrors behind each other
    again = mf.fold(reconstruction, mirrors=tmp_path / name)
    assert again["mirrors/x0"].size == 1


def test_ezdxf_finds_layers_and_facts(reconstruction, tmp_path):
    document = ezdxf.readfile(mf.export(reconstruction, tmp_path / "plan.dxf"))
    assert document.units == 6
    assert not document.audit().errors
    count = {layer: len(document.modelspace().query(f'*[layer=="{layer}"]'))
             for layer in ("mirrors", "mirror-images", "points")}  # fmt: skip
    assert count == {"mirrors": 1, "mirror-images": 1, "points": 5}
    facts = [value for _, value in document.modelspace().query("POINT")[4].get_xdata("MIRRORFOLD")]
    assert "chain=0" in facts


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("a.dxf", "no drawing", "no DXF file"),
        ("a.geojson", "{", "not valid JSON"),
        ("a.geojson", "[]", "no GeoJSON"),
        ("a.geojson", '{"type": "LineString", "units": "GHz"}', "'units' are 'GHz', expected m, cm, mm"),
        ("a.geojson", '{"type": "LineString"}', "without proper coordinates"),
        ("a.geojson", '{"type": "LineString", "coordinates": [[1, 2], [3]]}', "without proper coordinates"),
        ("a.geojson", '{"type": "LineString", "coordinates": [[1, 2], [NaN, 3]]}', "is not finite"),
        ("a.geojson", '{"type": "FeatureCollection", "features": []}', "holds no line"),
    ],
)
def test_damaged_plans_are_named(tmp_path, name, content, word):
    (tmp_path / name).write_text(content)
    with pytest.raises(mf.InputError, match=word):
        read_plan(tmp_path / name)


def test_a_missing_plan_or_library_is_named(tmp_path, monkeypatch):
    import sys

    with pytest.raises(mf.InputError, match="does not exist"):
        read_plan(tmp_path / "none.dxf")
    path = drawing(tmp_path)
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(mf.InputError, match=r"mirrorfold\[cad\]"):
        read_plan(path)


@pytest.mark.slow
def test_plans_lie_over_report_and_figures(reconstruction, tmp_path, monkeypatch):
    from mirrorfold.reporting.document import to_document

    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    plan = read_plan(drawing(tmp_path))
    assert to_document(reconstruction, plan=plan)["truth"][0] == WALL.tolist()
    assert main(["report", "r.nc", "-o", "r.html", "--plan", "plan6.dxf"]) == 0
    assert "[[0.4,1.6],[0.6,0.9]]" in (tmp_path / "r.html").read_text()
    figure = mf.plot.before_after(reconstruction, plan=plan)
    drawn = [line.get_xydata() for ax in figure.axes[:2] for line in ax.lines]
    assert sum(np.array_equal(line, WALL) for line in drawn) >= 4  # the mirror and the wall of the plan, in both
    assert "floor plan" in [text.get_text() for text in figure.legends[0].get_texts()]
    for what in ("before-after", "corrected", "mirrors"):
        assert main(["show", "r.nc", "-o", "f.png", "--dpi", "40", "--plan", "plan6.dxf", "--what", what]) == 0
    assert main(["show", "plan6.dxf", "-o", "f.png", "--dpi", "40"]) == 0
    assert main(["show", "r.nc", "-o", "f.png", "--plan", "none.dxf"]) == 2


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_plan_in_millimetres_that_says_no_unit_is_told(reconstruction, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    drawing(tmp_path, units=0, scale=1e3)
    for verb in (["report", "r.nc", "-o", "r.html"], ["show", "r.nc", "-o", "f.png", "--dpi", "40"]):
        assert main([*verb, "--plan", "plan0.dxf"]) == 0
        assert capsys.readouterr().err.count("are its numbers millimetres?") == 1
    plan, metres = read_plan("plan0.dxf"), read_plan(drawing(tmp_path))
    with pytest.warns(UserWarning, match="all walls reach far beyond"):
        extent = mf.plot.content_extent(reconstruction, plan=plan, folded=True)
    assert extent == mf.plot.content_extent(reconstruction, folded=True)
    assert mf.plot.content_extent(reconstruction, plan=metres, folded=True) != extent


@pytest.mark.parametrize("name", ["plan.dxf", "plan.geojson"])
def test_a_curved_mirror_comes_back_as_the_same_arc(reconstruction, tmp_path, name):
    arc = np.array([WALL[0], [0.47, 1.22], WALL[1]])
    line = [[-0.6, 1.7], [-0.65, 1.3], [-0.7, 0.9]]
    first = mf.fold(reconstruction, mirrors=[arc, line])
    plan = read_plan(mf.export(first, tmp_path / name))
    again = mf.fold(reconstruction, mirrors=tmp_path / name)
    for key in ("curvature", "xm", "ym"):
        np.testing.assert_allclose(again[f"mirrors/{key}"], first[f"mirrors/{key}"], rtol=1e-9, atol=1e-12)
    # Where the mirrors stand they are drawn round, for other programs.
    center, radius = (found[0] for found in circle_through(*arc[:, None]))
    assert len(plan.lines[0]) > 2
    np.testing.assert_allclose(np.linalg.norm(plan.lines[0] - center, axis=1), radius, rtol=1e-3)


def test_a_curved_mirror_whose_middle_lies_between_its_ends_is_a_line(reconstruction, tmp_path):
    first = mf.fold(reconstruction, mirrors=[np.array([WALL[0], [0.47, 1.22], WALL[1]])])
    mirrors = first["mirrors"].to_dataset(inherit=False)
    for axis in "xy":
        middle = 0.5 * (mirrors[f"folded_{axis}0"] + mirrors[f"folded_{axis}1"])
        mirrors[f"folded_{axis}m"] = middle
    first["mirrors"] = xr.DataTree(mirrors)
    drawn = read_plan(mf.export(first, tmp_path / "plan.dxf")).lines[0]
    np.testing.assert_allclose(drawn, np.array(WALL)[:, :2], atol=1e-9)
