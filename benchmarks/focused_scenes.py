"""Scenes for benchmarks that fold the same images again and again: simulated and focused once, and kept in memory."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.scenes.families import FAMILIES, draw
from mirrorfold.scenes.floor_plan import load_scene, parse_scene

FULLWAVE = Path(__file__).resolve().parents[1] / "../shared/data/two_walls_fullwave.nc"

TWO_WALLS = Path(str(files("mirrorfold").joinpath("scenes", "shipped", "two_walls.toml")))
"""The scene of that sweep."""

RAY_FAMILIES = [family.name for family in FAMILIES.values() if family.engine == "rays"]

SWEEP_FAMILIES = ("two walls", "corridor")
"""The first scene of each is folded with its sweep, too."""


@dataclass
class Case:
    """A scene with its image, focused once.

    Attributes
    ----------
    group : {"rays", "full wave", "volumes"}
    name : str
    scene : Scene or Scene3D
    image : DataArray
    sweep : Dataset, optional
        Where the test for mixed paths is to be judged.
    """

    group: str
    name: str
    scene: Any
    image: xr.DataArray
    sweep: xr.Dataset | None = None
    plan: FoldPlan | None = field(default=None, repr=False)
    first: xr.DataTree | None = field(default=None, repr=False)

    def fold(self, how: str, fresh: bool) -> xr.DataTree:
        """Fold the image: "alone", with its "sweep", or "again" after folding it with its sweep.

        Unless `fresh`, the view and its echoes are those of an earlier call. The picture is made as small as can be.
        """
        if how == "again":
            if self.first is None:
                self.first = mf.fold(self.image, sweep=self.sweep)
            return mf.fold(self.first)
        axes = np.array([0.0, 1.0])
        grid = (axes, axes, axes) if self.group == "volumes" else (axes, axes)
        if how == "sweep":
            return FoldPlan(self.image, sweep=self.sweep).fold(grid=grid)
        if fresh:
            return FoldPlan(self.image).fold(grid=grid)
        if self.plan is None:
            self.plan = FoldPlan(self.image)
        return self.plan.fold(grid=grid)

    def scores(self, how: str, fresh: bool) -> dict[str, float]:
        """F-scores at 2 cm; zero where nothing is found, and left out where there is nothing to find."""
        score = mf.score(self.fold(how, fresh), self.scene)
        values = {"all": score["f_score_2cm"], "hidden": score["hidden"]["f_score_2cm"]}
        return {name: float(value) for name, value in values.items() if value is not None}


def ray_cases(names: Iterable[str], seeds: range) -> Iterator[Case]:
    """Scenes of the families."""
    for name in names:
        for seed in seeds:
            scene = draw(name, seed)
            sweep = mf.simulate(scene, solver="rays", seed=seed, snr_db=FAMILIES[name].snr_db)
            keep = seed == seeds[0] and name in SWEEP_FAMILIES
            yield Case("rays", scene.name, scene, mf.focus(sweep, tolerance=1e-3), sweep if keep else None)


def fullwave_cases(path: Path = FULLWAVE) -> Iterator[Case]:
    """The full-wave sweep, where there is one."""
    if not path.is_file():
        print(f"{path} is absent; without the full-wave sweep", file=sys.stderr)
        return
    sweep = mf.load(path)
    assert isinstance(sweep, xr.Dataset)  # the file holds one
    scene = load_scene(TWO_WALLS)
    yield Case("full wave", scene.name, scene, mf.focus(sweep, tolerance=1e-3), sweep)


def volume_cases(seeds: range) -> Iterator[Case]:
    """Raster scenes; a draw that is no scene of its family makes room for the next one."""
    import raster

    def drawn(name: str) -> Iterator[Case]:
        draw = seeds[0]
        while True:
            scene = parse_scene(raster.FAMILIES[name][0](np.random.default_rng([draw, len(name)])))
            draw += 1
            try:
                volume = mf.focus(mf.simulate(scene, seed=draw, snr_db=raster.SNR_DB))
                if "mannequin" in mf.score(mf.fold(volume), scene)["surfaces"]:
                    yield Case("volumes", f"{name} {draw - 1}", scene, volume)
            except mf.InputError as error:
                if "wrap around" not in str(error):
                    raise

    for name in raster.FAMILIES:
        yield from islice(drawn(name), len(seeds))
