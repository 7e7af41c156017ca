"""How the walls of a room mirror and scatter terahertz waves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.decibels import power_decibel
from mirrorfold.common.records import Number, Record
from mirrorfold.common.slabs import POLARIZATIONS
from mirrorfold.common.types import Array
from mirrorfold.scenes.materials import coherent_factor, material

ANGLES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
"""Angles of incidence at which a wall is described [degree]."""


class Wall(Record):
    """Shares of the power that a wall mirrors and scatters, by angle of incidence."""

    angle_deg: list[float]
    specular_te_db: list[Number]
    specular_tm_db: list[Number]
    diffuse_db: list[Number]


def wall(name: str, frequency: float, roughness: tuple[float, float | None], angles: Sequence[float] = ANGLES) -> Wall:
    """Shares of the power that a wall mirrors and scatters, by angle of incidence [degree].

    Parameters
    ----------
    name : str
        Name of the material.
    frequency : float [Hz]
    roughness : (rms height, correlation length or None) [m]
    angles : list of float [degree]

    Returns
    -------
    Wall
        `angle_deg`; the mirrored shares `specular_te_db` and `specular_tm_db` for E perpendicular to the plane of
        incidence and in it; the scattered share `diffuse_db`, the mean of both. None where there is no power.
    """
    specular, diffuse = shares(name, np.array(frequency), np.radians(angles), roughness)
    return Wall(
        angle_deg=[float(angle) for angle in angles],
        specular_te_db=[power_decibel(value) for value in specular[0]],
        specular_tm_db=[power_decibel(value) for value in specular[1]],
        diffuse_db=[power_decibel(value) for value in diffuse.mean(axis=0)],
    )


def shares(name: str, frequency: Array, angle: Array, roughness: tuple[float, float | None]) -> tuple[Array, Array]:
    """Mirrored and scattered shares of the power, each (2, ...) for TE and TM.

    `frequency` [Hz] and `angle` of incidence [rad] are broadcast; `name` and `roughness` are as for `wall`.
    """
    kind = material(name)
    reflected = np.stack(
        [np.abs(kind.reflection(frequency, angle, polarization)) ** 2 for polarization in POLARIZATIONS]
    )
    coherent = coherent_factor(roughness[0], frequency, angle, correlation_length=roughness[1]) ** 2
    return reflected * coherent, reflected * (1.0 - coherent)
