"""The pictures of curved.md and transparent.md: what a pillar and a glass door show, before and after folding.

python docs/pictures/mirrors.py
"""

from importlib.resources import files
from pathlib import Path

import mirrorfold as mf

HERE = Path(__file__).parent

SCENES = {"curved": "pillar", "transparent": "glass-door"}


def main() -> None:
    """Simulate, reconstruct and draw the shipped scenes."""
    for picture, name in SCENES.items():
        scene = mf.load_scene(files("mirrorfold") / f"scenes/shipped/{name}.toml")
        reconstruction = mf.reconstruct(mf.simulate(scene))
        mf.plot.before_after(reconstruction, scene=scene).savefig(HERE / f"{picture}.png", dpi=90)


if __name__ == "__main__":
    main()
