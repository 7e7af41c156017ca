"""
A folder of Touchstone files
============================

A network analyser and two stages leave a file for every pair of positions. Here we write such a folder, and read it as
if it came from a laboratory.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import parse_scene

ROUGH = {"rms_height": 0.1e-3, "correlation_length": 0.4e-3}
scene = parse_scene(
    {
        "name": "a plate and a rod",
        "array": {"kind": "linear", "elements": 21, "pitch": 1e-3},
        "band": {"start": 140e9, "stop": 160e9, "points": 161},
        "surface": [
            {"name": "plate", "kind": "segment", "start": [-0.22, 0.62], "end": [-0.04, 0.54], "roughness": ROUGH},
            {"name": "rod", "kind": "circle", "center": [0.14, 0.5], "radius": 0.02, "roughness": ROUGH},
        ],
    }
)
sweep = mf.simulate(scene)

# %%
# 441 files `.s2p`, and a table of the places where the antennas stood.

folder = TemporaryDirectory()
scan = Path(folder.name) / "scan"
table = mf.save_touchstone(sweep, scan)
files = sorted(scan.glob("*.s2p"))
print(len(files), "files, the first", files[0].name)
print("\n".join(files[0].read_text().splitlines()[:4]))
print("\n".join(table.read_text().splitlines()[:3]))

# %%
# One call reads it. Nine digits keep every bit of a sample.

read = mf.import_data([scan], positions=table, parameter="S21")
print("bit by bit the same:", bool(np.array_equal(read["s"].values, sweep["s"].values)))

# %%
# A look at the data: the mean range profile, then the image.

facts = mf.info(read)
profile = np.abs(np.fft.ifft(read["s"].values * np.hanning(161)[:, None, None], axis=0)).mean(axis=(1, 2))
figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.2), layout="constrained")
left.plot(np.arange(161) * facts["ambiguous_range_m"] / 161, 20 * np.log10(profile / profile.max()), color="#0072b2")
left.set(xlabel="range [m]", ylabel="mean echo [dB]", ylim=(-70, 3), xlim=(0, facts["ambiguous_range_m"]))
left.grid(alpha=0.3)
image = mf.focus(read, x=np.arange(-0.3, 0.3, 0.002), y=np.arange(0.4, 0.75, 0.002))
mf.plot.image(image, right, floor_db=-35)
mf.plot.scene(scene, right, alpha=0.7)
right.set(xlim=(-0.3, 0.3), ylim=(0.4, 0.75))
folder.cleanup()

# %%
# On the command line: `mirrorfold import scan/ --positions positions.csv -o sweep.nc`. Tables may hold millimetres
# (`tx_x_mm`), and positions may be read from the file names.
