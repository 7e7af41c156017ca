"""The tree of two walls in the published notation, against the images of the true walls."""

from __future__ import annotations

import json

import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work
from mirrorfold.reproducing.experiments.tree import notation

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found():
    return EXPERIMENTS["tree"].run(Work(quick=True))


def test_every_wall_has_a_node_for_each_way_by_which_it_is_seen(found):
    assert [claim.verdict for claim in found.claims] == ["agrees"] * 3
    for name, nodes, deepest in (("facing", 5, 3), ("hidden", 2, 1)):
        assert found.numbers[f"{name}_nodes"] == found.numbers[f"{name}_expected"] == nodes
        assert found.numbers[f"{name}_missing"] == found.numbers[f"{name}_unexpected"] == 0
        assert found.numbers[f"{name}_deepest"] == deepest
        assert found.numbers[f"{name}_angle_error_deg"] < 0.15
        assert found.numbers[f"{name}_offset_error_m"] < 0.1 * found.numbers[f"{name}_range_cell_m"]
        echoes, right = (found.numbers[f"{name}_object_echoes{which}"] for which in ("", "_in_place"))
        assert echoes >= 25
        assert right >= 0.95 * echoes


def test_the_tree_is_in_the_published_notation(found):
    """Page, data and table hold the same tree."""
    tree = json.loads(found.data["facing"].attrs["json"])
    assert json.dumps(tree) in found.text[1]
    named = {}

    def walk(node, name):
        named[name] = node
        for number, below in enumerate(node["mirror"], 1):
            walk(below, f"{name}.mirror({number})")

    walk(tree, "tree")
    rows = {row[0]: row for row in found.tables[0].rows}
    assert set(rows) == set(named)
    assert len(rows) == 6
    for name, node in named.items():
        assert rows[name][6] == str(node["object"])
        assert rows[name][2] == str(name.count("mirror"))
        assert ("line" in node) == (name != "tree")
    deep = next(name for name, row in rows.items() if row[2] == "3")
    assert rows[deep][3] == "left wall in right wall in left wall"
    assert notation("1/0/0") == "tree.mirror(2).mirror(1).mirror(1)"
