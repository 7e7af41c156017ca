"""See around corners with terahertz radar: from raw sweeps to the folded, corrected image.

The verbs are plain functions, and each result is the next one's argument::

    import mirrorfold as mf

    sweep = mf.load("sweep.nc")
    reconstruction = mf.reconstruct(sweep)
    mf.plot.before_after(reconstruction)

Nothing heavy is imported before it is used.
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

from mirrorfold.common.lazy import lazy

if TYPE_CHECKING:
    from mirrorfold import calibration as calibrate
    from mirrorfold import plotting as plot
    from mirrorfold.benchmarking import benchmark
    from mirrorfold.describing.comparison import compare
    from mirrorfold.describing.info import info
    from mirrorfold.describing.planning import plan
    from mirrorfold.errors import InputError
    from mirrorfold.focusing import FocusOperator, FocusPlan, focus, plan_view, to_voxels
    from mirrorfold.folding.frames import pick_frame
    from mirrorfold.io import load, save
    from mirrorfold.io.exports.results import export
    from mirrorfold.io.exports.scan_folder import save_touchstone
    from mirrorfold.io.images import import_image
    from mirrorfold.io.importing import import_data
    from mirrorfold.plotting import volumes as plot_volume
    from mirrorfold.reconstruction import FoldPlan, fold, reconstruct
    from mirrorfold.reporting import report
    from mirrorfold.reproducing import reproduce
    from mirrorfold.scenes.floor_plan import Scene, load_scene, parse_scene
    from mirrorfold.scenes.solids import Scene3D
    from mirrorfold.scoring.score import score
    from mirrorfold.simulation import simulate
    from mirrorfold.simulation.fullwave.near_field import near_field
    from mirrorfold.sweep import (
        add_noise,
        check_sweep,
        join_polarizations,
        make_monostatic_sweep,
        make_raster_sweep,
        make_sweep,
    )
    from mirrorfold.viewing import view

try:
    from mirrorfold._version import __version__ as __version__  # written when the package is built or installed
except ImportError:  # the bare sources
    __version__ = "0.0.0"

__all__ = [  # noqa: RUF022  in the order of the work
    "load",
    "save",
    "import_data",
    "import_image",
    "save_touchstone",
    "load_scene",
    "parse_scene",
    "Scene",
    "Scene3D",
    "simulate",
    "near_field",
    "make_sweep",
    "make_monostatic_sweep",
    "make_raster_sweep",
    "check_sweep",
    "join_polarizations",
    "add_noise",
    "plan",
    "info",
    "calibrate",
    "focus",
    "FocusOperator",
    "FocusPlan",
    "plan_view",
    "to_voxels",
    "fold",
    "FoldPlan",
    "reconstruct",
    "pick_frame",
    "score",
    "benchmark",
    "reproduce",
    "compare",
    "export",
    "report",
    "view",
    "plot",
    "plot_volume",
    "InputError",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "benchmarking": ("benchmark",),
        "describing.comparison": ("compare",),
        "describing.info": ("info",),
        "describing.planning": ("plan",),
        "errors": ("InputError",),
        "focusing": ("FocusOperator", "FocusPlan", "focus", "plan_view", "to_voxels"),
        "folding.frames": ("pick_frame",),
        "io": ("load", "save"),
        "io.exports.results": ("export",),
        "io.exports.scan_folder": ("save_touchstone",),
        "io.images": ("import_image",),
        "io.importing": ("import_data",),
        "reconstruction": ("FoldPlan", "fold", "reconstruct"),
        "reporting": ("report",),
        "reproducing": ("reproduce",),
        "scenes.floor_plan": ("Scene", "load_scene", "parse_scene"),
        "scenes.solids": ("Scene3D",),
        "scoring.score": ("score",),
        "simulation": ("simulate",),
        "simulation.fullwave.near_field": ("near_field",),
        "sweep": (
            "add_noise",
            "check_sweep",
            "join_polarizations",
            "make_monostatic_sweep",
            "make_raster_sweep",
            "make_sweep",
        ),
        "viewing": ("view",),
    },
    {"calibrate": "calibration", "plot": "plotting", "plot_volume": "plotting.volumes"},
)


def load_ipython_extension(shell: Any) -> None:
    """Show reconstructions in a notebook with a picture and facts; ``%load_ext mirrorfold`` calls it.

    Where a notebook runs already, importing mirrorfold does so at once.
    """

    def show(tree: Any) -> str:
        return importlib.import_module("mirrorfold.viewing.notebook").to_html(tree)

    shell.display_formatter.formatters["text/html"].for_type_by_name("xarray.core.datatree", "DataTree", show)


if "IPython" in sys.modules and (_shell := sys.modules["IPython"].get_ipython()) is not None:
    load_ipython_extension(_shell)
