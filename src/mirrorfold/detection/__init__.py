"""Step 2 of the algorithm: the radar's own view, its echoes, and the mirrors among them."""

from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import find_echoes, find_mirrors, see, usual_settings
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.view import View

__all__ = ["Echoes", "Mirror", "View", "find_echoes", "find_mirrors", "see", "usual_settings"]
