"""Errors of mirrors and of antennas: how far they move folded points, by the number of folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.geometry import reflect_each, segment_normal
from mirrorfold.common.types import Array
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.antennas import EFFECTS, antenna_errors
from mirrorfold.reproducing.parts.hall import (
    CHAINS,
    ELEMENTS,
    LABELS,
    PITCH,
    START,
    STOP,
    drawn,
    hall_scene,
    image_mirrors,
    unfolding,
)
from mirrorfold.reproducing.parts.pixels import pixels_within
from mirrorfold.reproducing.parts.spread import standard_error
from mirrorfold.reproducing.parts.stated import stated_errors
from mirrorfold.reproducing.parts.two_walls_family import VIEW
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.families import draw
from mirrorfold.scenes.floor_plan import Scene

ANGLE_DEG, OFFSET = 0.1, 1e-3
"""Standard deviations of the mirrors' errors [degree, m]: those of good fits to rough walls."""

KINDS = {"angle": (ANGLE_DEG, 0.0), "offset": (0.0, OFFSET)}
"""Standard deviations [degree, m] of the two kinds of errors: mirrors are turned, or moved along their normal."""

SPREADS = (20e-6, 50e-6, 100e-6, 150e-6)
"""Standard deviations of random errors of the antennas' positions, along each axis [m]."""

TRIALS = 2000
"""Number of random errors of the mirrors for each place of the target. These are folded by the formulas alone."""

ALLOWED = 0.01
"""Largest error of a folded point in the rule for a laboratory [m]: half a resolution width at -3 dB."""

FAMILIES = ("two walls", "three bounces")
"""Families of random scenes in which the errors that reconstructions state are judged."""


def run(work: Work) -> Findings:
    """Perturb given mirrors, then antennas; then compare the errors that reconstructions state with the true errors."""
    draws, scenes, families = work.size(16, 8), work.size(6, 1), work.size(FAMILIES, FAMILIES[:1])
    steps = 3 + len(families) * scenes
    moved = mirror_errors(range(draws))
    work.step(1, steps)
    folded, farthest = _folded_by_program(work)
    work.step(2, steps)
    antennas = antenna_errors(
        range(work.size(3, 1)), work.size(SPREADS, SPREADS[1:3]), elements=work.size(ELEMENTS, 81),
        trials=work.size(4, 1),
    )  # fmt: skip
    work.step(3, steps)
    stated: list[dict[str, list[float]]] = []
    for family in families:
        for number in range(scenes):
            scene = draw(family, 200 + number)
            assert isinstance(scene, Scene)
            array = scene.array
            scene = replace(scene, array=replace(array, elements=work.size(array.elements, 81)))
            sweep = work.sweep(scene, seed=number)
            pixels = work.size({}, pixels_within(sweep, VIEW[0], (0.0, VIEW[1])))
            stated.append(work.kept(partial(_stated, sweep, scene, pixels)))
            work.step(3 + len(stated), steps)
    merged = {name: np.concatenate([one[name] for one in stated]) for name in stated[0]}
    numbers = _numbers(moved, antennas, merged) | {"fold_program_over_formula": folded, "fold_difference_m": farthest}
    return Findings(
        claims=_claims(numbers),
        numbers=numbers,
        figures={
            "mirrors": (_mirror_figure(moved), "How far folded points are off when each mirror on the way is turned or "
                        "moved by independent errors: bars measured, black marks by propagation of errors."),
            "antennas": (_antenna_figure(antennas), "What random errors of the antennas' positions cost: level of a "
                         "point by the number of folds, and how far it moves; lines are predicted."),
        },
        data=xr.DataTree(children={"mirrors": xr.DataTree(moved), "antennas": xr.DataTree(antennas),
                                   "stated": xr.DataTree(_stated_data(merged))}),
        tables=(_mirror_table(moved), _rule(moved), _antenna_table(antennas), _stated_table(merged)),
        text=(
            "A mirror that is off by the distance o moves all that is seen in it by 2 o, and one that is turned by the "
            "angle a by 2 a l, with l the straight distance from where the wave meets the mirror to the target. "
            "Nothing amplifies: later folds are reflections and carry an error along as it is. Independent errors "
            "therefore add in the mean square, and grow with the root of the number of folds where the distances are "
            "alike. Errors that all mirrors share, as a face that is seen too deep inside each wall, may add up in "
            "full.",
            "Antennas that stand at random a little off cost level, not place: the coherent sum loses the factor "
            "exp(-(k s)^2), s the standard deviation along the line of sight, whatever the number of folds. What moves "
            "a point is what all positions share: a scale that is wrong, stages that are not parallel, a cable of "
            "unknown length. It moves a point in proportion to the whole way or not even that, and not to the folds; "
            "and mirrors found in the same image are moved alike. Where both stages are turned together, the whole "
            "folded scene is turned about the radar, and nothing else happens.",
            "The rule for a laboratory: mirrors to the angle and offset of the second table; positions along the line "
            "of sight to a twentieth of a wavelength, 0.05 mm at 295 GHz, for one decibel; and what is common to all "
            "positions to the fraction of the way by which points may be off.",
        ),
        assumptions=(
            "Points between two smooth mirrors, by rays and images, without noise. A mirror is turned about the point "
            "where the wave meets it. Mirror errors are independent from mirror to mirror: each image of a wall has "
            "speckle of its own.",
            f"Seeds: places of the target 0 to {draws - 1}; scenes of the families {' and '.join(families)}, of "
            f"rough walls and by rays, 200 to {199 + scenes}.",
        ),
    )  # fmt: skip


def perturbed(line: Array, pivot: Array, angle: Array | float, offset: Array | float) -> Array:
    """A mirror (2, 2) [m], turned by angles (...) [rad] about a point, and moved by offsets (...) [m] along its normal.

    Returns
    -------
    (..., 2, 2) array [m]
    """
    angle, offset = np.asarray(angle), np.asarray(offset)
    turn = np.moveaxis(np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]), (0, 1), (-2, -1))
    return np.asarray(pivot + (line - pivot) @ turn + offset[..., None, None] * segment_normal(*line))


def folded(place: Array, lines: Sequence[Array]) -> Array:
    """A place of the image, reflected at mirrors of the image (..., 2, 2) [m], at the last mirror first."""
    for line in reversed(lines):
        start, end = line[..., 0, :], line[..., 1, :]
        place = reflect_each(place, start, segment_normal(start, end))
    return place


def met(ghost: Array, line: Array) -> Array:
    """Where the line from the radar, at the origin, to a place of the image meets a mirror of the image [m]."""
    normal = segment_normal(*line)
    return np.asarray(ghost * float(line[0] @ normal) / float(ghost @ normal))


def mirror_errors(seeds: range) -> xr.Dataset:
    """Errors of folded targets, (draw, kind, folds) [m]: by the formulas with random mirror errors, and propagated."""
    random = np.random.default_rng(seeds.start)
    measured, predicted, lever = (np.zeros((len(seeds), len(KINDS), len(CHAINS) - 1)) for _ in range(3))
    for row, seed in enumerate(seeds):
        mirrors, target = drawn(seed)
        lines = image_mirrors(mirrors)
        for folds in range(1, len(CHAINS)):
            ghost = unfolding(mirrors, CHAINS[folds]).inverse(target)
            pivots = [met(ghost, line) for line in lines[:folds]]
            # At each mirror, the ghost has been folded by the deeper mirrors before.
            shown = [folded(ghost, list(lines[before:folds])) for before in range(1, folds + 1)]
            ways = np.linalg.norm(np.array(shown) - np.array(pivots), axis=1)
            for column, (angle, offset) in enumerate(KINDS.values()):
                errors = random.standard_normal((folds, TRIALS, 2)) * (np.radians(angle), offset)
                given = [perturbed(line, pivot, error[:, 0], error[:, 1])
                         for line, pivot, error in zip(lines[:folds], pivots, errors, strict=True)]  # fmt: skip
                places = folded(ghost, given)
                measured[row, column, folds - 1] = np.sqrt(np.mean(np.sum((places - target) ** 2, axis=1)))
                predicted[row, column, folds - 1] = 2.0 * np.sqrt(np.sum((np.radians(angle) * ways) ** 2 + offset**2))
                lever[row, column, folds - 1] = np.sqrt(np.mean(ways**2))
    dims = ("draw", "kind", "folds")
    return xr.Dataset(
        {
            "measured": (dims, measured, {"units": "m"}),
            "propagated": (dims, predicted, {"units": "m"}),
            "way": (dims, lever, {"units": "m"}),
        },
        {"kind": list(KINDS), "folds": np.arange(1, len(CHAINS)), "draw": np.array(seeds)},
        {"angle_error_deg": ANGLE_DEG, "offset_error_m": OFFSET, "trials": TRIALS},
    )


def _folded_by_program(work: Work) -> tuple[float, float]:
    """The first draw, folded by `FoldPlan` about perturbed mirrors: error over that of the formulas, and largest
    distance of a folded echo from where the formulas put it [m].
    """
    mirrors, target = drawn(0)
    scene = hall_scene(mirrors, target, elements=work.size(161, 101), points=work.size(401, 281))
    sweep = work.sweep(scene, bounces=len(CHAINS) - 1)
    image = mf.focus(sweep, x=np.arange(-0.6, 1.9, 4e-3), y=np.arange(0.3, 2.4, 4e-3))
    plan, lines, random = FoldPlan(image), image_mirrors(mirrors), np.random.default_rng(1)

    def places(given: Array, chosen: dict[str, tuple[float, float]] | None) -> dict[str, tuple[Array, Array]]:
        """Places before and after folding of the echo of each chain nearest to the target's ghost, or to `chosen`."""
        points = plan.fold(mirrors=given).children["objects"].to_dataset(inherit=False)
        initial = np.column_stack([points["x_initial"], points["y_initial"]])
        found = {}
        for folds in range(1, len(CHAINS)):
            chain = "/".join("0" * folds)
            ghost = unfolding(mirrors, CHAINS[folds]).inverse(target) if chosen is None else chosen[chain]
            own = np.flatnonzero(points["chain"].values == chain)
            nearest = own[np.argmin(np.linalg.norm(initial[own] - ghost, axis=1))]
            found[chain] = initial[nearest], np.array([points["x"][nearest], points["y"][nearest]])
        return found

    before = places(lines, None)
    known = {chain: (float(at[0]), float(at[1])) for chain, (at, _) in before.items()}
    moved, expected, farthest = [], [], 0.0
    for _ in range(work.size(30, 2)):
        errors = random.standard_normal((len(lines), 2)) * (np.radians(ANGLE_DEG), OFFSET)
        ghost = unfolding(mirrors, CHAINS[-1]).inverse(target)
        given = np.stack([perturbed(line, met(ghost, line), *error) for line, error in zip(lines, errors, strict=True)])
        after = places(given, known)
        for folds, chain in enumerate(before, 1):
            at, true = before[chain]
            formula = folded(at, list(given[:folds]))
            farthest = max(farthest, float(np.linalg.norm(after[chain][1] - formula)))
            moved.append(float(np.sum((after[chain][1] - true) ** 2)))
            expected.append(float(np.sum((formula - true) ** 2)))
    return float(np.sqrt(np.sum(moved) / np.sum(expected))), farthest


def _stated(sweep: xr.Dataset, scene: Scene, pixels: dict[str, Any]) -> dict[str, list[float]]:
    """The errors of the reconstruction of a sweep, over the standard errors that it states."""
    return stated_errors(mf.reconstruct(sweep, **pixels), scene)


def _numbers(moved: xr.Dataset, antennas: xr.Dataset, stated: dict[str, Array]) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for kind in KINDS:
        for folds in range(1, len(CHAINS)):
            one = moved.sel(kind=kind, folds=folds)
            numbers[f"{kind}_{folds}_m"] = float(np.sqrt((one["measured"] ** 2).mean()))
            numbers[f"{kind}_{folds}_over_propagated"] = float((one["measured"] / one["propagated"]).mean())
    loss = antennas["level_db"].sel(effect="random").mean(("draw", "trial"))
    for i, spread in enumerate(antennas["spread"].values):
        numbers[f"level_{1e6 * spread:.0f}_um_db"] = float(loss.isel(spread=i).mean())
        numbers[f"level_{1e6 * spread:.0f}_um_predicted_db"] = float(_level_db(spread))
        numbers[f"level_{1e6 * spread:.0f}_um_between_folds_db"] = float(np.ptp(loss.isel(spread=i).values))
    for name in EFFECTS:
        if name != "random":
            one = antennas.sel(effect=name).isel(spread=0, trial=0)
            numbers[f"{name}_over_predicted"] = float((one["shift"] / one["predicted"]).mean())
    for name, values in stated.items():
        numbers[f"stated_{name}_rms"] = float(np.sqrt(np.mean(values**2))) if values.size else float("nan")
        numbers[f"stated_{name}_within_two"] = float(np.mean(np.abs(values) < 2.0)) if values.size else float("nan")
        numbers[f"stated_{name}_count"] = float(values.size)
    return numbers


def _level_db(spread: Any) -> Any:
    """Mean level [dB] that a point loses by random errors [m] of all antennas along the line of sight."""
    return -20.0 / np.log(10.0) * (np.pi * (START + STOP) / speed_of_light * np.asarray(spread)) ** 2


def _claims(numbers: dict[str, float]) -> tuple[Claim, ...]:
    ratios = [value for name, value in numbers.items() if name.endswith("_over_propagated")]
    return (
        Claim(
            claim="How do errors of the mirrors grow with the folds?",
            source="",
            measured=f"mirrors off by {ANGLE_DEG:g} degree move points by "
            + ", ".join(f"{1e3 * numbers[f'angle_{n}_m']:.1f}" for n in range(1, len(CHAINS)))
            + f" mm, mirrors off by {1e3 * OFFSET:g} mm by "
            + ", ".join(f"{1e3 * numbers[f'offset_{n}_m']:.1f}" for n in range(1, len(CHAINS)))
            + " mm, for one, two and three folds (root mean square)",
            verdict="new",
            why="2 a l and 2 o for each mirror on the way, added in the mean square; measured over propagated "
            f"{min(ratios):.2f} to {max(ratios):.2f}. The program folds as the formulas do, to "
            f"{1e9 * numbers['fold_difference_m']:.1f} nm.",
        ),
        Claim(
            claim="How exactly must the antennas be placed?",
            source="",
            measured=f"random errors of 0.05 mm cost {-numbers['level_50_um_db']:.1f} dB, of 0.1 mm "
            f"{-numbers['level_100_um_db']:.1f} dB, at any number of folds (they differ by "
            f"{numbers['level_100_um_between_folds_db']:.1f} dB)",
            verdict="new",
            why=f"exp(-(k s)^2) predicts {-numbers['level_50_um_predicted_db']:.1f} and "
            f"{-numbers['level_100_um_predicted_db']:.1f} dB, s along the line of sight.",
        ),
        Claim(
            claim="Are the standard errors true that a reconstruction states?",
            source="",
            measured=f"over their standard errors, angles of mirrors are off by {numbers['stated_angle_rms']:.1f}, "
            f"their offsets by {numbers['stated_offset_rms']:.1f}, folded points by {numbers['stated_points_rms']:.1f} "
            "(root mean square)",
            verdict="new",
            why="One would be exact. Above it, the stated errors are too small; below, too large.",
        ),
    )


def _mirror_table(moved: xr.Dataset) -> Table:
    rows = []
    for kind, (angle, offset) in KINDS.items():
        for folds in range(1, len(CHAINS)):
            one = moved.sel(kind=kind, folds=folds)
            ratio = (one["measured"] / one["propagated"]).values
            rows.append([
                f"{angle:g} degree" if angle else f"{1e3 * offset:g} mm", LABELS[folds],
                f"{float(np.sqrt((one['way'] ** 2).mean())):.2f}",
                f"{1e3 * float(one['measured'].mean()):.2f} +- {1e3 * standard_error(one['measured'].values):.2f}",
                f"{1e3 * float(one['propagated'].mean()):.2f}",
                f"{ratio.mean():.3f} +- {standard_error(ratio):.3f}",
            ])  # fmt: skip
    columns = ["error of each mirror", "folds", "from mirror to target [m]", "points are off [mm]",
               "propagated [mm]", "ratio"]  # fmt: skip
    return Table(title="Errors of mirrors", columns=columns, rows=rows)


def _rule(moved: xr.Dataset) -> Table:
    """The errors of mirrors that move points by `ALLOWED`, if angle and offset have equal shares in the mean square."""
    part = ALLOWED / np.sqrt(2.0)
    rows = [
        [LABELS[n], f"{np.degrees(part / (2.0 * np.sqrt(n))):.2f}", f"{1e3 * part / (2.0 * np.sqrt(n)):.1f}"]
        for n in range(1, len(CHAINS))
    ]
    columns = ["folds", "angle, for 1 m from mirror to target [degree]", "offset [mm]"]
    return Table(title=f"How exact mirrors must be for points off by {1e3 * ALLOWED:g} mm", columns=columns, rows=rows)


def _antenna_table(antennas: xr.Dataset) -> Table:
    rows = []
    for i, spread in enumerate(antennas["spread"].values):
        one = antennas.sel(effect="random").isel(spread=i)
        level = one["level_db"].mean(("draw", "trial")).values
        shift, predicted = (np.sqrt((one[name] ** 2).mean(("draw", "trial")).values) for name in ("shift", "predicted"))
        rows.append([f"random, {1e6 * spread:.0f} um", ", ".join(f"{value:.1f}" for value in level),
                     f"{float(_level_db(spread)):.1f}", ", ".join(f"{1e3 * value:.2f}" for value in shift),
                     ", ".join(f"{1e3 * value:.2f}" for value in predicted)])  # fmt: skip
    for name, what in EFFECTS.items():
        if name != "random":
            one = antennas.sel(effect=name).isel(spread=0, trial=0).mean("draw")
            rows.append([what, ", ".join(f"{value:.1f}" for value in one["level_db"].values), "0.0",
                         ", ".join(f"{1e3 * value:.2f}" for value in one["shift"].values),
                         ", ".join(f"{1e3 * value:.2f}" for value in one["predicted"].values)])  # fmt: skip
    columns = ["error", "level for 0, 1, 2, 3 folds [dB]", "predicted", "points are off, for 0, 1, 2, 3 folds [mm]",
               "predicted"]  # fmt: skip
    return Table(title="Errors of antennas", columns=columns, rows=rows)


def _stated_table(stated: dict[str, Array]) -> Table:
    rows = [[name, str(values.size), f"{np.sqrt(np.mean(values**2)):.2f}" if values.size else "-",
             f"{np.mean(np.abs(values) < 1.0):.2f}" if values.size else "-",
             f"{np.mean(np.abs(values) < 2.0):.2f}" if values.size else "-"]
            for name, values in stated.items()]  # fmt: skip
    columns = ["what", "how many", "root mean square", "share within one (0.68)", "share within two (0.95)"]
    return Table(title="Errors over the standard errors that reconstructions state", columns=columns, rows=rows)


def _stated_data(stated: dict[str, Array]) -> xr.Dataset:
    return xr.Dataset({name: (f"{name}_number", values, {"units": "1"}) for name, values in stated.items()})


def _mirror_figure(moved: xr.Dataset) -> Figure:
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    titles = {"angle": f"mirrors turned by {ANGLE_DEG:g} degree", "offset": f"mirrors moved by {1e3 * OFFSET:g} mm"}
    for axes, kind in zip(panels, KINDS, strict=True):
        one = 1e3 * moved.sel(kind=kind)
        axes.bar(one["folds"], one["measured"].mean("draw"), yerr=one["measured"].std("draw"), width=0.6,
                 color="tab:blue", capsize=4, label="measured, and its spread over places")  # fmt: skip
        axes.plot(one["folds"], one["propagated"].mean("draw"), "k_", markersize=26, label="propagated")
        axes.set(title=titles[kind], xlabel="folds", xticks=range(1, len(CHAINS)))
    panels[0].set_ylabel("points are off, r.m.s. [mm]")
    panels[0].legend(fontsize=8, loc="upper left")
    return figure


def _antenna_figure(antennas: xr.Dataset) -> Figure:
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    one = antennas.sel(effect="random")
    micrometres = 1e6 * antennas["spread"].values
    for folds, marker in enumerate("os^D"):
        level = one["level_db"].isel(folds=folds)
        left.errorbar(micrometres + 1.5 * (folds - 1.5), level.mean(("draw", "trial")), level.std(("draw", "trial")),
                      fmt=marker, markersize=4, capsize=2, label=LABELS[folds])  # fmt: skip
        shift = np.sqrt((one["shift"].isel(folds=folds) ** 2).mean(("draw", "trial")))
        expected = np.sqrt((one["predicted"].isel(folds=folds) ** 2).mean(("draw", "trial")))
        (drawn_line,) = right.plot(micrometres, 1e3 * shift, marker, markersize=4, label=LABELS[folds])
        right.plot(micrometres, 1e3 * expected, "-", color=drawn_line.get_color(), linewidth=0.8)
    fine = np.linspace(0.0, micrometres[-1], 100)
    left.plot(fine, _level_db(1e-6 * fine), "k-", linewidth=0.8, label="exp(-(k s)^2)")
    left.set(xlabel="random error of each position [um]", ylabel="level of the point [dB]")
    right.set(xlabel="random error of each position [um]", ylabel="the point is off, r.m.s. [mm]", ylim=(0.0, None))
    left.legend(fontsize=8)
    right.legend(fontsize=8)
    figure.suptitle(f"two stages of {antennas.attrs['elements']} positions, {1e3 * PITCH:g} mm apart")
    return figure
