"""The picture of curved.md: a pillar shows what a screen hides, before and after folding.

python docs/pictures/curved.py
"""

from importlib.resources import files
from pathlib import Path

import mirrorfold as mf

HERE = Path(__file__).parent


def main() -> None:
    """Simulate, reconstruct and draw the shipped scene."""
    scene = mf.load_scene(files("mirrorfold") / "scenes/shipped/pillar.toml")
    reconstruction = mf.reconstruct(mf.simulate(scene))
    mf.plot.before_after(reconstruction, scene=scene).savefig(HERE / "curved.png", dpi=90)


if __name__ == "__main__":
    main()
