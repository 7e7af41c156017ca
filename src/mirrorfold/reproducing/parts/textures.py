"""How bright a flat metal box is at oblique incidence, by its texture: the share of its reflection that is diffuse."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.common.decibels import COLOURS
from mirrorfold.common.geometry import reflect
from mirrorfold.plotting.volumes import FEWEST
from mirrorfold.reproducing.parts import bodies
from mirrorfold.reproducing.parts.bodies import Folded
from mirrorfold.reproducing.parts.raster import SNR_DB, without_pictures
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.scenes.surfaces import surface_named
from mirrorfold.simulation.raster.speckle import diffuse_share

BOX, BEHIND, MIRROR = "extinguisher box", "inner wall", "outer wall"
"""The box; the wall behind it, with which it is compared; and the wall that shows both."""

LEAST = 0.006
"""Least diffuse share in the picture, its left end: such a box is 12 dB darker than the wall."""


def box_of(scene: Scene3D) -> Any:
    """The box among the surfaces of a scene."""
    return surface_named(scene, BOX)


def over_wall_db(body: Folded) -> float:
    """Level of the points on the box over those on the wall behind it [dB]; minus infinity with fewer than `FEWEST`.

    So few points are probably not of the box, but of surfaces near it.
    """
    if np.count_nonzero(body.of(BOX)) < FEWEST:
        return -np.inf
    return body.level_db(BOX) - body.level_db(BEHIND)


def level_of(scene: Scene3D, share: float) -> float:
    """Level of the box over the wall behind it [dB], if this share of the box's reflection is diffuse."""
    changed = tuple(replace(one, diffuse_fraction=share) if one.name == BOX else one for one in scene.surface)
    other = replace(scene, surface=changed)
    return over_wall_db(bodies.folded(without_pictures(mf.simulate(other, snr_db=SNR_DB, bounces=1)), other))


def predicted_db(scene: Scene3D, body: Folded) -> float:
    """Predicted level of the box over the wall behind it [dB], by Lambert's law.

    A beam that a surface fills returns the power ``Q(t) cos(t)``, with the angle of incidence t and the share Q that
    is scattered diffusely.
    """
    frequency, means = scene.band.middle, []
    mirror = surface_named(scene, MIRROR)
    radar = reflect(scene.scanner.origin, mirror.frame.shift, mirror.frame.linear[:, 1])
    known = body.known
    for name in (BOX, BEHIND):
        finish = surface_named(scene, name)
        mine = known.reachable & (np.array([known.names[int(one)] == name for one in known.owner]))
        sight = radar - known.place[mine]
        cosine = np.einsum("nd,nd->n", sight, known.normals[mine]) / np.linalg.norm(sight, axis=1)
        share = diffuse_share(finish, frequency, cosine, inside=False)
        if finish.volume_depth > 0.0:
            share = share + diffuse_share(finish, frequency, cosine, inside=True)
        means.append(float(np.mean(share * cosine)))
    return float(10.0 * np.log10(means[0] / means[1]))


def told(levels: dict[float, float]) -> str:
    """Level of the box by its texture, in words."""
    words = (f"{level:+.1f} dB" if np.isfinite(level) else "not seen" for _, level in sorted(levels.items()))
    return ", ".join(f"at {100 * share:g} % {word}" for share, word in zip(sorted(levels), words, strict=True))


def levels_dataset(levels: dict[float, float]) -> xr.Dataset:
    """Level of the box by its texture."""
    shares = sorted(levels)
    level = ("diffuse_share", [levels[share] for share in shares], {"units": "dB", "long_name": "over the inner wall"})
    return xr.Dataset({"level": level}, coords={"diffuse_share": ("diffuse_share", shares, {"units": "1"})})


def draw_levels(levels: dict[float, float], share: float, predicted: float, body: float) -> Figure:
    """Draw the level of the box against its diffuse share, with the level `predicted` at one `share`, and the `body`'s.

    All levels are relative to the inner wall [dB].
    """
    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    ax = figure.subplots()
    line = np.geomspace(LEAST, 1.0, 50)
    ax.plot(line, predicted + 10.0 * np.log10(line / share), color="black", linestyle="dashed", linewidth=0.9,
            label="box, by Lambert's law")  # fmt: skip
    shown = sorted(one for one, level in levels.items() if np.isfinite(level))
    ax.plot(shown, [levels[one] for one in shown], "o", color=COLOURS[1], label="box, folded points")
    gone = ", ".join(f"{100 * one:g} %" for one, level in sorted(levels.items()) if not np.isfinite(level))
    if gone:
        ax.text(0.99, 0.03, f"a box of which {gone} is diffuse shows no points", fontsize=9, ha="right",
                transform=ax.transAxes)  # fmt: skip
    ax.axhline(0.0, color=COLOURS[0], label="inner wall")
    ax.axhline(body, color=COLOURS[5], label="mannequin")
    ax.set(xscale="log", xlabel="share of the box's reflection that is diffuse", ylim=(-15, 15))
    ax.set_ylabel("level over the inner wall [dB]")
    ax.legend(frameon=False, fontsize=9)
    return figure
