"""The six steps of the algorithm: from a raw sweep to the corrected scene.

1. `mirrorfold.focus`: the image, or of a raster scan the volume.
2. `mirrorfold.detection.find_mirrors`: the mirrors among the echoes of the image.
3. `mirrorfold.tree.order_mirrors`: which mirror is seen through which.
4. `mirrorfold.tree.assign_echoes`: which echo is seen through which chain of mirrors.
5. `mirrorfold.folding.fold_back`: every echo back to where it stands.
6. `mirrorfold.folding.collect`: the corrected scene.

Steps 2 to 4 are one call here, `find_every_kind`: mirrors, their order, and what can be seen at all depend on each
other, so that these steps are taken in turn until nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable, MutableMapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.common.arguments import one_of, wrong_kind
from mirrorfold.common.forecasts import expect
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.settings import takes
from mirrorfold.common.types import Mask, Progress
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import find_echoes, see, usual_settings
from mirrorfold.detection.mirrors.known_mirrors import check_mirrors, read_mirrors
from mirrorfold.detection.mirrors.plan_mirrors import mirrors_of_plan
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.errors import InputError
from mirrorfold.focusing.imaging import focus
from mirrorfold.focusing.labels import check_origin
from mirrorfold.focusing.scans.imaging import amplitude_of_scan, is_gridded
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD, FocusSettings
from mirrorfold.folding.collection import collect
from mirrorfold.folding.confidence import judged
from mirrorfold.folding.earlier import initial_image, told_before
from mirrorfold.folding.frames import each_frame, frame_count
from mirrorfold.folding.gaps import close_gaps
from mirrorfold.folding.memory import fold_parts
from mirrorfold.folding.pictures import Grid
from mirrorfold.folding.points import fold_back
from mirrorfold.folding.settings import PRESETS, FoldSettings
from mirrorfold.io.plans import is_plan, read_plan
from mirrorfold.sweep import check_sweep, is_monostatic, is_raster
from mirrorfold.sweep.polarization import polarizations, polarized
from mirrorfold.tree.kinds import find_every_kind
from mirrorfold.tree.lines_of_sight import ROOT
from mirrorfold.tree.measured import Measured, Teller, nothing_measured, told_by_sweep
from mirrorfold.tree.rounds import agreed


@takes(FocusSettings, FoldSettings)
def reconstruct(
    sweep: xr.Dataset,
    *,
    tolerance: float = TOLERANCE_TO_FOLD,
    mirrors: ArrayLike | FloorPlan | str | Path | None = None,
    preset: str = "default",
    finished: MutableMapping[int, xr.DataTree] | None = None,
    progress: Progress | None = None,
    **given: Any,
) -> xr.DataTree:
    """See around the corner: focus a sweep (step 1) and fold the image (steps 2 to 6).

    Parameters
    ----------
    sweep : xarray.Dataset
        MIMO or synthetic-aperture Sweep, or that of a raster scan. Of a recording, with a dimension `frame`, each frame
        gives what it gives alone; all are focused by one plan.
    tolerance : float
        Relative error of the image. 1e-3 is 60 dB below the image, and far below the threshold.
    mirrors, preset, finished
        As for `fold`.
    progress : callable (done, total), optional
    **given

    Returns
    -------
    xarray.DataTree
        The Reconstruction; of a recording that of all frames, see `fold`.

    Raises
    ------
    InputError
        If the sweep or a setting cannot be used.
    """
    if frame_count(sweep) is not None:  # `focus` keeps its plan from one frame to the next
        one = partial(reconstruct, tolerance=tolerance, mirrors=mirrors, preset=preset, **given)
        return each_frame(check_sweep(sweep), one, finished, progress)
    folding = FoldSettings.rules()
    imaging = {name: given.pop(name) for name in FocusSettings.rules() if name in given and name not in folding}
    chosen = FocusSettings().with_given(tolerance=tolerance, **imaging)
    if is_raster(sweep) and not is_gridded(chosen) and not polarizations(sweep):
        image = amplitude_of_scan(sweep, chosen, progress)
    else:
        image = focus(sweep, tolerance=tolerance, progress=progress, **imaging)
    known = None if is_raster(sweep) else sweep
    return fold(image, sweep=known, mirrors=mirrors, preset=preset, memory_limit=chosen.memory_limit, **given)


@takes(FoldSettings)
def fold(
    image: xr.DataArray | xr.DataTree,
    *,
    sweep: xr.Dataset | None = None,
    mirrors: ArrayLike | FloorPlan | str | Path | None = None,
    preset: str = "default",
    memory_limit: float | None = None,
    finished: MutableMapping[int, xr.DataTree] | None = None,
    progress: Progress | None = None,
    **given: Any,
) -> xr.DataTree:
    """Find the mirrors in an image, and fold what was seen through them back to where it stands.

    Parameters
    ----------
    image : (y, x), (z, y, x) or (range, azimuth, elevation) DataArray, or DataTree
        Complex or amplitude. Of voxels (z, y, x) the plan view is folded. The initial image of a Reconstruction is
        folded again. Of a recording, with a leading dimension `frame`, each frame is folded by itself. With a leading
        dimension `polarization` the image of TE is folded, and both tell what passed through half-transparent walls.
    sweep : xarray.Dataset, optional
        The MIMO or synthetic-aperture Sweep that the image was focused from. It tells echoes that left and arrived by
        different ways, which focus where nothing is, from true ones.
    mirrors : (mirrors, 2, 2) or (mirrors, 4, 3) array [m], list of dicts, FloorPlan or path, optional
        Mirrors in the unfolded image, where they are known or drawn: the two ends of each line, or in a volume the
        four corners of each plane, or a file of them (JSON), or what its list holds. Of a floor plan (DXF, GeoJSON)
        the walls that the radar sees, directly or by way of others. No others are looked for.
    preset : {"default", "published"}
        Where the settings below come from unless they are given.
    **given
    memory_limit : float [B], optional
        Memory that the process may hold in all; what needs more is refused before the work. By default what is free.
    finished : mutable mapping of int to xarray.DataTree, optional
        Of a recording: frames that are done are put into it, and those that are in it already are not made again. With
        a dict an interrupted call can be repeated from where it was; `mirrorfold.io.own.frame_folder` keeps them on
        disk.
    progress : callable (done, total), optional

    Returns
    -------
    xarray.DataTree
        The Reconstruction. Without any mirror it is the unfolded image, and its attr `remark` says so. That of a
        recording has pictures (frame, y, x), and tables whose column `frame` says which frame a row belongs to;
        `mf.pick_frame` gives one frame as it would be alone.

    Raises
    ------
    InputError
        If the image or a setting cannot be used.
    """
    if frame_count(image) is not None:
        if sweep is not None and frame_count(sweep) != frame_count(image):
            raise InputError(
                f"sweep: has {frame_count(sweep)} frames and the image {frame_count(image)}; give the sweep that the "
                "image was focused from"
            )

        one = partial(fold, mirrors=mirrors, preset=preset, memory_limit=memory_limit, **given)
        return each_frame(image, one, finished, progress, sweep=sweep)
    plan = FoldPlan(image, sweep=sweep)
    plan.expect_memory(memory_limit)
    return plan.fold(mirrors=mirrors, preset=preset, progress=progress, **given)


class FoldPlan:
    """An image that is folded again and again, as by `fold`: what does not change is found once."""

    def __init__(self, image: xr.DataArray | xr.DataTree, *, sweep: xr.Dataset | None = None) -> None:
        if not isinstance(image, xr.DataArray | xr.DataTree):
            raise wrong_kind("image", image, "an image (xarray.DataArray), as focus returns, or a reconstruction")
        # What is folded is the first polarization; both together tell what passed through walls.
        self._both, image, sweep = polarized(image, sweep)
        self._told: Teller = (
            told_before(image) if isinstance(image, xr.DataTree) and sweep is None else nothing_measured
        )
        self.image = initial_image(image) if isinstance(image, xr.DataTree) else image
        # A single antenna that sends and hears cannot tell echoes that left one way and came back another.
        checked = None if sweep is None else check_sweep(sweep)
        self._sweep = None if checked is None or is_monostatic(checked) else checked
        if self._sweep is not None:
            check_origin(self.image, self._sweep)
            self._told = told_by_sweep(self._sweep)
        # Users move given mirrors more often than they change settings: what the latest settings led to is kept.
        self._view = lru_cache(partial(see, self.image))
        # None of these refers to the plan: an image of hundreds of megabytes goes as soon as its plan does.
        self._echoes = lru_cache(1)(partial(_find_echoes, self._view))
        self._shown_walls = lru_cache(1)(partial(_find_walls, self._view, self._echoes))

    def expect_memory(self, limit: float | None = None) -> None:
        """Log what folding will take of the memory, and refuse it where that is more than there is.

        Parameters
        ----------
        limit : float [B], optional
            Of all that the process may hold.

        Raises
        ------
        InputError
            If it does not fit, or the image cannot be used.
        """
        parts = fold_parts(self.image, self._sweep)
        pixels = " x ".join(map(str, self.image.shape))
        remedy = "give a smaller or coarser image, close other programs, or raise the limit"
        held = parts.get("image", 0.0) + parts.get("samples", 0.0)
        expect(parts, f"image: the steps that fold {pixels} pixels", remedy, held=held, limit=limit)

    @takes(FoldSettings)
    def fold(
        self,
        *,
        mirrors: ArrayLike | FloorPlan | str | Path | None = None,
        preset: str = "default",
        grid: Grid | None = None,
        progress: Progress | None = None,
        **given: Any,
    ) -> xr.DataTree:
        """Fold the image, as `mirrorfold.fold` does.

        Parameters
        ----------
        mirrors, preset, progress
            As for `mirrorfold.fold`.
        grid : tuple of 1D arrays [m], optional
            Pixel coordinates (x, y) of the resulting pictures, equal rising steps; of a volume (x, y, z). The image's
            by default.
        **given

        Returns
        -------
        xarray.DataTree
            The Reconstruction.

        Raises
        ------
        InputError
            If the image or a setting cannot be used.
        """
        chosen = PRESETS[one_of("preset", preset, PRESETS)].with_given(**given)
        if isinstance(mirrors, str | Path):
            mirrors = read_plan(mirrors) if is_plan(mirrors) else read_mirrors(mirrors)
        if mirrors is not None and not isinstance(mirrors, FloorPlan):
            mirrors = check_mirrors(mirrors)
        report = progress or (lambda done, total: None)
        view = self._view(normalization=chosen.normalization)
        echoes = self._echoes(chosen.normalization, chosen.threshold_db, chosen.published)
        settings = chosen.completed(normalization=view.normalization, **usual_settings(view, echoes))
        if self._sweep is None:  # without the sweep, the tail of the pulse is not known
            settings = replace(settings, copies=False)
        report(1, 3)
        by_hand, walls = mirrors is not None, None
        given_count = None if mirrors is None else len(mirrors.walls if isinstance(mirrors, FloorPlan) else mirrors)
        if isinstance(mirrors, FloorPlan):
            mirrors = mirrors_of_plan(mirrors, view, generations=chosen.generations)
        if settings.generations == 0 and not by_hand:
            mirrors = check_mirrors([])  # no mirror is used, and no echo taken for the ghost of one
        if mirrors is not None and settings.opaque:
            echoes, walls = self._shown_walls(chosen, settings)
        told = self._told if not settings.published else nothing_measured
        measured = told(view) if isinstance(view, ImageView) else Measured()
        found = find_every_kind(
            *(view, echoes, settings), measured=measured, known=mirrors, walls=walls, polarizations=self._both,
            short=chosen.minimum_length is None,
        )  # fmt: skip
        report(2, 3)
        points = fold_back(found.tree, view, found.windows)
        if not settings.published:
            points = judged(points, found, measured.share)
        if settings.close_gaps and isinstance(view, ImageView):
            points = close_gaps(points, found.tree, view)
        result = collect(self.image, found, points, settings, grid=grid, given=given_count)
        result.attrs |= {"preset": preset, "mirrors_given": by_hand}
        report(3, 3)
        return result


Seen = Callable[..., View]
"""The radar's view of an image, by its normalization."""


def _find_echoes(seen: Seen, normalization: str | None, threshold_db: float | None, published: bool) -> Echoes:
    """The echoes of an image."""
    return find_echoes(seen(normalization=normalization), threshold_db=threshold_db, published=published)


def _find_walls(
    seen: Seen, heard: Callable[..., Echoes], chosen: FoldSettings, settings: FoldSettings
) -> tuple[Echoes, Mask]:
    """What the image itself tells, whichever mirrors are given: which echoes are strong, and which those of walls.

    A wall that is switched off or moved by hand is no object, and its ghosts are as strong as they were.
    """
    view = seen(normalization=chosen.normalization)
    echoes = heard(chosen.normalization, chosen.threshold_db, chosen.published)
    order, marked = agreed(view, echoes, replace(settings, generations=settings.generations or None))
    return replace(echoes, strong=marked.strong, limit=marked.limit), order.face != ROOT
