"""The other guides for a lab: a MIMO array and a raster scanner, every snippet and command in its order."""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from pages import ROOT, play, steps
from scans import panel, scene
from scipy.constants import speed_of_light

import mirrorfold as mf


def test_the_guide_for_a_mimo_array(tmp_path, monkeypatch, capsys):
    """A board that mixes so that the phase rises with range, before three corner reflectors."""
    monkeypatch.chdir(tmp_path)
    slope, rate, samples = 60e12, 10e6, 256
    frequency = 77e9 + slope * np.arange(samples) / rate
    rx_x = 1.9e-3 * (np.arange(16) - 7.5)
    tx_x = 16 * 1.9e-3 * (np.arange(6) - 2.5)
    reflectors = [(0.3, 2.0), (-0.5, 3.1), (0.1, 4.0)]
    cube = np.zeros((samples, 6, 16), dtype=complex)
    for x, y in reflectors:
        path = np.hypot(tx_x - x, y)[:, None] + np.hypot(rx_x - x, y)
        cube += np.exp(2j * np.pi * frequency[:, None, None] / speed_of_light * path)
    cube += 0.05 * np.random.default_rng(0).standard_normal((*cube.shape, 2)).view(complex)[..., 0]
    names = {"slope": slope, "rate": rate, "samples": samples, "tx_x": tx_x, "rx_x": rx_x, "cube": cube}
    names["frames"] = [cube.conj()]
    printed = [play(step, capsys, names) for step in steps("docs/howto/mimo.md")]
    assert "conjugated" in printed[0]
    image, (x, y) = np.abs(names["image"]), (names["x"], names["y"])
    for place in reflectors:
        # The farther an echo, the weaker; around each place the image is brightest there.
        near = np.hypot(x - place[0], y[:, None] - place[1]) < 0.3
        row, column = np.unravel_index(np.where(near, image, 0.0).argmax(), image.shape)
        assert np.hypot(x[column] - place[0], y[row] - place[1]) < 0.06


@pytest.mark.replay
@pytest.mark.slow
def test_the_guide_for_a_raster_scanner(tmp_path, monkeypatch, capsys):
    """A wall where the page says that one is, and a ball that it shows."""
    pytest.importorskip("trimesh", reason="the extra mirrorfold[mesh] has it")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs/howto/scanner.md").read_text(encoding="utf-8")
    Path("mirrors.json").write_text(page.split("```json\n")[1].split("```")[0], encoding="utf-8")
    wall = np.array(json.loads(Path("mirrors.json").read_text())["mirrors"][0]["corners"])
    width, height = np.linalg.norm(wall[1] - wall[0]), np.linalg.norm(wall[3] - wall[0])
    truth = scene(
        panel("wall", wall.mean(axis=0), (-0.4, -1.0, 0.0), width, height),
        {
            "name": "ball",
            "kind": "sphere",
            "center": [-0.62, 1.3, 0.0],
            "radius": 0.12,
            "material": "pec",
            "diffuse_fraction": 1.0,
        },
        half=12.0,
        beams=45,
        focus_distance=2.0,
    )
    sweep = mf.simulate(truth, seed=0)
    names = {"s11": sweep["s"].values}
    names |= {name: sweep[name].values for name in ("frequency", "azimuth", "elevation")}
    mpl = plt.get_backend()
    plt.switch_backend("Agg")
    for step in steps("docs/howto/scanner.md"):
        play(step, capsys, names)
    plt.switch_backend(mpl)
    assert Path("space.png").stat().st_size > 10_000
    assert Path("cloud.ply").read_bytes().startswith(b"ply")
    for reconstruction in (names["reconstruction"], mf.load("out.nc")):
        assert reconstruction["mirrors"].sizes["mirror"] == 1
    score = mf.score(names["reconstruction"], truth)
    assert score["hidden"]["accuracy_m"] < 0.01
    assert score["hidden"]["f_score_2cm"] > 0.9
