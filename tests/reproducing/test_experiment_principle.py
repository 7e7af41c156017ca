"""The principle: ghosts stand at mirror images, and folding puts them back."""

from __future__ import annotations

import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work

pytestmark = [pytest.mark.slow, pytest.mark.replay]

CELL = 0.035
"""Diagonal of the resolution cell [m]: 8 cm of aperture, 10 GHz, at a range of 2 m."""


@pytest.fixture(scope="module")
def found():
    return EXPERIMENTS["principle"].run(Work(quick=True))


def test_ghosts_stand_at_mirror_images_and_fold_back(found):
    assert [claim.verdict for claim in found.claims] == ["agrees"] * 4
    assert len(found.numbers) == 10
    for name, distance in found.numbers.items():
        # An isometry keeps distances; what it adds are the errors of the mirrors.
        twin = name.replace("ghost_to_image", "folded_to_post")
        assert 0.0005 < distance < 0.5 * CELL, name
        assert abs(distance - found.numbers[twin]) < 0.002, name


def test_each_way_is_in_the_table_and_the_data(found):
    rows = found.tables[0].rows
    assert [row[0] for row in rows] == ["one wall"] * 2 + ["two walls"] * 3
    assert len({row[1] for row in rows}) == 3
    assert all(int(row[2]) >= 5 for row in rows)
    assert {"", "0", "0/0"} <= set(found.data["walls_2"]["chain"].values.tolist())
