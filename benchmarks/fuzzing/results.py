"""A target of fuzzing: sweeps, images and reconstructions in our own formats, in the verbs that take them."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import xarray as xr

from fuzzing.damage import damaged_bytes, damaged_hdf5
from fuzzing.targets import Case, Generator, Target, run

SCENE = Path(__file__).resolve().parents[2] / "tests/one_wall.toml"

WALL = [[-0.15, 1.02, -0.1], [0.2, 1.18, -0.1], [0.2, 1.18, 0.1], [-0.15, 1.02, 0.1]]
"""Corners of a mirror in the volume [m]."""

VERBS = {
    "sweep": [
        ("info", "{}"),
        ("focus", "{}", "-o", "out.nc"),
        ("calibrate", "{}", "-o", "out.nc", "--conjugate"),
    ],
    "image": [
        ("info", "{}"),
        ("fold", "{}", "-o", "out.nc"),
        ("fold", "{}", "-o", "out.nc", "--mirrors", "lines.json"),
    ],
    "reconstruction": [
        ("info", "{}"),
        ("report", "{}", "-o", "out.html"),
        ("score", "{}", "scene.toml"),
        ("fold", "{}", "-o", "out.nc"),
        ("export", "{}", "-o", "out.geojson"),
        ("export", "{}", "-o", "out.vtp"),
        ("compare", "{}", "valid-reconstruction.nc"),
    ],
}
"""The command lines that are run with a file, by the kind of the file."""

PICTURE = ("show", "{}", "-o", "out.png")
"""A command line that takes ten times as long as any other, and is run less often accordingly."""


class Results(Target):
    """Files of our own: loaded, and in most of the verbs that take them."""

    ways = 100

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.files = _made(folder)
        (folder / "lines.json").write_text('{"mirrors": [{"start": [-0.2, 0.3], "end": [0.2, 0.34]}]}')

    def valid(self) -> list[Case]:
        # Files of volumes are only loaded, described and drawn: mirrors, scene and reconstruction in the other command
        # lines are of plan views.
        ways = {name: 2 if "volume" in name else len(self._verbs(name)) + 1 for name in self.files}
        every = [Case(name, raw, way) for name, raw in self.files.items() for way in range(ways[name])]
        return every + [Case(name, raw, self.ways - 1) for name, raw in self.files.items()]

    def case(self, number: int, rng: Generator) -> Case:
        name = list(self.files)[number % len(self.files)]
        if rng.random() < 0.15:
            raw = damaged_bytes(self.files[name], list(self.files.values()), rng)
        else:
            raw = damaged_hdf5(self.files[name], rng)
        return Case(name, raw, int(rng.integers(0, self.ways)))

    def read(self, path: Path, way: int) -> None:
        import mirrorfold as mf

        verbs = self._verbs(path.name)
        words = PICTURE if way == self.ways - 1 else ("", *verbs)[way % (len(verbs) + 1)]
        if not words:
            mf.load(path)
            return
        inner = {"out.nc", "out.html", "out.geojson", "out.vtp", "out.png", "lines.json", "scene.toml"}
        inner |= {"valid-reconstruction.nc"}
        place = [self.folder / word if word in inner else word.format(path) for word in words]
        run(*place)

    @staticmethod
    def _verbs(name: str) -> list[tuple[str, ...]]:
        return VERBS[name.partition("-")[0].removesuffix(".nc")]


def _made(folder: Path) -> dict[str, bytes]:
    """A small valid file of each kind; the truth beside them."""
    import mirrorfold as mf

    shutil.copy(SCENE, folder / "scene.toml")
    sweep = mf.simulate(mf.load_scene(SCENE))
    x, y = np.linspace(-0.3, 0.3, 31), np.linspace(0.15, 0.58, 31)
    image = mf.focus(sweep, x=x, y=y)
    things = {
        "sweep.nc": sweep,
        "image.nc": image,
        "reconstruction.nc": mf.fold(image, mirrors=[[[-0.2, 0.3], [0.2, 0.34]]]),
        "reconstruction-curved.nc": mf.fold(image, mirrors=[[[-0.2, 0.3], [0.0, 0.31], [0.2, 0.34]]]),
    }
    volume = _volume()
    things |= {"image-volume.nc": volume, "reconstruction-volume.nc": mf.fold(volume, mirrors=[WALL])}
    made = {}
    for name, thing in things.items():
        mf.save(thing, folder / name)
        made[name] = (folder / name).read_bytes()
    shutil.copy(folder / "reconstruction.nc", folder / "valid-reconstruction.nc")
    return made


def _volume() -> xr.DataArray:
    """An oblique wall as a raster scan sees it."""
    azimuth, elevation = np.linspace(-10, 10, 11), np.linspace(-6, 6, 7)
    distance = np.arange(0.8, 1.6, 0.02)
    wall = 1.1 + 0.01 * azimuth
    values = np.exp(-(((distance[:, None, None] - wall[:, None]) / 0.01) ** 2)) + 0 * elevation
    coords = {"range": distance, "azimuth": azimuth, "elevation": elevation}
    attrs = {"spot_radius": 0.02, "focus_distance": 1.2, "frequency_start": 270e9, "frequency_stop": 300e9}
    return xr.DataArray(
        values.astype(np.complex64), dims=("range", "azimuth", "elevation"), coords=coords, attrs=attrs, name="image"
    )
