"""Steps 5 and 6 of the algorithm: every ghost back to its true place, and the folded scene."""

from mirrorfold.folding.collection import collect
from mirrorfold.folding.fold_back import Points, fold_back
from mirrorfold.folding.settings import PRESETS, FoldSettings

__all__ = ["PRESETS", "FoldSettings", "Points", "collect", "fold_back"]
