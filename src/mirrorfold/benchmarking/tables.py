"""Tables of a benchmark as files: CSV with every number, JSON, and text for a page."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from mirrorfold.benchmarking.figures import FIGURES, shown_figures
from mirrorfold.benchmarking.summaries import Benchmark, FamilyResult
from mirrorfold.io.files import written_atomically

TABLES = ("table.csv", "table.json", "table.md")
"""Names of the files."""

COLUMNS = ("scenes", "mean", "low", "high", "median", "worst")
"""Columns of the CSV file for each figure."""

SHOWN = ("f_all", "f_hidden", "precision_hidden", "completeness_hidden", "f_hidden_cells", "invented_cells",
         "angle_deg", "offset_mm")  # fmt: skip
"""Figures of the table for a page; those of curved mirrors and half-transparent walls are added where they are defined.
The other figures are in the CSV and JSON files."""


def write_tables(found: Benchmark, folder: Path) -> list[Path]:
    """Write all tables to an existing folder; returns their paths."""
    paths = [folder / name for name in TABLES]
    with written_atomically(paths[0]) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(("family", "radar", "method", "failures", "figure", *COLUMNS))
        for result in found.results:
            group = result.family, result.radar, result.method, result.failures
            for name, spread in result.figures.items():
                rows.writerow((*group, name, *(spread[column] for column in COLUMNS)))
            for step, seconds in result.seconds.items():
                rows.writerow((*group, f"seconds_{step}", result.scenes, seconds, None, None, None, None))
    with written_atomically(paths[1]) as temporary:
        temporary.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    with written_atomically(paths[2]) as temporary:
        temporary.write_text(markdown(found), encoding="utf-8")
    return paths


def markdown(found: Benchmark) -> str:
    """A table in Markdown: the mean of each figure, its 95 % interval, and the worst scene in brackets."""
    shown = shown_figures(SHOWN, found.results)
    heads = ["family", "radar", "method", "scenes", "failures", *(FIGURES[name].label for name in shown)]
    lines = [heads, ["---"] * len(heads)]
    for result in found.results:
        counts = [str(result.scenes), str(result.failures)]
        lines.append([result.family, result.radar, result.method, *counts, *(cell(result, name) for name in shown)])
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"Mean over the scenes, its 95 % interval, and the worst scene in brackets.\n\n{table}\n"


def cell(result: FamilyResult, name: str) -> str:
    """A figure as text in a table, such as ``0.981 0.970-0.990 (0.94)``; a dash if it is undefined."""
    spread, digits = result.figures[name], FIGURES[name].digits
    if spread.mean is None or spread.worst is None:
        return "-"
    between = "" if spread.low is None else f" {spread.low:.{digits}f}-{spread.high:.{digits}f}"
    return f"{spread.mean:.{digits}f}{between} ({spread.worst:.{digits}f})"
