"""Scenes for benchmarks that fold the same images many times: simulated and focused once, and kept in memory."""

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

"""A full-wave sweep of two walls, which may be absent."""

TWO_WALLS = Path(str(files("mirrorfold").joinpath("scenes", "shipped", "two_walls.toml")))
"""The scene of the full-wave sweep."""

RAY_FAMILIES = [family.name for family in FAMILIES.values() if family.engine == "rays"]

SWEEP_FAMILIES = ("two walls", "corridor")
"""Families whose first scene is also folded with its sweep."""


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
        The sweep, for the cases in which the test for mixed paths is judged.
    plan : FoldPlan, optional
        The plan that `fold` has made, with the view and its echoes.
    first : DataTree, optional
        The first reconstruction, which is folded again.
    """

    group: str
    name: str
    scene: Any
    image: xr.DataArray
    sweep: xr.Dataset | None = None
    plan: FoldPlan | None = field(default=None, repr=False)
    first: xr.DataTree | None = field(default=None, repr=False)

    def fold(self, how: str, fresh: bool) -> xr.DataTree:
        """Fold the image: "alone", with its "sweep", or "again" after it was folded with its sweep.

        Alone, the view and its echoes are those of an earlier call unless `fresh` is true. Pictures are as small as
        possible, except for those of "again".
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
        """F-scores at 2 cm of all points and of the hidden ones; zero if nothing is found, none if nothing can be."""
        score = mf.score(self.fold(how, fresh), self.scene)
        values = {"all": score["f_score_2cm"], "hidden": score["hidden"]["f_score_2cm"]}
        return {name: float(value) for name, value in values.items() if value is not None}


def ray_cases(names: Iterable[str], seeds: range) -> Iterator[Case]:
    """The scenes of ray families with these seeds."""
    for name in names:
        for seed in seeds:
            scene = draw(name, seed)
            sweep = mf.simulate(scene, solver="rays", seed=seed, snr_db=FAMILIES[name].snr_db)
            keep = seed == seeds[0] and name in SWEEP_FAMILIES
            yield Case("rays", scene.name, scene, mf.focus(sweep, tolerance=1e-3), sweep if keep else None)


def fullwave_cases(path: Path = FULLWAVE) -> Iterator[Case]:
    """The scene of the full-wave sweep, if the file exists."""
    if not path.is_file():
        print(f"{path} is absent; without the full-wave sweep", file=sys.stderr)
        return
    sweep = mf.load(path)
    assert isinstance(sweep, xr.Dataset)  # the file holds a sweep
    scene = load_scene(TWO_WALLS)
    yield Case("full wave", scene.name, scene, mf.focus(sweep, tolerance=1e-3), sweep)


def volume_cases(seeds: range) -> Iterator[Case]:
    """Raster scenes, as many of each family as there are seeds; draws that are no scene of the family are skipped."""
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
