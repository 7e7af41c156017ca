"""The verbs `benchmark`, which judges methods on random scenes, and `benchmark compare`, for two such benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import mirrorfold as mf
from mirrorfold.cli.options import OptionalOutput
from mirrorfold.cli.study_tables import show_benchmark, show_benchmark_comparison, show_catalogue
from mirrorfold.cli.terminal import progress, remark, show_json, show_result
from mirrorfold.cli.writing import output_directory, output_file, required
from mirrorfold.common.records import Number, Record, fact
from mirrorfold.errors import EndedError, InputError
from mirrorfold.io.suffixes import PICTURES
from mirrorfold.plotting.saving import save_figure

PICTURE = "figures.png"
"""Name of the picture in the folder of a benchmark."""

MOST_SEEDS = 1_000_000
"""Largest number of seeds: at ten seconds a scene, four months of work for a single family."""

Names = Annotated[list[str] | None, Parameter(consume_multiple=True)]
"""Option that takes one or several names."""


class FamilyFacts(Record):
    """A family of random scenes."""

    name: str
    what: str
    engine: str = fact("what simulates it: rays, fullwave or raster")
    bounces: int = fact("by how many mirrors hidden surfaces can be reached")
    snr_db: Number = fact("signal over noise per sample; null without noise [dB]")
    radars: list[str] = fact("those that can see it, the usual one first")


class RadarFacts(Record):
    """A radar that sees the families."""

    name: str
    what: str
    cell_m: float = fact("range resolution")


class Catalogue(Record):
    """What `--list` prints."""

    kind: Literal["catalogue"]
    families: list[FamilyFacts]
    radars: list[RadarFacts]


def benchmark(
    *,
    family: Names = None,
    radar: Names = None,
    method: Names = None,
    seeds: str = "0:10",
    output: OptionalOutput = None,
    sweeps: Path | None = None,
    jobs: int = 1,
    catalogue: Annotated[bool, Parameter(name="--list")] = False,
    json: bool = False,
) -> None:
    """Judge methods on random scenes.

    Parameters
    ----------
    family
        Families of scenes, one or several; by default all that are simulated by rays.
    radar
        Radars that see them, one or several; by default the usual one of each family.
    method
        Methods that reconstruct the scenes, one or several: ours, flat (ours without curved mirrors), opaque (ours
        without half-transparent walls), published, or MODULE:FUNCTION, a function that is called with the image and the
        sweep and returns a reconstruction, or a dict with points; ours by default.
    seeds
        Seeds of the random scenes as FIRST:END, one scene each; END is left out.
    output
        Folder for the results: scenes.jsonl, which gets a line as each scene is done, and from which an interrupted
        command goes on; tables; and a picture.
    sweeps
        Folder that keeps the simulated sweeps, for another command on the same scenes.
    jobs
        Number of scenes at a time, each in a process of its own.
    catalogue
        List the families and the radars, and do nothing else.
    json
        Print all figures as one JSON object.
    """
    if catalogue:
        found = _catalogue()
        show_json(found) if json else show_catalogue(found)
        return
    output = required(output, "out")
    from mirrorfold.benchmarking.methods import OWN
    from mirrorfold.benchmarking.results import FILE
    from mirrorfold.benchmarking.tables import TABLES, write_tables
    from mirrorfold.io.files import directory_written_atomically

    names = (*TABLES, PICTURE)
    output_directory(output, names=names)
    steps = [0, 0]
    before: list[int] = []
    methods = method or ["ours"]

    def count(done: int, total: int) -> None:
        if not before:
            before.append(done)
        steps[:] = done, total
        if report is not None:
            report(done, total)

    try:
        with progress("judging scenes") as report:
            result = mf.benchmark(
                family, radars=radar, methods=methods, seeds=_seeds(seeds), output=output, sweeps=sweeps,
                jobs=jobs, progress=count,
            )  # fmt: skip
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"interrupted; {steps[0]} of {steps[1]} scenes are done, in {output}; the same command goes on from there"
        ) from None
    with directory_written_atomically(output, replaces=names) as directory:
        write_tables(result, directory)
        save_figure(mf.plot.benchmark(result), directory / PICTURE)
    if any(before) and not OWN.keys() >= set(methods):
        remark([f"{before[0]} of {steps[1]} scenes were done before; after a change of a method, give another folder"])
    files = [output / name for name in (FILE, *names)]
    show_result(result, files, show_benchmark, json=json)
    if all(one.failures == one.scenes for one in result.results):
        raise EndedError(f"every method failed on every scene; {output / FILE} holds the reasons")


def compare_benchmarks(first: str, second: str, *, output: OptionalOutput = None, json: bool = False) -> None:
    """Compare two benchmarks, scene by scene.

    Parameters
    ----------
    first
        Folder of a benchmark, or FOLDER:METHOD.
    second
        Another one.
    output
        Figure (.png, .pdf or .svg) to write.
    json
        Print the comparison as one JSON object.
    """
    from mirrorfold.benchmarking import compare_benchmarks as compare
    from mirrorfold.io.files import written_atomically

    if output is not None:
        output_file(output, suffixes=PICTURES)
    found = compare(first, second)
    if output is not None:
        with written_atomically(output) as temporary:
            save_figure(mf.plot.benchmark_comparison(found), temporary)
    show_result(found, [] if output is None else [output], show_benchmark_comparison, json=json)


def _seeds(text: str) -> range:
    """The seeds that ``FIRST:END``, or a single number, stands for."""
    first, colon, end = text.partition(":")
    try:
        found = range(int(first), int(end) if colon else int(first) + 1)
    except ValueError:
        found = range(0)
    if not found or found[0] < 0:
        raise InputError(f"--seeds is {text!r}, expected FIRST:END in whole numbers from 0, for example 0:10")
    if found[-1] - found[0] >= MOST_SEEDS:
        raise InputError(f"--seeds is {text!r}, expected at most {MOST_SEEDS} seeds, for example 0:10")
    return found


def _catalogue() -> Catalogue:
    """All families of scenes and all radars."""
    from mirrorfold.scenes.families import FAMILIES, RADARS, radars_of

    families = [
        FamilyFacts(
            name=one.name, what=one.what, engine=one.engine, bounces=one.bounces, snr_db=one.snr_db,
            radars=[radar.name for radar in radars_of(one)],
        )
        for one in FAMILIES.values()
    ]  # fmt: skip
    radars = [RadarFacts(name=one.name, what=one.what, cell_m=one.cell) for one in RADARS.values()]
    return Catalogue(kind="catalogue", families=families, radars=radars)
