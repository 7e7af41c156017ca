"""The picture of gaps in folding.md: hidden things with the gaps in their surfaces open, and closed.

python docs/pictures/gaps.py
"""

from pathlib import Path

from matplotlib.figure import Figure

import mirrorfold as mf
from mirrorfold.scenes.families import draw

HERE = Path(__file__).parent

AROUND = (-0.8, -0.2, 1.7, 2.5)
"""Left, right, lower and upper edge of what is shown [m]."""


def main() -> None:
    """Simulate one random scene, fold it twice, and draw the points over the truth."""
    scene = draw("drywall", 72)
    sweep = mf.simulate(scene, snr_db=30.0)
    image = mf.focus(sweep)
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    for axes, closed in zip(figure.subplots(1, 2, sharex=True, sharey=True), (False, True), strict=True):
        objects = mf.fold(image, sweep=sweep, close_gaps=closed)["objects"].to_dataset(inherit=False)
        objects = objects.isel(point=(objects["confidence"] >= 0.5) & (objects["surface"] == "object"))
        for surface in scene.surface:
            axes.plot(*surface.sample(2e-3)[0].T, ".", color="0.8", markersize=1.0)
        for between, colour, label in ((False, "C0", "echoes"), (True, "C1", "in gaps")):
            some = objects.isel(point=objects["interpolated"] == between)
            axes.plot(some["x"], some["y"], ".", color=colour, label=label, markersize=5.0)
        axes.set(title="gaps closed" if closed else "gaps open", xlabel="x [m]", xlim=AROUND[:2], ylim=AROUND[2:])
        axes.set_aspect("equal")
    figure.axes[0].set_ylabel("y [m]")
    figure.axes[1].legend(loc="lower left")
    figure.savefig(HERE / "gaps.png", dpi=90)


if __name__ == "__main__":
    main()
