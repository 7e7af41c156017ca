"""Everything that can be chosen about finding mirrors and folding."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mirrorfold.common.settings import Settings, setting
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import minimum_length_of, threshold_of
from mirrorfold.detection.view import View

WALL_CELLS = 1.15
"""Echoes up to this many resolution cells behind a mirror leak from inside the wall: 4 cm where a cell measures 3.5.
Building materials scatter from 1 to 3 cm deep at 0.1 to 1 THz."""


@dataclass(frozen=True)
class FoldSettings(Settings):
    """Settings of steps 2 to 6; what is None is chosen by the kind of image."""

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
        kind="float",
        unit="dB",
    )
    minimum_length: float | None = setting(
        None,
        "Of a mirror; in a volume of its width and height. By default 7.2 resolution cells in images, 11.4 in "
        "volumes, at the typical range of the echoes.",
        kind="float",
        unit="m",
        above=0.0,
    )
    wall_margin: float | None = setting(
        None,
        "How far behind a mirror echoes still belong to the wall. By default 1.15 resolution cells.",
        kind="float",
        unit="m",
        lowest=0.0,
    )
    generations: int | None = setting(
        None,
        "Largest number of mirrors in a chain, any number by default. Deeper ones count as objects, and hide what they "
        "show; with 0 the scene stays unfolded.",
        kind="int",
        lowest=0,
        whole=True,
    )
    opaque: bool = setting(True, "Whether objects hide what is behind them.", kind="bool", option=False)
    published: bool = setting(
        False,
        "Whether every pixel above the threshold counts, and every row of them that is long enough is a mirror.",
        kind="bool",
        option=False,
    )

    def for_view(self, view: View, echoes: Echoes) -> FoldSettings:
        """The settings with what the image decides: its kind, and its resolution at the typical range of its echoes."""
        cell = float(view.cell(echoes.typical_range))
        return replace(
            self,
            normalization=view.normalization,
            threshold_db=threshold_of(view) if self.threshold_db is None else self.threshold_db,
            minimum_length=minimum_length_of(view, echoes) if self.minimum_length is None else self.minimum_length,
            wall_margin=WALL_CELLS * cell if self.wall_margin is None else self.wall_margin,
        )


PRESETS = {
    "default": FoldSettings(),
    "published": FoldSettings(normalization="r2", threshold_db=-30.0, wall_margin=0.0, opaque=False, published=True),
}
"""`published` is the algorithm of Cui and Trichopoulos (2024), for comparison."""
