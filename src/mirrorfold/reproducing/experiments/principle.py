"""The principle: a mirror shows a ghost, and one reflection puts it back; a ghost in two mirrors takes two reflections.

A post is seen in line of sight, by way of one wall, and by way of two walls. The echoes of each way are compared with
the mirror image of the post, and the folded echoes with the post itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.common.geometry import Isometry, segment_normal
from mirrorfold.common.types import Array
from mirrorfold.folding.confident import confident_points
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.pixels import pixels_within
from mirrorfold.reproducing.parts.scenes import plan_scene
from mirrorfold.reproducing.work import Work

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

RIGHT = ((0.45, 1.95), (0.75, 0.95))
LEFT = ((-0.62, 1.05), (-0.50, 2.10))
"""Ends of the walls [m]."""

POST, RADIUS = (0.0, 1.45), 0.06
"""Middle and radius of the post [m], which the radar also sees directly."""

REACH = 0.3
"""Echoes up to this distance from the middle of the post's image are of the post [m]: nothing else is so near."""

QUICK_VIEW = (-2.1, 2.8), (0.1, 3.4)
"""First and last x and y [m] of the pixels of a quick run, which hold both walls, the post and all their images."""

FOLDS = {"": "in line of sight", "0": "in the right wall", "0/0": "in the left wall, seen in the right wall"}
"""How the post is seen, by the chain of mirrors."""

WALL_ROUGHNESS = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
POST_ROUGHNESS = {"rms_height": 0.10e-3, "correlation_length": 0.2e-3}
"""Rms height and correlation length in the published simulations [m]."""


def run(work: Work) -> Findings:
    """Fold a scene with one wall, then one with two: where the ghosts stand, and where they are folded to."""
    figures, rows, numbers, parts = {}, [], {}, {}
    for number, walls in enumerate(({"right": RIGHT}, {"right": RIGHT, "left": LEFT}), 1):
        scene = _scene(walls, elements=work.size(161, 121), points=work.size(401, 281))
        sweep = work.sweep(scene)
        reconstruction = mf.reconstruct(sweep, **work.size({}, pixels_within(sweep, *QUICK_VIEW)))
        work.step(number, 2)
        points = confident_points(reconstruction)
        for chain, way in list(FOLDS.items())[: number + 1]:
            seen = _echoes_of_post(points, chain)
            before, after = _distances(seen, chain)
            rows.append([scene.name, way, str(seen.sizes["point"]), f"{1e3 * before:.1f}", f"{1e3 * after:.1f}"])
            label = f"walls_{number}_bounces_{len(chain.split('/')) if chain else 0}"
            numbers[f"{label}_ghost_to_image_m"] = before
            numbers[f"{label}_folded_to_post_m"] = after
        caption = f"{scene.name.capitalize()}: the initial image with its ghosts, and the folded one."
        figures[f"walls-{number}"] = mf.plot.before_after(reconstruction, scene), caption
        parts[f"walls_{number}"] = xr.DataTree(points)
    columns = ["scene", "the post is seen", "echoes", "from its mirror image [mm]", "folded, from the post [mm]"]
    return Findings(
        claims=_claims(numbers),
        numbers=numbers,
        figures=figures,
        data=xr.DataTree(children=parts),
        tables=(Table(title="Echoes of the post", columns=columns, rows=rows),),
        text=(
            "A mirror image is as far behind the mirror as the thing is before it, so all path lengths are those of "
            "straight lines to the image: the radar cannot tell the image from a thing that stands there. Folding is "
            "the same reflection once more. An image seen in two mirrors is the image, in the first, of an image in "
            "the second; the folds are made in the order in which the wave comes back, the farthest mirror first.",
        ),
        assumptions=(
            "The publication explains the principle by drawings. Walls and post are put where each way can be checked "
            "against what the radar sees directly; array, band and roughness are those of the published simulations.",
        ),
    )


def _scene(walls: dict[str, tuple[tuple[float, float], tuple[float, float]]], *, elements: int, points: int) -> Scene:
    """The floor plan of walls, by their ends [m], and the post, with the published array or a part of it."""
    pieces = [
        {"name": name, "kind": "segment", "start": list(start), "end": list(end), "roughness": WALL_ROUGHNESS}
        for name, (start, end) in walls.items()
    ]
    post = {"name": "post", "kind": "circle", "center": list(POST), "radius": RADIUS, "roughness": POST_ROUGHNESS}
    return plan_scene(
        {
            "name": "one wall" if len(walls) == 1 else "two walls",
            "array": {"elements": elements, "pitch": 0.5e-3},
            "band": {"start": 290e9, "stop": 300e9, "points": points},
            "surface": [*pieces, post],
        }
    )


def _echoes_of_post(points: xr.Dataset, chain: str) -> xr.Dataset:
    """The echoes of objects that were assigned to a chain of mirrors and stand near the post's image in that chain."""
    place = np.column_stack([points["x_initial"], points["y_initial"]])
    near = np.linalg.norm(place - _image(chain), axis=-1) < REACH
    return points.isel(point=(points["chain"].values == chain) & (points["surface"].values == "object") & near)


def _image(chain: str) -> Array:
    """Mirror image (2,) [m] of the middle of the post in the true walls of a chain."""
    place = np.array(POST)
    for start, end in {"": (), "0": (RIGHT,), "0/0": (LEFT, RIGHT)}[chain]:
        place = Isometry.reflection(start, segment_normal(start, end))(place)
    return place


def _distances(seen: xr.Dataset, chain: str) -> tuple[float, float]:
    """Mean distances [m] of echoes from the mirror image of the post, and of the folded echoes from the post itself."""
    return (
        _from_circle(np.column_stack([seen["x_initial"], seen["y_initial"]]), _image(chain)),
        _from_circle(np.column_stack([seen["x"], seen["y"]]), np.array(POST)),
    )


def _from_circle(points: Array, centre: Array) -> float:
    """Mean distance [m] of points (n, 2) from the circumference of a post at `centre`; infinite without points."""
    if not len(points):
        return float("inf")
    return float(np.abs(np.linalg.norm(points - centre, axis=-1) - RADIUS).mean())


def _claims(numbers: dict[str, float]) -> tuple[Claim, ...]:
    """The principle in four claims. The limit is half a resolution cell; a cell is 3.5 cm."""
    limit = 0.0175
    ghost, once = numbers["walls_2_bounces_1_ghost_to_image_m"], numbers["walls_2_bounces_1_folded_to_post_m"]
    deep, twice = numbers["walls_2_bounces_2_ghost_to_image_m"], numbers["walls_2_bounces_2_folded_to_post_m"]
    why = "Mean distance of the echoes; it agrees below half a resolution cell, 17.5 mm."
    found = (
        ("What a wall reflects appears behind it, at its mirror image.", f"{1e3 * ghost:.1f} mm from it", ghost),
        ("Reflecting a ghost at its wall gives the true place.", f"{1e3 * once:.1f} mm from the post", once),
        ("What is seen in two walls appears at the image of an image.", f"{1e3 * deep:.1f} mm from it", deep),
        ("Two folds, the deepest first, give its true place.", f"{1e3 * twice:.1f} mm from the post", twice),
    )
    return tuple(
        Claim(claim=claim, source="", measured=measured, verdict="agrees" if value < limit else "differs", why=why)
        for claim, measured, value in found
    )
