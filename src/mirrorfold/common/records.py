"""Records: what the functions of this package find out, each fact declared once.

A record is a frozen dataclass and a dict at once: ``found.power_db`` is ``found["power_db"]``, ``json.dumps(found)``
works, and scripts may add items of their own. The declaration of its fields is also the JSON Schema that ``mirrorfold
schema`` prints.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Self, cast, dataclass_transform

Number = float | None
"""A number; None, which JSON calls null, where it is not finite or not known."""

LEFT_OUT = object()
"""Default of a fact that is no item of its record unless it is given; as an attribute it then reads None."""


def fact(meaning: str = "", *, default: Any = MISSING, **limits: Any) -> Any:
    """A field of a `Record`.

    Parameters
    ----------
    meaning : str
        What the fact says, with its unit where the name does not end in it.
    default : optional
        What stands there if nothing is given; `LEFT_OUT` for a fact that the record may lack.
    **limits
        Of the value, by the names of pydantic: `ge`, `le`, `min_length`, `max_length`.

    Returns
    -------
    dataclasses.Field
        Its metadata are what pydantic makes the JSON Schema from.
    """
    metadata = {"description": meaning, **limits} if meaning else limits
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False, field_specifiers=(fact, field))
class Record(dict[str, Any]):
    """Base of all records. A subclass only lists its fields; it becomes a frozen dataclass by itself.

    Facts stand in the order of the fields. Where records are joined, ``class Both(Second, First)``, those of the last
    base come first.

    The attributes are what the function found, and stay so; ``found.but(...)`` makes another record. Items are those of
    a dict: a script may add its own.

    Examples
    --------
    >>> class Wall(Record):
    ...     length_m: float = fact("from end to end")
    ...     material: str = fact(default=LEFT_OUT)
    >>> wall = Wall(length_m=2.0)
    >>> wall.length_m, wall["length_m"], "material" in wall, wall.material
    (2.0, 2.0, False, None)
    >>> wall.but(material="glass")
    {'length_m': 2.0, 'material': 'glass'}
    """

    __pydantic_config__: ClassVar = {"extra": "forbid", "strict": True}

    def __init_subclass__(cls) -> None:
        """Make a dataclass of a subclass; comparing and printing stay those of a dict."""
        dataclass(frozen=True, kw_only=True, eq=False, repr=False)(cls)

    def __post_init__(self) -> None:
        for item in fields(cast(Any, self)):
            value = getattr(self, item.name)
            if value is LEFT_OUT:
                object.__setattr__(self, item.name, None)
            else:
                super().__setitem__(item.name, value)

    def but(self, **changes: Any) -> Self:
        """The same record with some facts changed or added."""
        facts = {item.name for item in fields(cast(Any, self))}
        found = type(self)(**{**{name: self[name] for name in self if name in facts}, **changes})
        dict.update(found, {name: value for name, value in self.items() if name not in facts})
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle and copy would otherwise set the items one by one.
        return _record, (type(self), dict(self))


def _record(kind: type[Any], items: dict[str, Any]) -> Any:
    """A record from its items; those that are none of its facts, which a user has added, stay items alone."""
    facts = {item.name for item in fields(kind)}
    record = kind(**{name: value for name, value in items.items() if name in facts})
    dict.update(record, {name: value for name, value in items.items() if name not in facts})
    return record
