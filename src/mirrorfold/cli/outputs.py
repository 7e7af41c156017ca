"""The verb `schema`: the JSON Schema of the output of the other verbs with ``--json``."""

from __future__ import annotations

import json as json_format

from mirrorfold.cli.terminal import show_json
from mirrorfold.errors import InputError


def schema(verb: str, *, json: bool = False) -> None:
    """Print a JSON Schema.

    Parameters
    ----------
    verb
        The verb whose output is described.
    json
        Has no effect: the schema is a JSON object in any case.
    """
    from mirrorfold.cli.schema import json_schema, outputs

    if verb not in outputs():
        raise InputError(f"{verb!r} is no verb with a schema, expected one of {', '.join(outputs())}")
    if json:
        show_json(json_schema(verb))
        return
    print(json_format.dumps(json_schema(verb), indent=2))
