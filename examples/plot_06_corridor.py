"""
A corridor, as a floor plan
===========================

A corridor turns off to the left. A scan from its entrance sees the outer wall, and by way of it the inner wall, an
extinguisher box and a mannequin. Often a plan view is enough: what stands where.
"""
# sphinx_gallery_thumbnail_number = 2

from dataclasses import replace
from importlib.resources import files

import matplotlib.pyplot as plt

import mirrorfold as mf

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "corridor.toml"))
angles = {name: replace(getattr(scene.scanner, name), points=61) for name in ("azimuth", "elevation")}
scene = replace(scene, scanner=replace(scene.scanner, **angles))
sweep = mf.simulate(scene, snr_db=20.0, bounces=2)

# %%
# `focus` makes a volume of range, azimuth and elevation; `plan_view` keeps the strongest voxel of each column.

volume = mf.focus(sweep)
plan = mf.plan_view(volume)
figure, axes = plt.subplots(figsize=(7, 5.6), layout="constrained")
mf.plot.image(plan, axes, normalization="none", extent=(-1.2, 1.6, 0.8, 4.2))
axes.set_title("what the scan shows from above")

# %%
# The long line is the outer wall. Everything that appears behind it stands in front of it in truth. Folding in three
# dimensions finds walls as planes and keeps the heights:

reconstruction = mf.fold(volume)
figure = mf.plot.before_after(reconstruction, scene)

# %%
# Walls that were seen by way of another wall are mirrors of the second generation. The list says where they stand:

for mirror in mf.info(reconstruction)["mirrors"]:
    (x0, y0, _), (x1, y1, _) = mirror["start_m"], mirror["end_m"]
    print(
        f"mirror {mirror['mirror']}, generation {mirror['generation']}: ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m"
    )
