"""Voxels of planar arrays, which are folded as their floor plan."""

from __future__ import annotations

import numpy as np
from point_sweeps import echoes

import mirrorfold as mf


def test_objects_above_and_below_the_antennas_are_no_mixed_paths():
    """The sweep was asked whether their waves came from the height of the antennas, and said no."""
    frequency = np.linspace(76e9, 81e9, 81)
    place = 2e-3 * (np.arange(12) - 5.5)
    tx = np.array([[x, 0.0, z] for x in (-0.012, 0.012) for z in place])
    rx = np.array([[x, 0.0, z] for z in (-0.012, 0.012) for x in place])
    points = np.array([[0.15, 1.5, 0.6], [-0.3, 1.2, -0.5]])
    s = echoes(frequency, tx, rx, points)
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx)
    axes = {"x": np.arange(-0.7, 0.71, 0.05), "y": np.arange(0.7, 1.91, 0.03), "z": np.arange(-0.8, 0.81, 0.05)}
    found = mf.reconstruct(mf.add_noise(sweep, snr_db=20.0, seed=0), **axes)
    seen = found["objects"].dataset
    for x, y, _ in points:
        beside = np.hypot(seen["x"].values - x, seen["y"].values - y)
        nearest = int(np.argmin(beside))
        assert beside[nearest] < 0.05
        assert seen["confidence"].values[nearest] > 0.5
        assert seen["explanation"].values[nearest] == ""
    assert "left by one way" not in " ".join(seen["explanation"].values.tolist())
    assert "voxels are folded as their floor plan" in found.attrs["remark"]
