"""Two walls from 60 GHz to 1 THz: quality against frequency, roughness, aperture and bandwidth, and what decides it.

The same scenes are folded for many radars and walls. Two lengths explain the scores at all frequencies: the length of
the wall in resolution cells decides whether the wall is found; the distance at which a point counts as right, in
cells, decides the F-score of the folded points. `quality_table` turns both into the table of expected quality.
"""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.frequency_pages import (
    against_waves,
    aperture_map,
    by_bandwidth,
    by_roughness,
    collapse,
    mean_error,
    scene_table,
)
from mirrorfold.reproducing.parts.quality_table import FEWEST, quality_table
from mirrorfold.reproducing.parts.two_walls_family import Row, Setting, judged
from mirrorfold.reproducing.work import Work

SHARE, FIXED = 0.034, 10e9
"""The two assumptions on the bandwidth: a share of the frequency, that of 10 GHz in 295 GHz; or a fixed one [Hz]."""

APERTURES = (0.04, 0.08, 0.16)
"""Apertures of the radars [m]; the second is the published one."""

ROUGHNESSES = ((0.02e-3, 0.2e-3), (0.05e-3, 0.2e-3), (0.1e-3, 0.2e-3), (0.2e-3, 0.8e-3))
"""Rms height and correlation length of the walls [m]; the second is the published one."""

LONG_CORRELATION = 1e-3
"""Correlation length of all rough surfaces in the scenes that full waves are solved for [m]: 0.2 mm would take as many
unknowns at 60 GHz as at 300 GHz."""

QUICK_WAVES = (60e9, 2.7e9, 0.21)
"""Frequency [Hz], bandwidth [Hz] and aperture [m] for which a quick run solves for full waves. The resolution cells are
those of 80 GHz, a bandwidth of 3.4 percent and an aperture of 16 cm, and the unknowns are fewer."""

WAVE_TOLERANCE, QUICK_WAVE_TOLERANCE = 5e-3, 1e-2
"""Tolerance of the full waves, and of those of a quick run: 40 dB below the mean power of a sample."""

MATERIALS = ("concrete", "plasterboard", "wood")
"""Walls that mirror 6, 10 and 13 dB less than a conductor at 45 degrees."""

GOOD = 0.9
"""Least hidden F-score, or share of scenes, that a reader can rely on."""


def run(work: Work) -> Findings:
    """Fold all scenes, and make the table of expected quality of those that were simulated by rays."""
    tasks = _tasks(work.quick)
    rows: list[Row] = []
    for number, (group, setting, seed, options) in enumerate(tasks):
        rows.append({**judged(work, setting, seed, **options), "group": group})
        work.step(number + 1, len(tasks))
    rays = [row for row in rows if row["group"] != "full waves"]
    table = quality_table(rays, fewest=work.size(FEWEST, 1))
    numbers = _numbers(rows)
    for curve in ("found", "close"):
        for at, mean in zip(table[curve]["at"], table[curve]["mean"], strict=True):
            numbers[f"expected_{curve}_at_{at:.3g}_cells"] = mean
    return Findings(
        claims=_claims(numbers, rows),
        numbers=numbers,
        figures={
            "bandwidth": (
                by_bandwidth(rows),
                "Hidden F-score against frequency at an aperture of 8 cm and the published "
                "roughness (mean and standard error over scenes), with two assumptions on the bandwidth.",
            ),
            "roughness": (
                by_roughness(rows, ROUGHNESSES),
                "With a bandwidth of 10 GHz, for walls of four roughnesses: "
                "hidden F-score at 5 cm, and share of the scenes in which both walls are found.",
            ),
            "map": (
                aperture_map(rows, APERTURES),
                "Hidden F-score at 2 cm and at 5 cm by frequency and aperture, at a "
                "bandwidth of 3.4 percent. White: not computed.",
            ),
            "collapse": (
                collapse(rays, table),
                "What decides, in resolution cells. Left, the share of scenes in which "
                "the wall that shows is found; right, the F-score of those scenes. Small: scenes.",
            ),
            "fullwave": (against_waves(rows), "The same scenes by full waves and by rays."),
        },
        data=_data(rows).assign_attrs(expected_quality=json.dumps(table)),
        tables=(scene_table(rows), *_expected_tables(table)),
        text=_text(numbers, table),
        assumptions=(
            "Scenes are the published one (seed 0) and random ones of the family 'two walls' (seeds 1, 2, ...), the "
            "same for all radars. Walls are 0.8 to 1.2 m long, objects 6 to 40 cm large, ghosts 2.5 to 3.5 m away.",
            "Bandwidth: 3.4 percent of the frequency up to 450 GHz; or 10 GHz at all frequencies, 17 percent at 60 "
            "GHz.  Antennas stand half a wavelength apart at the top of the band, as many as the aperture holds. To "
            "keep computing in bounds, at most 165 of them receive, evenly spread, where more transmit.",
            "Rays, with noise of the electronics that `plan` assumes (0 dBm, 20 dBi, noise figure 20 dB in 10 kHz) at "
            "all frequencies. Walls conduct; other materials mirror 5 to 12 dB less. Air's absorption, 0.1 dB over 6 m "
            "outside of the lines of water, is left out.",
            f"Full waves: an aperture of {work.size(16, 21)} cm, a bandwidth of {work.size('3.4 percent', '2.7 GHz')}, "
            "heights with a correlation length of 1 mm in both solvers, and a tolerance of "
            f"{work.size('5e-3', '1e-2')}.",
        ),
    )


Task = tuple[str, Setting, int, dict[str, Any]]


def _tasks(quick: bool) -> list[Task]:
    """Name of the group, radar and walls, seed, and options of the simulator, for every scene."""
    share = (60, 100, 150) if quick else (60, 80, 110, 150, 220, 300, 450)
    fixed = (60, 150) if quick else (60, 80, 110, 150, 220, 300, 450, 670, 1000)
    rough = (150,) if quick else (110, 220, 450)
    narrow, wide = ((100,), ()) if quick else ((60, 80, 110, 150, 220, 300), (60, 80, 110, 150))
    lossy = () if quick else (110, 220)
    waves = [QUICK_WAVES] if quick else [(f * 1e9, SHARE * f * 1e9, APERTURES[2]) for f in (60, 80, 110)]
    tasks: list[Task] = []

    def add(group: str, setting: Setting, count: int | None = None, **options: Any) -> None:
        seeds = [1] if quick else range(count or _scenes(setting.frequency))
        tasks.extend((group, setting, seed, options) for seed in seeds)

    for frequency, bandwidth, aperture in waves:
        setting = Setting(frequency=frequency, bandwidth=bandwidth, aperture=aperture)
        setting = replace(setting, correlation_length=LONG_CORRELATION, object_correlation=LONG_CORRELATION)
        add("rays beside full waves", setting, 4)
        add("full waves", setting, 4, solver="fullwave", tolerance=QUICK_WAVE_TOLERANCE if quick else WAVE_TOLERANCE)
    for f in share:
        add("3.4 percent", Setting(frequency=f * 1e9, bandwidth=SHARE * f * 1e9))
    for length, some in ((APERTURES[0], narrow), (APERTURES[2], wide)):
        for f in some:
            add("3.4 percent", Setting(frequency=f * 1e9, bandwidth=SHARE * f * 1e9, aperture=length), 3)
    for f in fixed:
        add("10 GHz", Setting(frequency=f * 1e9, bandwidth=FIXED))
    for height, length in ROUGHNESSES[-1:] if quick else (ROUGHNESSES[0], *ROUGHNESSES[2:]):
        for f in rough if height > ROUGHNESSES[0][0] else rough[:2]:
            walls = Setting(frequency=f * 1e9, bandwidth=FIXED, rms_height=height, correlation_length=length)
            add("10 GHz", walls, 3 if f < 300 else 2)
    for f, material in product(lossy, MATERIALS):
        add("materials", Setting(frequency=f * 1e9, bandwidth=FIXED, material=material), 3)
    return tasks


def _scenes(frequency: float) -> int:
    """Number of scenes at a frequency [Hz]; fewer at high ones, as computing grows with the third power."""
    return 4 if frequency < 250e9 else 3 if frequency < 400e9 else 2


def _of(rows: list[Row], group: str, **wanted: float) -> list[Row]:
    """Rows of a group at the published roughness and aperture, unless `wanted` names another value."""
    usual = {"aperture": 0.08, "rms_height": 0.05e-3} | wanted
    return [row for row in rows if row["group"] == group and all(np.isclose(row[k], v) for k, v in usual.items())]


def _numbers(rows: list[Row]) -> dict[str, float]:
    """Means and standard errors by frequency; lowest good frequencies; effects of roughness and of full waves."""
    numbers: dict[str, float] = {}
    for group, label in (("3.4 percent", "share"), ("10 GHz", "fixed")):
        usual = _of(rows, group)
        for f in sorted({row["frequency"] for row in usual}):
            for name in ("f_2cm", "f_5cm", "f_cells", "both_walls", "angle_deg"):
                found = mean_error([row[name] for row in usual if row["frequency"] == f])
                if found is not None:
                    numbers[f"{label}_{f / 1e9:.0f}_ghz_{name}"], numbers[f"{label}_{f / 1e9:.0f}_ghz_{name}_error"] = (
                        found
                    )
        for name in ("both_walls", "f_2cm", "f_5cm", "f_cells"):
            lowest = _lowest_good(usual, name)
            if lowest is not None:
                numbers[f"{label}_lowest_good_{name}_ghz"] = lowest / 1e9
    for height, _ in ROUGHNESSES:
        walls = _of(rows, "10 GHz", rms_height=height)
        for f in sorted({row["frequency"] for row in walls}):
            found = mean_error([row["f_5cm"] for row in walls if row["frequency"] == f])
            if found is not None:
                numbers[f"height_{1e6 * height:.0f}_um_{f / 1e9:.0f}_ghz_f_5cm"] = found[0]
    for name in ("f_2cm", "f_5cm", "f_cells", "both_walls"):
        pairs = _pairs(rows, name)
        found = mean_error([waves - rays for waves, rays in pairs])
        if found is not None:
            numbers[f"waves_minus_rays_{name}"], numbers[f"waves_minus_rays_{name}_error"] = found
    return numbers


def _lowest_good(rows: list[Row], name: str) -> float | None:
    """The lowest frequency [Hz] from which on the mean is at least `GOOD` at all frequencies; None if there is none."""
    lowest = None
    for f in sorted({row["frequency"] for row in rows}, reverse=True):
        found = mean_error([row[name] for row in rows if row["frequency"] == f])
        if found is None or found[0] < GOOD:
            break
        lowest = f
    return lowest


def _pairs(rows: list[Row], name: str) -> list[tuple[float, float]]:
    """One score of each scene by full waves and by rays, where both are known."""
    rays = {(row["frequency"], row["seed"]): row[name] for row in rows if row["group"] == "rays beside full waves"}
    waves = [row for row in rows if row["group"] == "full waves"]
    pairs = [(row[name], rays[row["frequency"], row["seed"]]) for row in waves]
    return [(one, other) for one, other in pairs if one is not None and other is not None]


def _claims(numbers: dict[str, float], rows: list[Row]) -> tuple[Claim, ...]:
    """Questions with our answers, because nothing is published but the result at 0.3 THz."""

    def from_on(label: str, name: str) -> str:
        lowest = numbers.get(f"{label}_lowest_good_{name}_ghz")
        return "at none that was tried" if lowest is None else f"from {lowest:.0f} GHz"

    def value(key: str) -> str:
        return f"{numbers[key]:.2f}" if key in numbers else "not computed"

    both = [{row["frequency"] for row in _of(rows, "10 GHz", rms_height=height)} for height in (0.05e-3, 0.2e-3)]
    highest = max(both[0] & both[1]) / 1e9
    return (
        Claim(
            claim="From which frequency on does an aperture of 8 cm find both walls?",
            source="",
            measured=f"{from_on('share', 'both_walls')} with 3.4 percent of bandwidth, "
            f"{from_on('fixed', 'both_walls')} with 10 GHz",
            verdict="new",
            why=f"In {GOOD:.0%} of the scenes or more there and at all higher frequencies tried.",
        ),
        Claim(
            claim="From which frequency on are hidden things right within 5 cm, and within 2 cm?",
            source="",
            measured=f"5 cm {from_on('share', 'f_5cm')}, 2 cm {from_on('share', 'f_2cm')}; with 10 GHz of bandwidth "
            f"5 cm {from_on('fixed', 'f_5cm')}, 2 cm {from_on('fixed', 'f_2cm')}",
            verdict="new",
            why=f"Mean hidden F-score of {GOOD:g} or more there and at all higher frequencies tried.",
        ),
        Claim(
            claim="What does roughness change?",
            source="",
            measured=f"F at 5 cm and {highest:.0f} GHz: {value(f'height_50_um_{highest:.0f}_ghz_f_5cm')} at 50 um, "
            f"{value(f'height_200_um_{highest:.0f}_ghz_f_5cm')} at 200 um",
            verdict="new",
            why="The highest frequency at which both were tried.",
        ),
        Claim(
            claim="Do full waves say the same as rays at low frequencies?",
            source="",
            measured=f"hidden F at 1.5 cells {numbers['waves_minus_rays_f_cells']:+.2f} +- "
            f"{numbers['waves_minus_rays_f_cells_error']:.2f} against rays",
            verdict="new",
            why="Mean difference and standard error over the same scenes.",
        ),
    )


def _text(numbers: dict[str, float], table: dict[str, Any]) -> tuple[str, ...]:
    """What can be learnt."""
    found = list(zip(table["found"]["at"], table["found"]["mean"], strict=True))
    lost = max((at for at, mean in found if mean < 0.1), default=None)
    sure = min((at for at, mean in found if mean > 0.95), default=None)
    cliff = (
        ""
        if lost is None or sure is None
        else f" Here no wall of {lost:.0f} cells or fewer showed anything, and all of {sure:.0f} or more did."
    )
    return (
        "Two lengths in resolution cells decide, whatever the frequency. The first is that of the wall, in cells "
        "where it stands: a row of echoes counts as a mirror from about eight cells of the nearest echoes on. Below, "
        f"nothing is folded: the limit is a cliff, not a slope.{cliff} The second is the distance at which a point "
        "counts as right, in cells at the hidden things. Once the wall is found, F-scores at 2 cm and "
        "at 5 cm lie on one curve.",
        "So a lower frequency has to be paid for with aperture and with bandwidth both, for the diagonal of a cell "
        "is as long as the longer of its sides. At 60 to 110 GHz a bandwidth of 3.4 percent, 2 to 4 GHz, makes cells "
        "of 4 to 7 cm in depth: doubling the aperture gains little then, and a bandwidth of 10 GHz as much or more.",
        "Roughness bounds the frequency from above, not from below. Noise of a common instrument lies so far down that "
        "even the weak scattering of walls at 60 GHz is seen; but from one radian of phase on walls are no mirrors any "
        "more, and hidden things fade behind them.",
        "Full waves agree in where walls are found, and score somewhat lower behind them: what hidden objects scatter "
        "among each other fills the depth with speckle, which rays do not have. The table of expected quality is made "
        "from rays, and is to be read as what can be reached.",
    )


def _expected_tables(table: dict[str, Any]) -> tuple[Table, ...]:
    """A table for each of the two factors of the expected F-score."""
    made = []
    titles = {
        "found": "Chance that the wall is found, by its length in cells",
        "close": "F-score of what is folded, by the distance at which a point is right, in cells",
    }
    for name, title in titles.items():
        curve = table[name]
        rows = [
            [f"{at:.3g}", f"{mean:.2f}", f"{error:.2f}", f"{count:.0f}"]
            for at, mean, error, count in zip(*(curve[key] for key in ("at", "mean", "standard_error", "scenes")),
                                              strict=True)
        ]  # fmt: skip
        made.append(Table(title=title, columns=["cells", "mean", "standard error", "scores"], rows=rows))
    return tuple(made)


UNITS = {
    "frequency": "Hz", "bandwidth": "Hz", "aperture": "m", "rms_height": "m", "correlation_length": "m",
    "accuracy_m": "m", "angle_deg": "degree", "cell_m": "m", "mirrored_db": "dB",
}  # fmt: skip
"""Units of the columns; the other columns are shares and counts."""


def _data(rows: list[Row]) -> xr.Dataset:
    """The scores of all scenes."""
    columns = [name for name in rows[0] if name not in ("group", "material")]
    values = {
        name: np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=float) for name in columns
    }
    return xr.Dataset(
        {name: ("scene", values[name], {"units": UNITS.get(name, "1")}) for name in columns},
        coords={name: ("scene", [row[name] for row in rows]) for name in ("group", "material")},
    )
