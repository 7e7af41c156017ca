"""Speed, error and growth of the full-wave solver: ``python benchmarks/fullwave.py [--long]``.

Times are CPU seconds of one core with one thread. The quick rows take about a minute; ``--long`` adds the full scene at
three frequencies against a refined solution, the growth of the time with the size of the scene, and as a peer the
factorisation of a dense matrix, which is timed at a size that fits into memory and scaled by its number of operations.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light
from scipy.linalg import lapack
from scipy.special import j0, y0

from mirrorfold.common.threads import one_thread
from mirrorfold.simulation.fullwave.kernel import hankel
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.solver import System, residual, scattered

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from fullwave_scenes import ANTENNAS, SHAPES, K, cylinder, distance, exact_field, nodes_of, scene_of, small_two_walls

TOLERANCE = 1e-3
FREQUENCIES = (290e9, 295e9, 300e9)
DENSE_SIZE = 6000
"""Unknowns of the dense matrix that is factorised."""

PEER_UNKNOWNS = 43_000
"""Unknowns of the dense matrix to which the time is scaled: those of the full scene."""


def cpu_seconds(work: Callable[[], Any], repeats: int = 1) -> tuple[float, Any]:
    """Least CPU time [s] of several runs, and the result of the last run."""
    times, result = [], None
    for _ in range(repeats):
        start = time.process_time()
        result = work()
        times.append(time.process_time() - start)
    return min(times), result


def wavenumber(frequency: float) -> float:
    """Wavenumber [1/m] of a frequency [Hz]."""
    return 2.0 * np.pi * frequency / speed_of_light


def peak_gigabytes() -> float:
    """Largest memory of this process so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def kernel_rows(table: Table) -> None:
    """Add rows for the speed and the error of the Hankel function, the kernel of the integral equation."""
    rng = np.random.default_rng(0)
    targets, sources = rng.random((1000, 2)), rng.random((3000, 2))
    hankel(targets, sources, K)
    seconds, values = cpu_seconds(lambda: hankel(targets, sources, K), repeats=20)
    x = K * np.linalg.norm(targets[:, None] - sources, axis=2)
    peer_seconds, exact = cpu_seconds(lambda: j0(x) - 1j * y0(x))
    x = np.concatenate([np.geomspace(1e-6, 1.0, 2000), np.linspace(1.0, 50.0, 50_001), np.geomspace(50.0, 1e5, 20_000)])
    line = hankel(np.zeros((1, 2)), np.stack([x, 0 * x], axis=1), 1.0)[0]
    error = np.max(np.abs(line - (j0(x) - 1j * y0(x))) / np.abs(j0(x) - 1j * y0(x)))
    table.add_row("Hankel kernel", f"{values.size / seconds / 1e6:.0f} M values/s", ">= 250 M values/s")
    table.add_row("  largest relative error", f"{error:.1e}", "<= 1e-6")
    table.add_row("  over SciPy", f"{peer_seconds / seconds:.0f} times; it is within {distance(values, exact):.0e}", "")


def validation_rows(table: Table) -> None:
    """Add rows for the error against the series of a cylinder, and against refined solutions."""
    circle = scene_of({"kind": "circle", "center": [0.0, 0.02], "radius": 3e-3})
    series = cylinder(3e-3, np.array([0.0, 0.02]), ANTENNAS, ANTENNAS)
    error = distance(exact_field(nodes_of(circle, 12), ANTENNAS, ANTENNAS, K), series)
    table.add_row("cylinder series, 12 nodes/wavelength", f"{error:.1e}", "<= 1e-4")
    for name in ("strip", "right angle", "sharp angle"):
        scene = scene_of(SHAPES[name])
        fine, coarse = (exact_field(nodes_of(scene, density), ANTENNAS, ANTENNAS, K) for density in (64, 12))
        table.add_row(f"{name}, 12 nodes/wavelength, refined", f"{distance(coarse, fine):.1e}", "<= 1e-3")


def small_scene_rows(table: Table) -> None:
    """Add rows for the scene at an eighth of its size, against the dense solution."""
    system = prepare(small_two_walls(0.125, elements=21), tolerance=TOLERANCE)
    k = wavenumber(290e9)
    scattered(system, k)
    seconds, s = cpu_seconds(lambda: scattered(system, k), repeats=3)
    dense_seconds, reference = cpu_seconds(lambda: scattered(replace(system, roots=()), k))
    name = f"scene at 1/8, {system.nodes.size} unknowns"
    table.add_row(f"{name}: skeletons", f"{skeletons(system)}", "")
    table.add_row("  S against the dense solution", f"{distance(s, reference):.1e}", f"<= {TOLERANCE:g}")
    table.add_row("  reciprocity", f"{distance(s.T, s):.1e}", "<= 1e-4")
    table.add_row("  residual of the whole system", f"{residual(system, k, seed=0):.1e}", f"<= {TOLERANCE:g}")
    table.add_row("  time, dense time over it", f"{seconds:.3f} s, {dense_seconds / seconds:.0f} times", "")


def skeletons(system: System) -> int:
    """Number of unknowns that are left after compression."""
    return sum(len(root.skeleton) for root in system.roots)


def full_scene_rows(table: Table) -> float:
    """Add rows for the scene at full size; returns the CPU time of its slowest frequency [s]."""
    before = peak_gigabytes()
    setup, system = cpu_seconds(lambda: prepare(small_two_walls(1.0, elements=161), tolerance=TOLERANCE))
    table.add_row(
        f"full scene, {system.nodes.size} unknowns, {skeletons(system)} skeletons: set-up", f"{setup:.1f} s", "<= 15 s"
    )
    sweeps = [cpu_seconds(partial(scattered, system, wavenumber(f)), repeats=2) for f in FREQUENCIES]
    seconds = max(time for time, _ in sweeps)
    peak = peak_gigabytes()
    table.add_row("  CPU time per frequency, slowest of three", f"{seconds:.2f} s", "<= 4.5 s")
    table.add_row("  401 frequencies on two cores", f"{(401 * seconds / 2 + setup) / 60:.1f} min", "<= 20 min")
    table.add_row("  peak memory of the process (at its start)", f"{peak:.2f} GB ({before:.2f})", "<= 1 GB")
    for frequency, (_, s) in zip(FREQUENCIES, sweeps, strict=True):
        table.add_row(f"  reciprocity at {frequency / 1e9:.0f} GHz", f"{distance(s.T, s):.1e}", "<= 1e-4")
    refined = prepare(small_two_walls(1.0, elements=161), tolerance=TOLERANCE / 10)
    for frequency, (_, s) in zip(FREQUENCIES, sweeps, strict=True):
        error = distance(s, scattered(refined, wavenumber(frequency)))
        table.add_row(
            f"  S at {frequency / 1e9:.0f} GHz against {refined.nodes.size} unknowns, tolerance 1e-4",
            f"{error:.1e}",
            "<= 2e-3",
        )
    return seconds


def dense_row(table: Table, seconds: float) -> None:
    """Add a row for the time of a dense factorisation over the time [s] of the solver for one frequency."""
    rng = np.random.default_rng(0)
    square = rng.standard_normal((2, DENSE_SIZE, DENSE_SIZE), dtype=np.float32)
    matrix = np.asfortranarray(square[0] + 1j * square[1])
    dense, _ = cpu_seconds(lambda: lapack.cgetrf(matrix, overwrite_a=1))
    whole = dense * (PEER_UNKNOWNS / DENSE_SIZE) ** 3
    table.add_row(
        f"dense LU of {PEER_UNKNOWNS} unknowns over that, from {dense:.1f} s for {DENSE_SIZE}",
        f"{whole:.0f} s, {whole / seconds:.0f} times",
        ">= 200 times",
    )


def growth_rows(table: Table) -> None:
    """Add rows for the time of one frequency at several sizes of the scene."""
    scales, times = (0.25, 0.5, 1.0, 2.0), []
    for scale in scales:
        system = prepare(small_two_walls(scale, elements=161), tolerance=TOLERANCE)
        k = wavenumber(FREQUENCIES[1])
        seconds, _ = cpu_seconds(partial(scattered, system, k))
        times.append(seconds)
        label = f"scene at {scale:g}: {system.nodes.size} unknowns, {skeletons(system)} skeletons"
        table.add_row(label, f"{seconds:.2f} s, {peak_gigabytes():.2f} GB so far", "")
    exponent = np.polyfit(np.log(scales), np.log(times), 1)[0]
    last = np.log2(times[-1] / times[-2])
    table.add_row("growth of the time with the size", f"power {exponent:.1f}, {last:.1f} at the end", "printed")


def slab_rows(table: Table, scale: float) -> None:
    """Add rows for the time per unknown of dielectric walls, against conductors of about as many unknowns."""
    conductors = small_two_walls(scale, elements=161)
    walls = small_two_walls(0.32 * scale, elements=161)
    made = {"material": "plasterboard", "thickness": 4e-3, "roughness": None}
    walls = replace(walls, surface=tuple(replace(wall, **made) for wall in walls.surface[:2]))
    k, per_unknown = wavenumber(FREQUENCIES[1]), []
    for name, scene in (
        ("conductors", conductors),
        ("slabs of 4 mm, TE", walls),
        ("slabs of 4 mm, TM", replace(walls, polarization="TM")),
    ):
        system = prepare(scene, tolerance=TOLERANCE)
        seconds, _ = cpu_seconds(partial(scattered, system, k))
        per_unknown.append(seconds / system.equation.size)
        label = f"{name}: {system.equation.size} unknowns, {skeletons(system)} skeletons"
        ratio = f", {per_unknown[-1] / per_unknown[0]:.2f} times conductors'" if len(per_unknown) > 1 else ""
        table.add_row(label, f"{1e6 * per_unknown[-1]:.0f} us per unknown{ratio}", "<= 2.5 times" if ratio else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--long", action="store_true", help="the full scene too, some minutes")
    long = parser.parse_args().long
    table = Table(title=f"full-wave solver, one core of {os.cpu_count()}, load {os.getloadavg()[0]:.1f} at the start")
    for column in ("what", "measured", "target"):
        table.add_column(column, justify="left")
    with one_thread():
        kernel_rows(table)
        validation_rows(table)
        small_scene_rows(table)
        if long:
            seconds = full_scene_rows(table)
            dense_row(table, seconds)
            growth_rows(table)
            slab_rows(table, 1.0)
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
