"""Pictures of benchmarks: every figure of merit by family of scenes, and the differences between two benchmarks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mirrorfold.benchmarking.comparing import BenchmarkComparison, Difference
from mirrorfold.benchmarking.figures import FIGURES
from mirrorfold.benchmarking.summaries import Benchmark, FamilyResult
from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.decibels import COLOURS

PANELS_A_ROW = 4
ROW_HEIGHT, PANEL_WIDTH = 0.24, 3.1
"""Height of the row of a method, and width of a panel [inch]."""

LEGEND_LETTERS, LEGEND_MARK = 150, 9
"""Number of letters for which a legend as wide as the figure has room, and how many of them a mark takes."""

OFFSET = 0.8
"""Share of a family's height over which its methods are spread."""

VERDICTS = {"better": "#009E73", "worse": "#D55E00", "no difference": "#7F7F7F"}
"""Colours of the verdicts, which differ for the colour-blind too."""


def benchmark(found: Benchmark) -> Figure:
    """Draw a benchmark: a panel for each figure, a row for each family, a colour for each method.

    A dot is the mean with its 95 % interval, an upright line the median, a cross the worst scene.

    Parameters
    ----------
    found : Benchmark
        As `mirrorfold.benchmark` returns it.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if not isinstance(found, Benchmark):
        raise wrong_kind("plot.benchmark", found, "what mf.benchmark returns", reader="")
    methods = list(dict.fromkeys(result.method for result in found.results))
    rows = _rows([(result.family, result.radar) for result in found.results])
    names = _defined({name for result in found.results for name, one in result.figures.items() if one.scenes})
    figure, panels = _panels(len(names), len(rows) * max(len(methods), 2))
    for name, ax in zip(names, panels, strict=True):
        for result in found.results:
            number = methods.index(result.method)
            place = list(rows).index((result.family, result.radar)) + _aside(number, len(methods))
            _draw_spread(ax, result, name, place, COLOURS[number % len(COLOURS)])
        _finish(ax, name, list(rows.values()))
    marks = [
        Line2D([], [], color="0.3", marker="o", label="mean, 95 % interval"),
        Line2D([], [], color="0.3", marker="|", linestyle="none", markersize=11, label="median"),
        Line2D([], [], color="0.3", marker="x", linestyle="none", label="worst"),
    ]
    colours = [
        Line2D([], [], color=COLOURS[i % len(COLOURS)], marker="o", label=_with_failures(found, method))
        for i, method in enumerate(methods)
    ]
    handles = [*colours, *marks]
    longest = max(len(str(handle.get_label())) for handle in handles)
    columns = int(np.clip(LEGEND_LETTERS // (longest + LEGEND_MARK), 1, 6))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False)
    return figure


def benchmark_comparison(found: BenchmarkComparison) -> Figure:
    """Draw the differences between two benchmarks: the mean of each paired difference with its 95 % interval.

    Parameters
    ----------
    found : BenchmarkComparison
        As `mirrorfold.benchmarking.compare_benchmarks` returns it.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if not isinstance(found, BenchmarkComparison):
        raise wrong_kind(
            "plot.benchmark_comparison", found, "what mirrorfold.benchmarking.compare_benchmarks returns", reader=""
        )
    several = len({result.first_method for result in found.results}) > 1
    labels = [
        f"{label}, {result.second_method}" if several else label
        for result, label in zip(
            found.results, _labels([(result.family, result.radar) for result in found.results]), strict=True
        )
    ]
    names = _defined({one.figure for result in found.results for one in result.differences if one.scenes})
    figure, panels = _panels(len(names), 2 * len(labels))
    for name, ax in zip(names, panels, strict=True):
        for place, result in enumerate(found.results):
            _draw_difference(ax, next(one for one in result.differences if one.figure == name), place)
        ax.axvline(0.0, color="black", linewidth=0.8, zorder=1)
        _finish(ax, name, labels, bounded=False)
    handles = [Line2D([], [], color=colour, marker="o", label=verdict) for verdict, colour in VERDICTS.items()]
    figure.suptitle(f"{found.second} less {found.first}: mean difference, 95 % interval", fontsize=11)
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _defined(known: set[str]) -> list[str]:
    """The known figures of merit, in the order of `FIGURES`; all of `FIGURES` where none is known."""
    return [name for name in FIGURES if name in known or not known]


def _rows(pairs: Sequence[tuple[str, str]]) -> dict[tuple[str, str], str]:
    """Each family and radar once, with its label."""
    return dict(zip(pairs, _labels(pairs), strict=True))


def _labels(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Names of the families, with the radar where there are several."""
    several = len({radar for _, radar in pairs}) > 1
    return [f"{family}, {radar}" if several else family for family, radar in pairs]


def _panels(count: int, lines: int) -> tuple[Figure, list[Axes]]:
    """A figure with `count` panels in rows of `PANELS_A_ROW`, each high enough for `lines` lines."""
    below = int(np.ceil(count / PANELS_A_ROW))
    size = 1.6 + PANELS_A_ROW * PANEL_WIDTH, 0.9 + below * (0.75 + lines * ROW_HEIGHT)
    figure = Figure(figsize=size, layout="constrained", dpi=150)
    panels = list(figure.subplots(below, PANELS_A_ROW, sharey=True).flat)
    for ax in panels[count:]:
        ax.remove()
    return figure, panels[:count]


def _aside(number: int, count: int) -> float:
    """How far below the middle of its family the method with this number is drawn, in heights of a family."""
    return OFFSET * ((number + 0.5) / count - 0.5)


def _draw_spread(ax: Axes, result: FamilyResult, name: str, place: float, colour: str) -> None:
    """Draw mean with its interval, median and worst value of a figure of merit; nothing where it is undefined."""
    spread = result.figures[name]
    # None becomes NaN, which is not drawn.
    mean, low, high, median, worst = np.array(
        [spread.mean, spread.low, spread.high, spread.median, spread.worst], dtype=float
    )
    ax.plot([low, high], [place, place], color=colour, linewidth=1.8, zorder=2)
    for value, marker, size in ((mean, "o", 4.5), (median, "|", 9.0), (worst, "x", 5.0)):
        ax.plot(value, place, marker, color=colour, markersize=size, zorder=3)


def _draw_difference(ax: Axes, found: Difference, place: int) -> None:
    """Draw a mean difference with its interval, in the colour of the verdict."""
    difference, low, high = np.array([found.difference, found.low, found.high], dtype=float)
    colour = VERDICTS[found.verdict]
    ax.plot([low, high], [place, place], color=colour, linewidth=1.8, zorder=2)
    ax.plot(difference, place, "o", color=colour, markersize=5.0, zorder=3)


def _finish(ax: Axes, name: str, labels: list[str], *, bounded: bool = True) -> None:
    """Finish a panel: title, families from top to bottom and, if `bounded`, an axis from zero, to one for shares."""
    figure = FIGURES[name]
    ax.set_yticks(range(len(labels)), labels)
    ax.set_ylim(len(labels) - 0.5, -0.5)
    for between in range(1, len(labels)):
        ax.axhline(between - 0.5, color="0.85", linewidth=0.8, zorder=0)
    ax.set_title(f"{figure.label} ({'more' if figure.high else 'less'} is better)", fontsize=9)
    ax.margins(x=0.08)
    if bounded:  # with a little room, so that marks on the border are seen whole
        largest = 1.0 if figure.share else ax.get_xlim()[1]
        ax.set_xlim(-0.03 * largest, 1.03 * largest)
    ax.locator_params(axis="x", nbins=5)
    ax.tick_params(labelsize=8)
    ax.grid(axis="x", alpha=0.3)


def _with_failures(found: Benchmark, method: str) -> str:
    """The method's name, with the number of scenes on which it failed."""
    failures = sum(result.failures for result in found.results if result.method == method)
    return f"{method} ({failures} failed)" if failures else method
