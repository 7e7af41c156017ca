"""The verbs for shells and scripts: completion of what is typed, and the schema of what is printed."""

from __future__ import annotations

import json as json_format
from typing import Literal

from mirrorfold.cli.terminal import show_json
from mirrorfold.common.records import Record
from mirrorfold.errors import InputError


class Completion(Record):
    """A script that completes verbs and options."""

    kind: Literal["completion"]
    shell: str
    script: str


def completion(shell: Literal["bash", "zsh", "fish"], *, json: bool = False) -> None:
    """Print a completion script.

    Parameters
    ----------
    shell
        The shell that will read it: bash, zsh or fish.
    json
        Print the script as one JSON object.
    """
    from mirrorfold.cli.program import app

    script = app.generate_completion(shell=shell)
    if json:
        show_json(Completion(kind="completion", shell=shell, script=script))
        return
    print(script, end="" if script.endswith("\n") else "\n")


def schema(verb: str, *, json: bool = False) -> None:
    """Print a JSON Schema.

    Parameters
    ----------
    verb
        The verb whose output is described.
    json
        Changes nothing: the schema is a JSON object.
    """
    from mirrorfold.cli.schema import json_schema, outputs

    if verb not in outputs():
        raise InputError(f"{verb!r} is no verb with a schema, expected one of {', '.join(outputs())}")
    if json:
        show_json(json_schema(verb))
        return
    print(json_format.dumps(json_schema(verb), indent=2))
