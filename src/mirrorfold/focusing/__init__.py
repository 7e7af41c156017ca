"""Step 1 of the algorithm: from the raw sweep to the complex image.

Users call `focus` (in `imaging`), `FocusPlan` (`plan`) for frame after frame, `FocusOperator` (`operator`) for inverse
problems, and beforehand `choose_algorithm` (`forecast`). `settings` declares what they may choose. From a sweep and the
settings `checks` makes a `problem`: the sum to be computed, by default on the pixels of `grid`. `labels` puts
coordinates and attributes on the image. The sum is computed in folders, each of which uses only those named before it:

    exact/       all pairs, for antennas anywhere: in float64 the reference, in single precision the image; errors
    echoes/      for antennas anywhere: the part of a sweep that holds some ranges; whether an echo adds up in phase
    lines/       antennas on one line or nearly so: one sector of the image, through a polar grid
    predicting/  time and memory of each way on this machine
    fast/        whole images of line arrays ("polar"), and of large arrays of any shape ("factorized")
    choosing/    the fastest way, in strips where memory is short, held to the tolerance, and kept for the next sweep
    scans/       raster scans, whose beams are focused by a lens: range profiles, volumes, floor plans and voxels
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mirrorfold.focusing.choosing.caching import PlanCache, plan_cache, prepare
    from mirrorfold.focusing.forecast import choose_algorithm
    from mirrorfold.focusing.grid import default_grid, sweep_grid
    from mirrorfold.focusing.imaging import focus
    from mirrorfold.focusing.operator import FocusOperator
    from mirrorfold.focusing.plan import FocusPlan
    from mirrorfold.focusing.scans.gridding import plan_view, to_voxels
    from mirrorfold.focusing.scans.range_profiles import focus_raster
    from mirrorfold.focusing.settings import FocusSettings

_HOME = {
    "FocusOperator": "operator",
    "FocusPlan": "plan",
    "FocusSettings": "settings",
    "PlanCache": "choosing.caching",
    "choose_algorithm": "forecast",
    "default_grid": "grid",
    "focus": "imaging",
    "focus_raster": "scans.range_profiles",
    "plan_cache": "choosing.caching",
    "plan_view": "scans.gridding",
    "prepare": "choosing.caching",
    "sweep_grid": "grid",
    "to_voxels": "scans.gridding",
}
"""The module of each name: imported when first asked for, so that settings can be read without compiled kernels."""

__all__ = [
    "FocusOperator",
    "FocusPlan",
    "FocusSettings",
    "PlanCache",
    "choose_algorithm",
    "default_grid",
    "focus",
    "focus_raster",
    "plan_cache",
    "plan_view",
    "prepare",
    "sweep_grid",
    "to_voxels",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'mirrorfold.focusing' has no attribute {name!r}")
    value = getattr(import_module(f"mirrorfold.focusing.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
