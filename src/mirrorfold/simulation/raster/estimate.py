"""Time, memory and size of the simulation of a raster scan, estimated beforehand."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mirrorfold.common.records import Record, fact
from mirrorfold.scenes.solids import Scene3D
from mirrorfold.simulation.raster.echoes import beam_reach, find_echoes
from mirrorfold.simulation.raster.spreading import DelayGrid
from mirrorfold.simulation.raster.sweep import needed_points


class ScanEstimate(Record):
    """Time, memory and size of the simulation of a raster scan, estimated beforehand."""

    kind: Literal["estimate"]
    scatterers: int
    chains: int
    echoes: int
    longest_return_m: float
    needed_frequencies: int
    frequencies: int
    beams: int
    sweep_bytes: int
    memory_gb: float = fact("of the process")
    seconds: float
    remarks: list[str] = fact("sentences on what looks wrong")


def estimate(scene: Scene3D, *, bounces: int, seed: int = 0) -> ScanEstimate:
    """Time, memory and size of a simulation, without running it: only its echoes are found.

    The time is a rough figure for one core.
    """
    echoes, counts = find_echoes(scene, bounces=bounces, seed=seed)
    azimuth, elevation = scene.scanner.angles
    beams = azimuth.size * elevation.size
    reach = beam_reach(echoes.width, echoes.range)
    cell = float(np.diff(azimuth).mean() * np.diff(elevation).mean())
    lit = float(np.sum(4.0 * reach**2 / cell))
    size = DelayGrid(scene.band.points).size
    return ScanEstimate(
        kind="estimate",
        **counts,
        echoes=int(echoes.range.size),
        longest_return_m=float(echoes.range.max(initial=0.0)),
        needed_frequencies=needed_points(scene, echoes),
        frequencies=scene.band.points,
        beams=int(beams),
        sweep_bytes=8 * beams * scene.band.points,
        memory_gb=(PROCESS_BYTES + max(SCATTERER_BYTES * counts["scatterers"], 16.0 * beams * scene.band.points)) / 1e9,
        seconds=float(SECONDS_PER_SPREAD * lit + SECONDS_PER_FLOP * beams * size * np.log2(size)),
        remarks=[],
    )


PROCESS_BYTES = 3.3e8
"""Memory of a process with its libraries [B]."""

SCATTERER_BYTES = 220.0
"""Memory per scatterer while all of them are made [B]. The samples are made later, and are then held twice."""

SECONDS_PER_SPREAD, SECONDS_PER_FLOP = 2.5e-8, 2e-9
"""Time [s] of one echo in one beam, and of one butterfly of the FFT: measured on one core of a small server."""
