"""Antennas with an aperture, as point sources side by side.

A horn of width w radiates like its aperture field, ``cos(pi x / w)`` in the H-plane, which point sources at most half
a wavelength apart sample (Balanis, Antenna Theory, 4th ed., section 13.3). Neighbouring horns of an array overlap on
one lattice of sources, so that hardly more have to be simulated than there are antennas, by any solver and with the
pattern in every path, reflected or not. The pattern is that of the cosine to within a tenth of its peak.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.scenes.arrays import LinearArray
from mirrorfold.scenes.floor_plan import Scene

HALF_WAVE_TOLERANCE = 0.01
"""Share of half a wavelength by which sources may stand further apart: a beam's replica stays at the horizon."""

Complex64 = NDArray[np.complex64]


def point_sources(scene: Scene) -> tuple[Scene, Callable[[Complex64], Complex64]]:
    """The same scene seen by point sources, and what makes of their samples those of the antennas.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    scene : Scene
    gather : callable
        From samples (frequencies, sources, sources) to (frequencies, tx, rx).
    """
    receivers = scene.array if scene.array.rx is None else scene.array.rx
    if scene.array.horn is None and receivers.horn is None:
        return scene, lambda s: s
    shortest = speed_of_light / scene.band.stop
    tx, tx_weight = _lattice(scene.array, shortest)
    rx, rx_weight = _lattice(receivers, shortest)
    seen = replace(scene, array=replace(tx, rx=None if scene.array.rx is None else rx))

    def gather(s: Complex64) -> Complex64:
        return np.asarray(tx_weight @ s @ rx_weight.T, dtype=np.complex64)

    return seen, gather


def _lattice(array: LinearArray, wavelength: float) -> tuple[LinearArray, NDArray[np.float32]]:
    """Point sources for all horns of an array, and each horn's weights of them, (antennas, sources), of sum one."""
    if array.horn is None:
        return replace(array, rx=None), np.eye(len(array.present), dtype=np.float32)
    finer = int(np.ceil(array.pitch / (0.5 * wavelength) - HALF_WAVE_TOLERANCE))
    spacing = array.pitch / finer
    aside = int(np.ceil(0.5 * array.horn / spacing)) - 1
    sources = (array.elements - 1) * finer + 1 + 2 * aside
    taper = np.cos(np.pi * spacing * np.arange(-aside, aside + 1) / array.horn)
    weight = np.zeros((array.elements, sources), dtype=np.float32)
    for element in range(array.elements):
        weight[element, element * finer : element * finer + taper.size] = taper / taper.sum()
    lattice = LinearArray(elements=sources, pitch=spacing, center=array.center, direction=array.direction)
    return lattice, weight[array.present]
