"""Recordings of raster scans: each frame is imaged like a scan of its own."""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import noise

import mirrorfold as mf

VOXELS = {"x": np.linspace(-0.1, 0.1, 5), "y": np.linspace(0.5, 1.0, 6), "z": np.linspace(-0.05, 0.05, 4)}


@pytest.mark.parametrize("axes", [{}, VOXELS])
def test_frames_are_imaged_like_scans(axes, tmp_path):
    angles = {"azimuth": np.linspace(-8.0, 8.0, 9), "elevation": np.linspace(-4.0, 4.0, 5)}
    frequency = np.linspace(290e9, 300e9, 41)
    scans = mf.make_raster_sweep(noise((2, 41, 9, 5)), frequency=frequency, time=[0.0, 0.5], **angles)
    images = mf.focus(scans, **axes)
    for n in range(2):
        np.testing.assert_array_equal(images.isel(frame=n), mf.focus(scans.isel(frame=n), **axes))
    mf.save(images, tmp_path / "images.nc")
    read = mf.load(tmp_path / "images.nc")
    assert read.dims == images.dims
    np.testing.assert_array_equal(read["time"], [0.0, 0.5])
    assert mf.pick_frame(read, 1).dims == images.dims[1:]
