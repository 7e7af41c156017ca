"""Fit the weights of the confidence, and print how well it is calibrated on scenes that had no part in the fit.

    python benchmarks/confidence.py [--fit 30:32] [--judge 40:42] [--family NAME ...] [--radar NAME ...] [--sweeps DIR]

Each scene is folded as `mirrorfold fold` does, with its sweep and from the image alone: without the sweep more false
rows pass for mirrors, so the weights for an image alone are fitted to trees that were found without it. By default the
scenes are those of the ray families of `mirrorfold.scenes.families`, with all their radars and with `SPARSE` ones.
Full-wave families can be named as well; --sweeps is a folder that keeps their sweeps. Rays and full waves have the same
weight in the fit, whatever the number of their points.

The tables hold, for each radar and engine and number of mirrors in the chain: the number of points, the share of true
points (a surface stands within 1.5 resolution cells), the mean confidence, the expected calibration error over ten bins
(Naeini, Cooper and Hauskrecht, AAAI 2015), the share of the true points that a least confidence of 0.5 keeps, the share
of true points among those kept, and the normalised error: the root of the mean square of the distance across
the nearest surface over the standard error of the place, for points that are kept and true.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light
from scipy.optimize import minimize
from scipy.special import expit

import mirrorfold as mf
from mirrorfold.benchmarking.scenes import Task, simulated
from mirrorfold.common.types import Array, Index, Mask, Names
from mirrorfold.detection.finding import find_echoes, see, usual_settings
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.folding import PRESETS, Points, fold_back
from mirrorfold.folding.confidence import (
    FEATURES,
    TABLES,
    TRUE_CELLS,
    Weights,
    errors,
    features,
    judged,
    over_faces,
    table_numbers,
    weight_rows,
    with_confocal_shares,
)
from mirrorfold.scenes.families import FAMILIES, Radar, draw, radars_of
from mirrorfold.scenes.floor_plan import Scene as FloorPlan
from mirrorfold.scoring import floor_plans
from mirrorfold.sweep.facts import is_monostatic
from mirrorfold.tree.kinds import find_every_kind
from mirrorfold.tree.measured import measured_by_sweep, no_measurements
from mirrorfold.tree.mirror_tree import MirrorTree

TINY = np.finfo(float).eps
"""Smallest probability that is told from zero."""

HEADINGS = (
    "engine",
    "radar",
    "sweep",
    "mirrors",
    "what",
    "points",
    "true",
    "confidence",
    "error",
    "kept",
    "true of kept",
    "rms",
)
"""Columns of the tables; "rms" is the normalised error."""

BINS = 10
"""Bins of confidence for the calibration error."""

HALF_WAVE = speed_of_light / 81e9 / 2.0
"""Distance of the places that the pairs of `SPARSE` arrays fill [m]: half a wavelength at the top of their band."""

SPARSE = Radar(
    name="79 GHz chip",
    what="77-81 GHz, 12 transmitters, each as far from the next as the row of 8 receivers is long",
    band={"start": 77e9, "stop": 81e9, "points": 161},
    array={"kind": "linear", "elements": 12, "pitch": 8.0 * HALF_WAVE, "rx": {"elements": 8, "pitch": HALF_WAVE}},
)
MOVING = Radar(
    name="79 GHz moving antenna",
    what="77-81 GHz, one antenna at 160 places a quarter of a wavelength apart",
    band=SPARSE.band,
    array={"kind": "linear", "elements": 160, "pitch": 0.5 * HALF_WAVE},
)
"""Radars of which one array alone resolves directions, besides those of the benchmarks, whose two arrays both do."""

SIGNS = {"excess": 1, "neighbours": 1, "astray": -1, "share": 1, "over": 1, "deeper": -1}
"""Whether a larger feature speaks for a point or against it: fitted weights have this sign, or are zero."""

NAMED = (
    ("not measured", {"share", "over"}),
    ("not measured, one array resolves directions", {"share", "astray", "deeper"}),
    ("measured", {"deeper"}),
)
"""What each of the `TABLES` is for, and the features that keep their weights in it."""


class Scene(NamedTuple):
    """The points of one scene, with what they are judged by.

    Attributes
    ----------
    engine, radar : str
    by_sweep : str
        Whether the sweep was at hand.
    points : Points
    tree : MirrorTree
    features : (n, features) array
    table : (n,) array of int
        The number among `TABLES` of the weights of each point.
    true : (n,) bool array
    normalised : (n,) array
        Distance across the nearest surface over the standard error of the place in that direction.
    """

    engine: str
    radar: str
    by_sweep: str
    points: Points
    tree: MirrorTree
    features: Array
    table: Index
    true: Mask
    normalised: Array

    def confidence(self, tables: Sequence[Weights]) -> Array:
        """The confidence of the points, (n,), with these weights."""
        return judged(self.points, self.tree, self.features, self.table, tables)


def scenes_of(task: Task) -> list[Scene]:
    """One scene, folded from the image alone, and with the sweep where that tells more."""
    scene = draw(task.family, task.seed, radar=task.radar)
    sweep = simulated(task, scene)
    if task.radar is MOVING:
        sweep = one_antenna(sweep)
    image = mf.focus(sweep, tolerance=TOLERANCE_TO_FOLD)
    return [folded(task, image, scene, given) for given in ((None,) if is_monostatic(sweep) else (None, sweep))]


def one_antenna(sweep: xr.Dataset) -> xr.Dataset:
    """The part of a sweep that one antenna would measure that stands at all places in turn, and sends and receives."""
    number = xr.DataArray(np.arange(sweep.sizes["tx"]), dims="position")
    own = sweep.isel(tx=number, rx=number).drop_vars("rx_position").rename(tx_position="antenna_position")
    return own.transpose("frequency", "position", "axis")


def folded(task: Task, image: xr.DataArray, scene: FloorPlan, sweep: xr.Dataset | None) -> Scene:
    """The points of one scene, as `mirrorfold.fold` makes them, with their features and the truth."""
    view = see(image)
    echoes = find_echoes(view)
    settings = PRESETS["default"].completed(**usual_settings(view, echoes))
    settings = replace(settings, copies=sweep is not None)
    measured = (no_measurements if sweep is None else measured_by_sweep(sweep))(view)
    found = find_every_kind(view, echoes, settings, measured=measured)
    points = fold_back(found.tree, view, found.transparent_walls)
    if measured.confocal_share is not None:
        points = with_confocal_shares(points, measured.confocal_share)
    error, mirror_error = errors(points, found.tree, view)
    values = features(points, view, mirror_error, over_faces(points, found.tree))
    truth = floor_plans.truth(scene)
    distance, nearest = truth.distances(points.position)
    normal = truth.normals[nearest]
    across = np.abs(np.sum((points.position - truth.place[nearest]) * normal, axis=1))
    return Scene(
        task.family.engine,
        task.radar.name,
        "no" if sweep is None else "yes",
        points,
        found.tree,
        values,
        table_numbers(points, values, view, by_sweep=sweep is not None),
        distance <= TRUE_CELLS * view.cell(np.linalg.norm(points.initial - view.radar, axis=1)),
        across / np.maximum(np.linalg.norm(error * normal, axis=1), np.finfo(float).tiny),
    )


def fitted(scenes: list[Scene], number: int) -> Weights:
    """The weights that fit the truth best, in place of the `TABLES` with this number.

    A point is true if the mirrors on its way are and it is true in itself, so its likelihood is the product of both
    probabilities; faces are weighed first. All engines have the same weight. That of a scene grows with the root of the
    number of its points, which are not independent. Kinds without points keep their weights.
    """
    tables = list(TABLES)
    names = [name for name in FEATURES[1:] if name not in NAMED[number][1]]
    columns = [0, *(FEATURES.index(name) for name in names)]
    bounds = [(None, None), *((0.0, None) if SIGNS[name] > 0 else (None, 0.0) for name in names)]
    for kind in ("on mirrors", "in line of sight", "on mirrors", "behind mirrors"):
        parts = list[tuple[Array, Mask, Array, Array, Names]]()
        for scene in scenes:
            own = (scene.table == number) & (weight_rows(scene.points) == list(TABLES[number]).index(kind))
            values, count = np.nan_to_num(scene.features[own]), int(own.sum())
            # What the mirrors on the way leave of the probability that a point has in itself.
            mirrors = scene.confidence(tables)[own] / np.maximum(expit(values @ tables[number][kind]), TINY)
            parts.append((values, scene.true[own], mirrors, np.full(count, max(count, 1) ** -0.5),
                          np.full(count, scene.engine)))  # fmt: skip
        values, true, mirrors, share, engine = map(np.concatenate, zip(*parts, strict=True))
        if not true.size:
            continue
        for each in np.unique(engine):
            share[engine == each] /= share[engine == each].sum()
        weights = np.array(tables[number][kind])
        kept = np.delete(values, columns, axis=1) @ np.delete(weights, columns)
        given = values[:, columns], kept, true, mirrors, share
        weights[columns] = np.round(minimize(_loss, weights[columns], given, "L-BFGS-B", bounds=bounds).x, 2)
        tables[number] = {**tables[number], kind: tuple(weights.tolist())}
    return tables[number]


def _loss(weights: Array, values: Array, kept: Array, true: Mask, mirrors: Array, share: Array) -> float:
    """Minus the logarithm of the likelihood, by the `share` (n,) of each point, and a little for large weights."""
    likely = np.clip(expit(values @ weights + kept) * mirrors, TINY, 1.0 - TINY)
    return float(-share @ np.log(np.where(true, likely, 1.0 - likely)) + 1e-3 * np.sum((weights * values.std(0)) ** 2))


def calibration_error(confidence: Array, true: Array) -> float:
    """Mean difference of confidence and share of true points, over bins of confidence, weighted by their points."""
    bins = np.minimum((confidence * BINS).astype(int), BINS - 1)
    return float(sum(abs(np.sum(confidence[bins == b] - true[bins == b])) for b in range(BINS)) / max(true.size, 1))


def table(scenes: list[Scene], name: str, tables: Sequence[Weights]) -> Table:
    """How well the confidence is calibrated for each radar, with these weights."""
    made = Table(title=name)
    for heading in HEADINGS:
        made.add_column(heading, justify="right")
    for group in sorted({scene[:3] for scene in scenes}):
        own = [scene for scene in scenes if scene[:3] == group]
        confidence = np.concatenate([scene.confidence(tables) for scene in own])
        true, normalised = (np.concatenate(each) for each in zip(*(scene[-2:] for scene in own), strict=True))
        bounces, mirror = (np.concatenate([getattr(scene.points, column) for scene in own])
                           for column in ("bounces", "mirror"))  # fmt: skip
        for count, what in product(np.unique(bounces), ("all", "objects", "faces")):
            here = (bounces == count) & ((what == "all") | ((mirror != "") == (what == "faces")))
            if here.any():
                figures = _figures(confidence[here], true[here], normalised[here])
                made.add_row(*group, str(count), what, str(here.sum()), *(f"{value:.3f}" for value in figures))
    return made


def _figures(confidence: Array, true: Mask, normalised: Array) -> tuple[float, ...]:
    """The figures of the points of one line of a table."""
    kept = confidence >= 0.5
    good = kept & true
    return (
        true.mean(),
        confidence.mean(),
        calibration_error(confidence, true),
        good.sum() / max(true.sum(), 1),
        good.sum() / max(kept.sum(), 1),
        float(np.sqrt(np.mean(normalised[good] ** 2))) if good.any() else np.nan,
    )


def main() -> None:
    """Fit the weights to some scenes, and print the tables of others."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    rays = [family.name for family in FAMILIES.values() if family.engine == "rays" and family.name != "empty"]
    parser.add_argument("--fit", default="30:32")
    parser.add_argument("--judge", default="40:42")
    parser.add_argument("--family", nargs="+", default=rays)
    parser.add_argument("--radar", nargs="+")
    parser.add_argument("--sweeps", type=Path)
    given = parser.parse_args()

    def collected(seeds: str) -> list[Scene]:
        first, end = map(int, seeds.split(":"))
        tasks = [
            Task(FAMILIES[name], radar, seed, (), given.sweeps)
            for name in given.family
            for radar in (*radars_of(FAMILIES[name]), *((SPARSE, MOVING) if FAMILIES[name].engine == "rays" else ()))
            if given.radar is None or radar.name in given.radar
            for seed in range(first, end)
        ]
        return [scene for task in tasks for scene in scenes_of(task)]

    console = Console(width=None if sys.stdout.isatty() else 140)
    fit, judge = collected(given.fit), collected(given.judge)
    console.print(table(judge, f"as it stands, seeds {given.judge}", TABLES))
    tables = [fitted(fit, number) for number in range(len(TABLES))]
    for (name, _), new, now in zip(NAMED, tables, TABLES, strict=True):
        for kind, values in new.items():
            console.print(f"{name}: {kind} {values}, now {now[kind]}")
    console.print(table(judge, f"with these weights, seeds {given.judge}", tables))


if __name__ == "__main__":
    main()
