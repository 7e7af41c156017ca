"""The application, options that several verbs share with their types and texts, and the command line being run."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, Parameter

app = App(
    name="mirrorfold",
    help_format="plaintext",
    version_flags=[],
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative="", negative_iterable=()),
)
"""What the verbs are registered with; `mirrorfold.cli.program` does so."""

Output = Annotated[Path, Parameter(alias="-o")]
OptionalOutput = Annotated[Path | None, Parameter(alias="-o")]
Numbers = Annotated[str | None, Parameter(allow_leading_hyphen=True)]
"""Several of them in one text, such as ``-2:2:0.005`` or ``0,1.5``."""

CrossRanges = Annotated[
    Numbers,
    Parameter(
        help="Cross-range of the pixels as START:STOP:STEP [m], for example -2:2:0.005, or one number; chosen from the "
        "sweep by default."
    ),
]
Ranges = Annotated[Numbers, Parameter(help="Range of the pixels, likewise.")]
Heights = Annotated[Numbers, Parameter(help="Height of the pixels, likewise, for a volume; the floor plan by default.")]

Preset = Annotated[
    Literal["default", "published"],
    Parameter(
        help="The algorithm with all its tests, or as it was published. Settings of folding that are given count "
        "instead of those of the preset."
    ),
]
Mirrors = Annotated[
    Path | None,
    Parameter(
        help="Mirrors that are known or drawn (JSON), or a floor plan (DXF, GeoJSON), of which those walls are mirrors "
        "that the radar sees; found in the image by default."
    ),
]
FloorPlanFile = Annotated[
    Path | None, Parameter(name="--plan", help="Known floor plan (DXF, GeoJSON) to lay over the pictures.")
]
Frame = Annotated[int | None, Parameter(help="Which frame of a recording, from 0.")]
Export = Annotated[Path | None, Parameter(help="File for other programs to write too: see `mirrorfold export --help`.")]

command: ContextVar[str] = ContextVar("command", default="mirrorfold")
"""The command line being run, which results carry along."""


def with_opposites(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give every flag of a verb that is on by default an opposite, ``--no-NAME``; changes the function in place.

    A flag that is off by default, such as ``--json``, needs none: it is off where it is not given.
    """
    signature = inspect.signature(function)
    switches = {
        name: Annotated[bool, Parameter(negative=f"--no-{name.replace('_', '-')}")]
        for name, parameter in signature.parameters.items()
        if parameter.default is True
    }
    if switches:
        parameters = [one.replace(annotation=switches.get(one.name, one.annotation))
                      for one in signature.parameters.values()]  # fmt: skip
        function.__annotations__ |= switches
        function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return function
