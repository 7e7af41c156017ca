"""Step 1 of the algorithm: from the raw sweep to the complex image.

A sweep holds one complex sample for each frequency and each pair of a transmitter and a receiver. An echo from a pixel
turns the phase of each sample by the length of its path, from the transmitter to the pixel and on to the receiver.
Focusing undoes this phase and adds up all samples: where an object stands the terms add up in phase, elsewhere they
cancel. Several algorithms compute this same sum; the fastest one that keeps to the tolerance is taken.

Users call `focus` (module `imaging`) for one sweep, `FocusPlan` (`plan`) for many frames of one geometry,
`FocusOperator` (`operator`) for inverse problems, and `choose_algorithm` (`forecast`) to predict time and memory.
`settings` declares the keywords of all of them. `checks` makes a `Problem` (`problem`) of a sweep and the settings: the
sum to be computed, by default on the pixels of `grid`. `labels` puts coordinates and attributes on the image. These
folders compute the sum; each imports only from those above it:

    exact/       the sum over all pairs, for any array: in float64 the reference, in single precision whole images;
                 and the measured error of an image
    echoes/      for any array: the part of a sweep that comes from some ranges, and how coherent an echo is
    lines/       antennas on one line, or nearly so: one sector of the image, through a polar grid
    predicting/  time and memory of each algorithm on this machine
    fast/        whole images: of line arrays ("polar"), and of large arrays of any shape ("factorized")
    choosing/    which algorithm is taken, strips where memory is short, and plans kept for the next sweep
    scans/       raster scans, whose beams a lens focuses: range profiles, volumes, floor plans and voxels
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mirrorfold.common.lazy import lazy

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

# Settings can be read without the compiled kernels of other modules.
__getattr__, __dir__ = lazy(
    __name__,
    {
        "choosing.caching": ("PlanCache", "plan_cache", "prepare"),
        "forecast": ("choose_algorithm",),
        "grid": ("default_grid", "sweep_grid"),
        "imaging": ("focus",),
        "operator": ("FocusOperator",),
        "plan": ("FocusPlan",),
        "scans.gridding": ("plan_view", "to_voxels"),
        "scans.range_profiles": ("focus_raster",),
        "settings": ("FocusSettings",),
    },
)
