"""Put classic mistakes into random sweeps, diagnose them, and print which mistakes were named for which.

    python benchmarks/diagnosis.py [--scenes 30] [--first 0] [--fullwave FILE] [--scans 4] [--json FILE]

Scenes are drawn from `mirrorfold.scenes.families`, with arrays and bands of random size, and with transmitters and
receivers that coincide or are displaced. `--fullwave` adds parts of a measured or full-wave sweep of pairs, `--scans`
adds raster scans. Each row of the table is a mistake that was made, each column a mistake that was named.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import raster
import xarray as xr
from rich.console import Console
from rich.table import Table

import mirrorfold as mf
from mirrorfold.diagnosis import diagnose
from mirrorfold.scenes import families
from mirrorfold.scenes.floor_plan import parse_scene

FAMILIES = ("one wall", "two walls", "corridor", "three bounces", "drywall", "discs")
EXPECTED = {
    "none": (),
    "conjugated": ("conjugated",),
    "I and Q": ("conjugated",),
    "reversed": ("frequency-reversed",),
    "millimetres": ("position-unit",),
    "exchanged": ("tx-rx-exchanged",),
    "cable": ("range-offset",),
}
"""The mistakes that are put into sweeps, and the findings that name them rightly."""

SCAN_EXPECTED = {"none": (), "conjugated": ("range-reversed",), "reversed": ("range-reversed",)}
"""The same for raster scans."""

CABLES = (0.6, 5.0)
"""Least and largest length of the cable that is put into sweeps [m]."""


def draw(seed: int) -> xr.Dataset:
    """A random sweep of a random scene."""
    random = np.random.default_rng([seed, 99])
    scene = families.draw(FAMILIES[seed % len(FAMILIES)], 1000 + seed)
    if random.random() < 0.5:
        array = {"elements": int(random.integers(81, 162)), "pitch": 0.5e-3}
        band = {"start": 290e9, "stop": 300e9, "points": 401}
    else:
        elements, apart = int(random.integers(61, 101)), random.uniform(0.04, 0.15)
        receivers = {"elements": elements, "pitch": 0.5e-3, "center": [apart / 2, 0.0]}
        array = {"elements": elements, "pitch": 0.5e-3, "center": [-apart / 2, random.uniform(-0.02, 0.02)]}
        array["rx"] = receivers
        band = [{"start": 290e9, "stop": 300e9, "points": 401}, {"start": 270e9, "stop": 300e9, "points": 801}][
            seed % 2
        ]
    surfaces = [
        {name: value for name, value in vars(surface).items() if value is not None} for surface in scene.surface
    ]
    for surface in surfaces:
        if "roughness" in surface:
            surface["roughness"] = vars(surface["roughness"])
    drawn = parse_scene({"name": scene.name, "array": array, "band": band, "surface": surfaces})
    return mf.simulate(drawn, seed=seed, snr_db=float(random.choice([10.0, 20.0, 30.0])))


def part(sweep: xr.Dataset, seed: int) -> xr.Dataset:
    """The same random part of transmitters and receivers of a sweep, or two displaced parts of them, with noise."""
    random = np.random.default_rng([seed, 7])
    count = sweep.sizes["tx"]
    size = int(random.integers(61, count + 1))
    first = int(random.integers(0, count - size + 1))
    chosen = slice(first, first + size)
    found = sweep.isel(tx=chosen, rx=chosen)
    if random.random() < 0.5:
        size = count // 2
        found = sweep.isel(tx=slice(0, size), rx=slice(count - size, count))
    return mf.add_noise(found, snr_db=float(random.choice([10.0, 20.0, 30.0])), seed=seed)


def scan(seed: int) -> xr.Dataset:
    """A raster scan of a random drywall or corridor, with or without leakage."""
    random = np.random.default_rng([seed, 11])
    for _ in range(20):
        shown, draw_surfaces, _ = raster.FAMILIES[("drywall", "corridor")[seed % 2]]
        content = raster.shipped(shown) | {"surface": draw_surfaces(random)}
        content["scanner"] |= {axis: content["scanner"][axis] | {"points": 61} for axis in ("azimuth", "elevation")}
        if random.random() < 0.5:
            content["scanner"].pop("leakage", None)
        try:
            return mf.simulate(parse_scene(content), seed=seed, snr_db=float(random.choice([0.0, 10.0, 20.0])))
        except mf.InputError as error:
            if "wrap around" not in str(error):
                raise
    raise RuntimeError(f"no scan with seed {seed}")


def injected(sweep: xr.Dataset, mistake: str, seed: int) -> xr.Dataset:
    """The sweep after a mistake was put into it."""
    random = np.random.default_rng([seed, 3])
    turn = np.exp(2j * np.pi * random.random())  # the absolute phase of a measurement means nothing
    sweep = sweep.assign(s=sweep["s"].copy(data=(sweep["s"].values * turn).astype(np.complex64)))
    if mistake == "conjugated":
        return mf.calibrate.conjugate(sweep)
    if mistake == "I and Q":
        return mf.calibrate.swap_iq(sweep)
    if mistake == "reversed":
        return mf.calibrate.reverse_frequency(sweep)
    if mistake == "exchanged":
        return mf.calibrate.swap_tx_rx(sweep)
    if mistake == "cable":
        return mf.calibrate.remove_cable(sweep, -float(random.uniform(*CABLES)))
    if mistake == "millimetres":
        return sweep.assign_coords({f"{a}_position": 1e3 * sweep[f"{a}_position"] for a in ("tx", "rx")})
    return sweep


def table(counts: dict[tuple[str, str], Counter[str]]) -> Table:
    """How often each mistake was named for each that was made, by kind of sweep, and the share that is right."""
    names = sorted({name for row in counts.values() for name in row}, key=lambda name: (name != "nothing", name))
    result = Table(title="rows: mistake made; columns: mistakes named", title_justify="left")
    for heading in ("sweeps", "mistake", *names, "right"):
        result.add_column(heading, justify="left" if heading in ("sweeps", "mistake") else "right")
    for (kind, mistake), row in counts.items():
        expected = (SCAN_EXPECTED if kind == "raster" else EXPECTED)[mistake]
        right = row[", ".join(expected) or "nothing"] / row.total()
        result.add_row(kind, mistake, *(str(row[name] or "") for name in names), f"{100 * right:.1f} %")
    return result


def main() -> None:
    """Diagnose the sweeps that the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=30)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--fullwave", type=Path)
    parser.add_argument("--parts", type=int, default=10, help="parts of the full-wave sweep")
    parser.add_argument("--scans", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    counts: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    cases = [("rays", seed) for seed in range(options.first, options.first + options.scenes)]
    whole = mf.load(options.fullwave) if options.fullwave else None
    cases += [("full wave", seed) for seed in range(options.first, options.first + options.parts)] if whole else []
    cases += [("raster", seed) for seed in range(options.first, options.first + options.scans)]
    for kind, seed in cases:
        sweep = draw(seed) if kind == "rays" else scan(seed) if kind == "raster" else part(whole, seed)
        for mistake in SCAN_EXPECTED if kind == "raster" else EXPECTED:
            if mistake == "exchanged" and np.array_equal(sweep["tx_position"], sweep["rx_position"]):
                continue  # by reciprocity, the exchange changes nothing
            started = time.perf_counter()
            found, _ = diagnose(injected(sweep, mistake, seed))
            named = ", ".join(sorted(finding.name for finding in found)) or "nothing"
            counts[kind, mistake][named] += 1
            taken = time.perf_counter() - started
            print(f"{kind} {seed} {mistake}: {named} ({taken:.1f} s)", file=sys.stderr, flush=True)
    if options.json:
        options.json.write_text(json.dumps([[*key, dict(row)] for key, row in counts.items()]))
    Console(width=180).print(table(counts))


if __name__ == "__main__":
    main()
