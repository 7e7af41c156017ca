"""Pictures and tables of the experiment on scattering."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from mirrorfold.describing.planning import DULL_DB, INVISIBLE_DB
from mirrorfold.reproducing.findings import Table
from mirrorfold.reproducing.parts.window import MATERIALS, PAPER_ROUGHNESS, ROUGHNESSES, Window

COLOURS = ("#0072B2", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#000000")
"""Colours of the materials, or of the roughnesses (palette of Okabe and Ito)."""


def by_frequency(data: xr.Dataset) -> Figure:
    """Shares against frequency: a panel for all materials at the published roughness, one for concrete at all."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    frequency = data["frequency"].values / 1e9
    paper = ROUGHNESSES.index(PAPER_ROUGHNESS)
    for colour, name in zip(COLOURS, data["material"].values, strict=True):
        selected = data.sel(material=name).isel(roughness=paper)
        left.plot(frequency, selected["mirrored"], color=colour, label=str(name))
        left.plot(frequency, selected["scattered"], color=colour, linestyle="--")
    left.set_title("materials, 50 um / 0.2 mm", fontsize=10)
    for colour, index in zip(COLOURS, range(len(ROUGHNESSES)), strict=True):
        selected = data.sel(material="concrete").isel(roughness=index)
        right.plot(frequency, selected["mirrored"], color=colour, label=_label(ROUGHNESSES[index]))
        right.plot(frequency, selected["scattered"], color=colour, linestyle="--")
    right.set_title("concrete, rms height / correlation length", fontsize=10)
    for ax in (left, right):
        ax.set(xscale="log", ylim=(-80, 3), xlabel="frequency [GHz]")
        for level, word, place in ((DULL_DB, "dull below", 11.0), (INVISIBLE_DB, "invisible below", 110.0)):
            ax.axhline(level, color="0.5", linewidth=0.8)
            ax.text(place, level + 0.8, word, color="0.4", fontsize=8)
        ax.legend(fontsize=8, loc="lower right")
        ax.grid(alpha=0.2)
    left.set_ylabel("share of the power [dB]")
    return figure


def by_angle(data: xr.Dataset) -> Figure:
    """Shares at 300 GHz against the angle of incidence."""
    figure = Figure(figsize=(6.5, 4.2), layout="constrained")
    ax = figure.subplots()
    for colour, name in zip(COLOURS, data["material"].values, strict=True):
        selected = data.sel(material=name)
        ax.plot(data["angle"], selected["mirrored_te"], color=colour, label=str(name))
        ax.plot(data["angle"], selected["mirrored_tm"], color=colour, linestyle=":")
        ax.plot(data["angle"], selected["scattered_by_angle"], color=colour, linestyle="--")
    ax.set(xlabel="angle of incidence [degree]", ylabel="share of the power [dB]", ylim=(-45, 2), xlim=(0, 85))
    ax.legend(fontsize=8, loc="lower left", ncols=2)
    ax.grid(alpha=0.2)
    return figure


def draw_windows(windows: list[Window]) -> Figure:
    """Bars from the lowest to the highest frequency of each window."""
    figure = Figure(figsize=(8.0, 5.6), layout="constrained")
    ax = figure.subplots()
    names = list(dict.fromkeys(window.name for window in windows))
    for window in windows:
        row = names.index(window.name) + 0.13 * (ROUGHNESSES.index(window.roughness) - 2.5)
        colour = COLOURS[ROUGHNESSES.index(window.roughness)]
        label = _label(window.roughness) if window.name == names[0] else None
        for level, strength in ((INVISIBLE_DB, 0.35), (-40.0, 1.0)):
            low, high = window.visible[level] / 1e9, window.mirrors / 1e9
            if high > low:
                ax.barh(row, high - low, left=low, height=0.11, color=colour, alpha=strength,
                        label=label if strength == 1.0 else None)  # fmt: skip
    ax.axvline(300.0, color="0.3", linewidth=0.8)
    ax.set(xscale="log", xlabel="frequency [GHz]", yticks=range(len(names)), yticklabels=names)
    ax.invert_yaxis()
    figure.legend(fontsize=8, loc="outside lower center", ncols=3, title="rms height / correlation length",
                  title_fontsize=8)  # fmt: skip
    return figure


def against_waves(measured: list[dict[str, float]]) -> Figure:
    """Mirrored amplitudes of rough lines by full waves, beside both formulas."""
    figure = Figure(figsize=(6.5, 3.8), layout="constrained")
    ax = figure.subplots()
    x = np.arange(len(measured))
    ax.errorbar(x, [row["measured"] for row in measured], [row["standard_error"] for row in measured], fmt="o",
                color="black", capsize=4, label="full waves")  # fmt: skip
    ax.plot(
        x, [row["corrected"] for row in measured], "_", markersize=26, color=COLOURS[0], label="with correlation length"
    )
    ax.plot(x, [row["ament"] for row in measured], "_", markersize=26, color=COLOURS[3], label="Ament, height alone")
    labels = [f"{_label((row['rms_height_m'], row['correlation_length_m']))}\n{row['incidence_deg']:.0f} degrees"
              for row in measured]  # fmt: skip
    ax.set(xticks=x, xticklabels=labels, ylabel="mirrored amplitude over that of a smooth line", ylim=(0.35, 1.05))
    ax.margins(x=0.2)
    ax.legend(fontsize=8)
    ax.grid(alpha=0.2, axis="y")
    return figure


def _label(roughness: tuple[float, float]) -> str:
    return f"{1e6 * roughness[0]:.0f} um / {1e3 * roughness[1]:.2g} mm"


def share_table(numbers: dict[str, float]) -> Table:
    """Mirrored and scattered shares by material, and the level of a wall over the noise, at 10 and 300 GHz."""
    rows = [
        [
            name,
            *(f"{numbers[f'{name}_{what}_{where}_db']:.1f}" for where in ("10_ghz", "300_ghz")
              for what in ("mirrored", "scattered")),
            *(f"{numbers[f'{name}_wall_snr_{where}_db']:.0f}" for where in ("10_ghz", "300_ghz")),
        ]
        for name in (*MATERIALS, "pec")
    ]  # fmt: skip
    columns = ["material", "mirrored, 10 GHz [dB]", "scattered, 10 GHz [dB]", "mirrored, 300 GHz [dB]",
               "scattered, 300 GHz [dB]", "wall over noise at 3 m, 10 GHz [dB]", "300 GHz [dB]"]  # fmt: skip
    return Table(title="Shares of the power at 45 degrees, published roughness", columns=columns, rows=rows)


def window_table(windows: list[Window]) -> Table:
    """The edges of all windows of frequencies."""
    rows = [
        [window.name, _label(window.roughness), *(f"{value / 1e9:.3g}" for value in window.visible.values()),
         f"{window.mirrors / 1e9:.0f}"]
        for window in windows
    ]  # fmt: skip
    columns = ["material", "roughness", *(f"visible above {level:g} dB from [GHz]" for level in windows[0].visible),
               f"mirrors above {DULL_DB:g} dB up to [GHz]"]  # fmt: skip
    return Table(title="The window", columns=columns, rows=rows)


def wave_table(measured: list[dict[str, float]]) -> Table:
    """Mirrored amplitudes of rough lines by full waves and by both formulas."""
    rows = [
        [_label((row["rms_height_m"], row["correlation_length_m"])), f"{row['incidence_deg']:.0f}",
         f"{row['seeds']:.0f}",
         f"{row['measured']:.3f} +- {row['standard_error']:.3f}", f"{row['corrected']:.3f}", f"{row['ament']:.3f}"]
        for row in measured
    ]  # fmt: skip
    columns = ["roughness", "incidence [degree]", "seeds", "full waves", "with correlation length", "Ament"]
    return Table(
        title="Mirrored amplitude of a rough line over that of a smooth one, 300 GHz", columns=columns, rows=rows
    )
