"""Random scenes with two walls, seen by any radar, and how well they are folded."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.describing.planning import Instrument, sample_noise, transmitted_power
from mirrorfold.describing.quality import cell_diagonal
from mirrorfold.describing.walls import shares
from mirrorfold.focusing.grid import default_grid
from mirrorfold.reproducing.parts.scenes import shipped_plan
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.arrays import Band, LinearArray
from mirrorfold.scenes.families import Radar, draw
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.surfaces import Roughness, surface_named

UNAMBIGUOUS = 5.0
"""Unambiguous range [m]: the farthest ghosts of hidden objects stand at 3.5 m, and echoes of rays end soon after."""

MOST_RX = 165
"""Largest number of receivers. If receivers half a wavelength apart would be more, only every second, third, ... place
receives. The transmitters stay half a wavelength apart: their beam has no grating lobes, so the product of both beams
has none of full strength."""

MIRRORS = ("wall 1", "wall 2")
"""The wall that hides the objects, and the wall that shows them."""

OBJECT_HEIGHT = 0.10e-3
"""Rms height of the published objects [m]."""

VIEW = (-1.7, 3.3), 4.3
"""Pixels reach from the first to the second x, and up to this y [m]: they cover all scenes and their ghosts."""

Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A radar, and the roughness of the walls that it meets.

    Attributes
    ----------
    frequency : float [Hz]
        Middle of the band.
    bandwidth : float [Hz]
    aperture : float [m]
    rms_height, correlation_length : float [m]
        Roughness of the walls.
    material : str
        Material of the walls.
    object_correlation : float [m]
        Correlation length of the objects' heights.
    """

    frequency: float
    bandwidth: float
    aperture: float = 0.08
    rms_height: float = 0.05e-3
    correlation_length: float = 0.2e-3
    material: str = "pec"
    object_correlation: float = 0.2e-3

    @property
    def radar(self) -> Radar:
        """The radar: antennas fill the aperture, at most half a wavelength apart at the top of the band."""
        top = self.frequency + 0.5 * self.bandwidth
        steps = int(np.ceil(2.0 * self.aperture * top / speed_of_light))
        sparse = int(np.ceil((steps + 1) / MOST_RX))
        steps = sparse * int(np.ceil(steps / sparse))
        pitch = self.aperture / steps
        points = int(np.ceil(2.0 * self.bandwidth * UNAMBIGUOUS / speed_of_light)) + 1
        array: dict[str, Any] = {"kind": "linear", "elements": steps + 1, "pitch": pitch}
        if sparse > 1:
            array["rx"] = {"kind": "linear", "elements": steps // sparse + 1, "pitch": sparse * pitch}
        band = {"start": self.frequency - 0.5 * self.bandwidth, "stop": top, "points": points}
        return Radar(name=f"{self.frequency / 1e9:.0f} GHz", what="", band=band, array=array)

    @property
    def mirrored_db(self) -> float:
        """Share of the power that the walls mirror at 45 degrees [dB]."""
        rough = (self.rms_height, self.correlation_length)
        return float(10.0 * np.log10(shares(self.material, np.array(self.frequency), np.array(np.pi / 4), rough)[0][0]))

    def scene(self, seed: int) -> Scene:
        """The published scene for seed 0, and a random scene for any other seed; the same floor plan for all radars."""
        radar = self.radar
        drawn = shipped_plan("two_walls") if seed == 0 else draw("two walls", seed, radar=radar)
        assert isinstance(drawn, Scene)
        walls = Roughness(rms_height=self.rms_height, correlation_length=self.correlation_length)
        objects = Roughness(rms_height=OBJECT_HEIGHT, correlation_length=self.object_correlation)
        content = dict(radar.array)
        rx = content.pop("rx", None)
        array = LinearArray(**content, rx=LinearArray(**rx) if rx else None)
        return replace(
            drawn,
            array=array,
            band=Band(**radar.band),
            surface=tuple(
                (
                    replace(surface, roughness=walls, material=self.material)
                    if surface.name in MIRRORS
                    else replace(surface, roughness=objects)
                )
                for surface in drawn.surface
            ),
        )


def noise_power(frequency: float) -> float:
    """Power of the noise of a sample, in units of the simulated field, with the electronics of `mirrorfold.plan`.

    The unit follows from a smooth, infinite conducting wall at 1 m. By Friis' formula for the mirror image of the
    radar, it returns the power ``P G^2 lambda^2 / ((4 pi)^2 (2 m)^2)``; in the simulated plane, ``|s|^2 = 1 / (2 m)``.
    """
    electronics = Instrument()
    wavelength = speed_of_light / frequency
    received = transmitted_power(electronics) * power_ratio_of(2.0 * electronics.gain_dbi) * wavelength**2
    received /= (4.0 * np.pi) ** 2 * 2.0**2
    return float(sample_noise(electronics) / received / 2.0)


def judged(work: Work, setting: Setting, seed: int, **settings: Any) -> Row:
    """The scores of `judge` with the setting and the seed; stored, so that they are not computed twice."""
    return work.kept(lambda: asdict(setting) | {"seed": seed} | judge(setting, seed, **settings))


def judge(setting: Setting, seed: int, **settings: Any) -> Row:
    """Simulate a scene, add noise, reconstruct it and score the result."""
    scene = setting.scene(seed)
    sweep = mf.simulate(scene, seed=seed, **settings)
    level = 10.0 * np.log10(float((np.abs(sweep["s"].values) ** 2).mean()) / noise_power(setting.frequency))
    sweep = mf.sweep.add_noise(sweep, snr_db=float(level), seed=seed)
    x, y = default_grid(scene.band.frequency, scene.array.tx_position, scene.array.rx_position)
    x, y = x[(x >= VIEW[0][0]) & (x <= VIEW[0][1])], y[y <= VIEW[1]]
    score = mf.score(mf.reconstruct(sweep, x=x, y=y), scene)
    first = {name: [one for one in score.mirrors if one.surface == name and one.generation == 1] for name in MIRRORS}
    angles = [min(one.angle_error_deg or 0.0 for one in found) for found in first.values() if found]
    hidden = score.hidden
    at_wall = cell_diagonal(setting.frequency, setting.bandwidth, setting.aperture, _distance(scene, "wall 2"))
    far = float(np.median([_range(scene, name) for name in score.surfaces])) if score.surfaces else 3.0
    cell = cell_diagonal(setting.frequency, setting.bandwidth, setting.aperture, far)
    return {
        "f_2cm": hidden.f_score_2cm,
        "f_5cm": hidden.f_score_5cm,
        "f_cells": hidden.f_score_cells,
        "accuracy_m": hidden.accuracy_m,
        "shown": float(bool(first["wall 2"])),
        "both_walls": float(all(first.values())),
        "angle_deg": float(np.mean(angles)) if angles else None,
        "cell_m": cell,
        "wall_cells": _length(scene, "wall 2") / at_wall,
        "target_cells": float(np.mean([one.reachable_m for one in score.surfaces.values()])) / cell,
        "mirrored_db": setting.mirrored_db,
    }


def _length(scene: Scene, name: str) -> float:
    """Length of a surface [m]."""
    return float(surface_named(scene, name).sample(0.01)[2].sum())


def _distance(scene: Scene, name: str) -> float:
    """Distance of the middle of a surface from the radar [m]."""
    return float(np.linalg.norm(surface_named(scene, name).sample(0.01)[0].mean(axis=0)))


def _range(scene: Scene, name: str) -> float:
    """Range of a surface's ghost in wall 2 [m]: the length of the path from the radar by way of this wall."""
    wall = surface_named(scene, "wall 2").pieces(1.0)[0]
    middle = surface_named(scene, name).sample(0.01)[0].mean(axis=0)
    return float(np.linalg.norm(reflect(middle, wall[0], segment_normal(*wall))))
