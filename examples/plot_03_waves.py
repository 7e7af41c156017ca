"""
Waves between walls
===================

The full-wave solver knows nothing of mirrors: it solves Maxwell's equations on the surfaces. At 300 GHz a wave is too
short to be seen in a picture of a room, so here is the same room at 4 GHz.
"""
# sphinx_gallery_thumbnail_number = 2

from dataclasses import replace
from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation

import mirrorfold as mf

FREQUENCY = 4e9
scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "hidden_corner.toml"))
scene = replace(scene, surface=tuple(replace(surface, roughness=None) for surface in scene.surface))

# %%
# `near_field` gives the field of one transmitter, the middle one of the array, on a grid. It holds everything: the wave
# itself, its reflections, shadows, and diffraction at the edges.

x, y = np.linspace(-1.15, 1.15, 231), np.linspace(-0.1, 2.5, 261)
field = mf.near_field(scene, FREQUENCY, (x, y))

# %%
# The field is a complex number E at each pixel. Its real part during one period makes a movie: `Re(E exp(j w t))`.

figure, axes = plt.subplots(figsize=(5.4, 5.6), layout="constrained")
extent = (x[0], x[-1], y[0], y[-1])
wave = axes.imshow(field.real, origin="lower", extent=extent, cmap="RdBu_r", vmin=-2, vmax=2, interpolation="bicubic")
figure.colorbar(wave, ax=axes, shrink=0.8, label="field [m$^{-1/2}$]")
mf.plot.scene(scene, axes)
axes.set(title="one source at 4 GHz", xlim=extent[:2], ylim=extent[2:])

FRAMES = 20


def draw(frame):
    """The field at one moment of the period."""
    wave.set_data((field.values * np.exp(2j * np.pi * frame / FRAMES)).real)
    return (wave,)


movie = FuncAnimation(figure, draw, frames=FRAMES)

# %%
# The wave passes to the left of the partition, meets the wall there, and turns towards the corner and the screen. This
# reflected beam is all that reaches them from the radar. How strong is the field at each place?

level = 20 * np.log10(np.maximum(np.abs(field.values), 1e-6))
figure, axes = plt.subplots(figsize=(5.4, 5.6), layout="constrained")
strength = axes.imshow(level, origin="lower", extent=extent, cmap="viridis", vmin=-30, vmax=8)
figure.colorbar(strength, ax=axes, shrink=0.8, label="modulus [dB re m$^{-1/2}$]")
mf.plot.scene(scene, axes)
axes.set(title="how strong it is", xlim=extent[:2], ylim=extent[2:])

# %%
# The stripes are standing waves; from their distance follows the angle at which two waves cross. Behind the partition
# lies its shadow, which only the reflection of the wall and a little diffraction reach.
#
# At 300 GHz the same solver computes whole sweeps: `mf.simulate(scene, solver="fullwave")`.
