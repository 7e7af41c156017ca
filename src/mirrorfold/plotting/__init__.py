"""Pictures of sweeps, images, reconstructions, scenes, scores and plans; ``mf.plot`` is this package."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mirrorfold.plotting.benchmarks import benchmark, benchmark_comparison
    from mirrorfold.plotting.comparison import before_after, content_extent
    from mirrorfold.plotting.differences import compare
    from mirrorfold.plotting.figures import corrected, image, mirrors, plan, scene, shadows
    from mirrorfold.plotting.measurements import channel_map, range_profile, score, sweep, tree
    from mirrorfold.plotting.recordings import frames

_HOME = {
    "before_after": "comparison",
    "benchmark": "benchmarks",
    "benchmark_comparison": "benchmarks",
    "channel_map": "measurements",
    "compare": "differences",
    "content_extent": "comparison",
    "corrected": "figures",
    "frames": "recordings",
    "image": "figures",
    "mirrors": "figures",
    "plan": "figures",
    "range_profile": "measurements",
    "scene": "figures",
    "score": "measurements",
    "shadows": "figures",
    "sweep": "measurements",
    "tree": "measurements",
}
"""The module of each function. It is imported at first use, so that one figure does not load the code of all."""

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


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'mirrorfold.plotting' has no attribute {name!r}")
    value = getattr(import_module(f"mirrorfold.plotting.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
