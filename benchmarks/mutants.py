"""Change one operator or number of a module at a time: do its tests notice?

    python benchmarks/mutants.py src/mirrorfold/common/geometry.py --tests tests/common/test_geometry.py
    python benchmarks/mutants.py src/mirrorfold/tree/curved.py --tests tests/tree/test_curved_evidence.py --sample 40

A mutant that all tests accept has survived: either a test is missing, or the change makes no difference. Each mutant
runs in a fork of one process that has imported all libraries, so that it costs no more than its tests. Slow tests are
left out, unless `--marked` says otherwise. The kernels of a module run as plain Python, because compiled code that is
kept on disk would be that of the original.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib
import os
import random
import resource
import signal
import sys
import time
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path

LEAST_SECONDS, TIMES_AS_LONG = 20.0, 10.0
"""Limit of the processor time of a mutant's tests: the larger of this time [s], and this multiple of the time without a
change. A mutant whose tests take longer does not end; it counts as noticed."""

LIBRARIES = ("hypothesis", "numba", "pytest", "scipy.ndimage", "scipy.spatial", "xarray")
"""Libraries that are imported once, before the forks."""

SWAPPED = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
"""Operators, and those that replace them."""

NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "argmin": "argmax", "argmax": "argmin", "sin": "cos"}
NAMES |= {"minimum": "maximum", "maximum": "minimum", "floor": "ceil", "ceil": "floor", "cos": "sin"}
"""Functions, and those that replace them."""


def changes(tree: ast.Module) -> Iterator[tuple[int, str, ast.Module]]:
    """Line, description and tree of every mutant."""
    alone = _left_alone(tree)
    nodes = [node for node in ast.walk(tree) if id(node) not in alone]
    for index, node in enumerate(nodes):
        what = _change_of(node)
        if what is None:
            continue
        clone = copy.deepcopy(tree)
        alone = _left_alone(clone)
        _apply([one for one in ast.walk(clone) if id(one) not in alone][index])
        yield node.lineno, what, clone


def _left_alone(tree: ast.Module) -> set[int]:
    """Identities of nodes that are not changed, because no result depends on them: annotations, decorators, texts,
    errors that are raised, and guards against our own mistakes, such as `strict` of a `zip`.
    """
    found: set[int] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST] = []
        if isinstance(node, ast.FunctionDef):
            parts = [*node.decorator_list, *([node.returns] if node.returns else [])]
            parts += [argument.annotation for argument in node.args.args if argument.annotation]
        elif isinstance(node, ast.AnnAssign):
            parts = [node.annotation]
        elif (isinstance(node, ast.keyword) and node.arg == "strict") or _for_types_alone(node):
            parts = [node]
        elif isinstance(node, ast.JoinedStr | ast.Raise | ast.ClassDef):
            parts = [node] if not isinstance(node, ast.ClassDef) else list(node.decorator_list)
        for part in parts:
            found |= {id(one) for one in ast.walk(part)}
    return found


def _for_types_alone(node: ast.AST) -> bool:
    """Whether a node is an ``if TYPE_CHECKING`` block."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _change_of(node: ast.AST) -> str | None:
    """How a node is changed, in words; None if it is not."""
    if isinstance(node, ast.BinOp | ast.AugAssign | ast.BoolOp) and type(node.op) in SWAPPED:
        return f"{type(node.op).__name__} to {SWAPPED[type(node.op)].__name__}"
    if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPPED:
        return f"{type(node.ops[0]).__name__} to {SWAPPED[type(node.ops[0])].__name__}"
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
        return f"without {type(node.op).__name__}"
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        return f"{node.value} to {not node.value}"
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return f"{node.value} to {_other(node.value)}"
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        return "condition negated"
    name = node.func if isinstance(node, ast.Call) else None
    word = name.attr if isinstance(name, ast.Attribute) else name.id if isinstance(name, ast.Name) else ""
    return f"{word} to {NAMES[word]}" if word in NAMES else None


def _other(number: float) -> float:
    """The number that replaces a number."""
    return number + 1 if isinstance(number, int) else 2.0 * number if number else 1.0


def _apply(node: ast.AST) -> None:
    """Change a node in place."""
    if isinstance(node, ast.BinOp | ast.AugAssign | ast.BoolOp):
        node.op = SWAPPED[type(node.op)]()
    elif isinstance(node, ast.Compare):
        node.ops[0] = SWAPPED[type(node.ops[0])]()
    elif isinstance(node, ast.UnaryOp):
        node.operand = ast.UnaryOp(node.op, node.operand)  # applied twice, the operator has no effect
    elif isinstance(node, ast.Constant):
        node.value = not node.value if isinstance(node.value, bool) else _other(node.value)
    elif isinstance(node, ast.If | ast.IfExp | ast.While):
        node.test = ast.UnaryOp(ast.Not(), node.test)
    elif isinstance(node, ast.Call):
        if isinstance(node.func, ast.Attribute):
            node.func.attr = NAMES[node.func.attr]
        elif isinstance(node.func, ast.Name):
            node.func.id = NAMES[node.func.id]


def survives(path: Path, tree: ast.Module | None, tests: list[str], seconds: float) -> bool:
    """Whether the tests accept a mutant within this processor time [s]; `tree` None is the module unchanged."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(1, 2)
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # which ends the process
    signal.setitimer(signal.ITIMER_PROF, seconds)
    usual = SourceFileLoader.get_code

    def get_code(self: SourceFileLoader, name: str) -> object:
        if tree is not None and Path(self.get_filename(name)).resolve() == path:
            return compile(ast.fix_missing_locations(tree), str(path), "exec")
        return usual(self, name)

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign]
    import pytest

    # Hypothesis was imported before the forks, so pytest warns that it cannot rewrite the assertions of Hypothesis.
    quiet = ["-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    os._exit(int(pytest.main(["-x", "-q", *quiet, *tests])))
    return False


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("module", type=Path)
    parser.add_argument("--tests", nargs="+", required=True, help="what pytest is called with")
    parser.add_argument("--marked", default="not slow", help="which of them, as pytest's -m")
    parser.add_argument("--named", default="", help="which of them, as pytest's -k")
    parser.add_argument("--sample", type=int, default=0, help="so many mutants at random; by default all")
    parser.add_argument("--seed", type=int, default=0, help="of that sample")
    parser.add_argument("--lines", type=int, nargs="*", help="of these lines alone")
    parser.add_argument("--minutes", type=float, default=60.0)
    options = parser.parse_args()
    path = options.module.resolve()
    source = path.read_text(encoding="utf-8")
    if "njit" in source:
        os.environ["NUMBA_DISABLE_JIT"] = "1"
    for library in LIBRARIES:
        importlib.import_module(library)
    assert not any(name.startswith("mirrorfold") for name in sys.modules)
    tests = [*options.tests, "-m", options.marked, "-k", options.named]
    if not survives(path, None, tests, 60.0 * options.minutes):
        print("the tests fail without any change")
        return 2
    found = [one for one in changes(ast.parse(source)) if not options.lines or one[0] in options.lines]
    usual = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = max(LEAST_SECONDS, TIMES_AS_LONG * (usual.ru_utime + usual.ru_stime))
    count = min(options.sample or len(found), len(found))
    chosen = sorted(random.Random(options.seed).sample(range(len(found)), count))
    end, tried, alive = time.monotonic() + 60.0 * options.minutes, 0, 0
    for number in chosen:
        if time.monotonic() > end:
            break
        line, what, tree = found[number]
        tried += 1
        if survives(path, tree, tests, seconds):
            alive += 1
            print(f"{options.module}:{line}: {what} survives", flush=True)
    print(f"{options.module}: {tried} of {len(found)} mutants tried, {alive} survived")
    return 0


if __name__ == "__main__":
    sys.exit(main())
