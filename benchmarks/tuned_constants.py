"""The tuned constants of a package: found in its sources, and varied in all places at once.

The value of a constant is held in more places than its own module: in modules that imported it by name, in the defaults
of functions, and in constants that are computed from it. Compiled kernels keep the value of their first call; nothing
here can change it.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

Value = int | float | tuple[int | float, ...]
Place = tuple[str, str]
"""A module and a name in it."""

CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
"""Names in capital letters, as those of constants are written."""


@dataclass(frozen=True)
class Constant:
    """A number or a tuple of numbers that a module defines.

    Attributes
    ----------
    module, name : str
    value : number or tuple of numbers
    reason : str
        The text below the constant, which says why it has this value.
    derived : bool
        Whether the constant is computed from other constants, and follows them.
    kernels : tuple of str
        Compiled functions that use the constant: a variation does not reach them.
    stale : tuple of str
        Compiled functions and bodies of classes that use the constant, or what is computed from it, and keep the old
        value.
    """

    module: str
    name: str
    value: Value
    reason: str
    derived: bool
    kernels: tuple[str, ...]
    stale: tuple[str, ...]

    @property
    def label(self) -> str:
        """The last part of the module's name, and the name of the constant, such as ``rows.GAP_CELLS``."""
        return f"{self.module.rpartition('.')[2]}.{self.name}"


def is_value(value: object) -> bool:
    """Whether a value is a number or a tuple of numbers."""
    parts = value if isinstance(value, tuple) else (value,)
    return bool(parts) and all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts)


class Sources:
    """The sources of a package, and where each of its constants is used.

    Parameters
    ----------
    package : str
        Name of the package, which can be imported.
    """

    def __init__(self, package: str) -> None:
        found = import_module(package).__file__
        assert found is not None  # a package with an __init__
        root = Path(found).parent
        self.trees: dict[str, ast.Module] = {}
        for path in sorted(root.rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            name = ".".join((package, *(part for part in parts if part != "__init__")))
            self.trees[name] = ast.parse(path.read_text(encoding="utf-8"))

    def constants(self, *modules: str) -> list[Constant]:
        """The constants of these modules and of the modules inside of them."""
        wanted = [m for m in self.trees if any(m == prefix or m.startswith(prefix + ".") for prefix in modules)]
        return [constant for module in wanted for constant in self._of_module(module)]

    def _of_module(self, module: str) -> Iterator[Constant]:
        body = self.trees[module].body
        for statement, below in zip(body, [*body[1:], None], strict=True):
            for name, expression in _assigned(statement):
                value: Any = getattr(import_module(module), name, None)
                if not CONSTANT.fullmatch(name) or not is_value(value):
                    continue
                text = ""
                if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                    text = " ".join(str(below.value.value).split())
                places = self.places(module, name)
                kernels = {kernel for place in places[(module, name)] for kernel in self._kernels(*place)}
                stale = {where for group in places.values() for place in group for where in self._frozen(*place)}
                derived = any(CONSTANT.fullmatch(other) for other in _names(expression))
                yield Constant(module, name, value, text, derived, tuple(sorted(kernels)), tuple(sorted(stale)))

    def places(self, module: str, name: str) -> dict[Place, list[Place]]:
        """All places that hold a constant, and those that hold each constant computed from it.

        The keys are the places in which the constants are defined; each is also the first item of its list.
        """
        result: dict[Place, list[Place]] = {}
        waiting = [(module, name)]
        while waiting:
            origin = waiting.pop(0)
            if origin in result or any(origin in group for group in result.values()):
                continue
            result[origin] = self._imported(origin)
            for where, alias in result[origin]:
                waiting += [(where, other) for other, expression in self._assignments(where)
                            if alias in _names(expression) and other != alias]  # fmt: skip
        return result

    def _imported(self, origin: Place) -> list[Place]:
        """A place, and the places of all modules that imported it by name, from its own module or from another."""
        group = [origin]
        for place in group:
            for where, alias in self._imports.get(place, ()):
                if (where, alias) not in group and hasattr(import_module(where), alias):
                    group.append((where, alias))
        return group

    @cached_property
    def _imports(self) -> dict[Place, list[Place]]:
        """For each name of a module, the places in which it was imported."""
        result: dict[Place, list[Place]] = {}
        for module, tree in self.trees.items():
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom) and node.module in self.trees and not node.level:
                    for item in node.names:
                        result.setdefault((node.module, item.name), []).append((module, item.asname or item.name))
        return result

    def _assignments(self, module: str) -> list[tuple[str, ast.expr]]:
        """All names that a module defines by assignment, with their expressions."""
        return [pair for statement in self.trees[module].body for pair in _assigned(statement)]

    def _kernels(self, module: str, name: str) -> list[str]:
        """Compiled functions of a module that use a name as a global."""
        return [f"{module}.{path}" for path, node in _functions(self.trees[module])
                if _compiled(node) and name in _names(node)]  # fmt: skip

    def _frozen(self, module: str, name: str) -> list[str]:
        """Compiled functions and bodies of classes that use a name: they keep its old value."""
        classes = [
            f"class {module}.{node.name}"
            for node in ast.walk(self.trees[module])
            if isinstance(node, ast.ClassDef)
            and any(
                name in _names(part.value)
                for part in node.body
                if isinstance(part, ast.Assign | ast.AnnAssign) and part.value is not None
            )
        ]
        return self._kernels(module, name) + classes

    @contextmanager
    def varied(self, constant: Constant, value: Value) -> Iterator[None]:
        """Give a constant another value in all places that hold it, and restore its own value afterwards."""
        undo: list[Callable[[], None]] = []
        try:
            for origin, group in self.places(constant.module, constant.name).items():
                module, name = origin
                new: Any = value
                if origin != (constant.module, constant.name):
                    new = _evaluated(dict(self._assignments(module))[name], module)
                for where, alias in group:
                    undo.append(_set(vars(import_module(where)), alias, new))
            for module, alias in {place for group in self.places(constant.module, constant.name).values()
                                  for place in group}:  # fmt: skip
                undo += self._refresh_defaults(module, alias)
            yield
        finally:
            for restore in reversed(undo):
                restore()

    def _refresh_defaults(self, module: str, name: str) -> Iterator[Callable[[], None]]:
        """Evaluate again the defaults of functions that use a name; yields calls that undo this."""
        for path, node in _functions(self.trees[module]):
            function = _function(module, path)
            if function is None:
                continue
            for keyword, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True):
                if default is not None and name in _names(default):
                    yield _set(function.__kwdefaults__ or {}, keyword.arg, _evaluated(default, module))
            if any(name in _names(default) for default in node.args.defaults):
                before = function.__defaults__
                function.__defaults__ = tuple(
                    _evaluated(default, module) if name in _names(default) else old
                    for default, old in zip(node.args.defaults, before or (), strict=True)
                )
                yield lambda function=function, before=before: setattr(function, "__defaults__", before)  # type: ignore[misc]


def _set(holder: dict[str, Any], name: str, value: Any) -> Callable[[], None]:
    """Set a value, and return the call that undoes it."""
    before = holder[name]
    holder[name] = value
    return lambda: holder.__setitem__(name, before)


def _assigned(statement: ast.stmt) -> list[tuple[str, ast.expr]]:
    """The name to which a statement assigns a value, with the expression of the value, or nothing."""
    if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
        return [(statement.targets[0].id, statement.value)]
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name) and statement.value is not None:
        return [(statement.target.id, statement.value)]
    return []


def _names(node: ast.AST) -> set[str]:
    """All names that are read in a part of a program."""
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def _functions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions and methods, but not functions inside of functions, whose defaults are evaluated at every call."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            yield node.name, node
        if isinstance(node, ast.ClassDef):
            yield from ((f"{node.name}.{part.name}", part) for part in node.body if isinstance(part, ast.FunctionDef))


def _compiled(node: ast.FunctionDef) -> bool:
    """Whether Numba compiles a function."""
    return any(re.search(r"jit|vectorize|stencil", ast.unparse(decorator)) for decorator in node.decorator_list)


def _function(module: str, path: str) -> FunctionType | None:
    """The plain function of that name, without its wrappers; None if there is none."""
    found: Any = import_module(module)
    for part in path.split("."):
        found = vars(found).get(part)
    for attribute in ("__func__", "fget", "func", "py_func"):
        found = getattr(found, attribute, found)
    found = inspect.unwrap(found) if callable(found) else None
    return found if isinstance(found, FunctionType) else None


def _evaluated(expression: ast.expr, module: str) -> Any:
    """The present value of an expression in a module."""
    return eval(compile(ast.Expression(expression), module, "eval"), vars(import_module(module)))
