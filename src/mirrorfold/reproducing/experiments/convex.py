"""A pillar as a mirror: what it adds to the field of view, what it costs in resolution and level, and how it folds.

A convex mirror spreads a pencil of rays. It therefore shows more degrees of the room than a flat mirror of its width,
but its ghosts are weaker and their resolution cells wider. Both costs are measured by a point that pillars of several
radii show, and compared with the predicted width of the pencil. Random scenes then test whether a pillar is found from
the sweep alone, and whether what it shows is folded to its true place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.optimize import minimize_scalar

import mirrorfold as mf
from mirrorfold.common.decibels import to_db
from mirrorfold.common.geometry import reflect, unit
from mirrorfold.common.types import Array
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.hall import ELEMENTS, PITCH, RADIUS, START, STOP
from mirrorfold.reproducing.parts.pixels import pixels_within
from mirrorfold.reproducing.parts.point_image import PointImage
from mirrorfold.reproducing.parts.scenes import plan_scene, random_scenes, shipped_plan
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.families import draw
from mirrorfold.scenes.surfaces import surface_named

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

HIT, INCIDENCE, REST = np.array([0.45, 1.35]), np.radians(40.0), 1.0
"""Place at which the path to the point meets the mirror [m], angle of incidence there [rad], and length of the path
from the mirror to the point [m]."""

GRAZING = np.radians(80.0)
"""Largest angle of incidence at which a pillar counts as a mirror [rad]: everything that it shows at larger angles is
squeezed into a hundredth of its view."""

ASIDE = 0.025
"""Distance by which the point is moved to either side, perpendicular to the last leg of the path [m]."""

REACH = 0.09
"""Half the side of the image around the ghost [m]: three cells."""

CLOSE = 0.05
"""Largest relative difference at which a measured number agrees with the predicted one."""

QUICK_VIEW = (-1.3, 1.8), (0.3, 3.3)
"""First and last x and y [m] of the pixels of a quick run, which hold its scene and what the pillar shows."""

EXAMPLE = 0.2
"""Radius of the pillar that the claims are about [m]."""


def run(work: Work) -> Findings:
    """Measure one point in pillars of several radii; then fold random scenes whose objects only a pillar shows."""
    radii = work.size((0.05, 0.1, 0.2, 0.4, 0.8, np.inf), (EXAMPLE, np.inf))
    seeds = work.size(tuple(range(20, 30)), (21,))
    total, rows = len(radii) + len(seeds) + 1, []
    for number, radius in enumerate(radii):
        rows.append(_measured(work, radius, points=work.size(401, 281)))
        work.step(number + 1, total)
    data = xr.Dataset(
        {name: ("radius", [row[name] for row in rows], {"units": _unit(name)}) for name in rows[0]},
        {"radius": ("radius", [float(radius) for radius in radii], {"units": "m"})},
        {"simulator": "rays", "elements": ELEMENTS, "pitch_m": PITCH, "start_hz": START, "stop_hz": STOP},
    )
    data["level_db"] = data["level_db"] - data["level_db"].sel(radius=np.inf)  # relative to a flat mirror in its place
    data["level_db"].attrs["units"] = "dB"
    scene_scores = []
    for number, seed in enumerate(seeds):
        scene: Any = draw("pillar", seed)
        sweep = work.sweep(scene, solver="rays", seed=seed)
        if work.quick:  # which shows a scene that is scored
            folded = _folded(sweep, pixels_within(sweep, *QUICK_VIEW))
            scene_scores.append(_hidden_scores(scene, folded))
        else:
            scene_scores.append(work.kept(lambda: _hidden_scores(scene, _folded(sweep, {}))))  # noqa: B023
        work.step(len(radii) + number + 1, total)
    for name in scene_scores[0]:
        data[name] = "scene", [one[name] for one in scene_scores], {"units": "1"}
    data["scene"] = "scene", list(seeds), {"long_name": "seed of the family"}
    shown: Any = scene if work.quick else shipped_plan("pillar")
    example = folded["curved"] if work.quick else work.reconstruction(shown)
    work.step(total, total)
    numbers = _numbers(data)
    return Findings(
        claims=_claims(numbers, len(seeds)),
        numbers=numbers,
        figures={
            "before-after": (mf.plot.before_after(example, shown), "What a screen hides, the pillar shows, small. "
                             "Left the image, right what is folded by the arc that was found."),
            "view": (_view_figure(), f"What a pillar of radius {EXAMPLE:g} m shows of the room: rays from the array, "
                     "up to 80 degrees of incidence."),
            "cost": (_cost_figure(data), "What a convex mirror costs: how much wider the resolution cell is than that "
                     "of a flat mirror in its place, and how much weaker the echo. Lines are predicted."),
        },
        data=data,
        tables=(_table(data),),
        text=(
            "A pencil of rays that meets a convex mirror of radius R after r1, at the angle of incidence i, and goes "
            "on for s, is as wide for each radian as q = r1 + s + 2 r1 s / (R cos i). A flat mirror leaves r1 + s. So "
            "the cell across the last leg grows by q / (r1 + s), and the amplitude falls by as much, there and back "
            "together. Depth is as sharp as before. What is weaker still, and a little wider, is out of focus: the "
            "waves of the ghost are bent more than those of a thing at its range.",
            "The growth was measured without that formula: the point was moved aside by 25 mm to either side, and its "
            "ghost in the image moved by so much less.",
            "A pillar is a small thing that shows nearly the whole room. It is found as a curved row of echoes, and "
            "counts as a mirror only for what is seen behind it; without curved mirrors it is an object, and what it "
            "shows stays hidden.",
        ),
        assumptions=(
            "The publication folds about flat walls. Array and band are those of its simulations. For resolution and "
            "level the pillar is smooth and the point a circle of 1 mm radius; in the random scenes all is rough.",
            f"The random scenes are of the family 'pillar' of mirrorfold benchmark, seeds {seeds[0]} to {seeds[-1]}, "
            "on which nothing was tuned.",
        ),
    )  # fmt: skip


def _target() -> Array:
    """Place of the point, (2,) [m]."""
    return HIT + REST * _outgoing()


def _normal() -> Array:
    """Unit normal of the mirror at `HIT`, on the side of the radar and the point."""
    way = unit(HIT)
    turn = np.array([[np.cos(INCIDENCE), np.sin(INCIDENCE)], [-np.sin(INCIDENCE), np.cos(INCIDENCE)]])
    return np.asarray(-turn @ way)


def _outgoing() -> Array:
    """Unit vector along the last leg of the path, from the mirror to the point."""
    return reflect(unit(HIT), 0.0, _normal())


def _scene(radius: float, target: Array, *, points: int) -> Scene:
    """A smooth mirror and the point. The mirror is a circle, or a straight wall if the radius is infinite."""
    mirror: dict[str, Any] = {
        "name": "pillar",
        "kind": "circle",
        "center": (HIT - radius * _normal()).tolist(),
        "radius": radius,
    }
    if np.isinf(radius):
        along = np.array([-_normal()[1], _normal()[0]])
        mirror = {
            "name": "wall",
            "kind": "segment",
            "start": (HIT - 0.4 * along).tolist(),
            "end": (HIT + 0.4 * along).tolist(),
        }
    return plan_scene(
        {
            "name": "a point seen in a pillar",
            "array": {"elements": ELEMENTS, "pitch": PITCH},
            "band": {"start": START, "stop": STOP, "points": points},
            "surface": [mirror, {"name": "point", "kind": "circle", "center": target.tolist(), "radius": RADIUS}],
        }
    )


def _ghost(radius: float, target: Array) -> tuple[Array, Array]:
    """Ghost of the near side of the point, and the place where the shortest path meets the mirror, (2,) [m] each."""
    normal = _normal()
    along = np.array([-normal[1], normal[0]])

    def met(step: float) -> Array:
        if np.isinf(radius):
            return np.asarray(HIT + step * along)
        turn = step / radius
        return np.asarray(HIT + radius * (np.sin(turn) * along + (np.cos(turn) - 1.0) * normal))

    def length(step: float) -> float:
        return float(np.linalg.norm(met(step)) + np.linalg.norm(target - met(step)))

    reach = 0.3 * min(radius, 1.0)
    found = minimize_scalar(length, bounds=(-reach, reach), method="bounded", options={"xatol": 1e-9})
    return (found.fun - RADIUS) * unit(met(found.x)), met(found.x)


def _measured(work: Work, radius: float, *, points: int) -> dict[str, float]:
    """Growth of the cell, width, level and place of the point's ghost in one mirror."""
    middle, leaving = _target(), _outgoing()
    across = np.array([-leaving[1], leaving[0]])
    ghosts, images = [], []
    for side in (0.0, 1.0, -1.0):
        target = middle + side * ASIDE * across
        ghosts.append(_ghost(radius, target)[0])
        sweep = work.sweep(_scene(radius, target, points=points), bounces=1)
        images.append(PointImage(sweep, ghosts[-1], REACH))
    centre, way = images[0], float(np.linalg.norm(ghosts[0]))
    aside = np.array([-ghosts[0][1], ghosts[0][0]]) / way
    moved = float(np.linalg.norm(unit(images[1].top) - unit(images[2].top))) * way
    growth = pencil(radius)
    seen, shown = view_of(radius) if np.isfinite(radius) else (0.0, 0.0)
    return {
        "growth": 2.0 * ASIDE / moved,
        "growth_predicted": float(growth),
        "cross_width_m": centre.width(aside) * 2.0 * ASIDE / moved,
        "level_db": float(to_db(np.sqrt(centre.at(centre.top)))),
        "ghost_error_m": float(np.linalg.norm(centre.top - ghosts[0])),
        "seen_deg": seen,
        "shown_deg": shown,
    }


def pencil(radius: Array | float) -> Array:
    """Width of a pencil of rays at the point, over that after a flat mirror: ``1 + 2 r1 s / (R cos i (r1 + s))``."""
    before = float(np.linalg.norm(HIT))
    return np.asarray(1.0 + 2.0 * before * REST / (np.asarray(radius) * np.cos(INCIDENCE) * (before + REST)))


def fan(radius: float, count: int) -> tuple[Array, Array, Array]:
    """Rays from the middle of the array that a pillar reflects, up to the angle of incidence `GRAZING`.

    Returns
    -------
    hit, way, out : (rays, 2) arrays
        Where the rays meet the pillar [m], and their directions before and after.
    """
    center = HIT - radius * _normal()
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, count) + np.arctan2(*-center[::-1])
    normal = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    hit = center + radius * normal
    way = hit / np.linalg.norm(hit, axis=1)[:, None]
    cosine = -np.sum(way * normal, axis=1)
    met = cosine >= np.cos(GRAZING)
    return hit[met], way[met], (way + 2.0 * cosine[:, None] * normal)[met]


def view_of(radius: float, count: int = 20001) -> tuple[float, float]:
    """Angles [degree] that a pillar fills as the array sees it, and that it shows of the room, up to `GRAZING`."""
    _, *ways = fan(radius, count)
    seen, shown = (np.degrees(np.ptp(np.unwrap(np.arctan2(way[:, 1], way[:, 0])))) for way in ways)
    return float(seen), float(shown)


def _folded(sweep: xr.Dataset, pixels: dict[str, Any]) -> dict[str, xr.DataTree]:
    """Reconstructions with and without a search for curved mirrors; without `pixels`, from the sweep alone."""
    plan = FoldPlan(mf.focus(sweep, **pixels, tolerance=1e-3), sweep=sweep)
    return {name: plan.fold(curved=curved) for name, curved in (("curved", True), ("flat", False))}


def _hidden_scores(scene: Scene, reconstructions: dict[str, xr.DataTree]) -> dict[str, float]:
    """Hidden F-scores with and without curved mirrors, and the error of the pillar's curvature."""
    pillar = surface_named(scene, "pillar")
    found = {
        f"{name}_f_cells": float(mf.score(folded, scene).hidden.f_score_cells or 0.0)
        for name, folded in reconstructions.items()
    }
    bend = np.asarray(reconstructions["curved"]["mirrors"].dataset.get("curvature", np.zeros(1)))
    return {**found, "curvature_error": float(np.abs(bend * pillar.radius - 1.0).min())}


def _unit(name: str) -> str:
    return {"deg": "degree", "db": "dB", "m": "m"}.get(name.rsplit("_", 1)[-1], "1")


def _numbers(data: xr.Dataset) -> dict[str, float]:
    """The numbers that the claims rest on."""
    example, round_ = data.sel(radius=EXAMPLE), data.isel(radius=np.isfinite(data["radius"].values))
    flat = data.sel(radius=np.inf)
    return {
        "seen_deg": float(example["seen_deg"]),
        "shown_deg": float(example["shown_deg"]),
        "growth": float(example["growth"]),
        "growth_of_a_flat_mirror": float(flat["growth"]),
        "growth_off_most": float(np.abs(data["growth"] / data["growth_predicted"] - 1.0).max()),
        "cross_width_m": float(example["cross_width_m"]),
        "cross_width_flat_m": float(flat["cross_width_m"]),
        "level_db": float(example["level_db"]),
        "level_off_most_db": float(np.abs(round_["level_db"] + to_db(round_["growth_predicted"].values)).max()),
        "ghost_error_largest_m": float(data["ghost_error_m"].max()),
        "f_cells_curved": float(data["curved_f_cells"].mean()),
        "f_cells_curved_least": float(data["curved_f_cells"].min()),
        "f_cells_flat": float(data["flat_f_cells"].mean()),
        "curvature_error_largest": float(data["curvature_error"].max()),
    }


def _claims(numbers: dict[str, float], scenes: int) -> tuple[Claim, ...]:
    """Claims on the view that is gained, the resolution and level that are lost, and the folded scenes."""
    gained, off = numbers["shown_deg"] / numbers["seen_deg"], numbers["growth_off_most"]
    return (
        Claim(
            claim="A convex mirror shows more of the room than a flat one.",
            source="The remark on curved walls",
            measured=f"a pillar of {1e2 * EXAMPLE:g} cm radius, seen over {numbers['seen_deg']:.0f} degrees, shows "
            f"{numbers['shown_deg']:.0f}, {gained:.0f} times what a flat mirror of that width would",
            verdict="agrees" if gained > 1.0 else "differs",
            why="Rays from the middle of the array, up to an incidence of 80 degrees. A flat mirror shows as many "
            "degrees as it is seen over.",
        ),
        Claim(
            claim="It does so at the cost of resolution.",
            source="The remark on curved walls",
            measured=f"the cell across is {numbers['growth']:.1f} times as wide, {1e2 * numbers['cross_width_m']:.0f} "
            f"cm instead of {1e2 * numbers['cross_width_flat_m']:.1f}; all radii within {1e2 * off:.1f} % of the "
            "prediction",
            verdict="agrees" if numbers["growth"] > 1.0 and off < CLOSE else "differs",
            why="Measured by moving a point 1 m behind the reflection; predicted by the width of a pencil of rays. It "
            f"agrees within {1e2 * CLOSE:g} %.",
        ),
        Claim(
            claim="And of level?",
            source="",
            measured=f"{numbers['level_db']:.1f} dB at {1e2 * EXAMPLE:g} cm; all radii within "
            f"{numbers['level_off_most_db']:.1f} dB of one over the growth",
            verdict="new",
            why="The peak of the point's ghost against that in a flat mirror in its place: the power spreads over the "
            "wider pencil there and back.",
        ),
        Claim(
            claim="Does a pillar that nobody knows of show what is hidden?",
            source="",
            measured=f"hidden F-score within 1.5 grown cells {numbers['f_cells_curved']:.2f} in the mean over "
            f"{random_scenes(scenes)}, {numbers['f_cells_curved_least']:.2f} at least; without curved mirrors "
            f"{numbers['f_cells_flat']:.2f}",
            verdict="new",
            why="From the sweep alone. In these scenes nothing but the pillar shows what is hidden.",
        ),
    )


def _table(data: xr.Dataset) -> Table:
    """One row for each radius."""
    rows = []
    for radius in data["radius"].values:
        one = data.sel(radius=radius)
        flat = bool(np.isinf(radius))
        rows.append(
            [
                "flat" if flat else f"{1e2 * radius:g}",
                "" if flat else f"{float(one['seen_deg']):.1f}",
                "" if flat else f"{float(one['shown_deg']):.0f}",
                f"{float(one['growth']):.2f}",
                f"{float(one['growth_predicted']):.2f}",
                f"{1e2 * float(one['cross_width_m']):.1f}",
                f"{float(one['level_db']):.1f}",
                f"{-float(to_db(one['growth_predicted'].values)):.1f}",
                f"{1e3 * float(one['ghost_error_m']):.1f}",
            ]
        )
    columns = ["radius [cm]", "seen over [degree]", "shows [degree]", "growth", "predicted", "width across [cm]",
               "level [dB]", "predicted [dB]", "ghost off [mm]"]  # fmt: skip
    return Table(
        title="A point 1 m behind the reflection, seen in pillars and in a flat mirror", columns=columns, rows=rows
    )


def _view_figure() -> Figure:
    """Rays from the array to the pillar, and on after their reflection."""
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.subplots()
    center = HIT - EXAMPLE * _normal()
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.fill(*(center + EXAMPLE * np.stack([np.cos(turn), np.sin(turn)], axis=1)).T, color="0.75")
    for hit, _, out in zip(*fan(EXAMPLE, 41), strict=True):
        axes.plot(*np.stack([np.zeros(2), hit]).T, color="#0072B2", linewidth=0.6)
        axes.plot(*np.stack([hit, hit + 1.2 * out]).T, color="#D55E00", linewidth=0.6)
    axes.plot([-0.5 * ELEMENTS * PITCH, 0.5 * ELEMENTS * PITCH], [0.0, 0.0], "k", linewidth=3.0)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return figure


def _cost_figure(data: xr.Dataset) -> Figure:
    """Growth and level against the radius."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    panels = figure.subplots(1, 2)
    round_ = data.isel(radius=np.isfinite(data["radius"].values))
    radius = np.geomspace(float(round_["radius"].min()) / 1.3, float(round_["radius"].max()) * 1.3, 100)
    for axes, name, line, label in (
        (panels[0], "growth", pencil(radius), "growth of the cell across"),
        (panels[1], "level_db", -to_db(pencil(radius)), "level over a flat mirror's [dB]"),
    ):
        axes.semilogx(1e2 * radius, line, "k-", linewidth=0.8, label="predicted")
        axes.semilogx(1e2 * round_["radius"], round_[name], "o", color="#D55E00", label="measured")
        axes.set(xlabel="radius of the pillar [cm]", ylabel=label)
        axes.set_xticks(1e2 * round_["radius"].values, [f"{1e2 * one:g}" for one in round_["radius"].values])
        axes.minorticks_off()
        axes.legend(fontsize=8)
    return figure
