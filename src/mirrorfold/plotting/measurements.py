"""Pictures of sweeps, of the tree of mirrors, and of scores.

As in all of `mirrorfold.plotting`, each function draws into the given axes, or into new ones, and returns them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from numpy.typing import NDArray

from mirrorfold.common.arguments import boolean
from mirrorfold.common.decibels import COLOURS
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.describing.rows import mirror_rows, place_digits, points_by_chain
from mirrorfold.errors import InputError
from mirrorfold.folding.confident import confident_points
from mirrorfold.plotting.axes import axes_or_new, colour_of, expect_reconstruction
from mirrorfold.sweep import ambiguous_range, check_sweep, is_raster

if TYPE_CHECKING:
    from matplotlib.axes import Axes


PROFILE_FLOOR_DB = -80.0
"""Lowest level of a range profile that is shown, relative to its peak [dB]."""

SPREAD = (10.0, 90.0)
"""Percentiles over the channels between which the band around a range profile is drawn."""

LARGEST_BLOCK = 1 << 24
"""Largest number of samples that are transformed; of larger sweeps evenly spread channels are taken."""


def range_profile(sweep: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the power of a sweep against range: the mean over the channels, and the band that holds most of them.

    ``P(r) = |sum_m w_m S_m exp(+2 j k_m r)|^2`` with a Hann window w; channels are pairs of transmitter and receiver,
    or beams.

    Parameters
    ----------
    sweep : xarray.Dataset
    ax : matplotlib.axes.Axes, optional
        New ones by default.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the sweep is not valid, or has a single frequency.
    """
    sweep = check_sweep(sweep)
    frequency = sweep["frequency"].values.astype(float)
    if frequency.size < 2:
        raise InputError("sweep: has a single frequency, so there are no ranges to draw; sweep a band")
    channels = _channels(sweep)
    window = hann(frequency.size).astype(np.float32)
    count = channels.shape[1]
    # Where there are many channels, some of them suffice.
    chosen = np.unique(np.linspace(0, count - 1, min(count, max(1, LARGEST_BLOCK // frequency.size))).astype(int))
    power = np.abs(np.fft.ifft(channels[:, chosen] * window[:, None], axis=0)) ** 2
    mean = power.mean(axis=1)
    peak = float(mean.max()) or 1.0
    range_ = np.arange(frequency.size) * ambiguous_range(sweep) / frequency.size
    ax = axes_or_new(ax, (7.0, 3.6))
    low, high = (_level(values, peak) for values in np.percentile(power, SPREAD, axis=1))
    ax.fill_between(range_, low, high, color=COLOURS[5], alpha=0.18, linewidth=0,
                    label=f"{SPREAD[0]:g} % to {SPREAD[1]:g} % of the channels")  # fmt: skip
    ax.plot(range_, _level(mean, peak), color=COLOURS[5], linewidth=1.2, label="mean")
    ax.set(xlabel="range [m]", ylabel="power [dB]", xlim=(0.0, range_[-1]))
    ax.set_ylim(max(PROFILE_FLOOR_DB, float(np.percentile(low, 2.0)) - 5.0), 6.0)
    ax.grid(alpha=0.3, linewidth=0.5)
    ax.legend(frameon=False, fontsize="small")
    return ax


def channel_map(sweep: xr.Dataset, ax: Axes | None = None, *, colorbar: bool = True) -> Axes:
    """Draw the mean power of every channel of a sweep; a dead antenna or a wrong gain shows as a line.

    Parameters
    ----------
    sweep : xarray.Dataset
    ax : matplotlib.axes.Axes, optional
        New ones by default.
    colorbar : bool, default True

    Returns
    -------
    matplotlib.axes.Axes
    """
    sweep = check_sweep(sweep)
    s = sweep["s"]
    rows, columns = ("elevation", "azimuth") if is_raster(sweep) else ("rx", "tx")
    samples = s.transpose(..., rows, columns).values
    power = np.mean(np.abs(samples) ** 2, axis=tuple(range(samples.ndim - 2)), dtype=float)
    ax = axes_or_new(ax, (5.2, 4.4))
    if is_raster(sweep):
        axes = [sweep[name].values.astype(float) for name in ("azimuth", "elevation")]
        steps = [mean_step(axis) or 1.0 for axis in axes]
        extent = [edge for axis, step in zip(axes, steps, strict=True)
                  for edge in (axis[0] - step / 2, axis[-1] + step / 2)]  # fmt: skip
        ax.set(xlabel="azimuth [degree]", ylabel="elevation [degree]")
    else:
        extent = [-0.5, power.shape[1] - 0.5, -0.5, power.shape[0] - 0.5]
        ax.set(xlabel="transmitter", ylabel="receiver")
    reference = float(power.max()) or 1.0
    level = _level(power, reference)
    shown = level[np.isfinite(level)]
    low = float(np.percentile(shown, 1.0)) if shown.size else -1.0
    mesh = ax.imshow(level, origin="lower", extent=(extent[0], extent[1], extent[2], extent[3]), cmap="cividis",
                     vmin=min(low, -1.0), vmax=0.0, aspect="auto", interpolation="nearest")  # fmt: skip
    ax.set_facecolor("0.85")
    if boolean("colorbar", colorbar) and isinstance(ax.figure, Figure):
        ax.figure.colorbar(mesh, ax=ax, label="mean power [dB]", pad=0.02)
    return ax


def sweep(sweep: xr.Dataset) -> Figure:
    """Draw one figure of a sweep: its range profile, and the power of its channels.

    Parameters
    ----------
    sweep : xarray.Dataset

    Returns
    -------
    matplotlib.figure.Figure
        Not registered with pyplot; ``figure.savefig(path)`` writes it.
    """
    figure = Figure(figsize=(11.0, 4.0), layout="constrained", dpi=150)
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    range_profile(sweep, left)
    channel_map(sweep, right)
    title = str(sweep.attrs.get("title", ""))
    if title:
        figure.suptitle(title.replace("$", r"\$"), fontsize="medium")
    return figure


def tree(reconstruction: xr.DataTree, ax: Axes | None = None) -> Axes:
    """Draw the tree of mirrors: which mirror is seen through which, with lengths and numbers of points.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    ax : matplotlib.axes.Axes, optional
        New ones by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    expect_reconstruction("tree", reconstruction)
    mirrors = mirror_rows(reconstruction)
    seen, digits = points_by_chain(confident_points(reconstruction)), place_digits(reconstruction) - 1
    place: dict[int, tuple[float, float]] = {}
    rows = 0

    def put(number: int, depth: int) -> float:
        nonlocal rows
        heights = [put(mirror["number"], depth + 1) for mirror in mirrors if mirror["parent"] == number]
        if not heights:
            heights, rows = [float(-rows)], rows + 1
        place[number] = (2.2 * depth, 0.5 * (heights[0] + heights[-1]))
        return place[number][1]

    put(-1, 0)
    depth = max(x for x, _ in place.values())
    ax = axes_or_new(ax, (1.6 + 1.15 * depth, 0.6 + 0.85 * rows))
    for number, (x, y) in place.items():
        if number >= 0:
            px, py = place[mirrors[number]["parent"]]
            ax.plot([px + 0.85, 0.5 * (px + x), 0.5 * (px + x), x - 0.85], [py, py, y, y], color="0.6", linewidth=1.0)
        what, colour, chain = "radar", "black", ""
        if number >= 0:
            mirror = mirrors[number]
            what, colour = f"mirror {number}, {mirror['length']:.{digits}f} m", colour_of(mirror["generation"] - 1)
            chain = mirror["chain"]
        objects, walls = seen.get(chain, (0, 0))
        text = f"{what}\npoints: {objects} of objects,\n{walls} of walls"
        box = FancyBboxPatch((x - 0.82, y - 0.3), 1.64, 0.6, boxstyle="round,pad=0.03,rounding_size=0.12",
                             facecolor="white", edgecolor=colour, linewidth=1.6)  # fmt: skip
        ax.add_patch(box)
        ax.annotate(text, (x, y), ha="center", va="center", fontsize="small", color="black")
    ax.set(xlim=(-1.0, depth + 1.0), ylim=(-rows + 0.4, 0.6), aspect="auto")
    ax.set_axis_off()
    return ax


def score(score: dict[str, Any], ax: Axes | None = None) -> Axes:
    """Draw a score: precision, completeness and F-score of all points, and of those out of line of sight.

    Parameters
    ----------
    score : dict
        What `mirrorfold.score` returns.
    ax : matplotlib.axes.Axes, optional
        New ones by default.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If it is no score.
    """
    if not isinstance(score, dict) or "f_score_2cm" not in score:
        raise InputError(f"plot.score: got a {type(score).__name__}, expected what mirrorfold.score returns")
    names = {
        "precision\nat 2 cm": "precision_2cm",
        "completeness\nat 2 cm": "completeness_2cm",
        "F-score\nat 2 cm": "f_score_2cm",
        "F-score\nat 5 cm": "f_score_5cm",
    }
    ax = axes_or_new(ax, (5.6, 3.4))
    for k, (label, part, colour) in enumerate(
        (("all surfaces", score, COLOURS[5]), ("out of sight", score.get("hidden") or {}, COLOURS[1]))
    ):
        for i, name in enumerate(names.values()):
            value = part.get(name)
            height = float(value) if value is not None and np.isfinite(value) else 0.0
            where = i + 0.38 * (k - 0.5)
            ax.bar(where, height, width=0.36, color=colour, label=label if i == 0 else None)
            ax.annotate(f"{height:.2f}" if value is not None else "\u2013", (where, height), xytext=(0, 2),
                        textcoords="offset points", ha="center", fontsize="small")  # fmt: skip
    ax.set(ylim=(0.0, 1.12), ylabel="share", yticks=np.linspace(0.0, 1.0, 6))
    ax.set_xticks(range(len(names)), list(names))
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize="small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return ax


def _channels(sweep: xr.Dataset) -> NDArray[np.complex64]:
    """The samples as (frequency, channels)."""
    s = sweep["s"]
    others = [dim for dim in s.dims if dim != "frequency"]
    return np.asarray(s.transpose("frequency", *others).values.reshape(s.sizes["frequency"], -1))


def _level(power: Array, reference: float) -> Array:
    """Level ``10 log10(power / reference)`` [dB]; minus infinity where the power is zero."""
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(power / reference))
