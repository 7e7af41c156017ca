"""Each thing that can be wrong in a mapping, in a description of a scan, or between files: a sentence that names it."""

from __future__ import annotations

import errno
import os

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.io import files as output
from mirrorfold.io.own.steady import SteadyFile

F = np.linspace(1e9, 2e9, 7)
PLACES = np.random.default_rng(0).standard_normal((3, 3))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    s = np.random.default_rng(1).standard_normal((7, 3)) + 1j
    np.savez(
        "a.npz", s=s, frequency=F, places=PLACES, words=np.array(["a", "b"]), long=np.ones((7, 4)), re=s.real,
        flat=s.ravel(), times=np.arange(7) * 1e-9, uneven=np.arange(7.0) ** 2 * 1e-9, nan=PLACES * np.nan, real=s.real,
        cube=np.ones((7, 3, 5)), none=np.empty((7, 0)),
    )  # fmt: skip
    np.savetxt("table.csv", PLACES, delimiter=",")
    return tmp_path


def mapping(**changes):
    """A mapping that works, with some of it changed; None takes an entry out."""
    usual = {
        "s": {"variable": "s", "dims": ["frequency", "position"]},
        "frequency": "frequency",
        "antenna": {"position": "places"},
    }
    return {name: value for name, value in (usual | changes).items() if value is not None}


def samples(**changes):
    return mapping(s={"variable": "s", "dims": ["frequency", "position"]} | changes)


def of(variables, **changes):
    """Samples of two variables."""
    return mapping(s={"dims": ["frequency", "position"], **variables} | changes)


def test_the_mapping_that_is_changed_below_works(folder):
    assert mf.import_data("a.npz", mapping=mapping())["s"].shape == (7, 3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (of({"real": "re", "imaginary": "long"}), "have the shapes"),
        (samples(variable="words"), "expected numbers"),
        (samples(dims=["frequency", "re_im"]), "along 're_im', expected 2"),
        (samples(select={"tx": 0}), "select names the axis 'tx'"),
        (samples(select={"position": 9}), "select asks for 9"),
        (samples(variable="none"), "is empty"),
        (samples(skip=5), "5 columns are skipped"),
        (samples(variable="flat", shape=[7, 4]), "makes no"),
        (samples(variable="cube"), "cube"),
        (samples(dims=["position", "frequency"]), "values of frequency"),
        (samples(dims=["frequency", "frequency"]), "hold a name twice"),
        (samples(dims=["frequency", "time"]), "one of frequency, time and range"),
        (samples(dims=["frequency", "tx"]), "name what is not described"),
        (samples(real="re"), "give variable, or real and imaginary"),
        (mapping(band=[5e9, 6e9]), "holds none of the frequencies"),
        (mapping(band=[3.0, 2.0]), "is not a lower and an upper frequency"),
        (mapping(frequency={"variable": "long"}), "expected a row of real numbers"),
        (mapping(frequency={"variable": "frequency", "start": 1.0, "points": 7, "step": 1.0}), "give one of variable"),
        (mapping(frequency={"start": 1e9, "points": 7}), "start needs points and one of stop and step"),
        (mapping(frequency={"file": "table.csv", "column": 9}), "no column 9"),
        (mapping(antenna={"position": "places", "unit": "GHz"}), "antenna"),
        (mapping(antenna={"position": "nan"}), "not finite, the first as number 0"),
        (mapping(antenna={"position": "frequency"}), "expected \\(n, 3\\)"),
        (mapping(antenna={"position": [[0.0, 1.0], [0.0]]}), "different numbers of coordinates"),
        (mapping(antenna={"x": [0.0, 1.0], "y": [0.0, 1.0, 2.0]}), "coordinates of different lengths"),
        (mapping(antenna={"position": "places", "x": [0.0]}), "give one of position, file, or x, y and z"),
        (mapping(antenna={"position": "places", "axes": ["x", "-x", "z"]}), "hold a name twice"),
        (mapping(antenna={"position": [["1 mm", "2 GHz", 0]]}), "of several kinds"),
        (mapping(wave_speed=-1.0), "wave_speed is"),
        (mapping(wave_speed=3e8, relative_permittivity=2.0), "give one of wave_speed and relative_permittivity"),
    ],
)
def test_what_is_wrong_in_a_mapping(folder, given, words):
    with pytest.raises(mf.InputError, match=words):
        mf.import_data("a.npz", mapping=given)


def test_places_in_a_table_beside_the_file_and_as_rows(folder):
    table = mf.import_data("a.npz", mapping=mapping(antenna={"file": "table.csv"}))
    np.testing.assert_allclose(table["antenna_position"], PLACES)
    turned = mf.import_data("a.npz", mapping=mapping(antenna={"position": PLACES.T.tolist(), "axes": ["x", "-z", "y"]}))
    expected = np.stack([PLACES.T[:, 0], PLACES.T[:, 2], -PLACES.T[:, 1]], axis=-1)
    assert turned["antenna_position"].shape == expected.shape
    column = mf.import_data("a.npz", mapping=mapping(antenna={"x": {"file": "table.csv", "column": 0}}))
    np.testing.assert_allclose(column["antenna_position"][:, 0], PLACES[:, 0])


@pytest.mark.parametrize(
    ("time", "extra", "words"),
    [
        ("uneven", {}, "expected equal rising steps"),
        ("times", {"band": [1e15, 2e15]}, "holds none of the frequencies"),
    ],
)
def test_traces_over_time_that_give_no_spectrum(folder, time, extra, words):
    given = mapping(s={"variable": "real", "dims": ["time", "position"]}, frequency=None, time=time, **extra)
    with pytest.raises(mf.InputError, match=words):
        mf.import_data("a.npz", mapping=given)


def test_complex_traces_over_time_keep_their_positive_frequencies(folder):
    given = mapping(s={"variable": "s", "dims": ["time", "position"]}, frequency=None, time="times", band=[1e8, 4e8])
    sweep = mf.import_data("a.npz", mapping=given)
    np.testing.assert_allclose(sweep["frequency"], np.fft.fftfreq(7, 1e-9)[1:3])


@pytest.mark.parametrize(
    ("give", "words"),
    [
        ({"s": np.ones((7, 3, 3))}, "magnitudes or real parts alone"),
        ({"s": [[1j], [1j, 2j]]}, "an array of numbers"),
        ({"frequency": F * 1j}, "real numbers"),
        ({"rx_position": PLACES[:2]}, "the shapes do not fit together"),
        ({"s": np.ones((1, 1, 7, 3, 3), complex)}, "the shapes do not fit together"),
        ({"frequency": "GHz"}, "an array of numbers"),
    ],
)
def test_arrays_that_make_no_sweep(give, words):
    usual = {"s": np.ones((7, 3, 3), complex), "frequency": F, "tx_position": PLACES, "rx_position": PLACES}
    with pytest.raises(mf.InputError, match=words):
        mf.make_sweep(**(usual | give))


def test_a_full_disk_is_told_where_not_even_an_empty_file_can_be_made(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(output.Path, "touch", full)
    with pytest.raises(OSError, match="No space left") as caught, output.written_atomically(tmp_path / "a.nc"):
        pass
    assert caught.value.filename == str(tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


def test_a_disk_without_room_is_noticed_before_the_work(tmp_path):
    with pytest.raises(OSError, match="MB are free"):
        output.check_room(tmp_path / "a.nc", 10**18)


def test_a_steady_file_drops_what_it_cannot_write_and_tells_it_at_the_end(tmp_path):
    with pytest.raises(OSError, match="No space left"), SteadyFile(tmp_path / "a") as file:
        assert file.write(b"abcd") == 4
        file._failure = OSError(errno.ENOSPC, "No space left on device")
        assert file.write(b"efgh") == 4
        assert file.seek(0) == 0
        buffer = bytearray(b"xxxxxxxx")
        assert file.readinto(buffer) == 8
        assert bytes(buffer) == b"abcd\0\0\0\0"
    with pytest.raises(OSError, match="Invalid argument"), SteadyFile(tmp_path / "b") as file:
        assert file.truncate(-1) == -1


TABLE = "freq,re,im\n1e9,1,0\n2e9,1,0\n3e9,1,0\n"


def described(folder, content, *paths):
    """Import a scan as a description says."""
    (folder / "scan.toml").write_text(content)
    return mf.import_data(*paths, positions=folder / "scan.toml")


@pytest.mark.parametrize(
    ("content", "paths", "words"),
    [
        ('file = [{file = "a.csv", position = [0, 0, 0]}]', ["nowhere"], "nowhere: does not exist"),
        ('file = [{file = "?.csv", position = [0, 0, 0]}]', ["."], r"fits .*; make it fit one"),
        ('file = [{file = "z.csv", position = [0, 0, 0]}]', ["."], "z.csv"),
        ('file = [{file = "words.csv", position = [0, 0, 0]}]', ["words.csv"], "no scattering parameters"),
        (
            'file = [{file = "a.csv", position = [0, 0, 0]}, {file = "b.csv", position = [1, 0, 0]}]',
            ["a.csv", "b.csv"],
            "measure all with the same",
        ),
        ("tx = {position = [[0, 0, 0]]}\nrx = {position = [[0, 0, 0]]}", ["a.csv", "b.csv"], "one file with all pairs"),
        ("tx = {position = [[0, 0, 0]]}\nrx = {position = [[0, 0, 0]]}", ["a.csv"], "no pairs that are understood"),
    ],
)
def test_what_is_wrong_in_a_scan(folder, content, paths, words):
    (folder / "a.csv").write_text(TABLE)
    (folder / "b.csv").write_text(TABLE.replace("3e9", "3.5e9").replace("2e9", "2.25e9"))
    (folder / "words.csv").write_text("one,two\n1,2\n3,4\n")
    with pytest.raises(mf.InputError, match=words):
        described(folder, content, *(paths if len(paths) == 1 else [paths]))


def test_a_file_is_moved_to_another_disk_by_a_copy(tmp_path, monkeypatch):
    source, target = tmp_path / "new", tmp_path / "old"
    source.write_text("new")
    target.write_text("old")
    usual = os.replace

    def replace(one, other):
        if one == source:
            raise OSError(errno.EXDEV, os.strerror(errno.EXDEV))
        usual(one, other)

    monkeypatch.setattr(output.os, "replace", replace)
    output._move(source, target)
    assert target.read_text() == "new"
    monkeypatch.setattr(output.os, "replace", lambda *_: (_ for _ in ()).throw(OSError(errno.EIO, "broken")))
    with pytest.raises(OSError, match="broken"):
        output._move(source, target)


def test_outputs_of_another_kind_are_refused(tmp_path, monkeypatch):
    with pytest.raises(mf.InputError, match=r"expected \.png or \.pdf; rename it"):
        output.check_output(tmp_path / "a.nc", suffixes=(".png", ".pdf"))
    with pytest.raises(mf.InputError, match="is a directory"):
        output.check_output(tmp_path)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(mf.InputError, match="leads to itself"):
        output.check_output(tmp_path / "loop")
    token = output.may_overwrite.set(False)
    (tmp_path / "there.nc").write_text("precious")
    try:
        with pytest.raises(mf.InputError, match="--no-clobber"):
            output.check_output(tmp_path / "there.nc")
    finally:
        output.may_overwrite.reset(token)
