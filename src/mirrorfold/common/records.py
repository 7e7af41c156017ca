"""Records: what the functions of this package find out, each fact declared once.

A record is a frozen dataclass and a read-only dict at once: ``found.power_db`` is ``found["power_db"]``, and
``json.dumps(found)`` works. The declaration of its fields is also the JSON Schema that ``mirrorfold schema`` prints.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, NoReturn, Self, cast, dataclass_transform

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

    Raises
    ------
    TypeError
        Where a fact is to be changed: ``found.but(...)`` makes another record, ``dict(found)`` a dict to work on.

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
        return type(self)(**{**self, **changes})

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle and copy would otherwise set the items one by one.
        return _again, (type(self), dict(self))

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(f"{type(self).__name__} cannot be changed; use but(...) for another one, or dict(...) of it")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse


def _again(kind: type[Record], facts: dict[str, Any]) -> Record:
    """A record from its items."""
    return kind(**facts)
