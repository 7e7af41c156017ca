"""Pictures of the experiment on sparse imaging."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.common.decibels import ratio_of, to_db
from mirrorfold.folding.confident import confident_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mirrorfold.scenes.floor_plan import Scene

FLOOR_DB = -70.0
"""Floor of the images [dB]: a glint is tens of decibels above the echoes of hidden objects."""

STYLES = {
    "delay and sum": {"color": "#d95f02", "linestyle": "--", "marker": "o"},
    "sparse": {"color": "#1b6ca8", "linestyle": "-", "marker": "s"},
}


def draw_quality(data: xr.Dataset) -> Figure:
    """Hidden F-score at 1.5 cells against the share that is measured: a row for each family, a column for each kind."""
    from matplotlib.figure import Figure

    families, kinds = data["family"].values, data["kind"].values
    figure = Figure(figsize=(2.6 * len(kinds) + 0.6, 2.4 * len(families) + 0.8), layout="constrained")
    axes = figure.subplots(len(families), len(kinds), sharex=True, sharey=True, squeeze=False)
    percent = 100.0 * data["share"].values
    for row, family in enumerate(families):
        mean, error = _mean_and_error(data["full_f_cells"].sel(family=family))
        for column, kind in enumerate(kinds):
            ax = axes[row, column]
            ax.axhspan(float(mean - error), float(mean + error), color="0.85", lw=0)
            ax.axhline(float(mean), color="0.5", lw=1)
            for method, style in STYLES.items():
                values, bars = _mean_and_error(data["f_cells"].sel(family=family, kind=kind, imaging=method))
                ax.errorbar(percent, values, bars, label=method, capsize=3, ms=5, lw=1.4, **style)
            ax.set_xscale("log")
            ax.set_xticks(percent, [f"{p:.0f}" for p in percent])
            ax.minorticks_off()
            ax.set_xlim(0.8 * percent.min(), 1.25 * percent.max())
            ax.set_ylim(-0.03, 1.05)
            ax.grid(alpha=0.3)
            if row == 0:
                ax.set_title(f"random {kind}")
            if row == len(families) - 1:
                ax.set_xlabel("share measured [%]")
        axes[row, 0].set_ylabel(f"{family}\nhidden F, 1.5 cells")
    axes[0, min(1, len(kinds) - 1)].legend(fontsize=8, loc="center")
    return figure


def draw_example(example: dict[str, xr.DataTree], scene: Scene) -> Figure:
    """Initial images above, folded points below, a column for each method."""
    from matplotlib.figure import Figure

    names = ["all channels", "delay and sum", "sparse"]
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    axes = figure.subplots(2, len(names), sharex=True, sharey=True)
    for column, name in enumerate(names):
        picture = example[name]["initial"].to_dataset()["initial"]
        above, below = axes[:, column]
        level = to_db(np.maximum(picture.values / picture.values.max(), ratio_of(FLOOR_DB)))
        x, y = picture["x"].values, picture["y"].values
        shown = above.imshow(
            level, extent=(x[0], x[-1], y[0], y[-1]), origin="lower", vmin=FLOOR_DB, vmax=0.0, cmap="magma",
            aspect="equal", interpolation="nearest",
        )  # fmt: skip
        mf.plot.scene(scene, below)
        points = confident_points(example[name])
        below.scatter(points["x"], points["y"], s=9, color="#d95f02", zorder=3, label="folded points")
        above.set_title(name)
        below.set_aspect("equal")
        below.set_xlabel("cross-range x [m]")
        for ax in (above, below):
            ax.set_xlim(-1.6, 2.6)
            ax.set_ylim(0.0, 4.2)
            ax.set_ylabel("range y [m]" if column == 0 else "")
            ax.set_xlabel("cross-range x [m]" if ax is below else "")
            if ax.get_legend() is not None:
                ax.get_legend().remove()
    figure.colorbar(shown, ax=axes[0, :], label="amplitude [dB]", shrink=0.9)
    return figure


def draw_unexplained(data: xr.Dataset) -> Figure:
    """The loss of sparse imaging against the share that no reflectivities explain, a point for each scene."""
    from matplotlib.figure import Figure

    kinds = data["kind"].values
    figure = Figure(figsize=(2.6 * len(kinds) + 0.6, 2.9), layout="constrained")
    axes = figure.subplots(1, len(kinds), sharex=True, sharey=True, squeeze=False)[0]
    for ax, kind in zip(axes, kinds, strict=True):
        lost = data["full_f_cells"] - data["f_cells"].sel(kind=kind, imaging="sparse").mean("share")
        for family, marker, colour in zip(data["family"].values, "os", ("#1b6ca8", "#d95f02"), strict=False):
            ax.plot(
                100.0 * data["unexplained"].sel(family=family), lost.sel(family=family), marker, color=colour, ms=5,
                label=family,
            )  # fmt: skip
        ax.axhline(0.0, color="0.5", lw=1)
        ax.set_title(f"random {kind}")
        ax.set_xlabel("unexplained amplitude [%]")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("loss of hidden F")
    axes[0].legend(fontsize=8)
    return figure


def _mean_and_error(values: xr.DataArray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the scenes, and its standard error."""
    count = values.sizes["scene"]
    error = values.std("scene", ddof=1) / np.sqrt(count) if count > 1 else 0.0 * values.mean("scene")
    return np.asarray(values.mean("scene")), np.asarray(error)
