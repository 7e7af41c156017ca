"""
A first fold
============

A corner and a curved screen stand behind a partition, out of the radar's sight. A wall on the left shows them. We
simulate what the radar measures, and fold what it sees back to where it stands.
"""

from importlib.resources import files

import mirrorfold as mf

# %%
# The scene comes along. Its file is also the truth that the result will be compared with; nothing on the way there
# looks at it.

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "hidden_corner.toml"))
sweep = mf.simulate(scene, snr_db=20.0, seed=1)
print(sweep["s"].sizes)

# %%
# A sweep is an xarray dataset: 401 frequencies, 161 transmitters, 161 receivers. What can it resolve?

facts = mf.info(sweep)
for name in ("range_resolution_m", "ambiguous_range_m", "field_of_view_deg", "snr_db"):
    print(f"{name:22} {facts[name]:.3g}")

# %%
# From here on everything happens in one call: focusing, mirrors, the tree of who is seen through whom, folding.

reconstruction = mf.reconstruct(sweep)
figure = mf.plot.before_after(reconstruction, scene)

# %%
# On the left the initial image. The numbered lines are the mirrors that were found; what lies in the shaded area behind
# a mirror was seen by way of it. On the right it has been folded back. The thin red line is the truth, which the
# algorithm has never seen.

score = mf.score(reconstruction, scene)
for mirror in score["mirrors"]:
    print(
        f"{mirror['surface']:10} generation {mirror['generation']}: "
        f"{mirror['angle_error_deg']:.3f} degrees, {mirror['offset_error_mm']:.2f} mm off"
    )
print(f"hidden surfaces: {score['hidden']['completeness_2cm']:.0%} covered within 2 cm")

# %%
# Every folded point knows where it stood before, by way of which mirrors it was seen, and how sure that is.

objects = reconstruction["objects"].to_dataset(inherit=False)
print(objects[["x_initial", "y_initial", "bounces", "chain", "confidence"]].to_dataframe().tail(4).round(3))
