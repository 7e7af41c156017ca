"""
Design a radar
==============

How many elements, how far apart, how many frequencies? Before anything is bought or measured, `mf.plan` answers what a
measurement will show: what can be resolved, how mirror-like the walls are, how many bounces stay above the noise, how
long it takes.
"""

import matplotlib.pyplot as plt

import mirrorfold as mf
from mirrorfold.plotting import planning as plot_plan

ROUGHNESS = (50e-6, 200e-6)
plan = mf.plan(
    band=(270e9, 300e9),
    points=1001,
    aperture=0.08,
    pitch=0.5e-3,
    range=3.0,
    materials=["plasterboard"],
    roughness=ROUGHNESS,
)
for name in ("range_resolution_m", "ambiguous_range_m", "bounces_above_noise", "bounces_unambiguous", "data_megabytes"):
    print(f"{name:22} {plan[name]:.4g}")
figure = plot_plan.plan(plan, roughness=ROUGHNESS)

# %%
# Which limit comes first: the noise, or the ambiguous range? Each mirror at 45 degrees takes a share of the power
# twice, on the way out and on the way back. Its material decides how many bounces stay above the noise.

figure, axes = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
for material, colour in zip(("pec", "concrete", "plasterboard"), ("#0072b2", "#d55e00", "#009e73"), strict=True):
    found = mf.plan(
        band=(270e9, 300e9),
        points=1001,
        aperture=0.08,
        pitch=0.5e-3,
        range=3.0,
        materials=[material],
        roughness=ROUGHNESS,
    )
    budget = found["link_budget"][:6]
    axes.plot([row["bounces"] for row in budget], [row["snr_db"] for row in budget], "o-", color=colour, label=material)
axes.axhline(13.0, color="black", linewidth=0.8, linestyle="--", label="needed to be seen")
axes.set(xlabel="mirrors on each way", ylabel="signal over noise in the image [dB]", ylim=(-30, 95))
axes.grid(alpha=0.3)
axes.legend(frameon=False)

# %%
# Echoes of many bounces also come late. If they come later than the frequency step allows, they wrap around and appear
# in the middle of the room. More frequencies cost nothing but time:

print("frequencies   ambiguous range   bounces   time to measure")
for points in (501, 1001, 2001, 4001):
    found = mf.plan(band=(270e9, 300e9), points=points, aperture=0.08, pitch=0.5e-3, range=3.0, roughness=ROUGHNESS)
    minutes = found["measuring_s"] / 60
    print(f"{points:11d} {found['ambiguous_range_m']:15.2f} m {found['bounces']!s:>9} {minutes:13.0f} min")

# %%
# The same on the command line:
#
# .. code-block:: console
#
#     $ mirrorfold plan --band 270e9:300e9 --points 1001 --aperture 0.08 --pitch 0.5e-3 --range 3 -o plan.png
