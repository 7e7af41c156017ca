"""What several tests need: data from outside, a small scene, and one valid object of each kind."""

from __future__ import annotations

import os
import shutil
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np
import profiles  # noqa: F401
import pytest
import xarray as xr
from browser import chromium  # noqa: F401
from remembered import folder, of_this_run, remembered_rays  # noqa: F401
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.sweep import make_sweep

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as of what a shell runs in the background
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.default_int_handler)

collect_ignore_glob = ["*/conftest.py"]
"""They hold no doctests; looked at for some, those of several folders would be in each other's way by their name."""

ONE_WALL = Path(__file__).with_name("one_wall.toml")
SHARED_DATA = Path(__file__).resolve().parents[1] / "../shared/data"


def pytest_configure(config: pytest.Config) -> None:
    """Where kernels run as plain Python, they divide by zero as compiled ones do."""
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        for message in ("divide by zero", "overflow encountered", "invalid value encountered in scalar subtract"):
            config.addinivalue_line("filterwarnings", f"ignore:{message}:RuntimeWarning")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of data sets that tests may read but the project does not hold."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the data folder {SHARED_DATA} is absent; see its README for what belongs there")
    return SHARED_DATA


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """A small scene that simulates and reconstructs in a second or two."""
    return Path(shutil.copy(ONE_WALL, tmp_path / "scene.toml"))


@pytest.fixture
def sweep() -> xr.Dataset:
    """The exact sweep of a point target at (0.05, 0.4) m, 9 x 9 elements, 41 frequencies."""
    position = np.zeros((9, 3))
    position[:, 0] = 0.5e-3 * (np.arange(9) - 4)
    frequency = np.linspace(290e9, 300e9, 41)
    distance = np.linalg.norm(position - [0.05, 0.4, 0.0], axis=1)
    k = 2 * np.pi * frequency / speed_of_light
    s = np.exp(-1j * k[:, None, None] * (distance[:, None] + distance))
    return make_sweep(s, frequency=frequency, tx_position=position, rx_position=position, title="point target")


@pytest.fixture
def image() -> xr.DataArray:
    """A complex plan view of 40 x 50 pixels, brightest at (0.1, 1.2) m."""
    y, x = np.linspace(0.8, 1.58, 40), np.linspace(-0.4, 0.58, 50)
    phase = np.exp(1j * np.arange(50))
    values = 1.0 / (0.01 + (x - 0.1) ** 2 + (y[:, None] - 1.2) ** 2) * phase
    return xr.DataArray(values.astype(np.complex64), dims=("y", "x"), coords={"y": y, "x": x}, name="image")


@pytest.fixture
def reconstruction() -> xr.DataTree:
    """A wall with an object before it and, by way of the wall, another one."""
    start, end = np.array([0.4, 1.6]), np.array([0.6, 0.9])
    points = np.array([[-0.1, 0.9], [-0.12, 0.95], [0.1, 1.5], [0.12, 1.52], [0.14, 1.54]])
    bounces = np.array([0, 0, 1, 1, 1], dtype=np.int32)
    ghosts = reflect(points, start, segment_normal(start, end))
    initial = np.where(bounces[:, None] > 0, ghosts, points)
    y, x = np.linspace(0.5, 2.0, 76), np.linspace(-0.5, 1.5, 101)
    rng = np.random.default_rng(0)
    amplitude = rng.random((2, 76, 101)).astype(np.float32)
    ends = dict(zip(("x0", "y0", "x1", "y1"), (*start, *end), strict=True))
    objects = {
        "x": points[:, 0],
        "y": points[:, 1],
        "x_initial": initial[:, 0],
        "y_initial": initial[:, 1],
        "amplitude": np.ones(5, dtype=np.float32),
        "bounces": bounces,
        "chain": np.array(["", "", "0", "0", "0"]),
        "confidence": np.full(5, 0.9, dtype=np.float32),
    }
    mirrors = {
        **ends,
        **{f"folded_{name}": value for name, value in ends.items()},
        "parent": -1,
        "generation": 1,
        "strength": 2.0,
    }
    grid = {"y": y, "x": x}
    return xr.DataTree.from_dict(
        {
            "/": xr.Dataset(
                {"intensity": (("y", "x"), amplitude[0])},
                coords=grid,
                attrs={"mirrorfold_kind": "reconstruction", "radar_x": 0.0, "radar_y": 0.0},
            ),
            "/initial": xr.Dataset({"initial": (("y", "x"), amplitude[1])}, coords=grid),
            "/objects": xr.Dataset({name: ("point", value) for name, value in objects.items()}).set_coords(["x", "y"]),
            "/mirrors": xr.Dataset({name: ("mirror", np.array([value])) for name, value in mirrors.items()}),
        }
    )


@pytest.fixture
def on_a_map(reconstruction) -> xr.DataTree:
    """The same in the coordinates of a map, thousands of kilometres from their origin."""
    shift = {"x": 500_123.4, "y": 5_400_321.0}
    nodes = {}
    for node in reconstruction.subtree:
        table = node.to_dataset(inherit=False)
        axis = {str(name): str(name).removeprefix("folded_")[0] for name in table.variables}
        places = {name: letter for name, letter in axis.items() if letter in shift}
        moved = table.assign({name: table[name] + shift[letter] for name, letter in places.items()})
        nodes[node.path] = moved.set_coords(list(table.coords))
    nodes["/"].attrs |= {f"radar_{letter}": value for letter, value in shift.items()}
    return xr.DataTree.from_dict(nodes)


@pytest.fixture
def folded_scan() -> xr.DataTree:
    """A wall, a box before it seen by way of the wall, and a plan view: a folded scan, by hand."""
    random = np.random.default_rng(3)
    box = random.uniform([-0.9, 1.8, -0.5], [-0.6, 2.2, 0.5], (400, 3))
    wall = np.column_stack([np.full(200, 0.4), random.uniform(1.5, 2.5, 200), random.uniform(-0.6, 0.6, 200)])
    ghost = box * [-1, 1, 1] + [0.8, 0, 0]
    points, initial = np.concatenate([box, wall]), np.concatenate([ghost, wall])
    x, y = np.linspace(-1.2, 2.0, 161), np.linspace(0.2, 2.8, 131)
    image = random.random((131, 161)).astype(np.float32)
    objects = {
        **{letter: ("point", points[:, i]) for i, letter in enumerate("xyz")},
        **{f"{letter}_initial": ("point", initial[:, i]) for i, letter in enumerate("xyz")},
        "amplitude": ("point", random.random(600).astype(np.float32)),
        "bounces": ("point", np.repeat([1, 0], [400, 200]).astype(np.int32)),
        "chain": ("point", np.repeat(["0", ""], [400, 200])),
        "surface": ("point", np.repeat(["object", "mirror"], [400, 200])),
        "confidence": ("point", np.full(600, 0.8, dtype=np.float32)),
    }
    corners = np.array([[0.4, 1.5, -0.6], [0.4, 2.5, -0.6], [0.4, 2.5, 0.6], [0.4, 1.5, 0.6]])
    mirrors = {"parent": ("mirror", [-1]), "generation": ("mirror", [1]), "strength": ("mirror", [1.0])}
    for prefix in ("", "folded_"):
        for i, letter in enumerate("xyz"):
            mirrors[f"{prefix}{letter}0"], mirrors[f"{prefix}{letter}1"] = (("mirror", [c[i]]) for c in corners[:2])
            mirrors[f"{prefix}corner_{letter}"] = (("mirror", "corner"), corners[None, :, i])
    attrs = {"mirrorfold_kind": "reconstruction", "radar_x": 0.0, "radar_y": 0.0, "radar_z": 0.0, "title": "a scan"}
    coords = {"y": y, "x": x}
    return xr.DataTree.from_dict(
        {
            "/": xr.Dataset({"intensity": (("y", "x"), image)}, coords=coords, attrs=attrs),
            "/initial": xr.Dataset({"initial": (("y", "x"), image[:, ::-1])}, coords=coords),
            "/objects": xr.Dataset(objects).set_coords(["x", "y", "z"]),
            "/mirrors": xr.Dataset(mirrors),
        }
    )
