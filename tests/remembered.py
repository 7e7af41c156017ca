"""Sweeps by rays that several tests need: each is simulated once in a run, by whichever process needs it first."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest

from mirrorfold.simulation.rays import sweep


@pytest.fixture(scope="session")
def of_this_run(tmp_path_factory):
    """A folder that the processes of one run of the tests share, and no other run."""
    folder = tmp_path_factory.getbasetemp()
    folder = (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "remembered"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture
def remembered_rays(of_this_run, monkeypatch):
    """The same scene by rays, with the same settings, is read back instead of simulated again."""
    simulated = sweep.scattered_field

    def field(scene, *, progress=None, **settings):
        path = of_this_run / f"{hashlib.sha256(repr((scene, settings)).encode()).hexdigest()}.npy"
        if not path.exists():
            found = simulated(scene, progress=progress, **settings)
            own = Path(of_this_run, f"{os.getpid()}.npy")
            np.save(own, found)
            own.replace(path)
        elif progress is not None:
            progress(scene.band.points, scene.band.points)
        return np.load(path)

    monkeypatch.setattr(sweep, "scattered_field", field)
