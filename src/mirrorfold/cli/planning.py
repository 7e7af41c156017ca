"""The verb `plan`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

import mirrorfold as mf
from mirrorfold.cli.options import OptionalOutput, parse_numbers
from mirrorfold.cli.study_tables import show_plan
from mirrorfold.cli.terminal import show_files, show_info, show_json
from mirrorfold.cli.writing import output_file
from mirrorfold.common.units import Frequency, Length, Time
from mirrorfold.errors import InputError
from mirrorfold.plotting.saving import save_figure

Level = Annotated[float, Parameter(allow_leading_hyphen=True)]


def plan(
    *,
    band: str,
    points: int,
    aperture: Length,
    pitch: Length,
    range: Length,
    rx_aperture: Length | None = None,
    rx_pitch: Length | None = None,
    material: list[str] | None = None,
    roughness: str = "50",
    target: float = 1e-3,
    leg: Length | None = None,
    detection_db: Level = 13.0,
    power_dbm: Level = 0.0,
    gain_dbi: Level = 20.0,
    noise_figure_db: Level = 20.0,
    if_bandwidth: Frequency = 1e4,
    settling: Time = 5e-5,
    moving: Time = 0.0,
    output: OptionalOutput = None,
    json: bool = False,
) -> None:
    """Plan a measurement.

    Parameters
    ----------
    band
        Lowest and highest frequency as START:STOP [Hz], for example 270GHz:300GHz.
    points
        Number of frequencies.
    aperture
        Length of the transmitting array [m].
    pitch
        Distance of neighbouring antennas [m].
    range
        Distance to the farthest object in line of sight [m].
    rx_aperture
        Length of the receiving array, where it differs [m].
    rx_pitch
        Distance of neighbouring receiving antennas, where it differs [m].
    material
        Material of the walls: pec, plasterboard, concrete, glass, wood or marble; several may be given.
    roughness
        Rms height of the walls, or height and correlation length as H,L [um].
    target
        Radar cross section to be seen in one resolution cell [m^2].
    leg
        Length that each bounce adds to the range [m]; half the range by default.
    detection_db
        Signal over noise in the image from which an object counts as seen [dB].
    power_dbm
        Transmitted power [dBm].
    gain_dbi
        Gain of each antenna [dBi].
    noise_figure_db
        Noise figure of the receiver [dB].
    if_bandwidth
        Bandwidth of the receiver's filter [Hz].
    settling
        Time from one sample to the next [s].
    moving
        Time that a stage takes from one position to the next [s].
    output
        Picture to write (.png, .pdf or .svg).
    json
        Print all numbers as one JSON object.
    """
    from mirrorfold.describing.planning import Instrument
    from mirrorfold.io.files import written_whole

    if output is not None:
        output_file(output, suffixes=PICTURES)
    heights = parse_roughness(roughness)
    found = mf.plan(
        band=parse_band(band),
        points=points,
        aperture=aperture,
        pitch=pitch,
        range=range,
        rx_aperture=rx_aperture,
        rx_pitch=rx_pitch,
        materials=material or ["plasterboard"],
        roughness=heights,
        target=target,
        leg=leg,
        detection_db=detection_db,
        instrument=Instrument(
            power_dbm=power_dbm,
            gain_dbi=gain_dbi,
            noise_figure_db=noise_figure_db,
            if_bandwidth=if_bandwidth,
            settling=settling,
            moving=moving,
        ),
    )
    files = []
    if output is not None:
        from mirrorfold.plotting import planning as plot_plan

        with written_whole(output) as temporary:
            save_figure(plot_plan.plan(found, roughness=heights, detection_db=detection_db), temporary)
        files.append(str(output))
    if json:
        show_json(found.but(files=files))
        return
    show_plan(found)
    show_info({name: value for name, value in found.items() if name not in UNLISTED})
    show_files(files)


UNLISTED = ("walls", "link_budget", "hidden_quality", "kind", "files")
"""Facts of a plan that have tables of their own, or are not for people."""

PICTURES = (".png", ".pdf", ".svg")


def parse_band(text: str) -> tuple[float, float]:
    """Two frequencies [Hz] from START:STOP.

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
    """Rms height and correlation length [m] from H or H,L, in micrometres unless they have units.

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
