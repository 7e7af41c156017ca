"""What is wrong in a mapping, or in a command that imports: each is told by its place, all of them at once."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from point_target import line_of

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import InputError

GOOD = {
    "s": {"variable": "s", "dims": ["frequency", "tx", "rx"]},
    "frequency": "f",
    "tx": {"position": "tx"},
    "rx": {"position": "rx"},
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frequency": "freq"}, ["no variable 'freq'", "it holds s, f, tx"]),
        ({"frequency": "ghz"}, ["290 to 300 Hz", "unit"]),
        ({"frequency": "bad"}, ["not finite", "number 20"]),
        ({"frequency": "jump"}, ["equal rising steps"]),
        (
            {"frequency": {"start": 1e9, "step": 1e9, "points": 5}},
            ["frequency has 5 points", "21 samples along its axis"],
        ),
        ({"tx": {"position": "rx"}}, ["7 places of tx", "5 samples"]),
        ({"tx": {"position": "f"}}, ["shape (21,)", "(n, 3)"]),
        ({"s": {"variable": "s", "dims": ["frequency", "tx"]}}, ["shape (21, 5, 7)", "2 axes"]),
        ({"s": {"variable": "s", "dims": ["frequency", "tx", "rx"], "select": {"rx": 9}}}, ["length 7"]),
        ({"frequency": {"variable": "f", "unit": "mm"}}, ["unit 'mm'", "GHz"]),
        ({"s": {"variable": "s", "dims": ["tx", "frequency", "rx"]}}, ["length 5 along 'frequency'", "order of dims"]),
    ],
)
def test_what_does_not_fit_is_said_with_its_place(npz, change, words):
    with pytest.raises(InputError) as caught:
        mf.import_data(npz, mapping=GOOD | change)
    for word in [str(npz), *words]:
        assert word in str(caught.value)


MANY = {"start": 0.0, "stop": 1.0, "points": 20_000_000}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frequency": MANY}, "frequency has 20000000 points, and there are 21 samples"),
        ({"tx": {"x": MANY}}, "tx.x has 20000000 points, and there are 5 samples"),
        ({"rx": {"z": MANY}}, "rx.z has 20000000 points, and there are 7 samples"),
    ],
)
def test_more_points_than_samples_are_refused_before_they_are_made(npz, change, words):
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=words):
            mf.import_data(npz, mapping=GOOD | change)
        assert tracemalloc.get_traced_memory()[1] < 32 << 20
    finally:
        tracemalloc.stop()


def test_all_mistakes_of_a_mapping_are_said_at_once(tmp_path, npz):
    path = tmp_path / "m.toml"
    path.write_text(
        's = {variable = "s", dims = ["frequency", "tx", "rx"], slect = {}}\nfrequncy = "f"\n'
        'time_convention = "exp(jwt)"\ntx = {position = "tx", unit = "miles"}\n'
    )
    with pytest.raises(InputError) as caught:
        mf.import_data(npz, mapping=path)
    for word in (
        "s.slect",
        "did you mean 'select'",
        "frequncy",
        "did you mean 'frequency'",
        "time_convention",
        "tx.unit",
    ):
        assert word in str(caught.value)
    path.write_text('s = {variable = "s",\n')
    with pytest.raises(InputError, match="line 1"):
        mf.import_data(npz, mapping=path)
    path.write_text('s = {variable = "s", dims = ["frequency", "pair"]}\nfrequency = "f"\n')
    with pytest.raises(InputError, match="'pair' needs pairs"):
        mf.import_data(npz, mapping=path)


def test_a_file_that_says_nothing_of_itself_asks_for_a_mapping(npz, tmp_path):
    with pytest.raises(InputError, match="--guess"):
        mf.import_data(npz)
    (tmp_path / "a.s1p").write_text("# Hz S RI R 50\n1e9 0 1\n2e9 0 1\n")
    with pytest.raises(InputError, match="--positions"):
        mf.import_data(tmp_path / "a.s1p")
    with pytest.raises(InputError, match="2 files are given"):
        mf.import_data([npz, npz], mapping=GOOD)
    with pytest.raises(InputError, match="no files"):
        mf.import_data([])


def test_pairs_beyond_the_elements_are_refused(tmp_path):
    np.savez(tmp_path / "d.npz", s=np.ones((3, 2)) * 1j, tx=[1, 4], rx=[1, 2], el=line_of(3), twice=[1, 1])
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "pair"]},
        "frequency": {"start": 1e9, "stop": 2e9, "points": 3},
        "elements": {"position": "el"},
        "pairs": {"tx": "tx", "rx": "rx"},
    }
    with pytest.raises(InputError, match="holds 4 as number 1, expected whole numbers from 1 to 3"):
        mf.import_data(tmp_path / "d.npz", mapping=mapping)
    mapping["pairs"] = {"tx": "twice", "rx": "twice"}
    with pytest.raises(InputError, match="twice"):
        mf.import_data(tmp_path / "d.npz", mapping=mapping)


@pytest.mark.parametrize(
    "arguments",
    [
        ["import", "-o", "s.nc"],
        ["import", "d.npz"],
        ["import", "d.npz", "-o", "s.nc"],
        ["import", "none.npz", "-o", "s.nc"],
        ["import", "d.npz", "--mapping", "none.toml", "-o", "s.nc"],
        ["import", "d.npz", "--positions", "none.csv", "-o", "s.nc"],
        ["import", "d.npz", "-o", "none/s.nc"],
        ["import", "d.npz", "-o", "d.npz"],
        ["import", "d.npz", "--reader", "nonsense", "-o", "s.nc"],
        ["export", "d.npz", "-o", "scan"],
        ["export", "none.nc", "-o", "scan"],
    ],
)
def test_wrong_commands_are_told_in_one_line(npz, monkeypatch, capsys, arguments):
    monkeypatch.chdir(npz.parent)
    before = sorted(npz.parent.iterdir())
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert sorted(npz.parent.iterdir()) == before
