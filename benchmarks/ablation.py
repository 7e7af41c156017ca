"""What each part of the search for mirrors and of the judging of echoes adds: scores of the same scenes without it.

    python benchmarks/ablation.py [--family NAME ...] [--seeds 0:2] [--sweeps DIR]

By default the scenes are those of the full-wave families of `mirrorfold.scenes.families`; --sweeps is a folder that
keeps their sweeps, which take minutes each. The table holds means over the scenes: precision, completeness and F-score
of hidden surfaces in resolution cells, the share of invented points, and in how many scenes F falls and rises by more
than 0.01 without the part.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table

import mirrorfold as mf
from mirrorfold.benchmarking.scenes import Task, simulated
from mirrorfold.common.types import Chain, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.search import lines, shadows, side_lobes
from mirrorfold.detection.views import image_to_view
from mirrorfold.detection.views.view import View
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.scenes.families import FAMILIES, draw, radars_of
from mirrorfold.tree import assignment, completion, kinds, lines_of_sight, measured, ordering, rounds, short_rows
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining import explained_by_tree, misplaced, outshone, wrapped
from mirrorfold.tree.explaining.half_shadows import Overhangs

Instead = dict[ModuleType | type, dict[str, Any]]
"""Functions that do nothing, by the module or class in which they replace others, and by the names of those there."""


def nobody(*given: Any) -> Mask:
    """A mask (n,) that is false for all of the echoes, the first argument that is `Echoes`."""
    return np.zeros(len(next(one for one in given if isinstance(one, Echoes))), dtype=bool)


def nobody_at_all(found: Found, view: View, *given: Any) -> dict[Chain, Mask]:
    """For each chain of mirrors, a mask that is false for all of its objects."""
    return {node.chain: nobody(node.objects) for node in found.tree.walk()}


WITHOUT: dict[str, tuple[Instead, dict[str, Any]]] = {
    "(all parts)": ({}, {}),
    "mirrors seen edge-on": ({completion: {"edge_on": lambda *given: []}}, {}),
    "what casts no shadow": ({ordering: {"levels_behind": lambda *given: None}}, {}),
    "small objects": ({lines_of_sight: {"POINT_CELLS": 0}}, {}),
    "ends of shadows": ({lines_of_sight: {"shadow_ends": lambda objects, view: np.full(len(objects), np.inf)}}, {}),
    "far side lobes": ({explained_by_tree: {"outshone": nobody}}, {}),
    "walls behind objects": (
        {completion: {"beyond_shadows": lambda mirror, *given: mirror, "joined": lambda *given: []}},
        {},
    ),
    "the share that came back as it went": (
        {measured: {"confocal": lambda position, *given, **named: np.full(len(position), np.nan)}},
        {},
    ),
    "mixed paths and late echoes": ({measured: {"misplaced": lambda echoes, **named: np.full(len(echoes), "")}}, {}),
    "late echoes by more than one period": ({wrapped: {"MOST_PERIODS": 1}}, {}),
    "grating lobes": ({misplaced: {"lobe_level": lambda waves, view, range_, u: np.zeros(range_.size)}}, {}),
    "half-shadows": ({measured: {"half_shadows": lambda *given, **named: Overhangs()}}, {}),
    "short rows": ({kinds: {"find_short": lambda found, *given, besides, **named: (found, besides)}}, {}),
    "faint ends of rows": ({lines._Lines: {"strong_share": 1.0}}, {}),
    "rows that end where echoes are much fainter": ({lines: {"FAINTER_CELLS": np.inf}}, {}),
    "rows that end at corners": (
        {rounds: {"row_crossings": lambda *given: np.zeros((0, 2))}},
        {},
    ),
    "legs of corners that are short rows": ({short_rows: {"bright_places": lambda *given: np.zeros((0, 2))}}, {}),
    "side lobes in range": ({image_to_view: {"known_weights": lambda *given: np.zeros(0)}}, {}),
    "rings": ({side_lobes: {"SMALLEST_PART": 1.0}, outshone: {"LONGEST_ROW": np.inf}}, {}),
    "rows of side lobes": ({lines: {"are_side_lobes": lambda *given: False}}, {}),
    "walls that end by their waves": ({rounds: {"doubtful_rows": lambda *given: np.zeros((0, 2, 2))}}, {}),
    "lines by waves": ({kinds: {"with_lines_by_waves": lambda found, image: found}}, {}),
    "lines that leave their rows": ({lines: {"KEPT_SHARE": 0.0}}, {}),
    "breaks in rows": ({lines._Lines: {"_unbroken": lambda search, mirror, own: mirror}}, {}),
    "walls where they are faint": ({shadows: {"goes_on": lambda gap, view: False}}, {}),
    "ends that shine": ({lines._Lines: {"_without_shining_ends": lambda search, mirror, own: mirror}}, {}),
    "rows bent by curved mirrors": ({rounds: {"without_bent": lambda order, ordered: order}}, {}),
    "beams beyond the ends of mirrors": ({assignment: {"beyond_ends": lambda order, echoes, owner: owner}}, {}),
    "beams before the ends of mirrors": ({assignment: {"before_ends": lambda order, echoes, owner: owner}}, {}),
    "what only earlier rounds have hidden": ({rounds: {"shown_at_last": lambda order, echoes, seen, *given: seen}}, {}),
    "what would stand behind walls": ({explained_by_tree: {"behind_walls": nobody}}, {}),
    "what would stand behind objects": ({explained_by_tree: {"behind_objects": nobody_at_all}}, {}),
    "what goes to and fro": ({explained_by_tree: {"to_and_fro": nobody_at_all}}, {}),
    "what flat objects reflect on": ({explained_by_tree: {"reflected_on": nobody_at_all}}, {}),
    "flanks of explained waves": (
        {explained_by_tree: {"flanks": lambda echoes, *given: np.full(len(echoes), "")}},
        {},
    ),
    "short cuts": ({rounds: {"short_cuts": nobody}}, {}),
    "curved mirrors": ({}, {"curved": False}),
    "half-transparent walls": ({}, {"transparent": False}),
    "copies": ({}, {"copies": False}),
    "rough walls": ({}, {"rough_walls": False}),
    "gaps": ({}, {"close_gaps": False}),
    "the least confidence": ({}, {"min_confidence": 0.0}),
}
"""For each part, the functions that do nothing in its place, and the settings that turn it off."""

FIGURES = {
    "precision_cells": "precision", "completeness_cells": "completeness", "f_score_cells": "F",
    "invented_fraction": "invented",
}  # fmt: skip
"""Figures of the table, as `mirrorfold.score` names them, and their headings."""

Figures = dict[str, float | None]


def figures(scene: Any, image: xr.DataArray, sweep: xr.Dataset, part: str) -> Figures:
    """Figures of hidden surfaces without one part, by name; None where nothing is found, or nothing is hidden."""
    instead, settings = WITHOUT[part]
    with ExitStack() as stack:
        for home, functions in instead.items():
            stack.enter_context(patch.multiple(home, **functions))
        found = mf.score(mf.fold(image, sweep=sweep, **settings), scene).hidden
    return {name: getattr(found, name) for name in FIGURES}


def main() -> None:
    """Fold all scenes without each of the parts, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    waves = [family.name for family in FAMILIES.values() if family.engine == "fullwave"]
    parser.add_argument("--family", nargs="+", default=waves)
    parser.add_argument("--seeds", default="0:2", help="FIRST:END, END is left out")
    parser.add_argument("--sweeps", type=Path)
    given = parser.parse_args()
    first, end = map(int, given.seeds.split(":"))
    rows: dict[str, list[Figures]] = {part: [] for part in WITHOUT}
    for seed in range(first, end):
        for name in given.family:
            task = Task(FAMILIES[name], radars_of(FAMILIES[name])[0], seed, ("ours",), given.sweeps)
            scene = draw(task.family, seed, radar=task.radar)
            sweep = simulated(task, scene)
            image = mf.focus(sweep, tolerance=TOLERANCE_TO_FOLD)
            for part, made in rows.items():
                made.append(figures(scene, image, sweep, part))
    table = Table(title=f"hidden things, without one part; {len(rows['(all parts)'])} scenes")
    for heading in ("without", *FIGURES.values(), "falls in", "rises in", "most"):
        table.add_column(heading, justify="left" if heading == "without" else "right")
    # What is not found at all has an F-score of zero.
    scores = {part: np.array([one["f_score_cells"] or 0.0 for one in made]) for part, made in rows.items()}
    for part, made in rows.items():
        means = [np.mean([one[name] for one in made if one[name] is not None]) for name in FIGURES]
        change = scores[part] - scores["(all parts)"]
        moved = [] if part == "(all parts)" else [
            str(np.sum(change < -0.01)), str(np.sum(change > 0.01)), f"{change[np.argmax(abs(change))]:+.3f}",
        ]  # fmt: skip
        table.add_row(part, *(f"{value:.3f}" for value in means), *moved)
    Console().print(table)


if __name__ == "__main__":
    main()
