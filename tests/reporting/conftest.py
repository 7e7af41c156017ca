"""The report of the small reconstruction, as a file."""

from __future__ import annotations

import pytest

import mirrorfold as mf


@pytest.fixture
def address(reconstruction, scene_file, tmp_path):
    """Where a browser finds it."""
    reconstruction.attrs["command"] = "mirrorfold reconstruct sweep.nc -o out"
    return mf.report(reconstruction, tmp_path / "report.html", scene=scene_file).as_uri()
