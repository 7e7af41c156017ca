"""Time, memory and disk space of a full-wave sweep, estimated beforehand."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from scipy.linalg import lapack

from mirrorfold.common.records import Record, fact
from mirrorfold.common.threads import one_thread
from mirrorfold.simulation.fullwave.kernel import hankel
from mirrorfold.simulation.fullwave.solver import System

SMALL_BLOCKS = 2.0
"""Time of an operation on the small matrix of a group over that on a large matrix."""

PROCESS_BYTES = 2.5e8
"""Memory of a process with its libraries [B]."""


@dataclass(frozen=True)
class Estimate:
    """Time, memory and disk space of a sweep in one polarization.

    Attributes
    ----------
    unknowns, skeletons : int
        Number of unknowns, one per node of a conductor and two per node of a dielectric body, and size of the last
        dense system that they are reduced to.
    seconds_per_frequency : float [s]
        Time per frequency on one core.
    memory : float [B]
        Memory of each process.
    disk : float [B]
        Disk space of the results by frequency and of the sweep together.
    """

    unknowns: int
    skeletons: int
    seconds_per_frequency: float
    memory: float
    disk: float


class FullWaveEstimate(Record):
    """Time, memory and disk space of a full-wave simulation, estimated beforehand."""

    kind: Literal["estimate"]
    unknowns: int
    skeletons: int
    frequencies: int
    workers: int
    cpu_seconds_per_frequency: float
    minutes: float
    memory_per_worker_gb: float
    memory_gb: float
    disk_gb: float
    remarks: list[str] = fact("sentences on what looks wrong")


def estimate(system: System, frequencies: int) -> Estimate:
    """The cost of a sweep, from the sizes of its groups and the speed of this machine."""
    values, operations, kept = 0.0, 0.0, 0.0
    for group in (group for root in system.roots for group in root.walk()):
        n, s, rows = len(group.members), len(group.skeleton), len(group.scale)
        values += n * (n + rows)
        kept += n * (n if group.children else 0) + 2 * n * s
        operations += SMALL_BLOCKS * (8 / 3 * n**3 + 8 * n * n * s + 8 * (rows + s) * s * n)
    top = sum(len(root.skeleton) for root in system.roots) or system.equation.size
    blocks = sum(len(root.skeleton) ** 2 for root in system.roots)
    values += top * (top + len(system.antennas))
    operations += 8 / 3 * top**3 + 8 * top * top * len(system.tx) + 8 * top * blocks
    rate, flops = _speed()
    return Estimate(
        unknowns=system.equation.size,
        skeletons=top,
        seconds_per_frequency=values / rate + operations / flops,
        memory=PROCESS_BYTES + 8.0 * (1.1 * top * top + 2 * blocks + kept + 4 * top * len(system.antennas)),
        disk=2.0 * 8.0 * frequencies * len(system.tx) * len(system.rx),
    )


@cache  # half a second of measurement, which every small sweep of a script would pay anew
def _speed() -> tuple[float, float]:
    """Measured speed of one core: values of the kernel per second, and floating-point operations of LU per second."""
    generator = np.random.default_rng(0)
    points = generator.random((1500, 2))
    square = (points[:, :1] + 1j * points[:, 1]).astype(np.complex64) + 10.0 * np.eye(1500, dtype=np.complex64)
    rates = []
    with one_thread():
        for work, size in (
            (lambda: hankel(points, points + 2.0, 1e4), points.shape[0] ** 2),
            (lambda: lapack.cgetrf(square), 8 / 3 * len(square) ** 3),
        ):
            work()
            start = time.process_time()
            work()
            rates.append(size / max(time.process_time() - start, 1e-6))
    return rates[0], rates[1]
