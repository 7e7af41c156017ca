"""
The published algorithm, and what was added
===========================================

`preset="published"` runs the algorithm as Cui and Trichopoulos published it in 2024. The default adds tests that a real
scene needs. Where do the results differ?
"""

from dataclasses import replace
from importlib.resources import files

import matplotlib.pyplot as plt

import mirrorfold as mf

scene = mf.load_scene(str(files("mirrorfold") / "scenes" / "shipped" / "hidden_corner.toml"))
scene = replace(scene, array=replace(scene.array, elements=121), band=replace(scene.band, points=301))
sweep = mf.add_noise(mf.simulate(scene), snr_db=0.0, seed=3)

# %%
# In every single sample, the noise is as strong as the signal; but focusing adds up four million samples.

image = mf.focus(sweep, tolerance=1e-3)
presets = ("published", "default")
results = {preset: mf.fold(image, sweep=sweep, preset=preset) for preset in presets}

EXTENT = (-1.3, 1.4, -0.1, 2.8)
figure, panels = plt.subplots(1, 2, figsize=(11.5, 5.6), sharey=True, layout="constrained")
for axes, preset in zip(panels, presets, strict=True):
    mf.plot.corrected(results[preset], axes, extent=EXTENT, colorbar=False)
    mf.plot.scene(scene, axes)
    axes.set(title=f'preset="{preset}"', xlim=EXTENT[:2], ylim=EXTENT[2:])

# %%
# The dots are folded points, coloured by bounces; the thin red line is the truth. In numbers:

print(f"{'':34}{'published':>12}{'default':>12}")
scores = {preset: mf.score(result, scene) for preset, result in results.items()}
for label, name in (
    ("within 2 cm of the truth", "precision_2cm"),
    ("hidden surfaces covered", "completeness_2cm"),
    ("far from any surface", "invented_fraction"),
):
    values = [
        scores[preset]["hidden"][name] if name == "completeness_2cm" else scores[preset][name] for preset in presets
    ]
    print(f"{label:34}{values[0]:12.1%}{values[1]:12.1%}")
for preset in presets:
    firsts = [mirror for mirror in scores[preset]["mirrors"] if mirror["generation"] == 1 and mirror["surface"]]
    worst = max((mirror["angle_error_deg"] for mirror in firsts), default=float("nan"))
    print(f"{preset}: {len(firsts)} walls, the worst {worst:.3f} degrees off")
