"""Which verb prints what with ``--json``: its models, its JSON Schema, and its fields in words."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, TypeAdapter

from mirrorfold.cli.schema import (
    ArraySweep,
    BrokenSweep,
    Calibration,
    Completion,
    Figure,
    FullWaveEstimate,
    Image,
    Mapping,
    Output,
    Plan,
    PlanScore,
    RasterSweep,
    Reconstruction,
    Report,
    ScanEstimate,
    Scene,
    TouchstoneScan,
    View,
    VolumeScene,
    VolumeScore,
)

SweepFacts = ArraySweep | RasterSweep

OUTPUTS: dict[str, Any] = {
    "demo": PlanScore | VolumeScore,
    "simulate": SweepFacts | FullWaveEstimate | ScanEstimate,
    "import": SweepFacts | Image | Mapping,
    "export": TouchstoneScan,
    "calibrate": Calibration,
    "focus": Image,
    "fold": Reconstruction,
    "reconstruct": Reconstruction,
    "score": PlanScore | VolumeScore,
    "report": Report,
    "view": View,
    "show": Figure,
    "info": SweepFacts | BrokenSweep | Image | Reconstruction | Scene | VolumeScene,
    "plan": Plan,
    "completion": Completion,
}
"""The models of each verb's output; `schema` itself prints a JSON Schema."""


def outputs() -> dict[str, Any]:
    """The models of the verbs that there are."""
    from mirrorfold.cli import VERBS

    return {verb: OUTPUTS[verb] for verb in VERBS if verb in OUTPUTS}


def check(verb: str, printed: str) -> Any:
    """What a verb has printed, as its model.

    Parameters
    ----------
    verb : str
    printed : str
        One JSON object.

    Raises
    ------
    pydantic.ValidationError
        If it is not what the verb promises.
    """
    return TypeAdapter(OUTPUTS[verb]).validate_json(printed)


def json_schema(verb: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of what a verb prints."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"mirrorfold {verb} --json",
        **TypeAdapter(OUTPUTS[verb]).json_schema(),
    }


def models(verb_output: Any) -> tuple[type[Output], ...]:
    """The models that an output may be one of."""
    return get_args(verb_output) or (verb_output,)


def describe_fields(model: type[Output]) -> list[tuple[str, str, str]]:
    """Name, type and meaning of each field of a model."""
    return [(name, type_name(field.annotation), field.description or "") for name, field in model.model_fields.items()]


def type_name(annotation: Any) -> str:
    """A type in the words of JSON.

    Examples
    --------
    >>> type_name(list[float | None])
    'list of number or null'
    """
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return _words(annotation.__name__)
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_name(inner[0])
    if origin is Literal:
        return " or ".join(f"`{str(value).lower() if isinstance(value, bool) else value}`" for value in inner)
    if origin is list:
        return f"list of {type_name(inner[0])}"
    if origin is dict:
        return f"object of {type_name(inner[1])}"
    if inner:
        return " or ".join(type_name(part) for part in inner)
    names = {str: "text", int: "whole number", float: "number", bool: "true or false", type(None): "null"}
    return names.get(annotation, "anything")


def _words(name: str) -> str:
    """A class's name as plain words."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()
