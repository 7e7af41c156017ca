"""
A body around a drywall
=======================

A scanner with a focused beam looks at a drywall at an oblique angle. Out of its field of view stands a mannequin with
an L of foil under the shirt. The wall reflects it; the folded scan shows it where it stands.
"""
# sphinx_gallery_thumbnail_number = 2

from dataclasses import replace
from importlib.resources import files

import mirrorfold as mf

# %%
# The scene comes with the package; for this page the scan is coarsened to 81 x 81 beams.

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "drywall-mannequin.toml"))
axes = {name: replace(getattr(scene.scanner, name), points=81) for name in ("azimuth", "elevation")}
scene = replace(scene, scanner=replace(scene.scanner, **axes))
sweep = mf.simulate(scene, snr_db=20.0)
print(dict(sweep["s"].sizes))

# %%
# S11 in every beam becomes a volume of range, azimuth and elevation. The wall is a plane in this volume, of any tilt;
# echoes behind the plane were seen by way of the wall.

reconstruction = mf.reconstruct(sweep)
figure = mf.plot_volume.space(reconstruction, scene)

# %%
# The red outline is the true wall. Orange points were seen by way of it, and are drawn where they really stand: to the
# left, beside the radar's field of view.

figure = mf.plot_volume.body(reconstruction)

# %%
# The body as it looks from the wall: its outline, its limbs, and the L. In numbers:

score = mf.score(reconstruction, scene)
body = score["surfaces"]["mannequin"]
print(f"folded points to the body: {1e3 * body['accuracy_m']:.1f} mm in the mean")
print(f"foil over its surroundings: {score['patches']['foil']['contrast_db']:.1f} dB")

# %%
# `mf.export(reconstruction, "body.ply")` writes the points for other programs.
