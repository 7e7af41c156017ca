"""The verbs of the algorithm: `focus`, step 1; `fold`, steps 2 to 6; and `reconstruct`, all steps in one command.

Outputs are checked before the work begins, so that hours of work are not lost to a missing directory.
"""

from __future__ import annotations

from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mirrorfold as mf
from mirrorfold.cli.forecast import forecast_fold, forecast_sweep, show_forecast
from mirrorfold.cli.many import reconstruct_many
from mirrorfold.cli.options import (
    CrossRanges,
    Export,
    FloorPlanFile,
    Frame,
    Heights,
    Mirrors,
    OptionalOutput,
    Preset,
    Ranges,
    command,
)
from mirrorfold.cli.results import (
    BODY,
    FRAMES,
    PICTURE,
    RECONSTRUCTION,
    REPORT,
    SPACE,
    check_export,
    check_exported,
    frames_kept,
    load_mirrors,
    load_plan,
    one_frame,
    parse_grid,
    read,
    report_reconstruction,
    write_export,
    write_results,
)
from mirrorfold.cli.terminal import progress, remark, show_result
from mirrorfold.cli.writing import netcdf_file, output_directory, required
from mirrorfold.common.settings import takes
from mirrorfold.common.units import Memory
from mirrorfold.errors import InputError
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD, FocusSettings
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.io import prepare_to_read

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.describing.sweeps import SweepFacts

NAMES = (RECONSTRUCTION, PICTURE, FRAMES, BODY, SPACE, REPORT)
"""Files that may be written to the directory of a reconstruction."""


@takes(FocusSettings, options=True)
def focus(
    sweep: Path,
    *,
    output: OptionalOutput = None,
    x: CrossRanges = None,
    y: Ranges = None,
    z: Heights = None,
    frame: Frame = None,
    dry_run: bool = False,
    json: bool = False,
    **given: Any,
) -> None:
    """Focus a sweep.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF).
    output
        Image to write (netCDF); not needed for a dry run.
    **given
    dry_run
        Print which algorithm would be taken, why, and the time and memory that it would need; write nothing.
    json
        Print the facts of the image as one JSON object.
    """
    given |= parse_grid(x=x, y=y, z=z)
    if dry_run:
        show_forecast(forecast_sweep(sweep, given, frame), json=json)
        return
    output = required(output, "image.nc")
    netcdf_file(output, inputs=[sweep])
    prepare_to_read(sweep)
    from mirrorfold.sweep import place_doubts

    focus_sweep = mf.focus  # imported now: two threads must not import at once
    with ThreadPoolExecutor(1) as beside:
        reading, described = _read_beside(beside, sweep, given, frame, diagnose=False)
        measured = reading.result()
        speed = given.get("wave_speed")
        heard = measured if speed is None else measured.assign_attrs(wave_speed=speed)
        remark(f"{doubt.what} Remedy: {doubt.advice}" for doubt in place_doubts(heard))
        with progress("focusing") as report:
            image = focus_sweep(measured, **given, progress=report)
        remark(described.result().remarks)
    mf.save(image.assign_attrs(command=command.get()), output)
    show_result(mf.info(image), [output], json=json)


@takes(FoldSettings, options=True)
def fold(
    image: Path,
    *,
    output: OptionalOutput = None,
    sweep: Path | None = None,
    mirrors: Mirrors = None,
    preset: Preset = "default",
    export: Export = None,
    frame: Frame = None,
    memory_limit: Memory | None = None,
    dry_run: bool = False,
    json: bool = False,
    **given: Any,
) -> None:
    """Fold an image.

    Parameters
    ----------
    image
        Image to read (netCDF), or a reconstruction, whose initial image is folded again.
    output
        Reconstruction to write (netCDF); not needed for a dry run.
    sweep
        Sweep that the image was focused from (netCDF); with it, mixed-path ghosts are told from true echoes.
    **given
    memory_limit
        Memory that the process may hold in all; work that needs more is refused before it begins [B].
    dry_run
        Print the memory that each part of the work would need; write nothing.
    json
        Print mirrors and counts as one JSON object.
    """
    if dry_run:
        show_forecast(forecast_fold(image, sweep, memory_limit, frame), json=json)
        return
    output = required(output, "reconstruction.nc")
    inputs = [path for path in (image, sweep, mirrors) if path is not None]
    netcdf_file(output, inputs=inputs)
    check_export(export, [*inputs, output])
    known = load_mirrors(mirrors)
    focused = read(image, "image", "reconstruction")
    measured = None if sweep is None else read(sweep, "sweep")
    focused, measured = one_frame(frame, focused, measured)
    check_exported(export, focused)
    chosen = {"preset": preset, **given}
    limited: dict[str, Any] = {} if memory_limit is None else {"memory_limit": memory_limit}
    with frames_kept(focused, output, inputs, chosen) as kept:
        with progress("folding") as report:
            reconstruction = mf.fold(
                focused, sweep=measured, mirrors=known, progress=report, **kept, **chosen, **limited
            )
        reconstruction.attrs["command"] = command.get()
        mf.save(reconstruction, output)
    report_reconstruction(reconstruction, [output, *write_export(reconstruction, export)], json=json)


@takes(FocusSettings, FoldSettings, options=True)
def reconstruct(
    *sweep: Path,
    output: OptionalOutput = None,
    x: CrossRanges = None,
    y: Ranges = None,
    z: Heights = None,
    tolerance: float = TOLERANCE_TO_FOLD,
    mirrors: Mirrors = None,
    preset: Preset = "default",
    plan: FloorPlanFile = None,
    export: Export = None,
    frame: Frame = None,
    dry_run: bool = False,
    json: bool = False,
    **given: Any,
) -> None:
    """Reconstruct a scene.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF). If there are several, each gets its own folder in the output, and a line in the summary.
    output
        Directory for reconstruction.nc, before_after.png and report.html; for a raster scan, body.png and space.png
        too, for a recording frames.png. Not needed for a dry run.
    tolerance
        Largest relative L2 error of the image; folding needs no better one.
    **given
    dry_run
        Print the size of the image, its algorithm, and the time and memory that all steps would need; write nothing.
    json
        Print mirrors, counts and files as one JSON object; for several sweeps the summary.
    """
    if not sweep:
        raise InputError("no sweep is given; name the file to reconstruct, for example sweep.nc")
    given |= {"tolerance": tolerance, **parse_grid(x=x, y=y, z=z)}
    if dry_run:
        if len(sweep) > 1:
            raise InputError("--dry-run looks at one sweep and there are several; name one of them")
        show_forecast(forecast_sweep(sweep[0], given, frame, folded=True), json=json)
        return
    output = required(output, "results")
    if export is not None and len(sweep) > 1:
        raise InputError("--export names one file and there are several sweeps; export each with mirrorfold export")
    given |= {"preset": preset}
    extra = [path for path in (mirrors, plan) if path is not None]
    output_directory(output, names=NAMES if len(sweep) == 1 else (), inputs=[*sweep, *extra])
    check_export(export, [*sweep, *extra])
    known, walls = load_mirrors(mirrors), load_plan(plan)

    def work(path: Path, folder: Path) -> tuple[xr.DataTree, list[Path]]:
        return _reconstruct_file(
            path, folder, given, mirrors=known, plan=walls, frame=frame, inputs=extra, export=export
        )

    if len(sweep) == 1:
        reconstruction, files = work(sweep[0], output)
        report_reconstruction(reconstruction, [*files, *write_export(reconstruction, export)], json=json)
        return
    reconstruct_many(sweep, output, work, json=json)


def _reconstruct_file(
    path: Path,
    output: Path,
    given: dict[str, Any],
    *,
    mirrors: Any,
    plan: Any,
    frame: int | None,
    inputs: list[Path],
    export: Path | None,
) -> tuple[xr.DataTree, list[Path]]:
    """Reconstruct the sweep in one file; returns the reconstruction and the files written to the directory `output`."""
    prepare_to_read(path)
    from mirrorfold.io.files import directory_written_atomically

    reconstruct_sweep = mf.reconstruct  # imported now: two threads must not import at once
    with ThreadPoolExecutor(1) as beside:
        reading, described = _read_beside(beside, path, given, frame)
        _ = mf.report, mf.plot.before_after  # imported while the other thread, which imports nothing, is at work
    measured = reading.result()
    check_exported(export, measured)
    remark(described.result().remarks)  # remarks are printed before the work, which may take long
    with frames_kept(measured, output, [path, *inputs], given) as kept:
        with progress(f"reconstructing {path.name}") as report:
            reconstruction = reconstruct_sweep(measured, mirrors=mirrors, progress=report, **kept, **given)
        reconstruction.attrs["command"] = command.get()
        with directory_written_atomically(output, replaces=NAMES) as directory:
            results = write_results(reconstruction, directory, plan=plan)
    return reconstruction, [output / name for name in results]


def _read_beside(
    beside: Executor, path: Path, given: dict[str, Any], frame: int | None, *, diagnose: bool = True
) -> tuple[Future[xr.Dataset], Future[SweepFacts]]:
    """Read and describe a sweep in another thread, while the plan of its image is made in this one.

    The plan goes to the cache, where focusing finds it.

    Parameters
    ----------
    beside : Executor
        Runs the other thread.
    path : path
        File of the sweep.
    given : dict
        Options of the verb, with the settings of focusing among them.
    frame : int or None
        Which frame of a recording; all by default.
    diagnose : bool
        Whether to search the sweep for mistakes.

    Returns
    -------
    reading : Future of xarray.Dataset
        The sweep.
    described : Future of SweepFacts
        Facts and remarks about the sweep.
    """
    # Two threads must not import at once: what the other one needs, for `info` and `one_frame`, is imported here.
    import mirrorfold.describing.sweeps
    import mirrorfold.folding.frames  # noqa: F401
    from mirrorfold.focusing import plan_cache, prepare
    from mirrorfold.io import load_geometry

    geometry, describe = None, mf.info
    with suppress(InputError):  # reading the whole file reports the error
        geometry = load_geometry(path)
    reading = beside.submit(lambda: one_frame(frame, read(path, "sweep"))[0])
    described = beside.submit(lambda: describe(reading.result(), diagnose=diagnose))
    if geometry is not None:
        imaging = {name: given[name] for name in FocusSettings.rules() if name in given}
        with suppress(InputError):  # focusing reports the error
            prepare(geometry, plans=plan_cache, **imaging)
    return reading, described
