"""Records: the results of functions of this package, with each fact declared once.

A record is a frozen dataclass and a dict at once: ``found.power_db`` is ``found["power_db"]``, ``json.dumps(found)``
works, and scripts may add items of their own. The declaration of its fields is also the JSON Schema that ``mirrorfold
schema`` prints.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Self, cast, dataclass_transform

Number = float | None
"""A number; None (null in JSON) if it is not finite or not known."""

LEFT_OUT = object()
"""Default of an optional fact: unless it is given, it is no item of its record, and None as an attribute."""


def fact(meaning: str = "", *, default: Any = MISSING, **limits: Any) -> Any:
    """A field of a `Record`.

    Parameters
    ----------
    meaning : str
        What the fact means, with its unit if the name does not end in the unit.
    default : optional
        The value if none is given; `LEFT_OUT` for a fact that the record may lack.
    **limits
        Limits of the value, by pydantic's names: `ge`, `le`, `min_length`, `max_length`.

    Returns
    -------
    dataclasses.Field
        The field; pydantic makes the JSON Schema from its metadata.
    """
    metadata = {"description": meaning, **limits} if meaning else limits
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False, field_specifiers=(fact, field))
class Record(dict[str, Any]):
    """Base of all records. A subclass only lists its fields; it becomes a frozen dataclass by itself.

    Facts are in the order of the fields. In a record with several bases, ``class Both(Second, First)``, the facts of
    the last base come first. Attributes cannot be changed; ``found.but(...)`` makes another record. A script may add
    items of its own, as to any dict.

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
        """Make the subclass a dataclass; it is compared and printed as a dict."""
        dataclass(frozen=True, kw_only=True, eq=False, repr=False)(cls)

    def __post_init__(self) -> None:
        for item in fields(cast(Any, self)):
            value = getattr(self, item.name)
            if value is LEFT_OUT:
                object.__setattr__(self, item.name, None)
            else:
                super().__setitem__(item.name, value)

    def but(self, **changes: Any) -> Self:
        """A copy of the record with some facts changed or added."""
        facts = {item.name for item in fields(cast(Any, self))}
        found = type(self)(**{**{name: self[name] for name in self if name in facts}, **changes})
        dict.update(found, {name: value for name, value in self.items() if name not in facts})
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle and copy would otherwise set the items one by one.
        return _record, (type(self), dict(self))


def _record(kind: type[Any], items: dict[str, Any]) -> Any:
    """A record from its items; items that are no facts of it, which a user has added, are kept as items only."""
    facts = {item.name for item in fields(kind)}
    record = kind(**{name: value for name, value in items.items() if name in facts})
    dict.update(record, {name: value for name, value in items.items() if name not in facts})
    return record


def finite(value: Any) -> Any:
    """The value in plain Python types, with None in place of numbers that are not finite, which JSON cannot hold."""
    if isinstance(value, dict):
        return {str(name): finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return finite(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
