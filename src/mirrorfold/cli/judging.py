"""The verbs `info`, the content of a file and its probable mistakes, and `score`, the errors of a reconstruction."""

from __future__ import annotations

from pathlib import Path

import mirrorfold as mf
from mirrorfold.cli.options import Frame
from mirrorfold.cli.results import read
from mirrorfold.cli.terminal import progress, show_info, show_json, show_score
from mirrorfold.errors import InputError


def score(
    reconstruction: Path,
    scene: Path,
    *,
    min_confidence: float | None = None,
    frame: Frame = None,
    json: bool = False,
) -> None:
    """Score a reconstruction.

    Parameters
    ----------
    reconstruction
        Reconstruction to read (netCDF).
    scene
        Scene file with the truth (TOML).
    min_confidence
        Least confidence of points that count, from 0 to 1; by default as the reconstruction was folded.
    json
        Print the score as one JSON object.
    """
    truth = mf.load_scene(scene)
    found = mf.pick_frame(read(reconstruction, "reconstruction"), frame)
    result = mf.score(found, truth, min_confidence=min_confidence)
    if json:
        show_json(result)
    else:
        show_score(result)


def info(file: Path, *, json: bool = False) -> None:
    """Describe a file.

    Parameters
    ----------
    file
        Sweep, image, reconstruction (netCDF) or scene (TOML).
    json
        Print all facts as one JSON object.
    """
    with progress("looking for mistakes"):
        found = mf.info(file)
    if json:
        show_json(found)
    if not found.get("valid", True):
        reason, *others = found.remarks
        raise InputError(f"{reason}; {' '.join(others)}")
    if not json:
        show_info(found)
