"""Scene files: what they describe, and that every mistake in them is named with its place."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import load_scene, parse_scene
from mirrorfold.scenes.surfaces import Arc, Circle, Polyline, Segment

BASE = {
    "name": "a room",
    "array": {"kind": "linear", "elements": 5, "pitch": 0.5e-3},
    "band": {"start": 290e9, "stop": 300e9, "points": 11},
}


def room(*surfaces, **changes):
    return {**BASE, "surface": list(surfaces), **changes}


WALL = {"name": "wall", "kind": "segment", "start": [0, 1], "end": [1, 1]}


def test_a_scene_file_is_read_in_order(scene_file):
    scene = load_scene(scene_file)
    assert scene.name == "one wall"
    assert [surface.name for surface in scene.surface] == ["wall"]
    assert scene.surface[0].roughness.rms_height == 0.05e-3
    assert_allclose(scene.band.frequency[[0, -1]], [290e9, 300e9])
    assert scene.band.frequency.size == 41


def test_the_array_is_centred_and_evenly_spaced(scene_file):
    array = load_scene(scene_file).array
    assert_allclose(array.tx_position.mean(axis=0), 0.0, atol=1e-15)
    assert_allclose(np.diff(array.tx_position, axis=0), [[0.5e-3, 0, 0]] * 8, atol=1e-15)
    assert_allclose(array.rx_position, array.tx_position)


def test_a_receiving_array_of_its_own_and_a_direction():
    array = {
        "elements": 2, "pitch": 2e-3, "direction": [0, 3],
        "rx": {"elements": 3, "pitch": 1e-3, "center": [0.1, 0, 0.2]},
    }  # fmt: skip
    scene = parse_scene(room(array=array))
    assert_allclose(scene.array.tx_position, [[0, -1e-3, 0], [0, 1e-3, 0]], atol=1e-15)
    assert_allclose(scene.array.rx_position, [[0.099, 0, 0.2], [0.1, 0, 0.2], [0.101, 0, 0.2]], atol=1e-15)


@pytest.mark.parametrize(
    ("surface", "length"),
    [
        (Segment(name="s", start=(0, 0), end=(3, 4)), 5.0),
        (Polyline(name="p", points=((0, 0), (1, 0), (1, 2))), 3.0),
        (Arc(name="a", center=(1, 1), radius=0.5, start_angle=-30, stop_angle=60), 0.25 * np.pi),
        (Circle(name="c", center=(0, 2), radius=0.1), 0.2 * np.pi),
    ],
)
def test_samples_cover_the_length_of_a_surface(surface, length):
    points, normals, lengths = surface.sample(1e-3)
    assert lengths.sum() == pytest.approx(length, rel=1e-5)
    assert lengths.max() <= 1e-3 * (1 + 1e-9)
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert len(points) == len(normals) == len(lengths)


def test_samples_of_a_circle_lie_on_it_and_their_normals_point_outward():
    points, normals, _ = Circle(name="c", center=(0.3, 2), radius=0.1).sample(1e-3)
    outward = points - [0.3, 2]
    assert_allclose(np.linalg.norm(outward, axis=1), 0.1, rtol=1e-4)
    assert_allclose(np.sum(outward * normals, axis=1), 0.1, rtol=1e-4)


def test_the_ends_of_an_arc_follow_the_compass_of_mathematics():
    vertices = Arc(name="a", center=(0, 0), radius=2, start_angle=0, stop_angle=90).pieces(0.1)[0]
    assert_allclose(vertices[[0, -1]], [[2, 0], [0, 2]], atol=1e-15)


@pytest.mark.parametrize(
    ("content", "mistakes"),
    [
        (room({**WALL, "strat": [0, 0]}), ["surface[0].strat is not a known entry, did you mean 'start'?"]),
        (room({k: v for k, v in WALL.items() if k != "end"}), ["surface[0].end is missing"]),
        (room({**WALL, "kind": "wall"}), ["surface[0].kind is 'wall', expected one of segment, polyline, arc, circle"]),
        (room({"name": "wall"}), ["surface[0].kind is missing"]),
        (room({**WALL, "end": [0, 1]}), ["surface[0]", "the same point"]),
        (room(WALL, WALL), ["surface names must differ", "'wall'"]),
        (room({**WALL, "material": "plasterbord"}), ["surface[0].material", "plasterbord"]),
        (room({**WALL, "start": [0, float("nan")]}), ["surface[0].start"]),
        (room(band={"start": 300e9, "stop": 290e9, "points": 11}), ["band", "must lie above start"]),
        (room(array={"elements": 0, "pitch": 0.5e-3}), ["array.elements is 0"]),
        (room(array={"elements": 5, "pitch": 1e-3, "direction": [0, 0]}), ["array", "direction"]),
        (room({**WALL, "roughness": {"rms_height": -1, "correlation_length": 1}}), ["roughness.rms_height is -1"]),
        (
            room(
                array={"elements": 5, "pitch": 1, "rx": {"elements": 5, "pitch": 1, "rx": {"elements": 5, "pitch": 1}}}
            ),
            ["array: rx is the receiving array and has an rx of its own"],
        ),
        (room(dimensions=4), ["room.toml: dimensions is 4, expected 2 or 3"]),
        ({**room(), "arrays": {}}, ["arrays is not a known entry, did you mean 'array'?"]),
        ({"name": "nothing"}, ["array is missing", "band is missing"]),
        (
            room({"name": "c", "kind": "circle", "center": [0, 1], "radius": 0.1, "thickness": 0.01}),
            ["surface[0].thickness: kind 'circle' has no thickness; remove it, or take segment or polyline"],
        ),
        (room(array={"elements": 5, "pitch": 1e-3, "radius": 1}), ["array.radius is not a known entry, though others"]),
        (room(WALL, polarization="LHCP"), ["room.toml: polarization is 'LHCP', expected 'TE' or 'TM' or 'both'"]),
        (
            room({**WALL, "material": {"permittivity": 0.5}}),
            ["room.toml: surface[0].material.permittivity is 0.5, expected greater than or equal to 1"],
        ),
        (room({**WALL, "material": 5}), ["room.toml: surface[0].material is 5, expected a valid string or a table"]),
        (room(WALL, WALL), ["room.toml: surface names must differ"]),
        (
            room({"name": "p", "kind": "polyline", "points": [[-0.3, 1], [0.3, 1.1], [-0.3, 1]]}),
            ["surface[0]: crosses itself or folds back at (0.3, 1.1) m"],
        ),
        (
            room({"name": "p", "kind": "curve", "points": [[-0.3, 1], [0.3, 1.3], [0.3, 1], [-0.3, 1.3]]}),
            ["surface[0]: crosses itself or folds back at (-0.2064, 1.15) m"],
        ),
        (
            room(array={"elements": True, "pitch": True}),
            ["array.elements: true is no number", "array.pitch: true is no"],
        ),
        (room({**WALL, "start": [False, 1]}), ["surface[0].start[0]: false is no number; write one"]),
        (room({**WALL, "start": [0, 1, 0]}), ["surface[0].start has the length 3, [0, 1, 0], expected at most 2"]),
        (
            room({"name": "p", "kind": "polyline", "points": [[0, 1]]}),
            ["surface[0].points has the length 1, [[0, 1]], expected at least 2"],
        ),
        ({**room(), "surface": WALL}, ["surface is a single table, expected a list of tables; write [[surface]]"]),
        (
            room(
                {**WALL, "strat": 1}, {**WALL, "name": "b", "kind": "arch"}, band={"start": 1, "stop": 2, "points": 1}
            ),
            ["surface[0].strat", "surface[1].kind is 'arch'", "band.points is 1"],
        ),
    ],
)
def test_every_mistake_is_named_with_its_place(content, mistakes):
    with pytest.raises(InputError) as caught:
        parse_scene(content, source="room.toml")
    message = str(caught.value)
    assert message.startswith("room.toml: ")
    assert "\n" not in message
    for mistake in mistakes:
        assert mistake in message


def test_a_missing_file_and_bad_toml_are_one_sentence(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.toml: does not exist"):
        load_scene(tmp_path / "nowhere.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("name = [", encoding="utf-8")
    with pytest.raises(InputError, match="not valid TOML"):
        load_scene(broken)


def test_the_scene_of_the_demonstration_hides_its_objects():
    from importlib.resources import files

    from mirrorfold.common.geometry import crossing

    text = files("mirrorfold").joinpath("scenes/shipped/hidden_corner.toml").read_text(encoding="utf-8")
    scene = parse_scene(tomllib.loads(text))
    surfaces = {surface.name: surface for surface in scene.surface}
    partition = surfaces["partition"]
    for name in ("corner", "screen"):
        points, _, _ = surfaces[name].sample(0.01)
        along_ray, along_partition = crossing([0.0, 0.0], points, partition.start, partition.end)
        assert ((along_ray > 0.0) & (along_ray < 1.0)).all()
        assert ((along_partition > 0.0) & (along_partition < 1.0)).all()


def test_load_reads_scenes_too(scene_file):
    assert mf.load(scene_file) == load_scene(scene_file)
