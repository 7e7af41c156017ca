"""Predicted against measured time of focusing on random geometries: ``python benchmarks/cost_model.py [--count 60]``.

The speed of the machine drifts, so it is measured before and after each geometry. Processor times are compared, the
median of three, so that other programs disturb little.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light

from mirrorfold.focusing.choosing import choice
from mirrorfold.focusing.choosing.caching import PlanCache
from mirrorfold.focusing.choosing.choice import Option, options
from mirrorfold.focusing.choosing.proven import prove
from mirrorfold.focusing.exact.accuracy import measured_error, white_noise
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.fast import factorized
from mirrorfold.focusing.predicting import cost, machine
from mirrorfold.focusing.problem import Problem

WITHIN = 0.4
"""Largest difference of prediction and measurement that counts as good, as a share of the larger of the two."""

KINDS = ("coincident", "displaced", "aside", "tilted", "unequal", "arc", "moving, few fixed", "plane", "volume")

REPEATS = 3
"""Each time is the median of this many runs."""

LONGEST = 4.0
"""Random geometries for which a longer time of one core is predicted are left out [s]."""


def line(count: int, pitch: float) -> np.ndarray:
    """A line of elements along x, (count, 3) [m]."""
    position = np.zeros((count, 3))
    position[:, 0] = pitch * (np.arange(count) - 0.5 * (count - 1))
    return position


def turned(position: np.ndarray, angle: float) -> np.ndarray:
    """Positions (n, 3) [m], turned by an angle [rad] about the z axis."""
    c, s = np.cos(angle), np.sin(angle)
    return position @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def random_problem(rng: np.random.Generator) -> tuple[str, Problem, float]:
    """A random geometry as in laboratories: its kind, the focusing problem, and a tolerance."""
    start = rng.uniform(60e9, 300e9)
    wavelength = speed_of_light / start
    frequency = start * np.linspace(1.0, rng.uniform(1.01, 1.1), int(rng.integers(50, 400)))
    tx = line(int(rng.integers(16, 90)), rng.uniform(0.3, 0.8) * wavelength)
    monostatic, z = False, np.zeros(1)
    kind = str(rng.choice(KINDS))
    rx = tx
    if kind == "displaced":
        rx = tx + rng.uniform(-20.0, 20.0, 3) * wavelength
    elif kind == "aside":
        rx = tx + np.array([rng.uniform(0.5, 3.0) * np.ptp(tx[:, 0]), 0.0, 0.0])
    elif kind == "tilted":
        rx = turned(tx, rng.uniform(-0.2, 0.2)) + np.array([0.0, rng.uniform(-5.0, 5.0) * wavelength, 0.0])
    elif kind == "unequal":
        rx = line(int(rng.integers(10, 60)), rng.uniform(0.3, 1.2) * wavelength)
    elif kind == "arc":
        bend = rng.uniform(2.0, 8.0) * np.ptp(tx[:, 0])
        tx = np.stack([bend * np.sin(tx[:, 0] / bend), bend * (np.cos(tx[:, 0] / bend) - 1.0), 0.0 * tx[:, 0]], axis=1)
        rx = tx
    elif kind == "moving, few fixed":
        tx = line(int(rng.integers(100, 400)), 0.5 * wavelength)
        rx = rng.uniform(-0.3, 0.3, (int(rng.integers(1, 5)), 3)) * np.array([1.0, 0.3, 0.3])
    elif kind in ("plane", "volume"):
        side = wavelength * rng.uniform(0.4, 0.8) * (np.arange(int(rng.integers(8, 26))) - 8)
        tx = np.stack([a.ravel() for a in np.meshgrid(side, [0.0], side, indexing="ij")], axis=1)
        monostatic = kind == "volume"
        rx = tx if monostatic else line(int(rng.integers(16, 40)), 0.5 * wavelength)
    length = max(np.ptp(tx[:, 0]), np.ptp(rx[:, 0]))
    near, depth = rng.uniform(1.5, 5.0) * length, rng.uniform(3.0, 15.0) * length
    pixels = 10 ** rng.uniform(4.7, 6.0)
    shape = rng.uniform(0.5, 2.0)
    if kind == "volume":
        z = np.linspace(-0.5, 0.5, 24) * length
        pixels /= z.size
    x = np.linspace(-1.0, 1.0, int(np.sqrt(pixels * shape))) * rng.uniform(1.0, 5.0) * length
    y = near + np.linspace(0.0, depth, int(np.sqrt(pixels / shape)))
    problem = Problem.usual(frequency, tx, rx, x, y, z, monostatic=monostatic)
    return kind, problem, float(10.0 ** rng.uniform(-4.0, -2.7))


def processor_seconds(work) -> tuple[float, object]:  # type: ignore[no-untyped-def]
    """Processor time of a call [s], and its result."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def measured(problem: Problem, option: Option, s: np.ndarray) -> tuple[float, float]:
    """Processor time [s] of an algorithm, including its plan, and the relative error of its image."""

    def once() -> tuple[float, object]:
        if option.fast is None:
            return processor_seconds(lambda: focus_exact(problem, s, choice.EXACT_SHARE * option.tolerance))
        anew = choice.lay_out(option.fast, problem, option.tolerance)  # a layout keeps the tables that were made by it
        return processor_seconds(lambda: anew.make(problem)(s))

    tries = [once() for _ in range(REPEATS)]
    return float(np.median([seconds for seconds, _ in tries])), measured_error(problem, tries[0][1], s)


def _measure_machine() -> None:
    """Measure the speed of the machine, and have costs predicted for it."""
    now = machine.measure()
    for module in (cost, factorized):
        module.machine = lambda: now  # type: ignore[attr-defined]


def compare(count: int, seed: int = 0) -> list[dict[str, object]]:
    """Predicted and measured times of the algorithm that is chosen, for random geometries."""
    rng = np.random.default_rng(seed)
    rows: list[dict[str, object]] = []
    while len(rows) < count:
        _measure_machine()
        kind, problem, tolerance = random_problem(rng)
        found = options(problem, tolerance)
        if found[0].cost.processor_seconds() > LONGEST:
            continue
        s = white_noise(problem)
        if not rows:
            prove(problem, tolerance, s, PlanCache())  # compiles or loads the kernels
        seconds, error = measured(problem, found[0], s)
        _measure_machine()
        same = (option for option in options(problem, tolerance) if option.algorithm == found[0].algorithm)
        again = next(same, found[0])
        predicted = float(np.sqrt(found[0].cost.processor_seconds() * again.cost.processor_seconds()))
        rows.append(
            {
                "geometry": kind, "pairs": problem.pairs, "frequencies": problem.k.size, "pixels": problem.pixels,
                "tolerance": tolerance, "algorithm": found[0].algorithm, "predicted": predicted, "measured": seconds,
                "ratio": predicted / seconds, "exact": found[-1].cost.processor_seconds(), "error": error,
            }
        )  # fmt: skip
    return rows


def main() -> None:
    """Compare times for the random geometries, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rows = compare(given.count, given.seed)
    table = Table(title="processor time of plan and image [s]", title_justify="left", box=None)
    for heading in rows[0]:
        table.add_column(heading, justify="left" if heading in ("geometry", "algorithm") else "right")
    for row in rows:
        table.add_row(*(f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()))
    console = Console(width=150)
    console.print(table)
    ratio = np.array([row["ratio"] for row in rows])
    inside = (ratio > 1.0 - WITHIN) & (ratio < 1.0 / (1.0 - WITHIN))
    console.print(f"{inside.sum()} of {len(rows)} within {WITHIN:.0%}; median ratio {np.median(ratio):.2f}")


if __name__ == "__main__":
    main()
