"""What keeps compiled kernels quick to compile, and quick to load: their sources are read, and none is compiled."""

from __future__ import annotations

import ast
from functools import lru_cache
from pathlib import Path

import mirrorfold

ROOT = Path(mirrorfold.__file__).parent


@lru_cache
def kernels() -> list[tuple[str, ast.FunctionDef, list[ast.FunctionDef]]]:
    """The file, the function, and the functions around it, of each function that is compiled."""
    found = []

    def visit(path: str, node: ast.AST, around: list[ast.FunctionDef]) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef):
                if any("njit" in ast.unparse(decorator) for decorator in child.decorator_list):
                    found.append((path, child, around))
                visit(path, child, [*around, child])
            else:
                visit(path, child, around)

    for path in ROOT.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "@njit" in text:
            visit(path.name, ast.parse(text), [])
    return found


def is_slice(target: ast.expr) -> bool:
    return isinstance(target, ast.Subscript) and any(isinstance(part, ast.Slice) for part in ast.walk(target.slice))


def is_number(value: ast.expr) -> bool:
    """Whether an expression is a constant, or one of a NumPy type, such as ``np.float32(0.0)``."""
    return isinstance(value, ast.Constant) or (isinstance(value, ast.Call) and all(map(is_number, value.args)))


def test_kernels_are_found():
    names = {kernel.name for _, kernel, _ in kernels()}
    assert {"interpolate", "draw_row", "coherence", "trace_points"} <= names


def test_no_kernel_assigns_an_array_to_a_slice():
    """Numba compiles the text of the error for arrays of different shapes, which takes longer than most kernels."""
    wrong = [
        f"{path}: {kernel.name}: {ast.unparse(node)}"
        for path, kernel, _ in kernels()
        for node in ast.walk(kernel)
        if isinstance(node, ast.Assign) and any(map(is_slice, node.targets)) and not is_number(node.value)
    ]
    assert not wrong, "assign the elements in a loop"


def test_kernels_within_functions_take_nothing_but_numbers_from_them():
    """The cache tells them apart by the values that they take from around them; of a kernel there, each process has
    another value, and finds nothing in the cache.
    """
    wrong = []
    for path, kernel, around in kernels():
        local = {inner.name for outer in around for inner in ast.walk(outer) if isinstance(inner, ast.FunctionDef)}
        used = {node.id for node in ast.walk(kernel) if isinstance(node, ast.Name)}
        wrong += [f"{path}: {kernel.name} calls {name}" for name in (used & local) - {outer.name for outer in around}]
    assert not wrong
