"""The verb `plan`: what a measurement will show, before it is made."""

from __future__ import annotations

from typing import Any

import mirrorfold as mf
from mirrorfold.cli.options import OptionalOutput, parse_numbers
from mirrorfold.cli.study_tables import show_plan
from mirrorfold.cli.terminal import show_files, show_info, show_json
from mirrorfold.cli.writing import output_file
from mirrorfold.common.settings import takes
from mirrorfold.describing.plan_settings import Instrument, PlanSettings
from mirrorfold.errors import InputError
from mirrorfold.io.suffixes import PICTURES
from mirrorfold.plotting.saving import save_figure


@takes(PlanSettings, Instrument, options=True)
def plan(
    *,
    band: str,
    material: list[str] | None = None,
    roughness: str | None = None,
    output: OptionalOutput = None,
    json: bool = False,
    **given: Any,
) -> None:
    """Plan a measurement.

    Parameters
    ----------
    band
        Lowest and highest frequency as START:STOP [Hz], for example 270GHz:300GHz.
    **given
    material
        Material of the walls: pec, plasterboard, concrete, glass, wood or marble; several may be given. By default
        plasterboard.
    roughness
        Rms height of the walls, or height and correlation length as H,L [um]; 50 by default.
    output
        Picture to write (.png, .pdf or .svg).
    json
        Print all numbers as one JSON object.
    """
    from mirrorfold.io.files import written_atomically

    if output is not None:
        output_file(output, suffixes=PICTURES)
    electronics = {name: given.pop(name) for name in Instrument.rules() if name in given}
    if material:
        given["materials"] = material
    if roughness is not None:
        given["roughness"] = parse_roughness(roughness)
    asked = PlanSettings(band=parse_band(band), **given)
    found = mf.plan(**vars(asked), instrument=Instrument(**electronics))
    files = []
    if output is not None:
        from mirrorfold.plotting import planning as plot_plan

        with written_atomically(output) as temporary:
            save_figure(plot_plan.plan(found, roughness=asked.roughness, detection_db=asked.detection_db), temporary)
        files.append(str(output))
    if json:
        show_json(found.but(files=files))
        return
    show_plan(found)
    show_info({name: value for name, value in found.items() if name not in UNLISTED})
    show_files(files)


UNLISTED = ("walls", "link_budget", "hidden_quality", "kind", "files")
"""Facts of a plan that are not listed by name and value: they have tables of their own, or are not for people."""


def parse_band(text: str) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] from the text START:STOP.

    Raises
    ------
    InputError
        If the text is something else.
    """
    form = "START:STOP in hertz or with units, for example 270GHz:300GHz"
    numbers = parse_numbers(text, "band", form, "frequency")
    if len(numbers) != 2:
        raise InputError(f"--band is {text!r}, expected {form}")
    return numbers[0], numbers[1]


def parse_roughness(text: str) -> tuple[float, float | None]:
    """Rms height and correlation length [m] from the text H or H,L, in micrometres unless it has units.

    Raises
    ------
    InputError
        If the text is something else.
    """
    form = "H or H,L in micrometres or with units, for example 50,200 or 0.05mm,0.2mm"
    numbers = parse_numbers(text, "roughness", form, "length", mark=",", unit="um")
    if len(numbers) not in (1, 2):
        raise InputError(f"--roughness is {text!r}, expected {form}")
    return numbers[0], numbers[1] if len(numbers) == 2 else None
