"""How the gallery collects the figures of an example: those of pyplot, and those that it only holds in a variable."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.animation import Animation
from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

DPI = 110
FRAMES_PER_SECOND = 15

_SHOWN = "_figures_shown"


def figure_scraper(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save every figure and animation that a block of an example has made, once."""
    variables = block_vars["example_globals"]
    shown = variables.setdefault(_SHOWN, [])
    values = [*variables.values()]
    animations = [value for value in values if isinstance(value, Animation)]
    figures = [plt.figure(number) for number in plt.get_fignums()]
    figures += [value for value in values if isinstance(value, Figure) and value not in figures]
    animated = [animation._fig for animation in animations]
    paths = []
    for thing in [*animations, *(figure for figure in figures if figure not in animated)]:
        if any(thing is other for other in shown):
            continue
        shown.append(thing)
        path = next(block_vars["image_path_iterator"])
        if isinstance(thing, Animation):
            path = path.removesuffix(".png") + ".webp"
            thing.save(path, writer="pillow", fps=FRAMES_PER_SECOND, dpi=DPI)
        else:
            thing.savefig(path, dpi=DPI, bbox_inches="tight", facecolor="white")
        paths.append(path)
    plt.close("all")
    return figure_rst(paths, gallery_conf["src_dir"])
