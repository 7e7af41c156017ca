"""Rows measured to and fro by a stage with backlash, in two lines, a plane of positions and a scan."""

from __future__ import annotations

import numpy as np
import pytest
from instruments import line
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis import diagnose
from mirrorfold.diagnosis.backlash import backlash_findings

FREQUENCY = np.linspace(142e9, 158e9, 48)
K = 2 * np.pi * FREQUENCY / speed_of_light
PITCH = 0.9e-3


def scene(seed):
    """Places (points, 3) and strengths of a dozen points."""
    random = np.random.default_rng([seed, 17])
    place = random.uniform((-0.6, 0.4, -0.3), (0.6, 1.4, 0.3), (12, 3))
    return place, random.standard_normal((2, 12)).T @ [1.0, 1j]


def two_lines(seed, shift):
    """Transmitters at 22 places; the receivers go to and fro, and are displaced [m] on their way back."""
    points, strength = scene(seed)
    tx, rx = line(22, pitch=PITCH), line(28, pitch=PITCH, centre=(0.0, 0.0, 0.03))
    out = np.exp(-1j * K[:, None, None] * np.linalg.norm(tx[:, None] - points, axis=2))
    s = np.empty((K.size, len(tx), len(rx)), complex)
    for first, moved in ((0, 0.0), (1, shift)):
        distance = np.linalg.norm(rx[:, None] + np.array([moved, 0.0, 0.0]) - points, axis=2)
        s[:, first::2] = np.einsum(
            "fip,fkp,p->fik", out[:, first::2], np.exp(-1j * K[:, None, None] * distance), strength
        )
    return mf.make_sweep(s, frequency=FREQUENCY, tx_position=tx, rx_position=rx)


def plane(seed, shift, *, along=0):
    """One antenna at 20 rows of 24 places; every other row is displaced [m] along x or, by `along` = 2, along z."""
    points, strength = scene(seed)
    row, number = np.indices((20, 24)).reshape(2, -1)
    place = np.zeros((number.size, 3))
    place[:, along], place[:, 2 - along] = 0.5 * PITCH * number, 0.5 * PITCH * row
    true = place.copy()
    true[row % 2 == 1, along] += shift
    distance = np.linalg.norm(true[:, None] - points, axis=2)
    s = np.exp(-2j * K[:, None, None] * distance) @ strength
    mixed = np.random.default_rng(seed).permutation(len(place)) if seed % 2 else np.arange(len(place))
    return mf.make_monostatic_sweep(s[:, mixed], frequency=FREQUENCY, antenna_position=place[mixed])


def found_in(sweep, seed=0):
    return backlash_findings(mf.add_noise(sweep, snr_db=20.0, seed=seed))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [0.15, -0.35])
def test_backlash_is_named_with_its_size(seed, share):
    shift = share * PITCH
    for sweep in (two_lines(seed, shift), plane(seed, 0.5 * shift), plane(seed, 0.5 * shift, along=2)):
        found = found_in(sweep, seed)
        assert [finding.name for finding in found] == ["stage-backlash"]
        size = float(found[0].what.split(" mm")[0].split()[-1])
        true = abs(shift if "tx" in sweep.dims else 0.5 * shift) * 1e3
        assert abs(size - true) < 0.15 * true
    assert "stage-backlash" in [finding.name for finding in diagnose(two_lines(seed, shift))[0]]


@pytest.mark.parametrize("seed", range(3))
def test_rows_without_backlash_or_with_a_phase_of_their_own_are_not_accused(seed):
    for sweep in (two_lines(seed, 0.0), plane(seed, 0.0), two_lines(seed, 0.02 * PITCH)):
        assert found_in(sweep, seed) == []
    sweep = two_lines(seed, 0.0)
    switched = sweep["s"].values.copy()
    switched[:, 1::2] *= np.exp(1.2j)
    assert found_in(sweep.assign(s=sweep["s"].copy(data=switched)), seed) == []


def test_backlash_of_a_scan_is_named_in_degrees():
    points, strength = scene(4)
    azimuth, elevation = np.linspace(-40.0, 40.0, 81), np.linspace(-15.0, 15.0, 31)
    heading = np.degrees(np.arctan2(points[:, 0], points[:, 1]))
    distance = np.linalg.norm(points, axis=1)
    height = np.degrees(np.arcsin(points[:, 2] / distance))

    def scan(shift):
        at = azimuth[:, None] + shift * (np.arange(elevation.size) % 2)
        aside = ((at[..., None] - heading) ** 2 + (elevation[:, None] - height) ** 2) / 2.0**2
        s = np.einsum("aep,fp->fae", np.exp(-aside), strength * np.exp(-2j * np.outer(K, distance)))
        return mf.make_raster_sweep(s, frequency=FREQUENCY, azimuth=azimuth, elevation=elevation)

    assert found_in(scan(0.0)) == []
    found = found_in(scan(0.4))
    assert [finding.name for finding in found] == ["stage-backlash"]
    assert "0.4 degrees" in found[0].what
