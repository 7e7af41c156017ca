"""Every experiment has a module, a test, and a sentence that says what it is."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path

import pytest

from mirrorfold.reproducing import EXPERIMENTS
from mirrorfold.reproducing.catalogue import NEEDS, PACKAGE, chosen

HERE = Path(__file__).parent

PUBLISHED = ("principle", "two-walls", "tree", "drywall-mannequin", "corridor", "synthetic-aperture", "resolution")
QUESTIONS = ("frequency", "bounces", "errors", "sparse")


def test_all_that_was_published_and_all_questions_are_there():
    assert {*PUBLISHED, *QUESTIONS, "scattering", "runtime", "convex", "semi-transparent"} == set(EXPERIMENTS)
    assert all(not EXPERIMENTS[name].source for name in QUESTIONS)
    assert all(EXPERIMENTS[name].source for name in PUBLISHED)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_each_experiment_has_a_module_and_a_test(name):
    experiment = EXPERIMENTS[name]
    module = import_module(f"{PACKAGE}.{experiment.module}")
    assert list(inspect.signature(module.run).parameters) == ["work"]
    tests = "\n".join(path.read_text(encoding="utf-8") for path in HERE.glob("test_experiment_*.py"))
    assert f'EXPERIMENTS["{name}"].run(' in tests or f"{experiment.module}.run(Work(quick=True))" in tests
    assert experiment.purpose.endswith(".")
    assert experiment.extra in ("", *NEEDS)
    assert experiment.digest(quick=True) != experiment.digest(quick=False)


def test_the_order_is_that_of_the_catalogue_whatever_is_named_first():
    assert [one.name for one in chosen(["tree", "principle"])] == ["principle", "tree"]
    assert [one.name for one in chosen("all")] == list(EXPERIMENTS)
