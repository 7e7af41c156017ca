"""The verbs of the command line: each reads, calls the function of the same name, writes, and reports.

Outputs are checked before the work begins, so that no hour ends in a missing directory.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

import mirrorfold as mf
from mirrorfold.cli import VERBS
from mirrorfold.cli.terminal import (
    progress,
    remark,
    show_files,
    show_info,
    show_json,
    show_mirrors,
    show_score,
)
from mirrorfold.errors import InputError

Output = Annotated[Path, Parameter(alias="-o")]
Json = Annotated[bool, Parameter(negative="")]
Flag = Annotated[bool, Parameter(negative="")]
Grid = Annotated[str | None, Parameter(allow_leading_hyphen=True)]

PICTURE, RECONSTRUCTION = "before_after.png", "reconstruction.nc"

DEMO_SCENE = "hidden_corner.toml"

command: ContextVar[str] = ContextVar("command", default="mirrorfold")
"""The command line being run, which results carry along."""

app = App(name="mirrorfold", help_format="plaintext", version_flags=[], suppress_keyboard_interrupt=False)


def run(arguments: Sequence[str]) -> None:
    """Run one verb.

    Raises
    ------
    InputError
        If the arguments or the input are wrong.
    """
    token = command.set(shlex.join(["mirrorfold", *arguments]))
    try:
        app(list(arguments), print_error=False, exit_on_error=False, result_action="return_value")
    except CycloptsError as error:
        verb = f" {arguments[0]}" if arguments[0] in VERBS else ""
        sentence = " ".join(str(error).split()).rstrip(".")
        raise InputError(f"{sentence}; `mirrorfold{verb} --help` lists what can be given") from None
    finally:
        command.reset(token)


def demo(*, out: Path = Path("demo"), json: Json = False) -> None:
    """Run the demonstration.

    Parameters
    ----------
    out
        Directory for the scene, the sweep, the reconstruction, the picture and the score.
    json
        Print the score as one JSON object.
    """
    from importlib.resources import files as package_files

    from mirrorfold.io.files import check_output_directory, directory_written_whole

    names = (DEMO_SCENE, "sweep.nc", RECONSTRUCTION, PICTURE, "score.json")
    check_output_directory(out, names=names)
    text = package_files("mirrorfold").joinpath("scenes", DEMO_SCENE).read_text(encoding="utf-8")
    with directory_written_whole(out) as directory:
        (directory / DEMO_SCENE).write_text(text, encoding="utf-8")
        scene = mf.load_scene(directory / DEMO_SCENE)
        with progress("simulating the sweep") as report:
            sweep = mf.simulate(scene, progress=report)
        mf.save(sweep, directory / "sweep.nc")
        with progress("reconstructing") as report:
            reconstruction = mf.reconstruct(sweep, progress=report)
        write_results(reconstruction, directory, scene=scene)
        score = mf.score(reconstruction, scene)
        write_json(score, directory / "score.json")
    paths = [out / name for name in names]
    if json:
        show_json({**score, "files": list(map(str, paths))})
        return
    show_mirrors(mirror_table(reconstruction))
    show_score(score)
    show_files(paths)
    print(f"look at {out / PICTURE}")


def simulate(
    scene: Path,
    *,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    solver: Literal["rays", "fullwave"] = "rays",
    bounces: int = 3,
    seed: int = 0,
    snr_db: float | None = None,
    tolerance: float = 1e-3,
    direct: Flag = False,
    check_residual: Flag = False,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: Flag = False,
    dry_run: Flag = False,
    json: Json = False,
) -> None:
    """Simulate a sweep.

    Parameters
    ----------
    scene
        Scene file (TOML).
    output
        Sweep to write (netCDF); needed but for a dry run.
    solver
        How the waves are followed: by rays, or by the integral equation of perfect conductors. What follows snr-db is
        for fullwave alone.
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
    dry_run
        Say how long it will take and how much memory and disk it needs, and stop.
    json
        Print what was simulated as one JSON object.
    """
    from mirrorfold.io.files import check_output

    truth = mf.load_scene(scene)
    options: dict[str, Any] = {"bounces": bounces, "tolerance": tolerance, "direct": direct}
    options |= {"check_residual": check_residual, "scheduler": scheduler}
    if solver == "fullwave":
        workers = available_cores() if workers is None else workers
    if dry_run:
        if solver != "fullwave":
            raise InputError("--dry-run is for --solver fullwave; rays take seconds")
        show_estimate(estimate_simulation(truth, tolerance=tolerance, seed=seed, workers=workers or 1), json=json)
        return
    if output is None:
        raise InputError("--output is missing; give the file to write, for example -o sweep.nc")
    check_output(output, inputs=[scene])
    results = output.with_name(f"{output.name}.frequencies")
    if solver == "fullwave":
        options["checkpoint"] = results
    try:
        with progress("simulating the sweep") as report:
            sweep = mf.simulate(
                truth,
                solver=solver,
                seed=seed,
                snr_db=snr_db,
                workers=1 if workers is None else workers,
                resume=resume,
                progress=report,
                **options,
            )
    except KeyboardInterrupt:
        if results.exists():
            raise KeyboardInterrupt(f"interrupted; what is done is kept in {results}, --resume goes on") from None
        raise
    mf.save(sweep.assign_attrs(command=command.get()), output)
    if solver == "fullwave":
        remove_directory(results)
    found = mf.info(sweep)
    remark(found["remarks"])
    if json:
        show_json({**found, "files": [str(output)]})
        return
    show_files([output])


def focus(
    sweep: Path,
    *,
    output: Output,
    x: Grid = None,
    y: Grid = None,
    z: Grid = None,
    tolerance: float = 1e-4,
    taper: str = "hann",
    json: Json = False,
) -> None:
    """Focus a sweep.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF).
    output
        Image to write (netCDF).
    x
        Cross-range of the pixels as START:STOP:STEP [m], for example -2:2:0.005; chosen from the sweep by default.
    y
        Range of the pixels, likewise.
    z
        Height of the pixels, likewise, for a volume; the floor plan by default.
    tolerance
        Relative error of the image.
    taper
        Window over frequency.
    json
        Print what the image holds as one JSON object.
    """
    from mirrorfold.io.files import check_output

    axes = {name: parse_axis(text, name) for name, text in (("x", x), ("y", y), ("z", z)) if text is not None}
    check_output(output, inputs=[sweep])
    measured = read(sweep, "sweep")
    remark(mf.info(measured)["remarks"])
    with progress("focusing") as report:
        image = mf.focus(measured, **axes, tolerance=tolerance, taper=taper, progress=report)
    mf.save(image.assign_attrs(command=command.get()), output)
    found = mf.info(image)
    remark(found["remarks"])
    if json:
        show_json({**found, "files": [str(output)]})
        return
    show_files([output])


def fold(
    image: Path,
    *,
    output: Output,
    sweep: Path | None = None,
    preset: Literal["default", "published"] = "default",
    threshold_db: float | None = None,
    minimum_length: float | None = None,
    json: Json = False,
) -> None:
    """Fold an image.

    Parameters
    ----------
    image
        Image to read (netCDF).
    output
        Reconstruction to write (netCDF).
    sweep
        Sweep that the image was focused from (netCDF); tells mixed-path ghosts from true echoes.
    preset
        The algorithm with all its tests, or as it was published.
    threshold_db
        Level that echoes must exceed [dB]; found from the data by default.
    minimum_length
        Of a mirror [m].
    json
        Print mirrors and counts as one JSON object.
    """
    from mirrorfold.io.files import check_output

    check_output(output, inputs=[image] if sweep is None else [image, sweep])
    focused = read(image, "image")
    measured = None if sweep is None else read(sweep, "sweep")
    with progress("folding") as report:
        reconstruction = mf.fold(
            focused,
            sweep=measured,
            preset=preset,
            threshold_db=threshold_db,
            minimum_length=minimum_length,
            progress=report,
        )
    reconstruction.attrs["command"] = command.get()
    mf.save(reconstruction, output)
    report_reconstruction(reconstruction, [output], json=json)


def reconstruct(
    sweep: Path,
    *,
    output: Output,
    preset: Literal["default", "published"] = "default",
    threshold_db: float | None = None,
    minimum_length: float | None = None,
    json: Json = False,
) -> None:
    """Reconstruct a scene.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF).
    output
        Directory for reconstruction.nc and before_after.png.
    preset
        The algorithm with all its tests, or as it was published.
    threshold_db
        Level that echoes must exceed [dB]; found from the data by default.
    minimum_length
        Of a mirror [m].
    json
        Print mirrors, counts and files as one JSON object.
    """
    from mirrorfold.io.files import check_output_directory, directory_written_whole

    check_output_directory(output, names=(RECONSTRUCTION, PICTURE), inputs=[sweep])
    measured = read(sweep, "sweep")
    remark(mf.info(measured)["remarks"])
    with progress("reconstructing") as report:
        reconstruction = mf.reconstruct(
            measured, preset=preset, threshold_db=threshold_db, minimum_length=minimum_length, progress=report
        )
    reconstruction.attrs["command"] = command.get()
    with directory_written_whole(output) as directory:
        write_results(reconstruction, directory)
    report_reconstruction(reconstruction, [output / RECONSTRUCTION, output / PICTURE], json=json)


def score(reconstruction: Path, scene: Path, *, json: Json = False) -> None:
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


def info(file: Path, *, json: Json = False) -> None:
    """Describe a file.

    Parameters
    ----------
    file
        Sweep, image, reconstruction (netCDF) or scene (TOML).
    json
        Print all facts as one JSON object.
    """
    found = mf.info(file)
    if json:
        show_json(found)
    else:
        show_info(found)


for verb in (demo, simulate, focus, fold, reconstruct, score, info):
    app.command(
        verb,
        name=verb.__name__,
        help=VERBS[verb.__name__].purpose,
        help_epilogue=f"Example: {VERBS[verb.__name__].example}\n",
        version_flags=[],
    )


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def remove_directory(path: Path) -> None:
    """Remove a directory with all that is in it."""
    import shutil

    shutil.rmtree(path, ignore_errors=True)


def estimate_simulation(scene: mf.Scene, *, tolerance: float, seed: int, workers: int) -> dict[str, Any]:
    """What a full-wave simulation will cost, in plain numbers."""
    from mirrorfold.simulation.fullwave.sweep import estimate_sweep

    cost = estimate_sweep(scene, tolerance=tolerance, seed=seed)
    return {
        "unknowns": cost.unknowns,
        "skeletons": cost.skeletons,
        "frequencies": scene.band.points,
        "workers": workers,
        "cpu_seconds_per_frequency": cost.seconds_per_frequency,
        "minutes": cost.seconds_per_frequency * scene.band.points / workers / 60.0,
        "memory_per_worker_gb": cost.memory / 1e9,
        "memory_gb": workers * cost.memory / 1e9,
        "disk_gb": cost.disk / 1e9,
    }


def show_estimate(found: dict[str, Any], *, json: bool) -> None:
    """Print what a simulation will cost."""
    if json:
        show_json(found)
        return
    print(
        f"{found['unknowns']} unknowns, {found['skeletons']} after compression, {found['frequencies']} frequencies: "
        f"about {found['cpu_seconds_per_frequency']:.2g} s each, {found['minutes']:.2g} minutes with "
        f"{found['workers']} workers, {found['memory_gb']:.2g} GB of memory, {found['disk_gb']:.2g} GB of disk"
    )


def read(path: Path, kind: str) -> Any:
    """A file that must hold a sweep, an image or a reconstruction.

    Raises
    ------
    InputError
        If it holds something else.
    """
    import xarray as xr

    found = mf.load(path)
    kinds = {xr.Dataset: "sweep", xr.DataArray: "image", xr.DataTree: "reconstruction"}
    if kinds.get(type(found)) != kind:
        held = kinds.get(type(found), "scene")
        raise InputError(f"{path}: is of kind {held}, expected {kind}; give another file")
    return found


def parse_axis(text: str, name: str) -> Any:
    """Pixel coordinates from START:STOP:STEP, the stop included where the steps reach it.

    Raises
    ------
    InputError
        If it is not three numbers, or the steps lead nowhere.
    """
    import numpy as np

    try:
        start, stop, step = map(float, text.split(":"))
    except ValueError:
        raise InputError(f"--{name} is {text!r}, expected START:STOP:STEP in metres, for example -2:2:0.005") from None
    if not (np.isfinite([start, stop, step]).all() and step > 0 and stop > start):
        raise InputError(f"--{name} is {text!r}, expected finite numbers with STOP above START and a STEP above zero")
    return start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1)


def write_results(reconstruction: Any, directory: Path, scene: mf.Scene | None = None) -> None:
    """Write a reconstruction and its picture to a directory."""
    mf.save(reconstruction, directory / RECONSTRUCTION)
    mf.plot.before_after(reconstruction, scene).savefig(directory / PICTURE)


def write_json(result: dict[str, Any], path: Path) -> None:
    """Write one JSON object to a file."""
    from mirrorfold.cli.terminal import to_json

    path.write_text(to_json(result) + "\n", encoding="utf-8")


def mirror_table(reconstruction: Any) -> list[dict[str, Any]]:
    """The mirrors as `info` lists them."""
    return list(mf.info(reconstruction)["mirrors"])


def report_reconstruction(reconstruction: Any, files: Sequence[Path], *, json: bool) -> None:
    """Print mirrors and counts, and where the files are."""
    found = mf.info(reconstruction)
    remark(found["remarks"])
    if json:
        show_json({**found, "files": list(map(str, files))})
        return
    show_mirrors(found["mirrors"])
    counts = ", ".join(f"{count} after {bounces}" for bounces, count in found["points_by_bounces"].items())
    print(f"{found['points']} points, by bounces: {counts or 'none'}")
    show_files(files)
