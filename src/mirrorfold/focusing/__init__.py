"""Step 1 of the algorithm: from the raw sweep to the complex image.

`imaging` holds `focus`, the way from one to the other; `settings` what can be chosen about it. A sweep's geometry and
the settings make a `problem`, whose sum `exact` computes for any array, `line_array` and `factorized` fast. `choice`
takes the fastest by its `cost` on this `machine`, `proven` holds it to the tolerance, and `plan` keeps it for frame
after frame. `operator` is the model of a measurement with focusing as its adjoint, for the solvers of inverse problems:
`line_transpose` runs the fast path of `line_array` backwards, and `pair_sums` serves any other array. `accuracy`
compares images with the `direct_sum`, term by term in float64. Raster scans are imaged by `range_profiles`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mirrorfold.focusing.caching import PlanCache, plan_cache, prepare
    from mirrorfold.focusing.choice import choose_algorithm
    from mirrorfold.focusing.grid import default_grid, sweep_grid
    from mirrorfold.focusing.gridding import plan_view, to_voxels
    from mirrorfold.focusing.imaging import focus
    from mirrorfold.focusing.operator import FocusOperator
    from mirrorfold.focusing.plan import FocusPlan
    from mirrorfold.focusing.range_profiles import focus_raster
    from mirrorfold.focusing.settings import FocusSettings

_HOME = {
    "FocusOperator": "operator",
    "FocusPlan": "plan",
    "FocusSettings": "settings",
    "PlanCache": "caching",
    "choose_algorithm": "choice",
    "default_grid": "grid",
    "focus": "imaging",
    "focus_raster": "range_profiles",
    "plan_cache": "caching",
    "plan_view": "gridding",
    "prepare": "caching",
    "sweep_grid": "grid",
    "to_voxels": "gridding",
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
