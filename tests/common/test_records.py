"""Records are frozen dataclasses, dicts and JSON Schemas at once."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import subprocess
import sys
from typing import Literal

import numpy as np
import pydantic
import pytest

from mirrorfold.cli.schema import RecordSchema, describe_fields, parts
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact, finite


class Echo(Record):
    """An echo."""

    range_m: float = fact("from the radar", ge=0)
    level_db: Number = fact("[dB]")


class Named(Record):
    kind: Literal["list"]


class Echoes(Named):
    """Some echoes."""

    echoes: list[Echo]
    path: str | None = fact("the file", default=LEFT_OUT)
    valid: bool = True


ECHO = Echo(range_m=1.5, level_db=None)
FOUND = Echoes(kind="list", echoes=[ECHO])


def test_a_fact_is_an_attribute_and_an_item():
    assert ECHO.range_m == ECHO["range_m"] == 1.5
    assert FOUND.echoes[0].range_m == FOUND["echoes"][0]["range_m"]
    assert list(FOUND) == ["kind", "echoes", "valid"]
    assert {**ECHO} == dict(ECHO.items()) == ECHO == {"range_m": 1.5, "level_db": None}
    assert ECHO.get("level_db", 0.0) is None
    assert "level_db" in ECHO
    assert isinstance(ECHO, dict)
    assert json.loads(json.dumps(FOUND)) == FOUND


def test_a_fact_that_is_left_out_is_no_item():
    assert FOUND.path is None
    assert "path" not in FOUND
    there = FOUND.but(path="a.nc")
    assert (there.path, there["path"], type(there)) == ("a.nc", "a.nc", Echoes)
    # None is a value like any other: null in JSON.
    assert FOUND.but(path=None)["path"] is None
    assert "path" not in FOUND


def test_what_was_found_stays_and_scripts_may_add_items_of_their_own():
    with pytest.raises(dataclasses.FrozenInstanceError):
        ECHO.range_m = 2.0
    mine = ECHO.but(range_m=2.5)
    mine["missing"] = 3
    assert mine == {"range_m": 2.5, "level_db": None, "missing": 3}
    assert mine.but(range_m=1.0) == {"range_m": 1.0, "level_db": None, "missing": 3}
    assert pickle.loads(pickle.dumps(mine)) == mine
    with pytest.raises(TypeError, match="missing"):
        ECHO.but(missing=3)
    assert ECHO == {"range_m": 1.5, "level_db": None}


def test_what_is_not_declared_or_missing_is_refused():
    with pytest.raises(TypeError, match="more"):
        Echo(range_m=1.0, level_db=None, more=1)
    with pytest.raises(TypeError, match="level_db"):
        Echo(range_m=1.0)


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda record: pickle.loads(pickle.dumps(record))])
def test_copies_are_records_too(again):
    found = again(FOUND)
    assert found == FOUND
    assert (type(found), type(found.echoes[0]), found.path) == (Echoes, Echo, None)


def test_the_schema_is_the_declaration():
    schema = pydantic.TypeAdapter(Echoes).json_schema(schema_generator=RecordSchema)
    assert list(schema["properties"]) == ["kind", "echoes", "path", "valid"]
    assert schema["required"] == ["kind", "echoes"]
    assert schema["properties"]["kind"]["const"] == "list"
    assert schema["properties"]["path"]["description"] == "the file"
    assert schema["additionalProperties"] is False
    echo = schema["$defs"]["Echo"]
    assert echo["description"] == "An echo."
    assert echo["properties"]["range_m"] == {
        "description": "from the radar", "minimum": 0, "title": "Range M", "type": "number"
    }  # fmt: skip
    assert describe_fields(Echo) == [("range_m", "number", "from the radar"), ("level_db", "number or null", "[dB]")]
    assert parts(Echoes) == [Echo]


def test_the_schema_holds_json_to_it():
    read = pydantic.TypeAdapter(Echoes).validate_json(json.dumps(FOUND))
    assert read == FOUND
    assert type(read.echoes[0]) is Echo
    for change in ({"more": 1}, {"kind": "other"}, {"valid": "yes"}, {"echoes": [{"range_m": -1.0, "level_db": None}]}):
        with pytest.raises(pydantic.ValidationError):
            pydantic.TypeAdapter(Echoes).validate_json(json.dumps({**FOUND, **change}))


@pytest.mark.parametrize("kind", [float, np.float32, np.float64])
def test_numbers_that_json_cannot_hold_become_null(kind):
    found = {1: (kind("nan"), [kind("inf"), kind(0.5)]), "row": np.array([kind("-inf"), kind(2.0)]), "n": np.int64(3)}
    assert json.dumps(finite(found), allow_nan=False) == '{"1": [null, [null, 0.5]], "row": [null, 2.0], "n": 3}'


def test_no_fact_has_the_name_of_what_dicts_can_do():
    def below(kind):
        return [part for child in kind.__subclasses__() for part in (child, *below(child))]

    kinds = [kind for kind in below(Record) if kind.__module__.startswith("mirrorfold.")]
    assert len(kinds) > 30
    for kind in kinds:
        names = {item.name for item in dataclasses.fields(kind)}
        assert not names & set(dir(Record)), kind
        assert kind.__doc__


@pytest.mark.slow
def test_records_do_without_pydantic():
    """Only scenes and schemas are read with it."""
    modules = ("describing.info", "scoring.figures", "scoring.mirrors", "cli.program", "cli.results")
    code = "; ".join(f"import mirrorfold.{name}" for name in modules) + "; import sys; print('pydantic' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
