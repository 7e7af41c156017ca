"""Few channels: how small a random part of all channels, or how few random modes, suffice for imaging and folding.

Each scene is measured by a part of its channels, or by modes of two apertures with random phases. The measurement is
imaged by delay and sum, and by the sparse reconstruction that has the least l1 norm. Both images are folded and scored.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.sparse.linalg import lsqr

import mirrorfold as mf
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.types import Array
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.parts.scenes import random_scenes
from mirrorfold.reproducing.parts.sparse_figures import draw_example, draw_quality, draw_unexplained
from mirrorfold.reproducing.parts.sparse_imaging import Channels, Measurement, Modes, Samples, random_channels
from mirrorfold.reproducing.parts.sparse_imaging import sparse_reflectivity as solve
from mirrorfold.reproducing.parts.sparse_pages import in_a_word, learnt
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.families import Radar, draw

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

FAMILIES = ("discs", "two walls")
"""Families of scenes. Both hide objects behind one wall and show them in another: small discs, or corners, arcs and
discs."""

KINDS = ("channels", "frequencies", "elements", "modes")
"""What is chosen at random: any channels, frequencies, elements of both arrays, or the phases of two apertures."""

METHODS = ("delay and sum", "sparse", "sparse, not restored")
"""Ways to image: the matched filter; the sweep that the sparse reconstruction predicts, focused; and the sparse image
as it is."""

MEASURES = {
    "f_cells": "hidden F at 1.5 cells",
    "f_2cm": "hidden F at 2 cm",
    "mirrors": "mirrors found",
    "invented": "hidden points invented",
}
"""The scores of each reconstruction, all from 0 to 1, and their names in tables."""

SNR_DB = 20.0
"""Signal over noise of a sample [dB]: noise is far below the echoes of walls, and near those of hidden objects."""

ENOUGH = 0.9
"""A method needs no more channels if its mean F-score is at least this share of the F-score with all channels."""

EXAMPLE = ("channels", 0.1)
"""What is chosen, and the share of it, in the example that is drawn."""

LSQR_ITERATIONS = 20
"""Iterations of the least-squares fit that finds which part of the samples no reflectivities explain."""

Scores = dict[str, dict[str, float]]


class Setting(NamedTuple):
    """Sizes of a run: families, radar, pixels x and y [m], shares of the channels, seeds, and iterations of FISTA."""

    families: tuple[str, ...]
    radar: Radar
    x: Array
    y: Array
    shares: tuple[float, ...]
    seeds: tuple[int, ...]
    iterations: int


def run(work: Work) -> Findings:
    """Measure every scene in every way, image each measurement by all methods, and fold the images."""
    setting = work.size(
        Setting(FAMILIES, _radar(75, 141), *_grid(0.0125, 0.0187), (0.5, 0.25, 0.1), tuple(range(4)), 100),
        Setting(FAMILIES[:1], _radar(61, 121), *_grid(0.02, 0.0225), (0.1,), (3,), 30),
    )
    tasks = [(family, seed) for family in setting.families for seed in setting.seeds]
    found: dict[str, list[Scores]] = {family: [] for family in setting.families}
    example: dict[str, xr.DataTree] = {}
    scenes = {}
    for number, (family, seed) in enumerate(tasks):
        scene: Any = draw(family, seed, radar=setting.radar)
        sweep = work.sweep(scene, solver="rays", seed=seed, snr_db=SNR_DB)
        shown = family == setting.families[-1] and seed == setting.seeds[0]
        pictures: dict[str, xr.DataTree] = {}
        study = partial(_study, scene, sweep, seed, setting, pictures)
        found[family].append(study() if shown else work.kept(study))  # pictures are not stored, but made anew
        if shown:
            scenes[family], example = scene, pictures
        work.step(number + 1, len(tasks))
    data = _data(found, setting)
    numbers = _numbers(data)
    return Findings(
        claims=_claims(data, numbers),
        numbers=numbers,
        figures=_figures(data, example, scenes[setting.families[-1]], setting),
        data=xr.DataTree(children={"scores": xr.DataTree(data), **_example_data(example)}),
        tables=_tables(data, setting),
        text=learnt(data, numbers, setting.iterations),
        assumptions=(
            "Nothing was published on few channels. The radar is one for cars, 77-81 GHz, whose sweeps are small; a "
            f"range cell is 3.75 cm. Scenes are simulated by rays, with noise {SNR_DB:g} dB below the mean power of a "
            "sample; of modes, too, the noise is that of the samples that they combine.",
            "The modes have random phases at every element, mode and frequency, on either side: frequency-diverse "
            "apertures that are perfectly known.",
        ),
    )


def _radar(elements: int, points: int) -> Radar:
    """A radar at 77-81 GHz with antennas half a wavelength apart."""
    return Radar(
        name=f"{elements} antennas",
        what="77-81 GHz",
        band={"start": 77e9, "stop": 81e9, "points": points},
        array={"kind": "linear", "elements": elements, "pitch": 1.8e-3},
    )


def _grid(x: float, y: float) -> tuple[Array, Array]:
    """Pixels x, y [m] over everything that the scenes show, ghosts included; steps [m] of half a cell or less."""
    return np.arange(-2.4, 3.6, x), np.arange(0.45, 4.25, y)


def _study(scene: Scene, sweep: xr.Dataset, seed: int, setting: Setting, example: dict[str, xr.DataTree]) -> Scores:
    """The scores of one scene by kind, share and method; reconstructions for the pictures are put into `example`."""
    s = np.asarray(sweep["s"].values)
    model = mf.FocusOperator(sweep, x=setting.x, y=setting.y, tolerance=1e-3)
    imaged = partial(_folded, sweep, setting)
    everything = imaged(s, s)
    scores = {"full": _score(everything, scene)}
    residual = s - model.all_samples(lsqr(model, s.ravel(), iter_lim=LSQR_ITERATIONS)[0])
    # The share of the power that no reflectivities explain, less that of the noise; its root is one of the amplitude.
    power = (np.linalg.norm(residual) / np.linalg.norm(s)) ** 2 - power_ratio_of(-SNR_DB)
    scores["scene"] = {"unexplained": float(np.sqrt(np.maximum(power, 0.0)))}
    falls, filled = [], []
    for kind in KINDS:
        for share in setting.shares:
            random = np.random.default_rng([seed, KINDS.index(kind), round(100 * share)])
            measurement: Measurement = (
                Modes(model, s.shape, share, random)
                if kind == "modes"
                else Channels(model, random_channels(kind, share, s.shape, random))
            )
            y = measurement.measured(s)
            x, fell = solve(measurement, y, setting.iterations)
            falls.append(fell)
            filled.append(np.count_nonzero(x) / x.size)
            matched = measurement.matched(y)
            found = (
                imaged(matched, matched),
                imaged(measurement.completed(y, x), matched),
                mf.fold(model.image(x)),
            )
            for method, folded in zip(METHODS, found, strict=True):
                scores[f"{kind}, {share:g}, {method}"] = _score(folded, scene)
                if (kind, share) == EXAMPLE:
                    example[method] = folded
    example["all channels"] = everything
    scores["scene"] |= {"falls": float(np.mean(falls)), "filled": float(np.mean(filled))}
    return scores


def _folded(sweep: xr.Dataset, setting: Setting, s: Samples, measured: Samples) -> xr.DataTree:
    """The reconstruction from the image of samples `s`; tests that need a sweep, as for mixed paths, use `measured`."""
    shown, known = (sweep.assign(s=(sweep["s"].dims, samples.astype(np.complex64))) for samples in (s, measured))
    return mf.fold(mf.focus(shown, x=setting.x, y=setting.y), sweep=known)


def _score(reconstruction: xr.DataTree, scene: Scene) -> dict[str, float]:
    """The scores of a reconstruction that `MEASURES` names."""
    found: Any = mf.score(reconstruction, scene)
    walls = {mirror.surface for mirror in found.mirrors if (mirror.surface or "").startswith("wall")}
    return {
        "f_cells": float(found.hidden.f_score_cells or 0.0),
        "f_2cm": float(found.hidden.f_score_2cm or 0.0),
        "mirrors": len(walls) / sum(surface.name.startswith("wall") for surface in scene.surface),
        "invented": float(found.hidden.invented_fraction or 0.0),
    }


def _data(found: dict[str, list[Scores]], setting: Setting) -> xr.Dataset:
    """The scores of all scenes in one data set."""
    dims = ("family", "kind", "share", "imaging", "scene")
    units = {"units": "1"}

    def whole(name: str) -> tuple[Any, ...]:
        values = [[scores["full"][name] for scores in found[family]] for family in setting.families]
        return ("family", "scene"), values, units

    ways = list(product(KINDS, setting.shares, METHODS))
    shape = (len(setting.families), len(KINDS), len(setting.shares), len(METHODS), len(setting.seeds))

    def each(name: str) -> Array:
        values = [
            [[scores[f"{kind}, {share:g}, {method}"][name] for scores in found[family]] for kind, share, method in ways]
            for family in setting.families
        ]
        return np.reshape(values, shape)

    variables: dict[str, Any] = {
        name: (dims, each(name), units | {"long_name": label}) for name, label in MEASURES.items()
    }
    variables |= {f"full_{name}": whole(name) for name in MEASURES}
    variables |= {
        name: (
            ("family", "scene"),
            [[scores["scene"][name] for scores in found[family]] for family in setting.families],
            units,
        )
        for name in ("unexplained", "falls", "filled")
    }
    coords = {
        "family": list(setting.families),
        "kind": list(KINDS),
        "share": ("share", list(setting.shares), units),
        "imaging": list(METHODS),
        "scene": list(setting.seeds),
    }
    return xr.Dataset(variables, coords)


def _example_data(example: dict[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """The initial images and the points of the example, by method."""
    return {
        in_a_word(name): xr.DataTree(
            one["initial"].to_dataset()[["initial"]].drop_attrs(),
            children={"objects": xr.DataTree(one.children["objects"].to_dataset(inherit=False))},
        )
        for name, one in example.items()
    }


def _numbers(data: xr.Dataset) -> dict[str, float]:
    """Means over the scenes of all families, and of each family."""
    numbers = {"full_f_cells": float(data["full_f_cells"].mean()), "full_f_2cm": float(data["full_f_2cm"].mean())}
    for family in data["family"].values:
        for name in ("full_f_cells", "unexplained"):
            numbers[f"{in_a_word(family)}_{name}"] = float(data[name].sel(family=family).mean())
    for kind in KINDS:
        for share in data["share"].values:
            for method in METHODS:
                at = {"kind": kind, "share": share, "imaging": method}
                label = f"{kind}_{100 * share:.0f}_percent_{in_a_word(method)}_f_cells"
                numbers[label] = float(data["f_cells"].sel(at).mean())
                for family in data["family"].values:
                    numbers[f"{in_a_word(family)}_{label}"] = float(data["f_cells"].sel(at | {"family": family}).mean())
    numbers["pixels_not_zero"] = float(data["filled"].mean())
    numbers["cost_still_falls"] = float(data["falls"].max())
    if data["unexplained"].size > 2:
        numbers["unexplained_against_elements_correlation"] = _correlation(data)
    return numbers


def _correlation(data: xr.Dataset) -> float:
    """Correlation of the share that the model leaves unexplained with the F-score that random elements lose."""
    lost = data["full_f_cells"] - data["f_cells"].sel(kind="elements", imaging="sparse").mean("share")
    return float(xr.corr(data["unexplained"], lost))


def _claims(data: xr.Dataset, numbers: dict[str, float]) -> tuple[Claim, ...]:
    """Open questions, answered by numbers."""
    shares = data["share"].values
    full = numbers["full_f_cells"]
    found = []
    for kind in KINDS:
        least: dict[str, str] = {}
        for method in METHODS[:2]:
            serves = [share for share in shares if _of(numbers, kind, share, method) >= ENOUGH * full]
            least[method] = f"{100 * min(serves):.0f} %" if serves else f"more than {100 * max(shares):.0f} %"
        fewest = min(shares)
        what = {
            "channels": "of the channels, chosen at random,",
            "frequencies": "of the frequencies, chosen at random,",
            "elements": "of the pairs, by random elements,",
            "modes": "of the measurements, by random modes of two metasurfaces,",
        }[kind]
        found.append(
            Claim(
                claim=f"What share {what} does folding need?",
                source="",
                measured=f"sparse {least['sparse']}, delay and sum {least['delay and sum']}; at {100 * fewest:.0f} % "
                f"F is {_of(numbers, kind, fewest, 'sparse'):.2f} and "
                f"{_of(numbers, kind, fewest, 'delay and sum'):.2f}",
                verdict="new",
                why="The least share tried at which the mean hidden F at 1.5 cells is at least "
                f"{100 * ENOUGH:.0f} % of the {full:.2f} with all channels.",
            )
        )
    mean = {method: float(data["f_cells"].sel(imaging=method).mean()) for method in METHODS[1:]}
    gain = mean["sparse"] - mean["sparse, not restored"]
    found.append(
        Claim(
            claim="Can the sparse image be folded as it is?",
            source="",
            measured=f"{'no' if gain > 0.05 else 'yes'}: F is {mean['sparse, not restored']:.2f} as it is, "
            f"{mean['sparse']:.2f} restored",
            verdict="new",
            why="Means over all that was measured; a difference of more than 0.05 counts.",
        )
    )
    return tuple(found)


def _of(numbers: dict[str, float], kind: str, share: float, method: str, family: str = "") -> float:
    """Mean hidden F-score at 1.5 cells, over all families or in one."""
    before = f"{in_a_word(family)}_" if family else ""
    return numbers[f"{before}{kind}_{100 * share:.0f}_percent_{in_a_word(method)}_f_cells"]


def _figures(
    data: xr.Dataset, example: dict[str, xr.DataTree], scene: Scene, setting: Setting
) -> dict[str, tuple[Any, str]]:
    """Quality against share, an example, and the loss against what the model leaves unexplained, with captions."""
    found = {
        "quality": (
            draw_quality(data),
            "Quality of what is hidden against the share of the measurement that is made; mean and standard error over "
            f"{random_scenes(len(setting.seeds))} of each family. Grey: all channels.",
        )
    }
    if EXAMPLE[1] in setting.shares:
        caption = (
            f"A scene of the family {setting.families[-1]!r}: initial images, relative to the brightest pixel, and the "
            f"folded points over the truth; {100 * EXAMPLE[1]:.0f} % of the channels at random, and all of them."
        )
        found["example"] = draw_example(example, scene), caption
    found["unexplained"] = (
        draw_unexplained(data),
        "What sparse imaging loses against the share of the samples' amplitude that no reflectivities explain; each "
        "point is a scene, the mean over the shares tried.",
    )
    return found


def _tables(data: xr.Dataset, setting: Setting) -> tuple[Table, ...]:
    """Every mean with its standard error."""
    columns = ["scenes", "chosen at random", "share [%]", "method", *MEASURES.values()]
    rows = []
    for family in setting.families:
        whole = [_with_error(data[f"full_{name}"].sel(family=family)) for name in MEASURES]
        rows.append([family, "all", "100", METHODS[0], *whole])
        for kind in KINDS:
            for share in setting.shares:
                for method in METHODS:
                    at = {"family": family, "kind": kind, "share": share, "imaging": method}
                    cells = [_with_error(data[name].sel(at)) for name in MEASURES]
                    rows.append([family, kind, f"{100 * share:.0f}", method, *cells])
    title = f"Means and standard errors over {random_scenes(len(setting.seeds))} of each family"
    return (Table(title=title, columns=columns, rows=rows),)


def _with_error(values: xr.DataArray) -> str:
    """Mean and standard error as text."""
    mean = float(values.mean())
    if values.size < 2:
        return f"{mean:.2f}"
    return f"{mean:.2f} ± {float(values.std(ddof=1)) / np.sqrt(values.size):.2f}"
