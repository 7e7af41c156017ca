"""Draw the pictures of docs/raster.md, beside this file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import mirrorfold as mf
from mirrorfold.plotting import volumes as plot_volume
from mirrorfold.scenes.families import draw

HERE = Path(__file__).resolve().parent
DPI = 80


def main() -> None:
    """Simulate the shipped scenes, fold them and draw."""
    for name in ("drywall-mannequin", "drywall-control", "corridor"):
        scene = mf.load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml"))))
        result = mf.reconstruct(mf.simulate(scene, snr_db=20.0))
        if name == "corridor":
            mf.plot.before_after(result, scene).savefig(HERE / f"raster-{name}-plan.png", dpi=DPI)
            plot_volume.space(result, scene).savefig(HERE / f"raster-{name}-space.png", dpi=DPI)
        else:
            plot_volume.body(result, scene).savefig(HERE / f"raster-{name}-body.png", dpi=DPI)
    studs()


def studs() -> None:
    """A board of drywall on studs, which shows one thing and lets another be seen."""
    scene = draw("raster studs", 0)
    result = mf.reconstruct(mf.simulate(scene, snr_db=20.0))
    mf.plot.before_after(result, scene).savefig(HERE / "raster-studs-plan.png", dpi=DPI)


if __name__ == "__main__":
    main()
