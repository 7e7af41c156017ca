"""Figures as files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any


def save_figure(figure: Any, path: Path, **options: Any) -> None:
    """Write a figure in one piece, once it is drawn: Matplotlib's writers hide that a disk is full behind other errors.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path
        Its suffix says the format.
    **options
        Of `matplotlib.figure.Figure.savefig`, such as `dpi`.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix.lower().removeprefix("."), **options)
    path.write_bytes(content.getvalue())
