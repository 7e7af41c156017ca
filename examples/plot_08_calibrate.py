"""
Calibrate a scan
================

Cables, connectors and phase centres delay every element by an amount of its own. At 300 GHz a millimetre is a
wavelength: an array with such errors does not focus at all. With the echo of a small metal sphere at a known place, the
delays can be estimated and removed.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import parse_scene

# %%
# Two measurements by the same array: a wall and a box; and the sphere alone.

ARRAY = {"kind": "linear", "elements": 61, "pitch": 0.5e-3, "center": [-0.04, 0.0]}
ARRAY["rx"] = {"kind": "linear", "elements": 61, "pitch": 0.5e-3, "center": [0.04, 0.0]}
BAND = {"start": 280e9, "stop": 300e9, "points": 401}
ROUGH = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
SPHERE, RADIUS = (0.03, 0.9), 0.02


def measured(*surfaces, seed):
    """What the ideal instrument would measure of these surfaces."""
    return mf.simulate(parse_scene({"name": "lab", "array": ARRAY, "band": BAND, "surface": list(surfaces)}), seed=seed)


scene = measured(
    {"name": "wall", "kind": "segment", "start": [0.2, 1.15], "end": [0.52, 0.75], "roughness": ROUGH},
    {"name": "box", "kind": "polyline", "points": [[-0.28, 1.06], [-0.12, 1.02], [-0.16, 1.2]], "roughness": ROUGH},
    seed=0,
)
sphere = measured({"name": "sphere", "kind": "circle", "center": SPHERE, "radius": RADIUS}, seed=0)

# %%
# The real instrument has a random delay of up to 2 mm in each element, a long cable, and noise.

random = np.random.default_rng(0)
tx_delay, rx_delay = random.uniform(-2e-3, 2e-3, (2, 61))
CABLE = 1.7


def spoiled(sweep, seed):
    """The same sweep, through cables and connectors."""
    k = 2 * np.pi * sweep["frequency"].values[:, None, None] / speed_of_light
    turn = np.exp(-1j * k * (tx_delay[:, None] + rx_delay + CABLE))
    return mf.add_noise(sweep.assign(s=(sweep["s"] * turn).astype(np.complex64)), snr_db=20.0, seed=seed)


raw, raw_sphere = spoiled(scene, 1), spoiled(sphere, 2)

# %%
# As in a laboratory, we remove the nominal length of the cable, and estimate the delays of the elements from the
# sphere. They can be saved to a small file that serves all later measurements with this instrument.

raw, raw_sphere = mf.calibrate.remove_cable(raw, CABLE), mf.calibrate.remove_cable(raw_sphere, CABLE)
elements = mf.calibrate.estimate_elements(raw_sphere, at=SPHERE, radius=RADIUS)
clean = mf.calibrate.apply_elements(raw, elements)

x, y = np.arange(-0.5, 0.7, 0.003), np.arange(0.55, 1.38, 0.003)
figure, panels = plt.subplots(1, 3, figsize=(13, 4.0), sharey=True, layout="constrained")
for axes, (title, sweep) in zip(
    panels, {"as measured": raw, "calibrated": clean, "an ideal instrument": scene}.items(), strict=True
):
    mf.plot.image(mf.focus(sweep, x=x, y=y), axes, colorbar=False, floor_db=-35)
    axes.set_title(title)

# %%
# How well are the delays known? Only the sum of a transmitter's and a receiver's delay can be observed. So a constant
# may move from all transmitters to all receivers; it is left out of the errors.

error_tx = elements.tx_delay - tx_delay
error_rx = elements.rx_delay - rx_delay
figure, axes = plt.subplots(figsize=(7.5, 3.4), layout="constrained")
axes.plot(1e3 * tx_delay, "o", color="#0072b2", markersize=4, label="true delay, transmitters")
axes.plot(1e3 * (elements.tx_delay - np.median(error_tx)), "+", color="#d55e00", markersize=8, label="found")
axes.set(xlabel="element", ylabel="delay [mm]")
axes.legend(frameon=False, ncols=2, loc="upper right")
worst = max(np.abs(error - np.median(error)).max() for error in (error_tx, error_rx))
print(f"largest error of a delay: {1e6 * worst:.1f} um")
