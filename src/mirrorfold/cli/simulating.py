"""The verbs that begin with a scene: `demo`, the demonstration, and `simulate`, the sweep that a radar would measure.

Outputs are checked before the work begins, so that hours of work are not lost to a missing directory.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal

import mirrorfold as mf
from mirrorfold.cli.compiling import kernels_compiled_beside
from mirrorfold.cli.options import OptionalOutput, command
from mirrorfold.cli.results import (
    BODY,
    PICTURE,
    RECONSTRUCTION,
    REPORT,
    SPACE,
    write_json,
    write_results,
)
from mirrorfold.cli.terminal import (
    progress,
    say,
    show_files,
    show_info,
    show_json,
    show_mirrors,
    show_result,
    show_score,
)
from mirrorfold.cli.writing import netcdf_file, output_directory, required
from mirrorfold.common.units import Memory

DEMO_SCENES = {
    "hidden-corner": "hidden_corner.toml",
    "drywall-mannequin": "drywall-mannequin.toml",
    "drywall-control": "drywall-control.toml",
    "corridor": "corridor.toml",
    "pillar": "pillar.toml",
    "glass-door": "glass-door.toml",
}
"""Files of the scenes of the demonstration, by name."""

DEMO_SNR_DB = 20.0
"""Signal over noise per sample [dB] of the scans in three dimensions: modest for a vector network analyser."""


def demo(
    *,
    scene: Literal[
        "hidden-corner", "drywall-mannequin", "drywall-control", "corridor", "pillar", "glass-door"
    ] = "hidden-corner",
    out: Path = Path("demo"),
    json: bool = False,
) -> None:
    """Run the demonstration.

    Parameters
    ----------
    scene
        Name of the scene.
    out
        Directory for the scene, the sweep, the reconstruction, the pictures and the score.
    json
        Print the score as one JSON object.
    """
    from importlib.resources import files as package_files

    from mirrorfold.io.files import directory_written_atomically

    file = DEMO_SCENES[scene]
    names = (file, "sweep.nc", RECONSTRUCTION, PICTURE, BODY, SPACE, REPORT, "score.json")
    output_directory(out, names=names)
    text = package_files("mirrorfold").joinpath("scenes", "shipped", file).read_text(encoding="utf-8")
    with directory_written_atomically(out, replaces=names) as directory, ExitStack() as beside:
        (directory / file).write_text(text, encoding="utf-8")
        truth = mf.load_scene(directory / file)
        if truth.dimensions == 2:
            beside.enter_context(kernels_compiled_beside())
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
    say(f"open {out / REPORT} in a browser, or look at {out / PICTURE}")


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
    memory_limit: Memory | None = None,
    dry_run: bool = False,
    json: bool = False,
) -> None:
    """Simulate a sweep.

    Parameters
    ----------
    scene
        Scene file (TOML).
    output
        Sweep to write (netCDF); not needed for a dry run.
    solver
        How the waves are computed: by rays, or as full waves, by integral equations of conductors and dielectric walls.
        The options after snr-db, up to resume, are for full waves alone.
    bounces
        Largest number of mirrors on each way, for rays alone.
    seed
        Seed of the diffuse scatterers or the random profiles, and of the noise.
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
        For a raster scan: go on where returns wrap around or the scan step is wider than the beam.
    memory_limit
        Memory that the process may hold in all, for rays alone: scatterers are processed in tiles if necessary, and
        work that does not fit even so is refused before it begins [B].
    dry_run
        Print the work, time or memory that the simulation would need; write nothing.
    json
        Print what was simulated as one JSON object.
    """
    truth = mf.load_scene(scene)
    if solver == "fullwave" and workers is None:
        from mirrorfold.common.threads import cpu_count

        workers = cpu_count()
    if dry_run:
        from mirrorfold.simulation import estimate

        options: dict[str, Any] = {"bounces": bounces, "seed": seed, "tolerance": tolerance, "workers": workers or 1}
        cost = estimate(truth, solver=solver, memory_limit=memory_limit, **options)
        show_json(cost) if json else show_info(cost)
        return
    output = required(output, "sweep.nc")
    meshes = [getattr(surface, "path", None) for surface in truth.surface]
    netcdf_file(output, inputs=[scene, *meshes])
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
                memory_limit=memory_limit,
                progress=report,
            )
    except KeyboardInterrupt:
        if results.exists():
            raise KeyboardInterrupt(f"interrupted; what is done is kept in {results}, --resume goes on") from None
        raise
    mf.save(sweep.assign_attrs(command=command.get()), output)
    if solver == "fullwave":
        from mirrorfold.simulation.fullwave.checkpoint import remove_results

        remove_results(results)
    show_result(mf.info(sweep, diagnose=False), [output], json=json)
