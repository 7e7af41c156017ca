"""The choice of an algorithm: each usual geometry within its tolerance, and never much slower than the exact kernel."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from focusing_problems import line, noise, plane, problem, relative_error

from mirrorfold.focusing import choose_algorithm
from mirrorfold.focusing.choosing import choice
from mirrorfold.focusing.choosing.caching import PlanCache
from mirrorfold.focusing.choosing.choice import explain, options
from mirrorfold.focusing.choosing.proven import prove
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.fast.line_array import LineArrayPlan, lay_out
from mirrorfold.focusing.predicting.cost import exact_cost
from mirrorfold.sweep import make_sweep

BAND = np.linspace(290e9, 300e9, 61)
SLOWEST = 1.2
"""Of the exact kernel's time, for whatever is chosen, planning included."""


def turned(position, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return position @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def arc(count, angle, radius):
    a = np.linspace(-angle, angle, count)
    return radius * np.stack([np.sin(a), np.cos(a) - 1.0, 0.0 * a], axis=1)


LINE = line(41, 0.5e-3)
GEOMETRIES = {
    "coincident": (LINE, LINE),
    "15 mm above": (LINE, line(41, 0.5e-3, z=0.015)),
    "5 mm behind": (LINE, line(41, 0.5e-3, y=-0.005)),
    "10 cm aside": (LINE, line(41, 0.5e-3, x=0.1)),
    "aside, behind and above": (LINE, line(41, 0.5e-3, x=0.05, y=-0.03, z=0.04)),
    "tilted by 3 degrees": (LINE, turned(LINE, 3.0)),
    "tilted by 20 degrees": (LINE, turned(LINE, 20.0)),
    "at right angles": (LINE, np.add(turned(LINE, 90.0), [0.0, 0.03, 0.0])),
    "unequal pitch and length": (line(31, 0.5e-3), line(51, 0.7e-3, z=0.01)),
    "a robot's arc": (arc(61, 0.05, 0.5), arc(61, 0.05, 0.5)),
    "a plane against a line": (plane(9, 9, 1e-3), line(41, 0.5e-3, z=0.01)),
    "one moving, few fixed": (line(161, 0.5e-3), np.array([[-0.3, 0.0, 0.0], [0.2, -0.1, 0.05], [0.4, 0.1, 0.0]])),
    "one moving, one fixed": (line(321, 0.5e-3), np.array([[0.2, -0.1, 0.05]])),
}


def small(name, columns=120, rows=90):
    return problem(*GEOMETRIES[name], BAND, np.linspace(-1.5, 1.5, columns), np.linspace(0.6, 2.2, rows))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in GEOMETRIES if name != "at right angles"])
def test_the_fast_path_of_lines_holds_its_tolerance(name, monkeypatch):
    """In full: without the exact kernel's help where the array is far enough away."""
    dear = choice.Cost(0.0, 1e6)
    monkeypatch.setattr("mirrorfold.focusing.fast.line_array.exact_cost", lambda *_: dear)
    p = small(name)
    s = noise(p.data_shape)
    plan = LineArrayPlan(p, 3e-4)
    assert plan.sectors
    assert relative_error(plan(s), p, s, pixels=200) <= 3e-4


@pytest.mark.parametrize("name", GEOMETRIES)
def test_whatever_is_chosen_is_predicted_to_be_no_slower_than_the_exact_kernel(name):
    p = small(name, 440, 341)
    best = options(p, 1e-3)[0]
    exact = exact_cost(p, p.pixels, 0.5e-3)
    assert best.cost.processor_seconds() <= exact.processor_seconds()
    assert best.cost.seconds() <= exact.seconds()


@pytest.mark.slow
@pytest.mark.timing
@pytest.mark.parametrize("name", GEOMETRIES)
def test_whatever_is_chosen_is_measured_to_be_no_slower_than_the_exact_kernel(name):
    """Processor time of choice, plan, image and proof, against the exact kernel on a quarter of the pixels."""
    p = small(name, 440, 340)
    s = noise(p.data_shape)
    part = p.on(p.x[::2], p.y[::2], p.z)
    focus_exact(p.on(p.x[:20], p.y[:20], p.z), s, 0.5e-3)
    start = time.process_time()
    focus_exact(part, s, 0.5e-3)
    exact = 4.0 * (time.process_time() - start)
    prove(p, 1e-3, s, PlanCache())  # loads what is compiled
    start = time.process_time()
    proven = prove(p, 1e-3, s, PlanCache())
    spent = time.process_time() - start
    if proven is None:
        assert options(p, 1e-3)[0].algorithm == "exact" or spent <= (SLOWEST - 1.0) * exact
    else:
        assert spent <= SLOWEST * exact
        assert relative_error(proven.image, p, s) <= 1e-3


def test_displaced_lines_are_nearly_as_cheap_as_coincident_ones():
    """Within three times their throughput, by the model, on the default grid's scale."""
    seconds = {}
    for name in ("coincident", "15 mm above", "5 mm behind", "tilted by 3 degrees"):
        p = small(name, 1797, 992)
        seconds[name] = lay_out(p, 1e-4).cost.processor_seconds()
    assert max(seconds.values()) <= 3.0 * seconds["coincident"]


def test_the_choice_can_be_asked_for():
    sweep = make_sweep(noise((61, 41, 41)), frequency=BAND, tx_position=LINE, rx_position=line(41, 0.5e-3, z=0.015))
    grid = {"x": np.linspace(-1, 1, 500), "y": np.linspace(0.3, 1.2, 400)}
    found = choose_algorithm(sweep.drop_vars("s"), **grid, tolerance=1e-3)
    assert found.algorithm == "polar"
    assert [option.algorithm for option in found.options if option.chosen] == ["polar"]
    assert {option.algorithm for option in found.options} == {"polar", "factorized", "exact"}
    exact = found.options[-1]
    assert found.focusing_s < exact.total_s
    assert all(option.why for option in found.options)
    assert found.pixels == 200_000
    json.dumps(found)
    few = choose_algorithm(sweep, x=grid["x"][::50], y=grid["y"][::50])
    assert few.algorithm == "exact"
    assert "no plan pays" in few.options[0].why


def test_more_images_make_a_plan_worth_more():
    p = small("a robot's arc", 440, 341)
    once, often = explain(p, 1e-3), explain(p, 1e-3, frames=100)
    assert often.focusing_s > once.focusing_s
    assert often.algorithm != "exact"


@pytest.mark.parametrize("name", ["coincident", "a robot's arc"])
def test_what_is_forecast_is_laid_out_as_what_focuses(name):
    """Algorithms get lengths in wavelengths; laid out in metres, their nodes and their costs were others."""
    p = small(name, 440, 341)
    forecast, focusing = explain(p, 1e-3), options(p.in_wavelengths, 1e-3)[0]
    assert (forecast.algorithm, forecast.options[0].building_s) == (focusing.algorithm, focusing.cost.building)
    assert forecast.extent["x"] == [-1.5, 1.5]
