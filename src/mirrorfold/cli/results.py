"""Steps that several verbs share: reading of inputs, writing of results and pictures, and reporting."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mirrorfold as mf
from mirrorfold.cli.options import parse_numbers
from mirrorfold.cli.terminal import remark, say, show_files, show_frames, show_json, show_mirrors
from mirrorfold.cli.writing import watch_for_overwriting
from mirrorfold.errors import InputError
from mirrorfold.plotting.saving import save_figure

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.common.records import Record

PICTURE, RECONSTRUCTION = "before_after.png", "reconstruction.nc"
BODY, SPACE = "body.png", "space.png"
REPORT, FRAMES = "report.html", "frames.png"
"""Names of the files of a reconstruction."""


def read(path: Path, *expected: str) -> Any:
    """The content of a file, which must be of an expected kind.

    Parameters
    ----------
    path : path
    *expected : {"sweep", "image", "reconstruction"}
        The allowed kinds.

    Raises
    ------
    InputError
        If the content is of another kind.
    """
    import xarray as xr

    found = mf.load(path)
    kinds = {xr.Dataset: "sweep", xr.DataArray: "image", xr.DataTree: "reconstruction"}
    held = kinds.get(type(found), "scene")
    if held not in expected:
        raise InputError(f"{path}: is of kind {held}, expected {' or '.join(expected)}; give another file")
    return found


def one_frame(frame: int | None, *inputs: Any) -> tuple[Any, ...]:
    """The inputs, with recordings among them cut to one frame; as they are if `frame` is None.

    All inputs but the first may be None.

    Raises
    ------
    InputError
        If there is no such frame, or no input is a recording.
    """
    from mirrorfold.folding.frames import frame_count

    if frame is None:
        return inputs
    recorded = [frame_count(one) is not None for one in inputs]
    if not any(recorded):
        mf.pick_frame(inputs[0], frame)  # refuses every frame but the first
    return tuple(mf.pick_frame(one, frame) if cut else one for one, cut in zip(inputs, recorded, strict=True))


def parse_grid(**axes: str | None) -> dict[str, Any]:
    """Pixel coordinates [m] of the axes that are not None, by name.

    Raises
    ------
    InputError
        If the text of an axis is wrong.
    """
    return {name: parse_axis(text, name) for name, text in axes.items() if text is not None}


AXIS_BYTES = 24.0
"""Memory for each coordinate of an axis while the axis is made [bytes]."""


def parse_axis(text: str, name: str) -> Any:
    """Pixel coordinates [m] from the text START:STOP:STEP, or a single one from one number.

    STOP is included if the steps reach it exactly.

    Raises
    ------
    InputError
        If the text is not one number or three, the steps do not lead from START to STOP, or there are too many.
    """
    import numpy as np

    from mirrorfold.common.memory import check_room

    form = "START:STOP:STEP in metres or with units, for example -2:2:0.005 or -2m:2m:5mm"
    numbers = parse_numbers(text, name, form, "length")
    if len(numbers) == 1:
        return np.array(numbers)
    if len(numbers) != 3:
        raise InputError(f"--{name} is {text!r}, expected {form}")
    start, stop, step = numbers
    if not (np.isfinite([start, stop, step]).all() and step > 0 and stop > start):
        raise InputError(f"--{name} is {text!r}, expected finite numbers with STOP above START and a STEP above zero")
    steps = np.floor((stop - start) / step + 1e-9)
    check_room(AXIS_BYTES * (steps + 1.0), f"--{name} is {text!r}: its {steps + 1.0:.3g} pixels", "give a larger step")
    return start + step * np.arange(int(steps) + 1)


def write_results(
    reconstruction: xr.DataTree, directory: Path, scene: Any = None, plan: FloorPlan | None = None
) -> list[str]:
    """Write a reconstruction, its report and its pictures to a directory; returns the names of the files.

    For a recording, report and pictures show the first frame, and one picture shows all frames.
    """
    from mirrorfold.folding.frames import frame_count, named_frame

    mf.save(reconstruction, directory / RECONSTRUCTION)
    names = [RECONSTRUCTION, PICTURE]
    if frame_count(reconstruction) is not None:
        figure: Any = mf.plot.frames(reconstruction).figure
        save_figure(figure, directory / FRAMES, bbox_inches="tight")
        names.append(FRAMES)
        reconstruction = named_frame(reconstruction, 0)
    mf.report(reconstruction, directory / REPORT, scene=scene, plan=plan)
    names.append(REPORT)
    save_figure(mf.plot.before_after(reconstruction, scene, plan=plan), directory / PICTURE)
    if "z" not in reconstruction.children["objects"].variables:
        return names
    from mirrorfold.plotting import volumes as plot_volume

    save_figure(plot_volume.space(reconstruction, scene), directory / SPACE)
    names.append(SPACE)
    if plot_volume.has_body(reconstruction):
        save_figure(plot_volume.body(reconstruction, scene), directory / BODY)
        names.append(BODY)
    return names


@contextmanager
def frames_kept(recording: Any, output: Path, inputs: Sequence[Path], settings: Mapping[str, Any]) -> Iterator[Any]:
    """Keep the finished frames of a recording in a folder beside the output, so that an interrupted run continues.

    The folder is removed when the block ends without an error. Yields the keyword arguments for `mirrorfold.fold` or
    `mirrorfold.reconstruct`; none if `recording` has no frames.

    Parameters
    ----------
    recording : sweep, image or reconstruction
    output : path
        Output of the verb.
    inputs : list of path
        Files that the frames are made from.
    settings : dict
        Settings that the frames are made with.
    """
    from mirrorfold.folding.frames import frame_count

    if frame_count(recording) is None:
        yield {}
        return
    from mirrorfold.io.own.frame_folder import FrameFolder

    kept = FrameFolder(output.with_name(f"{output.name}.frames"), inputs, settings)
    if len(kept):
        remark([f"{len(kept)} frames were done before; going on from there"])
    try:
        yield {"finished": kept}
    except KeyboardInterrupt:
        done = f"the {len(kept)} frames that are done are kept in {kept.folder}, the same command goes on from there"
        raise KeyboardInterrupt(f"interrupted; {done}" if len(kept) else "") from None
    kept.remove()


def load_mirrors(path: Path | None) -> Any:
    """The known mirrors in a file: an array of mirrors, or a floor plan, whose walls are matched to the image later."""
    from mirrorfold.detection.mirrors.known_mirrors import read_mirrors
    from mirrorfold.io.plans import is_plan, read_plan

    if path is None:
        return None
    return read_plan(path) if is_plan(path) else read_mirrors(path)


def load_plan(path: Path | None) -> Any:
    """The floor plan in a file; None if no file is given."""
    if path is None:
        return None
    from mirrorfold.io.plans import read_plan

    return read_plan(path)


def check_export(path: Path | None, inputs: Iterable[Path]) -> None:
    """Refuse, before the work begins, an export that cannot be written or would overwrite an input."""
    if path is not None:
        from mirrorfold.io.exports.results import check_export_path

        check_export_path(path, inputs=inputs)
        check_exported(path, None)
        watch_for_overwriting([path])


def check_exported(path: Path | None, source: Any) -> None:
    """Refuse, before the work begins, an export that cannot hold what is made from `source`, or any reconstruction."""
    if path is not None:
        from mirrorfold.io.exports.results import check_can_hold

        check_can_hold(path, source)


def write_export(reconstruction: Any, path: Path | None) -> list[Path]:
    """Export a reconstruction for other programs, if a path is given; returns the written files."""
    return [] if path is None else [mf.export(reconstruction, path)]


def write_json(result: Record, path: Path) -> None:
    """Write one JSON object to a file."""
    from mirrorfold.cli.terminal import to_json

    path.write_text(to_json(result) + "\n", encoding="utf-8")


def report_reconstruction(reconstruction: xr.DataTree, files: Sequence[Path], *, json: bool) -> None:
    """Print the mirrors, the numbers of points, and the files of a reconstruction."""
    found = mf.info(reconstruction)
    remark(found.remarks)
    if json:
        show_json(found.but(files=list(map(str, files))))
        return
    if "points_by_frame" in found:
        show_frames(found)
    else:
        show_mirrors(found.mirrors)
    counts = ", ".join(f"{count} after {bounces}" for bounces, count in found.points_by_bounces.items())
    kinds = f"{found.points - found.points_on_mirrors} of objects and {found.points_on_mirrors} of walls"
    through = f", {found.points_through_walls} of them through walls" if found.points_through_walls else ""
    left_out = f"; {found.left_out} echoes from elsewhere, or copies, were left out" if found.left_out else ""
    doubted = f"; {found.doubted} more are doubted" if found.doubted else ""
    say(f"{found.points} points, {kinds}; by bounces: {counts or 'none'}{through}{left_out}{doubted}")
    show_files(files)
