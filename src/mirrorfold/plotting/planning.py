"""The picture of a plan: mirrors, bounces, resolution."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from scipy.constants import speed_of_light

from mirrorfold.common.decibels import COLOURS
from mirrorfold.describing.planning import Plan
from mirrorfold.describing.walls import shares

FLOOR_DB = -60.0
"""Lowest level that is shown [dB]."""

SPECTRUM = (50e9, 1000e9)
"""Lowest and highest frequency for which walls are shown [Hz]."""

SPECTRUM_ANGLES = (0.0, 45.0, 75.0)
"""Angles of incidence for which walls are shown against frequency [degree]."""


def plan(found: Plan, *, roughness: tuple[float, float | None], detection_db: float = 13.0) -> Figure:
    """Draw a plan: how walls mirror and scatter, signal over noise by bounces, and resolution.

    Parameters
    ----------
    found : Plan
        As `mirrorfold.plan` returns it.
    roughness : (rms height, correlation length or None) [m]
        As it was given to `mirrorfold.plan`.
    detection_db : float [dB]
        As it was given to `mirrorfold.plan`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(12.0, 8.5), layout="constrained")
    panels = figure.subplots(2, 2)
    name = next(iter(found.walls))
    centre = 0.5 * sum(found.band_hz)
    _over_angle(panels[0, 0], name, centre, roughness)
    _over_frequency(panels[0, 1], name, found.band_hz, roughness)
    _bounces(panels[1, 0], found, name, detection_db)
    _resolution(panels[1, 1], found, centre)
    return figure


def _over_angle(ax: Axes, name: str, frequency: float, roughness: tuple[float, float | None]) -> None:
    """Draw the mirrored and scattered power of a wall against the angle of incidence."""
    angle = np.linspace(0.0, 89.0, 179)
    specular, diffuse = shares(name, np.array(frequency), np.radians(angle), roughness)
    for values, label, style in (
        (specular[0], "mirrored, TE", "-"),
        (specular[1], "mirrored, TM", "--"),
        (diffuse.mean(axis=0), "scattered, mean of both", ":"),
    ):
        ax.plot(angle, _decibels(values), style, color=COLOURS[0 if style != ":" else 1], label=label)
    ax.set(xlabel="angle of incidence [degree]", xlim=(0, 90))
    _finish(ax, f"{name} at {frequency / 1e9:.4g} GHz, {roughness[0] * 1e6:.3g} um rms")


def _over_frequency(ax: Axes, name: str, band: list[float], roughness: tuple[float, float | None]) -> None:
    """Draw the mirrored and scattered power of a wall against frequency."""
    low, high = min(SPECTRUM[0], 0.5 * band[0]), max(SPECTRUM[1], 1.5 * band[1])
    frequency = np.geomspace(low, high, 200)
    for angle, colour in zip(SPECTRUM_ANGLES, COLOURS, strict=False):
        specular, diffuse = shares(name, frequency, np.radians(np.full(frequency.shape, angle)), roughness)
        ax.plot(frequency / 1e9, _decibels(specular[0]), "-", color=colour, label=f"mirrored, TE, {angle:g} degrees")
        ax.plot(
            frequency / 1e9, _decibels(diffuse.mean(axis=0)), ":", color=colour, label=f"scattered, {angle:g} degrees"
        )
    ax.axvspan(band[0] / 1e9, band[1] / 1e9, color="0.85", zorder=0, label="the band")
    ax.set(xlabel="frequency [GHz]", xscale="log", xlim=(low / 1e9, high / 1e9))
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    _finish(ax, f"{name} against frequency")


def _bounces(ax: Axes, found: Plan, name: str, detection_db: float) -> None:
    """Draw signal over noise in the image by number of bounces; bars beyond the ambiguous range are hollow."""
    rows, ambiguous = found.link_budget, found["ambiguous_range_m"]
    snr = np.array([row.snr_db for row in rows], dtype=float)
    unambiguous = np.array([row.range_m <= ambiguous for row in rows])
    bounces = np.arange(len(rows))
    bottom = min(0.0, detection_db) - 20.0
    shown = snr > bottom
    for mask, fill, label in (
        (unambiguous & shown, COLOURS[0], "within the ambiguous range"),
        (~unambiguous & shown, "none", "beyond it, wraps around"),
    ):
        if mask.any():
            ax.bar(bounces[mask], snr[mask] - bottom, bottom=bottom, color=fill, edgecolor=COLOURS[0], label=label)
    ax.axhline(detection_db, color="#CC0000", linewidth=1.0, label=f"seen from {detection_db:g} dB on")
    last = int(np.flatnonzero(shown).max(initial=0)) + 1
    ax.set(xlabel="bounces on each way", ylabel="signal over noise in the image [dB]", xlim=(-0.6, max(last, 3) + 0.6))
    ax.set_title(f"Target by way of {name} at 45 degrees", fontsize=11)
    ax.legend(fontsize=9, frameon=False)
    ax.grid(axis="y", alpha=0.3)


def _resolution(ax: Axes, found: Plan, frequency: float) -> None:
    """Draw the size of a resolution cell against range."""
    aperture = max(found.aperture_m)
    ambiguous = found["ambiguous_range_m"]
    farthest = max(ambiguous, found.link_budget[0].range_m)
    range_ = np.linspace(0.0, farthest * 1.1, 100)
    ax.plot(range_, 1e3 * speed_of_light / frequency * range_ / aperture, color=COLOURS[0], label="across the range")
    ax.axhline(1e3 * found["range_resolution_m"], color=COLOURS[1], linestyle="--", label="along the range")
    ax.axvline(ambiguous, color="#CC0000", linewidth=1.0, label="ambiguous range")
    ax.axvline(found.link_budget[0].range_m, color="0.4", linewidth=1.0, linestyle=":", label="the room ends")
    ax.set(xlabel="range [m]", ylabel="resolution [mm]", xlim=(0, farthest * 1.1), ylim=(0, None))
    ax.set_title(f"Resolution; field of view {found['field_of_view_deg']:.0f} degrees", fontsize=11)
    ax.legend(fontsize=9, frameon=False)
    ax.grid(alpha=0.3)


def _finish(ax: Axes, title: str) -> None:
    ax.set(ylabel="share of the power [dB]", ylim=(FLOOR_DB, 2.0))
    ax.set_title(title, fontsize=11)
    ax.legend(fontsize=8, frameon=False, loc="lower right")
    ax.grid(alpha=0.3)


def _decibels(share: np.ndarray) -> np.ndarray:
    return np.asarray(10.0 * np.log10(np.maximum(share, 1e-30)))
