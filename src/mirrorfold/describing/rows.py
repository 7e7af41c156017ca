"""What pages, pictures and notebooks tell of a reconstruction: its mirrors, how much was found, and its score."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.arcs import mirror_curves, mirror_outlines, mirror_places
from mirrorfold.common.chains import mirror_chains
from mirrorfold.common.decibels import PASSED_LABEL, bounce_label
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array
from mirrorfold.describing.reconstructions import PANE, on_mirrors, radius_of
from mirrorfold.folding.confident import passed_walls


def mirror_rows(reconstruction: xr.DataTree) -> list[dict[str, Any]]:
    """The facts about each mirror as a dict, with None for what the file does not hold."""
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    reference_echo = float(reconstruction.attrs.get("reference", 0.0) or 0.0)
    strengths = held["strength"].values.astype(float)
    if not reference_echo > 0.0 and strengths.size:
        reference_echo = float(strengths.max())
    volume = "corner_x" in held
    axes = "xyz" if "z0" in held else "xy"
    outlines = {prefix: mirror_outlines(held, prefix) if volume else [] for prefix in ("", "folded_")}
    rows: list[dict[str, Any]] = []
    chains = mirror_chains(held)
    curves = mirror_curves(held, "folded_")
    places = {prefix: mirror_places(held, prefix) for prefix in ("", "folded_")}
    for i in range(held.sizes.get("mirror", 0)):
        one = held.isel(mirror=i)
        ends = {
            prefix: [[float(one[f"{prefix}{axis}{end}"]) for axis in axes] for end in (0, 1)]
            for prefix in ("", "folded_")
        }
        way = np.subtract(ends["folded_"][1], ends["folded_"][0])
        row: dict[str, Any] = {
            "number": i,
            "parent": int(one["parent"]),
            "generation": int(one["generation"]),
            "chain": chains[i],
            "ends": ends[""],
            "folded_ends": ends["folded_"],
            "through": _middle(places[""][i]),
            "folded_through": _middle(places["folded_"][i]),
            "length": float(np.linalg.norm(np.diff(ends["folded_"] if volume else curves[i], axis=0), axis=1).sum()),
            "angle": float(np.degrees(np.arctan2(way[1], way[0])) % 180.0),
            "strength_db": _decibel(strengths[i], reference_echo),
            **{name: _known(one, name) for name in ("angle_error", "offset_error", "fill", *PANE)},
            **dict(zip(("radius", "radius_error"), radius_of(one), strict=True)),
        }
        if volume:
            for prefix in ("", "folded_"):
                row[f"{prefix}outlines"] = [line.tolist() for line in outlines[prefix][i]]
            heights = one["folded_corner_z"].values
            row["height"] = float(np.ptp(heights))
        rows.append(row)
    return rows


def found_rows(objects: xr.Dataset, mirrors: list[dict[str, Any]]) -> list[list[str]]:
    """How much was found: rows of a name and a number, both as texts."""
    passed, walls = passed_walls(objects), int(on_mirrors(objects).sum())
    every = objects["bounces"].values
    bounces, counts = np.unique(every[~passed], return_counts=True)
    rows = [
        ["mirrors", str(len(mirrors))],
        ["points", str(every.size)],
        ["of objects", str(every.size - walls)],
        ["of walls", str(walls)],
        ["seen around a corner", str(int((every > 0).sum()))],
        ["generations", str(max((mirror["generation"] for mirror in mirrors), default=0))],
    ]
    rows += [[bounce_label(int(b)), str(int(n))] for b, n in zip(bounces, counts, strict=True)]
    return [*rows, [PASSED_LABEL, str(int(passed.sum()))]] if passed.any() else rows


def points_by_chain(objects: xr.Dataset) -> dict[str, list[int]]:
    """For each chain the number of points seen by way of it: [of objects, of walls]."""
    walls = on_mirrors(objects)
    chains = objects["chain"].values.astype(str)
    return {
        str(chain): [int((~walls & (chains == chain)).sum()), int((walls & (chains == chain)).sum())]
        for chain in np.unique(chains)
    }


def place_digits(reconstruction: xr.DataTree) -> int:
    """Decimal places of positions in metres: as many as a pixel needs, and at least millimetres.

    Lengths of mirrors have one less.
    """
    pixel = mean_step(reconstruction.dataset["x"].values)
    return max(3, int(np.ceil(-np.log10(pixel) - 1e-9))) if pixel > 0.0 else 3


def score_rows(score: dict[str, Any]) -> dict[str, Any]:
    """The score as tables: headings, and rows of texts."""
    mirrors = [
        [str(i), mirror["surface"] or "-", _number(mirror["angle_error_deg"], ".3f"),
         _number(mirror["offset_error_mm"], ".2f"), _number(mirror.get("curvature_error"), ".2f", 100.0)]
        for i, mirror in enumerate(score["mirrors"])
    ]  # fmt: skip
    hidden = score.get("hidden") or {}
    points = [["points", *(str(part["points"]) if part else "-" for part in (score, hidden))]]
    points += [
        [label, *(_number(part.get(name), form, scale) for part in (score, hidden))]
        for label, name, form, scale in (
            ("accuracy [mm]", "accuracy_m", ".1f", 1e3),
            ("Chamfer distance [mm]", "chamfer_m", ".1f", 1e3),
            ("precision at 2 cm", "precision_2cm", ".3f", 1.0),
            ("completeness at 2 cm", "completeness_2cm", ".3f", 1.0),
            ("F-score at 2 cm", "f_score_2cm", ".3f", 1.0),
            ("F-score at 5 cm", "f_score_5cm", ".3f", 1.0),
            ("F-score at 1.5 cells", "f_score_cells", ".3f", 1.0),
            ("invented share", "invented_fraction", ".3f", 1.0),
        )
    ]
    return {"mirrors": mirrors, "points": points}


def _middle(place: Array) -> list[float] | None:
    """The middle of an arc given by three points; None for a line."""
    return place[1].tolist() if len(place) == 3 else None


def _known(one: xr.Dataset, name: str) -> float | None:
    """A variable of one mirror; None where the file lacks it, or it is not a finite number."""
    value = float(one[name]) if name in one else np.nan
    return value if np.isfinite(value) else None


def _decibel(value: float, zero: float) -> float | None:
    """Level of an amplitude relative to `zero` [dB]; None where one of them is not positive."""
    return float(20.0 * np.log10(value / zero)) if value > 0.0 and zero > 0.0 else None


def _number(value: float | None, form: str, scale: float = 1.0) -> str:
    """A number times `scale` as a text; "-" where it is unknown."""
    if value is None or not np.isfinite(value):
        return "-"
    shares = (0.0, 1.0) if scale == 1.0 else (0.0,)
    return format(value, "g") if value in shares else format(value * scale, form)  # these are exact
