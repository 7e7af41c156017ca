"""Draw which folder imports which: ``python docs/pictures/dependencies.py FILE.svg``.

The folders and their colours are those of the contracts that `lint-imports` holds the imports to (`pyproject.toml`);
the arrows are the imports that are really there. Every arrow points downwards.
"""

from __future__ import annotations

import importlib
import re
import sys
import tomllib
from itertools import combinations
from pathlib import Path

import grimp
import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

PROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"
PACKAGE = "mirrorfold"

BLIND, TRUTH, BOTH = "#cfe3f5", "#fbdcc0", "#dfe4e8"
INK, LINE, QUIET = "#1f2933", "#52606d", "#52606d"

ROW, BOX, HEIGHT = 1.05, 1.75, 0.62
"""Distance of the rows, width and height of a box."""

COLUMNS = {BLIND: 2.5, BOTH: 7.1, TRUTH: 11.7}
"""Middles of the columns: no arrow goes from the left one to the right one."""

SPAN = 2.2
"""Half the width of a column."""

LANES = (0.0, -1.05, 1.05)
"""Where a box may stand beside the middle of its column."""

EVERYWHERE = ("common", "errors")
"""Leaves that every folder may import; their arrows would hide the others."""

HIT, CROSSING, ASIDE = 10.0, 1.0, 0.4
"""What counts against a layout: an arrow through a box, two arrows that cross, a box beside the middle."""

LABELS = {BLIND: "imaging, blind to the truth", BOTH: "sees both sides", TRUTH: "scenes and their truth"}

Point = tuple[float, float]
Pairs = set[tuple[str, str]]


def folders() -> tuple[list[list[str]], set[str], set[str]]:
    """The layers from top to bottom, the folders that must not see the truth, and those of the truth."""
    contracts = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    blind = next(contract for contract in contracts if contract["type"] == "forbidden")
    rows = next(contract for contract in contracts if contract["type"] == "layers")["layers"]

    def short(names: list[str]) -> list[str]:
        return [name.strip().removeprefix(f"{PACKAGE}.") for name in names]

    return [short(row.split(":")) for row in rows], set(short(blind["source_modules"])), set(
        short(blind["forbidden_modules"])
    )  # fmt: skip


def imports(names: set[str]) -> Pairs:
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


def without_shortcuts(pairs: Pairs) -> Pairs:
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


def ranks(names: list[str], pairs: Pairs) -> dict[str, int]:
    """The row of each folder, counted from the bottom: one above the highest of those that it imports."""
    rank: dict[str, int] = {}
    for name in reversed(names):  # what is imported stands below in the layers
        rank[name] = 1 + max((rank[stop] for start, stop in pairs if start == name), default=-1)
    return rank


def step(name: str) -> str:
    """Which steps of the algorithm a folder holds, by the first words of its docstring; empty for none."""
    text = importlib.import_module(f"{PACKAGE}.{name}").__doc__ or ""
    found = re.match(r"(The six steps|Steps? \d(?: and \d)?)", text)
    return found[1].lower() if found else ""


def laid_out(names: list[str], column: dict[str, str], rank: dict[str, int], pairs: Pairs) -> dict[str, Point]:
    """The middle of each box, moved from lane to lane until no move makes the arrows clearer."""
    place = {name: (COLUMNS[column[name]], ROW * rank[name]) for name in names}

    def try_lanes(name: str) -> None:
        x, y = COLUMNS[column[name]], ROW * rank[name]
        options = [{**place, name: (x + lane, y)} for lane in LANES]
        place.update(min(options, key=lambda option: untidiness(option, column, pairs)))

    for _ in range(4):
        for name in names:
            try_lanes(name)
    return place


def untidiness(place: dict[str, Point], column: dict[str, str], pairs: Pairs) -> float:
    """What counts against a layout, see `HIT`, `CROSSING` and `ASIDE`."""
    ways = {pair: arrow(place, *pair) for pair in sorted(pairs)}
    found = ASIDE * sum(abs(x - COLUMNS[column[name]]) for name, (x, _) in place.items())
    for (start, stop), way in ways.items():
        for name, (x, y) in place.items():
            if name not in (start, stop):
                sides = (((x - BOX / 2, y), (x + BOX / 2, y)), ((x, y - HEIGHT / 2), (x, y + HEIGHT / 2)))
                found += HIT * any(cross(way, side) for side in sides)
    for (one, way), (other, more) in combinations(ways.items(), 2):
        found += CROSSING * (not set(one) & set(other) and cross(way, more))
    for (x, y), (u, v) in combinations(place.values(), 2):
        found += HIT * (y == v) * max(0.0, 1.1 * BOX - abs(x - u))  # boxes that overlap
    return found


def arrow(place: dict[str, Point], start: str, stop: str) -> tuple[Point, Point]:
    """From the lower edge of one box to the upper edge of the other."""
    (x, y), (u, v) = place[start], place[stop]
    lean = max(-0.35, min(0.35, 0.2 * (u - x))) * BOX  # arrows to different sides leave apart from each other
    return (x + lean, y - HEIGHT / 2), (u - lean, v + HEIGHT / 2)


def cross(one: tuple[Point, Point], other: tuple[Point, Point]) -> bool:
    """Whether two line segments cross."""

    def side(a: Point, b: Point, c: Point) -> float:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    (a, b), (c, d) = one, other
    return side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0


def draw(path: Path) -> Path:
    """Write the picture.

    Parameters
    ----------
    path : Path
        An SVG file, whose folder exists.
    """
    layers, blind, truth = folders()
    names = [name for layer in layers for name in layer if name not in EVERYWHERE]
    height = {name: index for index, layer in enumerate(layers) for name in layer}
    pairs = without_shortcuts({pair for pair in imports(set(names)) if height[pair[0]] < height[pair[1]]})
    column = {name: BLIND if name in blind else TRUTH if name in truth else BOTH for name in names}
    rank = ranks(names, pairs)
    place = laid_out(names, column, rank, pairs)
    top, bottom = ROW * max(rank.values()) + 1.15, -ROW - HEIGHT

    width = COLUMNS[TRUTH] + SPAN + 0.3
    figure = Figure(figsize=(width * 0.8, (top - bottom) * 0.8))
    axes = figure.add_axes((0, 0, 1, 1))
    for colour, label in LABELS.items():
        axes.axvspan(COLUMNS[colour] - SPAN, COLUMNS[colour] + SPAN, color=colour, alpha=0.25, linewidth=0)
        axes.text(COLUMNS[colour], top - 0.45, label, ha="center", fontsize=12, color=INK, fontweight="bold")
    for start, stop in sorted(pairs):
        ends = arrow(place, start, stop)
        style = {"arrowstyle": "-|>", "mutation_scale": 10, "shrinkA": 0, "shrinkB": 1}
        axes.add_patch(FancyArrowPatch(*ends, **style, color=LINE, linewidth=1.0, alpha=0.8))
    for name, (x, y) in place.items():
        box(axes, name, (x, y), BOX, column[name], step(name))
    box(
        axes, "  and  ".join(EVERYWHERE), (COLUMNS[BOTH], -ROW), width - 0.6, "#ffffff", "every folder may import these"
    )
    axes.set(xlim=(0, width), ylim=(bottom, top), aspect="equal")
    axes.axis("off")
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": PACKAGE}):
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, facecolor="white")
    return path


def box(axes: mpl.axes.Axes, name: str, at: Point, width: float, colour: str, note: str) -> None:
    """A box with a name, and a note below it."""
    x, y = at
    corner = (x - width / 2, y - HEIGHT / 2)
    rounded = "round,pad=0,rounding_size=0.12"
    axes.add_patch(
        FancyBboxPatch(corner, width, HEIGHT, rounded, facecolor=colour, edgecolor=INK, linewidth=0.8, zorder=3)
    )
    axes.text(x, y + 0.1 * bool(note), name, ha="center", va="center", fontsize=11, color=INK, zorder=4)
    axes.text(x, y - 0.17, note, ha="center", va="center", fontsize=8, color=QUIET, zorder=4)


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "dependencies.svg"))
