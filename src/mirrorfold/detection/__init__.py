"""Step 2 of the algorithm: the radar's own view, its echoes, and the mirrors among them."""

from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import find_echoes, find_mirrors, see, usual_settings
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import Fold, Mirror, any_curved, fold_of
from mirrorfold.detection.mirrors.round_mirror import RoundMirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.detection.views.volume_view import VolumeView

__all__ = [
    "ArcMirror",
    "Echoes",
    "Fold",
    "ImageView",
    "LineMirror",
    "Mirror",
    "RoundMirror",
    "View",
    "VolumeView",
    "any_curved",
    "find_echoes",
    "find_mirrors",
    "fold_of",
    "see",
    "usual_settings",
]
