"""Resolution: how wide the image of a point is, in line of sight and after one to three folds, and where it stands.

A point between two mirrors is imaged by way of none to three mirrors. Its widths at -3 dB in range and cross-range are
compared with ``c / 2B`` and ``lambda r / D``, times the factors of the windows, with r the length of the whole path.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from mirrorfold.common.decibels import to_db
from mirrorfold.common.types import Array
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.hall import (
    CHAINS,
    ELEMENTS,
    LABELS,
    PITCH,
    RADIUS,
    START,
    STOP,
    drawn,
    hall_scene,
    unfolding,
)
from mirrorfold.reproducing.parts.point_image import PointImage
from mirrorfold.reproducing.parts.spread import standard_error
from mirrorfold.reproducing.work import Work

HALF = 3.2
"""Half the side of the image around each point, in predicted widths."""

UNIFORM = 0.886
"""Full width of ``sinc(x)`` at -3 dB, in units of x: range width for a band without a taper, over ``c / 2B``."""

HANN = 1.441
"""The same for the transform of a Hann window. The taper widens echoes in range, but lowers side lobes to -31 dB."""

BOTH_WAYS = 0.638
"""The same for ``sinc(x)^2``: the same uniform array focuses on the way out and on the way back."""

CENTIMETRES = 0.05
"""Largest width that counts as a resolution on the scale of centimetres [m]."""

CLOSE = 0.05
"""Largest relative difference at which a measured width agrees with the predicted one."""


def run(work: Work) -> Findings:
    """Image points at random places between two mirrors at random angles, by way of none to three mirrors."""
    draws, elements = work.size(16, 2), work.size(ELEMENTS, 101)
    found: list[list[dict[str, float]]] = []
    shown: list[tuple[Array, Array]] = []
    for seed in range(draws):
        mirrors, target = drawn(seed)
        scene = hall_scene(mirrors, target, elements=elements, points=work.size(401, 281))
        sweep = work.sweep(scene, bounces=len(CHAINS) - 1)
        seen = [_measured(sweep, mirrors, target, chain) for chain in CHAINS]
        found.append([numbers for numbers, _ in seen])
        if seed == 0:
            shown = [picture for _, picture in seen]
        work.step(seed + 1, draws)
    names = list(found[0][0])
    values = np.array([[[one[name] for name in names] for one in draw] for draw in found])
    data = xr.Dataset(
        {name: (("draw", "bounces"), values[..., i], {"units": _unit(name)}) for i, name in enumerate(names)},
        {"bounces": np.arange(len(CHAINS)), "draw": np.arange(draws)},
        {"simulator": "rays", "elements": elements, "pitch_m": PITCH, "start_hz": START, "stop_hz": STOP},
    )
    numbers = _numbers(data)
    return Findings(
        claims=_claims(numbers, draws),
        numbers=numbers,
        figures={
            "points": (_points_figure(shown, found[0]), "The image about the target in the first draw, unfolded by the "
                       "mirrors: the same point in line of sight and by way of one to three of them. Contours at "
                       "-3 dB; white crosses where the target stands."),
            "widths": (_widths_figure(data), "Measured widths at -3 dB against the length of the way, over all draws; "
                       "lines are predicted."),
        },
        data=data,
        tables=(_table(data),),
        text=(
            "Folding moves the image of a point as a whole: reflections change no distances, so a folded point is as "
            "wide as any point that the radar sees at the same range. What the way over mirrors costs is its length: "
            "the width across grows with the length of the whole way, the depth does not grow at all.",
            f"In range the width is {HANN} c / 2B, because of the Hann window over frequency (without any window "
            f"{UNIFORM} c / 2B, with side lobes of -13 dB, which draw rings through the picture). Across it is "
            f"{BOTH_WAYS} lambda r / (D cos a), r the length of the way and a the angle off broadside, because the "
            "same array focuses on the way out and back. The formulas lambda r / D and c / 2B are thus right to "
            "within half of their value, and the windows decide the rest.",
            "After a fold, range and cross-range are those of the last leg as the mirrors turn it: a point seen in a "
            "wall at 45 degrees is wide in the direction in which one seen directly is deep. Two ways to one point "
            "resolve it in two directions.",
        ),
        assumptions=(
            "Rays, not full waves: smooth, perfect mirrors longer than what the array sees in them, and no noise. The "
            "target is a circle of 1 mm radius. Walls that are rough add speckle, which changes single widths, but not "
            "the resolution.",
            f"Array and band are those of the published simulations, {ELEMENTS} elements {1e3 * PITCH:g} mm apart and "
            f"10 GHz; these are {elements} elements. Draws have the seeds 0 to {draws - 1}.",
        ),
    )  # fmt: skip


def _measured(
    sweep: xr.Dataset, mirrors: dict[str, Array], target: Array, chain: tuple[str, ...]
) -> tuple[dict[str, float], tuple[Array, Array]]:
    """Widths and position errors of the target's echo by way of a chain, measured and predicted, by name; and for the
    picture the distances from the target along each axis [cm] and the levels around it [dB].
    """
    fold = unfolding(mirrors, chain)
    ghost = fold.inverse(target)
    way = float(np.linalg.norm(ghost))
    sight = ghost / way
    expected = ghost - RADIUS * sight  # the echo comes from the near side of the circle
    wavelength = 2.0 * speed_of_light / (START + STOP)
    cross, depth = wavelength * way / (sweep.sizes["tx"] * PITCH), speed_of_light / (2.0 * (STOP - START))
    reach = HALF * max(BOTH_WAYS * cross / sight[1], HANN * depth)
    image = PointImage(sweep, expected, reach)
    top = image.top
    across = np.array([sight[1], -sight[0]])
    misplaced = fold(top) - fold(expected)
    numbers = {
        "way_m": way,
        "angle_deg": float(np.degrees(np.arctan2(ghost[0], ghost[1]))),
        "range_width_m": image.width(sight),
        "cross_width_m": image.width(across),
        "range_predicted_m": HANN * depth,
        "cross_predicted_m": BOTH_WAYS * cross / sight[1],
        "range_formula_m": depth,
        "cross_formula_m": cross,
        "position_error_m": float(np.linalg.norm(misplaced)),
        "position_error_range_m": abs(float((top - expected) @ sight)),
        "position_error_cross_m": abs(float((top - expected) @ across)),
    }
    # The picture shows true places: square pixels around the target, each sampled where the mirrors show it.
    side = np.linspace(-0.05, 0.05, 201)
    places = target + np.stack(np.meshgrid(side, side), axis=-1)
    where = fold.inverse(places)
    inside = np.all(np.abs(where - expected) <= reach, axis=-1)
    level = np.where(inside, image.power(where[..., 1], where[..., 0], grid=False) / image.at(top), 0.0)
    return numbers, (1e2 * side, to_db(np.sqrt(np.maximum(level, 1e-12))))


def _unit(name: str) -> str:
    return "degree" if name.endswith("_deg") else "m"


def _numbers(data: xr.Dataset) -> dict[str, float]:
    """Means over draws, with standard errors, by the number of folds."""
    numbers = {}
    for name in ("range", "cross"):
        for against in ("predicted", "formula"):
            ratio = data[f"{name}_width_m"] / data[f"{name}_{against}_m"]
            for bounces in range(len(CHAINS)):
                one = ratio.sel(bounces=bounces).values
                numbers[f"{name}_width_over_{against}_{bounces}"] = float(one.mean())
                numbers[f"{name}_width_over_{against}_{bounces}_error"] = standard_error(one)
        for bounces in range(len(CHAINS)):
            numbers[f"{name}_width_{bounces}_m"] = float(data[f"{name}_width_m"].sel(bounces=bounces).mean())
        numbers[f"{name}_width_largest_m"] = float(data[f"{name}_width_m"].max())
    for bounces in range(len(CHAINS)):
        numbers[f"position_error_{bounces}_m"] = float(data["position_error_m"].sel(bounces=bounces).mean())
    numbers["position_error_largest_m"] = float(data["position_error_m"].max())
    return numbers


def _with_error(values: xr.DataArray, scale: float, digits: int) -> str:
    """Mean and standard error of a column, times `scale`, as text."""
    return f"{scale * float(values.mean()):.{digits}f} +- {scale * standard_error(values.values):.{digits}f}"


def _table(data: xr.Dataset) -> Table:
    """Widths and errors by the number of folds."""
    rows = []
    for bounces, label in enumerate(LABELS):
        one = data.sel(bounces=bounces)
        row = [label, f"{float(one['way_m'].min()):.2f} to {float(one['way_m'].max()):.2f}"]
        for name in ("range", "cross"):
            measured, predicted = one[f"{name}_width_m"], one[f"{name}_predicted_m"]
            row += [
                _with_error(measured, 1e3, 2),
                f"{1e3 * float(predicted.mean()):.2f}",
                _with_error(measured / predicted, 1.0, 3),
            ]
        rows.append([*row, _with_error(one["position_error_m"], 1e3, 2)])
    columns = ["the target is seen", "one way [m]", "range width [mm]", "predicted [mm]", "ratio",
               "cross-range width [mm]", "predicted [mm]", "ratio", "position error [mm]"]  # fmt: skip
    return Table(title="Widths at -3 dB, mean and its standard error over the draws", columns=columns, rows=rows)


def _claims(numbers: dict[str, float], draws: int) -> tuple[Claim, ...]:
    """Claims on the scale of centimetres, on the textbook's formulas, on the cost of folding, and on positions."""
    largest = max(numbers["range_width_largest_m"], numbers["cross_width_largest_m"])
    deepest = len(CHAINS) - 1
    names = [f"{name}_width_over_predicted_{bounces}" for name in ("range", "cross") for bounces in range(deepest + 1)]
    off = max(abs(numbers[name] - 1.0) for name in names)
    lost = max(abs(numbers[f"{name}_width_over_predicted_{deepest}"] / numbers[f"{name}_width_over_predicted_0"] - 1.0)
               for name in ("range", "cross"))  # fmt: skip
    return (
        Claim(
            claim="Images around corners have a resolution on the scale of centimetres.",
            source="Abstract",
            measured=f"{1e2 * numbers['range_width_0_m']:.1f} cm deep and {1e2 * numbers['cross_width_0_m']:.1f} cm "
            f"across in line of sight, {1e2 * numbers[f'range_width_{deepest}_m']:.1f} and "
            f"{1e2 * numbers[f'cross_width_{deepest}_m']:.1f} cm after three folds; at most {1e2 * largest:.1f} cm",
            verdict="agrees" if largest < CENTIMETRES else "differs",
            why=f"Widths at -3 dB of points, {draws} draws; it agrees if none is wider than {1e2 * CENTIMETRES:g} cm.",
        ),
        Claim(
            claim="The resolution is c / 2B in range and lambda r / D across, r the length of the whole way.",
            source="Section II",
            measured=f"with the factors of the windows, {HANN} and {BOTH_WAYS} / cos a, all means within "
            f"{1e2 * off:.1f} % of that",
            verdict="agrees" if off < CLOSE else "differs",
            why=f"Means over the draws for none to three folds; it agrees within {1e2 * CLOSE:g} %.",
        ),
        Claim(
            claim="Does folding itself cost resolution?",
            source="",
            measured=f"the widths after three folds, relative to the prediction for that way, differ by "
            f"{1e2 * lost:.1f} % from those in line of sight",
            verdict="new",
            why="A fold is a reflection, and keeps all distances; only the longer way widens a point.",
        ),
        Claim(
            claim="How exactly is a folded point placed, if the mirrors are known?",
            source="",
            measured=f"{1e3 * numbers['position_error_0_m']:.2f} mm in line of sight, "
            f"{1e3 * numbers[f'position_error_{deepest}_m']:.2f} mm after three folds; at most "
            f"{1e3 * numbers['position_error_largest_m']:.2f} mm",
            verdict="new",
            why="Peak of the echo against the target, without noise and with the true mirrors.",
        ),
    )


def _points_figure(shown: list[tuple[Array, Array]], numbers: list[dict[str, float]]) -> Figure:
    """The image of the point at its true place, a panel for each chain of mirrors."""
    figure = Figure(figsize=(10.4, 3.2), layout="constrained")
    panels = figure.subplots(1, len(shown), sharex=True, sharey=True)
    for axes, (side, level), label, one in zip(panels, shown, LABELS, numbers, strict=True):
        drawn = axes.pcolormesh(side, side, level, vmin=-30.0, vmax=0.0, cmap="viridis", rasterized=True)
        axes.contour(side, side, level, levels=[to_db(np.sqrt(0.5))], colors="white", linewidths=1.0)
        axes.plot(0.0, 0.0, "+", color="white", markersize=7)
        axes.set(aspect="equal", title=f"{label}, {one['way_m']:.2f} m", xlabel="x from the target [cm]")
    panels[0].set_ylabel("y from the target [cm]")
    figure.colorbar(drawn, ax=panels, label="level [dB], floor -30", shrink=0.75)
    return figure


def _widths_figure(data: xr.Dataset) -> Figure:
    """Widths against the length of the path."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    panels = figure.subplots(1, 2)
    titles = ("range", "cross-range, times cos a")
    for axes, name, title in zip(panels, ("range", "cross"), titles, strict=True):
        cosine = np.cos(np.radians(data["angle_deg"])) if name == "cross" else xr.ones_like(data["angle_deg"])
        for bounces, (label, marker) in enumerate(zip(LABELS, "os^D", strict=True)):
            one = (data[f"{name}_width_m"] * cosine).sel(bounces=bounces)
            axes.plot(data["way_m"].sel(bounces=bounces), 1e3 * one, marker, markersize=4, label=label)
        way = np.linspace(float(data["way_m"].min()), float(data["way_m"].max()), 50)
        depth = float(data["range_formula_m"].mean())
        slope = float((data["cross_formula_m"] / data["way_m"]).mean())
        width = HANN * depth * np.ones_like(way) if name == "range" else BOTH_WAYS * slope * way
        axes.plot(way, 1e3 * width, "k-", linewidth=0.8, label="predicted")
        plain = depth * np.ones_like(way) if name == "range" else slope * way
        axes.plot(way, 1e3 * plain, "k:", linewidth=0.8, label="c / 2B" if name == "range" else "lambda r / D")
        axes.set(title=title, xlabel="length of the way, one way [m]", ylabel="width at -3 dB [mm]", ylim=(0.0, None))
        axes.legend(fontsize=8, ncols=2)
    return figure
