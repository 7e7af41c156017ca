"""Packages whose modules are imported when one of their names is first used."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy(
    package: str, homes: Mapping[str, tuple[str, ...]], aliases: Mapping[str, str] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The functions ``__getattr__`` and ``__dir__`` of such a package.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : mapping of str to tuple of str
        The public names that each module defines.
    aliases : mapping of str to str, optional
        Modules, by the names that they have in the package.
    """
    module_of = {name: module for module, names in homes.items() for name in names}
    whole = aliases or {}

    def get(name: str) -> Any:
        if name not in module_of and name not in whole:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value: Any = import_module(f"{package}.{whole.get(name) or module_of[name]}")
        value = value if name in whole else getattr(value, name)
        vars(sys.modules[package])[name] = value
        return value

    def listed() -> list[str]:
        return sorted({*vars(sys.modules[package]), *module_of, *whole})

    return get, listed
