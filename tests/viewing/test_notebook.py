"""What a notebook shows: a small picture and the facts, whatever the names; xarray's own for the rest."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import xarray as xr
from scans import ball, panel, scene
from synthetic import build_tree, diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.common.svg import Stroke, picture
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.views.image_to_view import to_image_view
from mirrorfold.viewing.notebook import to_html

HOSTILE = "</td><script>alert(1)</script>\"'"


def drawing(html):
    """The first SVG of some HTML, as XML."""
    return ET.fromstring(html[html.index("<svg") : html.index("</svg>") + 6])


def paths(html):
    return drawing(html).findall("{*}path")


def test_a_scene_shows_its_surfaces_to_scale(scene_file):
    html = mf.load(scene_file)._repr_html_()
    assert "one wall" in html
    assert "290 to 300 GHz" in html
    wall = paths(html)[0]
    assert wall.find("{*}title").text == "wall"
    (x0, y0), *_, (x1, y1) = (map(float, pair.split(",")) for pair in wall.get("d")[1:].split("L"))
    assert (y0 - y1) / (x1 - x0) == pytest.approx(0.1, abs=0.01)


def test_names_are_text(scene_file):
    text = scene_file.read_text().replace('"one wall"', json.dumps(HOSTILE)).replace('"wall"', json.dumps(HOSTILE))
    scene_file.write_text(text)
    html = mf.load(scene_file)._repr_html_()
    assert "<script" not in html
    assert drawing(html).get("aria-label").endswith(HOSTILE)


def test_a_scene_in_space_shows_its_floor_plan():
    html = scene(panel(), ball())._repr_html_()
    assert [path.find("{*}title").text for path in paths(html)[:2]] == ["wall", "ball"]
    assert "41 x 41" in html


def test_the_tree_shows_mirrors_and_objects():
    wall = np.array([[0.5, 1.8], [0.9, 0.9]])
    parts = together(diffuse(*wall, seed=1), (np.array([[0.95, 1.9]]), np.array([30.0])))
    view = to_image_view(radar_image(*parts, np.linspace(-1.0, 2.2, 321), np.linspace(0.3, 2.6, 231)))
    tree, _ = build_tree(find_ridges(view), view)
    html = tree._repr_html_()
    assert "mirror 0" in html
    labels = [path.find("{*}title") for path in paths(html)]
    assert {"radar", "mirror 0", "seen through mirror 0"} <= {label.text for label in labels if label is not None}
    # The radar stands where ranges count from, below everything.
    (radar,) = (path for path in paths(html) if path.get("fill") == "currentColor")
    heights = [float(path.get("d").split(",")[1].split("L")[0].split("h")[0]) for path in paths(html)[1:2]]
    assert float(radar.get("d").split(",")[1].split("h")[0]) > max(heights)


def test_an_empty_tree_and_an_empty_picture_can_be_shown():
    view = to_image_view(
        radar_image(np.array([[0.0, 1.0]]), np.array([1e-9]), np.linspace(-1, 1, 81), np.linspace(0.5, 2, 61))
    )
    tree, _ = build_tree(find_ridges(view).take(np.zeros(0, dtype=int)), view)
    assert "radar" in tree._repr_html_()
    assert ET.fromstring(picture([Stroke(np.empty((0, 2)), "red", dots=True)], (0, 0), title="nothing")) is not None


def test_a_reconstruction_shows_a_picture_and_facts(reconstruction):
    reconstruction.attrs["title"] = HOSTILE
    html = to_html(reconstruction)
    assert "<script" not in html
    assert "data:image/png;base64," in html
    assert 'alt="' in html
    assert "0.73 m, seen through radar" in html
    assert "seen around a corner" in html


def test_other_trees_are_shown_as_xarray_shows_them(reconstruction):
    other = xr.DataTree(xr.Dataset({"a": 1}))
    assert "xr-" in to_html(other)
    broken = xr.DataTree(xr.Dataset(attrs={"mirrorfold_kind": "reconstruction"}))
    assert "data:image/png" not in to_html(broken)
    assert "data:image/png" not in to_html(reconstruction["objects"])
    assert "x_initial" in to_html(reconstruction["objects"])


@pytest.mark.slow
def test_ipython_is_told(reconstruction):
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    shell = interactive.InteractiveShell()
    mf.load_ipython_extension(shell)
    formatter = shell.display_formatter.formatters["text/html"]
    assert "data:image/png" in formatter(reconstruction)
    assert "data:image/png" not in formatter(xr.DataTree(xr.Dataset({"a": 1})))
