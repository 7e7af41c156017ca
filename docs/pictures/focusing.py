"""The picture of docs/focusing.md: ``python docs/pictures/focusing.py`` writes focusing.png beside itself."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from scipy.constants import speed_of_light

mpl.use("Agg")
import matplotlib.pyplot as plt

from mirrorfold.common.windows import window
from mirrorfold.focusing import focus
from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.problem import Problem
from mirrorfold.sweep import make_sweep

FLOOR_DB = -50.0
TARGETS = np.array([[-0.6, 1.2], [0.0, 0.9], [0.5, 1.5], [0.9, 0.6], [-0.95, 0.55]])


def main() -> None:
    """Image five points and show where the fast path errs."""
    frequency = np.linspace(290e9, 300e9, 121)
    k = 2 * np.pi * frequency / speed_of_light
    place = np.zeros((121, 3))
    place[:, 0] = 0.5e-3 * (np.arange(121) - 60)
    s = np.zeros((frequency.size, 121, 121), complex)
    for x, y in TARGETS:
        wave = np.exp(-1j * k[:, None] * np.hypot(place[:, 0] - x, y))
        s += wave[:, :, None] * wave[:, None, :]
    x, y = np.linspace(-1.2, 1.2, 900), np.linspace(0.2, 1.75, 600)
    sweep = make_sweep(s, frequency=frequency, tx_position=place, rx_position=place)
    image = focus(sweep, x=x, y=y, tolerance=1e-3)
    one = np.ones(121, complex)
    problem = Problem(k, place, place, window("hann", 121, "taper"), one, one, x, y, np.zeros(1))
    step = 12
    rows, columns = np.arange(0, y.size, step), np.arange(0, x.size, step)
    flat = np.ravel_multi_index(np.meshgrid([0], rows, columns, indexing="ij"), problem.shape).ravel()
    exact = direct_sum(problem, sweep["s"].values, problem.points(flat)).reshape(rows.size, columns.size)
    error = np.abs(image.values[np.ix_(rows, columns)] - exact)
    peak = float(np.abs(image).max())
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True, layout="constrained")
    shown = [
        (np.abs(image.values), FLOOR_DB, "image, fast path at a tolerance of 1e-3"),
        (error, -110.0, "its distance from the float64 sum"),
    ]
    for axis, (values, floor, title) in zip(axes, shown, strict=True):
        level = 20 * np.log10(np.maximum(values / peak, 1e-9))
        extent = (x[0], x[-1], y[0], y[-1])
        picture = axis.imshow(level, origin="lower", extent=extent, vmin=floor, cmap="viridis", aspect="equal")
        axis.set(title=title, xlabel="x [m]")
        figure.colorbar(picture, ax=axis, label="dB of the image's peak", shrink=0.85)
    axes[0].plot(*TARGETS.T, "o", markersize=12, fillstyle="none", color="white", markeredgewidth=0.7)
    axes[0].set_ylabel("y [m]")
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=130)
    print(f"error {image.attrs['error']:.1e}, algorithm {image.attrs['algorithm']}")


if __name__ == "__main__":
    main()
