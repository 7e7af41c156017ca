"""Steps 5 and 6: fold every ghost back, and collect what arrives at the root.

What was seen through a chain of mirrors is reflected across the last of them first and across the first of them last;
all lines are those of the unfolded image, where a deeper mirror is a ghost itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from mirrorfold.detection.image_echoes import THRESHOLD_DB, Echoes, find_echoes, find_pixels
from mirrorfold.detection.image_view import PolarImage, to_polar_image
from mirrorfold.detection.known_mirrors import check_lines
from mirrorfold.detection.lines import MINIMUM_LENGTH
from mirrorfold.errors import InputError
from mirrorfold.folding.collection import to_reconstruction
from mirrorfold.sweep import check_sweep, is_monostatic
from mirrorfold.tree.directions import is_mixed
from mirrorfold.tree.lines_of_sight import Views
from mirrorfold.tree.tree import WALL_MARGIN, MirrorTree, build_tree

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

MIXED_ROUNDS = 3
"""Each round uncovers little: mixed-path ghosts rarely stand behind one another."""

GHOST_CELLS = 0.5
"""An echo this close, in resolution cells, to a known mixed-path ghost is that ghost."""


@dataclass(frozen=True)
class Settings:
    """Everything that can be chosen about folding.

    Attributes
    ----------
    normalization : {"r", "none", "r2"}
        Power of range that undoes the spreading before anything is judged.
    threshold_db : float [dB]
        Relative to the robust reference echo; with `published`, to the brightest pixel.
    minimum_length : float [m]
        Of a mirror.
    wall_margin : float [m]
        How far behind a mirror echoes still belong to the wall.
    generations : int, optional
        Largest number of mirrors in a chain; any number by default.
    opaque : bool
        Objects end the view.
    published : bool
        Every pixel above the threshold counts, and every row of them that is long enough is a mirror.
    """

    normalization: str = "r"
    threshold_db: float = THRESHOLD_DB
    minimum_length: float = MINIMUM_LENGTH
    wall_margin: float = WALL_MARGIN
    generations: int | None = None
    opaque: bool = True
    published: bool = False


PRESETS = {
    "default": Settings(),
    "published": Settings(normalization="r2", threshold_db=-30.0, wall_margin=0.0, opaque=False, published=True),
}
"""`published` is the algorithm of Cui and Trichopoulos (2024), for comparison."""


def fold(
    image: xr.DataArray | xr.DataTree,
    *,
    sweep: xr.Dataset | None = None,
    mirrors: ArrayLike | None = None,
    preset: str = "default",
    normalization: str | None = None,
    threshold_db: float | None = None,
    minimum_length: float | None = None,
    wall_margin: float | None = None,
    generations: int | None = None,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Find the mirrors in an image, and fold what was seen through them back to where it stands.

    Parameters
    ----------
    image : (y, x) or (range, azimuth, elevation) DataArray, or DataTree
        Complex or amplitude, not normalised with range. For a volume see also `mirrorfold.folding.volumes`; of voxels
        (z, y, x) the plan view is folded. The initial image of a Reconstruction is folded again.
    sweep : xarray.Dataset, optional
        The MIMO or synthetic-aperture Sweep that the image was focused from. It tells echoes that left and arrived by
        different ways, which focus where nothing is, from true ones.
    mirrors : (mirrors, 2, 2) array [m], optional
        The two ends of each mirror in the unfolded image, where they are known or drawn: no others are looked for.
    preset : {"default", "published"}
        Where the settings below come from unless they are given.
    normalization : {"r", "none", "r2"}, optional
        For a volume "beam", "r2" or "none".
    threshold_db : float [dB], optional
        Relative to the robust reference echo; with the published preset to the brightest pixel.
    minimum_length : float [m], optional
        Of a mirror; in a volume, of its width and height.
    wall_margin : float [m], optional
        How far behind a mirror echoes still belong to the wall.
    generations : int, optional
        Largest number of mirrors in a chain. Deeper ones count as objects, and hide what they show; with 0 the scene
        stays unfolded.
    progress : callable (done, total), optional

    Returns
    -------
    xarray.DataTree
        The Reconstruction. Without any mirror it is the unfolded image, and its attr `remark` says so.

    Raises
    ------
    InputError
        If the image or a setting cannot be used.
    """
    if isinstance(image, xr.DataArray) and image.dims == ("range", "azimuth", "elevation"):
        from mirrorfold.folding.volumes import fold_volume

        if preset != "default":
            raise InputError(f"preset is {preset!r}, but a volume is folded with the default one; fold its plan_view")
        for name, value in (("mirrors", mirrors), ("generations", generations)):
            if value is not None:
                raise InputError(f"{name}: cannot be given for a volume; fold its plan_view, or leave {name} out")
        return fold_volume(
            image,
            normalization=normalization,
            threshold_db=threshold_db,
            minimum_size=minimum_length,
            wall_margin=wall_margin,
            progress=progress,
        )
    if isinstance(image, xr.DataArray) and image.dims == ("z", "y", "x"):  # the strongest voxel of each column
        image = abs(image).max("z", skipna=False, keep_attrs=True)
    return FoldPlan(image, sweep=sweep).fold(
        mirrors=mirrors,
        preset=preset,
        normalization=normalization,
        threshold_db=threshold_db,
        minimum_length=minimum_length,
        wall_margin=wall_margin,
        generations=generations,
        progress=progress,
    )


class FoldPlan:
    """An image that is folded again and again: what does not change is found once.

    Parameters
    ----------
    image : (y, x) DataArray or DataTree
        As for `fold`.
    sweep : xarray.Dataset, optional
        As for `fold`.
    """

    def __init__(self, image: xr.DataArray | xr.DataTree, *, sweep: xr.Dataset | None = None) -> None:
        self.image = initial_image(image) if isinstance(image, xr.DataTree) else image
        self._sweep = None if sweep is None else check_sweep(sweep)
        if self._sweep is not None and is_monostatic(self._sweep):
            self._sweep = None  # one antenna hears an echo from where it sent it to
        self._left_out = np.empty((0, 2))
        if isinstance(image, xr.DataTree) and sweep is None:
            places = [np.ravel(image.attrs.get(f"mixed_{axis}", ())).astype(float) for axis in "xy"]
            self._left_out = np.stack(places, axis=-1)
        self._polar: dict[str, PolarImage] = {}
        self._echoes: dict[tuple[str, float, bool], Echoes] = {}
        self._ratio: dict[str, dict[tuple[float, float], float]] = {}

    def fold(
        self,
        *,
        mirrors: ArrayLike | None = None,
        preset: str = "default",
        normalization: str | None = None,
        threshold_db: float | None = None,
        minimum_length: float | None = None,
        wall_margin: float | None = None,
        generations: int | None = None,
        grid: tuple[Array, Array] | None = None,
        progress: Progress | None = None,
    ) -> xr.DataTree:
        """Fold the image, as `mirrorfold.fold` does.

        Parameters
        ----------
        mirrors, preset, normalization, threshold_db, minimum_length, wall_margin, generations, progress
            As for `mirrorfold.fold`.
        grid : (x, y), optional
            Pixel coordinates of the resulting pictures, equal rising steps [m]; the image's by default.

        Returns
        -------
        xarray.DataTree
            The Reconstruction.

        Raises
        ------
        InputError
            If the image or a setting cannot be used.
        """
        given = {
            "normalization": normalization,
            "threshold_db": threshold_db,
            "minimum_length": minimum_length,
            "wall_margin": wall_margin,
            "generations": generations,
        }
        settings = _settings(preset, given)
        lines = None if mirrors is None else check_lines(mirrors)
        report = progress or (lambda done, total: None)
        polar = self._view(settings)
        report(1, 4)
        echoes = self._find(settings, polar)
        report(2, 4)

        def arrange(echoes: Echoes) -> tuple[MirrorTree, Views]:
            return build_tree(
                echoes,
                polar,
                minimum_length=settings.minimum_length,
                opaque=settings.opaque,
                wall_margin=settings.wall_margin,
                tested=not settings.published,
                lines=lines,
                generations=settings.generations,
            )

        tree, views = arrange(echoes)
        ghosts = [self._left_out]
        if self._sweep is not None and not settings.published:
            ratio = self._ratio.setdefault(settings.normalization, {})
            trusted = np.zeros(echoes.range.size, dtype=bool)
            # What stands behind a mixed-path ghost comes into view, and is tested in its turn.
            for _ in range(MIXED_ROUNDS):
                new = ~trusted & views.clear(echoes.range, views.column(echoes.u), echoes.amplitude)
                if not new.any():
                    break
                mixed = np.zeros_like(new)
                mixed[new] = is_mixed(echoes.take(new), self._sweep, polar, ratio)
                ghosts.append(echoes.position[mixed])
                trusted = (trusted | new)[~mixed]
                echoes = echoes.take(~mixed)
                tree, views = arrange(echoes)
        report(3, 4)
        result = to_reconstruction(
            self.image, polar, echoes, tree, views, asdict(settings), mixed=np.concatenate(ghosts), grid=grid
        )
        result.attrs |= {"preset": preset, "mirrors_given": lines is not None}
        report(4, 4)
        return result

    def _view(self, settings: Settings) -> PolarImage:
        """The radar's view of the image."""
        name = settings.normalization
        if name not in self._polar:
            self._polar[name] = to_polar_image(self.image, normalization=name)
        return self._polar[name]

    def _find(self, settings: Settings, polar: PolarImage) -> Echoes:
        """The echoes of the image, less those that are known for mixed-path ghosts; the latest are remembered."""
        key = (settings.normalization, settings.threshold_db, settings.published)
        if key not in self._echoes:
            find = find_pixels if settings.published else find_echoes
            echoes = find(polar, threshold_db=settings.threshold_db)
            if len(self._left_out) and not settings.published:
                range_, u = polar.to_polar(self._left_out)
                cell = np.array([polar.range_cell, polar.u_cell])
                known = cKDTree(np.stack([range_, u], axis=-1) / cell)
                distance = known.query(np.stack([echoes.range, echoes.u], axis=-1) / cell)[0]
                echoes = echoes.take(distance > GHOST_CELLS)
            self._echoes = {key: echoes}
        return self._echoes[key]


def initial_image(reconstruction: xr.DataTree) -> xr.DataArray:
    """The unfolded image of a Reconstruction, with what is known of the radar, to be folded again.

    Raises
    ------
    InputError
        If there is none, or it is that of a volume.
    """
    if "initial" not in reconstruction.children or "initial" not in reconstruction.children["initial"].data_vars:
        raise InputError("reconstruction: holds no initial image; expected what `fold` or `reconstruct` returns")
    if "z" in reconstruction.children["objects"].variables:
        raise InputError("reconstruction: does not hold the volume that it came from; fold that one")
    image = reconstruction.children["initial"].dataset["initial"].drop_vars(["z"], errors="ignore")
    attrs = {str(name).removeprefix("image_"): value for name, value in reconstruction.attrs.items()
             if str(name).startswith("image_")}  # fmt: skip
    radar = [float(reconstruction.attrs.get(f"radar_{axis}", 0.0)) for axis in "xyz"]
    attrs = {"radar_position": radar, **attrs}
    attrs["normalization"] = str(reconstruction.attrs.get("fold_normalization", "r"))
    return image.rename("image").assign_attrs(attrs)


def _settings(preset: str, given: dict[str, Any]) -> Settings:
    """The settings of a preset, with those that are given.

    Raises
    ------
    InputError
        With the first that is wrong.
    """
    if preset not in PRESETS:
        raise InputError(f"preset is {preset!r}, expected one of {', '.join(PRESETS)}")
    settings = replace(PRESETS[preset], **{name: value for name, value in given.items() if value is not None})
    for name in ("minimum_length", "wall_margin", "threshold_db"):
        value = getattr(settings, name)
        if not np.isfinite(value) or (name == "minimum_length" and value <= 0) or (name == "wall_margin" and value < 0):
            raise InputError(f"{name} is {value}, expected a finite number{'' if name == 'threshold_db' else ' [m]'} "
                             "above zero; leave it out for the default")  # fmt: skip
    generations = settings.generations
    if generations is not None and (
        isinstance(generations, bool) or int(generations) != generations or generations < 0
    ):
        raise InputError(f"generations is {generations!r}, expected a whole number of mirrors from 0 on")
    return settings
