"""Two walls, step by step: classification, each generation folded, and the corrected image against the geometry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.records import Number
from mirrorfold.common.types import Array
from mirrorfold.folding.confident import confident_points
from mirrorfold.reproducing.findings import Claim, Findings, Table, Verdict
from mirrorfold.reproducing.parts.ghosts import Identified, Shown, identified, objects_shown, way_name
from mirrorfold.reproducing.parts.steps import steps
from mirrorfold.reproducing.parts.walls import (
    MIDDLE_RADAR,
    SMALL_RADAR,
    THINNED_RADAR,
    at_lower_band,
    facing_walls,
    hidden_walls,
)
from mirrorfold.reproducing.work import Work

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

GENERATIONS = 3
"""Largest number of mirrors in a chain that is looked for; the published image shows as many."""

COVERED = 0.5
"""A ghost counts as found if at least this share of its visible part has an echo within a resolution cell."""

LEAST_F_SCORE, MOST_INVENTED = 0.9, 0.01
"""Least F-score and largest share of invented points at which a corrected image agrees with the geometry."""

BY = {"rays": "rays", "fullwave": "full wave"}
"""The solvers, and their names in titles."""


@dataclass(frozen=True, eq=False)
class Case:
    """A scene that was simulated and folded.

    Attributes
    ----------
    key, title : str
        Short and long name.
    scene : Scene
    reconstruction : DataTree
    mirrors : list of Identified
        The mirrors that were found, with the true walls of which they are images.
    shown : list of Shown
        The ghosts of objects that mirrors should show, with their echoes.
    cells : (2,) array
        Size of a resolution cell: in range [m], and in cross-range per metre of range.
    """

    key: str
    title: str
    scene: Scene
    reconstruction: xr.DataTree
    mirrors: list[Identified]
    shown: list[Shown]
    cells: Array

    @property
    def faces(self) -> bool:
        """Whether the walls face each other."""
        return self.key.startswith("facing")


def run(work: Work) -> Findings:
    """Simulate both scenes by rays and by full wave, fold them, and compare the results with the geometry."""
    hidden, facing = hidden_walls(), facing_walls()
    small = at_lower_band(hidden, *SMALL_RADAR)
    middle = at_lower_band(facing, *MIDDLE_RADAR)
    thinned = at_lower_band(facing, *THINNED_RADAR)
    published = ("hidden", "rays", hidden), ("hidden", "fullwave", hidden), ("facing", "rays", facing)
    reduced = ("hidden", "rays", small), ("hidden", "fullwave", small), ("facing", "rays", thinned)
    wanted = reduced if work.quick else (*published, ("facing", "fullwave", middle))
    cases = []
    for number, (name, solver, scene) in enumerate(wanted, 1):
        cases.append(_case(name, solver, scene, work))
        work.step(number, len(wanted))
    figures, data, numbers = {}, {}, dict[str, Number]()
    shown_first = next(case for case in cases if case.key == "hidden_fullwave")
    caption = f"Before and after folding: {shown_first.title}. Nothing but the sweep was given."
    figures["before-after"] = mf.plot.before_after(shown_first.reconstruction, shown_first.scene), caption
    for case in cases:
        figure, images = steps(case.reconstruction, case.scene)
        for image in images.values():
            image.encoding = {"zlib": True}  # most pixels of folded images are zero
        figures[f"steps-{case.key.replace('_', '-')}"] = figure, f"Step by step: {case.title}."
        data[case.key] = xr.DataTree.from_dict(
            {
                "/": xr.Dataset({name: image.drop_attrs() for name, image in images.items()}),
                "/objects": confident_points(case.reconstruction).rename(x="x_folded", y="y_folded"),
                "/mirrors": case.reconstruction.children["mirrors"].to_dataset(inherit=False),
            }
        )
        numbers |= {f"{case.key}_{name}": value for name, value in _numbers(case).items()}
    return Findings(
        claims=_claims(cases, numbers),
        numbers=numbers,
        figures=figures,
        data=xr.DataTree(children=data),
        tables=_tables(cases),
        text=(
            "Of two walls the initial image shows more than two. Each wall that the other reflects appears behind it, "
            "as long and as straight as it is, and casts a shadow of its own, in which the next generation stands. "
            "Every ghost of a wall must be folded with all that hangs below it, the deepest generation first: then "
            "the ghosts of a wall come to lie on the wall itself. How well they do is a check that needs no truth.",
            "Whether a wall shows the other one depends on where they stand. In the scene that comes along, no ray "
            "goes from the array by way of one wall to a side of the other that it could come back from, and none is "
            "found; in the other scene both do, and the arc, too, appears by way of both.",
            "Full waves add what rays leave out: the hidden objects scatter into each other and back into the wall, "
            "and behind every hidden object the image fills with speckle, which the rays do not have. It is left out "
            "because objects are opaque.",
        ),
        assumptions=(
            "The publication gives the ingredients, two walls of one metre, a corner with legs of 20 cm, an arc of "
            "50 cm, their roughness, array and band, but not where they stand. Both geometries are our own; the "
            "second one was searched for such that geometrical optics gives the ways that were published: two objects "
            "by way of the right wall, one of them by way of both, and three generations of walls. A search finds "
            "where things can be seen; it knows nothing of how well they are found.",
            "Where the second ghost of the arc stands, below the others or not, depends on the geometry; here it is "
            "farther away than they are.",
            *_sizes(work),
        ),
    )


def _sizes(work: Work) -> tuple[str, ...]:
    """Sentences on the radars that differ from the published one."""
    if work.quick:
        return (
            "In a quick run the first scene is the same floor plan at 20 to 24 GHz, seen by 87 antennas over 52 cm, "
            "its surfaces as rough in wavelengths as published; resolution cells are two and a half times as large. "
            "The second one, by rays alone, has three quarters of the published antennas and 281 of 401 frequencies.",
        )
    return (
        "Full waves in the first scene are those of the published radar; in the second one they are of 145 to 155 GHz, "
        "seen by 161 antennas over 16 cm, its surfaces as rough in wavelengths as published: the published resolution, "
        "at a quarter of the time.",
    )


def _case(name: str, solver: str, scene: Scene, work: Work) -> Case:
    """Simulate and fold a scene, and compare the mirrors and ghosts that are found with geometrical optics."""
    settings = {} if solver == "rays" else {"tolerance": work.size(1e-3, 1e-2)}
    reconstruction = work.reconstruction(scene, solver=solver, **settings)
    aperture = float(np.ptp(scene.array.tx_position[:, 0]))
    band = scene.band
    wavelength = speed_of_light / band.middle
    cells = np.array([speed_of_light / (2.0 * (band.stop - band.start)), wavelength / aperture])
    what = "the walls face each other" if name == "facing" else "one wall hides, the other shows"
    title = f"{what}, by {BY[solver]}, {band.start / 1e9:g}-{band.stop / 1e9:g} GHz"
    shown = objects_shown(reconstruction, scene, GENERATIONS, cells)
    return Case(f"{name}_{solver}", title, scene, reconstruction, identified(reconstruction, scene), shown, cells)


def _numbers(case: Case) -> dict[str, Number]:
    """The numbers of one case that the claims rest on."""
    score = mf.score(case.reconstruction, case.scene)
    walls = {surface.name for surface in case.scene.surface if surface.kind == "segment"}
    of_walls = [one for one in case.mirrors if one.face is not None and one.face.name in walls]
    found: dict[str, Number] = {"range_cell_m": float(case.cells[0])}
    for name, generation in (("walls", 1), ("ghost_walls", 2)):
        these = [one for one in of_walls if one.generation == generation]
        found[f"{name}_found"] = len({one.name for one in these})
        if these:
            found[f"{name}_angle_error_deg"] = max(one.angle_error for one in these)
            found[f"{name}_offset_error_m"] = max(one.offset_error for one in these)
    for name, mirrors in (("one_wall", 1), ("both_walls", 2)):
        expected = [one for one in case.shown if len(one.ghost.way) == mirrors]
        seen = [one for one in expected if one.covered >= COVERED]
        found[f"objects_by_{name}_expected"] = len(expected)
        found[f"objects_by_{name}_found"] = len(seen)
        if seen:
            found[f"objects_by_{name}_ghost_error_m"] = max(one.ghost_error for one in seen)
    found["third_generation_walls"] = sum(one.generation == 3 for one in of_walls)
    found["third_generation_echoes"] = int((confident_points(case.reconstruction)["bounces"].values >= 3).sum())
    found["accuracy_m"] = score.accuracy_m
    found["f_score_2cm"], found["f_score_cells"] = score.f_score_2cm, score.f_score_cells
    found["hidden_f_score_2cm"], found["hidden_f_score_cells"] = score.hidden.f_score_2cm, score.hidden.f_score_cells
    found["hidden_accuracy_m"] = score.hidden.accuracy_m
    found["invented_fraction"] = score.invented_fraction
    return found


def _tables(cases: Sequence[Case]) -> tuple[Table, ...]:
    """A table of the mirrors, and one of the ghosts of objects."""
    mirrors = [
        [case.title, one.name, str(one.generation), f"{one.angle_error:.3f}", f"{1e3 * one.offset_error:.2f}"]
        for case in cases
        for one in case.mirrors
    ]
    objects = [
        [case.title, one.ghost.surface, way_name(one.ghost.way), f"{100 * one.ghost.share:.0f}", str(one.echoes),
         f"{100 * one.covered:.0f}", f"{1e3 * one.ghost_error:.1f}", f"{1e3 * one.folded_error:.1f}"]
        for case in cases
        for one in case.shown
    ]  # fmt: skip
    errors = "off its mirror image [degree]", "[mm]"
    found = ["echoes", "found of that [%]", "echoes off the ghost [mm]", "folded, off the object [mm]"]
    return (
        Table(title="Mirrors in the initial image", columns=["scene", "mirror", "generation", *errors], rows=mirrors),
        Table(
            title="Ghosts of the hidden objects",
            columns=["scene", "object", "by way of", "can be seen [%]", *found],
            rows=objects,
        ),
    )


def _claims(cases: Sequence[Case], numbers: Mapping[str, Number]) -> tuple[Claim, ...]:
    """The published observations, each with the numbers of all cases in which it can be made."""
    facing = [case for case in cases if case.faces]

    def of(case: Case, name: str) -> float:
        value = numbers.get(f"{case.key}_{name}")
        return float("inf") if value is None else float(value)

    def each(chosen: Sequence[Case], text: str) -> str:
        """A text, once for every case, with the numbers of the case in place of their names; `_mm` for millimetres."""
        parts = []
        for case in chosen:
            own = {name.removeprefix(f"{case.key}_"): value for name, value in numbers.items()
                   if name.startswith(case.key)}  # fmt: skip
            own |= {f"{name}m": 1e3 * value for name, value in own.items() if name.endswith("_m") and value is not None}
            name = case.key.replace("_", ", ").replace("fullwave", "full wave")
            parts.append(f"{name}: {text.format(**own)}")
        return "; ".join(parts)

    def lines_agree(name: str, moves: float) -> Verdict:
        """Whether both lines are found, and so well that a ghost one metre away folds to within half a range cell of
        its object. A line may be off by `moves` times as much as a wall.
        """
        chosen = facing if name == "ghost_walls" else cases
        good = [
            of(case, f"{name}_found") == 2
            and of(case, f"{name}_offset_error_m") <= moves * of(case, "range_cell_m") / 4
            and np.radians(of(case, f"{name}_angle_error_deg")) <= moves * of(case, "range_cell_m") / 4
            for case in chosen
        ]
        return "agrees" if all(good) else "differs"

    errors = "{%s_found} found, {%s_angle_error_deg:.3f} degrees, {%s_offset_error_mm:.2f} mm"
    not_here = "In the first scene geometrical optics lets no wall show the other, and none is found. "
    right = all(of(case, "objects_by_one_wall_found") == 2 for case in cases)
    both = all(of(case, "objects_by_both_walls_found") == (1 if case.faces else 0) for case in cases)
    empty = all(of(case, "third_generation_walls") >= 1 and of(case, "third_generation_echoes") == 0 for case in facing)
    true = all(
        of(case, "accuracy_m") <= of(case, "range_cell_m") / 2
        and min(of(case, "f_score_cells"), of(case, "hidden_f_score_cells")) >= LEAST_F_SCORE
        and of(case, "invented_fraction") <= MOST_INVENTED
        for case in cases
    )
    return (
        Claim(
            claim="Both walls are found where they stand.",
            source="Fig. 4 (b)",
            measured=each(cases, errors.replace("%s", "walls")),
            verdict=lines_agree("walls", 1.0),
            why="The worse of the two. A ghost moves by twice its mirror's error: it agrees where that is less than "
            "half a range cell, one metre away.",
        ),
        Claim(
            claim="Behind each wall stands a ghost of the other one.",
            source="Fig. 4 (a), (b)",
            measured=each(facing, errors.replace("%s", "ghost_walls")),
            verdict=lines_agree("ghost_walls", 2.0),
            why=not_here + "In the second: against the true wall, reflected at the other true wall. A ghost of a wall "
            "may be off by twice as much as a wall.",
        ),
        Claim(
            claim="Two ghosts of the hidden objects stand behind the right-hand wall.",
            source="Fig. 4 (a), (b)",
            measured=each(cases, "{objects_by_one_wall_found} of {objects_by_one_wall_expected}, echoes up to "
                          "{objects_by_one_wall_ghost_error_mm:.1f} mm off the ghost"),
            verdict="agrees" if right else "differs",
            why=f"A ghost is found where {COVERED:.0%} of what geometrical optics shows of it has an echo in its "
            "resolution cell.",
        ),
        Claim(
            claim="One ghost is seen by way of both walls.",
            source="Fig. 4 (a), (b)",
            measured=each(cases, "{objects_by_both_walls_found} of {objects_by_both_walls_expected}"),
            verdict="agrees" if both else "differs",
            why="Found as above, in the second scene alone, which has one. That it stands below the others is a matter "
            "of the geometry; here it is the farthest.",
        ),
        Claim(
            claim="In the shadow of the third generation nothing is seen.",
            source="Fig. 4 (b), (c)",
            measured=each(facing, "{third_generation_walls} wall, {third_generation_echoes} echoes behind it"),
            verdict="agrees" if empty else "differs",
            why="There must be a wall of the third generation and no echo behind it. " + not_here,
        ),
        Claim(
            claim="The corrected image agrees with the geometry.",
            source="Fig. 4 (e)",
            measured=each(cases, "{accuracy_mm:.1f} mm off, F-score {f_score_2cm:.2f} at 2 cm and "
                          "{f_score_cells:.2f} in cells, of what is hidden {hidden_f_score_2cm:.2f} and "
                          "{hidden_f_score_cells:.2f}, invented {invented_fraction:.1%}"),
            verdict="agrees" if true else "differs",
            why="Mean distance below half a range cell, F-score within 1.5 resolution cells, overall and of what is "
            f"hidden, at least {LEAST_F_SCORE}, and invented points at most {MOST_INVENTED:.0%}.",
        ),
    )  # fmt: skip
