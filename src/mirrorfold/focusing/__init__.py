"""Step 1 of the algorithm: from the raw sweep to the complex image."""

from __future__ import annotations

from mirrorfold.focusing.api import focus
from mirrorfold.focusing.grid import default_grid, sweep_grid
from mirrorfold.focusing.plan import FocusPlan, prepare
from mirrorfold.focusing.range_profiles import focus_raster, plan_view, to_voxels

__all__ = [
    "FocusPlan",
    "default_grid",
    "focus",
    "focus_raster",
    "plan_view",
    "prepare",
    "sweep_grid",
    "to_voxels",
]
