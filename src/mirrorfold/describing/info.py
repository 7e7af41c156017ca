"""`info`: what a sweep, image, reconstruction or scene holds, what it can resolve, and what looks wrong.

Of the modules that describe each kind only the one that is needed is imported: that for sweeps takes half a second.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import xarray as xr

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.errors import InputError
from mirrorfold.io import load
from mirrorfold.io.own.checks import check_image, check_reconstruction
from mirrorfold.io.own.netcdf import read_unchecked

if TYPE_CHECKING:
    from mirrorfold.describing.images import ImageFacts
    from mirrorfold.describing.reconstructions import ReconstructionFacts
    from mirrorfold.describing.scenes import SceneFacts, VolumeSceneFacts
    from mirrorfold.describing.sweeps import SweepFacts
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

    Facts = SweepFacts | ImageFacts | ReconstructionFacts | SceneFacts | VolumeSceneFacts


@overload
def info(obj: xr.Dataset, *, diagnose: bool = True) -> SweepFacts: ...
@overload
def info(obj: xr.DataArray, *, diagnose: bool = True) -> ImageFacts: ...
@overload
def info(obj: xr.DataTree, *, diagnose: bool = True) -> ReconstructionFacts: ...
@overload
def info(obj: Scene, *, diagnose: bool = True) -> SceneFacts: ...
@overload
def info(obj: Scene3D, *, diagnose: bool = True) -> VolumeSceneFacts: ...
@overload
def info(obj: str | Path, *, diagnose: bool = True) -> Facts: ...


def info(
    obj: xr.Dataset | xr.DataArray | xr.DataTree | Scene | Scene3D | str | Path, *, diagnose: bool = True
) -> Facts:
    """Describe a sweep, image, reconstruction or scene: what it holds, what it can resolve, and what looks wrong.

    Parameters
    ----------
    obj : xarray.Dataset, xarray.DataArray, xarray.DataTree, Scene, Scene3D or path
        What is to be described, or the path of its file.
    diagnose : bool, default True
        Look for classic mistakes in a sweep, which takes a second or two.

    Returns
    -------
    Record
        Facts to read as attributes or as items: `SweepFacts`, `ImageFacts`, `ReconstructionFacts`, `SceneFacts` or
        `VolumeSceneFacts`. `kind` is "sweep", "image", "reconstruction" or "scene", lengths end in ``_m``, frequencies
        in ``_hz``, angles in ``_deg``, levels in ``_db``. `remarks` is a list of sentences on what looks wrong. For a
        sweep, `findings` lists its mistakes, each with `name`, `what`, `sure` (0 to 1) and `fix`, the command that
        corrects it, or advice; see `mirrorfold.diagnosis`.

    Raises
    ------
    InputError
        If the object is none of these or not valid.
    """
    if isinstance(obj, str | Path):
        return _file(Path(obj), diagnose).but(path=str(obj))
    if isinstance(obj, xr.DataTree):
        from mirrorfold.describing.reconstructions import describe_reconstruction

        return describe_reconstruction(check_reconstruction(obj))
    if isinstance(obj, xr.DataArray):
        from mirrorfold.describing.images import describe_image

        return describe_image(check_image(obj))
    if isinstance(obj, xr.Dataset):
        return _sweep(obj, "SWEEP.nc", diagnose)
    from mirrorfold.scenes.floor_plan import Scene

    if isinstance(obj, Scene) or getattr(obj, "dimensions", None) == 3:
        from mirrorfold.describing.scenes import describe_scene, describe_volume_scene

        return describe_scene(obj) if isinstance(obj, Scene) else describe_volume_scene(obj)
    raise wrong_kind("info", obj, "a sweep, an image, a reconstruction, a scene, or the path of one")


def _sweep(sweep: xr.Dataset, path: str, diagnose: bool) -> SweepFacts:
    """Facts about a sweep that is, or would be, in a file."""
    from mirrorfold.describing.sweeps import describe_sweep

    return describe_sweep(sweep, path, diagnose=diagnose)


def _file(path: Path, diagnose: bool) -> Facts:
    """Facts about the content of a file; a sweep that is not valid is described as far as possible."""
    content: Any
    try:
        content = load(path)
    except InputError as error:
        if path.suffix.lower() == ".toml":
            raise
        try:
            raw = read_unchecked(path)
        except InputError:
            raise error from None
        if "s" not in raw or raw["s"].dtype.kind != "c":
            raise
        return _sweep(raw, str(path), diagnose)
    return _sweep(content, str(path), diagnose) if isinstance(content, xr.Dataset) else info(content)
