"""The angle of a corner of two walls, and how it depends on the length of a wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.reproducing.parts.raster import SNR_DB, Wall, walls_of, without_pictures
from mirrorfold.scenes.scanner import Steps
from mirrorfold.scenes.solids import Panel, Scene3D
from mirrorfold.scoring.mirrors import mirror_errors
from mirrorfold.scoring.volumes import faces

MIRROR, ACROSS = "outer wall", "end wall"
"""The two walls in view: the mirror, which shows the hidden surfaces, and the wall at right angles to it."""

WIDER = 6.0
"""The scan is widened by this angle on the side of the end wall, so that a longer end wall is in view [degree]."""


def inner_angle(one: Wall, other: Wall) -> float:
    """Angle that two walls enclose on the side of the radar [degree]; their normals point to this side.

    Examples
    --------
    >>> normals = np.eye(3)[:2]
    >>> walls = [Wall("", np.zeros(3), normal, np.zeros((4, 3)), 0.0) for normal in normals]
    >>> round(inner_angle(*walls), 6)
    90.0
    """
    return 180.0 - float(np.degrees(np.arccos(np.clip(one.normal @ other.normal, -1.0, 1.0))))


def in_view(seen: xr.DataTree, scene: Scene3D) -> tuple[Wall, Wall]:
    """The two walls in line of sight, as they were found: the mirror, and the wall at right angles to it."""
    judged = zip(walls_of(seen), mirror_errors(seen, faces(scene)), strict=True)
    found = {row.surface: wall for wall, row in reversed(list(judged)) if row.generation == 1}
    return found[MIRROR], found[ACROSS]


def angle_of_corner(scene: Scene3D, length: float, seed: int) -> float:
    """Inner angle [degree] of the two walls in view if the end wall has this length [m], from the corner on. The scene
    consists of these two walls alone, without scattering inside.
    """
    walls = {one.name: replace(one, volume_depth=0.0) for one in scene.surface if isinstance(one, Panel)}
    end = walls[ACROSS]
    along = end.frame.linear[:, 0] * np.sign(end.frame.linear[0, 0])  # to the right, where the corner is
    x, y, z = end.frame.shift + 0.5 * (end.width - length) * along
    azimuth = scene.scanner.azimuth
    assert azimuth is not None
    step = (azimuth.stop - azimuth.start) / (azimuth.points - 1)
    more = int(np.ceil(WIDER / step))
    steps = Steps(start=azimuth.start - more * step, stop=azimuth.stop, points=azimuth.points + more)
    longer = replace(end, width=length, center=(float(x), float(y), float(z)))
    other = replace(scene, scanner=replace(scene.scanner, azimuth=steps), surface=(walls[MIRROR], longer))
    return inner_angle(*in_view(without_pictures(mf.simulate(other, snr_db=SNR_DB, bounces=1, seed=seed)), other))
