"""
A first fold
============

A corner and a curved screen stand behind a partition, out of the radar's sight. A wall on the left reflects them. We
simulate what the radar measures, and fold the ghosts back to where the objects stand.
"""

from importlib.resources import files

import mirrorfold as mf

# %%
# The scene comes with the package. Its file is also the truth with which the result will be compared; focusing and
# folding do not use it.

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "hidden_corner.toml"))
sweep = mf.simulate(scene, snr_db=20.0, seed=1)
print(sweep["s"].sizes)

# %%
# A sweep is an xarray dataset: 401 frequencies, 161 transmitters, 161 receivers. What can it resolve?

facts = mf.info(sweep)
for name in ("range_resolution_m", "ambiguous_range_m", "field_of_view_deg", "snr_db"):
    print(f"{name:22} {facts[name]:.3g}")

# %%
# From here on everything happens in one call: focusing, finding mirrors, ordering them in a tree (which mirror is seen
# by way of which), and folding.

reconstruction = mf.reconstruct(sweep)
figure = mf.plot.before_after(reconstruction, scene)

# %%
# On the left is the initial image. The numbered lines are the mirrors that were found; echoes in the shaded area behind
# a mirror were seen by way of it. On the right they are folded back. The thin red line is the truth, which the
# algorithm does not know.

score = mf.score(reconstruction, scene)
for mirror in score["mirrors"]:
    print(
        f"{mirror['surface']:10} generation {mirror['generation']}: "
        f"{mirror['angle_error_deg']:.3f} degrees, {mirror['offset_error_mm']:.2f} mm off"
    )
print(f"hidden surfaces: {score['hidden']['completeness_2cm']:.0%} covered within 2 cm")

# %%
# The table of points holds, for each point, its place before folding, the number of bounces, the chain of mirrors by
# way of which it was seen, and its confidence.

objects = reconstruction["objects"].to_dataset(inherit=False)
print(objects[["x_initial", "y_initial", "bounces", "chain", "confidence"]].to_dataframe().tail(4).round(3))
