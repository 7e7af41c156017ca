"""Sweeps by rays and files that several tests need: each is made once in a run, by whichever process needs it first."""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from mirrorfold.io import save
from mirrorfold.simulation.rays import sweep as ray_sweep


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
    simulated = ray_sweep.scattered_field

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

    monkeypatch.setattr(ray_sweep, "scattered_field", field)


@pytest.fixture
def folder(tmp_path, monkeypatch, of_this_run, sweep, image, reconstruction, scene_file):
    """A working directory with a scene and a valid file of each kind, each of which is written once in a run."""
    monkeypatch.chdir(tmp_path)
    for name, thing in (("sweep.nc", sweep), ("image.nc", image), ("reconstruction.nc", reconstruction)):
        if not (of_this_run / name).exists():
            save(thing, own := of_this_run / f"{os.getpid()}_{name}")
            own.replace(of_this_run / name)
        shutil.copy(of_this_run / name, name)
    return tmp_path
