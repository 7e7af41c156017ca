"""
Measured data: vehicles from the air
====================================

The files of other laboratories have other names, units, signs and axes. This example reads four degrees of the GOTCHA
circular synthetic-aperture data (AFRL, public release SN-07-0045), if they are in a folder of data beside the project,
or in the folder that the environment variable `MIRRORFOLD_DATA` names. Otherwise it makes similar data of its own.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import speed_of_light

import mirrorfold as mf


def data_files():
    """The measured files, if there are any; otherwise an empty list."""
    here = Path.cwd().resolve()
    folders = [Path(os.environ["MIRRORFOLD_DATA"])] if "MIRRORFOLD_DATA" in os.environ else []
    folders += [parent / "shared" / "data" for parent in (here, *here.parents)]
    return next((found for found in (sorted(folder.glob("gotcha/*.mat")) for folder in folders) if found), [])


# %%
# An airborne radar circles a parking lot at 7 km and looks down at 45 degrees. Each pulse was shifted in time as if it
# had been sent from the distance of the scene's centre. A *mapping*, a short TOML text, states all this; the mapping
# for these data comes with the package under the name `gotcha`.


def made_up_sweep():
    """Rows of vehicles, as bright corners, seen from the same arc."""
    random = np.random.default_rng(0)
    places = np.array([(x, y, 0.0) for x in (-24, -8, 8, 24) for y in np.arange(-30, 31, 5)])
    places[:, :2] += random.normal(0, 0.5, (len(places), 2))
    angle = np.radians(np.linspace(0, 4, 240))
    radar = 7100.0 * np.column_stack([np.cos(angle), np.sin(angle), np.full(angle.size, 1.0)])
    frequency = np.linspace(9.29e9, 9.91e9, 424)
    k = 2 * np.pi * frequency / speed_of_light
    s = np.zeros((frequency.size, angle.size), dtype=complex)
    for place, brightness in zip(places, random.rayleigh(1.0, len(places)), strict=True):
        s += brightness * np.exp(-2j * k[:, None] * np.linalg.norm(radar - place, axis=1))
    return mf.make_monostatic_sweep(s, frequency=frequency, antenna_position=radar, scene_center=[0.0, 0.0, 0.0])


found = data_files()
sweep = mf.import_data(found, mapping="gotcha") if found else made_up_sweep()
print("measured" if found else "simulated", dict(sweep["s"].sizes))

# %%
# From here on it is a sweep like any other. For any geometry, focusing predicts its error before it starts; the
# attribute `error` is measured on the finished image.

ground = np.linspace(-50, 50, 401)
image = mf.focus(sweep, x=ground, y=ground, tolerance=1e-3)
print(f"algorithm {image.attrs['algorithm']}, error {image.attrs['error']:.1e}")

figure, axes = plt.subplots(figsize=(7.2, 6.2), layout="constrained")
amplitude = np.abs(image.squeeze().values)
level = 20 * np.log10(amplitude / amplitude.max())
shown = axes.imshow(level, origin="lower", extent=(-50, 50, -50, 50), cmap="magma", vmin=-45, vmax=-5)
figure.colorbar(shown, ax=axes, shrink=0.85, label="amplitude [dB]")
axes.set(xlabel="x [m]", ylabel="y [m]", title="a parking lot, 4 degrees of the circle")

# %%
# The rows are vehicles. The bright spots are right angles between their sides and the ground, which act as mirrors.
#
# For files of your own, `mirrorfold import --guess FILE` proposes a mapping and says how sure it is of each line.
