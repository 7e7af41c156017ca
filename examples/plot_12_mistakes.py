"""
Classic mistakes, and how the data tells
========================================

The wrong time convention, positions in millimetres, a cable left in: each ruins an image in its own way, and none is an
error that a program could refuse. But echoes are waves: they expand, and arrive no sooner than light. `mf.info` tests
for this.
"""

from dataclasses import replace
from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import speed_of_light

import mirrorfold as mf

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "hidden_corner.toml"))
scene = replace(scene, array=replace(scene.array, elements=81), band=replace(scene.band, points=301))
right = mf.add_noise(mf.simulate(scene), snr_db=20.0, seed=0)

# %%
# The sweep as it should be, and three ways to spoil it.

k = 2 * np.pi * right["frequency"].values[:, None, None] / speed_of_light
sweeps = {
    "as it should be": right,
    "other time convention": right.assign(s=right["s"].conj()),
    "frequencies reversed": right.assign(s=right["s"].copy(data=right["s"].values[::-1])),
    "0.6 m of cable": right.assign(s=(right["s"] * np.exp(-1j * k * 0.6)).astype(np.complex64)),
}
x, y = np.arange(-1.4, 1.3, 0.01), np.arange(0.6, 3.3, 0.01)
figure, panels = plt.subplots(1, 4, figsize=(14, 3.9), sharey=True, layout="constrained")
for axes, (title, sweep) in zip(panels, sweeps.items(), strict=True):
    mf.plot.image(mf.focus(sweep, x=x, y=y, tolerance=1e-2), axes, colorbar=False, floor_db=-35)
    axes.set_title(title)

# %%
# What the diagnosis says, from the data alone, and the command that puts it right:

for title, sweep in sweeps.items():
    print(f"\n{title}")
    for finding in mf.info(sweep)["findings"]:
        print(f"  {finding['what']} (sure: {finding['sure']:.0%})")
        print(f"  -> {finding['fix']}")

# %%
# Noise is another matter: it does not ruin an image, but hides echoes. An echo must exceed a floor that leaves one
# false alarm in a thousand images, so an image of noise holds no mirrors at all.

noise = mf.add_noise(right, snr_db=-60.0, seed=1)
nothing = mf.reconstruct(noise)
print(f"mirrors in noise: {nothing['mirrors'].sizes['mirror']}, points: {nothing['objects'].sizes['point']}")
