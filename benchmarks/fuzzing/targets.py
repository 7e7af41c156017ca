"""The targets of fuzzing: readers of other formats, scene files, and descriptions such as mirrors.

A target makes damaged cases and feeds them to mirrorfold. `feed` returns "read" or "refused"; anything else that may
happen is an escape.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
from importlib.resources import files as package_files
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from fuzzing import files
from fuzzing.damage import damaged_bytes, damaged_hdf5, damaged_text
from mirrorfold.errors import InputError

LONGEST_MESSAGE = 2000
"""Most letters of a message: nobody would read a longer one."""

Generator = np.random.Generator


class Case(NamedTuple):
    """The name of a file, its content, and the number of the way in which the target reads it."""

    name: str
    raw: bytes
    way: int


class EscapeError(Exception):
    """A result that should not have been, although no exception was raised."""


class Target:
    """A part of mirrorfold to which damaged files are fed. Subclasses define the files and how they are read.

    Parameters
    ----------
    folder : path
        Folder in which the target may write.
    """

    ways = 1

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def valid(self) -> list[Case]:
        """Cases without mistakes, which must be read."""
        raise NotImplementedError

    def case(self, number: int, rng: Generator) -> Case:
        """The damaged case of this number."""
        raise NotImplementedError

    def feed(self, case: Case) -> str:
        """Feed a case; returns "read" or "refused"."""
        path = self.folder / case.name
        path.write_bytes(case.raw)
        try:
            self.read(path, case.way)
        except InputError as error:
            if len(str(error)) > LONGEST_MESSAGE:
                raise EscapeError(f"the message has {len(str(error))} letters") from error
            return "refused"
        finally:
            path.unlink(missing_ok=True)
        return "read"

    def read(self, path: Path, way: int) -> None:
        """Read a file in one of the ways."""
        raise NotImplementedError


def run(*words: object) -> None:
    """Run a command line, which may succeed, or refuse its input in a sentence.

    Raises
    ------
    InputError
        If the command refuses its input.
    Exception
        If the command makes a mistake.
    """
    from mirrorfold.cli import main

    said = io.StringIO()
    errors_as_they_are = patch.dict(os.environ, MIRRORFOLD_DEBUG="1")
    with errors_as_they_are, contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = main([str(word) for word in words])
    if code == 2:
        raise InputError(said.getvalue())
    if code:
        raise EscapeError(f"exit code {code}: {said.getvalue()[-500:]}")


class Readers(Target):
    """Data of other tools, scan folders, tables of positions, descriptions and mappings."""

    ways = 6
    own = ("one.s1p", "many.npz")
    """Files that the other files name; they are not damaged."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.files = files.seeds(folder)
        self.names = list(self.files)
        self.keep()

    def keep(self) -> None:
        for name in self.own:
            (self.folder / name).write_bytes(self.files[name])

    def valid(self) -> list[Case]:
        return [Case(self._name(name), raw, 5) for name, raw in self.files.items()]

    def case(self, number: int, rng: Generator) -> Case:
        name = self.names[number % len(self.names)]
        raw = self.files[name]
        text = name.endswith((".toml", ".json", ".csv", ".cti", ".s1p", ".s2p", ".ts")) or name in (
            "cloud.ply",
            "text.pcd",
        )
        if text and rng.random() < 0.5:
            others = [
                self.files[other].decode("latin-1") for other in ("parts.csv", "scan.toml", "mapping.toml", "two.s2p")
            ]
            raw = damaged_text(raw.decode("latin-1"), others, rng).encode("utf-8", "replace")
        elif name.endswith((".h5", "netcdf4.nc")) and rng.random() < 0.5:
            raw = damaged_hdf5(raw, rng)
        else:
            raw = damaged_bytes(raw, list(self.files.values()), rng)
        if rng.random() < 0.05:  # the file gets the suffix of another format
            name = f"other{Path(self.names[int(rng.integers(0, len(self.names)))]).suffix}"
        return Case(self._name(name), raw, int(rng.integers(0, self.ways)))

    @staticmethod
    def _name(name: str) -> str:
        return name if name.startswith(("positions", "scan", "mapping")) else f"case-{name}"

    def read(self, path: Path, way: int) -> None:
        from mirrorfold.io.guessing.guess import guess_mapping
        from mirrorfold.io.images import import_image
        from mirrorfold.io.importing import import_data
        from mirrorfold.io.mapping.model import load_mapping
        from mirrorfold.io.readers import read_contents

        if path.name.startswith(("positions", "scan")):
            import_data(path.parent / "one.s1p", positions=path)
        elif path.name.startswith("mapping"):
            import_data(path.parent / "many.npz", mapping=load_mapping(path))
        elif way == 0:
            guess_mapping(path)
        elif way == 1:
            import_image(path)
        elif way == 2:
            import_data(path)
        else:
            contents = read_contents(path)
            for name in contents.variables:
                contents.array(name)


class Texts(Target):
    """A target whose files are texts."""

    texts: dict[str, str]

    def valid(self) -> list[Case]:
        every = [Case(name, text.encode(), way) for name, text in self.texts.items() for way in range(self.ways)]
        return [case for case in every if case[::2] != ("curve.toml", 2)]

    def case(self, number: int, rng: Generator) -> Case:
        name = list(self.texts)[number % len(self.texts)]
        others = list(self.texts.values())
        way = int(rng.integers(0, 100))
        if rng.random() < 0.1:
            raw = damaged_bytes(self.texts[name].encode(), [other.encode() for other in others], rng)
        else:
            raw = damaged_text(self.texts[name], others, rng).encode("utf-8", "surrogatepass")
        return Case(name, raw, min(way, self.ways - 1) if way < self.ways else 0)


EVERY_SURFACE = """
name = "every surface"
[array]
kind = "linear"
elements = 5
pitch = "0.5 mm"
center = [0.0, 0.0]
horn = 1.5e-3
missing = [1]
[array.rx]
kind = "linear"
elements = 3
pitch = 0.5e-3
direction = [1.0, 0.0, 0.0]
[band]
start = "290 GHz"
stop = "0.3 THz"
points = 21
[[surface]]
name = "circle"
kind = "circle"
center = [0.1, 0.5]
radius = 0.05
material = "wood"
[[surface]]
name = "arc"
kind = "arc"
center = [-0.1, 0.5]
radius = 0.05
start_angle = 0
stop_angle = 120
material = "concrete"
volume_depth = 0.01
[[surface]]
name = "polyline"
kind = "polyline"
points = [[0.0, 0.4], [0.05, 0.45], [0.1, 0.4]]
roughness = {rms_height = 0.05e-3, correlation_length = 0.2e-3}
"""

CURVE = """
[[surface]]
name = "curve"
kind = "curve"
points = [[0.2, 0.4], [0.25, 0.45], [0.3, 0.4], [0.35, 0.45]]
"""
"""A curve, which only the full-wave solver can simulate."""

SOLIDS = """
name = "solids"
dimensions = 3
[scanner]
azimuth = {start = -5, stop = 5, points = 5}
elevation = {start = -5, stop = 5, points = 5}
spot_radius = 0.017
focus_distance = 3.6
leakage = {level_db = -30, range = 0.15}
[band]
start = 270e9
stop = 300e9
points = 51
[[surface]]
name = "panel"
kind = "panel"
center = [0.05, 2.2, 0.0]
normal = [-1.0, -1.0, 0.0]
width = 2.0
height = 2.4
material = "plasterboard"
[[surface]]
name = "box"
kind = "box"
heading = 10
rounding = 0.01
center = [0.0, 1.0, 0.0]
size = [0.2, 0.2, 0.2]
[[surface]]
name = "sphere"
kind = "sphere"
center = [0.5, 1.0, 0.0]
radius = 0.1
[[surface]]
name = "cylinder"
kind = "cylinder"
start = [-0.5, 1.0, 0.0]
end = [-0.5, 1.0, 0.5]
radius = 0.1
[[surface]]
name = "patch"
kind = "patch"
on = "panel"
center = [0.0, 0.0, 0.0]
direction = [0, 1, 0]
outline = [[-0.08, 0.11], [-0.08, -0.11], [0.08, -0.11]]
"""


class Scenes(Texts):
    """Scene files: read, described, and simulated if they are small."""

    ways = 3
    largest = 20_000
    """Most samples of a sweep that is simulated."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        shipped = package_files("mirrorfold") / "scenes" / "shipped"
        names = ("two_walls", "synthetic_aperture", "corridor", "drywall-mannequin")
        self.texts = {f"{name}.toml": (shipped / f"{name}.toml").read_text() for name in names}
        self.texts |= {"every.toml": EVERY_SURFACE, "curve.toml": EVERY_SURFACE + CURVE, "solids.toml": SOLIDS}

    def read(self, path: Path, way: int) -> None:
        import mirrorfold as mf

        scene = mf.load_scene(path)
        if way == 1:
            run("info", path, "--json")
        elif way == 2 and isinstance(scene, mf.Scene):
            count = scene.array.count * (scene.array.rx or scene.array).count
            if count * scene.band.points <= self.largest:
                mf.simulate(scene, bounces=1)


class Descriptions(Texts):
    """Mirrors, floor plans and calibrations of elements."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        corners = [[0.4, 1.5, -0.6], [0.4, 2.5, -0.6], [0.4, 2.5, 0.6], [0.4, 1.5, 0.6]]
        mirrors = [{"start": [0.4, 1.6], "end": [0.6, 0.9]}, {"start": [-0.5, 1.0], "end": [-0.4, 1.9]}]
        line = {"type": "LineString", "coordinates": [[0.4, 1.6], [0.6, 0.9], [0.7, 1.0]]}
        area = {"type": "MultiPolygon", "coordinates": [[[[0, 1], [1, 1], [1, 2], [0, 1]]]]}
        features = [
            {"type": "Feature", "geometry": line, "properties": {"layer": "mirrors"}},
            {"type": "Feature", "geometry": {"type": "GeometryCollection", "geometries": [area, line]}},
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": [0, 1]}, "properties": None},
        ]
        elements: dict[str, object] = {"mirrorfold_kind": "element calibration", "units": "m", "residual": 0.1}
        for side in ("tx", "rx"):
            elements |= {f"{side}_delay": [0.0, 1e-3], f"{side}_valid": [True, True]}
            elements[f"{side}_gain"] = {"real": [1.0, 0.9], "imag": [0.0, 0.1]}
            elements[f"{side}_offset"] = elements[f"{side}_position"] = [[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]]
        self.texts = {
            "lines.json": json.dumps({"mirrors": mirrors}),
            "planes.json": json.dumps({"mirrors": [{"corners": corners}]}),
            "plan.geojson": json.dumps({"type": "FeatureCollection", "features": features}),
            "elements.json": json.dumps(elements),
        }

    def read(self, path: Path, way: int) -> None:
        from mirrorfold.calibration.files import load_elements
        from mirrorfold.detection.mirrors.known_mirrors import read_mirrors
        from mirrorfold.io.plans import read_plan

        read = {"plan.geojson": read_plan, "elements.json": load_elements}.get(path.name, read_mirrors)
        read(path)
