"""How long imaging and folding take: what must hold on any machine."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work

pytestmark = [pytest.mark.slow, pytest.mark.replay]

SIZES = "150x200", "300x400"


@pytest.fixture(scope="module")
def found():
    return EXPERIMENTS["runtime"].run(Work(quick=True))


def test_the_fast_image_is_the_plain_sum_to_the_tolerance(found):
    for size in SIZES:
        assert 0.0 < found.numbers[f"pixels_{size}_image_error"] <= 1e-3


def test_numbers_table_and_data_agree(found):
    assert [claim.verdict for claim in found.claims[1:]] == ["new", "new"]
    assert found.numbers["cores"] >= 1
    assert [row[0] for row in found.tables[0].rows] == list(SIZES)
    for number, size in enumerate(SIZES):
        one = found.data.isel(size=number)
        names = "plan_s", "image_s", "fold_s", "fold_published_s", "pairs_s", "sum_s"
        medians = {name: float(np.median(one[name])) for name in names}
        for name, seconds in medians.items():
            assert seconds > 0.0
            assert found.numbers[f"pixels_{size}_{name}"] == pytest.approx(seconds)
        fold, image, pairs, plain = (medians[name] for name in ("fold_s", "image_s", "pairs_s", "sum_s"))
        assert found.numbers[f"pixels_{size}_folding_share"] == pytest.approx(fold / (fold + image))
        assert found.numbers[f"pixels_{size}_folding_share_of_pairs"] == pytest.approx(fold / (fold + pairs))
        assert found.numbers[f"pixels_{size}_folding_share_of_plain"] == pytest.approx(fold / (fold + plain))
        assert found.numbers[f"pixels_{size}_gain"] == pytest.approx(plain / image)
    assert float(found.data["pixels"][1]) == 4 * float(found.data["pixels"][0])


@pytest.mark.timing
def test_folding_is_little_beside_the_plain_sum_and_much_beside_the_fast_image(found):
    """Factors of 10 and of 100 leave room for whatever else a machine does."""
    assert found.claims[0].verdict == "agrees"
    for size in SIZES:
        assert found.numbers[f"pixels_{size}_folding_share_of_plain"] < 0.2
        assert found.numbers[f"pixels_{size}_gain"] > 100.0
