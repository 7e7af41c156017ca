"""The six steps of the algorithm: from a raw sweep to the corrected scene.

1. `mirrorfold.focus`: the image, or of a raster scan the volume.
2. `mirrorfold.detection.find_mirrors`: the mirrors among the echoes of the image.
3. `mirrorfold.tree.order_mirrors`: which mirror is seen through which.
4. `mirrorfold.tree.assign_echoes`: which echo is seen through which chain of mirrors.
5. `mirrorfold.folding.fold_back`: every echo moved back to where its object stands.
6. `mirrorfold.folding.collect`: the corrected scene.

Steps 2 to 4 are one call here, `find_every_kind`. Which mirrors there are, their order, and which echoes are visible
depend on each other, so these steps are repeated in turn until nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.common.arguments import number, one_of, wrong_kind
from mirrorfold.common.facts import VOXELS
from mirrorfold.common.forecasts import expect
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.settings import takes
from mirrorfold.common.types import ROOT, Array, Mask, Progress
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import STEEPEST, depression, find_echoes, see, usual_settings
from mirrorfold.detection.mirrors.known_mirrors import check_mirrors, read_mirrors
from mirrorfold.detection.mirrors.plan_mirrors import mirrors_of_plan
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View, in_single_precision
from mirrorfold.detection.views.volume_view import check_scan
from mirrorfold.errors import InputError
from mirrorfold.focusing.imaging import focus
from mirrorfold.focusing.labels import check_origin
from mirrorfold.focusing.scans.imaging import amplitude_of_scan, is_gridded
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD, FocusSettings
from mirrorfold.folding.collection import collect
from mirrorfold.folding.confidence import with_confidence
from mirrorfold.folding.earlier import initial_image, kept_measurements
from mirrorfold.folding.frames import check_finished, each_frame, frame_count
from mirrorfold.folding.gaps import close_gaps
from mirrorfold.folding.memory import fold_parts
from mirrorfold.folding.pictures import Grid
from mirrorfold.folding.points import fold_back
from mirrorfold.folding.settings import PRESETS, FoldSettings
from mirrorfold.io.plans import is_plan, read_plan
from mirrorfold.sweep import check_sweep, is_monostatic, is_raster
from mirrorfold.sweep.polarization import polarizations, polarized
from mirrorfold.tree.half_transparent.exchanged import exchanged, seen_behind_walls
from mirrorfold.tree.kinds import find_every_kind
from mirrorfold.tree.measured import Measured, Measurer, measured_by_sweep, no_measurements
from mirrorfold.tree.rounds import agreed, find_tree, found_and_ordered


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
        Sweep of a MIMO or synthetic-aperture radar, or of a raster scan. Each frame of a recording, which has a
        dimension `frame`, is reconstructed as if it were alone; one plan focuses all frames.
    tolerance : float
        Relative error of the image. 1e-3 is 60 dB below the image, and far below the threshold.
    mirrors, preset, finished
        As for `fold`.
    progress : callable (done, total), optional
        Of a single sweep it tells of the focusing alone, of a recording how many frames are done.
    **given

    Returns
    -------
    xarray.DataTree
        The Reconstruction; for a recording, the Reconstructions of all frames in one, see `fold`.

    Raises
    ------
    InputError
        If the sweep or a setting cannot be used.
    """
    check_finished(finished)
    if frame_count(sweep) is not None:  # `focus` keeps its plan from one frame to the next
        fold_frame = partial(reconstruct, tolerance=tolerance, mirrors=mirrors, preset=preset, **given)
        return each_frame(check_sweep(sweep), fold_frame, finished, progress)
    folding = FoldSettings.rules()
    imaging = {name: given.pop(name) for name in FocusSettings.rules() if name in given and name not in folding}
    chosen = FocusSettings().with_given(tolerance=tolerance, **imaging)
    check_foldable(sweep, chosen)
    if is_raster(sweep) and not is_gridded(chosen) and not polarizations(sweep):
        image = amplitude_of_scan(sweep, chosen, progress)
    else:
        image = focus(sweep, tolerance=tolerance, progress=progress, **imaging)
    known = None if is_raster(sweep) else sweep
    return fold(image, sweep=known, mirrors=mirrors, preset=preset, memory_limit=chosen.memory_limit, **given)


def check_foldable(sweep: xr.Dataset, settings: FocusSettings) -> None:
    """Refuse a sweep whose image can be focused with these settings, but not be folded.

    Raises
    ------
    InputError
        If it is not valid, or a raster scan of too few beams or in unequal steps, and no Cartesian grid is asked for.
    """
    if is_raster(sweep) and not is_gridded(settings):
        check_scan(check_sweep(sweep))


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
    """Find the mirrors in an image, and fold every echo seen through them back to where its object stands.

    Parameters
    ----------
    image : (y, x), (z, y, x) or (range, azimuth, elevation) DataArray, or DataTree
        Complex values or amplitudes. Voxels (z, y, x) are folded as their plan view, and the sweep does not test their
        echoes. Of a Reconstruction, the initial image is folded again. With a leading dimension `frame`, as in a
        recording, each frame is folded by itself. With a leading dimension `polarization`, the image of TE is folded,
        and TE and TM together tell which echoes passed through half-transparent walls.
    sweep : xarray.Dataset, optional
        The MIMO or synthetic-aperture Sweep that the image was focused from. It tells true echoes from those whose
        waves left and arrived by different ways, which focus where nothing stands.
    mirrors : (mirrors, 2, 2) or (mirrors, 4, 3) array [m], list of dicts, FloorPlan or path, optional
        Mirrors of the unfolded image, known or drawn by hand: the two ends of each line, or in a volume the four
        corners of each plane, or a JSON file of them, or the list in such a file. Of a floor plan (DXF, GeoJSON), the
        walls that the radar sees directly or by way of other walls. No other mirrors are looked for.
    preset : {"default", "published"}
        Values of those of the settings below that are not given.
    **given
    memory_limit : float [B], optional
        Memory that the process may hold in all; work that needs more is refused before it begins. By default, the
        limit is the free memory.
    finished : mutable mapping of int to xarray.DataTree, optional
        For a recording: each frame that is done is stored here by its number, and frames that are here already are not
        made again. With a dict, an interrupted call can be continued where it stopped;
        `mirrorfold.io.own.frame_folder` keeps the frames on disk.
    progress : callable (done, total), optional

    Returns
    -------
    xarray.DataTree
        The Reconstruction. Where no mirror is found, it shows the unfolded image, and its attribute `remark` says so.
        For a recording, the pictures are (frame, y, x), and the column `frame` of the tables says which frame a row
        belongs to; `mf.pick_frame` gives one frame as it would be alone.

    Raises
    ------
    InputError
        If the image or a setting cannot be used.
    """
    check_finished(finished)
    if frame_count(image) is not None:
        if sweep is not None and frame_count(sweep) != frame_count(image):
            raise InputError(
                f"sweep: has {frame_count(sweep) or 'no'} frames and the image {frame_count(image)}; give the sweep "
                "that the image was focused from, or one frame of the image with --frame N, in Python mf.pick_frame"
            )

        fold_frame = partial(fold, mirrors=mirrors, preset=preset, memory_limit=memory_limit, **given)
        return each_frame(image, fold_frame, finished, progress, sweep=sweep)
    plan = FoldPlan(image, sweep=sweep)
    plan.expect_memory(memory_limit)
    return plan.fold(mirrors=mirrors, preset=preset, progress=progress, **given)


class FoldPlan:
    """An image to be folded several times, as by `fold`: what does not change between two calls is computed once."""

    def __init__(self, image: xr.DataArray | xr.DataTree, *, sweep: xr.Dataset | None = None) -> None:
        if not isinstance(image, xr.DataArray | xr.DataTree):
            raise wrong_kind("image", image, "an image (xarray.DataArray), as focus returns, or a reconstruction")
        self._given = image, sweep
        # The image of the first polarization is folded; both images together tell which echoes passed through walls.
        both, image, sweep = polarized(image, sweep)
        self._polarizations = {name: in_single_precision(one) for name, one in both.items()}
        self._measure: Measurer = (
            kept_measurements(image) if isinstance(image, xr.DataTree) and sweep is None else no_measurements
        )
        self.image = in_single_precision(initial_image(image) if isinstance(image, xr.DataTree) else image)
        self._sweep = None if sweep is None else check_sweep(sweep)
        if self._sweep is not None:
            check_origin(self.image, self._sweep)
            # Where one antenna sends and receives, nothing tells whether waves left and arrived by different ways.
            if is_monostatic(self._sweep) or is_raster(self._sweep):
                self._sweep = None
            else:
                self._measure = measured_by_sweep(self._sweep)
        # Users move given mirrors more often than they change settings: the echoes of the latest settings are kept.
        self._view = lru_cache(partial(see, self.image))
        # None of these caches refers to the plan: an image of hundreds of megabytes is freed as soon as its plan is.
        self._echoes = lru_cache(1)(partial(_find_echoes, self._view))
        self._wall_echoes = lru_cache(1)(partial(_find_walls, self._view, self._echoes))
        self._exchanged = lru_cache(1)(partial(_exchanged, self._polarizations))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled as its image and its sweep: the plan is made anew from them."""
        return partial(FoldPlan, sweep=self._given[1]), self._given[:1]

    def expect_memory(self, limit: float | None = None) -> None:
        """Log how much memory folding will take, and refuse to fold where that is more than there is.

        Parameters
        ----------
        limit : float [B], optional
            Memory that the process may hold in all; by default, what is free counts.

        Raises
        ------
        InputError
            If the memory does not suffice, or the image cannot be used.
        """
        limit = None if limit is None else number("memory_limit", limit, "B", above=0.0)
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
            Pixel coordinates (x, y) of the resulting pictures, for a volume (x, y, z), in equal rising steps. By
            default, those of the image, grown to hold all points; for a volume, a grid around all points.
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
        by_hand = _read(mirrors)
        report = progress or (lambda done, total: None)
        view = self._view(normalization=chosen.normalization)
        echoes = self._echoes(chosen.normalization, chosen.threshold_db, chosen.published)
        settings = chosen.completed(normalization=view.normalization, **usual_settings(view, echoes))
        if self._sweep is None:  # copies are found by the tail of the pulse, which only the sweep tells
            settings = replace(settings, copies=False)
        report(1, 3)
        known, count = _known(by_hand, view, chosen)
        angle = depression(view, echoes)
        from_above = angle if angle > STEEPEST and not settings.published else None
        if known is None and (settings.generations == 0 or from_above is not None):
            known = check_mirrors([])  # no mirror is used, and no echo is taken for a ghost
        walls = None
        if known is not None and settings.opaque and from_above is None:
            echoes, walls = self._wall_echoes(chosen, settings)
        measured, untested = self._measured(view, settings)
        found = find_every_kind(
            *(view, echoes, settings), measured=measured, known=known, walls=walls, polarizations=self._polarizations,
            short=chosen.minimum_length is None,
        )  # fmt: skip
        report(2, 3)
        points = fold_back(found.tree, view, found.transparent_walls)
        if not settings.published:
            points = with_confidence(points, found, measured.confocal_share, measured.corners)
        if settings.close_gaps and isinstance(view, ImageView):
            points = close_gaps(points, found.tree, view)
        result = collect(self.image, found, points, settings, grid=grid, given=count, from_above=from_above)
        names = "" if known is not None or from_above is not None else self._exchanged(settings)
        result.attrs["remark"] = "; ".join(filter(None, (result.attrs["remark"], untested, names)))
        result.attrs |= {"preset": preset, "mirrors_given": by_hand is not None, **measured.corner_attrs()}
        report(3, 3)
        return result

    def _measured(self, view: View, settings: FoldSettings) -> tuple[Measured, str]:
        """What the sweep tells of the echoes of a view; and why it was not asked, "" if it was or is not at hand."""
        if self.image.dims == VOXELS:  # the way of an echo depends on its height, which the floor plan does not hold
            plan = "voxels are folded as their floor plan, as if all walls were upright, and echoes are not tested"
            return Measured(), plan
        if settings.published or not isinstance(view, ImageView):
            return Measured(), ""
        if abs(view.height) <= view.range_cell:
            return self._measure(view).noted(), ""
        off = f"the image lies {abs(view.height):.3g} m off the plane of the antennas: echoes are not tested"
        return Measured(), "" if self._sweep is None else off


def _exchanged(images: Mapping[str, xr.DataArray], settings: FoldSettings) -> str:
    """A remark if the images of TE and TM in a floor plan have each other's name, "" if not."""
    if not (images and settings.transparent and settings.opaque):
        return ""
    view = see(images["TM"], normalization=settings.normalization)
    if not isinstance(view, ImageView):
        return ""
    echoes = find_echoes(view, threshold_db=settings.threshold_db)
    if not exchanged(seen_behind_walls(find_tree(view, echoes, settings), view, images)):
        return ""
    return (
        "TE and TM seem to be exchanged, for no wall reflects TM more than TE; join the sweeps in the other order, TE "
        "is E along the vertical axis"
    )


Given = Array | FloorPlan | None
"""Mirrors that the user gives, see `check_mirrors`, or the floor plan that they are in; None where there are none."""


def _read(mirrors: ArrayLike | FloorPlan | str | Path | None) -> Given:
    """Mirrors that are given as for `fold`, read if they are in a file, and checked."""
    if isinstance(mirrors, str | Path):
        mirrors = read_plan(mirrors) if is_plan(mirrors) else read_mirrors(mirrors)
    return mirrors if mirrors is None or isinstance(mirrors, FloorPlan) else check_mirrors(mirrors)


def _known(given: Given, view: View, chosen: FoldSettings) -> tuple[Array | None, int | None]:
    """Given mirrors where the unfolded image shows them, and how many mirrors or walls of a plan were given."""
    if isinstance(given, FloorPlan):
        return mirrors_of_plan(given, view, generations=chosen.generations), given.count
    return given, None if given is None else len(given)


ViewOf = Callable[..., View]
"""Makes the radar's view of an image, given the normalization."""


def _find_echoes(view_of: ViewOf, normalization: str | None, threshold_db: float | None, published: bool) -> Echoes:
    """The echoes of an image in the view of that normalization."""
    return find_echoes(view_of(normalization=normalization), threshold_db=threshold_db, published=published)


def _find_walls(
    view_of: ViewOf, echoes_of: Callable[..., Echoes], chosen: FoldSettings, settings: FoldSettings
) -> tuple[Echoes, Mask]:
    """The echoes, marked as strong or faint by the mirrors that the image itself shows, and which lie on walls, (n,).

    Given mirrors do not change these marks. A wall whose mirror is switched off or moved by hand does not become an
    object that hides what is behind it, and its ghosts are as strong as they were.
    """
    view = view_of(normalization=chosen.normalization)
    echoes = echoes_of(chosen.normalization, chosen.threshold_db, chosen.published)
    settings = replace(settings, generations=settings.generations or None)
    order, marked = agreed(partial(found_and_ordered, view=view, settings=settings), echoes, settings)
    return replace(echoes, strong=marked.strong, limit=marked.limit), order.face != ROOT
