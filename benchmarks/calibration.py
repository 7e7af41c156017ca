"""Estimate random delays of elements from the echo of a sphere, and print the largest errors.

    python benchmarks/calibration.py [--draws 40]

Each draw has another array, band, place and size of the sphere, at 20 dB SNR per sample, with delays of up to 2 mm on
every element. With multipath, four more echoes of up to half the sphere's strength arrive from elsewhere; with
outliers, a tenth of the transmitters measure only noise; with random phases, each element also has a constant phase.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.reflectors import sphere_paths

LARGEST_DELAY = 2e-3
"""Largest delay of an element, as a length [m]."""

SNR_DB = 20.0
TOLERANCE_UM = 20.0
"""The table counts the draws whose largest error is below this [um]."""

KINDS = ("sphere alone", "multipath", "outliers", "random phases")


def draw(kind: str, seed: int) -> tuple[float, float]:
    """Largest error of the delay of any good element [um], and the time that the estimate took [s]."""
    random = np.random.default_rng([seed, KINDS.index(kind)])
    n_tx, n_rx = random.integers(8, 82, 2)
    if kind == "random phases":  # only the envelope of the echo is of use, which takes more samples
        n_tx, n_rx = random.integers(61, 82, 2)
    start = random.uniform(60e9, 270e9)
    band = 30e9 if kind == "random phases" else float(random.choice([5e9, 10e9, 30e9]))
    frequency = np.linspace(
        start, start + band, 401 if kind == "random phases" else int(random.choice([101, 201, 401]))
    )
    pitch = random.uniform(0.4e-3, 1.0e-3)
    tx, rx = (np.outer(pitch * np.arange(n), [1.0, 0.0, 0.0]) for n in (n_tx, n_rx))
    tx[:, 0] -= 0.1
    rx += [0.05, random.uniform(-0.02, 0.02), 0.0]
    centre, radius = np.array([random.uniform(-0.4, 0.4), random.uniform(0.5, 2.0)]), random.choice([0.0, 0.01, 0.025])
    tx_delay, rx_delay = (random.uniform(-LARGEST_DELAY, LARGEST_DELAY, n) for n in (n_tx, n_rx))
    k = 2 * np.pi * frequency[:, None, None] / speed_of_light
    s = np.exp(-1j * k * sphere_paths(tx, rx, centre, radius) + 2j * np.pi * random.random())
    if kind == "multipath":
        for _ in range(4):
            away = centre + random.uniform([-0.5, 0.1], [0.5, 1.0])
            s += random.uniform(0.1, 0.5) * np.exp(-1j * k * sphere_paths(tx, rx, away))
    s *= np.exp(-1j * k * (tx_delay[:, None] + rx_delay))
    if kind == "random phases":
        s *= np.exp(2j * np.pi * (random.random(n_tx)[:, None] + random.random(n_rx)))
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx)
    sweep = mf.add_noise(sweep, snr_db=SNR_DB, seed=seed)
    good = np.ones(n_tx, dtype=bool)
    if kind == "outliers":
        good[random.choice(n_tx, max(1, n_tx // 10), replace=False)] = False
        sweep["s"].values[:, ~good] = random.standard_normal((frequency.size, int((~good).sum()), n_rx))
    started = time.perf_counter()
    found = mf.calibrate.estimate_elements(sweep, at=centre, radius=radius)
    seconds = time.perf_counter() - started
    # A delay that moves from all transmitters to all receivers changes no sample: it is no error.
    errors = [found.tx_delay[good] - tx_delay[good], found.rx_delay - rx_delay]
    share = 0.5 * (errors[0].mean() - errors[1].mean())
    return 1e6 * max(np.abs(errors[0] - share).max(), np.abs(errors[1] + share).max()), seconds


def main() -> None:
    """Run the draws that the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=40)
    options = parser.parse_args()
    table = Table(title=f"worst element of each draw, {options.draws} draws, {SNR_DB:g} dB SNR", title_justify="left")
    for heading in ("sweep", "median [um]", "largest [um]", f"within {TOLERANCE_UM:g} um", "median time [s]"):
        table.add_column(heading, justify="right")
    for kind in KINDS:
        errors, seconds = np.array([draw(kind, seed) for seed in range(options.draws)]).T
        within = f"{100 * np.mean(errors < TOLERANCE_UM):.0f} %"
        table.add_row(kind, f"{np.median(errors):.2f}", f"{errors.max():.2f}", within, f"{np.median(seconds):.2f}")
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
