"""The synthetic-aperture experiment: two displaced apertures, elements with errors, a sphere to calibrate them.

    python benchmarks/synthetic_aperture.py [--seeds 3] [--out DIR]

Every antenna position of the shipped scene gets a delay of its own of up to 2 mm, as phase centres and cables have. The
delays are estimated from a steel sphere before the array, at 20 dB SNR per sample. Then the scene is imaged and folded
from three sweeps: as measured, as calibrated, and as an ideal instrument would have measured.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import Scene, load_scene
from mirrorfold.scenes.surfaces import Circle

LARGEST_DELAY = 2e-3
"""Largest delay of a position, as a length [m]."""

SNR_DB = 20.0
SPHERE, RADIUS = (0.03, 0.9), 0.02
"""Place and radius of the sphere [m]."""

CABLE = 1.7
"""Length of the cables in all paths, which the calibration has to remove as well [m]."""


def scene() -> Scene:
    """The shipped scene."""
    found = load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", "synthetic_aperture.toml"))))
    assert isinstance(found, Scene)
    return found


def sphere_alone(truth: Scene) -> Scene:
    """The scene of a steel sphere alone, before the same array."""
    return replace(truth, name="sphere", surface=(Circle(name="sphere", center=SPHERE, radius=RADIUS),))


def with_errors(sweep: xr.Dataset, tx_delay: np.ndarray, rx_delay: np.ndarray, cable: float = 0.0) -> xr.Dataset:
    """The sweep as an instrument measures it whose elements have delays of their own [m], through a cable [m]."""
    k = 2 * np.pi * sweep["frequency"].values / speed_of_light
    turn = np.exp(-1j * k[:, None, None] * (tx_delay[:, None] + rx_delay + cable))
    return sweep.assign(s=sweep["s"].copy(data=(sweep["s"].values * turn).astype(np.complex64)))


def calibrated(sweep: xr.Dataset, sphere: xr.Dataset, cable: float) -> tuple[xr.Dataset, Any]:
    """Calibrate as a laboratory does: remove the nominal cable, then the delays that are estimated from the sphere."""
    sphere = mf.calibrate.remove_cable(sphere, cable)
    elements = mf.calibrate.estimate_elements(sphere, at=SPHERE, radius=RADIUS)
    return mf.calibrate.apply_elements(mf.calibrate.remove_cable(sweep, cable), elements), elements


def experiment(seed: int, out: Path | None = None) -> list[dict[str, Any]]:
    """The scores of one draw of delays, for the measured, the calibrated and the ideal sweep."""
    random = np.random.default_rng(seed)
    truth = scene()
    ideal = mf.simulate(truth, seed=seed, bounces=2)
    tx_delay, rx_delay = random.uniform(-LARGEST_DELAY, LARGEST_DELAY, (2, truth.array.elements))
    measured = mf.add_noise(with_errors(ideal, tx_delay, rx_delay, CABLE), snr_db=SNR_DB, seed=seed)
    sphere = mf.simulate(sphere_alone(truth), seed=seed)
    sphere = mf.add_noise(with_errors(sphere, tx_delay, rx_delay, CABLE), snr_db=SNR_DB, seed=seed + 1)
    repaired, elements = calibrated(measured, sphere, CABLE)
    share = 0.5 * (tx_delay.mean() - rx_delay.mean())
    errors = [elements.tx_delay - (tx_delay - share), elements.rx_delay - (rx_delay + share)]
    rows = []
    uncalibrated = mf.calibrate.remove_cable(measured, CABLE)
    for name, sweep in (("measured", uncalibrated), ("calibrated", repaired), ("ideal", ideal)):
        started = time.perf_counter()
        reconstruction = mf.reconstruct(sweep)
        found = mf.score(reconstruction, truth)
        rows.append({"sweep": name, "score": found, "seconds": time.perf_counter() - started})
        if out is not None:
            mf.plot.before_after(reconstruction, truth).savefig(out / f"{name}.png")
    rows[1]["worst_um"] = 1e6 * max(float(np.abs(error).max()) for error in errors)
    return rows


def main() -> None:
    """Run the draws that the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, help="directory for pictures of the first draw")
    options = parser.parse_args()
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
    table = Table(title="81 x 81 positions, delays of up to 2 mm, 20 dB SNR", title_justify="left")
    for heading in ("draw", "sweep", "worst delay [um]", "drywall angle [deg]", "drywall offset [mm]", "F at 2 cm",
                    "hidden F at 2 cm", "hidden accuracy [mm]"):  # fmt: skip
        table.add_column(heading, justify="right")
    for seed in range(options.seeds):
        for row in experiment(seed, options.out if seed == 0 else None):
            score, hidden = row["score"], row["score"]["hidden"]
            wall = next((mirror for mirror in score["mirrors"] if mirror["surface"] == "drywall"), None)
            table.add_row(
                str(seed),
                row["sweep"],
                f"{row['worst_um']:.2f}" if "worst_um" in row else "",
                f"{wall['angle_error_deg']:.3f}" if wall else "-",
                f"{wall['offset_error_mm']:.2f}" if wall else "-",
                f"{score['f_score_2cm'] or 0.0:.2f}",
                f"{hidden['f_score_2cm'] or 0.0:.2f}",
                f"{1e3 * hidden['accuracy_m']:.1f}" if hidden["accuracy_m"] is not None else "-",
            )
            print(f"draw {seed}, {row['sweep']}: {row['seconds']:.1f} s", file=sys.stderr)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
