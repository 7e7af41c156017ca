"""Fits of straight rows to the image, each computed once.

The search for mirrors is repeated whenever echoes were explained and left out, and mostly finds the same rows again.
The fit of a row depends only on its ends and on the misplaced echoes near it. So the view keeps the results.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np

from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import ImageView

T = TypeVar("T")


def remembered(fit: Callable[[LineMirror, ImageView], T]) -> Callable[[LineMirror, ImageView], T]:
    """Decorate a function of a mirror and a view: each result is computed once and kept in the `fits` of the view.

    Of the mirror, the result may depend on its ends alone. So `fit` gets a mirror that has only these ends.
    """

    @wraps(fit)
    def kept(mirror: LineMirror, view: ImageView) -> T:
        # Misplaced echoes blur areas larger than a cell, so places a cell apart along the row find all of them.
        cell = min(view.range_cell, float(view.cross_cell(mirror.ends).min()))
        along = np.linspace(0.0, 1.0, 2 + int(mirror.length / cell))[:, None]
        blurs = view.misplaced_about(mirror.start + along * (mirror.end - mirror.start))
        key = f"{fit.__module__}.{fit.__qualname__}", mirror.ends.tobytes(), blurs.tobytes()
        if key not in view.fits:
            view.fits[key] = fit(LineMirror(mirror.start, mirror.end), view)
        result: T = view.fits[key]
        return result

    return kept
