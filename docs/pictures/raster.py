"""Draw the pictures of docs/raster.md, beside this file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import mirrorfold as mf
from mirrorfold.plotting import volumes as plot_volume

HERE = Path(__file__).resolve().parent
DPI = 80


def main() -> None:
    """Simulate the shipped scenes, fold them and draw."""
    for name in ("drywall-mannequin", "drywall-control", "corridor"):
        scene = mf.load_scene(Path(str(files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml"))))
        result = mf.reconstruct(mf.simulate(scene, snr_db=20.0))
        plot_volume.body(result, scene).savefig(HERE / f"raster-{name}-body.png", dpi=DPI)
        if name != "drywall-control":
            mf.plot.before_after(result, scene).savefig(HERE / f"raster-{name}-plan.png", dpi=DPI)
            plot_volume.space(result, scene).savefig(HERE / f"raster-{name}-space.png", dpi=DPI)


if __name__ == "__main__":
    main()
