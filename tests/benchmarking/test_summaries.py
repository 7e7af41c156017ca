"""Means, intervals and worst scenes; and what differs between two benchmarks, scene by scene."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from small_benchmark import RADAR, WALL

import mirrorfold as mf
from mirrorfold.benchmarking import compare_benchmarks
from mirrorfold.benchmarking.figures import FIGURES
from mirrorfold.benchmarking.results import FILE, append, read_lines
from mirrorfold.benchmarking.summaries import interval, spread, summarise
from mirrorfold.benchmarking.tables import markdown, write_tables


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """A line with a score."""
    folder = tmp_path_factory.mktemp("one")
    mf.benchmark(WALL, radars=RADAR, methods="small_benchmark:strongest", seeds=[0], output=folder)
    return next(iter(read_lines(folder / FILE).values()))


def lines(line, f_scores, *, angles=None, method="m", family="f"):
    """Lines of seeds 0, 1, ... with these F-scores and angles of a mirror."""
    made = []
    for seed, f in enumerate(f_scores):
        mirror = {"surface": "wall", "offset_error_mm": 0.1, "generation": 1, "length_m": 1.0}
        score = line.score.but(f_score_2cm=f)
        if angles is not None:
            from mirrorfold.scoring.mirrors import MirrorError

            score = score.but(mirrors=[MirrorError(**mirror, angle_error_deg=angles[seed])])
        made.append(line.but(seed=seed, score=score, method=method, family=family))
    return made


def folder_of(tmp_path, name, rows):
    (tmp_path / name).mkdir(exist_ok=True)
    append(tmp_path / name / FILE, rows)
    return tmp_path / name


def test_the_interval_of_many_values_is_that_of_the_normal_law():
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    low, high = interval(values)
    assert 0.5 * (high - low) == pytest.approx(1.96 * values.std() / 20.0, rel=0.06)
    assert 0.5 * (high + low) == pytest.approx(values.mean(), abs=0.01)


@pytest.mark.slow
def test_ninety_five_intervals_of_a_hundred_hold_the_mean():
    random = np.random.default_rng(2)
    held = [low <= 0.0 <= high for low, high in (interval(random.normal(size=40)) for _ in range(300))]
    assert 0.9 < np.mean(held) < 0.98


def test_a_spread_leaves_out_what_is_undefined_and_knows_the_worse_end():
    values = np.array([0.5, np.nan, 0.9, 0.7])
    high, low = (spread(values, FIGURES[name]) for name in ("f_all", "angle_deg"))
    assert (high.scenes, high.mean, high.median) == (3, pytest.approx(0.7), pytest.approx(0.7))
    assert (high.worst, low.worst) == (0.5, 0.9)
    one = spread(np.array([0.5]), FIGURES["f_all"])
    assert (one.mean, one.low, one.high) == (0.5, None, None)


def test_paired_differences_see_what_the_hardness_of_scenes_hides(line, tmp_path):
    random = np.random.default_rng(3)
    hard = random.uniform(0.3, 0.9, 12)
    small = random.uniform(0.01, 0.03, 12)
    first = folder_of(tmp_path, "a", lines(line, hard, angles=hard))
    second = folder_of(tmp_path, "b", lines(line, hard + small, angles=hard + small))
    found = compare_benchmarks(first, second).results[0]
    by_name = {one.figure: one for one in found.differences}
    f, angle, invented = (by_name[name] for name in ("f_all", "angle_deg", "invented_cells"))
    assert f.difference == pytest.approx(small.mean())
    assert small.min() < f.low < f.difference < f.high < small.max()
    assert (f.verdict, angle.verdict, invented.verdict) == ("better", "worse", "no difference")
    assert (invented.difference, invented.low, invented.high) == (0.0, 0.0, 0.0)
    back = compare_benchmarks(second, first).results[0].differences
    assert [one.verdict for one in back if one.figure in ("f_all", "angle_deg")] == ["worse", "better"]


def test_only_scenes_of_both_are_compared(line, tmp_path):
    first = folder_of(tmp_path, "a", lines(line, [0.5, 0.6, 0.7]))
    rows = lines(line, [0.5, 0.8])
    second = folder_of(tmp_path, "b", [rows[1], rows[0].but(score=None, error="no")])
    found = compare_benchmarks(first, second)
    assert (found.results[0].scenes, found.results[0].failures) == (2, [0, 1])
    f = found.results[0].differences[0]
    assert (f.scenes, f.difference, f.low, f.verdict) == (1, pytest.approx(0.2), None, "no difference")
    assert found.remarks == [
        f"1 scene is in {first} only, and left out.",
        f"{second}: failed on 1 of 2 scenes of f (m), which no difference counts.",
        "A difference on a single scene has no interval, and so no verdict.",
    ]


def test_other_scenes_of_the_same_seed_are_not_compared(line, tmp_path):
    rows = lines(line, [0.5, 0.6, 0.7])
    first = folder_of(tmp_path, "a", rows)
    second = folder_of(tmp_path, "b", [rows[0].but(scene="another"), *rows[1:]])
    found = compare_benchmarks(first, second)
    assert found.results[0].scenes == 2
    assert found.remarks == ["1 result is of different scenes of the same family and seed, and left out."]
    newer = folder_of(tmp_path, "c", [row.but(scene="another", version="9.9") for row in rows])
    assert compare_benchmarks(first, newer).results[0].scenes == 3


def test_methods_of_one_side_alone_are_told_of(line, tmp_path):
    first = folder_of(tmp_path, "a", [*lines(line, [0.5, 0.6]), *lines(line, [0.5, 0.6], method="alone")])
    second = folder_of(tmp_path, "b", lines(line, [0.5, 0.6]))
    assert compare_benchmarks(first, second).remarks == [f"alone: in {first} only, and left out."]


def test_methods_of_a_folder_are_named_or_matched(line, tmp_path):
    both = folder_of(tmp_path, "a", [*lines(line, [0.5, 0.6], method="x"), *lines(line, [0.7, 0.9], method="p.q:r")])
    found = compare_benchmarks(f"{both}:x", f"{both}:p.q:r").results
    assert [(one.first_method, one.second_method) for one in found] == [("x", "p.q:r")]
    assert found[0].differences[0].difference == pytest.approx(0.25)
    assert len(compare_benchmarks(both, both).results) == 2
    other = folder_of(tmp_path, "b", [*lines(line, [0.5], method="y"), *lines(line, [0.5], method="z")])
    for pair, expected in (
        ((both, other), "name the methods as FOLDER:METHOD"),
        ((f"{both}:w", other), "has no method 'w', expected one of: x, p.q:r"),
        ((both, tmp_path / "absent"), "holds no benchmark (scenes.jsonl)"),
        ((f"{both}:x", folder_of(tmp_path, "c", lines(line, [0.5], family="g"))), "no scene in common"),
    ):
        with pytest.raises(mf.InputError) as caught:
            compare_benchmarks(*pair)
        assert expected in str(caught.value)


def test_tables_hold_what_was_found(line, tmp_path):
    found = summarise([*lines(line, [0.5, 0.9]), *lines(line, [0.4], method="other")])
    write_tables(found, tmp_path)
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    mean = next(row for row in rows if (row["method"], row["figure"]) == ("m", "f_all"))
    assert (mean["scenes"], float(mean["mean"]), float(mean["worst"])) == ("2", pytest.approx(0.7), 0.5)
    assert {row["figure"] for row in rows} == {*FIGURES, *(f"seconds_{step}" for step in line.seconds)}
    assert json.loads((tmp_path / "table.json").read_text()) == found
    text = (tmp_path / "table.md").read_text()
    assert text == markdown(found)
    assert "| f | small | m | 2 | 0 | 0.700 0.500-0.900 (0.500) |" in text
    assert "| 0.400 (0.400) |" in text


def test_tables_show_curvatures_and_panes_where_there_are_any(line):
    assert "curvature [%]" not in markdown(summarise(lines(line, [0.5])))
    rows = [
        one.but(score=one.score.but(mirrors=[mirror.but(curvature_error=error) for mirror in one.score.mirrors]))
        for one, error in zip(lines(line, [0.5, 0.9], angles=[0.1, 0.1]), (0.01, 0.02), strict=True)
    ]
    rows[0] = rows[0].but(score=rows[0].score.but(sides_right=0.96, sides_doubtful=0.25, passed_m=0.004))
    text = markdown(summarise(rows))
    assert "| right sides | doubtful sides | passed [mm] | curvature [%] |" in text
    assert "permittivity" not in text
    assert "| 0.960 (0.960) | 0.250 (0.250) | 4.0 (4.0) | 1.50 1.00-2.00 (2.00) |" in text


def test_the_picture_has_a_panel_for_each_figure_that_is_known_and_tells_failures(line):
    rows = [*lines(line, [0.5, 0.9]), line.but(method="other", family="f", seed=0, score=None, error="no")]
    figure = mf.plot.benchmark(summarise(rows))
    known = ["F, all", "F, all, in cells", "invented cells"]  # nothing is hidden here, and no mirror found
    assert [ax.get_title().split(" (")[0] for ax in figure.axes] == known
    first = figure.axes[0]
    assert [label.get_text() for label in first.get_yticklabels()] == ["f"]
    drawn = [drawn.get_xdata().tolist() for drawn in first.lines]
    assert [0.5, 0.9] in drawn  # the interval of two values
    assert [0.7] in [[round(x, 9) for x in one] for one in drawn]
    assert "other (1 failed)" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_of_many_methods_is_no_wider_than_the_picture(line):
    rows = [one for n in range(9) for one in lines(line, [0.5], method=f"my_laboratory.folding:method_{n}")]
    figure = mf.plot.benchmark(summarise(rows))
    figure.canvas.draw()
    extent = figure.legends[0].get_window_extent()
    assert extent.x0 >= 0.0
    assert extent.x1 <= figure.bbox.width


def test_the_picture_of_a_comparison_marks_zero_and_the_verdict(line, tmp_path):
    first = folder_of(tmp_path, "a", lines(line, [0.5, 0.6, 0.7]))
    second = folder_of(tmp_path, "b", lines(line, [0.6, 0.8, 0.8]))
    figure = mf.plot.benchmark_comparison(compare_benchmarks(first, second))
    assert len(figure.axes) == 3
    mean = figure.axes[0].lines[1]
    assert mean.get_xdata()[0] == pytest.approx(0.4 / 3.0)
    assert mean.get_color() == "#009E73"
