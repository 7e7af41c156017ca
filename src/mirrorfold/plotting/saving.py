"""Writing of figures to files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any


def save_figure(figure: Any, path: Path, **options: Any) -> None:
    """Draw a figure in memory, then write its file at once, because Matplotlib hides a full disk behind other errors.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path
        Its suffix tells the format.
    **options
        Options of `matplotlib.figure.Figure.savefig`, such as `dpi`.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix.lower().removeprefix("."), **options)
    path.write_bytes(content.getvalue())
