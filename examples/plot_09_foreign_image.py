"""
Fold an image of another tool
=============================

Folding needs an image, not a sweep. Whatever has made it - a back-projection in MATLAB, a scanner's own software - a
plain array with the coordinates of its pixels will do, even without phase.
"""

from dataclasses import replace
from importlib.resources import files
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

import mirrorfold as mf

# %%
# Some other tool has made this image; here we borrow our own, throw the phase away, and keep 8 bits of amplitude in
# dB, as a picture would.

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "hidden_corner.toml"))
scene = replace(scene, array=replace(scene.array, elements=121), band=replace(scene.band, points=301))
x, y = np.arange(-1.9, 1.2, 0.005), np.arange(0.6, 3.3, 0.005)
image = mf.focus(mf.simulate(scene), x=x, y=y, tolerance=1e-3)
amplitude = np.abs(image.values)
level = np.clip(255 + 255 / 60 * 20 * np.log10(amplitude / amplitude.max()), 0, 255).astype(np.uint8)
print(level.dtype, level.shape)

# %%
# An `xarray.DataArray` over `(y, x)` with coordinates in metres is an image. Amplitudes must be linear; everything more
# than 60 dB below the maximum is zero here.

linear = np.where(level > 0, 10 ** (60 / 20 * (level / 255.0 - 1.0)), 0.0)
foreign = xr.DataArray(linear, dims=("y", "x"), coords={"y": y, "x": x}, name="image")
reconstruction = mf.fold(foreign)
figure = mf.plot.before_after(reconstruction, scene)

# %%
# Errors of the mirrors that were fitted to this image:

for mirror in mf.score(reconstruction, scene)["mirrors"]:
    if mirror["surface"] is not None:
        print(f"{mirror['surface']}: {mirror['angle_error_deg']:.3f} degrees, {mirror['offset_error_mm']:.2f} mm")

# %%
# Files work as well: `.npz`, `.mat`, HDF5 and netCDF with the image and its axes, and point clouds.

with TemporaryDirectory() as folder:
    np.savez(f"{folder}/other_tool.npz", amplitude=foreign.values, xs=x, ys=y)
    same = mf.import_image(f"{folder}/other_tool.npz", image="amplitude", x="xs", y="ys")
print("the same image:", bool(np.allclose(same, foreign)))
