"""What several tests of files need: random samples, and a point target as two arrays measure it."""

from __future__ import annotations

import numpy as np
import pytest
from point_target import echo, line_of


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.fixture
def samples(rng):
    return rng.standard_normal((6, 4)) + 1j * rng.standard_normal((6, 4))


@pytest.fixture
def measured():
    """Frequencies, antennas and samples of a point target, 5 x 7 elements."""
    f = np.linspace(290e9, 300e9, 21)
    tx, rx = line_of(5), line_of(7, 0.01)
    return f, tx, rx, echo(f, tx, rx)


@pytest.fixture
def npz(tmp_path, measured):
    f, tx, rx, s = measured
    np.savez(tmp_path / "d.npz", s=s, f=f, tx=tx, rx=rx, ghz=f / 1e9, bad=np.append(f[:-1], np.nan), jump=f**2)
    return tmp_path / "d.npz"


@pytest.fixture
def folder(folder):
    """The same working directory, with short names of files."""
    for path in folder.glob("*.nc"):
        path.rename(f"{path.name[0]}.nc")
    return folder
