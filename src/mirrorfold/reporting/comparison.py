"""A comparison as one self-contained page without scripts: the figure, and its numbers as tables."""

from __future__ import annotations

import base64
import io
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from mirrorfold.describing.comparison import Comparison, compare
from mirrorfold.io.files import written_atomically
from mirrorfold.plotting import differences


def write_comparison(first: Any, second: Any, path: Path, *, names: tuple[str, str] | None = None) -> Path:
    """Write a page that compares two reconstructions, or two images.

    Parameters
    ----------
    first, second : xarray.DataTree or xarray.DataArray
    path : path
        The HTML file to write.
    names : two of str, optional
        What to call them; their titles by default.

    Raises
    ------
    InputError
        As `mirrorfold.compare`, or if the file cannot be written.
    """
    found = compare(first, second, names=names)
    picture = io.BytesIO()
    differences.compare(first, second, names=(found.first, found.second)).savefig(picture, format="png", dpi=150)
    page = comparison_page(found, picture.getvalue())
    with written_atomically(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


MIRRORS = {"first": "first", "second": "second", "angle_deg": "angle [deg]", "offset_m": "offset [m]"}
BENDS = {"first_radius_m": "first radius [m]", "second_radius_m": "second radius [m]", "sagitta_m": "sagitta [m]"}
"""Headings of the table of mirrors by the fields of `MirrorPair`; those of `BENDS` only where a mirror is curved."""


def comparison_page(found: Comparison, picture: bytes) -> str:
    """The page of a comparison as HTML, with its picture (PNG)."""
    title = f"{found.first} and {found.second}"
    parts = [_table("levels, second over first", ("", ""), _rows(found.levels))]
    if "points" in found:
        parts.append(_table("points", ("", ""), _rows(found.points)))
        names = dict(MIRRORS)
        if any("sagitta_m" in pair for pair in found.mirrors):
            names |= BENDS
        rows = [[_text(pair.get(name)) for name in names] for pair in found.mirrors]
        parts.append(_table("mirrors", tuple(names.values()), rows))
    notes = "".join(f'<p class="notice">{escape(sentence)}</p>' for sentence in found.remarks)
    image = base64.b64encode(picture).decode("ascii")
    style = files("mirrorfold.reporting").joinpath("assets", "page.css").read_text(encoding="utf-8")
    style += "\nimg { max-width: 100%; height: auto; background: #fff; }\ntable { margin: 8px 0; }"
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<title>{escape(title)}</title>
<style>{style}</style>
</head>
<body><div id="page">
<header><div><h1>{escape(title)}</h1><p class="lead">two {escape(found.compared)} side by side</p></div></header>
{notes}
<div class="card"><img alt="both results, and what differs between them" src="data:image/png;base64,{image}"></div>
{"".join(parts)}
</div></body>
</html>
"""


def _rows(record: Any) -> list[list[str]]:
    """Names and values of a record as rows of a table."""
    return [[name.removesuffix("_db").replace("_", " "), _text(value)] for name, value in record.items()]


def _text(value: Any) -> str:
    """A value as a text of a table."""
    return "-" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def _table(title: str, headings: tuple[str, ...], rows: list[list[str]]) -> str:
    """A table with a title as HTML; without a row of headings where all are empty."""
    head = "".join(f"<th>{escape(text)}</th>" for text in headings) if any(headings) else ""
    body = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows)
    return f'<div class="card"><h2>{escape(title)}</h2><table><tr>{head}</tr>{body}</table></div>'
