"""How long the initial image and the folding take on this machine, compared with the plain sum over all pixels.

The plain sum adds all samples for every pixel, in float64. It is timed on a few pixels and extrapolated. The claims are
about the share of folding in the whole time, if the image is made by the plain sum, by a sum over pairs of antennas in
single precision, or by the fast algorithm that `mirrorfold.focus` chooses.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.common.records import Number
from mirrorfold.common.threads import cpu_count
from mirrorfold.focusing import FocusPlan, FocusSettings, PlanCache
from mirrorfold.focusing.checks import make_problem
from mirrorfold.focusing.exact.accuracy import measured_error
from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.walls import hidden_walls
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.arrays import Band, LinearArray

EXTENT = (-1.2, 2.2, 0.6, 3.0)
"""The part of the floor plan that is imaged, x0, x1, y0, y1 [m]: the walls, and the ghosts behind them."""

PIXELS = {True: ((150, 200), (300, 400)), False: ((300, 400), (600, 800), (1200, 1600), (2000, 2000))}
"""Rows and columns of the images, of a quick run and of a full one."""

QUICK_ARRAY = LinearArray(elements=81, pitch=0.5e-3)
QUICK_BAND = Band(start=290e9, stop=300e9, points=241)
"""The radar of a quick run: half the published array, and half its frequencies."""

SUM_PIXELS = 64
"""Number of random pixels on which the plain sum is timed; all pixels cost the same."""

PATCH = 64
"""The sum over pairs is timed on about this many rows and as many columns, evenly spaced over the whole image."""

SMALL_OVERHEAD = 0.1
"""Largest share of the whole time that counts as a small overhead."""

NAMES = {
    "plan_s": "plan, once for each geometry",
    "image_s": "image, each frame",
    "fold_s": "folding",
    "fold_published_s": "folding as published",
    "pairs_s": "sum over pairs, extrapolated",
    "sum_s": "plain sum, extrapolated",
}
"""The steps that are timed, and their names in tables and pictures."""


@dataclass(frozen=True)
class Timed:
    """Times of all steps for one size of image, and the error of the image.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns of the image.
    seconds : dict of str to list of float
        Times of all runs [s], by the names in `NAMES`.
    error : float
        Relative L2 error of the image against the float64 sum.
    algorithm : str
        The algorithm that `FocusPlan` has chosen.
    """

    shape: tuple[int, int]
    seconds: dict[str, list[float]]
    error: float
    algorithm: str

    def median(self, name: str) -> float:
        """Median time of a step over all runs [s]."""
        return float(np.median(self.seconds[name]))

    @property
    def label(self) -> str:
        """Rows and columns, such as ``600x800``."""
        return "x".join(map(str, self.shape))

    def share(self, imaging: str) -> float:
        """Share of folding in the time of folding and imaging; `imaging` is `image_s`, `pairs_s` or `sum_s`."""
        return self.median("fold_s") / (self.median("fold_s") + self.median(imaging))


def run(work: Work) -> Findings:
    """Time all steps for every size of image, several times each."""
    scene = work.size(hidden_walls(), replace(hidden_walls(), array=QUICK_ARRAY, band=QUICK_BAND))
    sweep = work.sweep(scene)
    sizes, repeats = PIXELS[work.quick], work.size(9, 1)
    timed = []
    for number, shape in enumerate(sizes, 1):
        found = work.kept(lambda: _time(sweep, shape, repeats))  # noqa: B023
        timed.append(Timed(shape, found["seconds"], found["error"], found["algorithm"]))
        work.step(number, len(sizes))
    numbers: dict[str, Number] = {"cores": cpu_count()}
    for one in timed:
        numbers |= {f"pixels_{one.label}_{name}": one.median(name) for name in NAMES}
        numbers |= {
            f"pixels_{one.label}_image_error": one.error,
            f"pixels_{one.label}_folding_share": one.share("image_s"),
            f"pixels_{one.label}_folding_share_of_pairs": one.share("pairs_s"),
            f"pixels_{one.label}_folding_share_of_plain": one.share("sum_s"),
            f"pixels_{one.label}_gain": one.median("sum_s") / one.median("image_s"),
        }
    samples = "x".join(str(n) for n in (sweep.sizes["tx"], sweep.sizes["rx"], sweep.sizes["frequency"]))
    largest = timed[-1]
    return Findings(
        claims=_claims(timed),
        numbers=numbers,
        figures={"runtime": (_figure(timed), f"Medians and ranges of {repeats} runs, {samples} samples, {cpu_count()} "
                             "cores. The plain sum is extrapolated from a few pixels.")},
        data=_data(timed),
        tables=(_table(timed, samples),),
        text=(
            "The plain sum adds, for every pixel, all pairs of antennas at all frequencies, in float64: its time grows "
            "with the number of pixels and is the same for every one of them. The structure of a line array makes the "
            f"image {_rounded(largest.median('sum_s') / largest.median('image_s'))} times as fast at {largest.label} "
            "pixels, at an error far below what any threshold sees; the tables that this takes are made once for a "
            "geometry. Between the two is a careful sum over all pairs in single precision, which goes to range by one "
            "Fourier transform first; it serves arrays without structure.",
            "Folding looks at the echoes and not at the pixels, so that its time hardly grows with the image. Beside a "
            "plain sum it is next to nothing. Beside a fast image it is most of the time: finding mirrors, ordering "
            "them, testing every echo with the sweep, and drawing the result.",
            "The folding that was published looks at every pixel above a threshold, once, and tests nothing; it takes "
            f"{largest.median('fold_published_s'):.2g} s at {largest.label} pixels, where ours takes "
            f"{largest.median('fold_s'):.2g} s.",
        ),
        assumptions=(
            "The publication's own times are not repeated here: they belong to another machine and another program. "
            "What is judged is its statement that folding costs little beside imaging.",
            "Times are those of the wall clock, the median of several runs in turn; other work on the machine makes "
            "them longer, ratios less so. Reading files is not counted.",
            *(("In a quick run: 81 of 161 antennas, 241 of 401 frequencies, small images.",) if work.quick else ()),
        ),
    )  # fmt: skip


def _time(sweep: xr.Dataset, shape: tuple[int, int], repeats: int) -> dict[str, Any]:
    """Times of all steps for one size of image. The steps take turns, so that other work disturbs all of them alike."""
    rows, columns = shape
    grid: dict[str, Any] = {
        "x": np.linspace(*EXTENT[:2], columns),
        "y": np.linspace(*EXTENT[2:], rows),
        "tolerance": TOLERANCE_TO_FOLD,
    }
    _, problem = make_problem(sweep, FocusSettings(**grid))
    samples = np.ascontiguousarray(sweep["s"].values)
    places = problem.points(np.random.default_rng(0).integers(0, problem.pixels, SUM_PIXELS))
    plan = FocusPlan(sweep, **grid)
    image = plan(samples)

    row_step, column_step = (max(1, size // PATCH) for size in shape)
    patch = problem.on(problem.x[::column_step], problem.y[::row_step], problem.z)

    jobs: dict[str, Callable[[], object]] = {
        "plan_s": lambda: FocusPlan(sweep, plans=PlanCache(), **grid),
        "image_s": lambda: plan.values(samples),
        "fold_s": lambda: mf.fold(image, sweep=sweep),
        "fold_published_s": lambda: mf.fold(image, preset="published"),
        "pairs_s": lambda: focus_exact(patch, samples, TOLERANCE_TO_FOLD),
        "sum_s": lambda: direct_sum(problem, samples, places),
    }
    for name in NAMES.keys() - {"plan_s"}:  # kernels are compiled before they are timed
        jobs[name]()
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(repeats):
        for name, job in jobs.items():
            started = time.perf_counter()
            job()
            seconds[name].append(time.perf_counter() - started)
    for name, timed in (("pairs_s", patch.pixels), ("sum_s", SUM_PIXELS)):
        seconds[name] = [problem.pixels / timed * one for one in seconds[name]]
    error = measured_error(problem, plan.values(samples).reshape(problem.shape), samples)
    return {"seconds": seconds, "error": error, "algorithm": plan.algorithm}


def _figure(timed: list[Timed]) -> Figure:
    """Times over the number of pixels."""
    figure = Figure(figsize=(7.5, 4.6), dpi=150, layout="constrained")
    ax = cast("Any", figure.subplots())
    pixels = np.array([one.shape[0] * one.shape[1] for one in timed])
    for (name, label), marker in zip(NAMES.items(), "os^vPD", strict=True):
        runs = np.array([one.seconds[name] for one in timed])
        middle = np.median(runs, axis=1)
        spread = np.abs(np.stack([runs.min(axis=1), runs.max(axis=1)]) - middle)
        ax.errorbar(pixels, middle, yerr=spread, marker=marker, capsize=3, linewidth=1.3, label=label)
    ax.set(xscale="log", yscale="log", xlabel="pixels", ylabel="time [s]")
    ax.set_xticks(pixels, [one.label for one in timed], rotation=20)
    ax.minorticks_off()
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _data(timed: list[Timed]) -> xr.Dataset:
    """The times of every run of every step."""
    table = {
        name: (("size", "run"), np.array([one.seconds[name] for one in timed]), {"units": "s", "long_name": label})
        for name, label in NAMES.items()
    }
    pixels = [one.shape[0] * one.shape[1] for one in timed]
    error = ("size", [one.error for one in timed], {"units": "1", "long_name": "relative L2 error of the image"})
    return xr.Dataset(table | {"image_error": error}, {"pixels": ("size", pixels, {"units": "1"})})


def _table(timed: list[Timed], samples: str) -> Table:
    """A row of median times and shares for each size of image."""
    columns = ["pixels", *(f"{label} [s]" for label in NAMES.values())]
    columns += ["error of the image", "share of folding [%]", "beside the sum over pairs [%]", "and the plain sum [%]"]
    rows = [
        [one.label, *(f"{one.median(name):.3g}" for name in NAMES), f"{one.error:.1e} ({one.algorithm})",
         *(f"{100 * one.share(imaging):.2g}" for imaging in ("image_s", "pairs_s", "sum_s"))]
        for one in timed
    ]  # fmt: skip
    return Table(title=f"Times for {samples} samples on {cpu_count()} cores, medians", columns=columns, rows=rows)


def _claims(timed: list[Timed]) -> tuple[Claim, ...]:
    """Claims on the share of folding in the whole time."""
    fast, pairs, plain = (max(one.share(imaging) for one in timed) for imaging in ("image_s", "pairs_s", "sum_s"))
    gains = [one.median("sum_s") / one.median("image_s") for one in timed]
    errors = max(one.error for one in timed)
    why = f"Folding over folding and image together, the largest of all sizes; small is up to {SMALL_OVERHEAD:.0%}."
    return (
        Claim(
            claim="Folding is a small overhead on imaging by the plain sum.",
            source="The computing time",
            measured=f"up to {plain:.1%} of the time",
            verdict="agrees" if plain <= SMALL_OVERHEAD else "differs",
            why=why,
        ),
        Claim(
            claim="Is it still one beside a careful sum over all pairs, in single precision?",
            source="",
            measured=f"up to {pairs:.0%} of the time, {timed[-1].share('pairs_s'):.1%} at {timed[-1].label} pixels",
            verdict="new",
            why="The larger the image, the smaller the share: folding hardly depends on the number of pixels.",
        ),
        Claim(
            claim="Is it still one where the image is made fast?",
            source="",
            measured=f"up to {fast:.0%} of the time; the image is {_rounded(min(gains))} to {_rounded(max(gains))} "
            f"times as fast as the plain sum, with an error of up to {errors:.1e}",
            verdict="new",
            why="The image is so much cheaper that what was an overhead is most of what is left.",
        ),
    )


def _rounded(value: float) -> str:
    """A number, rounded to two significant digits, as text."""
    return f"{float(f'{value:.2g}'):.0f}"
