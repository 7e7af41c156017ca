"""Small pictures and tables for notebooks, as plain SVG and HTML; every text from outside is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.decibels import COLOURS
from mirrorfold.common.types import Array

WIDTH, HEIGHT = 320, 260
"""Size of a picture [pixels]."""

MARGIN = 14
"""Margin around what is drawn [pixels]."""

LARGEST_CLOUD = 1500
"""Largest number of dots of one stroke in a picture: more would only make the notebook large."""


@dataclass(frozen=True, eq=False)
class Stroke:
    """A polyline or a set of dots.

    Attributes
    ----------
    points : (n, 2) array [m]
    colour : str
    width : float [pixels]
        Width of the line, or of the dots.
    dots : bool
        Whether to draw dots rather than a line.
    label : str
        Text shown when the mouse is over it.
    """

    points: Array
    colour: str
    width: float = 2.0
    dots: bool = False
    label: str = ""


def picture(strokes: Iterable[Stroke], radar: ArrayLike, *, title: str) -> str:
    """A floor plan as SVG: x to the right, y upwards, the radar as a triangle, and a scale bar.

    Parameters
    ----------
    strokes : list of Stroke
    radar : (2,) [m]
    title : str
        Text for readers who cannot see the picture.
    """
    strokes = list(strokes)
    station = np.asarray(radar, dtype=float)[:2]
    everything = np.concatenate([station[None], *(stroke.points for stroke in strokes if len(stroke.points))])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = np.maximum(high - low, 1e-3)
    scale = float(min((WIDTH - 2 * MARGIN) / size[0], (HEIGHT - 2 * MARGIN) / size[1]))
    middle = 0.5 * (low + high)

    def place(points: Array) -> Array:
        offset = (points - middle) * scale
        return np.stack([WIDTH / 2 + offset[..., 0], HEIGHT / 2 - offset[..., 1]], axis=-1)

    parts = []
    for stroke in strokes:
        label = f"<title>{escape(stroke.label)}</title>" if stroke.label else ""
        colour = escape(stroke.colour, quote=True)
        if stroke.dots:
            chosen = stroke.points[:: max(1, -(-len(stroke.points) // LARGEST_CLOUD))]
            path = "".join(f"M{x:.1f},{y:.1f}h0" for x, y in place(chosen))
        else:
            path = "M" + "L".join(f"{x:.1f},{y:.1f}" for x, y in place(stroke.points))
        parts.append(
            f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{stroke.width:g}" '
            f'stroke-linecap="round" stroke-linejoin="round">{label}</path>'
        )
    x, y = place(station)
    parts.append(f'<path d="M{x - 6:.1f},{y + 5:.1f}h12l-6,-11z" fill="currentColor"><title>radar</title></path>')
    bar = max(step for step in _STEPS if step * scale <= 0.4 * WIDTH)
    text = f"{bar:g} m" if bar >= 1.0 else f"{100 * bar:g} cm" if bar >= 0.01 else f"{1000 * bar:g} mm"
    end = WIDTH - MARGIN
    parts.append(
        f'<path d="M{end},{HEIGHT - 6}h{-bar * scale:.1f}" stroke="currentColor" stroke-width="2"/>'
        f'<text x="{end}" y="{HEIGHT - 11}" text-anchor="end" font-size="11" fill="currentColor">{text}</text>'
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'role="img" aria-label="{escape(title, quote=True)}">{"".join(parts)}</svg>'
    )


def card(title: str, drawing: str, facts: Sequence[tuple[str, str]]) -> str:
    """HTML of a title, a drawing (HTML or SVG) and a table of facts."""
    rows = "".join(
        f'<tr><td style="text-align:left;opacity:.7;padding:1px 12px 1px 0">{escape(name)}</td>'
        f'<td style="text-align:left;padding:1px 0">{escape(value)}</td></tr>'
        for name, value in facts
    )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:24px;align-items:center;font-family:system-ui,sans-serif">'
        f"<div>{drawing}</div>"
        f'<div><strong style="font-size:1.1em">{escape(title)}</strong>'
        f'<table style="margin:6px 0 0;border-collapse:collapse;font-size:.9em">{rows}</table></div></div>'
    )


def tree_card(root: Any) -> str:
    """HTML of a `MirrorTree`: mirrors and objects in the unfolded image, and which mirror is seen through which."""
    strokes, facts, position, range_ = [], [], [], []
    for node in root.walk():
        colours = [COLOURS[max(node.generation - 1 + k, 0) % len(COLOURS)] for k in (0, 1)]
        objects = node.objects.position
        strokes.append(Stroke(objects[:, :2], colours[1], 2.5, dots=True, label=f"seen through {node.name}"))
        size = ""
        if node.mirror is not None:
            ends = node.mirror.ends[:, :2]
            strokes.append(Stroke(ends, colours[0], 3.5, label=node.name))
            size = f"{node.mirror.size:.2f} m, "
        facts.append((f"{3 * node.generation * NO_BREAK}{node.name}", f"{size}{len(objects)} object echoes"))
        for echoes in (node.objects, node.face):
            position.append(echoes.position)
            range_.append(echoes.range)
    radar = _origin(np.concatenate(position), np.concatenate(range_))
    return card("Tree of mirrors", picture(strokes, radar, title="mirrors and objects of the unfolded image"), facts)


def _origin(position: Array, range_: Array) -> Array:
    """The place q (2,) of the radar, from positions p (n, d) and their ranges r (n,).

    The equations ``|p|^2 - r^2 = 2 p . q - |q|^2`` are linear in q and |q|^2. With too few positions, q is the origin.
    """
    if len(position) <= position.shape[1] + 1:
        return np.zeros(2)
    system = np.column_stack([2.0 * position, -np.ones(len(position))])
    return np.linalg.lstsq(system, np.sum(position**2, axis=1) - range_**2, rcond=None)[0][:2]


NO_BREAK = "\u00a0"
"""The no-break space, which indents entries of the table."""

_STEPS = [k * 10.0**e for e in range(-6, 7) for k in (1.0, 2.0, 5.0)]
"""Lengths that the scale bar may have [m]."""
