"""Forecasts of the time and memory of verbs, for ``--dry-run``."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mirrorfold.cli.results import one_frame, read
from mirrorfold.cli.terminal import show_info, show_json, show_options
from mirrorfold.focusing.settings import FocusSettings

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.common.forecasts import Forecast
    from mirrorfold.focusing.choosing.facts import Choice


def forecast_sweep(path: Path, given: dict[str, Any], frame: int | None = None, *, folded: bool = False) -> Choice:
    """The choice of the focusing algorithm for the sweep in a file, with the time and memory that it needs.

    Parameters
    ----------
    path : path
        File of the sweep.
    given : dict
        Options of the verb, with the settings of focusing among them.
    frame : int, optional
        Which frame of a recording; all by default.
    folded : bool
        Whether to add the time and memory of folding.

    Raises
    ------
    InputError
        If the sweep cannot be read, or not be focused with these settings.
    """
    from mirrorfold.describing.planning import FOLDING_PIXELS_PER_SECOND
    from mirrorfold.focusing import choose_algorithm
    from mirrorfold.reconstruction import check_foldable

    (sweep,) = one_frame(frame, read(path, "sweep"))
    own = {name: value for name, value in given.items() if name in FocusSettings.__dataclass_fields__}
    if folded:
        check_foldable(sweep, FocusSettings().with_given(**own))
    found = choose_algorithm(sweep, frames=int(sweep.sizes.get("frame", 1)), **own)
    if not folded:
        return found
    memory = max(found.memory_gb, _folding_memory_gb(sweep, found, own))
    return found.but(folding_s=found.pixels / FOLDING_PIXELS_PER_SECOND, memory_gb=memory)


def _folding_memory_gb(sweep: xr.Dataset, found: Choice, own: dict[str, Any]) -> float:
    """Memory [GB] of steps 2 to 6, with the samples and the tables of the focusing plan.

    Parameters
    ----------
    sweep : xarray.Dataset
    found : Choice
        The chosen algorithm.
    own : dict
        Settings of focusing.
    """
    from mirrorfold.common.forecasts import GIGABYTE, total
    from mirrorfold.focusing.forecast import expected_image
    from mirrorfold.folding.memory import fold_parts
    from mirrorfold.sweep import is_monostatic, is_raster

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # choosing the algorithm has issued these warnings already
        image = expected_image(sweep, **{**own, "normalization": None})
    tested = not is_raster(sweep) and not is_monostatic(sweep)
    parts = {"samples": 8.0 * sweep["s"].size} | fold_parts(image, sweep if tested else None)
    tables = sum(option.memory_gb or 0.0 for option in found.options if option.chosen)
    return total(parts) / GIGABYTE + tables


def forecast_fold(path: Path, sweep: Path | None, memory_limit: float | None, frame: int | None = None) -> Forecast:
    """The memory that folding the image in a file would need, by its parts.

    Raises
    ------
    InputError
        If a file cannot be read, or the image is too large.
    """
    from mirrorfold.common.forecasts import forecast
    from mirrorfold.folding.earlier import initial_image
    from mirrorfold.folding.memory import fold_parts
    from mirrorfold.reconstruction import FoldPlan

    focused = read(path, "image", "reconstruction")
    found, measured = one_frame(frame, focused, None if sweep is None else read(sweep, "sweep"))
    image = found if hasattr(found, "dims") and not hasattr(found, "children") else initial_image(found)
    single = image.isel(frame=0) if "frame" in image.dims else image
    FoldPlan(single).expect_memory(memory_limit)
    return forecast(fold_parts(image, measured))


def show_forecast(found: Choice | Forecast, *, json: bool) -> None:
    """Print a forecast: the time and memory of the work, and for focusing the grid and the table of algorithms."""
    if json:
        show_json(found)
        return
    show_info({name: value for name, value in found.items() if name not in ("kind", "options")})
    if found.get("options"):
        show_options(found["options"])
