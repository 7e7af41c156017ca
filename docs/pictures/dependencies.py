"""Draw which module imports which: ``python docs/pictures/dependencies.py FILE.svg``.

Rows are the layers that the imports are held to by `lint-imports`; arrows are the imports that are really there.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import grimp
import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

PROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"
PACKAGE = "mirrorfold"

BLIND, TRUTH, BOTH = "#cfe3f5", "#fbdcc0", "#eceff1"
INK, LINE = "#1f2933", "#7b8794"

HEIGHT, ROW, GAP = 0.5, 0.92, 0.35
CHARACTER = 0.115
"""Width of a letter, which boxes are made to fit."""

WIDTH = 13.0

COLUMNS = {BLIND: 2.4, BOTH: 6.75, TRUTH: 10.9}
"""Middles of the columns: no arrow goes from the left one to the right one."""

SPAN = 2.12
"""Half the width of a column."""

SHIFTS = (0.0, 0.5, -0.5, 0.3)

EVERYWHERE = {"errors", "memory", "levels"}
"""Leaves that nearly everything imports; their arrows would hide the others."""


def layers() -> tuple[list[list[str]], set[str], set[str]]:
    """The layers from top to bottom, the modules that must not see the truth, and those of the truth."""
    contracts = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    blind = next(contract for contract in contracts if contract["type"] == "forbidden")
    rows = next(contract for contract in contracts if contract["type"] == "layers")["layers"]

    def short(names: list[str]) -> list[str]:
        return [name.strip().removeprefix(f"{PACKAGE}.") for name in names]

    return [short(row.split(":")) for row in rows], set(short(blind["source_modules"])), set(
        short(blind["forbidden_modules"])
    )  # fmt: skip


def imports(names: set[str]) -> set[tuple[str, str]]:
    """Pairs of importer and imported, each with all that is inside of it."""
    graph = grimp.build_graph(PACKAGE, exclude_type_checking_imports=True)
    for name in names:
        if graph.find_children(f"{PACKAGE}.{name}"):
            graph.squash_module(f"{PACKAGE}.{name}")
    return {
        (importer, imported.removeprefix(f"{PACKAGE}."))
        for importer in names
        for imported in graph.find_modules_directly_imported_by(f"{PACKAGE}.{importer}")
        if imported.removeprefix(f"{PACKAGE}.") in names - {importer}
    }


def without_shortcuts(pairs: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The arrows that are not implied by a chain of others (transitive reduction)."""
    following: dict[str, set[str]] = {}
    for start, stop in pairs:
        following.setdefault(start, set()).add(stop)

    def reaches(start: str, stop: str) -> bool:
        return any(name == stop or reaches(name, stop) for name in following.get(start, ()))

    return {
        (start, stop)
        for start, stop in pairs
        if not any(name != stop and reaches(name, stop) for name in following[start])
    }


def draw(path: Path) -> Path:
    """Write the picture.

    Parameters
    ----------
    path : Path
        An SVG file, whose folder exists.
    """
    rows, blind, truth = layers()
    height = {name: index for index, row in enumerate(rows) for name in row}
    pairs = without_shortcuts({pair for pair in imports(set(height)) if height[pair[0]] < height[pair[1]]})
    pairs = {pair for pair in pairs if pair[1] not in EVERYWHERE}
    figure = Figure(figsize=(WIDTH, ROW * len(rows) * 1.0))
    axes = figure.add_axes((0, 0, 1, 1))
    place = {}
    for index, row in enumerate(rows):
        for colour, middle in COLUMNS.items():
            members = [name for name in row if (BLIND if name in blind else TRUTH if name in truth else BOTH) == colour]
            widths = [0.4 + CHARACTER * len(name) for name in members]
            # Neighbouring rows are shifted against each other, so that arrows pass between the boxes.
            left = (
                middle
                - (sum(widths) + GAP * (len(members) - 1)) / 2
                + (SHIFTS[index % len(SHIFTS)] if len(members) < 3 else 0.0)
            )
            for name, width in zip(members, widths, strict=True):
                place[name] = (left + width / 2, -ROW * index, width)
                left += width + GAP
    for start, stop in sorted(pairs):
        (x0, y0, _), (x1, y1, _) = place[start], place[stop]
        bend = 0.0 if y0 - y1 < 1.5 * ROW else 0.16 if x1 >= x0 else -0.16
        axes.add_patch(
            FancyArrowPatch(
                (x0, y0 - HEIGHT / 2),
                (x1, y1 + HEIGHT / 2),
                connectionstyle=f"arc3,rad={bend}",
                arrowstyle="-|>",
                mutation_scale=9,
                color=LINE,
                linewidth=0.9,
                alpha=0.75,
                shrinkA=0,
                shrinkB=1,
            )
        )
    for name, (x, y, width) in place.items():
        colour = BLIND if name in blind else TRUTH if name in truth else BOTH
        axes.add_patch(
            FancyBboxPatch(
                (x - width / 2, y - HEIGHT / 2),
                width,
                HEIGHT,
                boxstyle="round,pad=0,rounding_size=0.12",
                facecolor=colour,
                edgecolor=INK,
                linewidth=0.8,
                zorder=3,
            )
        )
        axes.text(x, y, name, ha="center", va="center", fontsize=11, color=INK, zorder=4)
    labels = {BLIND: "imaging: blind to the truth", TRUTH: "the world and the truth", BOTH: "both sides"}
    for colour, label in labels.items():
        axes.text(COLUMNS[colour], 0.75, label, ha="center", fontsize=12, color=INK, fontweight="bold")
        axes.axvspan(COLUMNS[colour] - SPAN, COLUMNS[colour] + SPAN, color=colour, alpha=0.25, linewidth=0)
    axes.set(xlim=(0, WIDTH), ylim=(-ROW * (len(rows) - 1) - 0.6, 1.1), aspect="equal")
    axes.axis("off")
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": PACKAGE}):
        figure.savefig(path, metadata={"Date": None}, transparent=False, facecolor="white")
    return path


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "dependencies.svg"))
