"""The command line that makes a result of the live page again."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mirrorfold.common.settings import option_words
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.folding import PRESETS, FoldSettings


def command_to_repeat(
    viewed: Path,
    output: Path,
    settings: Mapping[str, Any],
    *,
    preset: str = "default",
    frame: int | None = None,
    mirrors: Path | None = None,
    focused: bool = False,
    tested: bool = False,
) -> str:
    """The command line that folds a file with these settings; for a sweep, with the command that focuses it first.

    Parameters
    ----------
    viewed : path
        Sweep, image or reconstruction.
    output : path
        Reconstruction to write.
    settings : mapping
        All settings of folding, by name; those that the preset has are left out.
    preset : str
        A name of `PRESETS`.
    frame : int, optional
        Which frame of a recording.
    mirrors : path, optional
        File of the mirrors that are given.
    focused : bool
        Whether the file is a sweep.
    tested : bool
        Whether this sweep tests the echoes of its image.
    """
    chosen = [] if frame is None else ["--frame", str(frame)]
    steps, image = [], str(viewed)
    if focused:
        image = str(viewed.parent / f"{viewed.stem}.image.nc")
        tolerance = ["--tolerance", repr(TOLERANCE_TO_FOLD)]
        steps.append(["mirrorfold", "focus", str(viewed), "-o", image, *tolerance, *chosen])
    words = ["mirrorfold", "fold", image, *(["--sweep", str(viewed)] if tested else []), "-o", str(output)]
    if focused and not tested:  # the image, all that is read, holds this frame alone
        chosen = []
    words += [*chosen, *([] if mirrors is None else ["--mirrors", str(mirrors)])]
    words += [] if preset == "default" else ["--preset", preset]
    for name, value in settings.items():
        if FoldSettings.rules()[name].option and value not in (None, getattr(PRESETS[preset], name)):
            words += option_words(name, value)
    return " && ".join(shlex.join(step) for step in [*steps, words])
