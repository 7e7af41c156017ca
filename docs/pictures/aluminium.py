"""The picture of the page on a measured mirror: an ultrasonic array on a block of aluminium.

    python docs/pictures/aluminium.py contact_notch_aluminium.mat

The file is one of the examples of arim (https://github.com/ndtatbristol/arim, MIT licence).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mirrorfold as mf

PICTURE = Path(__file__).with_suffix(".png")

EXTENT = -22e-3, 27e-3, -1e-3, 93e-3
"""What is shown, (x0, x1, y0, y1) [m]."""

SEEN = (
    ("notch", (6.7, 19.6), (-13.0, 15.0)),
    ("back wall", (-4.0, 40.8), (-15.0, 35.0)),
    ("its copy", (-5.0, 46.0), (-15.0, 49.0)),
    ("notch, in the wall", (6.8, 59.1), (-12.0, 64.0)),
    ("array, in the wall", (-3.0, 80.1), (-14.0, 74.5)),
    ("its copy", (-3.0, 85.4), (-15.0, 89.0)),
)
"""Names of echoes, where they stand and where the name does, before folding [mm]."""

FOUND = (
    ("from above", (6.7, 19.6), (-11.0, 15.0)),
    ("and from below", (6.8, 22.5), (-10.0, 27.0)),
    ("back wall", (-4.0, 40.8), (-15.0, 46.0)),
)
"""The same after folding."""


def main(path: str) -> None:
    """Reconstruct the file and write the picture beside this one."""
    found = mf.reconstruct(mf.load(path))
    figure = Figure(figsize=(9.0, 8.2), layout="constrained")
    before, after = figure.subplots(1, 2, sharey=True)
    mf.plot.image(found["initial"].dataset["initial"], before, normalization="none", extent=EXTENT, colorbar=False)
    mf.plot.mirrors(found, before)
    mf.plot.corrected(found, after, extent=EXTENT, colorbar=True)
    for ax, names, title in ((before, SEEN, "as measured"), (after, FOUND, "folded")):
        for name, place, text in names:
            arrow = {"arrowstyle": "-", "color": "0.4", "linewidth": 0.8}
            ax.annotate(name, np.multiply(place, 1e-3), np.multiply(text, 1e-3), ha="center", va="center",
                        fontsize=9, arrowprops=arrow)  # fmt: skip
        ax.set(xlim=EXTENT[:2], ylim=EXTENT[2:], title=title)
    after.set_ylabel("")
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main(sys.argv[1])
