"""Steps 5 and 6 of the algorithm: every ghost is moved back to its true place, and the folded scene is collected."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mirrorfold.folding.collection import collect
    from mirrorfold.folding.points import Points, fold_back
    from mirrorfold.folding.settings import PRESETS, FoldSettings

_HOME = {
    "PRESETS": "settings",
    "FoldSettings": "settings",
    "Points": "points",
    "collect": "collection",
    "fold_back": "points",
}
"""The module of each name: imported when first asked for, so that settings can be read without compiled kernels."""

__all__ = ["PRESETS", "FoldSettings", "Points", "collect", "fold_back"]


def __getattr__(name: str) -> Any:
    """Import the module of a public name when the name is first used."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
