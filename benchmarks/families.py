"""Reconstruct families of random ray-simulated scenes and print the median and the worst of every figure.

    python benchmarks/families.py [--seeds 10] [--family NAME ...] [--json FILE]

The published algorithm runs on the same images, in the same table. Each scene is drawn until its hidden surfaces
really are hidden and can be seen by way of mirrors.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scoring.floor_plans import visible_truth

Generator = np.random.Generator
Surface = dict[str, Any]

ARRAY = {"kind": "linear", "elements": 161, "pitch": 0.5e-3}
BAND = {"start": 290e9, "stop": 300e9, "points": 401}
WALL_ROUGHNESS = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
OBJECT_ROUGHNESS = {"rms_height": 0.10e-3, "correlation_length": 0.2e-3}


def wall(name: str, middle: tuple[float, float], angle_deg: float, length: float, **more: Any) -> Surface:
    """A straight wall around its middle [m]; the angle counts from +x."""
    half = 0.5 * length * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    start, end = np.array(middle) - half, np.array(middle) + half
    return {
        "name": name,
        "kind": "segment",
        "start": start.tolist(),
        "end": end.tolist(),
        "roughness": WALL_ROUGHNESS,
        **more,
    }


def corner(name: str, vertex: tuple[float, float], facing_deg: float, leg: float) -> Surface:
    """A right-angled corner whose opening faces a direction."""
    legs = [np.radians(facing_deg + turn) for turn in (45.0, -45.0)]
    ends = [np.array(vertex) + leg * np.array([np.cos(a), np.sin(a)]) for a in legs]
    points = [ends[0].tolist(), list(vertex), ends[1].tolist()]
    return {"name": name, "kind": "polyline", "points": points, "roughness": OBJECT_ROUGHNESS}


def arc(name: str, center: tuple[float, float], radius: float, facing_deg: float, span_deg: float) -> Surface:
    """A convex arc that bulges towards a direction."""
    return {
        "name": name,
        "kind": "arc",
        "center": list(center),
        "radius": radius,
        "start_angle": facing_deg - span_deg / 2,
        "stop_angle": facing_deg + span_deg / 2,
        "roughness": OBJECT_ROUGHNESS,
    }


def circle(name: str, center: tuple[float, float], radius: float) -> Surface:
    """A rough disc."""
    return {"name": name, "kind": "circle", "center": list(center), "radius": radius, "roughness": OBJECT_ROUGHNESS}


def targets(random: Generator, x: tuple[float, float], y: tuple[float, float], facing_deg: float) -> list[Surface]:
    """Two or three of a corner, an arc and a disc, apart from each other."""
    places: list[np.ndarray] = []
    while len(places) < 3:
        place = np.array([random.uniform(*x), random.uniform(*y)])
        if all(np.linalg.norm(place - other) > 0.55 for other in places):
            places.append(place)
        elif random.random() < 0.02:
            places.clear()
    facing = facing_deg + random.uniform(-25.0, 25.0)
    made = [
        corner("corner", tuple(places[0]), facing, random.uniform(0.15, 0.22)),
        arc("arc", tuple(places[1]), random.uniform(0.15, 0.3), facing, random.uniform(90.0, 150.0)),
        circle("disc", tuple(places[2]), random.uniform(0.06, 0.12)),
    ]
    keep = int(random.integers(2, 4))
    return [made[i] for i in sorted(random.permutation(3)[:keep])]


def one_wall(random: Generator) -> list[Surface]:
    """A wall to the side shows what a pillar hides."""
    pillar = circle("pillar", (random.uniform(-0.25, 0.0), random.uniform(0.9, 1.1)), random.uniform(0.14, 0.22))
    mirror = wall("wall", (random.uniform(0.6, 0.85), random.uniform(1.2, 1.6)), random.uniform(98.0, 112.0),
                  random.uniform(0.9, 1.3))  # fmt: skip
    return [pillar, mirror, *targets(random, (-0.9, 0.05), (1.5, 2.4), -40.0)[:1]]


def two_walls(random: Generator, **mirror: Any) -> list[Surface]:
    """One wall hides the targets, the other shows them."""
    occluder = wall("wall 1", (random.uniform(-0.5, -0.25), random.uniform(0.95, 1.2)), random.uniform(150.0, 185.0),
                    random.uniform(0.9, 1.2), **mirror)  # fmt: skip
    shows = wall("wall 2", (random.uniform(0.6, 0.85), random.uniform(1.2, 1.6)), random.uniform(98.0, 115.0),
                 random.uniform(0.8, 1.2), **mirror)  # fmt: skip
    return [occluder, shows, *targets(random, (-1.0, 0.1), (1.4, 2.4), -15.0)]


def corridor(random: Generator) -> list[Surface]:
    """The radar stands in a corridor; its far wall shows what is around the corner."""
    turn = random.uniform(-0.6, -0.45), random.uniform(1.1, 1.4)
    inner = {
        "name": "inner corner",
        "kind": "polyline",
        "points": [
            [turn[0] + random.uniform(0.0, 0.1), 0.4],
            list(turn),
            [turn[0] - 1.3, turn[1] + random.uniform(-0.1, 0.1)],
        ],
        "roughness": WALL_ROUGHNESS,
    }
    far = wall("far wall", (random.uniform(-0.6, -0.3), turn[1] + random.uniform(1.0, 1.4)), random.uniform(-8.0, 12.0),
               random.uniform(1.6, 2.2))  # fmt: skip
    return [inner, far, *targets(random, (turn[0] - 1.1, turn[0] - 0.3), (turn[1] + 0.25, turn[1] + 1.0), 60.0)[:2]]


def three_bounces(random: Generator) -> list[Surface]:
    """A periscope: the first mirror shows the second, and the second the targets."""
    first = wall("mirror 1", (random.uniform(-0.1, 0.15), random.uniform(1.3, 1.5)), 45.0 + random.uniform(-4.0, 4.0),
                 random.uniform(0.9, 1.1))  # fmt: skip
    second = wall("mirror 2", (random.uniform(1.1, 1.3), random.uniform(1.3, 1.5)), 45.0 + random.uniform(-5.0, 5.0),
                  random.uniform(1.0, 1.2))  # fmt: skip
    occluder = wall("screen", (random.uniform(0.5, 0.65), random.uniform(0.85, 1.0)), random.uniform(-10.0, 25.0), 0.4)
    place = random.uniform(0.9, 1.5), random.uniform(2.0, 2.5)
    kind = int(random.integers(3))
    target = [
        corner("target", place, -90.0 + random.uniform(-25.0, 25.0), random.uniform(0.15, 0.22)),
        arc("target", place, random.uniform(0.15, 0.3), -90.0, 130.0),
        circle("target", place, random.uniform(0.08, 0.15)),
    ][kind]
    return [first, second, occluder, target]


def drywall(random: Generator) -> list[Surface]:
    """Two walls of plasterboard that scatter from 1 to 3 cm deep."""
    return two_walls(random, material="plasterboard", volume_depth=random.uniform(0.01, 0.03))


def discs(random: Generator) -> list[Surface]:
    """Small discs behind a wall."""
    walls = two_walls(random)[:2]
    places: list[np.ndarray] = []
    while len(places) < 4:
        place = np.array([random.uniform(-0.9, 0.1), random.uniform(1.4, 2.4)])
        if all(np.linalg.norm(place - other) > 0.2 for other in places):
            places.append(place)
    return [*walls, *(circle(f"disc {i}", tuple(p), random.uniform(0.015, 0.05)) for i, p in enumerate(places))]


def empty(random: Generator) -> list[Surface]:
    """Nothing but noise."""
    return []


FAMILIES: dict[str, tuple[Callable[[Generator], list[Surface]], float | None]] = {
    "one wall": (one_wall, None),
    "two walls": (two_walls, None),
    "corridor": (corridor, None),
    "three bounces": (three_bounces, None),
    "empty": (empty, 20.0),
    "drywall": (drywall, None),
    "SNR 20 dB": (two_walls, 20.0),
    "SNR 10 dB": (two_walls, 10.0),
    "SNR 0 dB": (two_walls, 0.0),
    "discs": (discs, None),
}


def draw(family: str, seed: int) -> Scene:
    """A random scene of a family, the same for the same seed."""
    make, _ = FAMILIES[family]
    random = np.random.default_rng([sum(map(ord, make.__name__)), seed])
    for _ in range(2000):
        surfaces = make(random)
        scene = parse_scene(
            {"name": f"{family} {seed}", "dimensions": 2, "array": ARRAY, "band": BAND, "surface": surfaces}
        )
        if not surfaces or good(scene, 2 if family == "three bounces" else 1):
            return scene
    raise RuntimeError(f"no scene of family {family!r} with seed {seed}")


def good(scene: Scene, bounces: int) -> bool:
    """Whether every target is out of sight, none touches a wall, and mirrors show a good part of each."""
    parts = [surface.sample(0.005)[:2] for surface in scene.surface]
    hidden = [i for i, s in enumerate(scene.surface) if s.name.split()[0] in ("corner", "arc", "disc", "target")]
    for i in hidden:
        for j, (other, _) in enumerate(parts):
            if i != j and min(np.linalg.norm(parts[i][0][:, None] - other[None], axis=-1).min(), 1.0) < 0.12:
                return False
    for i in hidden:
        points, normals = parts[i]
        direct, reachable = visible_truth(scene, points, normals, bounces=bounces)
        whole = 0.2 if scene.surface[i].kind == "circle" else 0.5
        if direct.any() or reachable.mean() < whole:
            return False
    return True


FIGURES = {
    "all F2": lambda s: s["f_score_2cm"],
    "hidden F2": lambda s: s["hidden"]["f_score_2cm"],
    "hidden precision": lambda s: s["hidden"]["precision_2cm"],
    "hidden completeness": lambda s: s["hidden"]["completeness_2cm"],
    "hidden accuracy [mm]": lambda s: None if s["hidden"]["accuracy_m"] is None else 1e3 * s["hidden"]["accuracy_m"],
    "angle [deg]": lambda s: mirror_error(s, "angle_error_deg"),
    "offset [mm]": lambda s: mirror_error(s, "offset_error_mm"),
    "missing mirrors": lambda s: s["missing_mirrors"],
    "invented %": lambda s: 100.0 * s["invented_fraction"],
}
LOW_IS_WORST = {"all F2", "hidden F2", "hidden precision", "hidden completeness"}


def mirror_error(score: dict[str, Any], key: str) -> float | None:
    """The mean error over the mirrors in line of sight that exist in truth."""
    errors = [m[key] for m in score["mirrors"] if m["generation"] == 1 and m["surface"] is not None]
    return float(np.mean(errors)) if errors else None


def judge(reconstruction: Any, scene: Scene) -> dict[str, Any]:
    """Scores, with the number of true mirrors in line of sight that were not found."""
    score = mf.score(reconstruction, scene)
    found = {m["surface"] for m in score["mirrors"] if m["generation"] == 1}
    expected = {s.name for s in scene.surface if s.name.startswith(("wall", "far", "mirror 1"))}
    score["missing_mirrors"] = len(expected - found)
    return score


def table(rows: dict[tuple[str, str], list[dict[str, Any]]]) -> Table:
    """Mean, median and worst of every figure by family and preset."""
    result = Table(title="each cell: mean, median, worst over the scenes", title_justify="left")
    result.add_column("family")
    result.add_column("preset")
    for name in FIGURES:
        result.add_column(name, justify="right")
    for (family, preset), scores in rows.items():
        cells = []
        for name, figure in FIGURES.items():
            values = [value for value in map(figure, scores) if value is not None]
            worst = min if name in LOW_IS_WORST else max
            digits = 1 if name.endswith(("[mm]", "%", "mirrors")) else 2 if name in LOW_IS_WORST else 3
            figures = (np.mean(values), np.median(values), worst(values)) if values else ()
            cells.append("  ".join(f"{value:.{digits}f}" for value in figures) or "-")
        result.add_row(family, preset, *cells, end_section=preset == "published")
    return result


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--family", action="append", choices=FAMILIES)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for family in options.family or FAMILIES:
        for seed in range(options.first, options.first + options.seeds):
            started = time.perf_counter()
            scene = draw(family, seed)
            sweep = mf.simulate(scene, solver="rays", seed=seed, snr_db=FAMILIES[family][1])
            image = mf.focus(sweep, tolerance=1e-3)
            for preset in ("default", "published"):
                rows.setdefault((family, preset), []).append(judge(mf.fold(image, sweep=sweep, preset=preset), scene))
            print(f"{scene.name}: {time.perf_counter() - started:.1f} s", file=sys.stderr)
        if options.json:
            done = [{"family": name, "preset": preset, "scores": scores} for (name, preset), scores in rows.items()]
            options.json.write_text(json.dumps(done))
    Console(width=200).print(table(rows))


if __name__ == "__main__":
    main()
