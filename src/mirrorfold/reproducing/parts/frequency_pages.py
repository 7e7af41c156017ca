"""Pictures and tables of the experiment on frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from mirrorfold.reproducing.findings import Table
from mirrorfold.reproducing.parts.quality_table import MIRRORED_EDGES_DB
from mirrorfold.scoring.figures import NEAR, WIDE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = dict[str, Any]

COLOURS = ("#0072B2", "#009E73", "#E69F00", "#D55E00")
TICKS = (60, 80, 110, 150, 220, 300, 450, 670, 1000)
"""Frequencies that are labelled [GHz]."""

SCORES = {"f_2cm": "within 2 cm", "f_5cm": "within 5 cm", "f_cells": "within 1.5 cells"}


def mean_error(values: Sequence[float | None]) -> tuple[float, float] | None:
    """Mean and standard error of the values that are known; the error of a single value is zero; None without any."""
    known = np.array([value for value in values if value is not None], dtype=float)
    if not known.size:
        return None
    return float(known.mean()), float(known.std(ddof=1) / np.sqrt(known.size)) if known.size > 1 else 0.0


def by_bandwidth(rows: Sequence[Row]) -> Figure:
    """F-scores, and errors of the angles of the walls that are found, against frequency."""
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    panels = figure.subplots(1, 3)
    for ax, group in zip(panels, ("3.4 percent", "10 GHz"), strict=False):
        usual = _usual(rows, group)
        for colour, (name, label) in zip(COLOURS, SCORES.items(), strict=False):
            _curve(ax, usual, name, color=colour, label=label)
        ax.set_title(f"bandwidth {group}", fontsize=10)
        ax.set(ylabel="hidden F-score", ylim=(-0.03, 1.05))
        _frequencies(ax)
        ax.legend(fontsize=8, loc="lower right")
    for colour, group in zip(COLOURS, ("3.4 percent", "10 GHz"), strict=False):
        _curve(panels[2], _usual(rows, group), "angle_deg", color=colour, label=group)
    panels[2].set_title("angle of the walls that are found", fontsize=10)
    panels[2].set(ylabel="error [degree]", yscale="log")
    _frequencies(panels[2])
    panels[2].legend(fontsize=8)
    return figure


def by_roughness(rows: Sequence[Row], roughnesses: Sequence[tuple[float, float]]) -> Figure:
    """F-score at 5 cm and the share of scenes in which both walls are found, for several roughnesses."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for colour, (height, length) in zip(COLOURS, roughnesses, strict=True):
        selected = [row for row in rows if row["group"] == "10 GHz" and np.isclose(row["rms_height"], height)]
        label = f"{1e6 * height:.0f} um / {1e3 * length:.2g} mm"
        _curve(left, selected, "f_5cm", color=colour, label=label)
        _curve(right, selected, "both_walls", color=colour, label=label)
    left.set(ylabel="hidden F-score within 5 cm", ylim=(-0.03, 1.05))
    right.set(ylabel="share of scenes with both walls found", ylim=(-0.03, 1.05))
    right.legend(fontsize=8, title="walls: rms height / correlation", title_fontsize=8, loc="lower center")
    for ax in (left, right):
        _frequencies(ax)
    return figure


def aperture_map(rows: Sequence[Row], apertures: Sequence[float]) -> Figure:
    """Mean F-scores as a map of frequency and aperture, with the numbers written into its cells."""
    usual = [row for row in rows if row["group"] == "3.4 percent"]
    frequencies = sorted({row["frequency"] for row in usual})
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for ax, name in zip(panels, ("f_2cm", "f_5cm"), strict=True):
        table = np.full((len(apertures), len(frequencies)), np.nan)
        for i, aperture in enumerate(apertures):
            for j, f in enumerate(frequencies):
                found = mean_error(
                    [r[name] for r in usual if np.isclose(r["aperture"], aperture) and r["frequency"] == f]
                )
                if found is not None:
                    table[i, j] = found[0]
                    ax.text(j, i, f"{found[0]:.2f}", ha="center", va="center", fontsize=8,
                            color="white" if found[0] < 0.6 else "black")  # fmt: skip
        image = ax.imshow(table, origin="lower", vmin=0.0, vmax=1.0, cmap="viridis", aspect="auto")
        ax.set(xticks=range(len(frequencies)), xticklabels=[f"{f / 1e9:.0f}" for f in frequencies],
               yticks=range(len(apertures)), yticklabels=[f"{100 * a:.0f}" for a in apertures],
               xlabel="frequency [GHz]")  # fmt: skip
        ax.set_title(SCORES[name], fontsize=10)
    panels[0].set_ylabel("aperture [cm]")
    figure.colorbar(image, ax=panels, label="hidden F-score")
    return figure


def collapse(rows: Sequence[Row], table: dict[str, Any]) -> Figure:
    """Scores of all scenes, and the table of expected quality, against lengths in resolution cells."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    jitter = np.random.default_rng(0).uniform(-0.02, 0.02, len(rows))
    used = [row["mirrored_db"] >= MIRRORED_EDGES_DB[-1] for row in rows]
    left.scatter([row["wall_cells"] for row in rows], [row["shown"] + j for row, j in zip(rows, jitter, strict=True)],
                 s=7, c=["0.6" if ok else "#D55E00" for ok in used])  # fmt: skip
    for colour, name, limit in ((COLOURS[0], "f_2cm", NEAR), (COLOURS[1], "f_5cm", WIDE)):
        seen = [row for row, ok in zip(rows, used, strict=True) if ok and row["shown"]]
        at = [limit / row["cell_m"] for row in seen]
        right.scatter(at, [row[name] for row in seen], s=7, color=colour, alpha=0.5, label=f"scenes, {SCORES[name]}")
    for ax, curve in ((left, table["found"]), (right, table["close"])):
        ax.errorbar(curve["at"], curve["mean"], curve["standard_error"], marker="o", color="black", capsize=3,
                    markersize=4, label="mean of each class")  # fmt: skip
        ax.set(xscale="log", ylim=(-0.05, 1.07))
        ax.grid(alpha=0.2)
    for ax, ticks in ((left, (5, 10, 20, 40, 80)), (right, (0.1, 0.2, 0.5, 1, 2))):
        ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.set_xticks([], minor=True)
    left.set(xlabel="length of the wall [cells]", ylabel="wall that shows is found")
    right.set(xlabel="distance at which a point is right [cells]", ylabel="hidden F-score")
    left.set_title(f"orange: walls that mirror less than {MIRRORED_EDGES_DB[-1]:g} dB", fontsize=9)
    right.legend(fontsize=8, loc="lower right")
    return figure


def against_waves(rows: Sequence[Row]) -> Figure:
    """F-scores of the same scenes by rays and by full waves, against frequency."""
    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for ax, name in zip(panels, ("f_5cm", "f_cells"), strict=True):
        for colour, group in ((COLOURS[0], "rays beside full waves"), (COLOURS[3], "full waves")):
            selected = [row for row in rows if row["group"] == group]
            label = "rays" if group.startswith("rays") else group
            _curve(ax, selected, name, color=colour, label=label)
            ax.scatter(
                [row["frequency"] / 1e9 for row in selected],
                [row[name] for row in selected],
                s=9,
                color=colour,
                alpha=0.5,
            )
        ax.set(ylim=(-0.03, 1.05))
        ax.set_title(SCORES[name], fontsize=10)
        _frequencies(ax)
        ax.set_xlim(50, 130)
    panels[0].set_ylabel("hidden F-score")
    panels[1].legend(fontsize=8)
    return figure


def scene_table(rows: Sequence[Row]) -> Table:
    """Means by group, radar, material and roughness."""
    keys = list(dict.fromkeys(_key(row) for row in rows))
    lines = []
    for key in keys:
        selected = [row for row in rows if _key(row) == key]
        cells = []
        for name in ("f_2cm", "f_5cm", "f_cells", "both_walls", "angle_deg"):
            found = mean_error([row[name] for row in selected])
            digits = 3 if name == "angle_deg" else 2
            cells.append("-" if found is None else f"{found[0]:.{digits}f} +- {found[1]:.{digits}f}")
        group, material, f, bandwidth, aperture, height = key
        cell = 1e3 * float(np.mean([row["cell_m"] for row in selected]))
        radar = [f"{f / 1e9:.0f}", f"{bandwidth / 1e9:.3g}", f"{100 * aperture:.0f}"]
        lines.append([group, material, *radar, f"{1e6 * height:.0f}", f"{cell:.0f}", str(len(selected)), *cells])
    columns = [
        "scenes", "walls", "frequency [GHz]", "bandwidth [GHz]", "aperture [cm]", "rms height [um]", "cell [mm]",
        "count", "F, 2 cm", "F, 5 cm", "F, 1.5 cells", "both walls", "angle [degree]",
    ]  # fmt: skip
    return Table(title="Mean and standard error over scenes", columns=columns, rows=lines)


def _key(row: Row) -> tuple[Any, ...]:
    return tuple(row[name] for name in ("group", "material", "frequency", "bandwidth", "aperture", "rms_height"))


def _usual(rows: Sequence[Row], group: str) -> list[Row]:
    """The scenes of a group with an aperture of 8 cm and the published rms height."""
    return [
        row for row in rows
        if row["group"] == group and np.isclose(row["aperture"], 0.08) and np.isclose(row["rms_height"], 0.05e-3)
    ]  # fmt: skip


def _curve(ax: Axes, rows: Sequence[Row], name: str, **style: Any) -> None:
    """Draw means with standard errors against frequency."""
    points = []
    for f in sorted({row["frequency"] for row in rows}):
        found = mean_error([row[name] for row in rows if row["frequency"] == f])
        if found is not None:
            points.append((f / 1e9, *found))
    if points:
        ax.errorbar(*np.array(points).T, marker="o", capsize=3, markersize=4, **style)


def _frequencies(ax: Axes) -> None:
    """Make the x axis a logarithmic axis of frequency with a few labels."""
    ax.set(xscale="log", xlabel="frequency [GHz]", xlim=(50, 1200))
    ax.set_xticks(TICKS, [str(tick) for tick in TICKS], fontsize=7)
    ax.set_xticks([], minor=True)
    ax.grid(alpha=0.2)
