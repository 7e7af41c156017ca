"""The verb `completion`: a script with which a shell completes verbs and options."""

from __future__ import annotations

from typing import Literal

from mirrorfold.cli.options import app
from mirrorfold.cli.terminal import show_json
from mirrorfold.common.records import Record


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
    script = app.generate_completion(shell=shell)
    if json:
        show_json(Completion(kind="completion", shell=shell, script=script))
        return
    print(script, end="" if script.endswith("\n") else "\n")
