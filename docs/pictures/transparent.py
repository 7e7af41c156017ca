"""The picture of transparent.md: a glass door shows what stands on both sides of it, before and after folding.

python docs/pictures/transparent.py
"""

from importlib.resources import files
from pathlib import Path

import mirrorfold as mf

HERE = Path(__file__).parent


def main() -> None:
    """Simulate, reconstruct and draw the shipped scene."""
    scene = mf.load_scene(files("mirrorfold") / "scenes/shipped/glass-door.toml")
    reconstruction = mf.reconstruct(mf.simulate(scene))
    mf.plot.before_after(reconstruction, scene=scene).savefig(HERE / "transparent.png", dpi=90)


if __name__ == "__main__":
    main()
