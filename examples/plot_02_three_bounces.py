"""
Around three corners
====================

A wave that is reflected at three walls, one after the other, has passed through four rooms. Each reflection adds a
generation to the tree of mirrors, because a surface that is seen by way of a mirror may be a mirror itself.
"""

import matplotlib.pyplot as plt

import mirrorfold as mf
from mirrorfold.common.decibels import COLOURS
from mirrorfold.scenes.floor_plan import parse_scene

# %%
# Three metal panels turn the view to the left, ahead, and to the left again, like a periscope. At its end stands a
# corner. A screen keeps the radar from looking past the first panel. The panels are slightly rough, so that the radar
# sees them as well as the objects that they reflect.

rough = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
panels = {
    "first": [(-0.26, 1.26), (0.26, 0.74)],
    "second": [(-1.16, 1.30), (-0.56, 0.70)],
    "third": [(-1.26, 2.30), (-0.46, 1.50)],
    "screen": [(-0.45, 0.42), (-0.10, 0.46)],
}
corner = [(-1.50, 1.74), (-1.66, 1.90), (-1.50, 2.06)]
scene = parse_scene(
    {
        "name": "periscope",
        "array": {"kind": "linear", "elements": 121, "pitch": 0.5e-3},
        "band": {"start": 290e9, "stop": 300e9, "points": 361},
        "surface": [
            {"name": name, "kind": "segment", "start": start, "end": stop, "roughness": rough}
            for name, (start, stop) in panels.items()
        ]
        + [{"name": "corner", "kind": "polyline", "points": corner, "roughness": {**rough, "rms_height": 0.1e-3}}],
    }
)
reconstruction = mf.reconstruct(mf.simulate(scene, bounces=3))

# %%
# In the initial image everything appears in one direction, far behind the first panel.

figure = mf.plot.before_after(reconstruction, scene)

# %%
# How many echoes came by way of how many mirrors?

objects = reconstruction["objects"].to_dataset(inherit=False)
bounces, counts = [0, 1, 2, 3], [int((objects["bounces"] == n).sum()) for n in (0, 1, 2, 3)]
figure, axes = plt.subplots(figsize=(6.5, 2.6), layout="constrained")
axes.barh(bounces, counts, color=COLOURS[:4])
axes.set(xlabel="folded points", ylabel="bounces", yticks=bounces)
axes.invert_yaxis()

# %%
# An error of a wall's angle turns the reflection by twice this error. After three reflections, the mirrors must be
# known to a few hundredths of a degree for the corner to be placed to within a centimetre.

for mirror in mf.score(reconstruction, scene)["mirrors"]:
    if mirror["surface"] is not None:
        print(f"{mirror['surface']:8} generation {mirror['generation']}: {mirror['angle_error_deg']:.3f} degrees")
