"""Sweeps of which a part was not measured: a source that dropped out, a stage that was stuck, samples written twice."""

from __future__ import annotations

import numpy as np
import pytest
from instruments import line
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.windows import hann
from mirrorfold.diagnosis import diagnose
from mirrorfold.diagnosis.repeated import repeated_findings

FREQUENCY = np.linspace(142e9, 158e9, 160)
PITCH = 0.9e-3


def echoes(seed, *, moving, wall=0.0, snr_db=20.0):
    """Samples of 40 antennas: (frequencies, tx, rx), or of one that moves, (frequencies, position).

    The scene holds a dozen points, and of the given strength a smooth wall that faces the middle of the antennas.
    """
    random = np.random.default_rng([seed, 8])
    place = line(40, pitch=PITCH)
    points = random.uniform((-0.6, 0.4, 0.0), (0.6, 1.2, 0.0), (12, 3))
    path = np.linalg.norm(place[:, None] - points, axis=2)
    k = 2 * np.pi * FREQUENCY[:, None, None] / speed_of_light
    one_way = np.exp(-1j * k * path)
    strength = random.standard_normal((2, 12)).T @ [1.0, 1j]
    image = place + np.array([0.0, 2 * 0.7, 0.0])
    if moving:
        glint = np.exp(-2j * k[:, 0] * np.hypot(0.7, place[:, 0]))
        s = np.einsum("fip,p->fi", one_way**2, strength) + wall * glint
    else:
        glint = np.exp(-1j * k * np.linalg.norm(place[:, None] - image, axis=2))
        s = np.einsum("fip,fkp,p->fik", one_way, one_way, strength) + wall * glint
    noise = (random.standard_normal((2, *s.shape)).T @ [1.0, 1j]).T
    return s + noise * np.sqrt(0.5 * np.mean(np.abs(s) ** 2)) * 10 ** (-snr_db / 20)


def sweep(s):
    place = line(40, pitch=PITCH)
    if s.ndim == 2:
        return mf.make_monostatic_sweep(s, frequency=FREQUENCY, antenna_position=place)
    return mf.make_sweep(s, frequency=FREQUENCY, tx_position=place, rx_position=place)


def named(s):
    return [finding.name for finding in diagnose(sweep(s))[0]]


@pytest.mark.slow
@pytest.mark.parametrize("moving", [False, True])
def test_a_source_that_dropped_out_is_named_with_the_band_that_is_left(moving):
    s = echoes(0, moving=moving)
    random = np.random.default_rng(0)
    for level in (0.0, 0.05):
        dropped = s.copy()
        dropped[107:] = level * random.standard_normal(s[107:].shape)
        found = [finding for finding in mf.info(sweep(dropped)).findings if finding.name == "silent-frequencies"]
        assert len(found) == 1
        assert "53 of 160 frequencies, above 152.667 GHz" in found[0].what
        assert "slice(0, 107)" in found[0].fix
    dropped[:10] = 0.0
    assert "slice(10, 107)" in mf.info(sweep(dropped)).findings[0].fix


@pytest.mark.slow
@pytest.mark.parametrize("moving", [False, True])
def test_a_window_the_band_of_a_transducer_and_a_wall_ahead_are_no_slips(moving):
    s = echoes(1, moving=moving, wall=30.0, snr_db=30.0)
    column = (slice(None), *[None] * (s.ndim - 1))
    band = np.exp(-(np.linspace(-2.2, 2.2, len(s)) ** 2))
    for right in (s, s * hann(len(s))[column], s * band[column]):
        assert not {"silent-frequencies", "repeated-samples", "stuck-stage"} & set(named(right))


@pytest.mark.parametrize("moving", [False, True])
def test_a_stage_that_was_stuck_is_named_with_its_stops(moving):
    noise = np.random.default_rng(2).standard_normal
    for first, last in ((12, 17), (20, 23), (31, 40)):
        s = echoes(2, moving=moving)
        rows = s[:, first:last]
        rows[:] = rows[:, :1] + 0.3 * (noise(rows.shape) + 1j * noise(rows.shape))
        found = repeated_findings(sweep(s))
        assert [finding.name for finding in found] == ["stuck-stage"]
        assert f" {first + 1} to {last} of 40" in found[0].what


def test_stops_of_unequal_distance_are_not_stuck():
    place = np.delete(line(60, pitch=PITCH / 20.0), slice(30, 50), axis=0)
    place[:30] -= [5.0 * PITCH, 0.0, 0.0]
    target = np.array([[0.3, 0.8, 0.0], [-0.2, 0.5, 0.0], [0.1, 1.1, 0.0], [-0.4, 0.7, 0.0], [0.5, 0.9, 0.0]])
    path = np.linalg.norm(place[:, None] - target, axis=2)
    s = np.exp(-4j * np.pi / speed_of_light * FREQUENCY[:, None, None] * path).sum(axis=2)
    made = mf.make_monostatic_sweep(s, frequency=FREQUENCY, antenna_position=place)
    assert repeated_findings(mf.add_noise(made, snr_db=30.0, seed=0)) == []


def test_samples_that_were_written_twice_are_named():
    s = echoes(3, moving=False)
    s[:, 20:23] = s[:, 10:13]
    found = diagnose(sweep(s))[0]
    assert [finding.name for finding in found][:1] == ["repeated-samples"]
    assert "3 of 40 transmitters" in found[0].what
    assert "number 11 and 21" in found[0].what


def test_symmetric_scenes_and_scans_that_meet_nothing_hold_no_copies():
    half = echoes(4, moving=True)[:, :20]
    assert repeated_findings(sweep(np.concatenate([half, half[:, ::-1]], axis=1))) == []
    leakage = np.exp(-0.3j * np.arange(len(FREQUENCY)))
    scan = np.broadcast_to(leakage[:, None, None], (len(FREQUENCY), 9, 9)).copy()
    scan[:, 3, 4] += np.exp(-1j * np.arange(len(FREQUENCY)))
    angles = np.linspace(-4.0, 4.0, 9)
    made = mf.make_raster_sweep(scan, frequency=FREQUENCY, azimuth=angles, elevation=angles)
    assert repeated_findings(made) == []
    scan += np.random.default_rng(5).standard_normal(scan.shape)
    scan[:, 6] = scan[:, 5]
    made = made.assign(s=made["s"].copy(data=scan.astype(np.complex64)))
    assert [finding.name for finding in repeated_findings(made)] == ["repeated-samples"]
