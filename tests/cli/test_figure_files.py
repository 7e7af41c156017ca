"""Figures are written in one piece: a full disk is told as what it is."""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import matplotlib.figure
import pytest

import mirrorfold as mf
from mirrorfold.plotting.saving import save_figure


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg", "PNG"])
def test_a_figure_is_of_the_format_that_its_name_says(tmp_path, suffix):
    save_figure(matplotlib.figure.Figure(figsize=(1, 1)), tmp_path / f"a.{suffix}", dpi=20)
    head = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[suffix.lower()]
    assert (tmp_path / f"a.{suffix}").read_bytes().startswith(head)


LIMITED = """
import resource, sys
from mirrorfold.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
sys.exit(main(["show", sys.argv[1], "-o", sys.argv[2]]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs limits to the size of files")
@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_a_full_disk_is_one_sentence(image, tmp_path, suffix):
    path, figure = mf.save(image, tmp_path / "i.nc"), tmp_path / f"i.{suffix}"
    command = [sys.executable, "-c", LIMITED, str(path), str(figure)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    reason = os.strerror(errno.EFBIG)
    said = f"{figure}: cannot be read or written ({reason}); make room, or choose another place"
    assert done.stderr == f"mirrorfold: {said}\n"
    assert list(tmp_path.iterdir()) == [path]
