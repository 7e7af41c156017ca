"""What people and machines see: progress and remarks on stderr, results on stdout."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

from rich import box
from rich.console import Console
from rich.table import Table

from mirrorfold.cli import note

if TYPE_CHECKING:
    from pathlib import Path

    from mirrorfold.benchmarking.comparing import BenchmarkComparison
    from mirrorfold.benchmarking.summaries import Benchmark
    from mirrorfold.cli.benchmarking import Catalogue
    from mirrorfold.cli.many import SweepResult
    from mirrorfold.cli.reproducing import Experiments
    from mirrorfold.common import types
    from mirrorfold.common.records import Record
    from mirrorfold.describing.comparison import Comparison
    from mirrorfold.describing.planning import Plan
    from mirrorfold.describing.reconstructions import MirrorFacts, ReconstructionFacts
    from mirrorfold.focusing.choice_facts import OptionFacts
    from mirrorfold.reproducing import Reproduction
    from mirrorfold.scoring.score import PlanScore, VolumeScore

PLAIN_WIDTH = 110
"""Width of tables that do not go to a terminal [characters]."""

WIDE = 140
"""Of one with more columns than fit."""

UNLISTED = ("remarks", "mirrors", "surfaces", "findings", "judged", "valid", "points_by_frame")
"""Facts that have tables or lines of their own."""


@contextmanager
def progress(description: str) -> Iterator[types.Progress | None]:
    """A progress bar on stderr, as a function of done and total; None where stderr is not a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def remark(sentences: Iterable[str]) -> None:
    """Print sentences that deserve attention on stderr; the verb goes on."""
    for sentence in sentences:
        note(sentence)


def show_json(result: Mapping[str, Any]) -> None:
    """Print one JSON object."""
    print(to_json(result))


def show_result(found: Record, files: Sequence[Path], show: Callable[[Any], None] | None = None, *, json: bool) -> None:
    """Say what a verb has found, and which files it has written; its remarks go to stderr."""
    remark(found["remarks"])
    if json:
        show_json(found.but(files=list(map(str, files))))
        return
    if show is not None:
        show(found)
    show_files(files)


def to_json(result: Mapping[str, Any]) -> str:
    """One JSON object; numbers that are not finite become null."""
    return json.dumps(_finite(result), indent=2)


def show_files(files: Iterable[Any]) -> None:
    """Say where the files are."""
    for file in files:
        print(f"wrote {file}")


def show_info(found: Mapping[str, Any]) -> None:
    """Print what `info` has found, as a table of names and values."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in found.items():
        if name in UNLISTED or value in (None, ""):
            continue
        label, text = describe(name, value)
        table.add_row(label, text)
    for surface in found.get("surfaces", ()):
        table.add_row("surface", f"{surface['name']} ({surface['kind']}, {surface['material']})")
    _console().print(table)
    if found.get("points_by_frame"):
        show_frames(cast("ReconstructionFacts", found))
    elif found.get("mirrors"):
        show_mirrors(found["mirrors"])
    for sentence in found["remarks"]:
        print(f"! {sentence}")


def show_options(options: Sequence[OptionFacts]) -> None:
    """Print the table of algorithms."""
    table = _table("algorithms, the fastest first")
    for heading in ("algorithm", "plan", "image", "in all", "memory [GB]", "why"):
        table.add_column(heading, justify="left" if heading in ("algorithm", "why") else "right")
    for option in options:
        times = (option.building_s, option.frame_s, option.total_s)
        table.add_row(
            option.algorithm + (" *" if option.chosen else ""),
            *(duration(time) if time else "-" for time in times),
            _number(option.memory_gb, ".2g"),
            option.why,
        )
    _console().print(table)


def show_mirrors(mirrors: Sequence[MirrorFacts]) -> None:
    """Print the table of mirrors."""
    table = _table("mirrors, at their true places")
    for heading in ("mirror", "seen through", "generation", "start [m]", "end [m]", "strength"):
        table.add_column(heading, justify="right")
    for mirror in mirrors:
        table.add_row(
            str(mirror.mirror),
            "" if mirror.parent < 0 else str(mirror.parent),
            str(mirror.generation),
            *(f"({', '.join(f'{part:.4f}' for part in end)})" for end in (mirror.start_m, mirror.end_m)),
            _number(mirror.strength, ".3g"),
        )
    _console().print(table)


def show_frames(found: ReconstructionFacts) -> None:
    """Print how much was found in each frame of a recording."""
    table = _table("frames")
    for heading in ("frame", "mirrors", "points"):
        table.add_column(heading, justify="right")
    for frame, points in enumerate(found.points_by_frame):
        table.add_row(str(frame), str(sum(mirror.frame == frame for mirror in found.mirrors)), str(points))
    _console().print(table)


def show_summary(results: Sequence[SweepResult]) -> None:
    """Print what became of many sweeps, one in a line."""
    table = _table("sweeps")
    for heading in ("sweep", "mirrors", "points", "by mirrors", "result"):
        table.add_column(heading, justify="left" if heading in ("sweep", "result") else "right", overflow="fold")
    for one in results:
        counts = ("-" if count is None else str(count) for count in (one.mirrors, one.points, one.hidden))
        place = os.path.dirname(one.files[0]) if one.files else "failed"
        table.add_row(one.sweep, *counts, place)
    _console().print(table)


def show_comparison(found: Comparison) -> None:
    """Print how two results differ: levels, points, mirrors."""
    levels = found.levels
    facts = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_row("first", found.first)
    facts.add_row("second", found.second)
    facts.add_row("level, second over first", f"{_number(levels.median_db, '+.2f')} dB (median)")
    facts.add_row("difference", f"{_number(levels.rms_db, '.2f')} dB (rms over {levels.pixels} pixels)")
    facts.add_row("correlation", _number(levels.correlation, ".4f"))
    if "points" in found:
        points = found.points
        facts.add_row("points", f"{points.first} and {points.second}: {points.kept} kept, {points.gained} gained, "
                                f"{points.lost} lost")  # fmt: skip
    _console().print(facts)
    if not found.get("mirrors"):
        return
    table = _table("mirrors, at their true places")
    for heading in ("first", "second", "angle [deg]", "offset [mm]"):
        table.add_column(heading, justify="right")
    for pair in found.mirrors:
        numbers = ("-" if number is None else str(number) for number in (pair.first, pair.second))
        table.add_row(*numbers, _number(pair.angle_deg, ".3f"), _number(pair.offset_m, ".2f", 1e3))
    _console().print(table)


def show_benchmark(found: Benchmark) -> None:
    """Print means of the figures in a line for each family, radar and method, and the worst of the hidden F-score."""
    from mirrorfold.benchmarking.figures import FIGURES

    shown = ("f_all", "f_hidden", "precision_hidden", "f_hidden_cells", "invented_cells", "angle_deg", "offset_mm")
    for radar in dict.fromkeys(result.radar for result in found.results):
        table = _table(f"radar {radar}: means over the scenes")
        for heading in ("family", "method"):
            table.add_column(heading, overflow="fold", min_width=max(len(one[heading]) for one in found.results))
        for heading in ("done", *(FIGURES[name].label for name in shown), "F, hidden, worst", "time"):
            table.add_column(heading, justify="right")
        for result in found.results:
            if result.radar == radar:
                means = (_number(result.figures[name].mean, f".{FIGURES[name].digits}f") for name in shown)
                worst = _number(result.figures["f_hidden"].worst, ".3f")
                counts = f"{result.scenes - result.failures}/{result.scenes}"
                taken = duration(sum(result.seconds.values()))
                table.add_row(result.family, result.method, counts, *means, worst, taken)
        _console(WIDE).print(table)


def show_benchmark_comparison(found: BenchmarkComparison) -> None:
    """Print each figure that differs between two benchmarks, and how many do not."""
    from mirrorfold.benchmarking.figures import FIGURES

    table = _table(f"{found.second} less {found.first}: mean difference of the scenes that both have")
    for heading in ("family, radar, method", "scenes", "figure", "first", "second", "difference", "95 %", "verdict"):
        table.add_column(heading, justify="left" if heading[0] in "fv" and heading != "first" else "right")
    for result in found.results:
        methods = " to ".join(dict.fromkeys((result.first_method, result.second_method)))
        name = f"{result.family}, {result.radar}, {methods}"
        for one in result.differences:
            if one.difference is None:
                continue
            form = f".{FIGURES[one.figure].digits}f"
            between = "-" if one.low is None else f"{_number(one.low, '+' + form)} {_number(one.high, '+' + form)}"
            numbers = (_number(one.first, form), _number(one.second, form), _number(one.difference, "+" + form))
            table.add_row(name, str(one.scenes), FIGURES[one.figure].label, *numbers, between, one.verdict)
            name = ""
    _console().print(table)


def show_catalogue(found: Catalogue) -> None:
    """Print families and radars, each with what it is."""
    for title, entries in (("families", found.families), ("radars", found.radars)):
        table = _table(title)
        table.add_column("name", no_wrap=True)
        table.add_column("what")
        for entry in entries:
            table.add_row(entry.name, entry.what)
        _console().print(table)


def show_experiments(found: Experiments) -> None:
    """Print the experiments that can be made, in one table."""
    table = _table("Experiments")
    for heading in ("name", "published", "what"):
        table.add_column(heading)
    for one in found.experiments:
        table.add_row(one.name, one.source, one.purpose)
    _console(WIDE).print(table)


def show_reproduction(found: Reproduction) -> None:
    """Print the claims of experiments beside what came out, and where the pages are."""
    table = _table("")
    for heading in ("experiment", "claim", "here", "verdict"):
        table.add_column(heading)
    for result in found.results:
        for number, claim in enumerate(result.claims):
            table.add_row(result.name if number == 0 else "", claim.claim, claim.measured, claim.verdict)
        table.add_section()
    _console(WIDE).print(table)
    show_files(path for path in found.files if path.endswith(("index.html", "index.md")))


def show_plan(found: Plan) -> None:
    """Print how walls mirror and scatter, and the signal over noise that is left after each bounce."""
    for name, wall in found.walls.items():
        table = _table(f"{name}: share of the power [dB]")
        table.add_column("angle of incidence [deg]")
        for angle in wall.angle_deg:
            table.add_column(f"{angle:g}", justify="right")
        for label, levels in (
            ("mirrored, TE", wall.specular_te_db),
            ("mirrored, TM", wall.specular_tm_db),
            ("scattered", wall.diffuse_db),
        ):
            table.add_row(label, *(_number(level, ".1f") for level in levels))
        _console().print(table)
    budget = _table("a target by way of mirrors at 45 degrees")
    for heading in ("bounces", "range [m]", "SNR of a sample [dB]", "SNR in the image [dB]"):
        budget.add_column(heading, justify="right")
    for row in found.link_budget[: (found.bounces_above_noise or 0) + 3]:
        budget.add_row(
            str(row.bounces),
            f"{row.range_m:.3g}",
            _number(row.sample_snr_db, ".1f"),
            _number(row.snr_db, ".1f"),
        )
    _console().print(budget)
    quality = found.hidden_quality
    expected = _table(f"hidden F-score to expect behind a wall of 1 m ({quality.wall_cells:.0f} cells)")
    for heading in ("points right within", "F-score", "standard error"):
        expected.add_column(heading, justify="right")
    for label, score, error in (
        ("2 cm", quality.f_score_2cm, quality.f_score_2cm_error),
        ("5 cm", quality.f_score_5cm, quality.f_score_5cm_error),
        (f"1.5 cells ({150.0 * quality.cell_m:.1f} cm)", quality.f_score_cells, quality.f_score_cells_error),
    ):
        expected.add_row(label, _number(score, ".2f"), _number(error, ".2f"))
    _console().print(expected)


def show_score(score: PlanScore | VolumeScore) -> None:
    """Print the score: the mirrors, then a column for all surfaces and one for those out of sight."""
    mirrors = _table("mirrors against the truth")
    for heading in ("surface", "angle error [deg]", "offset error [mm]"):
        mirrors.add_column(heading, justify="left" if heading == "surface" else "right")
    for mirror in score.mirrors:
        mirrors.add_row(
            str(mirror.surface), _number(mirror.angle_error_deg, ".3f"), _number(mirror.offset_error_mm, ".2f")
        )
    points = _table("points against the truth")
    for heading in ("", "all surfaces", "out of sight"):
        points.add_column(heading, justify="right" if heading else "left")
    for label, name, scale in (
        ("accuracy [mm]", "accuracy_m", 1e3),
        ("Chamfer distance [mm]", "chamfer_m", 1e3),
        ("precision at 2 cm", "precision_2cm", 1.0),
        ("completeness at 2 cm", "completeness_2cm", 1.0),
        ("F-score at 2 cm", "f_score_2cm", 1.0),
        ("F-score at 5 cm", "f_score_5cm", 1.0),
        ("F-score at 1.5 cells", "f_score_cells", 1.0),
        ("invented share", "invented_fraction", 1.0),
    ):
        values = (score[name], score.hidden[name])
        points.add_row(label, *(_number(value, ".1f" if scale > 1 else ".3f", scale) for value in values))
    _console().print(mirrors, points)
    for name, patch in (score.get("patches") or {}).items():
        print(f"{name} over its surroundings: {_number(patch['contrast_db'], '.1f')} dB")


def describe(name: str, value: Any) -> tuple[str, str]:
    """Label and text of one fact, with the unit that the end of its name stands for.

    Examples
    --------
    >>> describe("range_resolution_m", 0.015)
    ('range resolution', '15 mm')
    >>> describe("cross_range_resolution_m", {"1": 0.0127, "2": 0.0254})
    ('cross range resolution', '12.7 mm at 1 m, 25.4 mm at 2 m')
    >>> describe("measuring_s", 1560.0)
    ('measuring', '26 min')
    """
    stem, _, unit = name.rpartition("_")
    if unit not in ("m", "hz", "deg", "db", "gb", "s"):
        stem, unit = name, ""
    if name == "cross_range_resolution_m":
        at = {_quantity(float(distance), "m"): _quantity(size, "m") for distance, size in value.items()}
        text = ", ".join(f"{size} at {distance}" for distance, size in at.items())
    elif isinstance(value, dict):
        text = ", ".join(f"{key} {_quantity(item, unit)}" for key, item in value.items())
    elif isinstance(value, list):
        text = (
            " to ".join(_quantity(item, unit) for item in value)
            if name == "band_hz"
            else ", ".join(_quantity(item, unit) for item in value)
        )
    else:
        text = _quantity(value, unit)
    return stem.replace("_", " ").replace("snr", "SNR, at least"), text


def _quantity(value: Any, unit: str) -> str:
    """A number with its unit, in millimetres or gigahertz where that reads better."""
    if isinstance(value, list):
        return " to ".join(_quantity(item, unit) for item in value)
    if not isinstance(value, float):
        return "-" if value is None else str(value)
    if unit == "m":
        return f"{value * 1e3:.3g} mm" if abs(value) < 0.1 else f"{value:.3g} m"
    if unit == "s":
        return duration(value)
    if unit == "hz":
        return f"{value / 1e9:.6g} GHz" if value >= 1e9 else f"{value / 1e6:.6g} MHz"
    return f"{value:.3g} { ({'deg': 'degrees', 'db': 'dB', 'gb': 'GB'}.get(unit, '')) }".rstrip()


def duration(seconds: float) -> str:
    """A time as people say it.

    Examples
    --------
    >>> [duration(t) for t in (0.0042, 0.35, 12.0, 59.9, 1560.0, 9000.0, 2e5)]
    ['4.2 ms', '0.35 s', '12 s', '60 s', '26 min', '2.5 h', '2.3 days']
    """
    for limit, unit, name in ((0.1, 1e-3, "ms"), (100.0, 1.0, "s"), (6000.0, 60.0, "min"), (172800.0, 3600.0, "h")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    return f"{seconds / 86400.0:.1f} days"


def _number(value: float | None, form: str, scale: float = 1.0) -> str:
    """A number, or a dash where there is none."""
    return "-" if value is None or not math.isfinite(value) else format(value * scale, form)


def _finite(value: Any) -> Any:
    """The same value in plain Python types, with None for numbers that JSON cannot hold."""
    if isinstance(value, dict):
        return {str(name): _finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return _finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _table(title: str) -> Table:
    """A table: with ruled lines in a terminal, and with nothing but words and numbers for files and pipes."""
    if sys.stdout.isatty():
        return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    return Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))


def _console(plain_width: int = PLAIN_WIDTH) -> Console:
    return Console(width=None if sys.stdout.isatty() else plain_width, highlight=False, markup=False)
