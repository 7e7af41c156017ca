"""Few channels and metasurfaces: what the page says at reduced size."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work
from mirrorfold.reproducing.experiments.sparse import KINDS, METHODS

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def found():
    return EXPERIMENTS["sparse"].run(Work(quick=True))


def number(found, kind, method):
    return found.numbers[f"{kind}_10_percent_{method}_f_cells"]


def test_all_channels_show_what_is_hidden(found):
    assert found.numbers["full_f_cells"] > 0.95
    assert found.numbers["full_f_2cm"] > 0.5


@pytest.mark.parametrize("kind", ["channels", "modes"])
def test_a_tenth_will_do_for_sparse_imaging_alone(found, kind):
    assert number(found, kind, "sparse") > max(0.9, number(found, kind, "delay_and_sum") + 0.2)


def test_few_elements_will_do_for_both(found):
    """All their channels are measured, which tell lobes and paths from disc to disc from echoes without it, too.

    This is one scene of one draw; on the page, of more of both, sparse imaging needs fewer elements.
    """
    assert min(number(found, "elements", method) for method in ("sparse", "delay_and_sum")) > 0.8


def test_a_tenth_of_the_frequencies_will_not_do(found):
    assert number(found, "frequencies", "sparse") < 0.3


def test_the_sparse_image_must_be_restored(found):
    """What is not restored stands beside echoes in range, and folding takes much of that for their side lobes: without
    that, F would be 0.35 of channels and 0.31 of modes. So channels lose 0.13 and modes nothing, but elements all.
    """
    loss = {kind: number(found, kind, "sparse") - number(found, kind, "sparse_not_restored") for kind in KINDS}
    assert loss["elements"] > 0.3
    assert loss["channels"] > 0.1
    assert np.mean(list(loss.values())) > 0.2


def test_the_sparse_image_is_sparse(found):
    assert 0.0 < found.numbers["pixels_not_zero"] < 0.6


def test_discs_are_point_reflectors(found):
    """Nothing is left unexplained but what goes from disc to disc, a fifth of the amplitude; noise is a tenth."""
    assert found.numbers["discs_unexplained"] < 0.25


def test_the_claims_say_what_the_numbers_say(found):
    said = {claim.claim.split(",")[0].split("of the ")[-1]: claim for claim in found.claims}
    assert {claim.verdict for claim in found.claims} == {"new"}
    assert said["channels"].measured.startswith("sparse 10 %, delay and sum more than 10 %")
    assert said["frequencies"].measured.startswith("sparse more than 10 %")
    assert found.claims[-1].measured.startswith("no")


def test_scores_are_in_the_data_and_the_table(found):
    scores = found.data["scores"].to_dataset()
    assert scores["f_cells"].sizes == {"family": 1, "kind": len(KINDS), "share": 1, "imaging": len(METHODS), "scene": 1}
    for name in ("f_cells", "f_2cm", "mirrors", "invented"):
        assert scores[name].attrs["units"] == "1"
        assert ((scores[name] >= 0.0) & (scores[name] <= 1.0)).all()
    (table,) = found.tables
    assert len(table.rows) == 1 + len(KINDS) * len(METHODS)
    mean = float(scores["f_cells"].sel(kind="modes", imaging="sparse").mean())
    assert table.rows[-2][4] == f"{mean:.2f}"
    assert np.isfinite(list(found.numbers.values())).all()


def test_the_example_shows_more_than_noise(found):
    """Sparse imaging lowers the floor of the image that delay and sum makes of a tenth of the channels."""
    floor = {name: np.median(found.data[name]["initial"] / found.data[name]["initial"].max()) for name in found.data
             if name != "scores"}  # fmt: skip
    assert set(floor) == {"all_channels", "delay_and_sum", "sparse", "sparse_not_restored"}
    assert floor["sparse"] < 0.3 * floor["delay_and_sum"]


def test_pictures_have_labelled_axes(found):
    for figure, caption in found.figures.values():
        assert caption.endswith(".")
        assert any(ax.get_xlabel() for ax in figure.axes)


def test_the_example_is_kept_with_its_points(found):
    kept = found.data["sparse"]
    assert kept["objects"]["x"].dims == kept["objects"]["y"].dims == ("point",)
