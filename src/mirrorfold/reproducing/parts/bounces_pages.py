"""Pictures and tables of the experiment on bounces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.common.decibels import COLOURS, bounce_label
from mirrorfold.describing.planning import Plan
from mirrorfold.reproducing.findings import Table
from mirrorfold.reproducing.parts.frequency_pages import mean_error
from mirrorfold.scenes.floor_plan import Scene

Row = dict[str, Any]
Plans = dict[tuple[str, float], Plan]


def case_key(material: str, power: float, threshold: float) -> str:
    """The beginning of the names of all numbers of a case."""
    return f"{material}_{power:.0f}_dbm_threshold_{-threshold:.0f}_db"


def found_by_bounces(rows: Sequence[Row], plans: Plans) -> Figure:
    """Completeness of the target against the number of bounces, a panel for each threshold."""
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    thresholds = sorted({row["threshold_db"] for row in rows}, reverse=True)
    counts = sorted({row["bounces"] for row in rows})
    panels = figure.subplots(1, len(thresholds), sharey=True, squeeze=False)[0]
    for ax, threshold in zip(panels, thresholds, strict=True):
        for index, ((material, power), plan) in enumerate(plans.items()):
            colour, shift = COLOURS[index % len(COLOURS)], 0.04 * (index - 0.5 * (len(plans) - 1))
            values = [(n + shift, _of(rows, material, power, threshold, n, "completeness_cells")) for n in counts]
            points = [(at, *found) for at, value in values if (found := mean_error(value))]
            ax.errorbar(*np.array(points).T, marker="o", capsize=3, markersize=4, color=colour,
                        label=f"{material}, {power:.0f} dBm")  # fmt: skip
            last = plan.bounces_above_noise
            if last is not None and last < max(counts):
                ax.axvline(last + 0.5 + shift, color=colour, linestyle="--", linewidth=1.2)
        ax.set(xlabel="bounces", xticks=counts, xlim=(counts[0] - 0.5, counts[-1] + 0.7), ylim=(-0.05, 1.07))
        ax.set_title(f"threshold {threshold:.0f} dB", fontsize=10)
        ax.grid(alpha=0.2)
    panels[0].set_ylabel("completeness of the target, 1.5 cells")
    panels[-1].legend(fontsize=8)
    return figure


def found_by_snr(rows: Sequence[Row], detection_db: float) -> Figure:
    """Completeness of the target in every corridor against the signal over noise that `plan` predicts."""
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    thresholds = sorted({row["threshold_db"] for row in rows}, reverse=True)
    panels = figure.subplots(1, len(thresholds), sharey=True, squeeze=False)[0]
    for ax, threshold in zip(panels, thresholds, strict=True):
        for count in sorted({row["bounces"] for row in rows}):
            selected = [row for row in rows if row["bounces"] == count and row["threshold_db"] == threshold]
            spread = np.random.default_rng(count).uniform(-0.7, 0.7, len(selected))
            ax.scatter([row["plan_snr_db"] for row in selected] + spread,
                       [row["completeness_cells"] for row in selected], s=14,
                       color=COLOURS[count % len(COLOURS)], label=bounce_label(count))  # fmt: skip
        ax.axvline(detection_db, color="0.4", linestyle="--", linewidth=1.0)
        ax.text(detection_db + 0.7, 0.5, "seen, says plan", rotation=90, va="center", fontsize=8, color="0.3")
        ax.set(xlabel="signal over noise of the target, by plan [dB]", ylim=(-0.05, 1.07))
        ax.set_title(f"threshold {threshold:.0f} dB", fontsize=10)
        ax.grid(alpha=0.2)
    panels[0].set_ylabel("completeness of the target, 1.5 cells")
    panels[-1].legend(fontsize=8)
    return figure


def accuracies(rows: Sequence[Row]) -> Figure:
    """Distances of points from the target, and errors of the walls, in the corridors whose target is found."""
    figure = Figure(figsize=(10.0, 3.8), layout="constrained")
    panels = figure.subplots(1, 3)
    found = [row for row in rows if row["found"]]
    counts = sorted({row["bounces"] for row in found})
    off = [
        [1e3 * row["median_m"] for row in found if row["bounces"] == n and row["median_m"] is not None] for n in counts
    ]
    mean = [[1e3 * row["mean_m"] for row in found if row["bounces"] == n and row["mean_m"] is not None] for n in counts]
    if counts:
        panels[0].boxplot(off, positions=counts, widths=0.5)
        panels[0].plot(counts, [np.mean(one) if one else np.nan for one in mean], "D", color=COLOURS[4], markersize=5,
                       label="mean distance")  # fmt: skip
        panels[0].legend(fontsize=8, loc="lower right")
    panels[0].set(xlabel="bounces", ylabel="median distance from the target [mm]")
    panels[0].set_ylim(bottom=0.0)
    kinds = (0, "error of the angle [degree]", (1e-3, 3.0)), (1, "error of the offset [mm]", (1e-2, 30.0))
    for ax, (index, label, limits) in zip(panels[1:], kinds, strict=True):
        errors = [
            [
                row["walls"][g - 1][index]
                for row in found
                if row["bounces"] >= g and row["walls"][g - 1][index] is not None
            ]
            for g in counts
        ]
        if counts:
            ax.boxplot([one or [np.nan] for one in errors], positions=counts, widths=0.5)
        ax.set(xlabel="generation of the wall", ylabel=label, yscale="log", ylim=limits)
    for ax in panels:
        ax.grid(alpha=0.2, axis="y")
    return figure


def result_table(rows: Sequence[Row]) -> Table:
    """Means of the scores by case and number of bounces."""
    lines = []
    cases = dict.fromkeys((row["material"], row["power_dbm"], row["threshold_db"]) for row in rows)
    scores = (
        ("found", 1, 2),
        ("completeness_cells", 1, 2),
        ("precision_cells", 1, 2),
        ("median_m", 1e3, 1),
        ("mean_m", 1e3, 1),
    )
    for case in sorted(cases, key=lambda case: (case[0], case[1], -case[2])):
        for count in sorted({row["bounces"] for row in rows}):
            cells = []
            for name, scale, digits in scores:
                one = mean_error(_of(rows, *case, count, name))
                cells.append("-" if one is None else f"{scale * one[0]:.{digits}f} +- {scale * one[1]:.{digits}f}")
            number = len(_of(rows, *case, count, "found"))
            snr = np.mean(_of(rows, *case, count, "plan_snr_db"))
            lines.append([case[0], f"{case[1]:.0f}", f"{case[2]:.0f}", str(count), f"{snr:.0f}", str(number), *cells])
    columns = [
        "walls", "power [dBm]", "threshold [dB]", "bounces", "signal over noise by plan [dB]", "corridors", "found",
        "completeness, 1.5 cells", "hidden precision, 1.5 cells", "median distance [mm]", "mean distance [mm]",
    ]  # fmt: skip
    return Table(title="Mean and standard error over corridors", columns=columns, rows=lines)


def budget_table(plans: Plans, counts: Sequence[int]) -> Table:
    """The link budget of `plan`, for each case."""
    lines = [
        [material, f"{power:.0f}", *(f"{plan.link_budget[n].snr_db:.0f}" for n in (0, *counts)),
         str(plan.bounces_above_noise)]
        for (material, power), plan in plans.items()
    ]  # fmt: skip
    columns = ["walls", "power [dBm]", *(f"{n} bounces [dB]" for n in (0, *counts)), "bounces above 13 dB"]
    return Table(title="The link budget of `plan`", columns=columns, rows=lines)


def _of(rows: Sequence[Row], material: str, power: float, threshold: float, bounces: int, name: str) -> list[Any]:
    """The values of one score in the corridors of one case."""
    wanted = (material, power, threshold, bounces)
    return [
        row[name] for row in rows
        if (row["material"], row["power_dbm"], row["threshold_db"], row["bounces"]) == wanted
    ]  # fmt: skip


def wide_picture(reconstruction: xr.DataTree, scene: Scene) -> Figure:
    """The image before and after folding, wide enough for the legend of five generations."""
    figure = mf.plot.before_after(reconstruction, scene)
    figure.set_size_inches(11.0, 7.5)
    return figure
