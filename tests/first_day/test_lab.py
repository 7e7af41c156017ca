"""The first day of a lab: a network analyser on two stages, from its files to a correct picture, word by word."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from instruments import Instrument
from pages import play, steps
from scipy.constants import speed_of_light

import mirrorfold as mf

HEIGHT = 0.015
"""Of the receivers above the transmitters [m]."""

WAITING = 120.0
"""Seconds that the lab may wait for its picture, all commands together."""

SPHERE, RADIUS = (0.03, 0.9), 0.02


def above(sweep, height):
    """A sweep of a floor plan with its receivers above the transmitters; walls are upright, so that a path of length L
    becomes ``sqrt(L^2 + h^2)``."""
    frequency = sweep["frequency"].values
    count = frequency.size
    length = np.arange(count) * speed_of_light / (frequency[1] - frequency[0]) / count
    longer = np.where(length > 0.1, np.hypot(length, height) - length, 0.0)
    turn = np.exp(-2j * np.pi * frequency.mean() / speed_of_light * longer)
    return np.fft.fft(np.fft.ifft(sweep["s"].values, axis=0) * turn[:, None, None], axis=0)


def write_scan(sweep, folder):
    """A folder as an analyser leaves it, and the table of the stages in millimetres beside it."""
    mf.save_touchstone(sweep, folder)
    (folder / "positions.csv").unlink()
    tx, rx = (1e3 * sweep[name].values for name in ("tx_position", "rx_position"))
    lines = ["file,tx_x_mm,rx_x_mm,rx_z_mm"]
    for i, k in np.ndindex(len(tx), len(rx)):
        (folder / f"tx{i:02d}_rx{k:02d}.s2p").rename(folder / f"run_{i:03d}_{k:03d}.s2p")
        lines.append(f"run_{i:03d}_{k:03d}.s2p,{tx[i, 0]:.6g},{rx[k, 0]:.6g},{rx[k, 2]:.6g}")
    Path("positions.csv").write_text("\n".join(lines) + "\n", encoding="ascii")


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """What the lab has measured: scan, empty, sphere; and the truth."""
    monkeypatch.chdir(tmp_path)
    truth = mf.load_scene(Path(__file__).with_name("lab.toml"))
    ideal = mf.simulate(truth, seed=0)
    tx, frequency = ideal["tx_position"].values, ideal["frequency"].values
    scene = above(ideal, HEIGHT)
    level = float(np.sqrt(np.mean(np.abs(scene) ** 2)))
    rx = tx + np.array([0.0, 0.0, HEIGHT])
    # At their nearest the antennas hear each other 26 dB louder than the scene; the phase drifts by 0.1 in a scan.
    instrument = Instrument.random(
        tx, rx, frequency, 4, cable=6.37, coupling=20.0 * level * HEIGHT, drift=0.1, largest_delay=1.5e-3
    )
    noise = 0.1 * level
    sphere = 0.3 * level * instrument.sphere(SPHERE, RADIUS)
    for seed, (name, ideal) in enumerate({"scan": scene, "empty": 0.0 * scene, "sphere": sphere}.items()):
        write_scan(instrument.measure(ideal, seed, noise=noise), tmp_path / name)
    return truth, instrument


def follow(asked, capsys):
    """Do what the guide asks for; returns how long each command took [s]."""
    waited = {}
    for step in asked:
        verb = step.text.split()[1]
        if verb == "view":
            assert Path(step.text.split()[2]).is_file()
            continue
        start = time.perf_counter()
        play(step, capsys, {})
        waited[step.text] = time.perf_counter() - start
    return waited


@pytest.mark.replay
@pytest.mark.slow
@pytest.mark.timing
def test_a_lab_need_not_wait_long(measured, capsys):
    waited = follow(steps("docs/howto/vna.md"), capsys)
    assert sum(waited.values()) < WAITING, waited


@pytest.mark.replay
@pytest.mark.slow
def test_the_guide_for_a_network_analyser_ends_in_a_correct_picture(measured, capsys):
    truth, instrument = measured
    asked = steps("docs/howto/vna.md")
    assert sum(step.text.split()[1] not in ("plan", "view") for step in asked) <= 6
    follow(asked, capsys)
    reconstruction = mf.load("out/reconstruction.nc")
    score = mf.score(reconstruction, truth)
    cell = 0.1  # of 6 cm at the wall and 10 cm at the ghost
    found = {mirror["surface"]: mirror for mirror in score["mirrors"]}
    assert found["wall"]["offset_error_mm"] < 10
    assert score["hidden"]["accuracy_m"] < 0.2 * cell
    assert score["hidden"]["completeness_5cm"] > 0.9
    assert Path("out/before_after.png").stat().st_size > 10_000
    clean = mf.load("clean.nc")
    period = instrument.period
    step = next(step for step in clean.attrs["processing"] if "cable" in step)
    said = float(step.split(", and ")[1].split(" m of cable")[0])
    truth_delay = instrument.cable + instrument.tx_delay.mean() + instrument.rx_delay.mean()
    assert abs((said - truth_delay + 0.5 * period) % period - 0.5 * period) < 1e-3
