"""Samples that are echoes over time in place of frequencies, and phases in radians that were taken for degrees."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from instruments import line
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis import sample_findings
from mirrorfold.diagnosis.findings import Finding


def s(seed, *, count=64, points=10, elements=10):
    """Samples (frequencies, tx, rx) of random points before a line of antennas, with noise."""
    random = np.random.default_rng([seed, 3])
    k = 2 * np.pi * np.linspace(75e9, 81e9, count)[:, None, None] / speed_of_light
    place = random.uniform([-0.5, 0.2], [0.5, 1.2], (points, 2))
    path = np.hypot(line(elements, pitch=1.9e-3)[:, :1] - place[:, 0], place[:, 1])  # (elements, points)
    strength = random.standard_normal((2, points)).T @ [1.0, 1j]
    echoes = sum(a * np.exp(-1j * k * (r[:, None] + r)) for a, r in zip(strength, path.T, strict=True))
    return echoes + 0.1 * (random.standard_normal((2, *echoes.shape)).T @ [1.0, 1j]).T


def sweep(samples):
    antennas = line(samples.shape[1], pitch=1.9e-3)
    frequency = np.linspace(75e9, 81e9, samples.shape[0])
    return mf.make_sweep(samples, frequency=frequency, tx_position=antennas, rx_position=antennas)


def named(samples):
    return [finding.name for finding in sample_findings(sweep(samples))]


@pytest.mark.parametrize("seed", range(5))
def test_echoes_over_time_are_named(seed):
    right = s(seed)
    assert named(right) == []
    assert named(np.fft.ifft(right, axis=0)) == ["time-domain"]


@pytest.mark.parametrize("width", [0.1, 0.2, 0.5])
def test_a_narrow_band_is_not_taken_for_echoes_over_time(width):
    """Speckle from everywhere, through a transducer that passes part of the band alone."""
    random = np.random.default_rng(1)
    speckle = (random.standard_normal((2, 64, 10, 10)).T @ [1.0, 1j]).T
    band = np.exp(-(((np.arange(64) - 31.5) / (64 * width)) ** 2))
    assert "time-domain" not in named(speckle * band[:, None, None])


@pytest.mark.parametrize("seed", range(3))
def test_phases_in_radians_taken_for_degrees_are_named(seed):
    right = s(seed)
    assert named(np.abs(right) * np.exp(1j * np.radians(np.angle(right)))) == ["phase-unit"]
    strong = right + 0.1 * np.abs(right).max()  # one echo makes some phases more frequent than others
    assert named(np.abs(strong) * np.exp(1j * np.radians(np.angle(strong)))) == ["phase-unit"]
    assert "phase-unit" not in named(np.exp(0.02j * np.random.default_rng(seed).standard_normal(right.shape)))


def test_commands_can_be_pasted_whatever_the_path():
    command = Finding("conjugated", "The samples are conjugated.", 0.9, "--conjugate").command("my scan/sweep 1.nc")
    assert shlex.split(command)[2:5] == ["my scan/sweep 1.nc", "-o", "my scan/sweep 1-repaired.nc"]


@pytest.mark.parametrize("seed", range(3))
def test_a_parameter_that_was_not_measured_is_named(seed):
    right = s(seed)
    assert named(np.zeros_like(right) + 1e-9) == ["constant"]
    assert named(np.zeros_like(right) + right[:1]) == ["constant"]
    assert "constant" not in named(np.where(np.arange(len(right))[:, None, None] > 3, right, right[:1]))
