"""How thick a wall appears, and how much of this is due to the beam, the range cell, and scattering inside the wall.

The mean power across a wall is measured for walls that scatter on their faces alone, and down to several depths. The
profile of a wall that scatters inside is predicted from that of the face alone, shifted to the depths of all
scatterers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.decibels import COLOURS, power_ratio_of
from mirrorfold.common.types import Array
from mirrorfold.reproducing.findings import Table
from mirrorfold.reproducing.parts.raster import (
    DEPTHS,
    SNR_DB,
    TOLD_DB,
    thickness,
    wall_profile,
    walls_of,
    without_pictures,
)
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.materials import scattering_depth
from mirrorfold.scenes.scanner import Steps
from mirrorfold.scenes.solids import Panel, Scene3D
from mirrorfold.simulation.raster.speckle import diffuse_share

BEAMS = (61, 31)
"""Number of beams in azimuth and in elevation. The scan is half as high as wide, which suffices for a mean profile."""

HANN_TOLD = 2.56
"""Width at -10 dB of the echo of a point with a Hann window over frequency, in units of ``c / (2B)``."""

QUANTILES = (np.arange(400) + 0.5) / 400
"""Quantiles of the scatterers' depths, for the prediction of profiles."""


@dataclass(frozen=True, eq=False)
class Thickness:
    """Mean profiles across a wall that scatters down to several depths.

    Attributes
    ----------
    depths : tuple of float [m]
        Depths down to which the walls scatter; the first is zero.
    profiles : (depths, seeds, samples) array
        Relative power at `DEPTHS` behind the true face, across a plane parallel to the fitted one.
    errors : (depths, seeds) array [m]
        Distance of the fitted plane behind the true face.
    predicted : (depths, samples) array
        The profile of the face alone, spread over the depths of the scatterers.
    cell : float [m]
        Width that the range cell alone would have across the wall.
    """

    depths: tuple[float, ...]
    profiles: Array
    errors: Array
    predicted: Array
    cell: float

    def widths(self) -> Array:
        """Apparent thickness [m], (depths, seeds)."""
        return np.array([[thickness(_profile(one)) for one in of_depth] for of_depth in self.profiles])

    def numbers(self) -> dict[str, float]:
        """Thickness of each wall, and by how much scattering down to 15 mm makes a wall appear thicker."""
        widths, found = self.widths(), {"range_cell_alone_m": self.cell}
        for depth, width, profile, predicted, error in zip(
            self.depths, widths, self.profiles, self.predicted, self.errors, strict=True
        ):
            label = f"{1e3 * depth:.0f}mm"
            found[f"face_behind_{label}_m"] = float(error.mean())
            found[f"thickness_{label}_m"] = float(width.mean())
            found[f"predicted_{label}_m"] = thickness(_profile(predicted))
            found[f"center_{label}_m"] = _center(profile.mean(axis=0))
        scene = widths[self.depths.index(0.015)] - widths[0]
        found["thicker_m"] = float(scene.mean())
        found["thicker_se_m"] = float(scene.std(ddof=1) / np.sqrt(scene.size))
        return found

    def table(self) -> Table:
        """A row for each depth: thickness with its standard error, prediction, centre of the echo, fitted plane."""
        rows, widths = [], self.widths()
        for i, depth in enumerate(self.depths):
            error = widths[i].std(ddof=1) / np.sqrt(widths[i].size)
            millimetres = depth, thickness(_profile(self.predicted[i])), _center(self.profiles[i].mean(axis=0))
            results = [f"{1e3 * value:z.1f}" for value in (*millimetres, float(self.errors[i].mean()))]
            rows.append([results[0], f"{1e3 * widths[i].mean():.1f} +- {1e3 * error:.1f}", *results[1:]])
        columns = ["scatters down to [mm]", f"thickness at -{TOLD_DB:g} dB [mm]", "predicted [mm]",
                   "centre of the echo, behind the face [mm]", "fitted plane, behind the face [mm]"]  # fmt: skip
        return Table(title="How thick the drywall appears", columns=columns, rows=rows)

    def dataset(self) -> xr.Dataset:
        """All profiles."""
        power, metres = {"long_name": "power, relative to its maximum", "units": "1"}, {"units": "m"}
        return xr.Dataset(
            {
                "profile": (("volume_depth", "seed", "depth"), self.profiles, power),
                "predicted": (("volume_depth", "depth"), self.predicted, power),
                "thickness": (("volume_depth", "seed"), self.widths(), metres),
                "face_error": (("volume_depth", "seed"), self.errors, metres),
            },
            coords={"volume_depth": ("volume_depth", list(self.depths), metres), "depth": ("depth", DEPTHS, metres)},
        )


def measure_thickness(
    work: Work, scene: Scene3D, depths: tuple[float, ...], seeds: int, *, done: int, total: int
) -> Thickness:
    """Scan the walls of a scene alone, with scattering down to each of the depths [m], each with several seeds."""
    steps = Steps(start=-7.5, stop=7.5, points=BEAMS[1])
    low = replace(scene, scanner=replace(scene.scanner, elevation=steps))
    low = replace(low, scanner=replace(low.scanner, azimuth=replace(_steps(low), points=BEAMS[0])))
    walls = [one for one in scene.surface if isinstance(one, Panel)]
    results = []
    for depth in depths:
        bare = replace(low, surface=tuple(replace(one, volume_depth=depth) for one in walls))
        for seed in range(seeds):
            results.append(work.kept(lambda bare=bare, seed=seed: _profile_of(bare, seed)))  # type: ignore[misc]
            done += 1
            work.step(done, total)
    table = np.array(results).reshape(len(depths), seeds, -1)
    found, errors = table[..., 1:], table[..., 0]
    wall = walls[0]
    sight = np.array([0.0, 1.0, 0.0])
    cosine = float(abs(sight @ wall.normal) / np.linalg.norm(wall.normal))
    frequency = scene.band.middle
    shares = [float(diffuse_share(wall, frequency, np.array([cosine]), inside=inside)[0]) for inside in (False, True)]
    predicted = np.array([_predicted_profile(found[0].mean(axis=0), wall, depth, *shares) for depth in depths])
    cell = HANN_TOLD * speed_of_light / (2.0 * (scene.band.stop - scene.band.start)) * cosine
    return Thickness(depths, found, errors, predicted, cell)


def draw_thickness(found: Thickness) -> Figure:
    """Draw the profiles of all walls, with their spread over the seeds."""
    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    ax = figure.subplots()
    widths = found.widths().mean(axis=1)
    for i, depth in enumerate(found.depths):
        level = _db(found.profiles[i])
        colour = COLOURS[(0, 3, 1, 2)[i % 4]] if len(found.depths) > 2 else COLOURS[i]
        name = "face alone" if depth == 0.0 else f"down to {1e3 * depth:.0f} mm"
        ax.plot(1e3 * DEPTHS, level.mean(axis=0), color=colour, label=f"{name}: {1e3 * widths[i]:.1f} mm")
        ax.fill_between(1e3 * DEPTHS, level.min(axis=0), level.max(axis=0), color=colour, alpha=0.25, linewidth=0)
        if depth:
            ax.plot(1e3 * DEPTHS, _db(found.predicted[i]), color="black", linestyle="dashed", linewidth=0.9)
    ax.plot([], [], color="black", linestyle="dashed", linewidth=0.9, label="predicted")
    ax.axhline(-TOLD_DB, color="0.6", linewidth=0.8)
    ax.axvline(0.0, color="#CC0000", linewidth=0.8, label="true face")
    ax.set(xlabel="depth behind the true face [mm]", ylabel="mean power [dB], floor -30 dB", xlim=(-45, 65),
           ylim=(-30, 1.5))  # fmt: skip
    ax.legend(title=f"thickness at -{TOLD_DB:g} dB", fontsize=9, frameon=False)
    return figure


def _profile_of(scene: Scene3D, seed: int) -> list[float]:
    """Distance of the plane that is found in a scan of a wall behind the wall's face [m], and the mean profile."""
    sweep = mf.simulate(scene, snr_db=SNR_DB, bounces=0, seed=seed)
    wall, panel = walls_of(without_pictures(sweep))[0], scene.surface[0]
    error = float((panel.frame.shift - wall.center) @ wall.normal)
    face = replace(wall, center=wall.center + error * wall.normal)
    return [error, *(float(value) for value in wall_profile(mf.focus(sweep), face).values)]


def _predicted_profile(face: Array, wall: Panel, depth: float, of_face: float, inside: float) -> Array:
    """The profile of a wall that scatters down to a depth [m], predicted from that of its face alone.

    `of_face` and `inside` are the shares of the power that are scattered on the face and inside the wall.
    """
    if depth == 0.0:
        return face / face.max()
    shifts = scattering_depth(wall.volume_profile, depth, QUANTILES)
    moved = np.mean([np.interp(DEPTHS - shift, DEPTHS, face) for shift in shifts], axis=0)
    total = of_face * face + inside * moved
    return np.asarray(total / total.max())


def _steps(scene: Scene3D) -> Steps:
    """The azimuths of a scan on a grid."""
    azimuth = scene.scanner.azimuth
    assert azimuth is not None
    return azimuth


def _profile(power: Array) -> xr.DataArray:
    return xr.DataArray(power, dims="depth", coords={"depth": DEPTHS})


def _center(power: Array) -> float:
    """Mean depth [m] of a profile, weighted by its power, without samples more than `TOLD_DB` below the maximum."""
    weight = np.where(power > power_ratio_of(-TOLD_DB) * power.max(), power, 0.0)
    return float((weight * DEPTHS).sum() / weight.sum())


def _db(power: Array) -> Array:
    return np.asarray(10.0 * np.log10(np.maximum(power, 1e-6)))
