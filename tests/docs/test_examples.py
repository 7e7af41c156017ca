"""The examples of the gallery run, draw, and find what their texts say."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.animation import Animation
from matplotlib.figure import Figure

FOLDER = Path(__file__).resolve().parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("plot_*.py"))


def run(name, directory, monkeypatch):
    """The variables that an example leaves, run in an empty directory; its figures are drawn and closed."""
    mpl.use("Agg")
    monkeypatch.chdir(directory)
    plt.close("all")
    left = runpy.run_path(str(FOLDER / f"{name}.py"))
    figures = [*map(plt.figure, plt.get_fignums()), *(value for value in left.values() if isinstance(value, Figure))]
    for animation in (value for value in left.values() if isinstance(value, Animation)):
        animation._draw_was_started = True  # it is the gallery that saves it
    for figure in figures:
        figure.canvas.draw()
    plt.close("all")
    assert figures
    return left


def test_there_are_enough_and_each_is_an_essay():
    assert len(EXAMPLES) >= 10
    for path in EXAMPLES:
        text = path.read_text(encoding="utf-8")
        title, line, *_ = ast.get_docstring(ast.parse(text)).splitlines()
        assert set(line) == {"="}
        assert len(line) >= len(title)
        assert text.count("# %%") >= 2


def hidden_corner(left, printed):
    assert left["score"]["hidden"]["f_score_2cm"] > 0.9
    assert max(m["angle_error_deg"] for m in left["score"]["mirrors"] if m["generation"] == 1) < 0.1


def three_bounces(left, printed):
    objects = left["reconstruction"]["objects"].to_dataset()
    assert int(objects["bounces"].max()) == 3
    # What came by way of all three panels is the corner, within some centimetres.
    deep = objects["bounces"].values == 3
    middle = np.array([objects["x"].values[deep].mean(), objects["y"].values[deep].mean()])
    assert np.linalg.norm(middle - np.mean(left["corner"], axis=0)) < 0.15


def waves(left, printed):
    field, x, y = left["field"], left["x"], left["y"]
    before = np.abs(field.sel(x=0.3, y=0.6, method="nearest").item())
    behind = np.abs(field.sel(x=slice(0.25, 0.45), y=slice(1.16, 1.26)).values)
    assert np.median(behind) < 0.5 * before
    assert field.shape == (y.size, x.size)


def measured(left, printed):
    assert left["image"].attrs["error"] < 1e-3
    assert np.abs(left["image"].values).max() > 30 * np.median(np.abs(left["image"].values))


def mannequin(left, printed):
    assert left["body"]["accuracy_m"] < 0.01
    assert left["score"]["patches"]["foil"]["contrast_db"] > 6


def corridor(left, printed):
    assert printed.count("generation 2") >= 1


def design(left, printed):
    assert left["plan"]["bounces_above_noise"] >= left["plan"]["bounces_unambiguous"]


def calibrate(left, printed):
    assert left["worst"] < 20e-6


def foreign_image(left, printed):
    assert "the same image: True" in printed
    assert left["reconstruction"]["mirrors"].sizes["mirror"] >= 2


def published(left, printed):
    assert left["scores"]["default"]["precision_2cm"] > left["scores"]["published"]["precision_2cm"]


def fast_focus(left, printed):
    assert np.median(left["error"]) < 1e-3
    assert left["image"].attrs["error"] < 1e-4


def mistakes(left, printed):
    for option in ("--conjugate", "--reverse-frequency", "--cable-length"):
        assert option in printed
    assert left["nothing"]["mirrors"].sizes["mirror"] == 0


def touchstone(left, printed):
    assert "bit by bit the same: True" in printed


FINDINGS = {
    "plot_01_first_fold": hidden_corner,
    "plot_02_three_bounces": three_bounces,
    "plot_03_waves": waves,
    "plot_04_measured": measured,
    "plot_05_mannequin": mannequin,
    "plot_06_corridor": corridor,
    "plot_07_design": design,
    "plot_08_calibrate": calibrate,
    "plot_09_foreign_image": foreign_image,
    "plot_10_published": published,
    "plot_11_fast_focus": fast_focus,
    "plot_12_mistakes": mistakes,
    "plot_13_touchstone": touchstone,
}


def test_every_example_is_looked_at():
    assert set(FINDINGS) == {path.stem for path in EXAMPLES}


@pytest.mark.replay
@pytest.mark.slow
@pytest.mark.usefixtures("remembered_rays")
@pytest.mark.parametrize("name", FINDINGS)
def test_example(name, tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("MIRRORFOLD_DATA", raising=False)
    left = run(name, tmp_path, monkeypatch)
    FINDINGS[name](left, capsys.readouterr().out)


@pytest.mark.replay
@pytest.mark.slow
def test_the_measured_example_on_measured_data(shared_data, tmp_path, monkeypatch, capsys):
    """The brightest point of the parking lot is where the data's description says."""
    monkeypatch.setenv("MIRRORFOLD_DATA", str(shared_data.resolve()))
    left = run("plot_04_measured", tmp_path, monkeypatch)
    assert "measured" in capsys.readouterr().out
    image = left["image"].squeeze()
    row, column = np.unravel_index(np.abs(image.values).argmax(), image.shape)
    assert float(image["x"][column]) == pytest.approx(-15.5, abs=1.0)
    assert float(image["y"][row]) == pytest.approx(21.5, abs=1.0)
