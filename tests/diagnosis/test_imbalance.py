"""I and Q out of balance show every echo a second time, at the mirrored range."""

from __future__ import annotations

import re

import numpy as np
import pytest
from point_sweeps import echoes
from scans import point_sweep
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis.imbalance import imbalance_findings


def chip(seed, *, late=0):
    """A chip of 4 x 8 antennas at 77 GHz that sees twenty points, some of them beyond its ambiguous range of 12.8 m."""
    random = np.random.default_rng(seed)
    frequency = 77e9 + np.arange(256) * speed_of_light / (2.0 * 12.8)
    wavelength = speed_of_light / 77e9
    tx, rx = (np.outer(step * wavelength * np.arange(count), [1.0, 0.0, 0.0]) for step, count in ((4.0, 4), (0.5, 8)))
    angle, range_ = random.uniform(-1.0, 1.0, 20), random.uniform(0.8, 6.0, 20)
    range_[:late] += 12.8
    points = np.stack([range_ * np.sin(angle), range_ * np.cos(angle), 0.0 * angle], axis=1)
    sweep = mf.make_sweep(echoes(frequency, tx, rx, points), frequency=frequency, tx_position=tx, rx_position=rx)
    return mf.add_noise(sweep, snr_db=20.0, seed=seed)


def unbalanced(sweep, b):
    return sweep.assign(s=sweep["s"].copy(data=sweep["s"].values + b * sweep["s"].values.conj()))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("b", [0.03j, 0.1, -0.12 + 0.09j])
def test_an_imbalance_is_named_with_what_takes_the_images_off(seed, b):
    balanced = chip(seed)
    sweep = unbalanced(balanced, b)
    (finding,) = imbalance_findings(sweep)
    assert finding.name == "iq-imbalance"
    told = complex(re.search(r"\((.*?j)\)", finding.remedy)[1])
    assert told == pytest.approx(b, abs=0.2 * abs(b))
    s = sweep["s"].values
    assert imbalance_findings(sweep.assign(s=sweep["s"].copy(data=s - told * s.conj()))) == []


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("late", [0, 5, 10])
def test_echoes_that_have_truly_wrapped_around_are_no_imbalance(seed, late):
    sweep = chip(seed, late=late)
    assert imbalance_findings(sweep) == []
    assert imbalance_findings(mf.calibrate.conjugate(sweep)) == []


def test_neither_noise_nor_a_scan_of_points_has_images():
    scan = point_sweep((0.0, 1.2, 0.0), (0.02, 1.5, 0.0), noise=0.01)
    assert imbalance_findings(scan) == []
    assert imbalance_findings(mf.add_noise(scan, snr_db=-60.0, seed=0)) == []
