"""Pictures of sweeps, images, reconstructions, scenes, scores and plans; ``mf.plot`` is this package."""

from mirrorfold.plotting.comparison import before_after, content_extent
from mirrorfold.plotting.figures import corrected, image, mirrors, scene, shadows
from mirrorfold.plotting.measurements import channel_map, range_profile, score, sweep, tree

__all__ = [
    "before_after",
    "channel_map",
    "content_extent",
    "corrected",
    "image",
    "mirrors",
    "range_profile",
    "scene",
    "score",
    "shadows",
    "sweep",
    "tree",
]
