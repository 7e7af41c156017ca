"""The pictures of docs/explanation/algorithm.md: ``python docs/pictures/steps.py`` writes them beside itself."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.common.decibels import COLOURS, TRUTH_COLOUR

HERE = Path(__file__).resolve().parent
BEFORE = (-2.2, 1.15, -0.15, 3.15)
AFTER = (-1.25, 1.35, -0.15, 2.6)
HEIGHT, DPI = 5.4, 110
PALE = 0.25


def panel(extent: tuple[float, float, float, float]) -> tuple[Figure, plt.Axes]:
    """A figure as wide as the part of the floor plan is."""
    width = HEIGHT * (extent[1] - extent[0]) / (extent[3] - extent[2])
    return plt.subplots(figsize=(width + 1.0, HEIGHT), layout="constrained")


def write(figure: Figure, axes: plt.Axes, extent: tuple[float, float, float, float], name: str) -> None:
    """Cut to the extent and write."""
    axes.plot(0.0, 0.0, "^", color="black", markersize=10, markeredgecolor="white", zorder=6)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    figure.savefig(HERE / f"steps-{name}.png", dpi=DPI)
    plt.close(figure)


def background(reconstruction: object, axes: plt.Axes, *, alpha: float = 1.0) -> None:
    """The initial image."""
    initial = reconstruction.children["initial"].dataset["initial"]
    mf.plot.image(initial, axes, normalization="none", extent=BEFORE, colorbar=False, floor_db=-40.0)
    axes.images[0].set_alpha(alpha)


def ways(axes: plt.Axes, scene: object) -> None:
    """The scene, with the way of a wave to an object out of sight, and the place where the radar takes it to stand."""
    mf.plot.scene(scene, axes)
    for line in axes.lines[:-1]:
        line.set(linewidth=2.6)
    wall = next(surface for surface in scene.surface if surface.name == "wall").pieces(1.0)[0]
    hidden = np.array([0.14, 2.16])
    along = (wall[1] - wall[0]) / np.linalg.norm(wall[1] - wall[0])
    normal = np.array([-along[1], along[0]])
    ghost = hidden - 2.0 * normal * ((hidden - wall[0]) @ normal)
    depth = (wall[0] @ normal) / (ghost @ normal)
    hit = ghost * depth
    way = np.stack([np.zeros(2), hit, hidden])
    axes.plot(*way.T, color=COLOURS[1], linewidth=1.8, label="the way of the wave")
    axes.plot(
        *np.stack([hit, ghost]).T,
        color=COLOURS[1],
        linewidth=1.4,
        linestyle=(0, (4, 3)),
        label="what the radar takes it for",
    )
    axes.plot(*ghost, "o", markersize=11, markerfacecolor="none", markeredgecolor=COLOURS[1], markeredgewidth=1.8)
    for surface in scene.surface:
        middle = np.concatenate(surface.pieces(0.05)).mean(axis=0)
        axes.annotate(surface.name, middle, xytext=(9, 9), textcoords="offset points", color=TRUTH_COLOUR)
    axes.annotate(
        "ghost of the corner", ghost, xytext=(0, 13), textcoords="offset points", color=COLOURS[1], ha="center"
    )
    axes.annotate("radar", (0.0, 0.0), xytext=(12, -4), textcoords="offset points")
    axes.legend(loc="upper right", frameon=False)


def points(reconstruction: object, axes: plt.Axes, *, folded: bool) -> None:
    """The objects, coloured by the number of bounces."""
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    suffix = "" if folded else "_initial"
    names = {0: "line of sight", 1: "by way of one mirror", 2: "by way of two mirrors"}
    for bounces in np.unique(objects["bounces"]):
        chosen = objects["bounces"].values == bounces
        axes.plot(
            objects[f"x{suffix}"].values[chosen],
            objects[f"y{suffix}"].values[chosen],
            "o",
            markersize=3.4,
            markeredgewidth=0,
            color=COLOURS[int(bounces)],
            label=names.get(int(bounces), f"{bounces} mirrors"),
        )
    axes.legend(loc="upper right", frameon=False)


def movements(reconstruction: object, axes: plt.Axes) -> None:
    """Each mirror where it was seen, thin, and where it stands; arrows for a few of the echoes."""
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    for index in range(mirrors.sizes["mirror"]):
        one = mirrors.isel(mirror=index)
        colour = COLOURS[int(one["generation"]) - 1]
        seen, true = (
            np.array([[one[f"{p}x0"], one[f"{p}y0"]], [one[f"{p}x1"], one[f"{p}y1"]]], dtype=float)
            for p in ("", "folded_")
        )
        axes.plot(*seen.T, color=colour, linewidth=1.5, linestyle=(0, (3, 2)))
        axes.plot(*true.T, color=colour, linewidth=3.4, solid_capstyle="round")
        if not np.allclose(seen, true):
            arrow(axes, seen.mean(axis=0), true.mean(axis=0), colour)
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    moved = np.flatnonzero(objects["bounces"].values > 0)
    for i in moved[:: max(len(moved) // 14, 1)]:
        start = objects["x_initial"].values[i], objects["y_initial"].values[i]
        stop = objects["x"].values[i], objects["y"].values[i]
        arrow(axes, start, stop, COLOURS[int(objects["bounces"][i])])


def arrow(axes: plt.Axes, start: object, stop: object, colour: str) -> None:
    """A curved arrow."""
    style = {"arrowstyle": "-|>", "color": colour, "alpha": 0.75, "linewidth": 1.1, "connectionstyle": "arc3,rad=-0.12"}
    axes.annotate("", stop, start, arrowprops=style)


def main() -> None:
    """Simulate the hidden corner, fold it, and draw each step."""
    scene = mf.load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", "hidden_corner.toml"))))
    reconstruction = mf.reconstruct(mf.simulate(scene))

    figure, axes = panel(BEFORE)
    ways(axes, scene)
    write(figure, axes, BEFORE, "0-scene")

    figure, axes = panel(BEFORE)
    background(reconstruction, axes)
    write(figure, axes, BEFORE, "1-image")

    figure, axes = panel(BEFORE)
    background(reconstruction, axes)
    mf.plot.mirrors(reconstruction, axes)
    write(figure, axes, BEFORE, "2-mirrors")

    figure, axes = panel(BEFORE)
    background(reconstruction, axes)
    mf.plot.shadows(reconstruction, axes)
    mf.plot.mirrors(reconstruction, axes)
    write(figure, axes, BEFORE, "3-shadows")

    figure, axes = panel(BEFORE)
    background(reconstruction, axes, alpha=PALE)
    mf.plot.shadows(reconstruction, axes)
    points(reconstruction, axes, folded=False)
    write(figure, axes, BEFORE, "4-objects")

    figure, axes = panel(BEFORE)
    background(reconstruction, axes, alpha=PALE)
    movements(reconstruction, axes)
    write(figure, axes, BEFORE, "5-chains")

    figure, axes = panel(AFTER)
    mf.plot.corrected(reconstruction, axes, extent=AFTER, colorbar=False)
    mf.plot.scene(scene, axes)
    write(figure, axes, AFTER, "6-folded")


if __name__ == "__main__":
    main()
