"""The pictures of docs/fullwave.md: ``python docs/pictures/fullwave.py [SWEEP.nc]`` writes them beside itself.

SWEEP.nc is the full-wave sweep of the shipped scene two_walls.toml; without it, the comparison with rays is left out.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

import mirrorfold as mf
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.solver import scattered

HERE = Path(__file__).resolve().parent
TWO_WALLS = Path(str(files("mirrorfold").joinpath("scenes", "shipped", "two_walls.toml")))
sys.path.insert(0, str(HERE.parents[1] / "tests"))
from fullwave_scenes import (  # noqa: E402
    ANTENNAS,
    SHAPES,
    TARGET,
    WALL,
    K,
    cylinder,
    distance,
    exact_field,
    nodes_of,
    scene_of,
    small_two_walls,
)

FLOOR_DB = -60.0
NEAR_FIELD_HERTZ = 6e9


def validation() -> None:
    """Error against nodes per wavelength, and against the tolerance of the skeletons."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    densities = np.array([10, 12, 14, 16, 20, 24])
    line = {"kind": "segment", "start": [-0.006, 0.03], "end": [0.006, 0.032]}
    shapes = {
        "cylinder, against its series": {"kind": "circle", "center": [0.0, 0.02], "radius": 3e-3},
        "strip": line,
        "right angle": SHAPES["right angle"],
        "rough as a wall, h = 0.05, L = 0.2 mm": {**line, "roughness": WALL},
        "rough as a target, h = 0.1, L = 0.2 mm": {**line, "roughness": TARGET},
    }
    for (name, shape), marker in zip(shapes.items(), "os^vD", strict=True):
        scene = scene_of(shape)
        if shape["kind"] == "circle":
            reference = cylinder(3e-3, np.array([0.0, 0.02]), ANTENNAS, ANTENNAS)
        else:
            reference = exact_field(nodes_of(scene, 64), ANTENNAS, ANTENNAS, K)
        errors = [distance(exact_field(nodes_of(scene, n), ANTENNAS, ANTENNAS, K), reference) for n in densities]
        left.loglog(densities, errors, marker + "-", label=name)
    left.loglog(densities, 3e-2 * (densities / 8.0) ** -5.0, "k:", label="fifth order")
    left.set(xlabel="nodes per wavelength", ylabel="relative error of the scattered field", xticks=densities)
    left.set_xticklabels([str(n) for n in densities])
    left.minorticks_off()
    left.legend(fontsize=8)

    k = K * 290 / 300
    tolerances = np.array([1e-2, 3e-3, 1e-3, 3e-4, 1e-4])
    scene = small_two_walls(0.1, elements=17)
    dense = scattered(replace(prepare(scene, nodes_per_wavelength=14), roots=()), k)
    systems = [prepare(scene, tolerance=t, nodes_per_wavelength=14) for t in tolerances]
    fields = [scattered(system, k) for system in systems]
    right.loglog(tolerances, [distance(s, dense) for s in fields], "o-", label="against the dense solution")
    right.loglog(tolerances, [distance(s.T, s) for s in fields], "s-", label="reciprocity")
    right.loglog(tolerances, tolerances, "k:", label="the tolerance")
    right.set(xlabel="tolerance", ylabel="relative error of the sweep")
    right.legend(fontsize=8)
    for axis in (left, right):
        axis.grid(alpha=0.3)
    figure.savefig(HERE / "fullwave_validation.png", dpi=110)


def near_field() -> None:
    """The field between two smooth walls, at a frequency whose waves can be seen."""
    rough = mf.load_scene(TWO_WALLS)
    scene = replace(rough, surface=tuple(replace(surface, roughness=None) for surface in rough.surface))
    x, y = np.linspace(-1.1, 1.1, 440), np.linspace(-0.1, 2.4, 500)
    field = mf.near_field(scene, NEAR_FIELD_HERTZ, (x, y))
    figure, axes = plt.subplots(1, 2, figsize=(10, 5.6), sharey=True, layout="constrained")
    extent = (x[0], x[-1], y[0], y[-1])
    wave = axes[0].imshow(
        field.real, origin="lower", extent=extent, cmap="RdBu_r", vmin=-2.0, vmax=2.0, interpolation="bilinear"
    )
    figure.colorbar(wave, ax=axes[0], shrink=0.8, label="real part [m$^{-1/2}$]")
    level = 20 * np.log10(np.maximum(np.abs(field), 1e-6))
    strength = axes[1].imshow(level, origin="lower", extent=extent, cmap="viridis", vmin=-30.0, vmax=10.0)
    figure.colorbar(strength, ax=axes[1], shrink=0.8, label="modulus [dB re m$^{-1/2}$]")
    for axis, title in zip(axes, ("the wave at one moment", "how strong it is"), strict=True):
        mf.plot.scene(scene, axis)
        axis.set(title=title, xlabel="x [m]", ylabel="y [m]", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    figure.savefig(HERE / "fullwave_near_field.png", dpi=80)


def comparison(sweep: Path) -> None:
    """Images of both solvers' sweeps of one scene, at one scale, and their range profiles."""
    scene = mf.load_scene(TWO_WALLS)
    sweeps = {"full wave": mf.load(sweep), "rays": mf.simulate(scene)}
    x, y = np.linspace(-1.2, 2.8, 801), np.linspace(0.6, 4.6, 801)
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.3), layout="constrained", width_ratios=(1, 1, 0.9))
    images = {name: np.abs(mf.focus(data, x=x, y=y).values) * np.hypot(x, y[:, None]) for name, data in sweeps.items()}
    peak = max(image.max() for image in images.values())
    for axis, (name, image) in zip(axes, images.items(), strict=False):
        level = 20 * np.log10(np.maximum(image / peak, 1e-9))
        shown = axis.imshow(
            level, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), vmin=FLOOR_DB, vmax=-5.0, cmap="viridis"
        )
        mf.plot.scene(scene, axis, alpha=0.6)
        axis.set(title=name, xlabel="x [m]", ylabel="y [m]", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    figure.colorbar(shown, ax=axes[:2], shrink=0.8, label="dB of the stronger image's peak, times range")
    for name, data in sweeps.items():
        s = data["s"].values
        window = np.hanning(len(s))
        profile = np.sqrt(np.mean(np.abs(np.fft.ifft(s * window[:, None, None], axis=0)) ** 2, axis=(1, 2)))
        ranges = np.arange(len(s)) * mf.info(data)["ambiguous_range_m"] / len(s)
        axes[2].plot(ranges, 20 * np.log10(profile), label=name, linewidth=0.9)
    axes[2].set(xlabel="range [m]", ylabel="mean echo [dB re m$^{-1/2}$]", ylim=(-95, -15), xlim=(0, 6))
    axes[2].grid(alpha=0.3)
    axes[2].legend()
    figure.savefig(HERE / "fullwave_rays.png", dpi=100)


if __name__ == "__main__":
    validation()
    near_field()
    if len(sys.argv) > 1:
        comparison(Path(sys.argv[1]))
