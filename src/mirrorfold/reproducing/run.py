"""Runs experiments one after the other. The folder of each is written as a whole or not at all."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from mirrorfold import __version__
from mirrorfold.common.records import Record, fact
from mirrorfold.common.threads import cpu_count
from mirrorfold.errors import InputError
from mirrorfold.io.files import check_output_directory, directory_written_atomically, written_atomically
from mirrorfold.plotting.saving import save_figure
from mirrorfold.reproducing.catalogue import EXPERIMENTS, Experiment, chosen
from mirrorfold.reproducing.findings import Findings, Picture, Result
from mirrorfold.reproducing.pages import index_markdown, page_markdown, to_html
from mirrorfold.reproducing.work import Work

if TYPE_CHECKING:
    from mirrorfold.common.types import Progress

RESULT, PAGE, DATA = "result.json", "page.md", "data.nc"
INDEX = ("index.md", "index.html")

UNFINISHED, SPENT = "unfinished", "spent.json"
"""Folder, beside the results, for the intermediate results of unfinished experiments; and the file in the subfolder of
each experiment that tells how long the experiment has run so far."""

DPI = 130
"""Resolution of the pictures as PNG [dots per inch]: they are some 900 pixels wide, as wide as a page shows them."""

_RESULT: TypeAdapter[Result] = TypeAdapter(Result)


class Reproduction(Record):
    """The results that `mirrorfold reproduce` has computed, or has found in the folder already."""

    results: list[Result]
    files: list[str] = fact("what was written")


def reproduce(
    names: str | Sequence[str] = "all",
    *,
    output: str | Path,
    quick: bool = False,
    again: bool = False,
    began: Callable[[Experiment], Progress | None] | None = None,
    finished: Callable[[Result], None] | None = None,
) -> Reproduction:
    """Compute published experiments anew, and set the published claims beside our results.

    Parameters
    ----------
    names : str or list of str
        Names of the experiments; `mirrorfold.reproducing.EXPERIMENTS` lists them.
    output : path
        Folder for the results: one folder for each experiment, with pictures (PNG, PDF), data (netCDF), a page
        (Markdown) and `result.json`; an index, and one HTML page with everything to read offline. Experiments whose
        results are there already, made by the same program at the same size, are not run again.
    quick : bool
        Run all experiments at reduced size, which takes minutes.
    again : bool
        Run also the experiments again whose results are there already.
    began : callable (experiment), optional
        Called before each experiment. It may return a function, which is then called with the number of steps done
        and their total.
    finished : callable (result), optional
        Called with the result of each experiment.

    Returns
    -------
    Reproduction

    Raises
    ------
    InputError
        If a name is not known, an extra is missing, nothing can be written there, or a folder with the name of an
        experiment holds other files.
    """
    experiments = chosen(names)
    output = check_output_directory(output, names=INDEX)
    for experiment in experiments:
        _check_folder(output / experiment.name)
    output.mkdir(exist_ok=True)
    results = []
    for experiment in experiments:
        result = None if again else _made(output, experiment, quick)
        if result is None:
            result = _make(experiment, output, quick, began(experiment) if began is not None else None)
            write_index(output)
        results.append(result)
        if finished is not None:
            finished(result)
    written = write_index(output)
    written += [output / one.name / name for one in results for name in _names(one)]
    return Reproduction(results=results, files=list(map(str, written)))


def _check_folder(folder: Path) -> None:
    """Refuse a folder that holds files of someone else, which those of an experiment would replace.

    Raises
    ------
    InputError
    """
    if folder.is_dir() and any(folder.iterdir()) and not (folder / RESULT).is_file():
        raise InputError(f"{folder}: holds files of something else; give another folder, or move it away")


def _make(experiment: Experiment, output: Path, quick: bool, progress: Progress | None) -> Result:
    """Run an experiment and write its folder."""
    kept = output / UNFINISHED / experiment.name
    digest = experiment.digest(quick=quick)
    with _timed(kept, digest) as seconds:
        found = experiment.run(Work(quick, kept, digest, cpu_count(), progress))
    result = Result(
        name=experiment.name,
        title=experiment.title,
        source=experiment.source,
        purpose=experiment.purpose,
        quick=quick,
        command=f"mirrorfold reproduce {experiment.name} -o out" + (" --quick" if quick else ""),
        version=__version__,
        seconds=seconds(),
        digest=digest,
        claims=list(found.claims),
        numbers={name: None if value is None else float(value) for name, value in found.numbers.items()},
        tables=list(found.tables),
        pictures=[Picture(file=name, caption=caption) for name, (_, caption) in found.figures.items()],
        text=list(found.text),
        assumptions=list(found.assumptions),
    )
    folder = output / experiment.name
    before = read_result(folder / RESULT)
    with directory_written_atomically(folder, replaces=[] if before is None else _names(before)) as directory:
        _write(result, found, directory)
    shutil.rmtree(kept, ignore_errors=True)
    with suppress(OSError):  # the folder is not empty if another experiment is unfinished
        kept.parent.rmdir()
    return result


@contextmanager
def _timed(kept: Path, digest: str) -> Iterator[Callable[[], float]]:
    """Measure the time [s] that an experiment takes, including earlier, interrupted runs of the same program."""
    file, before, started = kept / SPENT, 0.0, time.perf_counter()
    with suppress(OSError, ValueError, KeyError, TypeError):
        spent = json.loads(file.read_text(encoding="utf-8"))
        before = float(spent["seconds"]) if spent["digest"] == digest else 0.0

    def seconds() -> float:
        return before + time.perf_counter() - started

    try:
        yield seconds
    except BaseException:
        if kept.is_dir():
            with suppress(OSError), written_atomically(file) as temporary:
                temporary.write_text(json.dumps({"digest": digest, "seconds": seconds()}), encoding="utf-8")
        raise


def _write(result: Result, found: Findings, directory: Path) -> None:
    """Write all files of an experiment into its folder."""
    for name, (figure, _) in found.figures.items():
        save_figure(figure, directory / f"{name}.png", dpi=DPI)
        save_figure(figure, directory / f"{name}.pdf")
    found.data.to_netcdf(directory / DATA, engine="h5netcdf")
    (directory / PAGE).write_text(page_markdown(result), encoding="utf-8")
    (directory / RESULT).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


def _names(result: Result) -> list[str]:
    """The names of all files of an experiment."""
    pictures = [f"{picture.file}{suffix}" for picture in result.pictures for suffix in (".png", ".pdf")]
    return [RESULT, PAGE, DATA, *pictures]


def _made(output: Path, experiment: Experiment, quick: bool) -> Result | None:
    """The result in the folder, if it is whole and the same program made it at the same size; else None."""
    found = _whole(output / experiment.name)
    return found if found is not None and found.digest == experiment.digest(quick=quick) else None


def _whole(folder: Path) -> Result | None:
    """The result in the folder of an experiment, if all its files exist; else None."""
    found = read_result(folder / RESULT)
    return found if found is not None and all((folder / name).is_file() for name in _names(found)) else None


def read_result(path: Path) -> Result | None:
    """The result of an experiment, read from its file; None if the file does not exist or cannot be read."""
    try:
        return _RESULT.validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return None


def write_index(output: Path) -> list[Path]:
    """Write the index of all whole results in a folder, in Markdown and as one HTML page; returns both paths."""
    results = [found for name in EXPERIMENTS if (found := _whole(output / name)) is not None]
    texts = index_markdown(results), to_html(results, output)
    paths = [output / name for name in INDEX]
    for path, text in zip(paths, texts, strict=True):
        with written_atomically(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return paths
