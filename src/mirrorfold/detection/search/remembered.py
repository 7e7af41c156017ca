"""What the image tells of a straight row, computed once.

The search for mirrors is repeated whenever echoes were explained and left out, and mostly finds the same rows again.
How a row is fitted to the image depends on its ends, and on places that misplaced echoes blur. It does not depend on
the echoes that are left. So the view keeps the results.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np

from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import ImageView

T = TypeVar("T")


def remembered(ask: Callable[[LineMirror, ImageView], T]) -> Callable[[LineMirror, ImageView], T]:
    """A function of a mirror and a view that computes each answer once: the view keeps the answers in `fits`.

    The answer may depend on the ends of the mirror alone. So `ask` gets a mirror that has nothing but these ends.
    """

    @wraps(ask)
    def known(mirror: LineMirror, view: ImageView) -> T:
        # A fit moves a row by less than the size of the area that a misplaced echo blurs. Places a cell apart suffice.
        cell = min(view.range_cell, float(view.cross_cell(mirror.ends).min()))
        along = np.linspace(0.0, 1.0, 2 + int(mirror.length / cell))[:, None]
        blurs = view.misplaced_about(mirror.start + along * (mirror.end - mirror.start))
        key = f"{ask.__module__}.{ask.__qualname__}", mirror.ends.tobytes(), blurs.tobytes()
        if key not in view.fits:
            view.fits[key] = ask(LineMirror(mirror.start, mirror.end), view)
        answer: T = view.fits[key]
        return answer

    return known
