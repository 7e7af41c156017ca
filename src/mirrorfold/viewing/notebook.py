"""How a notebook shows a Reconstruction: a small picture and facts. Other trees are shown as xarray shows them.

A Reconstruction is an `xarray.DataTree` without a class of its own, so it cannot have a method that shows it. But
IPython looks for a formatter by the type of an object: ``import mirrorfold`` registers one where IPython runs, and
``%load_ext mirrorfold`` does so at any later time.
"""

from __future__ import annotations

import base64
import io
from html import escape

import xarray as xr

from mirrorfold.common.svg import card

DOTS_PER_INCH = 72
"""Resolution of the picture, low enough for a notebook of many cells."""


def to_html(tree: xr.DataTree) -> str:
    """A reconstruction as HTML; any other tree as xarray represents it.

    Parameters
    ----------
    tree : xarray.DataTree

    Returns
    -------
    str
    """
    if tree.attrs.get("mirrorfold_kind") != "reconstruction" or tree.parent is not None:
        return _plain(tree)
    from mirrorfold.describing.rows import found_rows, mirror_rows
    from mirrorfold.errors import InputError
    from mirrorfold.io.own.checks import check_reconstruction
    from mirrorfold.reporting.document import title_of

    try:
        checked = check_reconstruction(tree)
    except InputError:  # an incomplete reconstruction
        return _plain(tree)
    mirrors = mirror_rows(checked)
    facts = [(row[0], row[1]) for row in found_rows(checked.children["objects"].to_dataset(inherit=False), mirrors)]
    for mirror in mirrors[:LONGEST_LIST]:
        seen = "radar" if mirror["parent"] < 0 else f"mirror {mirror['parent']}"
        facts.append((f"mirror {mirror['number']}", f"{mirror['length']:.2f} m, seen through {seen}"))
    if len(mirrors) > LONGEST_LIST:
        facts.append(("", f"and {len(mirrors) - LONGEST_LIST} more"))
    if checked.attrs.get("remark"):
        facts.append(("remark", str(checked.attrs["remark"])))
    return card(title_of(checked), _picture(checked), facts)


LONGEST_LIST = 8
"""Largest number of mirrors that are listed; of the others, only their number is told."""


def _plain(tree: xr.DataTree) -> str:
    """The tree as HTML by xarray, or as its text where this fails, for a group whose coordinates hide the root's."""
    try:
        return str(tree._repr_html_())
    except ValueError:
        return f"<pre>{escape(str(tree.to_dataset(inherit=False)))}</pre>"


def _picture(reconstruction: xr.DataTree) -> str:
    """The picture before and after folding, as an image element of HTML."""
    import mirrorfold.plotting as plot

    content = io.BytesIO()
    plot.before_after(reconstruction).savefig(content, format="png", dpi=DOTS_PER_INCH)
    data = base64.b64encode(content.getvalue()).decode("ascii")
    words = "the initial image with its mirrors, and the corrected scene"
    return f'<img src="data:image/png;base64,{data}" alt="{words}" style="max-width:100%">'
