"""Pictures of sweeps, trees and scores: that what is drawn is what the data say; and the verb that writes figures."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib import style
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from PIL import Image
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.reporting.document import to_document
from mirrorfold.sweep import make_raster_sweep


@pytest.fixture
def ax():
    return Figure().subplots()


@pytest.fixture
def scan():
    """Three by two beams, one of them dead, on a target at 1.5 m."""
    frequency = np.linspace(270e9, 300e9, 301)
    s = np.exp(-4j * np.pi * frequency / speed_of_light * 1.5)[:, None, None] * np.ones((1, 3, 2))
    s[:, 1, 0] *= 1e-3
    return make_raster_sweep(s, frequency=frequency, azimuth=[-1.0, 0.0, 1.0], elevation=[0.0, 0.5])


def test_the_range_profile_peaks_where_the_target_is(sweep, ax):
    mf.plot.range_profile(sweep, ax)
    range_, level = ax.lines[0].get_xydata().T
    assert range_[level.argmax()] == pytest.approx(np.hypot(0.05, 0.4), abs=0.01)
    assert level.max() == pytest.approx(0.0, abs=1e-6)
    assert "[m]" in ax.get_xlabel()
    assert "[dB]" in ax.get_ylabel()


def test_a_dead_channel_shows_as_a_dark_line(sweep, scan, ax):
    sweep["s"].values[:, 3, :] *= 0.01
    level = np.asarray(mf.plot.channel_map(sweep, ax).images[0].get_array())
    assert level.shape == (9, 9)
    assert_allclose(level[:, 3], -40.0, atol=0.1)
    assert_allclose(np.delete(level, 3, axis=1), 0.0, atol=0.1)
    beams = mf.plot.channel_map(scan)
    assert_allclose(np.asarray(beams.images[0].get_array()), [[0.0, -60.0, 0.0], [0.0, 0.0, 0.0]], atol=0.1)
    assert_allclose(beams.images[0].get_extent(), [-1.5, 1.5, -0.25, 0.75])
    assert "azimuth" in beams.get_xlabel()


@pytest.mark.slow
def test_one_figure_of_a_sweep_has_both(sweep, scan, tmp_path):
    for measured in (sweep, scan):
        figure = mf.plot.sweep(measured)
        assert len(figure.axes) == 3
        figure.savefig(tmp_path / "sweep.svg")
    with pytest.raises(mf.InputError, match="single frequency"):
        mf.plot.range_profile(sweep.isel(frequency=[0]))


def test_the_tree_names_every_mirror_and_counts_its_points(reconstruction, ax):
    with style.context("dark_background"):
        mf.plot.tree(reconstruction, ax)
    mirror, root = sorted(text.get_text() for text in ax.texts)
    assert root == "radar\npoints: 2 of objects,\n0 of walls"
    assert mirror == f"mirror 0, {np.hypot(0.2, 0.7):.2f} m\npoints: 3 of objects,\n0 of walls"
    assert len(ax.lines) == 1
    assert {text.get_color() for text in ax.texts} == {"black"}  # in white boxes


def test_the_tree_says_of_an_arc_and_of_walls_what_the_report_says(reconstruction, ax):
    quarter = 0.5 * np.pi * 0.4
    ends = {"x0": 0.4, "y0": 1.0, "x1": 0.0, "y1": 1.4, "xm": 0.4 * np.sqrt(0.5), "ym": 1.0 + 0.4 * np.sqrt(0.5)}
    mirrors = reconstruction["mirrors"].to_dataset(inherit=False)
    both = {f"{prefix}{name}": ("mirror", [value]) for name, value in ends.items() for prefix in ("", "folded_")}
    reconstruction["mirrors"] = mirrors.assign(both | {"curvature": ("mirror", [2.5])})
    objects = reconstruction["objects"].to_dataset(inherit=False)
    reconstruction["objects"] = objects.assign(surface=("point", ["object", "mirror", "object", "object", "mirror"]))
    mf.plot.tree(reconstruction, ax)
    document = to_document(reconstruction)
    assert document["mirrors"][0]["length"] == pytest.approx(quarter, rel=1e-3)
    assert document["seen"] == {"": [1, 1], "0": [2, 1]}
    assert sorted(text.get_text() for text in ax.texts) == [
        f"mirror 0, {quarter:.2f} m\npoints: 2 of objects,\n1 of walls",
        "radar\npoints: 1 of objects,\n1 of walls",
    ]


def test_the_score_is_drawn_as_it_is(ax):
    held = {"precision_2cm": 0.9, "completeness_2cm": 0.8, "f_score_2cm": 0.85, "f_score_5cm": 0.95}
    mf.plot.score({**held, "hidden": {**held, "precision_2cm": None}}, ax)
    heights = [patch.get_height() for patch in ax.patches]
    assert heights == [0.9, 0.8, 0.85, 0.95, 0.0, 0.8, 0.85, 0.95]
    assert "\u2013" in [text.get_text() for text in ax.texts]
    labels = [label.get_text().split("\n") for label in ax.get_xticklabels()]
    assert labels == [[what, "at 2 cm"] for what in ("precision", "completeness", "F-score")] + [["F-score", "at 5 cm"]]
    with pytest.raises(mf.InputError, match="got a str"):
        mf.plot.score("0.9")


def test_before_and_after_go_into_axes_that_are_given(reconstruction, scene_file):
    figure = Figure()
    axes = figure.subplots(1, 2)
    assert mf.plot.before_after(reconstruction, mf.load(scene_file), axes=axes) is figure
    assert len(figure.axes) == 2
    assert all(panel.images for panel in axes)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_every_kind_of_file_makes_a_figure(
    suffix, sweep, image, reconstruction, scene_file, scan, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    things = {"sweep": sweep, "image": image, "reconstruction": reconstruction, "scan": scan}
    for name, thing in things.items():
        mf.save(thing, f"{name}.nc")
    head = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[suffix]
    for file in (*(f"{name}.nc" for name in things), str(scene_file)):
        assert main(["show", file, "-o", f"out.{suffix}", "--dpi", "60"]) == 0
        assert (tmp_path / f"out.{suffix}").read_bytes().startswith(head)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["before-after", "initial", "corrected", "mirrors", "tree", "score"])
def test_each_part_of_a_reconstruction_can_be_drawn(what, reconstruction, scene_file, tmp_path, capsys):
    mf.save(reconstruction, tmp_path / "r.nc")
    arguments = ["show", str(tmp_path / "r.nc"), "-o", str(tmp_path / "x.png"), "--what", what, "--json"]
    assert main([*arguments, "--scene", str(scene_file), "--dpi", "50"]) == 0
    assert json.loads(capsys.readouterr().out)["what"] == what
    assert len(np.unique(np.asarray(Image.open(tmp_path / "x.png")))) > 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["r.nc", "-o", "x.gif"], "suffix '.gif'"),
        (["r.nc", "-o", "x.png", "--what", "score"], "needs --scene"),
        (["r.nc", "-o", "x.png", "--what", "space"], "floor plan, it has no heights; draw it with --what before-after"),
        (["r.nc", "-o", "x.png", "--what", "frames"], "has no frames; draw it with --what before-after"),
        (["r.nc", "-o", "x.png", "--dpi", "1"], "--dpi is 1"),
        (["r.nc", "-o", "x.png", "--floor-db", "3"], "negative"),
        (["s.nc", "-o", "x.png", "--what", "tree"], "no reconstruction"),
    ],
)
def test_what_cannot_be_drawn_is_refused(arguments, words, reconstruction, sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    mf.save(sweep, "s.nc")
    assert main(["show", *arguments]) == 2
    printed = capsys.readouterr().err
    assert words in printed
    assert printed.count("\n") == 1
    assert not list(tmp_path.glob("*x.*"))
