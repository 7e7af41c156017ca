"""The benchmark that varies constants: it finds them, changes them wherever they are held, and puts them back."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.detection.search import lines
from mirrorfold.scenes.floor_plan import parse_scene

PACKAGE = {
    "__init__": "",
    "origin": '''
import numba
LENGTH = 2.0
"""Why."""
PAIR = (1, 3)
DOUBLE = 2 * LENGTH
NAME = "no number"
def default(x=LENGTH, *, y=LENGTH + 1.0): return x, y
KERNEL = 4
@numba.njit
def compiled(): return KERNEL
''',
    "user": """
from varied_package.origin import DOUBLE, LENGTH as OWN
class Holder:
    kept = OWN
    def method(self, x=OWN): return x, DOUBLE
""",
    "other": "from varied_package.user import OWN as THIRD",
}


@pytest.fixture
def benchmark(monkeypatch):
    """The module, with its neighbours."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    return importlib.import_module("sensitivity")


@pytest.fixture
def package(benchmark, tmp_path, monkeypatch):
    """Sources of a package, and its modules by name."""
    (tmp_path / "varied_package").mkdir()
    for name, text in PACKAGE.items():
        (tmp_path / "varied_package" / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    sources = benchmark.Sources("varied_package")
    yield sources, {name: importlib.import_module(f"varied_package.{name}") for name in ("origin", "user", "other")}
    for name in [name for name in sys.modules if name.startswith("varied_package")]:
        del sys.modules[name]


def test_constants_are_found_with_their_reasons_and_with_what_cannot_follow_them(package):
    found = {constant.name: constant for constant in package[0].constants("varied_package.origin")}
    assert set(found) == {"LENGTH", "PAIR", "DOUBLE", "KERNEL"}
    assert (found["LENGTH"].value, found["LENGTH"].reason) == (2.0, "Why.")
    assert [name for name in found if found[name].derived] == ["DOUBLE"]
    assert found["KERNEL"].kernels == ("varied_package.origin.compiled",)
    assert found["LENGTH"].kernels == ()
    assert found["LENGTH"].stale == ("class varied_package.user.Holder",)


@pytest.mark.parametrize("fails", [False, True])
def test_a_varied_constant_is_varied_wherever_it_is_held_and_restored_everywhere(package, fails):
    sources, modules = package
    origin, user, other = modules["origin"], modules["user"], modules["other"]

    def held():
        return (
            origin.LENGTH,
            origin.DOUBLE,
            user.OWN,
            user.DOUBLE,
            other.THIRD,
            origin.default(),
            user.Holder().method(),
        )

    before = held()
    assert before == (2.0, 4.0, 2.0, 4.0, 2.0, (2.0, 3.0), (2.0, 4.0))
    length = next(c for c in sources.constants("varied_package.origin") if c.name == "LENGTH")
    try:
        with sources.varied(length, 5.0):
            assert held() == (5.0, 10.0, 5.0, 10.0, 5.0, (5.0, 6.0), (5.0, 10.0))
            if fails:
                raise ArithmeticError
    except ArithmeticError:
        assert fails
    assert held() == before


@pytest.mark.slow
def test_every_variation_differs_and_shares_stay_below_one(benchmark):
    constants, _ = benchmark.selected(benchmark.Sources("mirrorfold"), None)
    assert len(constants) > 20
    for constant in constants:
        for value in benchmark.sides(constant):
            assert np.all(np.not_equal(value, constant.value)), constant.label
            if constant.name in benchmark.SHARES:
                assert 0.0 < value < 1.0


@pytest.mark.slow
def test_a_constant_of_the_program_takes_effect_and_is_restored(benchmark):
    """A wall that is just long enough for a mirror is none when mirrors must be half as long again."""
    start, end = [-0.25, 1.25], [0.25, 1.2]
    points, amplitude = together(diffuse(start, end, seed=1), diffuse([-0.4, 0.8], [-0.3, 0.8], seed=2))
    x, y = np.arange(-0.6, 0.6, 0.006), np.arange(0.6, 1.6, 0.006)
    wall = {"name": "wall", "kind": "segment", "start": start, "end": end}
    scene = parse_scene({
        "name": "one wall", "dimensions": 2, "surface": [wall],
        "array": {"kind": "linear", "elements": 161, "pitch": 0.5e-3},
        "band": {"start": 290e9, "stop": 300e9, "points": 401},
    })  # fmt: skip
    case = benchmark.Case("rays", "one wall", scene, radar_image(points, amplitude, x, y))
    sources = benchmark.Sources("mirrorfold")
    (constant,), _ = benchmark.selected(sources, ["lines.MINIMUM_CELLS"])

    def mirrors():
        return mf.fold(case.image)["mirrors"].dataset.sizes["mirror"]

    own = lines.MINIMUM_CELLS
    assert mirrors() == 1
    with sources.varied(constant, 3.0 * own):
        assert mirrors() == 0
    assert own == lines.MINIMUM_CELLS
    assert mirrors() == 1

    tasks = [(None, None, "alone"), *((constant, value, "alone") for value in (0.9 * own, 3.0 * own))]
    unvaried, shorter, longer = benchmark.results(sources, [case], tasks, jobs=1)
    assert own == lines.MINIMUM_CELLS
    assert not any(one.error for one in (unvaried, shorter, longer))
    assert shorter.scores == unvaried.scores
    assert longer.scores["one wall"]["all"] != unvaried.scores["one wall"]["all"]
    shown = benchmark.table([unvaried, shorter, longer], [case])
    assert shown.row_count == 3


def test_verdicts(benchmark):
    def both(mean_down, mean_up, worst=0.0):
        return [{("rays", "all", "mean"): mean, ("rays", "all", "worst"): worst} for mean in (mean_down, mean_up)]

    assert benchmark.verdict(both(0.0005, -0.0005), failed=False) == "moves nothing"
    assert benchmark.verdict(both(0.0005, -0.0005, worst=-0.02), failed=False) == "flat"
    assert benchmark.verdict(both(0.0, -0.005), failed=False) == "flat"
    assert benchmark.verdict(both(0.03, -0.02), failed=False) == "edge"
    assert benchmark.verdict(both(0.03, 0.0), failed=False) == "gains"
    assert benchmark.verdict(both(0.0, 0.0), failed=True) == "fails"
