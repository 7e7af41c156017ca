"""The verbs of the command line: each reads, calls the function of the same name, writes, and reports.

Outputs are checked before the work begins, so that no hour ends in a missing directory.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import mirrorfold as mf
from mirrorfold.cli.options import Numbers, OptionalOutput, Output, command
from mirrorfold.cli.results import (
    BODY,
    PICTURE,
    RECONSTRUCTION,
    REPORT,
    SPACE,
    available_cores,
    check_export,
    parse_axis,
    read,
    remove_directory,
    report_reconstruction,
    write_cloud,
    write_json,
    write_results,
)
from mirrorfold.cli.terminal import (
    progress,
    remark,
    show_files,
    show_info,
    show_json,
    show_mirrors,
    show_score,
)
from mirrorfold.common.settings import takes
from mirrorfold.errors import InputError
from mirrorfold.focusing.settings import FocusSettings

DEMO_SCENES = {
    "hidden-corner": "hidden_corner.toml",
    "drywall-mannequin": "drywall-mannequin.toml",
    "drywall-control": "drywall-control.toml",
    "corridor": "corridor.toml",
}

DEMO_SNR_DB = 20.0
"""Of the scans in three dimensions, per sample: modest for a vector network analyser."""


def demo(
    *,
    scene: Literal["hidden-corner", "drywall-mannequin", "drywall-control", "corridor"] = "hidden-corner",
    out: Path = Path("demo"),
    json: bool = False,
) -> None:
    """Run the demonstration.

    Parameters
    ----------
    scene
        Which of the scenes that come along.
    out
        Directory for the scene, the sweep, the reconstruction, the pictures and the score.
    json
        Print the score as one JSON object.
    """
    from importlib.resources import files as package_files

    from mirrorfold.io.files import check_output_directory, directory_written_whole

    file = DEMO_SCENES[scene]
    check_output_directory(out, names=(file, "sweep.nc", RECONSTRUCTION, PICTURE, BODY, SPACE, REPORT, "score.json"))
    text = package_files("mirrorfold").joinpath("scenes", "shipped", file).read_text(encoding="utf-8")
    with directory_written_whole(out) as directory:
        (directory / file).write_text(text, encoding="utf-8")
        truth = mf.load_scene(directory / file)
        snr_db = DEMO_SNR_DB if truth.dimensions == 3 else None
        with progress("simulating the sweep") as report:
            sweep = mf.simulate(truth, snr_db=snr_db, progress=report)
        mf.save(sweep, directory / "sweep.nc")
        with progress("reconstructing") as report:
            reconstruction = mf.reconstruct(sweep, progress=report)
        reconstruction.attrs["command"] = command.get()
        results = write_results(reconstruction, directory, scene=truth)
        score = mf.score(reconstruction, truth)
        write_json(score, directory / "score.json")
    paths = [out / name for name in (file, "sweep.nc", *results, "score.json")]
    if json:
        show_json(score.but(files=list(map(str, paths))))
        return
    show_mirrors(mf.info(reconstruction).mirrors)
    show_score(score)
    show_files(paths)
    print(f"open {out / REPORT} in a browser, or look at {out / PICTURE}")


def simulate(
    scene: Path,
    *,
    output: OptionalOutput = None,
    solver: Literal["rays", "fullwave"] = "rays",
    bounces: int = 3,
    seed: int = 0,
    snr_db: float | None = None,
    tolerance: float = 1e-3,
    direct: bool = False,
    check_residual: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    force: bool = False,
    dry_run: bool = False,
    json: bool = False,
) -> None:
    """Simulate a sweep.

    Parameters
    ----------
    scene
        Scene file (TOML).
    output
        Sweep to write (netCDF); needed but for a dry run.
    solver
        How the waves are followed: by rays, or by the integral equation of perfect conductors. What follows snr-db, up
        to resume, is for fullwave alone.
    bounces
        Largest number of mirrors on each way, for rays alone.
    seed
        Of the diffuse scatterers or the random profiles, and of the noise.
    snr_db
        Signal over noise per sample [dB]; no noise by default.
    tolerance
        Relative error of the samples.
    direct
        Add the direct wave from transmitter to receiver.
    check_residual
        Measure how well the equations are solved, at mid-band.
    workers
        Processes that share the frequencies; one for each core by default.
    scheduler
        Address of a Dask scheduler, whose workers share the frequencies instead.
    resume
        Go on with a sweep that was interrupted.
    force
        Of a raster scan: go on where returns wrap around or the scan step is wider than the beam.
    dry_run
        Of full waves or a raster scan: say what the simulation would take, and write nothing.
    json
        Print what was simulated as one JSON object.
    """
    from mirrorfold.io.files import check_output

    truth = mf.load_scene(scene)
    if solver == "fullwave" and workers is None:
        workers = available_cores()
    if dry_run:
        from mirrorfold.simulation import estimate

        options: dict[str, Any] = {"bounces": bounces, "seed": seed, "tolerance": tolerance, "workers": workers or 1}
        cost = estimate(truth, solver=solver, **options)
        show_json(cost) if json else show_info(cost)
        return
    if output is None:
        raise InputError("--output is missing; give the file to write, for example -o sweep.nc")
    check_output(output, inputs=[scene])
    results = output.with_name(f"{output.name}.frequencies")
    try:
        with progress("simulating the sweep") as report:
            sweep = mf.simulate(
                truth,
                solver=solver,
                bounces=bounces,
                seed=seed,
                snr_db=snr_db,
                tolerance=tolerance,
                direct=direct,
                check_residual=check_residual,
                workers=workers or 1,
                scheduler=scheduler,
                checkpoint=results if solver == "fullwave" else None,
                resume=resume,
                force=force,
                progress=report,
            )
    except KeyboardInterrupt:
        if results.exists():
            raise KeyboardInterrupt(f"interrupted; what is done is kept in {results}, --resume goes on") from None
        raise
    mf.save(sweep.assign_attrs(command=command.get()), output)
    if solver == "fullwave":
        remove_directory(results)
    found = mf.info(sweep, diagnose=False)
    remark(found.remarks)
    if json:
        show_json(found.but(files=[str(output)]))
        return
    show_files([output])


@takes(FocusSettings, options=True)
def focus(
    sweep: Path,
    *,
    output: Output,
    x: Numbers = None,
    y: Numbers = None,
    z: Numbers = None,
    json: bool = False,
    **given: Any,
) -> None:
    """Focus a sweep.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF).
    output
        Image to write (netCDF).
    x
        Cross-range of the pixels as START:STOP:STEP [m], for example -2:2:0.005, or one number; chosen from the sweep
        by default.
    y
        Range of the pixels, likewise.
    z
        Height of the pixels, likewise, for a volume; the floor plan by default.
    **given
    json
        Print what the image holds as one JSON object.
    """
    from mirrorfold.focusing import prepare
    from mirrorfold.io import load_geometry
    from mirrorfold.io.files import check_output

    given |= {name: parse_axis(text, name) for name, text in (("x", x), ("y", y), ("z", z)) if text is not None}
    check_output(output, inputs=[sweep])
    geometry = None
    with suppress(InputError):  # reading it all says what is wrong
        geometry = load_geometry(sweep)
    focus_sweep, describe = mf.focus, mf.info  # imported now: two threads must not import at once
    plans = None
    with ThreadPoolExecutor(1) as beside:
        # The plan is made while the samples are read and described.
        reading = beside.submit(read, sweep, "sweep")
        described = beside.submit(lambda: describe(reading.result(), diagnose=False))
        if geometry is not None:
            with suppress(InputError):  # focusing says what is wrong
                plans = prepare(geometry, **given)
        measured = reading.result()
        with progress("focusing") as report:
            image = focus_sweep(measured, **given, plans=plans, progress=report)
        remark(described.result().remarks)
    mf.save(image.assign_attrs(command=command.get()), output)
    found = mf.info(image)
    remark(found.remarks)
    if json:
        show_json(found.but(files=[str(output)]))
        return
    show_files([output])


def fold(
    image: Path,
    *,
    output: Output,
    sweep: Path | None = None,
    mirrors: Path | None = None,
    preset: Literal["default", "published"] = "default",
    threshold_db: float | None = None,
    minimum_length: float | None = None,
    normalization: Literal["r", "none", "r2", "beam"] | None = None,
    wall_margin: float | None = None,
    generations: int | None = None,
    export: Path | None = None,
    json: bool = False,
) -> None:
    """Fold an image.

    Parameters
    ----------
    image
        Image to read (netCDF), or a reconstruction, whose initial image is folded again.
    output
        Reconstruction to write (netCDF).
    sweep
        Sweep that the image was focused from (netCDF); tells mixed-path ghosts from true echoes.
    mirrors
        Mirrors that are known or drawn (JSON); found in the image by default.
    preset
        The algorithm with all its tests, or as it was published.
    threshold_db
        Level that echoes must exceed [dB]; found from the data by default.
    minimum_length
        Of a mirror [m]; in a volume, of its width and height.
    normalization
        Power of range that undoes the spreading; for a volume, beam, r2 or none.
    wall_margin
        How far behind a mirror echoes still belong to the wall [m].
    generations
        Largest number of mirrors in a chain; any number by default.
    export
        Point cloud to write too (.ply, .pcd or .vtp).
    json
        Print mirrors and counts as one JSON object.
    """
    from mirrorfold.detection.known_mirrors import read_mirrors
    from mirrorfold.io.files import check_output

    check_output(output, inputs=[path for path in (image, sweep, mirrors) if path is not None])
    check_export(export)
    lines = None if mirrors is None else read_mirrors(mirrors)
    focused = read(image, "image", "reconstruction")
    measured = None if sweep is None else read(sweep, "sweep")
    with progress("folding") as report:
        reconstruction = mf.fold(
            focused,
            sweep=measured,
            mirrors=lines,
            preset=preset,
            threshold_db=threshold_db,
            minimum_length=minimum_length,
            normalization=normalization,
            wall_margin=wall_margin,
            generations=generations,
            progress=report,
        )
    reconstruction.attrs["command"] = command.get()
    mf.save(reconstruction, output)
    report_reconstruction(reconstruction, [output, *write_cloud(reconstruction, export)], json=json)


def reconstruct(
    sweep: Path,
    *,
    output: Output,
    preset: Literal["default", "published"] = "default",
    threshold_db: float | None = None,
    minimum_length: float | None = None,
    export: Path | None = None,
    json: bool = False,
) -> None:
    """Reconstruct a scene.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF).
    output
        Directory for reconstruction.nc, before_after.png and report.html; of a raster scan, body.png and space.png too.
    preset
        The algorithm with all its tests, or as it was published.
    threshold_db
        Level that echoes must exceed [dB]; found from the data by default.
    minimum_length
        Of a mirror [m]; in a volume, of its width and height.
    export
        Point cloud to write too (.ply, .pcd or .vtp).
    json
        Print mirrors, counts and files as one JSON object.
    """
    from mirrorfold.io.files import check_output_directory, directory_written_whole

    check_output_directory(output, names=(RECONSTRUCTION, PICTURE, BODY, SPACE, REPORT), inputs=[sweep])
    check_export(export)
    measured = read(sweep, "sweep")
    remark(mf.info(measured).remarks)
    with progress("reconstructing") as report:
        reconstruction = mf.reconstruct(
            measured, preset=preset, threshold_db=threshold_db, minimum_length=minimum_length, progress=report
        )
    reconstruction.attrs["command"] = command.get()
    with directory_written_whole(output) as directory:
        results = write_results(reconstruction, directory)
    files = [*(output / name for name in results), *write_cloud(reconstruction, export)]
    report_reconstruction(reconstruction, files, json=json)


def score(reconstruction: Path, scene: Path, *, json: bool = False) -> None:
    """Score a reconstruction.

    Parameters
    ----------
    reconstruction
        Reconstruction to read (netCDF).
    scene
        Scene file with the truth (TOML).
    json
        Print the score as one JSON object.
    """
    truth = mf.load_scene(scene)
    result = mf.score(read(reconstruction, "reconstruction"), truth)
    if json:
        show_json(result)
    else:
        show_score(result)


def info(file: Path, *, json: bool = False) -> None:
    """Describe a file.

    Parameters
    ----------
    file
        Sweep, image, reconstruction (netCDF) or scene (TOML).
    json
        Print all facts as one JSON object.
    """
    with progress("looking for mistakes"):
        found = mf.info(file)
    if json:
        show_json(found)
    if not found.get("valid", True):
        reason, *others = found.remarks
        raise InputError(f"{reason}; {' '.join(others)}")
    if not json:
        show_info(found)
