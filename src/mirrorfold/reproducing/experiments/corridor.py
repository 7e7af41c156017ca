"""The entrance of a corridor: two walls at right angles, and what one of them shows around the corner (Fig. 6).

The radar sees the two walls. The outer wall is the mirror: it shows a mannequin, a wall and a metal box, all hidden
around the corner. The experiment measures the angle between the walls that were found, how well the hidden surfaces are
folded to their places, and how bright the box is. It repeats this in random corridors and with boxes of other textures.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.common.decibels import power_ratio_of, to_db
from mirrorfold.plotting import volumes as plot_volume
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts import bodies
from mirrorfold.reproducing.parts.bodies import Facing, Folded
from mirrorfold.reproducing.parts.corners import MIRROR, angle_of_corner, in_view, inner_angle
from mirrorfold.reproducing.parts.raster import (
    SNR_DB,
    Wall,
    hidden_points,
    reduced,
    walls_of,
    without_pictures,
)
from mirrorfold.reproducing.parts.scenes import shipped_solids
from mirrorfold.reproducing.parts.sections import draw_sections, sections
from mirrorfold.reproducing.parts.spread import Row, spread, spread_table
from mirrorfold.reproducing.parts.textures import (
    BEHIND,
    BOX,
    box_of,
    draw_levels,
    level_of,
    levels_dataset,
    over_wall_db,
    predicted_db,
    told,
)
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes import families
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.scoring.mirrors import mirror_errors
from mirrorfold.scoring.volumes import faces

FIGURE = "Fig. 6"

HIDDEN = ("mannequin", BEHIND, BOX)

FAMILY = "raster corridor"

LEVEL = 0.3
"""Height of the horizontal section [m]: through the chest and the box."""

HALF_CELL = 0.0175
"""Half the diagonal of the resolution cell in the focus of the beam [m]."""

FRONT_DB = -30.0
"""Floor of the pictures of the hidden surfaces [dB]."""


def run(work: Work) -> Findings:
    """Fold the shipped corridor, random corridors, and the shipped one with boxes of other textures."""
    beams, frequencies = work.size((81, 901), (61, 901))
    draws = work.size(6, 0)
    textures = work.size((0.0, 0.01, 0.03, 0.1, 1.0), (0.03,))
    lengths, seeds = work.size(((0.5, 1.0), 5), ((1.0,), 1))
    done, total = 1 + draws + len(textures), 1 + draws + len(textures) + len(lengths) * seeds
    scene = reduced(shipped_solids("corridor"), beams=beams, frequencies=frequencies)
    volume = mf.focus(work.sweep(scene, snr_db=SNR_DB, bounces=work.size(3, 2)))
    seen = mf.fold(volume)
    work.step(1, total)
    body, view, wall = _view(seen, scene)
    numbers = judge(seen, scene, body, view)
    rows = []
    for seed in range(draws):
        rows.append(work.kept(lambda seed=seed: _draw(seed)))  # type: ignore[misc]
        work.step(2 + seed, total)
    levels = {box_of(scene).diffuse_fraction: numbers["box_over_wall_db"]}
    for number, texture in enumerate(textures):
        levels[texture] = work.kept(lambda texture=texture: level_of(scene, texture))  # type: ignore[misc]
        work.step(2 + draws + number, total)
    for length in lengths:
        found = []
        for seed in range(seeds):
            found.append(work.kept(lambda length=length, seed=seed: angle_of_corner(scene, length, seed)))  # type: ignore[misc]
            done += 1
            work.step(done, total)
        numbers[f"angle_end_wall_{length:g}m_deg"] = float(np.mean(found))
        numbers[f"angle_end_wall_{length:g}m_se_deg"] = (
            float(np.std(found, ddof=1) / np.sqrt(seeds)) if seeds > 1 else np.nan
        )
    predicted, share = predicted_db(scene, body), box_of(scene).diffuse_fraction
    numbers |= spread(rows) | {
        "predicted_box_over_wall_db": predicted,
        "least_diffuse_share": share * power_ratio_of(-predicted),
        **{f"box_over_wall_at_share_{share:g}_db": level for share, level in sorted(levels.items())},
    }
    cuts = sections(volume, seen, view, wall, level=LEVEL)
    return Findings(
        claims=_claims(numbers, levels, len(rows)),
        numbers={name: value if np.isfinite(value) else None for name, value in numbers.items()},
        figures={
            "plan": (
                mf.plot.before_after(seen, scene),
                "Plan view as the radar sees it, and folded. Orange: seen in one mirror. The two walls in view show "
                "each other behind their corner, and behind the outer wall mannequin, box and inner wall. Outlines "
                "are those of convex hulls.",
            ),
            "hidden": (
                _hidden_figure(body, view, scene),
                "What the outer wall shows, folded: from the mirror image of the radar, and from above.",
            ),
            "sections": (
                draw_sections(cuts, scene, mirrored=HIDDEN),
                "Horizontal and upright sections before and after folding; the upright one cuts the body's middle.",
            ),
            "body": (
                plot_volume.body(seen, scene, floor_db=-25.0),
                "The mannequin from the front and cut from the side, with its true outlines.",
            ),
            "levels": (
                draw_levels(levels, share, predicted, numbers["box_over_wall_db"] - numbers["box_over_body_db"]),
                "How bright the box is over the inner wall, by the share of its reflection that is diffuse.",
            ),
            "space-before": (
                plot_volume.space(seen, scene, folded=False),
                "The scene in perspective as the radar sees it, with mirror images behind the walls.",
            ),
            "space": (plot_volume.space(seen, scene), "The folded scene in perspective."),
        },
        data=xr.DataTree(
            children={
                "points": xr.DataTree(hidden_points(seen).assign(nearest=("point", body.surface.astype(str)))),
                "levels": xr.DataTree(levels_dataset(levels)),
                **cuts.dataset(),
            }
        ),
        tables=(
            _surfaces(body, view, scene),
            spread_table("The scene and random corridors", "random corridors", numbers, rows, ROWS),
        ),
        text=_text(numbers),
        assumptions=(
            "The scan is simulated by rays: diffuse scatterers frozen on all surfaces and inside the walls, seen by "
            "way of up to three mirrors. Edges return no glint of their own, and curved surfaces reflect diffusely "
            "only: rounded edges and handles of a real box would be bright.",
            "Places and sizes are not published in numbers; those of the scene follow the photographs. The box is of "
            "perfect metal whose reflection is diffuse to 30 %; for other shares see the last claim.",
            f"Noise is {SNR_DB:g} dB below the mean power of a sample.",
        ),
    )


def judge(seen: xr.DataTree, scene: Scene3D, body: Folded, view: Facing) -> dict[str, float]:
    """Errors, levels and shares of one corridor, by name."""
    mirrors, (mirror, across) = mirror_errors(seen, faces(scene)), in_view(seen, scene)
    error = next(row for row in mirrors if row.surface == MIRROR and row.generation == 1)
    step = float(np.diff(scene.scanner.angles[0]).mean())
    in_section = bodies.section_distances(body, "mannequin", view)[1]
    numbers = {
        "angle_between_deg": inner_angle(mirror, across),
        "angle_between_se_deg": float(np.hypot(mirror.angle_error, across.angle_error)),
        "mirror_angle_error_deg": float(error.angle_error_deg or 0.0),
        "mirror_offset_error_m": 1e-3 * float(error.offset_error_mm or 0.0),
        "section_distance_mean_m": float(in_section.mean()),
        "section_distance_90_m": float(np.quantile(in_section, 0.9)),
        "unexplained": float(np.mean(body.distance > 0.1)),
    }
    for name in HIDDEN:
        label = name.split()[-1] if name != "inner wall" else "wall"
        numbers |= {f"{label}_{key}": value for key, value in bodies.facts(body, name, view, step).items()}
        one = body.points["bounces"].values[body.of(name)] == 1
        numbers[f"{label}_by_one_mirror"] = float(one.mean()) if one.size else 0.0
    numbers["box_over_wall_db"] = over_wall_db(body)
    numbers["box_over_body_db"] = body.level_db(BOX) - body.level_db("mannequin")
    inner = [row.angle_error_deg for row in mirrors if row.surface == "inner wall"]
    numbers["hidden_wall_angle_error_deg"] = max((float(one or 0.0) for one in inner), default=np.inf)
    return numbers


def _draw(seed: int) -> dict[str, float]:
    """Simulate and fold a random corridor; returns its numbers."""
    scene = families.draw(FAMILY, seed)
    assert isinstance(scene, Scene3D)
    seen = without_pictures(mf.simulate(scene, snr_db=SNR_DB, bounces=2, seed=seed))
    return judge(seen, scene, *_view(seen, scene)[:2])


def _view(reconstruction: xr.DataTree, scene: Scene3D) -> tuple[Folded, Facing, Wall]:
    """The hidden points, the view of the mannequin from the radar's mirror image, and the wall that shows it."""
    body = bodies.folded(reconstruction, scene)
    mine = body.of("mannequin")
    chains, counts = np.unique(body.points["chain"].values[mine], return_counts=True)
    wall = next(one for one in walls_of(reconstruction) if one.chain == str(chains[np.argmax(counts)]))
    return body, bodies.facing(body.place[mine], wall, np.array(scene.scanner.origin)), wall


def _hidden_figure(body: Folded, view: Facing, scene: Scene3D) -> Figure:
    """The folded hidden points, drawn as seen from the radar's mirror image in the outer wall, and from above."""
    mine = np.isin(body.surface, HIDDEN)
    place, amplitude = body.place[mine], body.points["amplitude"].values[mine].astype(float)
    flat = view.flat(place)
    u, z = flat.T
    columns, rows = [np.arange(flat[:, i].min() - 0.1, flat[:, i].max() + 0.1, plot_volume.CELL) for i in (0, 1)]
    figure = Figure(figsize=(11.5, 6.6), layout="constrained")
    front, top = figure.subplots(1, 2, width_ratios=(1.0, 1.1))
    reference = float(np.sqrt(np.nanmax(plot_volume.smoothed_power(u, z, amplitude, columns, rows))))
    picture = plot_volume.draw_front(front, u, z, amplitude, columns, rows, floor_db=FRONT_DB, reference=reference)
    for name in ("mannequin", BOX):
        outline = body.of(name)
        plot_volume.draw_silhouette(front, scene, body.place[outline], view.middle, view.right, columns, rows)
    front.set(title="from the mirror image of the radar", xlabel="across [m]", ylabel="height z [m]", aspect="equal",
              facecolor="0.92")  # fmt: skip
    level = np.clip(to_db(amplitude / reference), FRONT_DB, 0.0)
    order = np.argsort(level)
    top.scatter(*place[order, :2].T, c=level[order], s=9, cmap="inferno", vmin=FRONT_DB, vmax=0.0, linewidths=0)
    plot_volume.scene(scene, top)
    low, high = place[:, :2].min(axis=0) - 0.25, place[:, :2].max(axis=0) + 0.25
    top.set(title="from above", xlim=(low[0], high[0]), ylim=(low[1], high[1]), facecolor="0.92")
    figure.colorbar(picture, ax=[front, top], label=f"amplitude [dB], floor {FRONT_DB:g} dB", shrink=0.8)
    return figure


def _surfaces(body: Folded, view: Facing, scene: Scene3D) -> Table:
    """A row for each hidden surface."""
    step, rows = float(np.diff(scene.scanner.angles[0]).mean()), []
    for name in HIDDEN:
        mine = body.of(name)
        facts = bodies.facts(body, name, view, step)
        chains, counts = np.unique(body.points["chain"].values[mine], return_counts=True)
        ways = ", ".join(f"{count} by {chain}" for chain, count in zip(chains, counts, strict=True))
        rows.append(
            [name, ways, f"{1e3 * facts['distance_mean_m']:.1f}", f"{1e3 * facts['distance_90_m']:.1f}",
             f"{100 * facts['covered']:.0f}", f"{100 * facts['overlap']:.0f}",
             f"{body.level_db(name) - body.level_db('inner wall'):+.1f}"]
        )  # fmt: skip
    columns = ["surface", "points by chain of mirrors", "distance, mean [mm]", "90th percentile [mm]",
               "visible part covered [%]", "silhouette, overlap [%]", "level over the inner wall [dB]"]  # fmt: skip
    return Table(title="What is hidden", columns=columns, rows=rows)


ROWS: tuple[Row, ...] = (
    ("angle_between_deg", "angle between the walls [deg]", 1.0, ".3f"),
    ("mirror_angle_error_deg", "mirror wall, angle error [deg]", 1.0, ".3f"),
    ("hidden_wall_angle_error_deg", "hidden wall, angle error [deg]", 1.0, ".3f"),
    ("mannequin_distance_mean_m", "folded points to the mannequin, mean [mm]", 1e3, ".1f"),
    ("box_distance_mean_m", "folded points to the box, mean [mm]", 1e3, ".1f"),
    ("wall_distance_mean_m", "folded points to the inner wall, mean [mm]", 1e3, ".1f"),
    ("mannequin_covered", "visible mannequin covered [%]", 100.0, ".0f"),
    ("section_distance_mean_m", "section, points to the outline, mean [mm]", 1e3, ".1f"),
    ("mannequin_top_error_m", "top of the head, error of its height [mm]", 1e3, "+.0f"),
    ("box_over_wall_db", "box over the inner wall [dB]", 1.0, ".1f"),
    ("box_over_body_db", "box over the mannequin [dB]", 1.0, ".1f"),
    ("unexplained", "points further than 10 cm from any surface [%]", 100.0, ".1f"),
)


def _claims(numbers: dict[str, Any], levels: dict[float, float], draws: int) -> tuple[Claim, ...]:
    """The claims, each with the criterion by which it is judged."""
    off = numbers["angle_between_deg"] - 90.0
    family = (
        f"; {draws} random corridors: {numbers['family_angle_between_mean_deg']:.3f} +- "
        f"{numbers['family_angle_between_se_deg']:.3f}"
        if draws
        else ""
    )
    distance = {name: numbers[f"{name}_distance_mean_m"] for name in ("mannequin", "box", "wall")}
    covered = {name: numbers[f"{name}_covered"] for name in distance}
    one = min(numbers[f"{name}_by_one_mirror"] for name in distance)
    placed = max(distance.values()) < HALF_CELL and min(covered.values()) > 0.8 and one > 0.95
    brighter = min(numbers["box_over_wall_db"], numbers["box_over_body_db"])
    posture = numbers["section_distance_mean_m"] < HALF_CELL and abs(numbers["mannequin_top_error_m"]) < 2 * HALF_CELL
    return (
        Claim(
            claim="Both walls in view appear with the right angle between them.",
            source=FIGURE,
            measured=f"{numbers['angle_between_deg']:.3f} degrees, standard error of the fits "
            f"{numbers['angle_between_se_deg']:.3f}{family}",
            verdict="agrees" if abs(off) < 0.3 else "differs",
            why="Angle between the two fitted planes. It agrees within 0.3 degrees, by which a wall folds what is "
            "1 m away a centimetre aside.",
        ),
        Claim(
            claim="Mannequin, inner wall and metal box, all hidden, are mirrored by one wall and fold to their places.",
            source=FIGURE,
            measured="; ".join(
                f"{name} {1e3 * distance[name]:.1f} mm, {100 * covered[name]:.0f} % covered" for name in distance
            ),
            verdict="agrees" if placed else "differs",
            why=f"Mean distance of folded points from the true surface, below half a resolution cell "
            f"({1e3 * HALF_CELL:.1f} mm) for each; over 80 % of what one mirror shows within 3 cm of a point; over "
            f"95 % of the points seen by way of one mirror ({100 * one:.0f} %).",
        ),
        Claim(
            claim="The metal box appears brighter.",
            source=FIGURE,
            measured=f"{numbers['box_over_wall_db']:.1f} dB over the inner wall, {numbers['box_over_body_db']:.1f} dB "
            "over the mannequin",
            verdict="agrees" if brighter > 3.0 else "differs",
            why="Mean power of the folded points; it agrees above 3 dB over both. It holds for a box whose reflection "
            "is diffuse to 30 %, see the last claim.",
        ),
        Claim(
            claim="The upright section shows the mannequin's outline and posture.",
            source=FIGURE,
            measured=f"points in the section {1e3 * numbers['section_distance_mean_m']:.1f} mm from the true outline, "
            f"90 % within {1e3 * numbers['section_distance_90_m']:.1f} mm; top of the head "
            f"{1e3 * numbers['mannequin_top_error_m']:+.0f} mm",
            verdict="agrees" if posture else "differs",
            why="Points within 1.7 cm of the upright plane through the body's middle. It agrees if their mean is below "
            "half a resolution cell and the head ends within a whole one.",
        ),
        Claim(
            claim="What makes a flat metal box bright that is seen obliquely?",
            source="",
            measured=f"its texture: brighter than the wall where more than {100 * numbers['least_diffuse_share']:.0f} "
            "% of its reflection is diffuse; " + told(levels),
            verdict="new",
            why="The share at which the box equals the wall follows from Lambert's law; boxes of several textures were "
            "scanned. Smooth metal reflects all power past the radar.",
        ),
    )


def _text(numbers: dict[str, Any]) -> tuple[str, ...]:
    """What can be learnt."""
    return (
        "A corner of two walls at right angles shows itself: each wall is seen in the other, behind the corner, as if "
        "it went on straight. Unfolded, the image shows a cross; folded, both images lie on the walls that they are "
        "of. Their agreement is a test of the angle that needs no truth.",
        f"The angle comes out {numbers['angle_between_deg'] - 90.0:.2f} degrees too large, and in random corridors "
        "alike. It fits that beams which straddle the corner have nothing of a wall beyond it: the centre of their "
        "footprint lies before the corner, and the end of each wall seems to bend towards the radar. That turns a "
        "wall the more the shorter it is. Alone, and scattering on their faces only, the walls enclose "
        + " and ".join(
            f"{numbers[f'angle_end_wall_{length}m_deg']:.3f} degrees with an end wall of {length} m"
            for length in ("0.5", "1")
            if f"angle_end_wall_{length}m_deg" in numbers
        )
        + ".",
        "One wall shows three things, and each hides what is behind it: the mirrored inner wall is seen above and "
        "below the box, and there as a plane that is no mirror for anything in range.",
        "A flat box does not return a glint to a radar that sees it at 30 degrees from its normal. What is seen of it "
        "is diffuse: texture, labels, rounded edges. Perfect metal reflects ten times more than plasterboard, but "
        f"with less than {100 * numbers['least_diffuse_share']:.0f} % of it diffuse the box is darker than the wall, "
        "which scatters from its inside. So brightness tells texture as much as metal; the published box must have "
        "had some, or edges.",
        "What limits the picture of the body is the field of view, which cuts off one arm, and not the noise.",
    )
