"""Raster scans: time, memory and accuracy from the simulation to the folded volume, on shipped and random scenes.

    python benchmarks/raster.py [--seeds 10] [--family NAME ...] [--json FILE]

Process times are sums over all threads: on two cores the wall time is between a half and the whole of them.
"""

from __future__ import annotations

import argparse
import copy
import json
import resource
import time
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

import mirrorfold as mf
from mirrorfold.detection import find_echoes, find_mirrors, see, usual_settings
from mirrorfold.focusing.scans.gridding import plan_view, to_voxels
from mirrorfold.focusing.scans.range_profiles import focus_raster
from mirrorfold.folding import FoldSettings
from mirrorfold.folding.pictures import draw
from mirrorfold.folding.points import fold_back, owned_blobs
from mirrorfold.scenes.families.raster import corridor, drywall, leaning_drywall
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.scoring.volumes import patch_contrast
from mirrorfold.simulation.raster.echoes import find_echoes as simulated_echoes
from mirrorfold.simulation.raster.meshes import solids
from mirrorfold.simulation.raster.sweep import measure
from mirrorfold.tree.rounds import find_tree

Content = dict[str, Any]


class NotHiddenError(Exception):
    """The radar sees the body of a draw directly, so that the draw is no scene of the family."""


SNR_DB = 20.0
"""Signal over noise of a sample [dB]: the body then stands some 30 dB above the noise of the volume."""


def shipped(name: str) -> Content:
    """The content of a shipped scene."""
    return tomllib.loads(files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml").read_text(encoding="utf-8"))


def without_foil(content: Content) -> Content:
    """The same scene without its patches of foil."""
    content = copy.deepcopy(content)
    content["surface"] = [surface for surface in content["surface"] if surface["kind"] != "patch"]
    return content


def mirror_error(score: Content, surface: str) -> tuple[float, float]:
    """Errors of angle [degree] and offset [mm] of a true wall, of the first generation found; infinite if none is."""
    rows = [row for row in score["mirrors"] if row["surface"] == surface]
    best = min(rows, key=lambda row: row["generation"], default=None)
    return (best["angle_error_deg"], best["offset_error_mm"]) if best else (np.inf, np.inf)


def judge_drywall(content: Content, seed: int) -> dict[str, float]:
    """Errors and levels of one drywall scene, and of its control without foil."""
    scene = parse_scene(content)
    sweep = mf.simulate(scene, seed=seed, snr_db=SNR_DB)
    score = mf.score(mf.reconstruct(sweep), scene)
    if "mannequin" not in score["surfaces"]:
        raise NotHiddenError
    bare = parse_scene(without_foil(content))
    objects = mf.reconstruct(mf.simulate(bare, seed=seed, snr_db=SNR_DB)).children["objects"].dataset
    behind = objects["bounces"].values > 0
    points = np.stack([objects[axis].values for axis in "xyz"], axis=-1)[behind]
    foil = next(surface for surface in scene.surface if surface.name == "foil")
    angle, offset = mirror_error(score, "drywall")
    body = score["surfaces"]["mannequin"]
    return {
        "plane error [deg] <= 0.15": angle,
        "plane offset [mm] <= 5": offset,
        "points to body, mean [cm] <= 0.6": 100.0 * _or_inf(score["hidden"]["accuracy_m"]),
        "false points [%] <= 1": 100.0 * score["hidden"]["false_fraction"],
        "body covered [%] >= 95": 100.0 * (body.get("completeness_3cm") or 0.0),
        "L over surroundings [dB] >= 6": _or_inf(score["patches"]["foil"]["contrast_db"], -np.inf),
        "control [dB] <= 3": _or_inf(patch_contrast(scene, foil, points, objects["amplitude"].values[behind])),
        "mirrors": float(len(score["mirrors"])),
    }


def judge_corridor(content: Content, seed: int) -> dict[str, float]:
    """Errors and shares of one corridor."""
    scene = parse_scene(content)
    sweep = mf.simulate(scene, seed=seed, snr_db=SNR_DB)
    score = mf.score(mf.reconstruct(sweep), scene)
    if "mannequin" not in score["surfaces"]:
        raise NotHiddenError
    body, box = score["surfaces"]["mannequin"], score["surfaces"].get("extinguisher box", {})
    return {
        "mirror wall [deg] <= 0.2": mirror_error(score, "outer wall")[0],
        "hidden wall [deg] <= 0.3": mirror_error(score, "inner wall")[0],
        "folded body, mean [cm] <= 1.2": 100.0 * _or_inf(body.get("accuracy_m")),
        "unexplained points [%] <= 8": 100.0 * score["hidden"]["invented_fraction"],
        "body covered [%]": 100.0 * (body.get("completeness_3cm") or 0.0),
        "box, mean [cm]": 100.0 * _or_inf(box.get("accuracy_m")),
        "mirrors": float(len(score["mirrors"])),
    }


def _or_inf(value: float | None, otherwise: float = np.inf) -> float:
    return otherwise if value is None else value


FAMILIES: dict[str, tuple[str, Callable[[np.random.Generator], Any], Callable[[Content, int], dict[str, float]]]] = {
    "drywall": ("drywall-mannequin", drywall, judge_drywall),
    "leaning": ("drywall-mannequin", leaning_drywall, judge_drywall),
    "corridor": ("corridor", corridor, judge_corridor),
}
"""For each family: the shipped scene with the scanner, the function that draws surfaces, and the one that judges."""


def run_family(name: str, seeds: int) -> list[dict[str, float]]:
    """Errors, levels and shares of as many random scenes of a family as there are `seeds`."""
    shown, draw_surfaces, judge = FAMILIES[name]
    rows: list[dict[str, float]] = []
    draw = 0
    while len(rows) < seeds:
        random = np.random.default_rng([draw, len(name)])
        draw += 1
        try:
            rows.append(judge(shipped(shown) | {"surface": draw_surfaces(random)}, draw))
        except NotHiddenError:
            continue
        except mf.InputError as error:
            # Echoes of this draw come from beyond the unambiguous range: it is no scene for this instrument.
            if "wrap around" not in str(error):
                raise
    return rows


def family_table(name: str, rows: list[dict[str, float]]) -> Table:
    """Median and worst value of every error, level and share."""
    table = Table(title=f"{name}: {len(rows)} random scenes", title_justify="left")
    for heading in ("figure and target", "median", "worst"):
        table.add_column(heading, justify="left" if heading.startswith("figure") else "right")
    for figure in rows[0]:
        values = np.array([row[figure] for row in rows])
        worst = values.min() if ">=" in figure or figure == "body covered [%]" else values.max()
        table.add_row(figure, f"{np.median(values):.3g}", f"{worst:.3g}")
    return table


def timed(work: Callable[[], Any], repeats: int = 3) -> tuple[float, float, Any]:
    """Least process time and wall time [s] of several calls, after a first call that compiles; and the result."""
    result = work()
    cpu, wall = [], []
    for _ in range(repeats):
        before = time.process_time(), time.perf_counter()
        result = work()
        cpu.append(time.process_time() - before[0])
        wall.append(time.perf_counter() - before[1])
    return min(cpu), min(wall), result


def speed() -> Table:
    """Time of every step on the shipped scenes."""
    table = Table(title="time, warm", title_justify="left")
    for heading in ("job", "target, two cores [s]", "process [s]", "wall [s]"):
        table.add_column(heading, justify="left" if heading == "job" else "right")

    def add(job: str, target: float, measured: tuple[float, float, Any]) -> Any:
        table.add_row(job, f"{target:g}", f"{measured[0]:.2f}", f"{measured[1]:.2f}")
        return measured[2]

    scene = parse_scene(shipped("drywall-mannequin"))
    hall = parse_scene(shipped("corridor"))
    sweep = add("simulate drywall 121x121x1001", 10, timed(lambda: mf.simulate(scene), 1))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    add("simulate corridor 81x81x901, 3 bounces", 30, timed(lambda: mf.simulate(hall, bounces=3), 1))
    volume: xr.DataArray = add("S11 -> volume 121x121x1001", 0.8, timed(lambda: focus_raster(sweep)))
    add("plan view", 0.5, timed(lambda: plan_view(volume)))
    view = see(volume)
    echoes = find_echoes(view)
    add("mirrors", 0.2, timed(lambda: find_mirrors(view, echoes)))
    settings = FoldSettings().completed(**usual_settings(view, echoes))
    found = find_tree(view, echoes, settings)
    x, y, z = np.linspace(-1.7, 0.7, 250), np.linspace(1.5, 3.9, 250), np.linspace(-1.0, 1.0, 160)
    margin = settings.wall_margin or 0.0
    blobs = owned_blobs(fold_back(found.tree), found.sight)
    add(
        "fold 10 million voxels",
        0.3,
        timed(lambda: draw(found.sight, margin, (x, y, z), blobs)),
    )
    cube = {"x": np.linspace(-1.2, 1.2, 256), "y": np.linspace(1.0, 4.0, 256), "z": np.linspace(-1.0, 1.0, 256)}
    add("spherical -> Cartesian, 17 million voxels", 0.6, timed(lambda: to_voxels(volume, **cube)))
    table.caption = f"largest memory of the process up to the first simulation: {memory:.2f} GB (target 1 GB)"
    return table


def simulator_error() -> float:
    """Largest error of the simulator's fast sum against the plain sum, relative to the largest sample."""
    content = shipped("drywall-mannequin")
    content["scanner"] |= {
        "azimuth": {"start": -2, "stop": 2, "points": 7},
        "elevation": {"start": -2, "stop": 2, "points": 5},
    }
    scene = parse_scene(content)
    echoes, _ = simulated_echoes(scene, bounces=1, seed=0, density=0.1)
    fast = measure(scene, echoes)
    from mirrorfold.common.beams import beam_direction

    azimuth, elevation = scene.scanner.angles
    frequency = scene.band.frequency
    width = echoes.width
    wave = np.exp(-4j * np.pi / speed_of_light * np.outer(frequency[::50], echoes.range))
    worst = 0.0
    for i, a in enumerate(azimuth):
        for j, e in enumerate(elevation):
            rho = np.linalg.norm(np.cross(echoes.position, beam_direction(a, e)), axis=1)
            weight = 2.0 / (np.pi * width**2) * np.exp(-2.0 * (rho / width) ** 2)
            worst = max(worst, np.abs(fast[::50, i, j] - wave @ (weight * echoes.amplitude)).max())
    return float(worst / np.abs(fast).max())


def plan_comparison() -> Table:
    """A table of the shipped drywall, folded in three dimensions, and its plan view, folded in two."""
    scene = parse_scene(shipped("drywall-mannequin"))
    volume = mf.focus(mf.simulate(scene, snr_db=SNR_DB))
    body = next(solid for solid in solids(scene) if scene.surface[solid.surface].name == "mannequin")
    footprint = cKDTree(body.vertices[:, :2])
    wall = next(surface for surface in scene.surface if surface.name == "drywall")
    table = Table(title="volume folded as it is, and its plan view folded in the floor plan", title_justify="left")
    for heading in ("", "mirror [deg]", "points", "to the body's plan, mean [cm]", "further than 15 cm [%]"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, image in (("volume", volume), ("plan view", plan_view(volume, pixel=0.01))):
        result = mf.fold(image)
        objects, mirrors = (result.children[group].to_dataset(inherit=False) for group in ("objects", "mirrors"))
        behind = (objects["bounces"].values > 0) & (objects["surface"].values == "object")
        points = np.stack([objects["x"].values, objects["y"].values], axis=-1)[behind]
        outside = footprint.query(points)[0] if len(points) else np.full(1, np.inf)
        angle = np.inf
        for i in range(mirrors.sizes["mirror"]):
            x, y = (float(mirrors[f"folded_{a}1"][i] - mirrors[f"folded_{a}0"][i]) for a in "xy")
            flat = np.array(wall.normal[:2]) / np.linalg.norm(wall.normal[:2])
            angle = min(angle, float(np.degrees(np.arcsin(abs(np.array([x, y]) @ flat) / np.hypot(x, y)))))
        table.add_row(name, f"{angle:.3f}", str(len(points)), f"{100 * outside.mean():.2f}",
                      f"{100 * np.mean(outside > 0.15):.1f}")  # fmt: skip
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10, help="scenes of each family")
    parser.add_argument("--family", nargs="*", choices=list(FAMILIES), default=list(FAMILIES))
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    arguments = parser.parse_args()
    console = Console(markup=False, width=110)
    console.print(speed())
    console.print(f"simulator against the plain sum: {simulator_error():.1e} of the largest sample (target 1e-4)")
    console.print(plan_comparison())
    everything = {}
    for name in arguments.family:
        everything[name] = run_family(name, arguments.seeds)
        console.print(family_table(name, everything[name]))
    if arguments.json:
        arguments.json.write_text(json.dumps(everything, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
