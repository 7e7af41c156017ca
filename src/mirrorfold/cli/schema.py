"""The output of each verb with ``--json``: its records, their JSON Schema, and their fields in words."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Literal, cast, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from mirrorfold.benchmarking.comparing import BenchmarkComparison
from mirrorfold.benchmarking.summaries import Benchmark
from mirrorfold.cli.benchmarking import Catalogue
from mirrorfold.cli.calibration import Calibration
from mirrorfold.cli.importing import Exported, MappingProposal, TouchstoneScan
from mirrorfold.cli.looking import Figure, Report, View
from mirrorfold.cli.many import Summary
from mirrorfold.cli.reproducing import Experiments
from mirrorfold.cli.shell import Completion
from mirrorfold.common.forecasts import Forecast
from mirrorfold.common.records import Record
from mirrorfold.describing.comparison import Comparison
from mirrorfold.describing.images import ImageFacts
from mirrorfold.describing.planning import Plan
from mirrorfold.describing.reconstructions import ReconstructionFacts
from mirrorfold.describing.scenes import SceneFacts, VolumeSceneFacts
from mirrorfold.describing.sweeps import ArraySweepFacts, BrokenSweepFacts, RasterSweepFacts
from mirrorfold.focusing.choosing.facts import Choice
from mirrorfold.reproducing import Reproduction
from mirrorfold.scoring.score import PlanScore, VolumeScore
from mirrorfold.simulation.fullwave.estimate import FullWaveEstimate
from mirrorfold.simulation.raster.estimate import ScanEstimate
from mirrorfold.simulation.rays.tiles import RayEstimate

UsableSweep = ArraySweepFacts | RasterSweepFacts
"""Facts of a valid sweep."""

OUTPUTS: dict[str, Any] = {
    "demo": PlanScore | VolumeScore,
    "simulate": UsableSweep | FullWaveEstimate | ScanEstimate | RayEstimate,
    "import": UsableSweep | ImageFacts | MappingProposal,
    "export": TouchstoneScan | Exported,
    "calibrate": Calibration | Forecast,
    "focus": ImageFacts | Choice,
    "fold": ReconstructionFacts | Forecast,
    "reconstruct": ReconstructionFacts | Summary | Choice,
    "compare": Comparison,
    "score": PlanScore | VolumeScore,
    "benchmark": Benchmark | BenchmarkComparison | Catalogue,
    "reproduce": Reproduction | Experiments,
    "report": Report,
    "view": View,
    "show": Figure,
    "info": UsableSweep | BrokenSweepFacts | ImageFacts | ReconstructionFacts | SceneFacts | VolumeSceneFacts,
    "plan": Plan,
    "completion": Completion,
}
"""The records that each verb may print; `schema` itself is missing, because it prints a JSON Schema."""


def outputs() -> dict[str, Any]:
    """The records that each verb may print, in the order of the verbs."""
    from mirrorfold.cli import VERBS

    return {verb: OUTPUTS[verb] for verb in VERBS if verb in OUTPUTS}


def check(verb: str, printed: str) -> Any:
    """The printed output of a verb as a record, checked.

    Parameters
    ----------
    verb : str
    printed : str
        One JSON object.

    Raises
    ------
    pydantic.ValidationError
        If the output does not match the records of the verb: no other fields, and no values of other types, are
        allowed.
    """
    return TypeAdapter(OUTPUTS[verb]).validate_json(printed)


def json_schema(verb: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of what a verb prints."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"mirrorfold {verb} --json",
        **TypeAdapter(OUTPUTS[verb]).json_schema(schema_generator=RecordSchema),
    }


class RecordSchema(GenerateJsonSchema):
    """Makes JSON Schemas, without the warning that JSON cannot hold the default of facts that may be left out."""

    ignored_warning_kinds = {*GenerateJsonSchema.ignored_warning_kinds, "non-serializable-default"}  # noqa: RUF012


def models(verb_output: Any) -> tuple[type[Record], ...]:
    """The records of an output, which may be a single record or a union of several."""
    return get_args(verb_output) or (verb_output,)


def parts(model: type[Record]) -> list[type[Record]]:
    """The records within the fields of a record, in the order of the fields, each followed by the records within it."""
    found: list[type[Record]] = []
    for annotation in _types(model).values():
        for part in _records_in(annotation):
            found += [part, *parts(part)]
    return found


def describe_fields(model: type[Record]) -> list[tuple[str, str, str]]:
    """Name, type and meaning of each field of a record."""
    meanings = {item.name: item.metadata.get("description", "") for item in fields(cast(Any, model))}
    return [(name, type_name(annotation), meanings[name]) for name, annotation in _types(model).items()]


def type_name(annotation: Any) -> str:
    """A type in the words of JSON.

    Examples
    --------
    >>> type_name(list[float | None])
    'list of number or null'
    """
    if isinstance(annotation, type) and issubclass(annotation, Record):
        return _words(annotation.__name__)
    origin, inner = get_origin(annotation), get_args(annotation)
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


def _types(model: type[Record]) -> dict[str, Any]:
    """The types of the fields of a record by name, in their order."""
    hints = get_type_hints(model)
    return {item.name: hints[item.name] for item in fields(cast(Any, model))}


def _records_in(annotation: Any) -> list[type[Record]]:
    """The records that a type contains, such as those of a list or a union."""
    if isinstance(annotation, type) and issubclass(annotation, Record):
        return [annotation]
    return [model for part in get_args(annotation) for model in _records_in(part)]


def _words(name: str) -> str:
    """The name of a class as words in lower case."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()
