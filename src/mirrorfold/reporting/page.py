"""The page of a reconstruction: one HTML file that contains its style, its program and its content."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html import escape
from importlib.resources import files
from typing import Any

from mirrorfold.common.records import finite

STYLES = ("page.css",)
PROGRAMS = ("basics.js", "sight.js", "maps.js", "tree.js", "tables.js", "space.js")
MAIN, LIVE = "main.js", "live.js"


def to_html(document: dict[str, Any], *, title: str, live: dict[str, Any] | None = None) -> str:
    """The whole page as HTML.

    Everything that comes from files is in one JSON element, without any character that has a meaning in HTML, and is
    inserted into the page as text. By its content security policy the page runs no program but its own, and opens no
    connection; only a live page may call the server that it came from.

    Parameters
    ----------
    document : dict
        What `to_document` returns.
    title : str
    live : dict, optional
        For the live page: the token of the server, and the name of the header that carries it.

    Returns
    -------
    str
    """
    style = "\n".join(_asset(name) for name in STYLES)
    names = (*PROGRAMS, *((LIVE,) if live is not None else ()), MAIN)
    program = '"use strict";\n(() => {\n' + "\n".join(_asset(name) for name in names) + "\n})();\n"
    policy = "; ".join(
        (
            "default-src 'none'",
            "img-src data: blob:",
            f"style-src '{_hash(style)}'",
            f"script-src '{_hash(program)}'",
            "connect-src 'none'" if live is None else "connect-src 'self'",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
    parts = {
        "policy": escape(policy),
        "title": escape(title),
        "style": style,
        "content": to_json(document),
        "live": to_json(live),
        "program": program,
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: parts[mark[1]], _asset("page.html"))


def to_json(content: Any) -> str:
    """JSON that is safe inside a script element: in ASCII, with <, > and & as escapes."""
    text = json.dumps(finite(content), ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _asset(name: str) -> str:
    """Content of a file in `assets`."""
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8").strip("\n")


def _hash(text: str) -> str:
    """The hash by which a content security policy allows an inline element."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
