"""Tables, for people, of the results of plans, benchmarks, comparisons and experiments."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from mirrorfold.cli.terminal import WIDE, CleanTable, console, duration, number, show_files, table_of

if TYPE_CHECKING:
    from mirrorfold.benchmarking.comparing import BenchmarkComparison
    from mirrorfold.benchmarking.summaries import Benchmark
    from mirrorfold.cli.benchmarking import Catalogue
    from mirrorfold.cli.reproducing import Experiments
    from mirrorfold.describing.comparison import Comparison
    from mirrorfold.describing.planning import Plan
    from mirrorfold.reproducing import Reproduction

HEADING_WIDTH = 10
"""Width at which the headings of figures are broken into lines [characters]."""

UNLIMITED = 10_000
"""Width that no table needs [characters]."""


def show_comparison(found: Comparison) -> None:
    """Print how two results differ: levels, points, mirrors."""
    levels = found.levels
    facts = CleanTable(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_row("first", found.first)
    facts.add_row("second", found.second)
    facts.add_row("level, second over first", f"{number(levels.median_db, '+.2f')} dB (median)")
    facts.add_row("difference", f"{number(levels.rms_db, '.2f')} dB (rms over {levels.pixels} pixels)")
    facts.add_row("correlation", number(levels.correlation, ".4f"))
    if "points" in found:
        points = found.points
        facts.add_row("points", f"{points.first} and {points.second}: {points.kept} kept, {points.gained} gained, "
                                f"{points.lost} lost")  # fmt: skip
    console().print(facts)
    if not found.get("mirrors"):
        return
    table = table_of("mirrors, at their true places")
    curved = any("sagitta_m" in pair for pair in found.mirrors)
    bends = ("first radius [m]", "second radius [m]", "sagitta [mm]") if curved else ()
    for heading in ("first", "second", "angle [deg]", "offset [mm]", *bends):
        table.add_column(heading, justify="right")
    for pair in found.mirrors:
        cells = ["-" if number is None else str(number) for number in (pair.first, pair.second)]
        cells += [number(pair.angle_deg, ".3f"), number(pair.offset_m, ".2f", 1e3)]
        if curved:
            cells += [number(pair.first_radius_m, ".3g"), number(pair.second_radius_m, ".3g")]
            cells.append(number(pair.sagitta_m, ".2f", 1e3))
        table.add_row(*cells)
    console().print(table)


def show_benchmark(found: Benchmark) -> None:
    """Print a table for each radar, with the mean figures of each family and method, and the worst hidden F-score."""
    from mirrorfold.benchmarking.figures import FIGURES, shown_figures

    usual = ("f_all", "f_hidden", "precision_hidden", "f_hidden_cells", "invented_cells", "angle_deg", "offset_mm")
    for radar in dict.fromkeys(result.radar for result in found.results):
        shown = shown_figures(usual, [result for result in found.results if result.radar == radar])
        table = table_of(f"radar {radar}: means over the scenes")
        for heading in ("family", "method"):
            table.add_column(heading)
        for heading in ("done", *(FIGURES[name].label for name in shown), "F, hidden, worst", "time"):
            table.add_column(textwrap.fill(heading, HEADING_WIDTH, break_long_words=False), justify="right")
        for result in found.results:
            if result.radar == radar:
                means = (number(result.figures[name].mean, f".{FIGURES[name].digits}f") for name in shown)
                worst = number(result.figures["f_hidden"].worst, ".3f")
                counts = f"{result.scenes - result.failures}/{result.scenes}"
                taken = duration(sum(result.seconds.values()))
                table.add_row(result.family, result.method, counts, *means, worst, taken)
        on = console(WIDE)
        needed = on.measure(table, options=on.options.update(max_width=UNLIMITED)).maximum
        on.width = max(on.width, needed)  # in a narrow window lines are continued below: no figure may be cut off
        on.print(table)


def show_benchmark_comparison(found: BenchmarkComparison) -> None:
    """Print the difference of each figure between two benchmarks, with its interval and the verdict."""
    from mirrorfold.benchmarking.figures import FIGURES

    table = table_of(f"{found.second} less {found.first}: mean difference of the scenes that both have")
    for heading in ("family, radar, method", "scenes", "figure", "first", "second", "difference", "95 %", "verdict"):
        table.add_column(heading, justify="left" if heading[0] in "fv" and heading != "first" else "right")
    for result in found.results:
        methods = " to ".join(dict.fromkeys((result.first_method, result.second_method)))
        name = f"{result.family}, {result.radar}, {methods}"
        for one in result.differences:
            if one.difference is None:
                continue
            form = f".{FIGURES[one.figure].digits}f"
            between = "-" if one.low is None else f"{number(one.low, '+' + form)} {number(one.high, '+' + form)}"
            numbers = (number(one.first, form), number(one.second, form), number(one.difference, "+" + form))
            verdict = "-" if one.low is None else one.verdict
            table.add_row(name, str(one.scenes), FIGURES[one.figure].label, *numbers, between, verdict)
            name = ""
    console().print(table)


def show_catalogue(found: Catalogue) -> None:
    """Print all families of scenes and all radars, each with its description."""
    for title, entries in (("families", found.families), ("radars", found.radars)):
        table = table_of(title)
        table.add_column("name", no_wrap=True)
        table.add_column("what")
        for entry in entries:
            table.add_row(entry.name, entry.what)
        console().print(table)


def show_experiments(found: Experiments) -> None:
    """Print the table of all experiments."""
    table = table_of("Experiments")
    for heading in ("name", "published", "what"):
        table.add_column(heading)
    for one in found.experiments:
        table.add_row(one.name, one.source, one.purpose)
    console(WIDE).print(table)


def show_reproduction(found: Reproduction) -> None:
    """Print the published claims of experiments beside our numbers, and the paths of the pages."""
    table = table_of("")
    for heading in ("experiment", "claim", "here", "verdict"):
        table.add_column(heading)
    for result in found.results:
        for place, claim in enumerate(result.claims):
            table.add_row(result.name if place == 0 else "", claim.claim, claim.measured, claim.verdict)
        table.add_section()
    console(WIDE).print(table)
    show_files(path for path in found.files if path.endswith(("index.html", "index.md")))


def show_plan(found: Plan) -> None:
    """Print the plan of a measurement: reflection and scattering of walls, signal over noise by bounces, F-scores."""
    for name, wall in found.walls.items():
        table = table_of(f"{name}: share of the power [dB]")
        table.add_column("angle of incidence [deg]")
        for angle in wall.angle_deg:
            table.add_column(f"{angle:g}", justify="right")
        for label, levels in (
            ("mirrored, TE", wall.specular_te_db),
            ("mirrored, TM", wall.specular_tm_db),
            ("scattered", wall.diffuse_db),
        ):
            table.add_row(label, *(number(level, ".1f") for level in levels))
        console().print(table)
    budget = table_of("a target by way of mirrors at 45 degrees")
    for heading in ("bounces", "range [m]", "SNR of a sample [dB]", "SNR in the image [dB]"):
        budget.add_column(heading, justify="right")
    for row in found.link_budget[: (found.bounces_above_noise or 0) + 3]:
        budget.add_row(
            str(row.bounces),
            f"{row.range_m:.3g}",
            number(row.sample_snr_db, ".1f"),
            number(row.snr_db, ".1f"),
        )
    console().print(budget)
    quality = found.hidden_quality
    expected = table_of(f"hidden F-score, wall of 1 m ({quality.wall_cells:.0f} cells)")
    for heading in ("points right within", "F-score", "standard error"):
        expected.add_column(heading, justify="right")
    for label, score, error in (
        ("2 cm", quality.f_score_2cm, quality.f_score_2cm_error),
        ("5 cm", quality.f_score_5cm, quality.f_score_5cm_error),
        (f"1.5 cells ({150.0 * quality.cell_m:.1f} cm)", quality.f_score_cells, quality.f_score_cells_error),
    ):
        expected.add_row(label, number(score, ".2f"), number(error, ".2f"))
    console().print(expected)
