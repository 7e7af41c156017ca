"""The verb `reproduce`: the published experiments, repeated."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from mirrorfold.cli.options import OptionalOutput
from mirrorfold.cli.study_tables import show_experiments, show_reproduction
from mirrorfold.cli.terminal import progress, show_json
from mirrorfold.cli.writing import output_directory, required
from mirrorfold.common.records import Record, fact

if TYPE_CHECKING:
    from mirrorfold.common.types import Progress
    from mirrorfold.reproducing import Experiment
    from mirrorfold.reproducing.findings import Result


class ExperimentFacts(Record):
    """An experiment that can be made."""

    name: str
    title: str
    source: str = fact("the published figure; empty for a question that is left open")
    purpose: str
    extra: str = fact("the extra of the package that it needs; empty where there is none")


class Experiments(Record):
    """What `--list` prints."""

    kind: Literal["experiments"]
    experiments: list[ExperimentFacts]


def reproduce(
    *names: str,
    output: OptionalOutput = None,
    quick: bool = False,
    again: bool = False,
    catalogue: Annotated[bool, Parameter(name="--list")] = False,
    json: bool = False,
) -> None:
    """Make published experiments anew.

    Parameters
    ----------
    names
        Names of experiments, or `all`, which is the default.
    output
        Folder for the results: a folder for each experiment with pictures, data and a page; an index; and one HTML page
        to read offline. Experiments that are complete there are not made again, so an interrupted command goes on where
        it was.
    quick
        Make all at reduced size, in minutes.
    again
        Make complete experiments again, too.
    catalogue
        List the experiments, and do nothing else.
    json
        Print all claims and numbers as one JSON object.
    """
    from mirrorfold.reproducing import EXPERIMENTS
    from mirrorfold.reproducing import reproduce as make
    from mirrorfold.reproducing.run import INDEX

    if catalogue:
        facts = [
            ExperimentFacts(name=one.name, title=one.title, source=one.source, purpose=one.purpose, extra=one.extra)
            for one in EXPERIMENTS.values()
        ]
        listed = Experiments(kind="experiments", experiments=facts)
        show_json(listed) if json else show_experiments(listed)
        return
    output = output_directory(required(output, "out"), names=INDEX)
    done: list[str] = []
    with ExitStack() as bars:

        def began(experiment: Experiment) -> Progress | None:
            bars.close()
            return bars.enter_context(progress(experiment.name))

        def finished(result: Result) -> None:
            bars.close()
            done.append(result.name)

        try:
            found = make(names or "all", output=output, quick=quick, again=again, began=began, finished=finished)
        except KeyboardInterrupt:
            listed_done = ", ".join(done) or "none"
            raise KeyboardInterrupt(
                f"interrupted; complete in {output}: {listed_done}; the same command goes on from there"
            ) from None
    show_json(found) if json else show_reproduction(found)
