"""Input that once hung, or came out as a mistake of our own: each is one sentence, and exit code 2."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.reading import quoting_nothing_outside
from mirrorfold.io.scans.positions import read_positions

SCENE = Path(__file__).parents[1].joinpath("one_wall.toml").read_text(encoding="utf-8")
WALL = 'kind = "segment"\nstart = [-0.2, 0.3]\nend = [0.2, 0.34]'


def refused(capsys, *arguments, word=""):
    """Run the command line, which must refuse its input; returns what it says."""
    assert main([str(word) for word in arguments]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("mirrorfold: ")
    assert "mistake of its own" not in said
    assert word in said
    return said


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000 + "]" * 5000,
        "a = " + "{b=" * 3000 + "1" + "}" * 3000,
        "a = " + "9" * 5000,
        "a." * 40000 + "a = 1\n",
        "b = 1\n[" + "a . " * 40000 + "a]\n",
        "b = {" + r'"\"." . ' * 40000 + "'a' = 1}\n",
    ],
    ids=["arrays", "tables", "digits", "name", "heading", "quoted name"],
)
def test_toml_that_is_too_deep_or_too_long(folder, capsys, text):
    (folder / "a.toml").write_text(text)
    refused(capsys, "info", "a.toml", word="a.toml: is not valid TOML")
    refused(capsys, "import", "s.nc", "--mapping", "a.toml", "-o", "o.nc", word="a.toml: is not valid TOML")


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", ["[" * 100_000 + "]" * 100_000, '{"mirrors": ' + "9" * 5000 + "}"], ids=["deep", "digits"]
)
def test_json_that_is_too_deep_or_too_long(folder, capsys, text):
    for name in ("a.json", "a.geojson"):
        (folder / name).write_text(text)
        refused(capsys, "fold", "i.nc", "--mirrors", name, "-o", "o.nc", word=f"{name}: is not valid JSON")
    refused(capsys, "calibrate", "s.nc", "--elements", "a.json", "-o", "o.nc", word="a.json: is not valid JSON")


def test_numbers_of_hundreds_of_digits(folder, capsys):
    (folder / "a.json").write_text(json.dumps({"mirrors": [{"start": [10**400, 0], "end": [1, 1]}]}))
    refused(capsys, "fold", "i.nc", "--mirrors", "a.json", "-o", "o.nc", word="expected for each mirror")
    (folder / "a.geojson").write_text(json.dumps({"type": "LineString", "coordinates": [[10**400, 0], [1, 1]]}))
    refused(capsys, "fold", "i.nc", "--mirrors", "a.geojson", "-o", "o.nc", word="without proper coordinates")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("suffix", ["", ".nc", ".toml", ".geojson", ".dxf", ".csv", ".npy"])
def test_pipes_are_not_waited_for(folder, capsys, suffix):
    pipe = f"pipe{suffix}"
    os.mkfifo(pipe)
    end = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    os.write(end, b"not a file")
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.alarm(60)  # a reader that waits is interrupted
    try:
        for arguments in (
            ["info", pipe],
            ["focus", pipe, "-o", "o.nc"],
            ["import", pipe, "-o", "o.nc"],
            ["view", pipe, "--no-open"],
            ["fold", "i.nc", "--mirrors", pipe, "-o", "o.nc"],
            ["score", "r.nc", pipe],
            ["calibrate", "s.nc", "-o", "o.nc", "--elements", pipe],
            ["calibrate", "s.nc", "-o", "o.nc", "--background", pipe],
            ["import", "s.nc", "-o", "o.nc", "--mapping", pipe],
        ):
            refused(capsys, *arguments, word="is no file but a device, a pipe or a socket")
        if suffix in (".csv", ".npy"):
            curve = SCENE.replace(WALL, f'kind = "curve"\nfile = "{pipe}"')
            (folder / "scene.toml").write_text(curve)
            refused(capsys, "info", "scene.toml", word="is no file but a device, a pipe or a socket")
        assert os.read(end, 100) == b"not a file"
    finally:
        signal.alarm(0)
        os.close(end)


@pytest.mark.parametrize("far", [1e308, 1e12])
def test_places_that_no_echo_returns_from(folder, capsys, far):
    (folder / "a.toml").write_text(SCENE.replace("[-0.2, 0.3]", f"[{far}, 0.3]"))
    refused(capsys, "info", "a.toml", word="start")
    (folder / "a.toml").write_text(SCENE.replace("pitch = 0.5e-3", f"pitch = {far}"))
    refused(capsys, "simulate", "a.toml", "-o", "o.nc", word="pitch")
    (folder / "a.json").write_text(json.dumps({"mirrors": [{"start": [far, -far], "end": [-far, 1]}]}))
    refused(capsys, "fold", "i.nc", "--mirrors", "a.json", "-o", "o.nc", word="farther away than")
    (folder / "a.geojson").write_text(json.dumps({"type": "LineString", "coordinates": [[far, 0], [1, 1]]}))
    refused(capsys, "fold", "i.nc", "--mirrors", "a.geojson", "-o", "o.nc", word="farther away than")
    for file, place, arguments in (
        ("s.nc", "tx_position", ["focus", "s.nc", "-o", "o.nc"]),
        ("i.nc", "x", ["fold", "i.nc", "-o", "o.nc"]),
        ("r.nc", "mirrors/x0", ["report", "r.nc", "-o", "o.html"]),
    ):
        with h5py.File(file, "a") as content:
            content[place][...] = far
        refused(capsys, *arguments, word="farther away than")


@pytest.mark.parametrize("level", ["7296", "-1e5", "1e308"])
def test_levels_that_no_measurement_spans(folder, capsys, level):
    refused(capsys, "fold", "i.nc", "-o", "o.nc", f"--threshold-db={level}", word="threshold_db is")


def test_walls_longer_than_can_be_followed(folder, capsys):
    (folder / "a.toml").write_text(SCENE.replace("[-0.2, 0.3]", "[-9e6, 0.3]"))
    refused(capsys, "info", "a.toml", word="give lengths in metres")
    (folder / "a.json").write_text(json.dumps({"mirrors": [{"start": [-9e6, 1], "end": [9e6, 1]}]}))
    refused(capsys, "fold", "i.nc", "--mirrors", "a.json", "-o", "o.nc", word="1.8e+07 m long")


LONG = "x" * 300


@pytest.mark.parametrize(
    "arguments",
    [
        ["info", f"{LONG}.nc"],
        ["info", f"{LONG}.toml"],
        ["fold", "i.nc", "-o", f"{LONG}.nc"],
        ["reconstruct", "s.nc", "-o", LONG],
        ["fold", "i.nc", "--mirrors", f"{LONG}.json", "-o", "o.nc"],
        ["import", f"{LONG}.csv", "-o", "o.nc"],
        ["import", "s.nc", "--mapping", LONG, "-o", "o.nc"],
        ["calibrate", "s.nc", "-o", "o.nc", "--elements", LONG],
        ["view", LONG],
        ["info", "a/" * 3000 + "x.nc"],
        ["info", "loop.nc"],
        ["fold", "i.nc", "-o", "loop.nc"],
        ["info", "zero\0byte.nc"],
        ["fold", "i.nc", "-o", "zero\0byte.nc"],
    ],
    ids=lambda words: " ".join(word[:9] for word in words),
)
def test_names_that_no_file_can_have(folder, capsys, arguments):
    (folder / "loop.nc").symlink_to("loop.nc")
    refused(capsys, *arguments)


def test_names_that_are_as_long_as_they_may_be(folder, image):
    name = "y" * 252 + ".nc"
    assert mf.save(image, name).is_file()
    assert [path.name for path in folder.glob("*y*")] == [name]


def empty(file, name):
    file.attrs[name] = h5py.Empty("f")


def two(file, name):
    file.attrs[name] = np.arange(2)


def null(file, name):
    file.attrs[name] = "null"


@pytest.mark.slow
@pytest.mark.parametrize("change", [empty, two, null])
@pytest.mark.parametrize(
    ("file", "name", "arguments"),
    [
        ("s", "processing", ["calibrate", "s.nc", "-o", "o.nc", "--frequency-unit", "Hz"]),
        ("s", "title", ["focus", "s.nc", "-o", "o.nc"]),
        ("r", "title", ["report", "r.nc", "-o", "o.html"]),
        ("r", "fold_wall_margin", ["report", "r.nc", "-o", "o.html"]),
    ],
)
def test_attributes_of_another_kind_do_no_harm(folder, file, name, arguments, change):
    with h5py.File(f"{file}.nc", "a") as content:
        change(content, name)
    assert main(arguments) == 0


@pytest.mark.slow
@pytest.mark.parametrize("change", [empty, two])
@pytest.mark.parametrize(
    ("file", "name", "verb"),
    [("s.nc", "time_convention", "focus"), ("s.nc", "origin", "focus"), ("r.nc", "radar_x", "fold")],
)
def test_attributes_that_matter_are_refused(folder, capsys, file, name, verb, change):
    with h5py.File(file, "a") as content:
        change(content, name)
    refused(capsys, verb, file, "-o", "o.nc", word=name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "values"),
    [
        ("mirrors/x0", [1 + 1j]),
        ("mirrors/x0", [np.nan]),
        ("mirrors/strength", [1 + 1j]),
        ("mirrors/parent", [-7]),
        ("objects/x_initial", [1 + 1j] * 5),
        ("objects/amplitude", [np.nan] * 5),
        ("objects/bounces", [np.nan] * 5),
        ("objects/bounces", [10**9] * 5),
    ],
)
def test_columns_that_are_no_numbers(folder, capsys, place, values):
    group, _, name = place.partition("/")
    with h5py.File("r.nc", "a") as content:
        column = content[place]
        scales = [scale.name for scale in column.dims[0].values()]
        content.create_dataset("other", data=np.array(values))
        del content[place]
        content.move("other", place)
        for scale in scales:
            content[place].dims[0].attach_scale(content[scale])
    for verb in (["report", "r.nc", "-o", "o.html"], ["export", "r.nc", "-o", "o.geojson"]):
        said = refused(capsys, *verb, word=f"'{name}' in the group /{group}")
        assert "r.nc" in said


def test_cells_far_smaller_than_the_memory(folder, capsys):
    with h5py.File("i.nc", "a") as content:
        facts = {"frequency_start": 1e9, "frequency_stop": 2e9, "frequency_points": 11, "rx_aperture": 1.0}
        content.attrs.update({**facts, "tx_aperture": 1e15, "rx_aperture": 1e15})
    refused(capsys, "fold", "i.nc", "-o", "o.nc", word="GB of memory")


@pytest.mark.slow
@pytest.mark.parametrize("change", [np.flip, lambda x: np.where(x == x[3], x[5], x), lambda x: np.full_like(x, np.nan)])
def test_pictures_whose_pixels_stand_anywhere(folder, capsys, change):
    with h5py.File("r.nc", "a") as content:
        content["x"][...] = change(content["x"][...])
    for verb in (["report", "r.nc", "-o", "o.html"], ["show", "r.nc", "-o", "o.png"], ["fold", "r.nc", "-o", "o.nc"]):
        refused(capsys, *verb, word="coordinate 'x' ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("wave_speed", "{}"),
        ("wave_speed", 0.0),
        ("frequency_start", np.nan),
        ("frequency_stop", np.inf),
        ("frequency_points", -1),
        ("range_resolution", "x"),
        ("tx_aperture", np.arange(2)),
        ("radar_position", 1.0),
        ("radar_position", np.array([np.nan, 0.0])),
        ("array_direction", np.zeros(3)),
    ],
)
def test_facts_of_the_measurement_that_are_none(folder, capsys, name, value):
    for file, prefix, verb in (("i.nc", "", "info"), ("i.nc", "", "fold"), ("r.nc", "image_", "report")):
        with h5py.File(file, "a") as content:
            content.attrs[f"{prefix}{name}"] = value
        output = [] if verb == "info" else ["-o", "o.nc" if verb == "fold" else "o.html"]
        refused(capsys, verb, file, *output, word=f"attr {prefix}{name} is ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "word"),
    [
        ("objects/z_initial", "'z_initial' is missing from the group /objects"),
        ("mirrors/folded_z1", "'folded_z1' is missing from the group /mirrors"),
        ("mirrors/corner_y", "'corner_y' is missing from the group /mirrors"),
    ],
)
def test_volumes_without_one_of_their_columns(folder, capsys, folded_scan, place, word):
    mf.save(folded_scan, "v.nc")
    with h5py.File("v.nc", "a") as content:
        del content[place]
    for verb in (["report", "v.nc", "-o", "o.html"], ["show", "v.nc", "-o", "o.png"]):
        refused(capsys, *verb, word=word)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_corners_that_are_not_those_of_the_mirrors(folder, capsys, folded_scan):
    mf.save(folded_scan, "v.nc")
    with h5py.File("v.nc", "a") as content:
        del content["mirrors/folded_corner_z"]
        content["mirrors/folded_corner_z"] = np.zeros((4, 1, 1))
    refused(capsys, "report", "v.nc", "-o", "o.html", word="'folded_corner_z' in the group /mirrors has dimensions")


@pytest.mark.filterwarnings("default")  # of the libraries that read it
@pytest.mark.parametrize(("file", "name", "scale"), [("s", "s", "axis"), ("i", "image", "x")])
def test_dimensions_that_contradict_each_other(folder, capsys, file, name, scale):
    with h5py.File(f"{file}.nc", "a") as content:
        first = content[name].dims[0]
        for old in list(first.values()):
            first.detach_scale(old)
        first.attach_scale(content[scale])
    for verb in (["info", f"{file}.nc"], ["show", f"{file}.nc", "-o", "o.png"]):
        refused(capsys, *verb, word="conflicting sizes for dimension")


@pytest.fixture
def inner(folder):
    """A folder whose files may name those of the folder around it."""
    (folder / "inner").mkdir()
    return folder / "inner"


OUTSIDE = "'../secret.csv', which is outside of the folder"

LINES = {
    "no table": "nobody:x:0:0\nnobody:x:1:1\n",
    "headings alone": "nobody,x\n1,2\n",
    "a table of files": "file,x,y,z\nnobody,1,2,3\n",
    "a table without places": "file,word\nnobody,nobody\n",
    "few numbers": "12345,99\n12345,99\n",
    "numbers beyond reason": "12345,99\n12345e9,99\n12345,98\n1,2\n",
}


@pytest.mark.parametrize("lines", LINES.values(), ids=LINES.keys())
@pytest.mark.parametrize("named_by", ["scan", "curve", "directions", "mapping", "places"])
def test_what_lies_outside_is_named_but_not_shown(inner, capsys, named_by, lines):
    """Whichever step finds the error, and whether the file can be read or not."""
    (inner.parent / "secret.csv").write_text(lines)
    file = inner / f"{named_by}.toml"
    verb = ("info", file)
    if named_by == "scan":
        file.write_text('table = "../secret.csv"\n')
        verb = ("import", "s.nc", "--positions", file, "-o", "o.nc")
    elif named_by == "curve":
        file.write_text(SCENE.replace(WALL, 'kind = "curve"\nfile = "../secret.csv"'))
    elif named_by == "directions":
        file.write_text(
            'name = "x"\ndimensions = 3\n[scanner]\ndirections = "../secret.csv"\nspot_radius = 0.02\n'
            "focus_distance = 1.0\n[band]\nstart = 290e9\nstop = 300e9\npoints = 11\n"
            '[[surface]]\nname = "wall"\nkind = "plane"\n'
        )
    else:
        np.savez(inner / "d.npz", s=np.ones((3, 3, 3), complex))
        frequency = '{file = "../secret.csv", column = "nothing"}' if named_by == "mapping" else "[1e9, 2e9, 3e9]"
        places = '{file = "../secret.csv"}' if named_by == "places" else "{x = [0.0, 1.0, 2.0], unit = 'm'}"
        samples = "s = {variable = 's', dims = ['frequency', 'tx', 'rx']}"
        file.write_text(f"{samples}\nfrequency = {frequency}\ntx = {places}\nrx = {places}\n")
        verb = ("import", inner / "d.npz", "--mapping", file, "-o", "o.nc")
    said = refused(capsys, *verb, word=OUTSIDE)
    assert not any(word in said for word in ("nobody", "12345", "word"))


def test_remarks_do_not_quote_what_lies_outside_either(inner):
    """The table can be used, but for a column that is not understood."""
    (inner.parent / "secret.csv").write_text("file,x,nobody\na.s1p,0,1\n")
    (inner / "scan.toml").write_text('table = "../secret.csv"\n')
    with quoting_nothing_outside(), pytest.warns(UserWarning, match="some columns are not understood") as said:
        read_positions(inner / "scan.toml")
    assert "nobody" not in str(said[0].message)


def test_what_lies_beside_is_said(folder, capsys):
    (folder / "secret.csv").write_text(LINES["no table"])
    (folder / "scene.toml").write_text(SCENE.replace(WALL, 'kind = "curve"\nfile = "secret.csv"'))
    refused(capsys, "info", "scene.toml", word="secret.csv cannot be read")


@pytest.mark.parametrize("name", ["\\u0000", 300 * "x"])
def test_files_whose_names_no_file_can_have(folder, capsys, name):
    (folder / "scan.toml").write_text(f'table = "{name}.csv"\n')
    refused(capsys, "import", "s.nc", "--positions", "scan.toml", "-o", "o.nc")
    (folder / "scene.toml").write_text(SCENE.replace(WALL, f'kind = "curve"\nfile = "{name}.csv"'))
    refused(capsys, "info", "scene.toml")
    np.savez("d.npz", s=np.ones((3, 3, 3), complex))
    (folder / "m.toml").write_text(
        f's = {{variable = "s", dims = ["frequency", "tx", "rx"]}}\nfrequency = {{file = "{name}.csv", column = 0}}\n'
    )
    refused(capsys, "import", "d.npz", "--mapping", "m.toml", "-o", "o.nc")


@pytest.mark.parametrize("suffix", ["npy", "csv"])
def test_points_that_are_too_many_are_refused_before_they_are_read(folder, capsys, suffix):
    (folder / "scene.toml").write_text(SCENE.replace(WALL, f'kind = "curve"\nfile = "many.{suffix}"'))
    with open(f"many.{suffix}", "wb") as file:
        if suffix == "npy":
            np.lib.format.write_array_header_1_0(
                file, {"descr": "<f8", "fortran_order": False, "shape": (3 * 10**8, 2)}
            )
        file.truncate(file.tell() + 48 * 10**8)  # a sparse file, which takes no room
    refused(capsys, "info", "scene.toml", word="at most")


@pytest.mark.slow
def test_a_cluster_without_workers_is_not_waited_for(scene_file, monkeypatch):
    distributed = pytest.importorskip("distributed")
    from mirrorfold.simulation.fullwave import tasks

    monkeypatch.setattr(tasks, "CONNECT_SECONDS", 2)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None) as cluster,
        pytest.raises(mf.InputError, match="has no workers; start some with `dask worker"),
    ):
        mf.simulate(mf.load_scene(scene_file), solver="fullwave", scheduler=cluster.scheduler_address)


def test_frequencies_that_are_no_row_of_numbers(folder, capsys):
    with h5py.File("s.nc", "a") as content:
        count = content["frequency"].size
        del content["frequency"]
        content["frequency"] = np.zeros((count, 3))
    refused(capsys, "calibrate", "s.nc", "-o", "o.nc", "--frequency-unit", "Hz", word="frequency")
