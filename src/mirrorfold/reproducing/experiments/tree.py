"""The tree of mirrors: which mirror is seen by way of which, compared with the images of the true walls.

Geometrical optics predicts which walls the radar sees by way of which others, and where their images stand. The trees
of two scenes are printed in the published notation. Their nodes, lines and objects are compared with this prediction.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.common.records import Number
from mirrorfold.common.types import Array
from mirrorfold.folding.confident import confident_points
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.ghosts import Ghost, Identified, ghosts_of, identified, surface_of
from mirrorfold.reproducing.parts.walls import (
    SMALL_RADAR,
    THINNED_RADAR,
    at_lower_band,
    facing_walls,
    hidden_walls,
)
from mirrorfold.reproducing.work import Work

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mirrorfold.scenes.floor_plan import Scene

GENERATIONS = 3
"""Largest number of walls in a predicted chain."""

RIGHT_SHARE = 0.95
"""Least share of the objects' echoes that must belong to the node that geometrical optics predicts."""


@dataclass(frozen=True, eq=False)
class Grown:
    """The tree of a scene, and what geometrical optics predicts of it.

    Attributes
    ----------
    name : str
        Name of the scene, in one word.
    scene : Scene
    reconstruction : DataTree
    mirrors : list of Identified
    expected : set of str
        Names of the walls, and of walls seen in walls, of which the radar sees enough for a mirror.
    placed : dict of str to (int, int)
        By chain: the number of echoes of objects, and how many of them stand at the ghost of an object that is seen by
        way of that chain.
    """

    name: str
    scene: Scene
    reconstruction: xr.DataTree
    mirrors: list[Identified]
    expected: set[str]
    placed: dict[str, tuple[int, int]]

    @property
    def range_cell(self) -> float:
        """Size of a resolution cell in range [m]."""
        return float(self.reconstruction.attrs["image_range_resolution"])


def run(work: Work) -> Findings:
    """Compare the trees of both scenes with two walls with their predictions."""
    scenes = {
        "facing": work.size(facing_walls(), at_lower_band(facing_walls(), *THINNED_RADAR)),
        "hidden": work.size(hidden_walls(), at_lower_band(hidden_walls(), *SMALL_RADAR)),
    }
    trees = []
    for name, scene in scenes.items():
        trees.append(_grown(name, scene, work.reconstruction(scene, solver="rays")))
        work.step(len(trees), len(scenes))
    figures, data, numbers = {}, {}, dict[str, Number]()
    for tree in trees:
        figure = cast("Figure", mf.plot.tree(tree.reconstruction).figure)
        figures[f"tree-{tree.name}"] = (
            figure,
            (
                f"The tree of {tree.scene.name}. Numbers of mirrors are those of the other pictures, colours those of "
                "the generations; counts are of echoes that are no walls."
            ),
        )
        data[tree.name] = xr.DataTree(_data(tree))
        numbers |= {f"{tree.name}_{key}": value for key, value in _numbers(tree).items()}
    return Findings(
        claims=_claims(trees, numbers),
        numbers=numbers,
        figures=figures,
        data=xr.DataTree(children=data),
        tables=tuple(_table(tree) for tree in trees),
        text=(
            "A tree says in which order to fold. What hangs below a node is reflected across the line of that node, "
            "and then belongs to its parent; at the root everything is in its place. A wall has as many nodes as there "
            "are ways by which it is seen.",
            f"The tree of {trees[0].scene.name}, with lines in metres of the initial image and objects as numbers of "
            f"echoes: {json.dumps(published_notation(trees[0].reconstruction))}",
            "Nodes come from the strongest mirror to the weakest, so that their numbers say nothing of where the walls "
            "stand.",
        ),
        assumptions=(
            "The publication writes tree.mirror(i).mirror(k).line and .object. The numbers are taken to count from "
            "one, as parentheses do in MATLAB.",
            "The sweeps are by rays, which flatter: they have no multiple scattering between the objects.",
            "The scenes are those of the experiment two-walls, in geometries of our own.",
            *(("In a quick run, the first by three quarters of the published antennas, the second at 20 to 24 GHz.",)
              if work.quick else ()),
        ),
    )  # fmt: skip


def notation(chain: str) -> str:
    """A node in the published notation, such as ``tree.mirror(1).mirror(2)`` for the chain ``"0/1"``."""
    return ".".join(["tree", *(f"mirror({int(index) + 1})" for index in chain.split("/") if index)])


def published_notation(reconstruction: xr.DataTree, chain: str = "") -> dict[str, Any]:
    """The tree as nested dictionaries with the published names: `line`, `object`, `mirror`."""
    lines = {one: ends for one, ends in _lines(reconstruction).items() if one.rpartition("/")[0] == chain and one}
    node: dict[str, Any] = {"object": _echoes(reconstruction, chain).sizes["point"]}
    if chain:
        node = {"line": np.round(_lines(reconstruction)[chain], 4).tolist(), **node}
    return node | {"mirror": [published_notation(reconstruction, one) for one in lines]}


def _lines(reconstruction: xr.DataTree) -> dict[str, Array]:
    """The two ends (2, 2) [m] of every mirror in the initial image, by its chain, in the order of the tree."""
    held = reconstruction.children["mirrors"].to_dataset(inherit=False)
    ends = np.stack([held[name].values for name in ("x0", "y0", "x1", "y1")], axis=-1).reshape(-1, 2, 2)
    return dict(zip(held["chain"].values.astype(str).tolist(), ends, strict=True))


def _echoes(reconstruction: xr.DataTree, chain: str) -> xr.Dataset:
    """The echoes of objects that belong to a node itself, not to its children."""
    points = confident_points(reconstruction)
    return points.isel(point=(points["chain"].values == chain) & (points["surface"].values == "object"))


def _grown(name: str, scene: Scene, reconstruction: xr.DataTree) -> Grown:
    """The tree of a reconstruction, with what geometrical optics predicts of it."""
    mirrors = identified(reconstruction, scene)
    ghosts = ghosts_of(scene, GENERATIONS)
    least = float(reconstruction.attrs["fold_minimum_length"])
    expected = {ghost.name for ghost in ghosts if ghost.is_wall and ghost.seen_length >= least}
    placed = {"": _right(reconstruction, "", [ghost for ghost in ghosts if not ghost.way])}
    for one in mirrors:
        below = []
        if one.face is not None and one.way is not None:
            way = (*(face.name for face in one.way), one.face.name)
            below = [ghost for ghost in ghosts if ghost.way_names == way]
        placed[one.chain] = _right(reconstruction, one.chain, below)
    return Grown(name, scene, reconstruction, mirrors, expected, placed)


def _right(reconstruction: xr.DataTree, chain: str, below: Sequence[Ghost]) -> tuple[int, int]:
    """Number of echoes of objects that belong to a node, and how many of them stand at one of the ghosts `below` it."""
    held = _echoes(reconstruction, chain)
    nearest = surface_of(held, [ghost for ghost in below if not ghost.is_wall], reconstruction)
    return held.sizes["point"], int(np.count_nonzero(nearest >= 0))


def _table(tree: Grown) -> Table:
    """A row for each node."""
    rows = [[notation(""), "radar", "0", "the radar", "", "", *map(str, tree.placed[""])]]
    for number, one in enumerate(tree.mirrors):
        (x0, y0), (x1, y1) = one.ends
        errors = "" if one.face is None else f"{one.angle_error:.3f} degrees, {1e3 * one.offset_error:.2f} mm"
        line = f"({x0:.3f}, {y0:.3f}) to ({x1:.3f}, {y1:.3f})"
        rows.append([notation(one.chain), f"mirror {number}", str(one.generation), one.name, line, errors,
                     *map(str, tree.placed[one.chain])])  # fmt: skip
    columns = ["node", "in the picture", "generation", "in truth", ".line [m]", "off the image of the true wall"]
    columns += [".object [echoes]", "of an object seen by that way"]
    return Table(title=f"The nodes: {tree.scene.name}", columns=columns, rows=rows)


def _data(tree: Grown) -> xr.Dataset:
    """The nodes with their lines, and the tree as JSON."""
    ends = np.array([one.ends for one in tree.mirrors]).reshape(-1, 2, 2)
    along = ("mirror", "end", "axis"), ends, {"units": "m", "long_name": "ends in the initial image"}
    angle, offset = ([getattr(one, f"{name}_error") for one in tree.mirrors] for name in ("angle", "offset"))
    return xr.Dataset(
        {
            "line": along,
            "generation": ("mirror", [one.generation for one in tree.mirrors], {"units": "1"}),
            "echoes": ("mirror", [tree.placed[one.chain][0] for one in tree.mirrors], {"units": "1"}),
            "angle_error": ("mirror", angle, {"units": "degree"}),
            "offset_error": ("mirror", offset, {"units": "m"}),
            "truth": ("mirror", [one.name for one in tree.mirrors]),
            "notation": ("mirror", [notation(one.chain) for one in tree.mirrors]),
        },
        attrs={"json": json.dumps(published_notation(tree.reconstruction))},
    )


def _numbers(tree: Grown) -> dict[str, Number]:
    """The numbers that the claims rest on."""
    found = {one.name for one in tree.mirrors}
    errors = [one for one in tree.mirrors if one.name in tree.expected]
    total, right = (sum(counts[k] for counts in tree.placed.values()) for k in (0, 1))
    return {
        "nodes": len(tree.mirrors),
        "expected": len(tree.expected),
        "missing": len(tree.expected - found),
        "unexpected": sum(one.name not in tree.expected for one in tree.mirrors),
        "deepest": max((one.generation for one in tree.mirrors), default=0),
        "angle_error_deg": max((one.angle_error for one in errors), default=None),
        "offset_error_m": max((one.offset_error for one in errors), default=None),
        "range_cell_m": tree.range_cell,
        "object_echoes": total,
        "object_echoes_in_place": right,
    }


def _claims(trees: Sequence[Grown], numbers: dict[str, Number]) -> tuple[Claim, ...]:
    """Claims on the nodes, lines and objects of both trees."""

    def of(tree: Grown, name: str) -> float:
        value = numbers[f"{tree.name}_{name}"]
        return float("inf") if value is None else float(value)

    complete = all(of(tree, "missing") == of(tree, "unexpected") == 0 for tree in trees)
    straight = all(
        of(tree, "offset_error_m") <= tree.range_cell / 2
        and np.radians(of(tree, "angle_error_deg")) <= tree.range_cell / 2
        for tree in trees
    )
    shares = {tree.name: of(tree, "object_echoes_in_place") / max(of(tree, "object_echoes"), 1.0) for tree in trees}
    return (
        Claim(
            claim="A mirror in the shadow of another one is its child: the tree holds every wall once for each way by "
            "which it is seen.",
            source="The hierarchy of mirrors",
            measured="; ".join(
                f"{tree.name}: {of(tree, 'nodes'):.0f} nodes down to generation {of(tree, 'deepest'):.0f}, "
                f"{of(tree, 'expected'):.0f} predicted, {of(tree, 'missing'):.0f} missing, "
                f"{of(tree, 'unexpected'):.0f} others"
                for tree in trees
            ),
            verdict="agrees" if complete else "differs",
            why="Predicted are the true walls and their images in one another, of which geometrical optics shows the "
            "radar at least the shortest mirror that is looked for. None may be missing, and no other found.",
        ),
        Claim(
            claim="A child's line is the mirror image of a wall.",
            source="The hierarchy of mirrors",
            measured="; ".join(
                f"{tree.name}: up to {of(tree, 'angle_error_deg'):.3f} degrees and "
                f"{1e3 * of(tree, 'offset_error_m'):.2f} mm off"
                for tree in trees
            ),
            verdict="agrees" if straight else "differs",
            why="The largest error of all nodes, against the true wall reflected at the true walls on the way; it "
            "agrees below half a range cell, and as much at one metre from the middle.",
        ),
        Claim(
            claim="Every object hangs below the deepest mirror in whose shadow it is.",
            source="The hierarchy of objects",
            measured="; ".join(
                f"{tree.name}: {of(tree, 'object_echoes_in_place'):.0f} of {of(tree, 'object_echoes'):.0f} echoes"
                for tree in trees
            ),
            verdict="agrees" if min(shares.values()) >= RIGHT_SHARE else "differs",
            why="Echoes within 1.5 resolution cells of the image of an object that geometrical optics shows by the way "
            f"of their node; at least {RIGHT_SHARE:.0%} of them.",
        ),
    )
