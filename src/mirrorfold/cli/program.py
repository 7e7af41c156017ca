"""The program: registers all verbs under their names, and runs one of them."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from inspect import signature

from cyclopts import App, CycloptsError

from mirrorfold.cli import (
    VERBS,
    benchmarking,
    calibration,
    comparing,
    importing,
    judging,
    looking,
    outputs,
    planning,
    reconstructing,
    reproducing,
    shell,
    simulating,
)
from mirrorfold.cli.help import PlainHelp
from mirrorfold.cli.options import app, command, completed
from mirrorfold.cli.verbose import with_verbose
from mirrorfold.cli.writing import with_inputs_spared, with_no_clobber
from mirrorfold.common.units import split_quantity
from mirrorfold.errors import InputError, printable

FUNCTIONS = (
    *(simulating.demo, simulating.simulate),
    *(reconstructing.focus, reconstructing.fold, reconstructing.reconstruct, judging.score, judging.info),
    *(comparing.compare, reproducing.reproduce),
    *(importing.import_, importing.export, calibration.calibrate, planning.plan),
    *(looking.report, looking.view, looking.show, shell.completion, outputs.schema),
)
"""The functions of all verbs but `benchmark`."""

OWN_FILES = ("reproduce",)
"""Verbs that continue from files that they have written before, and replace damaged ones; `benchmark` is another."""

for function in FUNCTIONS:
    parameters = signature(function).parameters
    name = function.__name__.rstrip("_")  # `import` is a keyword of Python, so its function is called `import_`
    verb = completed(function)
    if "dry_run" in parameters:
        verb = with_verbose(verb)
    if "output" in parameters and name not in OWN_FILES:
        verb = with_inputs_spared(verb)
    if {"output", "out"}.intersection(parameters):
        verb = with_no_clobber(verb)
    app.command(
        verb,
        name=name,
        help=VERBS[name].purpose,
        help_epilogue=f"Example: {VERBS[name].example}\n",
        version_flags=[],
    )

benchmark = App(
    name="benchmark",
    help=VERBS["benchmark"].purpose,
    help_epilogue=f"Example: {VERBS['benchmark'].example}\n",
    version_flags=[],
)
"""The only verb that has a verb below it: `benchmark compare`."""

benchmark.default(with_no_clobber(completed(benchmarking.benchmark)))
benchmark.command(
    with_no_clobber(completed(benchmarking.compare_benchmarks)),
    name="compare",
    help="Compare two benchmarks, scene by scene.",
    help_epilogue="Example: mirrorfold benchmark compare before after -o difference.png\n",
    version_flags=[],
)
app.command(benchmark)


def run(arguments: Sequence[str]) -> None:
    """Run one verb.

    Raises
    ------
    InputError
        If the arguments or the input are wrong.
    """
    if arguments[0] not in VERBS:
        raise InputError(_no_verb(arguments[0]))
    app.help_formatter = "default" if sys.stdout.isatty() else PlainHelp()
    token = command.set(printable(shlex.join(["mirrorfold", *arguments])))
    try:
        app(list(arguments), print_error=False, exit_on_error=False, result_action="return_value")
    except CycloptsError as error:
        sentence = " ".join(str(error).split()).rstrip(".")
        wrong = [text for text in arguments if _has_unit(text)]
        sentence += f", and {wrong[0]!r} is no number; leave out its unit" if wrong else ""
        raise InputError(f"{sentence}; `mirrorfold {arguments[0]} --help` lists what can be given") from None
    finally:
        command.reset(token)


def _has_unit(text: str) -> bool:
    """Whether a text is a negative number with a unit, such as ``-18dB``, which is taken for an option."""
    found = split_quantity(text.removesuffix("dB"))
    return text.startswith("-") and found is not None and (bool(found[1]) or text.endswith("dB"))


def _no_verb(word: str) -> str:
    """The message for a first argument that is no verb."""
    close = get_close_matches(word, VERBS, n=1)
    if close:
        return f"{word!r} is no verb, did you mean {close[0]!r}?"
    order = "; options follow the verb" if word.startswith("-") else ""
    return f"{word!r} is no verb, expected one of {', '.join(VERBS)}{order}"
