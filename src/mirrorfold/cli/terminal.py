"""Output of the verbs: progress and remarks on stderr; results on stdout, as tables or as one JSON object."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

from rich import box
from rich.console import Console
from rich.table import Table

from mirrorfold.cli import note
from mirrorfold.common.records import finite
from mirrorfold.common.units import length_text
from mirrorfold.errors import printable

if TYPE_CHECKING:
    from pathlib import Path

    from mirrorfold.cli.many import SweepResult
    from mirrorfold.common import types
    from mirrorfold.common.records import Record
    from mirrorfold.describing.reconstructions import MirrorFacts, ReconstructionFacts
    from mirrorfold.focusing.choosing.facts import OptionFacts
    from mirrorfold.scoring.score import PlanScore, VolumeScore

PLAIN_WIDTH = 110
"""Width of tables that are not printed on a terminal [characters]."""

WIDE = 140
"""Width of tables with more columns than fit into `PLAIN_WIDTH` [characters]."""

UNLISTED = ("remarks", "mirrors", "surfaces", "findings", "judged", "valid", "points_by_frame")
"""Facts that are not listed by name and value, because they have tables or lines of their own."""


@contextmanager
def progress(description: str) -> Iterator[types.Progress | None]:
    """A progress bar on stderr: yields a function of the done and the total work; None if stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def remark(sentences: Iterable[str]) -> None:
    """Print remarks on stderr; the verb goes on."""
    for sentence in sentences:
        note(sentence)


def say(text: str, end: str = "\n") -> None:
    """Print a text on stdout; unprintable characters, which it may quote from a file, are replaced."""
    print(printable(text), end=end)


class CleanTable(Table):
    """A table whose cells may quote a file: unprintable characters are replaced."""

    def add_row(self, *cells: Any, **options: Any) -> None:
        """Add a row of cells."""
        super().add_row(*(printable(cell) if isinstance(cell, str) else cell for cell in cells), **options)

    def add_column(self, header: Any = "", *parts: Any, **options: Any) -> None:
        """Add a column with its heading."""
        super().add_column(printable(header) if isinstance(header, str) else header, *parts, **options)


def show_json(result: Mapping[str, Any]) -> None:
    """Print one JSON object."""
    print(to_json(result))


def show_result(found: Record, files: Sequence[Path], show: Callable[[Any], None] | None = None, *, json: bool) -> None:
    """Print the result of a verb and the files that it has written on stdout, and its remarks on stderr.

    Parameters
    ----------
    found : Record
        The result, with the field `remarks`.
    files : list of path
        Files that were written.
    show : callable, optional
        Prints the result for people; by default only the files are printed.
    json : bool
        Whether to print one JSON object instead.
    """
    remark(found["remarks"])
    if json:
        show_json(found.but(files=list(map(str, files))))
        return
    if show is not None:
        show(found)
    show_files(files)


def to_json(result: Mapping[str, Any]) -> str:
    """The text of one JSON object; numbers that are not finite become null."""
    return json.dumps(finite(result), indent=2)


def show_files(files: Iterable[Any]) -> None:
    """Print the paths of files that were written."""
    for file in files:
        say(f"wrote {file}")


def show_info(found: Mapping[str, Any]) -> None:
    """Print the facts that `info` has found, as a table of names and values, and tables of mirrors or frames."""
    table = CleanTable(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in found.items():
        if name in UNLISTED or value in (None, ""):
            continue
        label, text = describe(name, value)
        table.add_row(label, text)
    for surface in found.get("surfaces", ()):
        table.add_row("surface", f"{surface['name']} ({surface['kind']}, {surface['material']})")
    console().print(table)
    if found.get("points_by_frame"):
        show_frames(cast("ReconstructionFacts", found))
    elif found.get("mirrors"):
        show_mirrors(found["mirrors"])
    for sentence in found["remarks"]:
        say(f"! {sentence}")


def show_options(options: Sequence[OptionFacts]) -> None:
    """Print the table of focusing algorithms, with their times and memory; the chosen one is marked by an asterisk."""
    table = table_of("algorithms, the fastest first")
    for heading in ("algorithm", "plan", "image", "in all", "memory [GB]", "why"):
        table.add_column(heading, justify="left" if heading in ("algorithm", "why") else "right")
    for option in options:
        times = (option.building_s, option.frame_s, option.total_s)
        table.add_row(
            option.algorithm + (" *" if option.chosen else ""),
            *(duration(time) if time else "-" for time in times),
            number(option.memory_gb, ".2g"),
            option.why,
        )
    console().print(table)


MEASURED = (
    ("radius_m", "radius_error_m", "radius [m]", ".3f", 1.0),
    ("permittivity", "permittivity_error", "permittivity", ".2f", 1.0),
    ("thickness_m", "thickness_error_m", "thickness [mm]", ".2f", 1e3),
)
"""Columns that only some mirrors have: names of the value and of its standard error, heading, format, scale."""


def _measured(mirror: MirrorFacts, name: str, error: str, _: str, form: str, scale: float) -> str:
    """A value with its standard error, as text; empty for a mirror without this value.

    The parameters after `mirror` are an entry of `MEASURED`.
    """
    values = [getattr(mirror, which) for which in (name, error)]
    return " \u00b1 ".join(format(scale * value, form) for value in values if value is not None)


def show_mirrors(mirrors: Sequence[MirrorFacts]) -> None:
    """Print the table of mirrors."""
    table = table_of("mirrors, at their true places")
    more = [column for column in MEASURED if any(getattr(mirror, column[0]) is not None for mirror in mirrors)]
    headings = ("mirror", "seen through", "generation", "start [m]", "end [m]", "strength")
    for heading in (*headings, *(column[2] for column in more)):
        table.add_column(heading, justify="right")
    for mirror in mirrors:
        table.add_row(
            str(mirror.mirror),
            "" if mirror.parent < 0 else str(mirror.parent),
            str(mirror.generation),
            *(f"({', '.join(f'{part:.4f}' for part in end)})" for end in (mirror.start_m, mirror.end_m)),
            number(mirror.strength, ".3g"),
            *(_measured(mirror, *column) for column in more),
        )
    console().print(table)


def show_frames(found: ReconstructionFacts) -> None:
    """Print the number of mirrors and points in each frame of a recording."""
    table = table_of("frames")
    for heading in ("frame", "mirrors", "points"):
        table.add_column(heading, justify="right")
    for frame, points in enumerate(found.points_by_frame):
        table.add_row(str(frame), str(sum(mirror.frame == frame for mirror in found.mirrors)), str(points))
    console().print(table)


def show_summary(results: Sequence[SweepResult]) -> None:
    """Print the results of many sweeps, one in each line."""
    table = table_of("sweeps")
    for heading in ("sweep", "mirrors", "points", "by mirrors", "result"):
        table.add_column(heading, justify="left" if heading in ("sweep", "result") else "right", overflow="fold")
    for one in results:
        counts = ("-" if count is None else str(count) for count in (one.mirrors, one.points, one.hidden))
        place = os.path.dirname(one.files[0]) if one.files else "failed"
        table.add_row(one.sweep, *counts, place)
    console().print(table)


def show_score(score: PlanScore | VolumeScore) -> None:
    """Print a score: the errors of the mirrors, then those of the points, for all surfaces and for hidden ones."""
    mirrors = table_of("mirrors against the truth")
    curved = any("curvature_error" in mirror for mirror in score.mirrors)
    for heading in ("surface", "angle error [deg]", "offset error [mm]", *(["curvature error [%]"] if curved else [])):
        mirrors.add_column(heading, justify="left" if heading == "surface" else "right")
    for mirror in score.mirrors:
        bent = mirror.curvature_error
        mirrors.add_row(
            *(mirror.surface or "-", number(mirror.angle_error_deg, ".3f"), number(mirror.offset_error_mm, ".2f")),
            *([number(None if bent is None else 100.0 * bent, ".2f") if "curvature_error" in mirror else ""] * curved),
        )
    points = table_of("points against the truth")
    for heading in ("", "all surfaces", "out of sight"):
        points.add_column(heading, justify="right" if heading else "left")
    for label, name, scale in (
        ("accuracy [mm]", "accuracy_m", 1e3),
        ("Chamfer distance [mm]", "chamfer_m", 1e3),
        ("precision at 2 cm", "precision_2cm", 1.0),
        ("completeness at 2 cm", "completeness_2cm", 1.0),
        ("F-score at 2 cm", "f_score_2cm", 1.0),
        ("F-score at 5 cm", "f_score_5cm", 1.0),
        ("F-score at 1.5 cells", "f_score_cells", 1.0),
        ("invented share", "invented_fraction", 1.0),
    ):
        values = (score[name], score.hidden[name])
        points.add_row(label, *(number(value, ".1f" if scale > 1 else ".3f", scale) for value in values))
    console().print(mirrors, points)
    for name, patch in (score.get("patches") or {}).items():
        say(f"{name} over its surroundings: {number(patch['contrast_db'], '.1f')} dB")


def describe(name: str, value: Any) -> tuple[str, str]:
    """Label and text of one fact; its unit follows from the end of its name.

    Examples
    --------
    >>> describe("range_resolution_m", 0.015)
    ('range resolution', '15 mm')
    >>> describe("cross_range_resolution_m", {"1": 0.0127, "2": 0.0254})
    ('cross range resolution', '12.7 mm at 1 m, 25.4 mm at 2 m')
    >>> describe("measuring_s", 1560.0)
    ('measuring', '26 min')
    """
    stem, _, unit = name.rpartition("_")
    if unit not in ("m", "hz", "deg", "db", "gb", "s"):
        stem, unit = name, ""
    if name == "cross_range_resolution_m":
        at = {_quantity(float(distance), "m"): _quantity(size, "m") for distance, size in value.items()}
        text = ", ".join(f"{size} at {distance}" for distance, size in at.items())
    elif isinstance(value, dict):
        text = ", ".join(f"{key} {_quantity(item, unit)}" for key, item in value.items())
    elif isinstance(value, list):
        text = (
            " to ".join(_quantity(item, unit) for item in value)
            if name == "band_hz"
            else ", ".join(_quantity(item, unit) for item in value)
        )
    else:
        text = _quantity(value, unit)
    return stem.replace("_", " ").replace("snr", "SNR, at least"), text


def _quantity(value: Any, unit: str) -> str:
    """A number with its unit as text; frequencies in kilohertz, from 1 MHz in megahertz, from 1 GHz in gigahertz."""
    if isinstance(value, list):
        return " to ".join(_quantity(item, unit) for item in value)
    if not isinstance(value, float):
        return "-" if value is None else str(value)
    if unit == "m":
        return length_text(value)
    if unit == "s":
        return duration(value)
    if unit == "hz":
        name, scale = ("GHz", 1e9) if value >= 1e9 else ("MHz", 1e6) if value >= 1e6 else ("kHz", 1e3)
        return f"{value / scale:.6g} {name}"
    return f"{value:.3g} { ({'deg': 'degrees', 'db': 'dB', 'gb': 'GB'}.get(unit, '')) }".rstrip()


def duration(seconds: float) -> str:
    """A time as text, in the unit that gives a small number.

    Examples
    --------
    >>> [duration(t) for t in (0.0042, 0.35, 12.0, 59.9, 1560.0, 9000.0, 2e5)]
    ['4.2 ms', '0.35 s', '12 s', '60 s', '26 min', '2.5 h', '2.3 days']
    """
    for limit, unit, name in ((0.1, 1e-3, "ms"), (100.0, 1.0, "s"), (6000.0, 60.0, "min"), (172800.0, 3600.0, "h")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    return f"{seconds / 86400.0:.1f} days"


def number(value: float | None, form: str, scale: float = 1.0) -> str:
    """A number as text, multiplied by `scale`; a dash if it is None or not finite."""
    return "-" if value is None or not math.isfinite(value) else format(value * scale, form)


def table_of(title: str) -> CleanTable:
    """An empty table: with ruled lines on a terminal, and with only words and numbers for files and pipes."""
    if sys.stdout.isatty():
        return CleanTable(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    return CleanTable(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))


def console(plain_width: int = PLAIN_WIDTH) -> Console:
    """A console to print tables on: as wide as the terminal, or `plain_width` characters for files and pipes."""
    return Console(width=None if sys.stdout.isatty() else plain_width, highlight=False, markup=False)
