"""Pictures of sweeps, images, reconstructions, scenes, scores and plans; ``mf.plot`` is this package."""

from typing import TYPE_CHECKING

from mirrorfold.common.lazy import lazy

if TYPE_CHECKING:
    from mirrorfold.plotting.benchmarks import benchmark, benchmark_comparison
    from mirrorfold.plotting.comparison import before_after, content_extent
    from mirrorfold.plotting.differences import compare
    from mirrorfold.plotting.figures import corrected, image, mirrors, plan, scene, shadows
    from mirrorfold.plotting.measurements import channel_map, range_profile, score, sweep, tree
    from mirrorfold.plotting.recordings import frames

__all__ = [
    "before_after",
    "benchmark",
    "benchmark_comparison",
    "channel_map",
    "compare",
    "content_extent",
    "corrected",
    "frames",
    "image",
    "mirrors",
    "plan",
    "range_profile",
    "scene",
    "score",
    "shadows",
    "sweep",
    "tree",
]

# One figure does not load the code of all.
__getattr__, __dir__ = lazy(
    __name__,
    {
        "benchmarks": ("benchmark", "benchmark_comparison"),
        "comparison": ("before_after", "content_extent"),
        "differences": ("compare",),
        "figures": ("corrected", "image", "mirrors", "plan", "scene", "shadows"),
        "measurements": ("channel_map", "range_profile", "score", "sweep", "tree"),
        "recordings": ("frames",),
    },
)
