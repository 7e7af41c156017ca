"""One to five bounces: how many of them folding can undo, and how many the link budget of `plan` promises."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.common.types import Array
from mirrorfold.describing.planning import Instrument, Plan
from mirrorfold.focusing.grid import default_grid
from mirrorfold.folding.confident import confident_points
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.reproducing.findings import Claim, Findings
from mirrorfold.reproducing.parts.bounces_pages import (
    accuracies,
    budget_table,
    case_key,
    found_by_bounces,
    found_by_snr,
    result_table,
    wide_picture,
)
from mirrorfold.reproducing.parts.frequency_pages import mean_error
from mirrorfold.reproducing.parts.zigzag import (
    ELEMENTS,
    EVERY,
    FIRST,
    LEG,
    PITCH,
    POINTS,
    START,
    STOP,
    alone,
    corridor,
    way,
)
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import surface_named

MOST = 5
"""Largest number of bounces that is tried."""

ROUGHNESS = (0.05e-3, 0.2e-3)
"""Rms height and correlation length of the walls [m], the published ones."""

NEAR = float(np.mean(FIRST))
"""Range at which the link budget is stated [m]: the mean range of the first wall."""

SECTION = 1e-3
"""Radar cross section of the target [m^2], as `plan` assumes it."""

DETECTION_DB = 13.0
"""Signal over noise in the image from which `plan` counts an object as visible [dB]."""

FOUND = 0.25
"""The target counts as found if at least this share of it is within 1.5 resolution cells of points."""

THRESHOLDS = (-18.0, -40.0)
"""Relative to the robust reference echo [dB]: the usual threshold of `mirrorfold.fold`, and a lower one."""

SIDE = 1.4
"""Half width of the image [m]: before folding, all ghosts of a corridor stand nearly straight ahead of the radar."""

Row = dict[str, Any]


def run(work: Work) -> Findings:
    """Fold the images of all corridors, and compare the results with the link budget of `plan`."""
    cases = _cases(work.quick)
    counts = (1, 3) if work.quick else tuple(range(1, MOST + 1))
    seeds = work.size(10, 1)
    rows: list[Row] = []
    plans = {(material, power): _plan(material, power) for material, powers in cases.items() for power in powers}
    total = len(cases) * len(counts) * seeds
    for number, ((material, powers), count, seed) in enumerate(product(cases.items(), counts, range(seeds))):
        near = {power: plans[material, power].link_budget[0].sample_snr_db or 0.0 for power in powers}
        rows += work.kept(partial(_judge, count, seed, material, near))
        work.step(number + 1, total)
    for row in rows:
        row["plan_snr_db"] = plans[row["material"], row["power_dbm"]].link_budget[row["bounces"]].snr_db
    deep = work.size(MOST, 2)
    example = corridor(deep, 0, "pec")
    reconstruction = _folded(work.sweep(example, bounces=deep), example, (THRESHOLDS[0],))[0]
    numbers = _numbers(rows, plans)
    return Findings(
        claims=_claims(numbers, rows),
        numbers=numbers,
        figures={
            "example": (
                wide_picture(reconstruction, example),
                f"A corridor of {deep} bounces without noise: all images stand one behind the other; folded, "
                "the target is where it is.",
            ),
            "found": (
                found_by_bounces(rows, plans),
                "How much of the target is found (mean and standard error over corridors), with the usual threshold "
                "and a lowered one. Dashed: the last bounce that `plan` promises.",
            ),
            "snr": (
                found_by_snr(rows, DETECTION_DB),
                "The same against the signal over noise that `plan` predicts for the target.",
            ),
            "accuracy": (
                accuracies(rows),
                "Distance of the target's points from it, and errors of the walls, by generation, at all powers.",
            ),
        },
        data=_data(rows),
        tables=(result_table(rows), budget_table(plans, counts)),
        text=_text(numbers),
        assumptions=(
            "Corridors: each wall turns the way by 80 to 100 degrees, to the right and to the left in turn; walls "
            "are 0.45 to 0.7 m long and 0.65 to 0.85 m apart, the target is an arc with a radius of 12 to 18 cm. "
            "Seeds are those of the table. No part of the target can be seen by fewer bounces.",
            "Rays in a plane, published band and array, every third place of which receives. Noise: the target "
            f"alone, in line of sight at {NEAR:g} m, has the signal over noise per sample that `plan` states there for "
            f"{1e4 * SECTION:.0f} cm^2. Since power falls with the square of the range in the plane and with its "
            "fourth power in space, noise is raised by the square of the way.",
            f"The target counts as found if {FOUND:.0%} of what can be seen of it lie within 1.5 resolution cells of "
            "points. Walls are of one material, their roughness is the published one.",
        ),
    )


def _cases(quick: bool) -> dict[str, tuple[float, ...]]:
    """Transmitted powers [dBm] to try, by the material of the walls."""
    if quick:
        return {"concrete": (0.0,)}
    return {"concrete": (-20.0, 0.0), "pec": (0.0,), "plasterboard": (0.0,)}


def _plan(material: str, power_dbm: float) -> Plan:
    """The link budget of `mirrorfold.plan` for corridors with walls of this material."""
    return mf.plan(
        band=(START, STOP),
        points=POINTS,
        aperture=(ELEMENTS - 1) * PITCH,
        pitch=PITCH,
        rx_pitch=EVERY * PITCH,
        range=NEAR,
        leg=float(np.mean(LEG)),
        materials=(material,),
        roughness=ROUGHNESS,
        target=SECTION,
        detection_db=DETECTION_DB,
        instrument=Instrument(power_dbm=power_dbm),
    )


def _folded(sweep: xr.Dataset, scene: Scene, thresholds: Sequence[float]) -> list[xr.DataTree]:
    """Reconstructions from a part of the default grid, one for each threshold [dB]."""
    x, y = default_grid(scene.band.frequency, scene.array.tx_position, scene.array.rx_position)
    plan = FoldPlan(mf.focus(sweep, x=x[np.abs(x) <= SIDE], y=y), sweep=sweep)
    return [plan.fold(threshold_db=threshold) for threshold in thresholds]


def _judge(bounces: int, seed: int, material: str, snr_db: dict[float, float]) -> list[Row]:
    """Simulate a corridor, add noise for each power, and score the folded target for each power and threshold.

    `snr_db` is the signal over noise of a sample for a target in line of sight at `NEAR` [dB], by power.
    """
    scene = corridor(bounces, seed, material)
    sweep = mf.simulate(scene, bounces=bounces, seed=seed)
    signal = float((np.abs(mf.simulate(alone(scene, NEAR), bounces=0, seed=seed)["s"].values) ** 2).mean())
    distance = way(scene, bounces)
    rows = []
    for power, at_near in snr_db.items():
        noise = signal * 10.0 ** (-0.1 * at_near) * (distance / NEAR) ** 2
        level = 10.0 * np.log10(float((np.abs(sweep["s"].values) ** 2).mean()) / noise)
        noisy = mf.sweep.add_noise(sweep, snr_db=float(level), seed=seed)
        facts = {"bounces": bounces, "seed": seed, "material": material, "power_dbm": power, "way_m": distance}
        for threshold, reconstruction in zip(THRESHOLDS, _folded(noisy, scene, THRESHOLDS), strict=True):
            rows.append({**facts, "threshold_db": threshold} | _scores(reconstruction, scene, bounces))
    return rows


def _scores(reconstruction: xr.DataTree, scene: Scene, bounces: int) -> Row:
    """Scores of the target, and errors of the walls in the order in which the path meets them."""
    score = mf.score(reconstruction, scene, bounces=bounces)
    target = score.surfaces["target"]
    points = confident_points(reconstruction)
    mine = points.isel(point=(points["bounces"].values == bounces) & (points["surface"].values == "object"))
    off = _distances(np.column_stack([mine["x"], mine["y"]]), scene)
    off = off[off < APART]
    walls: list[list[float | None]] = []
    for generation in range(1, bounces + 1):
        found = [
            one
            for one in score.mirrors
            if one.surface == f"wall {generation}" and one.generation == generation and one.angle_error_deg is not None
        ]
        best = min(found, key=lambda one: one.angle_error_deg or 0.0, default=None)
        walls.append([None, None] if best is None else [best.angle_error_deg, best.offset_error_mm])
    completeness = target.completeness_cells or 0.0
    return {
        "found": float(completeness >= FOUND),
        "completeness_cells": completeness,
        "completeness_5cm": target.completeness_5cm or 0.0,
        "mean_m": float(off.mean()) if off.size else None,
        "median_m": float(np.median(off)) if off.size else None,
        "precision_cells": score.hidden.precision_cells or 0.0,
        "walls": walls,
        "cell_m": target.cell_m,
    }


APART = 0.3
"""Points of the deepest generation count as echoes of the target up to this distance from it [m]; walls are farther."""


def _distances(points: Array, scene: Scene) -> Array:
    """Distances (n,) [m] of points (n, 2) [m] from the target."""
    truth = surface_named(scene, "target").sample(0.002)[0]
    return np.array([np.linalg.norm(truth - point, axis=1).min() for point in points])


def _numbers(rows: list[Row], plans: dict[tuple[str, float], Plan]) -> dict[str, float | None]:
    """Means and standard errors by case and bounces; how many bounces folding reaches, and how many `plan` promises."""
    numbers: dict[str, float | None] = {}
    for (material, power), threshold in product(plans, THRESHOLDS):
        case = case_key(material, power, threshold)
        plan, reached, broken = plans[material, power], 0, False
        for bounces in _counts(rows):
            wanted = (material, power, threshold, bounces)
            selected = [
                row
                for row in rows
                if (row["material"], row["power_dbm"], row["threshold_db"], row["bounces"]) == wanted
            ]
            for name in ("found", "completeness_cells", "completeness_5cm", "precision_cells", "median_m", "mean_m"):
                mean = mean_error([row[name] for row in selected])
                if mean is not None:
                    key = f"{case}_{bounces}_bounces_{name}"
                    numbers[key], numbers[f"{key}_error"] = mean
            broken |= (numbers[f"{case}_{bounces}_bounces_found"] or 0.0) < 0.5
            reached = reached if broken else bounces
            numbers[f"{case}_{bounces}_bounces_plan_snr_db"] = plan.link_budget[bounces].snr_db
        numbers[f"{case}_folding_reaches_bounces"] = float(reached)
        numbers[f"{case}_plan_promises_bounces"] = float(min(plan.bounces_above_noise or 0, max(_counts(rows))))
    for generation in range(1, max(_counts(rows)) + 1):
        for index, name in enumerate(("angle_deg", "offset_mm")):
            errors = [
                row["walls"][generation - 1][index] for row in rows if row["found"] and row["bounces"] >= generation
            ]
            known = [error for error in errors if error is not None]
            if known:
                numbers[f"generation_{generation}_median_{name}"] = float(np.median(known))
    for threshold in THRESHOLDS:
        selected = [row for row in rows if row["threshold_db"] == threshold]
        above = [row["found"] for row in selected if row["plan_snr_db"] >= DETECTION_DB]
        below = [row["found"] for row in selected if row["plan_snr_db"] < DETECTION_DB]
        for label, values in (("above", above), ("below", below)):
            share = mean_error(values)
            if share is not None:
                key = f"threshold_{-threshold:.0f}_db_found_{label}_13_db"
                numbers[key], numbers[f"{key}_error"] = share
        lost = [float(any(angle is None for angle, _ in row["walls"])) for row in selected if not row["found"]]
        if lost:
            numbers[f"threshold_{-threshold:.0f}_db_lost_for_want_of_a_wall"] = float(np.mean(lost))
        needed = _needed_snr(selected)
        if needed is not None:
            numbers[f"threshold_{-threshold:.0f}_db_snr_needed_db"] = needed
    return numbers


def _counts(rows: list[Row]) -> list[int]:
    return sorted({row["bounces"] for row in rows})


def _needed_snr(rows: list[Row]) -> float | None:
    """Level [dB] that best separates corridors whose target is found from the others: fewest are on the wrong side."""
    levels = sorted({row["plan_snr_db"] for row in rows})
    if all(row["found"] for row in rows) or not any(row["found"] for row in rows):
        return None
    edges = [0.5 * (a + b) for a, b in pairwise(levels)]
    wrong = [sum((row["plan_snr_db"] > edge) != bool(row["found"]) for row in rows) for edge in edges]
    return float(edges[int(np.argmin(wrong))])


def _claims(numbers: dict[str, float | None], rows: list[Row]) -> tuple[Claim, ...]:
    """Questions with our answers, because nothing is published on more than a few bounces."""
    reach = []
    for material, power in dict.fromkeys((row["material"], row["power_dbm"]) for row in rows):
        keys = [case_key(material, power, threshold) for threshold in THRESHOLDS]
        usual, lowered = (f"{numbers[f'{key}_folding_reaches_bounces']:.0f}" for key in keys)
        promised = f"{numbers[f'{keys[0]}_plan_promises_bounces']:.0f}"
        reach.append(f"{material} at {power:.0f} dBm: {usual}, lowered {lowered}, `plan` {promised}")
    most = max(_counts(rows))
    by_count = []
    for count in _counts(rows):
        off = [row["median_m"] for row in rows if row["found"] and row["bounces"] == count and row["median_m"]]
        if off:
            by_count.append(f"{count}: {1e3 * float(np.median(off)):.1f} mm")
    angles, offsets = (
        [
            f"{numbers[f'generation_{g}_median_{name}']:.{digits}f}"
            for g in range(1, most + 1)
            if f"generation_{g}_median_{name}" in numbers
        ]
        for name, digits in (("angle_deg", 2), ("offset_mm", 1))
    )
    needed = [numbers.get(f"threshold_{-threshold:.0f}_db_snr_needed_db") for threshold in THRESHOLDS]
    answers = ["not decided" if one is None else f"{one:.0f} dB" for one in needed]
    return (
        Claim(
            claim="By way of how many walls, of five at most, is a target found, and how many does `plan` promise?",
            source="",
            measured="; ".join(reach),
            verdict="new",
            why="The largest number of bounces up to which it is found in half of the corridors or more: with the "
            f"usual threshold of {THRESHOLDS[0]:g} dB, and with one lowered to {THRESHOLDS[1]:g} dB.",
        ),
        Claim(
            claim="How exact is a target after so many folds?",
            source="",
            measured=", ".join(by_count),
            verdict="new",
            why="By bounces: median over the corridors in which it is found of the points' median distance from it.",
        ),
        Claim(
            claim="Do errors of mirrors grow from generation to generation?",
            source="",
            measured=f"{', '.join(angles)} degrees; {', '.join(offsets)} mm",
            verdict="new",
            why="Median errors of angle and place of the first, second, ... wall, where the target is found.",
        ),
        Claim(
            claim="Which signal over noise, as `plan` predicts it, does a target need?",
            source="",
            measured=f"{answers[0]} with the usual threshold, {answers[1]} with the lowered one",
            verdict="new",
            why=f"The level with the fewest corridors on its wrong side; `plan` counts from {DETECTION_DB:g} dB on.",
        ),
    )


def _text(numbers: dict[str, float | None]) -> tuple[str, ...]:
    """What can be learnt."""
    usual, lowered = (
        numbers.get(f"threshold_{-threshold:.0f}_db_found_above_13_db") or 0.0 for threshold in THRESHOLDS
    )
    walls = numbers.get(f"threshold_{-THRESHOLDS[0]:.0f}_db_lost_for_want_of_a_wall") or 0.0
    return (
        "Folding itself loses little from bounce to bounce. A mirror seen in others is fitted less exactly than "
        "one in line of sight: it is farther away, and shorter seen from there. Its place drifts more than its angle, "
        "since errors of all mirrors before it add up; so does the target's. All stays far below a resolution cell.",
        "Loss ends it, earlier than the link budget says. The budget is that of the target alone. Yet every wall on "
        "the way must be found, too, by what it scatters: an oblique wall of concrete scatters 17 dB less than meets "
        "it, and what is seen in it sinks by twice its loss with each bounce. Of the targets that are not found, "
        f"{walls:.0%} miss a wall on their way.",
        f"Of the corridors whose target stands {DETECTION_DB:g} dB above the noise by `plan`, {usual:.0%} are folded "
        f"with the usual threshold of {THRESHOLDS[0]:g} dB, and {lowered:.0%} with one of {THRESHOLDS[1]:g} dB. `plan` "
        "knows of the target's noise alone: its number of bounces is an upper bound.",
        "A lower threshold is not free. These corridors by rays have no multiple scattering that would fill the "
        "depth; in full waves speckle behind objects lies 20 to 40 dB below the brightest echoes.",
    )


UNITS = {
    "power_dbm": "dBm",
    "threshold_db": "dB",
    "way_m": "m",
    "mean_m": "m",
    "median_m": "m",
    "cell_m": "m",
    "plan_snr_db": "dB",
}


def _data(rows: list[Row]) -> xr.Dataset:
    """The scores of all corridors."""
    names = [name for name in rows[0] if name not in ("material", "walls")]

    def values(name: str) -> Array:
        return np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=float)

    angle = np.full((len(rows), MOST, 2), np.nan)
    for place, row in zip(angle, rows, strict=True):
        place[: len(row["walls"])] = np.array(row["walls"], dtype=float)
    return xr.Dataset(
        {name: ("scene", values(name), {"units": UNITS.get(name, "1")}) for name in names}
        | {
            "wall_angle_error": (("scene", "generation"), angle[..., 0], {"units": "degree"}),
            "wall_offset_error": (("scene", "generation"), angle[..., 1], {"units": "mm"}),
        },
        coords={
            "material": ("scene", [row["material"] for row in rows]),
            "generation": ("generation", np.arange(1, MOST + 1), {"units": "1"}),
        },
    )
