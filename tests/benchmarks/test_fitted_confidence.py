"""The fit of the weights of the confidence finds those by which the truth was drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.special import expit
from synthetic import echoes_at, empty_view

from mirrorfold.folding.points import Points
from mirrorfold.tree.mirror_tree import MirrorTree

FOLDER = Path(__file__).parents[2] / "benchmarks"
COUNT = 4000


@pytest.fixture
def benchmark(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    import confidence

    return confidence


def test_weights_by_which_the_truth_was_drawn_are_found(benchmark):
    """Those of kinds of points that no scene holds stay as they are."""
    random, drawn_by = np.random.default_rng(0), np.array([-2.0, 0.1, 0.9, 0.0, 0.0, 0.0, 0.0])
    features = np.column_stack([np.ones(COUNT), random.uniform(0.0, 20.0, COUNT), random.uniform(0.0, 3.0, COUNT),
                                np.zeros(COUNT), np.full(COUNT, np.nan), np.zeros(COUNT), np.zeros(COUNT)])  # fmt: skip
    true = random.random(COUNT) < expit(np.nan_to_num(features) @ drawn_by)
    echoes = echoes_at(empty_view(), np.column_stack([np.zeros(COUNT), np.linspace(0.5, 2.5, COUNT)]))
    points = Points.of(echoes, echoes.position)
    tree = MirrorTree(None, echoes.take([]), echoes)
    table, unknown = np.zeros(COUNT, dtype=np.intp), np.ones(COUNT)
    scene = benchmark.Scene("rays", "a radar", "no", points, tree, features, table, true, unknown)
    found = benchmark.fitted([scene], 0)
    np.testing.assert_allclose(found["in line of sight"], drawn_by, atol=0.25)
    assert found["behind mirrors"] == benchmark.TABLES[0]["behind mirrors"]
    now, fitted = (
        benchmark.calibration_error(scene.confidence([weights] * 3), true) for weights in (benchmark.TABLES[0], found)
    )
    assert fitted < 0.02 < now


def test_one_antenna_measures_what_it_sends_itself(benchmark):
    """Of all pairs of the same places, those that are one antenna."""
    places = ("tx", "axis"), np.arange(9.0).reshape(3, 3)
    pairs = {"s": (("frequency", "tx", "rx"), np.arange(18.0).reshape(2, 3, 3)), "tx_position": places,
             "rx_position": (("rx", "axis"), places[1])}  # fmt: skip
    moving = benchmark.one_antenna(xr.Dataset(pairs, {"frequency": [1.0, 2.0], "axis": list("xyz")}))
    np.testing.assert_array_equal(moving["s"], [[0.0, 4.0, 8.0], [9.0, 13.0, 17.0]])
    np.testing.assert_array_equal(moving["antenna_position"], places[1])
    assert moving["s"].dims == ("frequency", "position")
