"""In the mirror or through it: echoes behind half-transparent walls, distinguished with one and two polarizations.

An echo behind a half-transparent wall is either the ghost of an object before it, which the wall reflected, or an
object behind it, whose wave passed through the wall. Reflection and passage change the amplitudes of TE and TM
differently, most of all near Brewster's angle. Random scenes are folded with one polarization and with both, at several
angles of incidence and SNRs, and each decision is compared with the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.benchmarking.methods import OWN
from mirrorfold.common.decibels import to_db
from mirrorfold.common.slabs import slab
from mirrorfold.common.types import Array
from mirrorfold.folding.confident import confident_points
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.scenes import random_scenes, shipped_plan
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.families import FAMILIES, draw, radars_of
from mirrorfold.scoring.transparent import behind
from mirrorfold.tree.half_transparent.doubts import doubtful

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

START, STOP = 116e9, 128e9
"""The band [Hz], for which a pane of glass is half transparent."""

GRID: dict[str, Any] = {"x": np.arange(-1.4, 1.8, 0.006), "y": np.arange(0.4, 2.9, 0.006)}
"""Pixels over everything that the scenes show, ghosts included [m]; steps of half a cell or less."""

FAMILY = "glass door"

SNR_DB = 20.0
"""Signal over noise of every sample of the sweep, unless another is stated [dB]."""

METHODS = {
    "published": "published",
    "opaque": "ours, walls opaque",
    "one": "ours, one polarization",
    "two": "ours, two polarizations",
}
"""The methods that are compared, and their names in tables and pictures."""

ANGLES = (20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
"""Edges of the classes of echoes by angle of incidence [degree]."""

FEWEST = 10
"""A class of incidence, or an SNR, is drawn only if it has at least this many echoes."""

ASKED = 0.95
"""Share of the echoes that two polarizations must decide rightly for the claim to agree."""

PERMITTIVITIES = (2.5, 6.5)
"""Least and largest permittivity of the walls of the family."""

COLOURS = {"opaque": "0.6", "one": "#56B4E9", "two": "#D55E00"}


def run(work: Work) -> Findings:
    """Fold random scenes with a half-transparent wall, with one polarization and with two, at several SNRs."""
    seeds: Sequence[int] = work.size(tuple(range(400, 412)), (1,))
    noises: Sequence[float] = work.size((20.0, 0.0, -20.0, -30.0, -40.0), (SNR_DB,))
    radar = radars_of(FAMILIES[FAMILY])[0]
    if work.quick:
        radar = replace(radar, array=radar.array | {"elements": 61}, band=radar.band | {"points": 241})
    total, rows = len(seeds) * len(noises) + 1, []
    for number, seed in enumerate(seeds):
        scene: Any = draw(FAMILY, seed, radar=radar)
        sweep = work.sweep(scene, solver="rays", seed=seed, bounces=2)
        for level, snr in enumerate(noises):
            methods = tuple(METHODS) if snr == SNR_DB else ("one", "two")
            noisy = partial(mf.add_noise, sweep, snr_db=snr, seed=seed)
            if work.quick:  # which shows a scene that is judged
                folded = _folded(noisy(), methods)
                rows += _judged(scene, *folded, seed, snr)
            else:
                rows += work.kept(lambda: _judged(scene, *_folded(noisy(), methods), seed, snr))  # noqa: B023
            work.step(number * len(noises) + level + 1, total)
    shown: Any = scene if work.quick else shipped_plan("glass-door")
    example = folded[1]["two"] if work.quick else work.reconstruction(shown, snr_db=SNR_DB)
    work.step(total, total)
    numbers = _numbers(rows, noises)
    return Findings(
        claims=_claims(numbers, len(seeds)),
        numbers=numbers,
        figures={
            "before-after": (mf.plot.before_after(example, shown), "Left the image, which holds both behind the "
                             "door: what it reflects and what stands behind it. Right: what it reflects is folded, "
                             "what passed stays, moved by what the pane delays and shifts."),
            "ratio": (_ratio_figure(rows), "Why two polarizations can tell: TM over TE of echoes that a wall "
                      "reflected, and of those that passed through it. Dots are echoes of the random scenes, bands "
                      "lossless walls of permittivities from 2.5 to 6.5, without the fringes between their faces."),
            "decided": (_decided_figure(rows, noises), "Share of the echoes behind the wall that are taken for what "
                        "they are: against the angle of incidence at an SNR of 20 dB, and against that SNR."),
            "places": (_places_figure(rows), "How far what passed stands from the truth: in the image, where the wall "
                       "delays and shifts it, and corrected by the wall that two polarizations have measured."),
        },
        data=_data(rows, noises),
        tables=(_table(numbers),),
        text=(
            "What a wall reflects there and back bears R^2, what passes through it T^2. TE and TM of R differ most "
            "near Brewster's angle and are the same at normal incidence. So steep walls are the hard ones, where the "
            "difference is small; and at an angle well above Brewster's, TM is reflected as strongly as TE again.",
            "An image of one polarization alone says nothing of it. What geometry can say is said as a guess: "
            "another mirror shows the same thing behind the wall, too. These scenes have few mirrors, and nearly all "
            "is taken for reflected, as if the wall were opaque.",
            "Where one wall is taken for opaque, what stands behind it is folded to where nothing is. That is what "
            "the rows of the table differ in.",
        ),
        assumptions=(
            "The publication proposes the second polarization and does not try it. The walls are panes and boards of 4 "
            "to 10 mm, drawn at random, with one or two hidden things before them and one or two behind.",
            f"The scenes are of the family '{FAMILY}' of mirrorfold benchmark, seeds {seeds[0]} to {seeds[-1]}, on "
            f"which {'the method' if work.quick else 'nothing'} was tuned, seen by "
            f"{radar.array['elements']} antennas and {radar.band['points']} frequencies. An echo counts where "
            "the image shows it within 6 cm of a thing or of its mirror image.",
        ),
    )  # fmt: skip


def _folded(sweep: xr.Dataset, methods: Sequence[str]) -> tuple[xr.DataArray, dict[str, xr.DataTree]]:
    """The images of a sweep, and their reconstructions by method."""
    images, found = mf.focus(sweep, tolerance=1e-3, **GRID), {}
    for method in methods:
        image, own = images, sweep
        if method == "one":
            image, own = image.sel(polarization="TE", drop=True), own.sel(polarization="TE", drop=True)
        found[method] = OWN[method if method in OWN else "ours"](image, own)
    return images, found


def _judged(
    scene: Scene, images: xr.DataArray, reconstructions: dict[str, xr.DataTree], seed: int, snr: float
) -> list[dict[str, Any]]:
    """Scores and decisions of every method on one scene at one SNR [dB]."""
    rows = []
    for method, found in reconstructions.items():
        score = mf.score(found, scene)
        decisions = behind(confident_points(found), scene)
        row: dict[str, Any] = {
            "seed": seed, "snr_db": snr, "method": method,
            "f_cells": float(score.f_score_cells or 0.0), "hidden_f_cells": float(score.hidden.f_score_cells or 0.0),
        }  # fmt: skip
        if decisions is not None:
            degrees = np.degrees(decisions.incidence)
            decisions = decisions.take((degrees >= ANGLES[0]) & (degrees < ANGLES[-1]))
            rightly_passed = decisions.truth & decisions.taken
            row |= {
                "right": (decisions.taken == decisions.truth).tolist(),
                "doubtful": doubtful(decisions.passed).tolist(),
                "truth": decisions.truth.tolist(),
                "incidence_deg": np.degrees(decisions.incidence).tolist(),
                "before_m": decisions.before[rightly_passed].tolist(),
                "after_m": decisions.after[rightly_passed].tolist(),
            }
            if method == "two":
                row["ratio_db"] = _ratios(images, decisions.initial).tolist()
        rows.append(row)
    return rows


def _ratios(images: xr.DataArray, places: Array) -> Array:
    """Ratio TM / TE [dB] of the two images at the places of echoes, (n, 2) [m]."""
    at = {axis: xr.DataArray(place, dims="point") for axis, place in zip("xy", places.T, strict=True)}
    level = {name: np.abs(images.sel(polarization=name).sel(at, method="nearest").values) for name in ("TE", "TM")}
    return np.asarray(to_db(level["TM"] / level["TE"]))


def _gathered(rows: Sequence[dict[str, Any]], name: str, method: str, snr: float = SNR_DB) -> Array:
    """The values of a column for all echoes of all scenes, by one method at one SNR [dB]."""
    found = [row.get(name, []) for row in rows if row["method"] == method and row["snr_db"] == snr]
    return np.concatenate([np.asarray(each, dtype=float) for each in found])


def _decided(rows: Sequence[dict[str, Any]], method: str, snr: float = SNR_DB) -> Array:
    """Whether each echo was decided rightly (1) or wrongly (0); doubtful echoes are left out."""
    return _gathered(rows, "right", method, snr)[_gathered(rows, "doubtful", method, snr) == 0.0]


def _mean(values: Array) -> float | None:
    """The mean; None without values."""
    return float(np.mean(values)) if values.size else None


def _numbers(rows: Sequence[dict[str, Any]], noises: Sequence[float]) -> dict[str, float | None]:
    """The numbers that the claims rest on."""
    numbers: dict[str, float | None] = {"echoes": float(_gathered(rows, "right", "two").size)}
    for method in METHODS:
        scores = [row for row in rows if row["method"] == method and row["snr_db"] == SNR_DB]
        numbers |= {
            f"right_{method}": _mean(_decided(rows, method)),
            f"f_cells_{method}": float(np.mean([row["f_cells"] for row in scores])),
            f"f_cells_least_{method}": float(np.min([row["f_cells"] for row in scores])),
            f"hidden_f_cells_{method}": float(np.mean([row["hidden_f_cells"] for row in scores])),
            f"hidden_f_cells_least_{method}": float(np.min([row["hidden_f_cells"] for row in scores])),
        }
    for method in ("one", "two"):
        numbers[f"doubtful_{method}"] = _mean(_gathered(rows, "doubtful", method))
        numbers |= {
            f"right_{method}_snr_{snr:.0f}_db".replace("-", "minus_"): _mean(_decided(rows, method, snr))
            for snr in noises
        }
    before, after = (_gathered(rows, name, "two") for name in ("before_m", "after_m"))
    numbers["passed_before_m"] = float(np.median(before)) if before.size else None
    numbers["passed_after_m"] = float(np.median(after)) if after.size else None
    by_angle = [share for _, share in _classes(rows, "two")]
    numbers["right_two_least_of_angles"] = min(by_angle) if by_angle else None
    return numbers


def _classes(rows: Sequence[dict[str, Any]], method: str) -> list[tuple[float, float]]:
    """Middle of each class of incidence [degree] with enough echoes, and the share that is decided rightly in it."""
    decided = _gathered(rows, "doubtful", method) == 0.0
    angle, right = (_gathered(rows, name, method)[decided] for name in ("incidence_deg", "right"))
    found = []
    for low, high in pairwise(ANGLES):
        within = (angle >= low) & (angle < high)
        if within.sum() >= FEWEST:
            found.append((0.5 * (low + high), float(right[within].mean())))
    return found


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{1e2 * share:.0f} %"


def _millimetres(length: float | None) -> str:
    return "none" if length is None else f"{1e3 * length:.1f} mm"


def _claims(numbers: dict[str, float | None], scenes: int) -> tuple[Claim, ...]:
    """Claims on two polarizations, on one, on the places of objects behind the wall, and on the F-scores."""
    two = numbers["right_two"] or 0.0
    return (
        Claim(
            claim="Two polarizations tell what a wall reflects from what passes through it.",
            source="The proposal of two polarizations",
            measured=f"{_percent(numbers['doubtful_two'])} of {numbers['echoes']:.0f} echoes behind the walls of "
            f"{random_scenes(scenes)} are left open, and {_percent(two)} of the others are decided rightly",
            verdict="agrees" if two >= ASKED else "differs",
            why=f"At an SNR of {SNR_DB:g} dB and incidence of 20 to 70 degrees, from the sweep alone. It agrees from "
            f"{_percent(ASKED)} on. Left open are probabilities from 0.1 to 0.9; of a wall that is not found, "
            "or not to be transparent, nothing is.",
        ),
        Claim(
            claim="And one?",
            source="",
            measured=f"{_percent(numbers['right_one'])} with what geometry guesses, "
            f"{_percent(numbers['right_opaque'])} if all is taken for reflected",
            verdict="new",
            why="Geometry decides only what is seen a second time, in another mirror.",
        ),
        Claim(
            claim="Where does that stand which passed?",
            source="",
            measured=f"{_millimetres(numbers['passed_after_m'])} from the truth in the median, "
            f"{_millimetres(numbers['passed_before_m'])} without correction",
            verdict="new",
            why="The distance from the nearest surface, of what was rightly taken for passed. Delay and shift follow "
            "from thickness and permittivity of the wall, measured by the same echoes.",
        ),
        Claim(
            claim="What is it good for?",
            source="",
            measured=f"F-score within 1.5 cells {numbers['f_cells_two']:.2f} with two polarizations, "
            f"{numbers['f_cells_one']:.2f} with one, {numbers['f_cells_opaque']:.2f} with opaque walls, "
            f"{numbers['f_cells_published']:.2f} as published",
            verdict="new",
            why="Mean over the same scenes, of all surfaces.",
        ),
    )


def _table(numbers: dict[str, float | None]) -> Table:
    """One row for each method."""
    rows = [
        [
            title,
            _percent(numbers[f"right_{name}"]),
            *(f"{numbers[f'{key}_{name}']:.2f} ({numbers[f'{key}_least_{name}']:.2f})"
              for key in ("f_cells", "hidden_f_cells")),
        ]
        for name, title in METHODS.items()
    ]  # fmt: skip
    columns = ["method", "echoes behind the wall decided rightly", "F, all", "F, hidden"]
    return Table(
        title="Mean over the scenes, the worst in brackets; F-scores within 1.5 cells", columns=columns, rows=rows
    )


def _data(rows: Sequence[dict[str, Any]], noises: Sequence[float]) -> xr.Dataset:
    """The data of the pictures: every echo at 20 dB, as decided with two polarizations, and the right shares by SNR."""
    shares = {
        f"right_{method}": ("snr", [np.nan if (mean := _mean(_decided(rows, method, snr))) is None else mean
                                    for snr in noises], {"units": "1"})
        for method in ("one", "two")
    }  # fmt: skip
    units = {"right": "1", "truth": "1", "incidence_deg": "degree", "ratio_db": "dB"}
    echoes = {name: ("echo", _gathered(rows, name, "two"), {"units": unit}) for name, unit in units.items()}
    places = {name: ("passed", _gathered(rows, name, "two"), {"units": "m"}) for name in ("before_m", "after_m")}
    attrs = {"simulator": "rays", "family": FAMILY, "start_hz": START, "stop_hz": STOP}
    return xr.Dataset(shares | echoes | places, {"snr": ("snr", list(noises), {"units": "dB"})}, attrs)


def _band_of(angle: Array, which: int) -> Array:
    """Ratio TM / TE [dB] after two reflections (`which` 0) or two passages (1) at angles (n,) [rad]: the least and the
    largest over the permittivities of the family, (2, n).

    The power is averaged over thicknesses that differ by up to a whole fringe.
    """
    wavenumber = np.pi * (START + STOP) / speed_of_light
    levels = []
    for eps in np.linspace(*PERMITTIVITIES, 9):
        thickness = np.linspace(0.0, np.pi / (wavenumber * np.sqrt(eps - 1.0)), 64)[1:, None] + 4e-3
        te, tm = (slab(eps, thickness, wavenumber, angle, name)[which] for name in ("TE", "TM"))
        levels.append(10.0 * np.log10(np.mean(np.abs(tm) ** 4, axis=0) / np.mean(np.abs(te) ** 4, axis=0)))
    return np.stack([np.min(levels, axis=0), np.max(levels, axis=0)])


def _ratio_figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Ratio TM / TE of every echo against the angle of incidence."""
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    degrees = np.linspace(15.0, 75.0, 121)
    angle, ratio, truth = (_gathered(rows, name, "two") for name in ("incidence_deg", "ratio_db", "truth"))
    for passed, colour, name in ((False, "#0072B2", "reflected"), (True, "#D55E00", "passed")):
        axes.fill_between(degrees, *_band_of(np.radians(degrees), int(passed)), color=colour, alpha=0.2, linewidth=0)
        own = truth == passed
        axes.plot(angle[own], ratio[own], ".", color=colour, markersize=3, label=name)
    axes.set(xlabel="angle of incidence [degree]", ylabel="TM over TE [dB]", xlim=(15.0, 75.0), ylim=(-60.0, 25.0))
    axes.legend(loc="lower left", fontsize=8)
    return figure


def _decided_figure(rows: Sequence[dict[str, Any]], noises: Sequence[float]) -> Figure:
    """Shares of right decisions by angle and by SNR."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for method, colour in COLOURS.items():
        classes = _classes(rows, method)
        if classes:
            left.plot(*np.transpose(classes), "o-", color=colour, label=METHODS[method], markersize=4)
    for method in ("one", "two"):
        decided = {snr: _decided(rows, method, snr) for snr in noises}
        shares = [(snr, each.mean()) for snr, each in decided.items() if each.size >= FEWEST]
        if shares:
            right.plot(*np.transpose(shares), "o-", color=COLOURS[method], markersize=4)
    for axes in (left, right):
        axes.axhline(ASKED, color="0.4", linewidth=0.6, linestyle=":")
    left.set(xlabel="angle of incidence [degree]", ylabel="share decided rightly", xlim=(20.0, 70.0), ylim=(0.0, 1.03))
    right.set(xlabel="SNR of a sample [dB]")
    left.legend(fontsize=8, loc="lower right")
    return figure


def _places_figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Share of the passed echoes within each distance of the truth, in the image and corrected."""
    figure = Figure(figsize=(6.4, 3.4), layout="constrained")
    axes = figure.subplots()
    for name, colour, label in (("before_m", "0.5", "in the image"), ("after_m", "#D55E00", "corrected")):
        distance = np.sort(_gathered(rows, name, "two"))
        axes.step(1e3 * distance, (np.arange(distance.size) + 1.0) / max(distance.size, 1), color=colour, label=label)
    axes.set(xlabel="distance from the truth [mm]", ylabel="share of what passed", xlim=(0.0, 40.0), ylim=(0.0, 1.0))
    axes.legend(fontsize=8)
    return figure
