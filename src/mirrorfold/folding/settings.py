"""Everything that can be chosen about finding mirrors and folding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from mirrorfold.common.settings import Settings, setting

MOST_DB = 300.0
"""Limit of all levels [dB]: 15 decades of amplitude, twice what complex64 samples resolve."""


@dataclass(frozen=True)
class FoldSettings(Settings):
    """Settings of steps 2 to 6; those that are None are chosen from the image, see `completed`."""

    normalization: str | None = setting(
        None,
        "How the spreading with range is undone before anything is judged: r for images, as line sources spread there "
        "and back; beam for volumes whose beam is known, else r2.",
        choices=("none", "r", "r2", "beam"),
    )
    threshold_db: float | None = setting(
        None,
        "Level that echoes must exceed, relative to a robust reference echo; with the published preset to the "
        "brightest pixel. By default -18 for images, -26 for volumes.",
        unit="dB",
        lowest=-MOST_DB,
        highest=MOST_DB,
    )
    minimum_length: float | None = setting(
        None,
        "Shortest mirror; in a volume its least width and height. By default 7.75 resolution cells of the nearest "
        "echoes in images, five where what stands behind outshines the mirror, 7.5 of the middle ones in volumes. A "
        "mirror that faces an array at least 4.4 cells long may be as short as nine tenths of the array.",
        unit="m",
        lowest=1e-9,
    )
    wall_margin: float | None = setting(
        None,
        "How far behind a mirror echoes still belong to the wall. By default as deep as waves go into a wall, 40 "
        "wavelengths, or 1.25 resolution cells if that is less.",
        unit="m",
        lowest=0.0,
    )
    generations: int | None = setting(
        None,
        "Largest number of mirrors in a chain, any number by default. Deeper ones count as objects, and hide what they "
        "show; with 0 the scene stays unfolded.",
        lowest=0,
        highest=1000,
    )
    opaque: bool = setting(
        True,
        "Whether objects hide what is behind them. Where mirrors are given, only what is seen behind the same mirrors; "
        "all that is not folded stays where the image shows it.",
        label="objects are opaque",
    )
    min_confidence: float = setting(
        0.5,
        "Least confidence of points that are drawn, scored and exported; the others stay in the file.",
        lowest=0.0,
        highest=1.0,
    )
    copies: bool = setting(
        True,
        "Whether, where the sweep is at hand, an echo is left out if most strong echoes have such a weaker one behind "
        "them at the same delay: a copy that the tail of the pulse makes, or a layer in the wall of a mirror.",
        label="copies are left out",
    )
    rough_walls: bool = setting(
        True,
        "Whether, in images, echoes behind a mirror are left out that its rough wall may have made: it scatters waves "
        "towards another wall or a bright object, from where they come back by the same way or by mirrors.",
        label="twice scattered echoes are left out",
    )
    close_gaps: bool = setting(
        True,
        "Whether, in images, surfaces go on between neighbouring echoes up to three resolution cells apart where the "
        "image is not dark.",
        label="gaps in surfaces are closed",
    )
    curved: bool = setting(
        True,
        "Whether arcs, in volumes cylinders and spheres, are mirrors where the image shows behind them what an opaque "
        "object cannot.",
        label="curved mirrors",
    )
    transparent: bool = setting(
        True,
        "Whether echoes behind a wall may have passed through it: told by two polarizations, guessed from geometry "
        "with one.",
        label="half-transparent walls",
    )
    published: bool = setting(
        False,
        "Whether every pixel above the threshold counts, and every row of them that is long enough is a mirror.",
        option=False,
    )

    def completed(self, **usual: Any) -> FoldSettings:
        """The same settings, with values of `usual` in place of those that are None."""
        return replace(self, **{name: value for name, value in usual.items() if getattr(self, name) is None})


PRESETS = {
    "default": FoldSettings(),
    "published": FoldSettings(
        normalization="r2",
        threshold_db=-30.0,
        wall_margin=0.0,
        opaque=False,
        copies=False,
        rough_walls=False,
        close_gaps=False,
        curved=False,
        transparent=False,
        min_confidence=0.0,
        published=True,
    ),
}
"""`published` is the algorithm of Cui and Trichopoulos (2024), for comparison."""
