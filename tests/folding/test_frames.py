"""Recordings: each frame gives what it gives alone, in one file, and what is done is never done again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.common.arcs import mirror_places
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.folding.confident import confident_points
from mirrorfold.folding.frames import frame_count, join_frames
from mirrorfold.io.plans import read_plan

X, Y = np.arange(-0.7, 1.7, 0.02), np.arange(0.3, 2.7, 0.02)
WALL = np.array([[0.9, 0.9], [0.3, 1.9]])


@pytest.fixture(scope="module")
def recording():
    """Three frames: an object walks before a wall, which shows it around the corner; in the last the wall has gone."""
    frames = []
    for number in range(3):
        wall = diffuse(*WALL, seed=1)
        start = np.array([-0.45 + 0.1 * number, 1.2])
        body, amplitude = diffuse(start, start + np.array([0.1, 0.05]), seed=2 + number, strength=3.0)
        ghost = reflect(body, WALL[0], segment_normal(*WALL))
        seen = [(ghost, amplitude)] if number < 2 else [(body, amplitude)]
        frames.append(radar_image(*together(*([wall] if number < 2 else []), *seen), X, Y))
    return xr.concat(frames, "frame").assign_coords(time=("frame", [0.0, 0.5, 1.0]))


@pytest.fixture(scope="module")
def folded(recording):
    return mf.fold(recording)


def on_disk(tree, path):
    return mf.load(mf.save(tree, path))


def assert_same(first, second):
    for path in ("/", "/initial", "/objects", "/mirrors"):
        a, b = (tree[path].to_dataset(inherit=False) for tree in (first, second))
        xr.testing.assert_identical(a, b)


@pytest.mark.slow
def test_a_frame_is_what_it_is_alone(recording, folded, tmp_path):
    again = on_disk(folded, tmp_path / "all.nc")
    for number in (0, 2):
        alone = on_disk(mf.fold(recording.isel(frame=number)), tmp_path / "alone.nc")
        assert_same(on_disk(mf.pick_frame(folded, number), tmp_path / "one.nc"), alone)
        assert_same(on_disk(mf.pick_frame(again, number), tmp_path / "one.nc"), alone)


def test_a_recording_has_frames_in_its_pictures_and_tables(folded):
    assert folded["intensity"].dims == folded["initial/initial"].dims == ("frame", "y", "x")
    np.testing.assert_array_equal(folded["time"], [0.0, 0.5, 1.0])
    objects, mirrors = (folded.children[name].to_dataset(inherit=False) for name in ("objects", "mirrors"))
    assert set(np.unique(objects["frame"])) == {0, 1, 2}
    assert 2 not in mirrors["frame"]
    hidden = objects.isel(point=(objects["bounces"] > 0).values)
    for number in (0, 1):
        middle = hidden.isel(point=(hidden["frame"] == number).values)
        place = np.median(middle["x"]), np.median(middle["y"])
        np.testing.assert_allclose(place, [-0.4 + 0.1 * number, 1.225], atol=0.03)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:y reaches beyond the ambiguous range")
def test_a_sweep_with_frames_is_focused_and_folded_frame_by_frame(sweep, tmp_path):
    s = sweep["s"].values
    recording = sweep.assign(s=(("frame", *sweep["s"].dims), np.stack([s, 2.0 * s])))
    grid = {"x": np.arange(-0.3, 0.3, 0.01), "y": np.arange(0.2, 0.7, 0.01)}
    calls = []
    found = mf.reconstruct(recording, **grid, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 2), (2, 2)]
    for number in range(2):
        alone = on_disk(mf.reconstruct(mf.pick_frame(recording, number), **grid), tmp_path / "alone.nc")
        assert_same(on_disk(mf.pick_frame(found, number), tmp_path / "one.nc"), alone)
    np.testing.assert_allclose(2.0 * found["initial/initial"][0], found["initial/initial"][1], rtol=1e-4)


@pytest.fixture
def done(monkeypatch):
    """One entry for each frame that is folded. Ctrl-C comes before the third, unless the list is cleared."""
    from mirrorfold import reconstruction

    real, done = reconstruction.FoldPlan.fold, []

    def interrupted(self, **given):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(1)
        return real(self, **given)

    monkeypatch.setattr(reconstruction.FoldPlan, "fold", interrupted)
    return done


@pytest.mark.slow
def test_frames_that_are_done_are_not_done_again(recording, folded, done):
    finished = {}
    with pytest.raises(KeyboardInterrupt):
        mf.fold(recording, finished=finished)
    assert list(finished) == [0, 1]
    done.clear()
    assert_same(mf.fold(recording, finished=finished), folded)
    assert len(done) == 1


@pytest.mark.slow
def test_an_interrupted_command_goes_on_where_it_was(recording, folded, done, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(recording, "recording.nc")
    assert main(["fold", "recording.nc", "-o", "out.nc"]) == 130
    assert "2 frames that are done are kept in out.nc.frames" in capsys.readouterr().err
    assert not (tmp_path / "out.nc").exists()
    done.clear()
    assert main(["fold", "recording.nc", "-o", "out.nc", "--json"]) == 0
    printed = capsys.readouterr()
    assert "2 frames were done before" in printed.err
    assert len(done) == 1
    assert sum(check("fold", printed.out).points_by_frame) == confident_points(folded).sizes["point"]
    assert [path.name for path in tmp_path.iterdir() if "frames" in path.name] == []
    result = mf.load("out.nc")
    assert result.attrs.pop("command").startswith("mirrorfold fold recording.nc")
    assert_same(result, on_disk(folded, "x.nc"))


@pytest.mark.slow
def test_reconstruct_writes_one_folder_for_a_recording(sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    s = sweep["s"].values
    mf.save(sweep.assign(s=(("frame", *sweep["s"].dims), np.stack([s, s]))), "recording.nc")
    grid = ["--x", "-0.2:0.2:0.01", "--y", "0.2:0.55:0.01"]
    assert main(["reconstruct", "recording.nc", "-o", "out", *grid, "--export", "all.vtp", "--json"]) == 0
    found = check("reconstruct", capsys.readouterr().out)
    assert len(found.points_by_frame) == 2
    assert {"out/reconstruction.nc", "out/frames.png", "out/before_after.png", "out/report.html"} < set(found.files)
    assert "point target frame 0" in (tmp_path / "out/report.html").read_text()
    assert main(["report", "out/reconstruction.nc", "--frame", "1", "-o", "one.html"]) == 0
    assert "<title>point target frame 1 - mirrorfold</title>" in (tmp_path / "one.html").read_text()
    assert not (tmp_path / "out.frames").exists()


@pytest.mark.slow
def test_frames_of_other_settings_are_made_anew(recording, tmp_path, monkeypatch):
    from mirrorfold.io.own.frame_folder import FrameFolder

    monkeypatch.chdir(tmp_path)
    path = mf.save(recording, tmp_path / "recording.nc")
    kept = FrameFolder(tmp_path / "f", [path], {"x": np.arange(3.0)})
    kept[0] = mf.fold(recording.isel(frame=0))
    assert list(FrameFolder(tmp_path / "f", [path], {"x": np.arange(3.0)})) == [0]
    with pytest.warns(UserWarning, match="of other inputs or settings; all are made anew"):
        assert list(FrameFolder(tmp_path / "f", [path], {"x": np.arange(4.0)})) == []
    (tmp_path / "mine").mkdir()
    with pytest.raises(mf.InputError, match="in the way"):
        FrameFolder(tmp_path / "mine", [path], {})


@pytest.mark.slow
def test_a_frame_that_cannot_be_trusted_is_made_again(recording, folded, tmp_path):
    from mirrorfold.io.own.frame_folder import FrameFolder

    path = mf.save(recording, tmp_path / "recording.nc")
    kept = FrameFolder(tmp_path / "f", [path], {})
    for number in range(3):
        kept[number] = on_disk(mf.pick_frame(folded, number), tmp_path / "one.nc")
    assert_same(kept[1], on_disk(mf.pick_frame(folded, 1), tmp_path / "one.nc"))
    flipped = bytearray((tmp_path / "f/00001.nc").read_bytes())
    flipped[len(flipped) // 2] ^= 1
    (tmp_path / "f/00001.nc").write_bytes(flipped)
    (tmp_path / "f/00002.nc").write_bytes((tmp_path / "f/00000.nc").read_bytes())
    with pytest.warns(UserWarning, match=r"00001\.nc, 00002\.nc cannot be trusted"):
        assert list(FrameFolder(tmp_path / "f", [path], {})) == [0]


@pytest.fixture
def files(recording, folded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mf.save(recording, "recording.nc")
    mf.save(folded, "folded.nc")
    return tmp_path


@pytest.mark.slow
def test_every_verb_can_deal_with_a_recording(files, scene_file, capsys):
    assert main(["info", "folded.nc", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dimensions"]["frame"] == len(found["points_by_frame"]) == 3
    assert {mirror["frame"] for mirror in found["mirrors"]} == {0, 1}
    assert main(["info", "folded.nc"]) == 0
    assert "frame  mirrors  points" in capsys.readouterr().out
    for one in (["report", "folded.nc", "-o", "r.html"], ["score", "folded.nc", str(scene_file)]):
        assert main(one) == 2
        assert "3 frames, numbered from 0 to 2" in capsys.readouterr().err
        assert main([*one, "--frame", "1"]) == 0
        assert main([*one, "--frame", "7"]) == 2
    assert main(["show", "folded.nc", "-o", "f.png", "--dpi", "40"]) == 0
    assert main(["show", "folded.nc", "-o", "f.png", "--dpi", "40", "--frame", "2", "--what", "corrected"]) == 0
    assert main(["show", "recording.nc", "-o", "f.png", "--dpi", "40", "--frame", "2"]) == 0
    assert main(["fold", "folded.nc", "-o", "again.nc"]) == 0
    assert frame_count(mf.load("again.nc")) == 3


@pytest.mark.slow
def test_a_frame_that_cannot_be_folded_is_named(recording):
    broken = recording.copy()
    broken[1, 5, 5] = np.nan
    with pytest.raises(mf.InputError, match=r"frame 1: .* not finite"):
        mf.fold(broken)


def test_frames_of_scans_share_a_grid_though_none_may_reach_over_all_of_it(folded_scan):
    """Each plan view ends where its points do; what lies between two of them belongs to neither."""
    far = xr.DataTree.from_dict({
        node.path: node.to_dataset(inherit=False).assign_coords(x=folded_scan["x"].values + 10.0)
        if node.path in ("/", "/initial") else node.to_dataset(inherit=False) for node in folded_scan.subtree
    })  # fmt: skip
    both = join_frames([folded_scan, far], {})
    np.testing.assert_allclose(np.diff(both["x"]), 0.02, rtol=1e-6)
    for number, one in enumerate((folded_scan, far)):
        picked = mf.pick_frame(both, number)
        np.testing.assert_array_equal(picked["intensity"], one["intensity"])
        np.testing.assert_array_equal(picked["x"], one["x"])
        np.testing.assert_array_equal(picked["objects"]["z"], one["objects"]["z"])


def with_columns(tree, group, **columns):
    """A Reconstruction whose table has further columns, of one value each."""
    table = tree[group].to_dataset(inherit=False)
    ((dimension, size),) = [item for item in table.sizes.items() if item[0] in ("point", "mirror")]
    nodes = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    nodes[f"/{group}"] = table.assign({name: (dimension, np.full(size, value)) for name, value in columns.items()})
    return xr.DataTree.from_dict(nodes)


@pytest.mark.parametrize("order", [1, -1])
def test_walls_that_only_some_frames_let_through_are_kept(reconstruction, tmp_path, order):
    """Texts that a frame lacked became numbers, which no file can hold: the recording was lost when it was done."""
    through = with_columns(reconstruction, "objects", passed=np.float32(0.9), wall="0", decided="polarization")
    parts = [through, reconstruction][::order]
    again = on_disk(join_frames(parts, {}), tmp_path / "all.nc")
    for number, part in enumerate(parts):
        held = again["objects"].to_dataset(inherit=False)
        walls = held["wall"].values[held["frame"].values == number]
        assert set(walls.tolist()) == {"0" if part is through else ""}
        assert_same(on_disk(mf.pick_frame(again, number), tmp_path / "one.nc"), on_disk(part, tmp_path / "alone.nc"))
    assert mf.info(again).points_through_walls == 5


@pytest.mark.parametrize("order", [1, -1])
def test_flat_mirrors_stay_flat_beside_frames_with_curved_ones(reconstruction, tmp_path, order):
    line = [[-0.6, 1.7], [-0.7, 0.9]]
    curved = mf.fold(reconstruction, mirrors=[[[0.4, 1.6], [0.47, 1.22], [0.6, 0.9]]])
    flat = mf.fold(reconstruction, mirrors=[line])
    parts = [curved, flat][::order]
    joined = join_frames(parts, {})
    places = mirror_places(joined["mirrors"].to_dataset(inherit=False), "folded_")[::order]
    assert [len(place) for place in places] == [3, 2]
    np.testing.assert_allclose(places[1], line)
    assert len(read_plan(mf.export(joined, tmp_path / "plan.geojson")).lines) == 2
    for number, part in enumerate(parts):
        assert_same(mf.pick_frame(on_disk(joined, tmp_path / "all.nc"), number), on_disk(part, tmp_path / "one.nc"))


@pytest.mark.parametrize("text", ["", "[1]", "{", '{"lacking": 3}'])
def test_damaged_attributes_of_a_frame_are_a_sentence(reconstruction, text):
    joined = join_frames([reconstruction] * 2, {})
    joined.dataset = joined.to_dataset().assign(attributes=("frame", np.array(["{}", text])))
    assert mf.pick_frame(joined, 0)["objects"].sizes["point"] == 5
    with pytest.raises(mf.InputError, match=r"the attributes of frame 1.*; reconstruct again"):
        mf.pick_frame(joined, 1)
