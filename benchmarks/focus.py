"""Time and error of focusing, job by job: ``python benchmarks/focus.py [--quick]``.

Every time is the median of several runs, with the fastest beside it. Every error is the relative L2 error against the
float64 direct sum on random pixels. Ratios are of times from the same run. The peer's kernel is timed on a patch and
extrapolated to the whole image.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
import warnings
from pathlib import Path

import numpy as np
import xarray as xr
from peers import delay_and_sum_baseband, range_compressed
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light

from mirrorfold.focusing import FocusPlan, PlanCache, choose_algorithm, focus
from mirrorfold.focusing.checks import make_problem
from mirrorfold.focusing.exact.accuracy import measured_error, white_noise
from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import make_sweep

SCENE = Path(__file__).resolve().parents[2] / "shared" / "data" / "two_walls_fullwave.nc"
"""A full-wave sweep; without this file, a sweep of random points takes its place."""

PEER_SAMPLES = 512
"""Least number of samples of the peer's range-compressed traces."""


def line(elements: int, pitch: float) -> np.ndarray:
    """A line of elements along x, (elements, 3) [m]."""
    position = np.zeros((elements, 3))
    position[:, 0] = pitch * (np.arange(elements) - 0.5 * (elements - 1))
    return position


def scatterers(frequency: np.ndarray, tx: np.ndarray, seed: int = 0, count: int = 40) -> np.ndarray:
    """Samples (frequency, tx, rx) of random point scatterers 1 to 4.5 m ahead, for use without `SCENE`."""
    rng = np.random.default_rng(seed)
    r, u = rng.uniform(1.0, 4.5, count), rng.uniform(-0.7, 0.7, count)
    place = np.stack([r * u, r * np.sqrt(1 - u * u), np.zeros(count)], axis=1)
    path = np.linalg.norm(tx[:, None] - place[None], axis=2)
    k = 2 * np.pi * frequency / speed_of_light
    wave = np.exp(-1j * k[:, None, None] * path) * rng.standard_normal(count)
    return np.einsum("mip,mkp->mik", wave, np.exp(-1j * k[:, None, None] * path)).astype(np.complex64)


def timed(call, repeats: int) -> tuple[float, float]:
    """Median and least time [s] of several calls, after one call that compiles."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return float(np.median(times)), min(times)


def error_on(problem: Problem, image: np.ndarray, s: np.ndarray) -> float:
    """Relative L2 error of an image of the samples s on random pixels."""
    return measured_error(problem, np.ascontiguousarray(image).reshape(problem.shape), s, seed=7, pixels=90)


def peer(problem: Problem, s: np.ndarray, frequency: np.ndarray, side: int = 24) -> tuple[float, float]:
    """Time [s] of the peer's kernel, extrapolated from a patch to the whole image, and its error on the patch."""
    profile, carrier = range_compressed(s, problem.taper.real, frequency, max(PEER_SAMPLES, 2 * frequency.size))
    step = (frequency[-1] - frequency[0]) / (frequency.size - 1)
    patch = problem.on(
        problem.x[:: problem.x.size // side][:side], problem.y[:: problem.y.size // side][:side], problem.z
    )
    points = patch.points(np.arange(patch.pixels))
    delay = np.linalg.norm(points[:, None] - problem.tx[None], axis=2) / speed_of_light
    phase = np.exp(2j * np.pi * carrier * delay).astype(np.complex64)
    i, k = (index.ravel() for index in np.indices(s.shape[1:]))
    out = np.empty(patch.pixels, np.complex64)
    delay = delay.astype(np.float32)
    per_second = np.float32(profile.shape[1] * step)
    median, _ = timed(lambda: delay_and_sum_baseband(profile, i, k, delay, delay, phase, phase, per_second, out), 3)
    reference = direct_sum(problem, s, points)
    return median * problem.pixels / patch.pixels, float(np.linalg.norm(out - reference) / np.linalg.norm(reference))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few repeats, no planar job")
    quick = parser.parse_args().quick
    repeats = 5 if quick else 25
    console = Console(width=150)
    table = Table(title=f"focusing on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
    for column in ("job", "tolerance", "algorithm", "median", "fastest", "error: scene", "error: noise", "target"):
        table.add_column(column, justify="right" if column not in ("job", "algorithm", "target") else "left")
    warnings.simplefilter("ignore", UserWarning)
    tx = line(161, 0.5e-3)
    wide = np.linspace(290e9, 300e9, 201)
    jobs = [
        ("A 161x161x201 -> 600x800", wide, (600, 800), (1.0, 5.0), 2.0, 4e-4, "<= 45 ms, stretch 30, at 2e-4 / 1e-3"),
        ("A tight", wide, (600, 800), (1.0, 5.0), 2.0, 1e-5, "<= 70 ms at 1e-5"),
        ("B same -> 2000x2000", wide, (2000, 2000), (1.0, 5.0), 2.0, 1e-3, "<= 100 ms"),
        ("C 401, 270-300 GHz, 1-3 m", np.linspace(270e9, 300e9, 401), (600, 800), (1.0, 3.0), 1.0, 1e-3, "<= 75 ms"),
    ]
    notes = []
    for name, frequency, (rows, columns), (near, far), half, tolerance, target in jobs:
        grid = {"x": np.linspace(-half, half, columns), "y": np.linspace(near, far, rows)}
        if SCENE.exists() and frequency is wide:
            s = xr.open_dataset(SCENE, engine="h5netcdf")["s"].values[::2]
        else:
            s = scatterers(frequency, tx)
        sweep = make_sweep(s, frequency=frequency, tx_position=tx, rx_position=tx)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        plan = FocusPlan(sweep, **grid, tolerance=tolerance)
        _, problem = make_problem(sweep, FocusSettings(**grid, tolerance=tolerance))
        median, fastest = timed(lambda: plan.values(s), repeats)  # noqa: B023
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        noise = white_noise(problem, seed=3)
        errors = [f"{error_on(problem, plan.values(data), data):.1e}" for data in (s, noise)]
        table.add_row(
            name, f"{tolerance:g}", plan.algorithm, f"{1e3 * median:.1f} ms", f"{1e3 * fastest:.1f} ms", *errors, target
        )
        if name.startswith("A 161"):
            again = time.perf_counter()
            FocusPlan(sweep, **grid, tolerance=tolerance, plans=PlanCache())
            build = time.perf_counter() - again
            notes.append(
                f"A: plan build {build:.2f} s (target 1 s), tables {plan.nbytes / 2**20:.0f} MiB, "
                f"peak memory above the input {after - before:.0f} MiB (target 400)"
            )
            patch = problem.on(problem.x[::8], problem.y[::6], problem.z)
            exact, _ = timed(lambda: focus_exact(patch, s, 1e-3), 3)  # noqa: B023
            rate = patch.pairs * patch.pixels / exact / 1e6
            whole = exact * problem.pixels / patch.pixels
            image = focus_exact(patch, s, 1e-3)
            exact_error = f"{error_on(patch, image, s):.1e}"
            table.add_row(
                "A by the exact kernel, from 100x100",
                "0.001",
                "exact",
                f"{whole:.1f} s",
                "",
                exact_error,
                "",
                f"{rate:.0f} M pair-pixels/s (target 500)",
            )
            seconds, peer_error = peer(problem, s, wide)
            table.add_row(
                "A by a peer's kernel, from 24x24", "", "linear", f"{seconds:.0f} s", "", f"{peer_error:.1e}", "", ""
            )
            notes.append(
                f"A: {seconds / median:.0f} times the peer's kernel (target 3000), "
                f"{whole / median:.0f} times the exact kernel (target 350)"
            )
    if SCENE.exists():
        sweep = xr.open_dataset(SCENE, engine="h5netcdf").load()
        start = time.perf_counter()
        image = focus(sweep, tolerance=1e-4)
        first = time.perf_counter() - start
        start = time.perf_counter()
        focus(sweep, tolerance=1e-4)
        shape = "x".join(str(n) for n in image.shape)
        table.add_row(
            f"two walls, 401 -> {shape}, plan and proof included",
            "0.0001",
            image.attrs["algorithm"],
            f"{first:.2f} s",
            f"{time.perf_counter() - start:.2f} s",
            f"{image.attrs['error']:.1e}",
            "",
            "second: same geometry again",
        )
    geometries(table, notes)
    if not quick:
        planar(table)
    console.print(table)
    for note in notes:
        console.print(note)


def geometries(table: Table, notes: list[str]) -> None:
    """Add rows for geometries of laboratories: the time of plan, image and measurement of the error together."""
    fine = np.linspace(290e9, 300e9, 501)
    above = line(41, 0.5e-3) + np.array([0.0, 0.0, 0.015])
    behind = line(41, 0.5e-3) - np.array([0.0, 0.005, 0.0])
    bend = np.linspace(-0.1, 0.1, 81)
    robot = 0.4 * np.stack([np.sin(bend), np.cos(bend) - 1.0, 0.0 * bend], axis=1)
    probe, wide = line(64, 0.63e-3), {"x": np.linspace(-0.02, 0.02, 401), "y": np.linspace(1e-3, 0.059, 580)}
    sound = 1e6 + 8e6 / 271 * np.arange(271)
    jobs = [
        ("coincident lines 41x41x501", fine, line(41, 0.5e-3), line(41, 0.5e-3), {}, None, 1e-4, ""),
        ("displaced lines, 15 mm above", fine, line(41, 0.5e-3), above, {}, None, 1e-4, "<= 3 s"),
        ("displaced lines, 5 mm behind", fine, line(41, 0.5e-3), behind, {}, None, 1e-4, "<= 3 s"),
        ("near and wide, 64x64x271, ultrasound", sound, probe, probe, wide, 6300.0, 1e-4, "<= 2.5 s"),
        ("arc of a robot, 81x81x201", fine[::2][:201], robot, robot, {}, None, 1e-4, ""),
    ]
    for name, frequency, tx, rx, grid, speed, tolerance, target in jobs:
        geometry = make_sweep(
            np.ones((frequency.size, len(tx), len(rx)), np.complex64),
            frequency=frequency,
            tx_position=tx,
            rx_position=rx,
        )
        _, problem = make_problem(geometry, FocusSettings(**grid, tolerance=tolerance, wave_speed=speed))
        sweep = geometry.assign(s=geometry["s"].copy(data=white_noise(problem)))
        chosen = choose_algorithm(geometry, **grid, tolerance=tolerance, wave_speed=speed)
        before, start = time.process_time(), time.perf_counter()
        image = focus(sweep, **grid, tolerance=tolerance, wave_speed=speed, plans=PlanCache())
        wall, processor = time.perf_counter() - start, time.process_time() - before
        rows = "x".join(str(n) for n in image.shape)
        error = f"{error_on(problem, image.values, sweep['s'].values):.1e}"
        label = f"{name} -> {rows}"
        seconds = f"{wall:.2f} s"
        table.add_row(label, f"{tolerance:g}", image.attrs["algorithm"], seconds, "", "", error, target)
        notes.append(
            f"{name}: processor time {processor:.2f} s, predicted {chosen.focusing_s:.2f} s on idle cores, "
            f"the exact kernel {chosen.options[-1].total_s:.2f} s"
        )


def planar(table: Table) -> None:
    """Add rows for 101 x 101 monostatic positions, 201 frequencies and 200 x 200 x 100 voxels, far and near."""
    frequency = np.linspace(290e9, 300e9, 201)
    u = 0.5e-3 * (np.arange(101) - 50)
    place = np.stack([a.ravel() for a in np.meshgrid(u, [0.0], u, indexing="ij")], axis=1)
    geometry = xr.Dataset(coords={"frequency": frequency, "antenna_position": (("position", "axis"), place)})
    for near, far, half in ((0.8, 1.2, 0.2), (0.3, 0.5, 0.1)):
        across, along = np.linspace(-half, half, 200), np.linspace(near, far, 100)
        _, problem = make_problem(geometry, FocusSettings(x=across, y=along, z=across, tolerance=1e-3))
        s = white_noise(problem)
        plan = FocusPlan(geometry, x=across, y=along, z=across, tolerance=1e-3)
        median, fastest = timed(lambda: plan.values(s), 3)  # noqa: B023
        table.add_row(
            f"planar 101x101x201 -> 200x200x100, {near}-{far} m, built in {plan.build_time:.1f} s",
            "0.001",
            plan.algorithm,
            f"{median:.2f} s",
            f"{fastest:.2f} s",
            "",
            f"{error_on(problem, plan.values(s), s):.1e}",
            "<= 2 s",
        )


if __name__ == "__main__":
    main()
