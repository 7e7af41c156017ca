"""The experiment on resolution: widths by the formulas of textbooks, which folding leaves alone."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mirrorfold.common.windows import hann
from mirrorfold.reproducing import Findings, Work
from mirrorfold.reproducing.experiments import resolution
from mirrorfold.reproducing.parts import hall

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def findings() -> Findings:
    return resolution.run(Work(quick=True))


def test_factors_of_the_windows():
    def spectrum(x: float) -> float:
        window = hann(4001)
        at = np.arange(4001) - 2000
        return float(abs((window * np.exp(2j * np.pi * x * at / 4001)).sum()) / window.sum())

    half = np.sqrt(0.5)
    assert 2 * brentq(lambda x: spectrum(x) - half, 0.1, 1.5) == pytest.approx(resolution.HANN, abs=2e-3)
    assert 2 * brentq(lambda x: np.sinc(x) - half, 0.1, 0.9) == pytest.approx(resolution.UNIFORM, abs=1e-3)
    assert 2 * brentq(lambda x: np.sinc(x) ** 2 - half, 0.1, 0.9) == pytest.approx(resolution.BOTH_WAYS, abs=1e-3)


@pytest.mark.parametrize("name", ["range", "cross"])
@pytest.mark.parametrize("bounces", range(4))
def test_widths_are_those_of_the_windows(findings, name, bounces):
    ratio = findings.data[f"{name}_width_m"] / findings.data[f"{name}_predicted_m"]
    np.testing.assert_allclose(ratio.sel(bounces=bounces), 1.0, atol=0.05)
    assert findings.numbers[f"{name}_width_over_predicted_{bounces}"] == pytest.approx(
        float(ratio.sel(bounces=bounces).mean())
    )


def test_depth_does_not_grow_with_the_way_and_width_does(findings):
    data = findings.data
    assert np.ptp(data["range_width_m"].values) < 0.05 * float(data["range_width_m"].mean())
    across = data["cross_width_m"] * np.cos(np.radians(data["angle_deg"])) / data["way_m"]
    assert np.ptp(across.values) < 0.02 * float(across.mean())


def test_the_way_gets_longer_with_each_fold(findings):
    assert (findings.data["way_m"].diff("bounces") > 0.0).all()


def test_folded_points_are_placed_within_half_a_millimetre(findings):
    assert float(findings.data["position_error_m"].max()) < 0.5e-3
    assert findings.numbers["position_error_largest_m"] == pytest.approx(float(findings.data["position_error_m"].max()))


def test_claims(findings):
    assert [claim.verdict for claim in findings.claims] == ["agrees", "agrees", "new", "new"]
    largest = max(float(findings.data[f"{name}_width_m"].max()) for name in ("range", "cross"))
    assert f"at most {1e2 * largest:.1f} cm" in findings.claims[0].measured


def test_folds_undo_the_images():
    mirrors, target = hall.drawn(1)
    for chain in hall.CHAINS:
        fold = hall.unfolding(mirrors, chain)
        ghost = fold.inverse(target)
        assert np.linalg.det(fold.linear) == pytest.approx((-1.0) ** len(chain))
        np.testing.assert_allclose(fold(ghost), target, atol=1e-12)
