"""The pictures of the page on what comes after: somebody walks around a corner, and two results are compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import parse_scene

HERE = Path(__file__).parent
FRAMES = 5
X, Y = np.arange(-0.9, 1.8, 0.01), np.arange(0.2, 2.7, 0.01)


def scene(frame: int):
    """A wall that shows a round body, out of sight behind a screen, which walks past it."""
    return parse_scene(
        {
            "name": "somebody walks",
            "array": {"kind": "linear", "elements": 61, "pitch": 0.5e-3},
            "band": {"start": 290e9, "stop": 300e9, "points": 201},
            "surface": [
                {"name": "wall", "kind": "segment", "start": [0.9, 0.9], "end": [0.25, 2.0],
                 "roughness": {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}},
                {"name": "body", "kind": "circle", "center": [-0.5 + 0.09 * frame, 1.25 + 0.04 * frame], "radius": 0.07,
                 "roughness": {"rms_height": 0.2e-3, "correlation_length": 0.2e-3}},
                {"name": "screen", "kind": "segment", "start": [-0.45, 0.6], "end": [0.02, 0.62],
                 "roughness": {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}},
            ],
        }
    )  # fmt: skip


def main() -> None:
    """Write both pictures beside this file."""
    sweeps = [mf.simulate(scene(frame), seed=0) for frame in range(FRAMES)]
    recording = sweeps[0].assign(s=xr.concat([sweep["s"] for sweep in sweeps], "frame"))
    result = mf.reconstruct(recording, x=X, y=Y)
    mf.plot.frames(result).figure.savefig(HERE / "onward-frames.png", dpi=110, bbox_inches="tight")
    first, last = mf.pick_frame(result, 0), mf.pick_frame(result, FRAMES - 1)
    figure = mf.plot.compare(first, last, names=("frame 0", f"frame {FRAMES - 1}"))
    figure.savefig(HERE / "onward-compare.png", dpi=110)


if __name__ == "__main__":
    main()
