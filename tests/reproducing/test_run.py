"""Running experiments: folders that are whole, nothing made twice, interruptions that lose one experiment at most."""

from __future__ import annotations

import json
import re
from contextlib import nullcontext
from dataclasses import dataclass
from errno import ENOSPC

import pytest
import xarray as xr
from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.reproducing import EXPERIMENTS, Claim, Experiment, Findings, Table, Work, catalogue
from mirrorfold.reproducing.run import read_result


class Full(Figure):
    """A picture that the disk has no room for."""

    def savefig(self, *_, **__):
        raise OSError(ENOSPC, "No space left on device")


@dataclass(frozen=True)
class Counted(Experiment):
    """An experiment of two steps that counts what it has to compute."""

    calls: tuple = ()

    @property
    def run(self):
        def steps(work: Work) -> Findings:
            log = COUNTS.setdefault(self.name, [])
            first = work.kept(lambda: log.append("first") or {"a": 1.5})
            if STOP.get(self.name) == "between":
                raise KeyboardInterrupt
            second = work.kept(lambda: log.append("second") or [2.5])
            work.step(2, 2)
            figure = Full() if STOP.get(self.name) == "full" else Figure()
            figure.subplots().plot([0, 1])
            return Findings(
                claims=(Claim(claim="a | b", source="Fig. 9", measured="1.5 <m>", verdict="agrees", why="equal"),),
                numbers={"a_m": first["a"], "nothing": None},
                figures={"line": (figure, "A [line]")},
                data=xr.Dataset({"b": ("n", second, {"units": "m"})}),
                tables=(Table(title="Numbers", columns=["a"], rows=[["1"]]),),
                text=("One can learn.",),
                assumptions=("None.",),
            )

        return steps

    def digest(self, *, quick: bool) -> str:
        return f"{self.name}-{quick}-{VERSION[0]}".ljust(64, "0")


COUNTS: dict[str, list[str]] = {}
STOP: dict[str, str] = {}
VERSION = [1]


@pytest.fixture(autouse=True)
def two_experiments():
    """Two experiments alone; afterwards the true ones again, in their order, which counts for other tests."""
    COUNTS.clear()
    STOP.clear()
    VERSION[0] = 1
    true = dict(EXPERIMENTS)
    EXPERIMENTS.clear()
    EXPERIMENTS.update({name: Counted(name, f"Experiment {name}", "Fig. 9", "Counts.") for name in ("one", "two")})
    yield
    EXPERIMENTS.clear()
    EXPERIMENTS.update(true)


@pytest.mark.slow
def test_each_experiment_leaves_pictures_data_and_pages(tmp_path):
    found = mf.reproduce("all", output=tmp_path / "out", quick=True)
    assert [one.name for one in found.results] == ["one", "two"]
    for name in ("one", "two"):
        folder = tmp_path / "out" / name
        assert sorted(path.name for path in folder.iterdir()) == [
            "data.nc", "line.pdf", "line.png", "page.md", "result.json",
        ]  # fmt: skip
        with xr.open_dataset(folder / "data.nc", engine="h5netcdf") as data:
            assert data["b"].values.tolist() == [2.5]
            assert data["b"].attrs["units"] == "m"
        page = (folder / "page.md").read_text()
        for text in ("a \\| b", "1.5 <m>", "agrees", "Fig. 9", "(line.png)", "A [line]", "One can learn.", "None.",
                     f"mirrorfold reproduce {name} -o out --quick"):  # fmt: skip
            assert text in page
        assert read_result(folder / "result.json") == next(one for one in found.results if one.name == name)
    assert set(found.files) == {str(path) for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert not (tmp_path / "out" / "unfinished").exists()


def test_the_index_holds_every_claim_and_the_html_page_needs_nothing_else(tmp_path):
    mf.reproduce(output=tmp_path / "out")
    index = (tmp_path / "out" / "index.md").read_text()
    assert "[one](one/page.md)" in index
    assert "[two](two/page.md)" in index
    assert index.count("1.5 <m>") == 2
    html = (tmp_path / "out" / "index.html").read_text()
    assert html.count("1.5 &lt;m&gt;") == 4  # in the table of all claims, and in the sections of both
    assert html.count("data:image/png;base64,") == 2
    assert not re.search(r"(src|href)=\"(?!data:image/png|#)", html)


@pytest.mark.slow
def test_what_is_complete_is_not_made_again(tmp_path):
    mf.reproduce("one", output=tmp_path / "out")
    mf.reproduce(["two", "one"], output=tmp_path / "out")
    assert COUNTS == {"one": ["first", "second"], "two": ["first", "second"]}
    mf.reproduce("one", output=tmp_path / "out", again=True)
    assert len(COUNTS["one"]) == 4


@pytest.mark.slow
@pytest.mark.parametrize("change", ["size", "program", "picture", "result"])
def test_what_is_of_another_size_or_program_or_damaged_is_made_again(tmp_path, change):
    mf.reproduce("one", output=tmp_path / "out")
    if change == "program":
        VERSION[0] = 2
    if change == "picture":
        (tmp_path / "out" / "one" / "line.pdf").unlink()
    if change == "result":
        (tmp_path / "out" / "one" / "result.json").write_text('{"name": "one"}')
    mf.reproduce("one", output=tmp_path / "out", quick=change == "size")
    assert len(COUNTS["one"]) == 4


def test_an_experiment_that_lacks_a_picture_keeps_no_other_from_the_index(tmp_path):
    out = tmp_path / "out"
    mf.reproduce("one", output=out)
    (out / "one" / "line.png").unlink()
    mf.reproduce("two", output=out)
    assert "(two/page.md)" in (out / "index.md").read_text()
    assert "one/page.md" not in (out / "index.md").read_text()


@pytest.mark.slow
def test_files_of_someone_else_are_left_alone(tmp_path):
    mine = tmp_path / "two" / "notes.txt"
    mine.parent.mkdir()
    mine.write_text("mine")
    with pytest.raises(mf.InputError, match="two: holds files of something else"):
        mf.reproduce(output=tmp_path)
    assert not COUNTS
    assert [path.name for path in tmp_path.rglob("*")] == ["two", "notes.txt"]
    mf.reproduce("one", output=tmp_path)
    notes = tmp_path / "one" / "notes.txt"
    notes.write_text("mine")
    mf.reproduce("one", output=tmp_path, again=True)
    assert notes.read_text() == "mine"


def test_an_interruption_loses_no_more_than_the_step_at_work(tmp_path, capsys):
    STOP["two"] = "between"
    assert main(["reproduce", "-o", str(tmp_path / "out")]) == 130
    told = capsys.readouterr().err
    assert "complete in" in told
    assert "one" in told
    assert not (tmp_path / "out" / "two").exists()
    assert "Experiment one" in (tmp_path / "out" / "index.html").read_text()
    STOP.clear()
    assert main(["reproduce", "-o", str(tmp_path / "out")]) == 0
    assert COUNTS == {"one": ["first", "second"], "two": ["first", "second"]}


@pytest.mark.slow
def test_the_time_of_interrupted_runs_counts_unless_another_program_ran(tmp_path):
    STOP["one"] = "between"
    with pytest.raises(KeyboardInterrupt):
        mf.reproduce("one", output=tmp_path / "out")
    spent = tmp_path / "out" / "unfinished" / "one" / "spent.json"
    told = json.loads(spent.read_text())
    assert 0.0 < told["seconds"] < 60.0
    STOP.clear()
    for digest, hours in ((told["digest"], True), ("another", False)):
        spent.parent.mkdir(parents=True, exist_ok=True)
        spent.write_text(json.dumps({"digest": digest, "seconds": 3600.0}))
        found = mf.reproduce("one", output=tmp_path / "out", again=True)
        assert (found.results[0].seconds > 3600.0) == hours


def test_steps_of_another_program_or_damaged_ones_are_made_again(tmp_path):
    STOP["one"] = "between"
    for change in ("none", "damage", "program"):
        if change == "damage":
            part = tmp_path / "out" / "unfinished" / "one" / "json" / "00000.json"
            part.write_bytes(part.read_bytes().replace(b"1.5", b"2.5"))
        if change == "program":
            VERSION[0] = 2
        told = (
            pytest.warns(UserWarning, match=r"00000\.json cannot be trusted") if change == "damage" else nullcontext()
        )
        with pytest.raises(KeyboardInterrupt), told:
            mf.reproduce("one", output=tmp_path / "out")
    assert COUNTS["one"] == ["first"] * 3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*strong echoes come from")
@pytest.mark.parametrize("solver", ["rays", "fullwave"])
def test_sweeps_are_kept_until_the_experiment_is_done(tmp_path, monkeypatch, solver):
    content = {
        "name": "strip",
        "array": {"elements": 3, "pitch": 0.5e-3},
        "band": {"start": 290e9, "stop": 300e9, "points": 3},
        "surface": [{"name": "strip", "kind": "segment", "start": [-0.01, 0.3], "end": [0.01, 0.31]}],
    }
    scene = mf.parse_scene(content)
    first = Work(quick=True, folder=tmp_path, digest="0" * 64).sweep(scene, solver=solver)
    monkeypatch.setattr(mf, "simulate", None)
    again = Work(quick=True, folder=tmp_path, digest="0" * 64).sweep(scene, solver=solver)
    xr.testing.assert_equal(first, again)
    with pytest.raises(TypeError):
        Work(quick=True, folder=tmp_path, digest="1" * 64).sweep(scene, solver=solver)


@pytest.mark.slow
def test_a_full_disk_loses_nothing_that_was_complete(tmp_path, capsys):
    mf.reproduce("all", output=tmp_path / "out")
    before = {path: path.read_bytes() for path in (tmp_path / "out" / "one").iterdir()}
    STOP["one"] = "full"
    assert main(["reproduce", "one", "--again", "-o", str(tmp_path / "out")]) == 1
    assert "No space left" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (tmp_path / "out" / "one").iterdir()} == before
    assert not list((tmp_path / "out").glob(".*"))


def test_the_verb_prints_claims_and_checks_against_its_schema(tmp_path, capsys):
    assert main(["reproduce", "one", "-o", str(tmp_path / "out"), "--json"]) == 0
    printed = capsys.readouterr().out
    check("reproduce", printed)
    assert json.loads(printed)["results"][0]["numbers"] == {"a_m": 1.5, "nothing": None}
    assert main(["reproduce", "one", "-o", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "agrees" in printed
    assert "index.html" in printed
    assert main(["reproduce", "--list", "--json"]) == 0
    printed = capsys.readouterr().out
    check("reproduce", printed)
    assert [one["name"] for one in json.loads(printed)["experiments"]] == ["one", "two"]
    assert main(["reproduce", "--list"]) == 0
    assert "Counts." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["three", "-o", "out"], "expected one of: all, one, two"),
        (["one"], "--output is missing"),
        (["one", "-o", "missing/out"], "does not exist"),
    ],
)
def test_mistakes_are_told_in_a_sentence(tmp_path, monkeypatch, capsys, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *arguments]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_missing_extra_is_named_before_any_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(EXPERIMENTS, "two", Counted("two", "Experiment two", "", "Counts.", "mesh"))
    monkeypatch.setattr(catalogue, "find_spec", lambda name: None if name == "embreex" else True)
    assert main(["reproduce", "-o", str(tmp_path / "out")]) == 2
    assert "needs embreex; install with: pip install 'mirrorfold[mesh]'" in capsys.readouterr().err
    assert not COUNTS
    assert main(["reproduce", "one", "-o", str(tmp_path / "out")]) == 0
