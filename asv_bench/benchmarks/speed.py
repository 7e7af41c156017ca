"""What users wait for: importing, simulating, planning, focusing, folding. Errors beside times are in `benchmarks/`."""

from __future__ import annotations

import subprocess
import sys
from importlib.resources import files

import mirrorfold as mf


def _scene(points: int) -> dict:
    """The hidden corner that comes along, with fewer frequencies."""
    import tomllib

    text = files("mirrorfold").joinpath("scenes", "shipped", "hidden_corner.toml").read_text(encoding="utf-8")
    content = tomllib.loads(text)
    content["band"]["points"] = points
    return content


class Importing:
    """What each command pays before it does anything."""

    def time_import(self) -> None:
        subprocess.run([sys.executable, "-c", "import mirrorfold"], check=True)

    def time_help(self) -> None:
        subprocess.run([sys.executable, "-m", "mirrorfold", "--help"], check=True, stdout=subprocess.DEVNULL)


class Steps:
    """From the scene to the folded reconstruction; kernels are compiled before the clock runs."""

    timeout = 300

    def setup(self) -> None:
        self.scene = mf.parse_scene(_scene(201))
        self.sweep = mf.simulate(self.scene)
        self.plan = mf.FocusPlan(self.sweep)
        self.image = self.plan(self.sweep["s"].values)
        mf.fold(self.image, sweep=self.sweep)

    def time_simulate(self) -> None:
        mf.simulate(self.scene)

    def time_plan(self) -> None:
        mf.FocusPlan(self.sweep)

    def time_focus(self) -> None:
        self.plan(self.sweep["s"].values)

    def time_fold(self) -> None:
        mf.fold(self.image, sweep=self.sweep)

    def track_error(self) -> float:
        """Relative error of the image against the float64 sum."""
        return float(self.plan.error)

    def peakmem_reconstruct(self) -> None:
        mf.reconstruct(self.sweep)
