"""Fit the weights of the confidence, and print how well it is calibrated on scenes that had no part in the fit.

    python benchmarks/confidence.py [--fit 30:32] [--judge 40:42] [--family NAME ...] [--radar NAME ...] [--sweeps DIR]

By default the scenes are those of the ray families of `mirrorfold.scenes.families`, with all their radars. Full-wave
families can be named as well; --sweeps is a folder that keeps their sweeps. Rays and full waves have the same weight in
the fit, whatever the number of their points.

The tables hold, for each engine and number of mirrors in the chain: the number of points, the share of true points (a
surface stands within 1.5 resolution cells), the mean confidence, the expected calibration error over ten bins (Naeini,
Cooper and Hauskrecht, AAAI 2015), the share of the true points that a least confidence of 0.5 keeps, and the share of
true points among those kept.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize
from scipy.special import expit

import mirrorfold as mf
from mirrorfold.benchmarking.scenes import Task, simulated
from mirrorfold.common.types import Array
from mirrorfold.detection.finding import find_echoes, see, usual_settings
from mirrorfold.folding import PRESETS, fold_back
from mirrorfold.folding.confidence import (
    TRUE_CELLS,
    WEIGHTS,
    WEIGHTS_MEASURED,
    errors,
    features,
    over_faces,
    weight_rows,
    with_confidence,
    with_confocal_shares,
)
from mirrorfold.scenes.families import FAMILIES, draw, radars_of
from mirrorfold.scoring import floor_plans
from mirrorfold.tree.measured import measured_by_sweep
from mirrorfold.tree.rounds import find_tree

BINS = 10
"""Bins of confidence for the calibration error."""


class Points(NamedTuple):
    """Points of one engine: features (n, 6); and row of the weights, number of mirrors in the chain, confidence, and
    whether the point is true, (n,) each.
    """

    engine: str
    features: Array
    kind: Array
    bounces: Array
    confidence: Array
    true: Array


def points_of(task: Task) -> Points:
    """The points of one scene, with their features and the truth."""
    scene = draw(task.family, task.seed, radar=task.radar)
    sweep = simulated(task, scene)
    view = see(mf.focus(sweep, tolerance=1e-3))
    echoes = find_echoes(view)
    settings = PRESETS["default"].completed(**usual_settings(view, echoes))
    measured = measured_by_sweep(sweep)(view)
    found = find_tree(view, echoes, settings, measured=measured)
    points = with_confocal_shares(fold_back(found.tree), measured.confocal_share)
    count = len(points.position)
    confidence = with_confidence(points, found).confidence[:count]
    _, mirror_error = errors(points, found.tree, view)
    cell = view.cell(np.linalg.norm(points.initial - view.radar, axis=1))
    distance = floor_plans.truth(scene).distances(points.position)[0] if count else np.zeros(0)
    given = (
        features(points, view, mirror_error, over_faces(points, found.tree)),
        weight_rows(points),
        points.bounces,
        confidence,
        distance <= TRUE_CELLS * cell,
    )
    return Points(task.family.engine, *given)


def fitted(sets: list[Points], columns: int) -> dict[str, list[float]]:
    """The weights of the first `columns` features, by kind of point, that fit the truth best by logistic regression.

    All engines have the same weight. Kinds without points keep their present weights.
    """
    engines = sorted({points.engine for points in sets})

    def loss(weights: Array, parts: list[tuple[Array, Array]], spread: Array) -> float:
        odds = [(values @ weights) * np.where(true, -1.0, 1.0) for values, true in parts]
        return float(sum(np.mean(np.logaddexp(0.0, each)) for each in odds) + 1e-3 * np.sum((weights * spread) ** 2))

    found = {}
    for kind, name in enumerate(WEIGHTS):
        parts = []
        for engine in engines:
            chosen = [(p.features[p.kind == kind], p.true[p.kind == kind]) for p in sets if p.engine == engine]
            chosen_features, true = map(np.concatenate, zip(*chosen, strict=True))
            if true.size:
                parts.append((np.nan_to_num(chosen_features[:, :columns]), true))
        if parts:
            spread = np.std(np.concatenate([chosen_features for chosen_features, _ in parts]), axis=0)
            found[name] = np.round(minimize(loss, np.zeros(columns), args=(parts, spread)).x, 2).tolist()
    return {**(WEIGHTS if columns == 4 else WEIGHTS_MEASURED), **found}


def calibration_error(confidence: Array, true: Array) -> float:
    """Mean difference of confidence and share of true points, over bins of confidence, weighted by their points."""
    bins = np.minimum((confidence * BINS).astype(int), BINS - 1)
    return float(sum(abs(np.sum(confidence[bins == b] - true[bins == b])) for b in range(BINS)) / max(true.size, 1))


def table(sets: list[Points], name: str, weights: dict[str, list[float]] | None = None) -> Table:
    """How well the confidence is calibrated, with the present weights or with others."""
    made = Table(title=name)
    for heading in ("engine", "mirrors", "points", "true", "confidence", "error", "kept", "true of kept"):
        made.add_column(heading, justify="right")
    for engine in sorted({points.engine for points in sets}):
        own = [points for points in sets if points.engine == engine]
        kind, bounces, confidence, true = (np.concatenate([points[i] for points in own]) for i in (2, 3, 4, 5))
        if weights is not None:
            rows = np.array(list(weights.values()))[kind]
            given_ = np.concatenate([points.features for points in own])[:, : rows.shape[1]]
            confidence = expit(np.sum(np.nan_to_num(given_) * rows, axis=1))
        for count in np.unique(bounces):
            p, t = confidence[bounces == count], true[bounces == count]
            kept = p >= 0.5
            figures = t.mean(), p.mean(), calibration_error(p, t), kept[t].mean(), t[kept].mean() if kept.any() else 1.0
            made.add_row(engine, str(count), str(t.size), *(f"{value:.3f}" for value in figures))
    return made


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

    def collected(seeds: str) -> list[Points]:
        first, end = map(int, seeds.split(":"))
        tasks = [
            Task(FAMILIES[name], radar, seed, ("ours",), given.sweeps)
            for name in given.family
            for radar in radars_of(FAMILIES[name])
            if given.radar is None or radar.name in given.radar
            for seed in range(first, end)
        ]
        return [points_of(task) for task in tasks]

    console = Console()
    fit, judge = collected(given.fit), collected(given.judge)
    console.print(table(judge, f"as it stands, seeds {given.judge}"))
    for name, now in (("of the image alone", WEIGHTS), ("with the sweep", WEIGHTS_MEASURED)):
        weights = fitted(fit, len(now["on mirrors"]))
        for kind, values in weights.items():
            console.print(f"{name}, {kind}: {values}, now {list(now[kind])}")
        console.print(table(judge, f"with these weights {name}, seeds {given.judge}", weights))


if __name__ == "__main__":
    main()
