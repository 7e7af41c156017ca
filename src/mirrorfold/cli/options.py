"""What the options of all verbs share: how an output and numbers are given, and the command line being run."""

from __future__ import annotations

from contextvars import ContextVar
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

Output = Annotated[Path, Parameter(alias="-o")]
OptionalOutput = Annotated[Path | None, Parameter(alias="-o")]
Numbers = Annotated[str | None, Parameter(allow_leading_hyphen=True)]
"""Several of them in one text, such as ``-2:2:0.005`` or ``0,1.5``."""

command: ContextVar[str] = ContextVar("command", default="mirrorfold")
"""The command line being run, which results carry along."""
