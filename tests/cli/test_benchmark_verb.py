"""The verb `benchmark` for people: tables, what is told of failures, interruptions, and plain words for mistakes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mirrorfold.benchmarking.results import FILE
from mirrorfold.benchmarking.scenes import Line
from mirrorfold.benchmarking.summaries import summarise
from mirrorfold.cli import main
from mirrorfold.cli.study_tables import show_benchmark
from mirrorfold.scenes.families import FAMILIES, RADARS

METHODS = """
calls = 0
def nothing(image, sweep): return {'points': []}
def wrong(image, sweep): raise ValueError('wrong\\nfrom the start')
def crashes(image, sweep): __import__('os')._exit(3)
def stopped(image, sweep):
    global calls
    calls += 1
    if calls == 3: raise KeyboardInterrupt
    return {'points': []}
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs the verb on a small family, seen by a small radar."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "judged_here.py").write_text(METHODS)
    radar = RADARS["300 GHz"]
    small = {"array": {**radar.array, "elements": 21}, "band": {**radar.band, "points": 41}}
    monkeypatch.setitem(RADARS, "small", replace(radar, name="small", **small))
    monkeypatch.setitem(FAMILIES, "small noise", replace(FAMILIES["empty"], name="small noise"))
    monkeypatch.delitem(__import__("sys").modules, "judged_here", raising=False)

    def call(*arguments, method="nothing"):
        return main(["benchmark", "--family", "Small-noise", "--radar", "small", "--method", f"judged_here:{method}",
                     *arguments])  # fmt: skip

    return call


def test_a_table_for_people_and_the_files(run, capsys, tmp_path):
    assert run("--seeds", "0:2", "-o", "out") == 0
    printed = capsys.readouterr()
    assert "radar small: means over the scenes" in printed.out
    assert "2/2" in printed.out
    assert "wrote out/table.md" in printed.out
    assert printed.err == ""
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "figures.png", "scenes.jsonl", "table.csv", "table.json", "table.md"
    ]  # fmt: skip
    assert main(["benchmark", "compare", "out", "out"]) == 0
    assert "no difference" in capsys.readouterr().out
    assert run("--seeds", "0", "-o", "one") == 0
    capsys.readouterr()
    assert main(["benchmark", "compare", "one", "one"]) == 0
    compared = capsys.readouterr()
    assert "no difference" not in compared.out
    assert "A difference on a single scene has no interval, and so no verdict." in compared.err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("others", "code"), [((), 1), (("--method", "judged_here:nothing"), 0)], ids=["alone", "beside"]
)
def test_a_benchmark_in_which_nothing_succeeds_has_failed_and_its_work_is_done(run, capsys, tmp_path, others, code):
    assert run("--seeds", "1", "-o", "out", *others, method="wrong") == code
    printed = capsys.readouterr()
    assert "0/1" in printed.out
    assert ("1/1" in printed.out) == bool(others)
    assert (tmp_path / "out" / "table.md").is_file()
    note, *failure = printed.err.splitlines()
    assert note == (
        "mirrorfold: note: judged_here:wrong failed on 1 of 1 scenes, most often so: "
        "the method raised ValueError: wrong from the start"
    )
    assert failure == ["mirrorfold: every method failed on every scene; out/scenes.jsonl holds the reasons"][:code]


def test_no_figure_is_cut_off_the_table(capsys):
    long = "a family with a name as long as these names may be at most"
    lines = [
        Line(family=long, radar="small", seed=seed, method=f"somebody.folding:variant_{seed}", version="", scene="",
             error="none", seconds={"simulate": 3.0, "fold": 4.0}, score=None)
        for seed in range(2)
    ]  # fmt: skip
    show_benchmark(summarise(lines))
    title, *_, first, second = capsys.readouterr().out.rstrip().split("\n")
    assert title.startswith("radar small")
    for seed, row in enumerate((first, second)):
        assert row.split("  ")[0] == long
        assert f"somebody.folding:variant_{seed}" in row
        assert row.rstrip().endswith("7 s")


@pytest.mark.slow
def test_a_process_that_crashes_is_no_wrong_input(run, capsys):
    assert run("--seeds", "0:2", "--jobs", "2", "-o", "out", method="crashes") == 1
    assert "because a method crashed or ended it" in capsys.readouterr().err


@pytest.mark.slow
def test_an_interruption_keeps_what_is_done_and_says_how_to_go_on(run, capsys, tmp_path):
    assert run("--seeds", "0:5", "-o", "out", method="stopped") == 130
    assert capsys.readouterr().err == (
        "mirrorfold: interrupted; 2 of 5 scenes are done, in out; the same command goes on from there\n"
    )
    assert [path.name for path in (tmp_path / "out").iterdir()] == [FILE]
    assert (tmp_path / "out" / FILE).read_text().count("\n") == 2
    assert run("--seeds", "0:5", "-o", "out", method="stopped") == 0
    assert (tmp_path / "out" / FILE).read_text().count("\n") == 5
    kept = "mirrorfold: note: 2 of 5 scenes were done before; after a change of a method, give another folder\n"
    assert kept in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["-o", "out", "--family", "two wals"], "family is 'two wals', expected one of: one wall, two walls"),
        (["-o", "out", "--radar", "60GHz"], "radar is '60GHz', expected one of: 300 GHz"),
        (["-o", "out", "--method", "absent_module:fold"], "the module 'absent_module' cannot be imported"),
        (
            ["-o", "out", "--method", "median"],
            "method is 'median', expected ours, flat, opaque, published or MODULE:FUNCTION",
        ),
        (["-o", "out", "--seeds", "3:3"], "--seeds is '3:3', expected FIRST:END"),
        (["-o", "out", "--seeds", "0:99999999999999999999"], "expected at most 1000000 seeds"),
        (["-o", "out", "--seeds", "few"], "--seeds is 'few', expected FIRST:END"),
        (["-o", "absent/out"], "the directory absent does not exist"),
        ([], "--output is missing"),
        (["compare", "out", "out"], "out: holds no benchmark"),
        (["compare", "out", "out", "-o", "d.txt"], "d.txt: has the suffix '.txt'"),
    ],
)
def test_mistakes_get_one_sentence_and_leave_nothing(tmp_path, monkeypatch, capsys, arguments, expected):
    monkeypatch.chdir(tmp_path)
    assert main(["benchmark", *arguments]) == 2
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert expected in printed.err
    assert not list(tmp_path.iterdir())


def test_the_list_names_families_and_radars(capsys):
    assert main(["benchmark", "--list"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert all(family.name in printed and family.what in printed for family in FAMILIES.values())
    assert all(radar.what in printed for radar in RADARS.values())
