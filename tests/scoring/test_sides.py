"""Which echoes behind a half-transparent wall are judged, and on which side the truth is."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.scoring.transparent import side_shares

SCENE = """
name = "a door, a disc behind it, and a mirror before it"
dimensions = 2
[array]
kind = "linear"
elements = 11
pitch = 1e-3
[band]
start = 116e9
stop = 128e9
points = 11
[[surface]]
name = "door"
kind = "segment"
start = [-0.5, 1.0]
end = [0.5, 1.0]
material = "glass"
thickness = "6 mm"
[[surface]]
name = "disc"
kind = "circle"
center = [0.0, 1.5]
radius = 0.05
material = "pec"
"""


@pytest.mark.parametrize(("chain", "place", "judged"), [
    ("0/1", (0.2, 1.0), False),  # the door, seen in itself and in the mirror
    ("0/1", (0.2, 0.7), True),
    ("0", (0.2, 1.0), True),
    ("", (0.0, 1.45), True),
])  # fmt: skip
def test_what_two_mirrors_show_of_a_wall_says_nothing_of_its_side(tmp_path, chain, place, judged):
    """Though the image shows it near the disc."""
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = mf.load_scene(tmp_path / "scene.toml")
    columns = {"x": place[0], "y": place[1], "x_initial": 0.0, "y_initial": 1.42, "passed": 0.2 if chain else 0.8}
    table = {name: ("point", np.array([value])) for name, value in columns.items()}
    points = xr.Dataset(table | {"chain": ("point", [chain]), "surface": ("point", ["object"])})
    found = side_shares(points, scene)
    assert bool(found) == judged
    if judged:
        assert found["sides_doubtful"] == 1.0
