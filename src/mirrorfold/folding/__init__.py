"""Steps 5 and 6 of the algorithm: every ghost is moved back to its true place, and the folded scene is collected."""

from typing import TYPE_CHECKING

from mirrorfold.common.lazy import lazy

if TYPE_CHECKING:
    from mirrorfold.folding.collection import collect
    from mirrorfold.folding.points import Points, fold_back
    from mirrorfold.folding.settings import PRESETS, FoldSettings

__all__ = ["PRESETS", "FoldSettings", "Points", "collect", "fold_back"]

# Settings can be read without the compiled kernels of other modules.
__getattr__, __dir__ = lazy(
    __name__, {"collection": ("collect",), "points": ("Points", "fold_back"), "settings": ("PRESETS", "FoldSettings")}
)
