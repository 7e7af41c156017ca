"""The verb `compare`: two results side by side."""

from __future__ import annotations

from pathlib import Path

import mirrorfold as mf
from mirrorfold.cli.options import Frame, OptionalOutput
from mirrorfold.cli.results import read
from mirrorfold.cli.study_tables import show_comparison
from mirrorfold.cli.terminal import show_result
from mirrorfold.cli.writing import output_file
from mirrorfold.errors import printable
from mirrorfold.io.suffixes import PICTURES
from mirrorfold.plotting.saving import save_figure


def compare(
    first: Path, second: Path, *, output: OptionalOutput = None, frame: Frame = None, json: bool = False
) -> None:
    """Compare two results.

    Parameters
    ----------
    first
        Reconstruction or image to read (netCDF).
    second
        Another of the same kind.
    output
        Figure (.png, .pdf or .svg), or page with the figure and the numbers (.html), to write.
    json
        Print the comparison as one JSON object.
    """
    from mirrorfold.folding.frames import frame_count
    from mirrorfold.io.files import written_atomically

    if output is not None:
        output_file(output, inputs=[first, second], suffixes=(".html", *PICTURES))
    a, b = (read(path, "reconstruction", "image") for path in (first, second))
    if frame is not None:  # of a recording beside a single result, the recording has the frame
        recordings = [one for one in (a, b) if frame_count(one) is not None]
        a, b = (mf.pick_frame(one, frame) if not recordings or frame_count(one) is not None else one for one in (a, b))
    names = printable(str(first)), printable(str(second))
    found = mf.compare(a, b, names=names)
    if output is not None and output.suffix.lower() == ".html":
        from mirrorfold.reporting.comparison import write_comparison

        write_comparison(a, b, output, names=names)
    elif output is not None:
        with written_atomically(output) as temporary:
            save_figure(mf.plot.compare(a, b, names=names), temporary, dpi=200)
    show_result(found, [] if output is None else [output], show_comparison, json=json)
