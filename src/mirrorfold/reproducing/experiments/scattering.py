"""How walls mirror and scatter from microwaves to light: in a window of frequencies in between they do both.

A wall can be folded about only if it mirrors objects and also scatters enough power back to the radar to be found.
At low frequencies a wall is too smooth to scatter; at high ones it is too rough to mirror. The window between both is
computed for materials and roughnesses by formulas, and the specular loss of the formulas is tested by full waves.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.types import Array
from mirrorfold.describing.planning import DULL_DB, INVISIBLE_DB, Instrument, sample_noise, transmitted_power
from mirrorfold.describing.walls import shares
from mirrorfold.reproducing.findings import Claim, Findings
from mirrorfold.reproducing.parts.scattering_pages import (
    against_waves,
    by_angle,
    by_frequency,
    draw_windows,
    share_table,
    wave_table,
    window_table,
)
from mirrorfold.reproducing.parts.scenes import plan_scene
from mirrorfold.reproducing.parts.window import MATERIALS, OBLIQUE, PAPER_ROUGHNESS, ROUGHNESSES, Window, reflected
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.materials import Dielectric, coherent_factor

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene

MICROWAVE, TERAHERTZ, LIGHT = 10e9, 300e9, 545e12
"""The three frequencies at which claims are judged [Hz]; that of light is for a wavelength of 0.55 um."""

GLOSSY = Dielectric(2.25, 0.0, 0.0, 0.0)
"""Walls at visible wavelengths: refractive index 1.5; those of minerals, glass and cellulose are 1.46 to 1.6."""

RANGE, BANDWIDTH_SHARE, APERTURE = 3.0, 0.034, 0.08
"""For the link budget: range [m], bandwidth as a share of the frequency, and aperture [m]."""

CASES = ((0.05e-3, 0.2e-3, 0.0), (0.1e-3, 0.2e-3, 0.0), (0.1e-3, 0.2e-3, 45.0), (0.05e-3, 1e-3, 45.0))
"""Rms height [m], correlation length [m] and angle of incidence [degree] of the rough lines that full waves are solved
for."""


def run(work: Work) -> Findings:
    """Compute shares of the power, the windows, and the specular loss of rough lines by full waves."""
    frequency = np.geomspace(10e9, 3e12, work.size(200, 60))
    angle = np.radians(np.linspace(0.0, 85.0, work.size(86, 18)))
    measured = _measured(work, CASES if not work.quick else CASES[1:2], work.size(24, 10))
    windows = [Window.of(name, rough) for name in (*MATERIALS, "pec") for rough in ROUGHNESSES]
    numbers = _numbers(windows, measured)
    data = _data(frequency, angle)
    return Findings(
        claims=_claims(numbers),
        numbers=numbers,
        figures={
            "frequency": (
                by_frequency(data),
                "Shares of the power at 45 degrees against frequency, with the published "
                "roughness: mirrored (TE, solid) and scattered (dashed). The levels are those below which "
                "`plan` calls a mirror dull and a wall invisible.",
            ),
            "angle": (
                by_angle(data),
                "The same at 300 GHz against the angle of incidence; dotted: E in the plane of "
                "incidence, which Brewster's angle spoils.",
            ),
            "window": (
                draw_windows(windows),
                "The window for six roughnesses (rms height / correlation length): in each "
                "bar, walls mirror above -25 dB and scatter above -60 dB; the darker part scatters above -40 dB.",
            ),
            "fullwave": (
                against_waves(measured),
                "What roughness leaves of the mirrored amplitude: full waves on "
                "random conducting lines (mean and standard error over seeds) against both formulas.",
            ),
        },
        data=data,
        tables=(share_table(numbers), window_table(windows), wave_table(measured)),
        text=_text(numbers),
        assumptions=(
            "The publication gives no levels for a mirror and for a visible wall. Those of `mirrorfold plan` serve: a "
            f"wall mirrors from {DULL_DB:g} dB of the power at 45 degrees (E perpendicular to the plane of incidence), "
            f"and is visible from {INVISIBLE_DB:g} dB of scattered power. The scattered share counts all directions.",
            "The recommendation's fits are for frequencies up to some hundred gigahertz. They are extrapolated to 3 "
            "THz, and the reflection of the half-space is kept above; for light the refractive index is taken as "
            "1.5. Where the window ends is decided by the exponential of roughness, not by the material: 3 dB of "
            "reflection move it by 8 percent.",
            "Heights are Gaussian with one correlation length. Real walls are rough at several scales, and boards and "
            "plaster also scatter from inside, which makes them visible at lower frequencies than the surface alone.",
        ),
    )


def _measured(work: Work, cases: Sequence[tuple[float, float, float]], seeds: int) -> list[dict[str, float]]:
    """The mirrored amplitude of random rough lines over that of a smooth line, by full waves, for each case."""
    rows = []
    for done, (height, length, degrees) in enumerate(cases):
        rows.append(work.kept(partial(_line, height, length, degrees, seeds)))
        work.step(done + 1, len(cases))
    return rows


def _line(height: float, length: float, degrees: float, seeds: int) -> dict[str, float]:
    """Mirrored amplitude of rough lines over that of a smooth line: mean and standard error over seeds, by full waves,
    and the predictions of both formulas for the same pairs of antennas.
    """
    smooth_scene, roughness = _line_scene(degrees), {"rms_height": height, "correlation_length": length}
    rough_scene = _line_scene(degrees, roughness)
    with warnings.catch_warnings():
        # The warning is about ambiguous ranges; two frequencies resolve none, and none is needed here.
        warnings.filterwarnings("ignore", message=".*strong echoes come from up to")
        smooth = mf.simulate(smooth_scene, solver="fullwave")["s"].values.astype(complex)
        rough = [mf.simulate(rough_scene, solver="fullwave", seed=seed)["s"].values for seed in range(seeds)]
    frequency = smooth_scene.band.frequency
    power = float((np.abs(smooth) ** 2).sum())
    ratio = [float((s * smooth.conj()).sum().real) / power for s in rough]
    tx, rx = rough_scene.array.tx_position, rough_scene.array.rx_position
    incidence = np.arctan(np.abs(rx[None, :, 0] - tx[:, None, 0]) / (2.0 * DISTANCE))
    weight = np.abs(smooth) ** 2 / power
    formulas = {
        name: float((weight * coherent_factor(height, frequency[:, None, None], incidence, correlation_length=L)).sum())
        for name, L in (("ament", None), ("corrected", length))
    }
    error = float(np.std(ratio, ddof=1) / np.sqrt(seeds))
    case = {"rms_height_m": height, "correlation_length_m": length, "incidence_deg": degrees}
    return {**case, "measured": float(np.mean(ratio)), "standard_error": error, **formulas, "seeds": float(seeds)}


DISTANCE = 0.08
"""Distance of the antennas from the line [m], eighty wavelengths: the first Fresnel zone holds 30 heights or more."""


def _line_scene(degrees: float, roughness: dict[str, float] | None = None) -> Scene:
    """A conducting line, and two arrays between which the specular ray meets the line at this angle of incidence."""
    aside = DISTANCE * float(np.tan(np.radians(degrees)))
    line: dict[str, Any] = {"name": "line", "kind": "segment", "start": [-0.05, DISTANCE], "end": [0.05, DISTANCE]}
    places = {"elements": 9, "pitch": 1e-3}
    return plan_scene(
        {
            "name": "a rough line",
            "array": {**places, "center": [-aside, 0.0], "rx": {**places, "center": [aside, 0.0]}},
            "band": {"start": 299.5e9, "stop": 300.5e9, "points": 2},
            "surface": [line | ({"roughness": roughness} if roughness else {})],
        }
    )


def _wall_snr_db(name: str, frequency: float) -> float:
    """Signal over noise [dB] in the image of one resolution cell of an oblique wall that scatters by Lambert's law."""
    electronics = Instrument()
    wavelength = speed_of_light / frequency
    depth = speed_of_light / (2.0 * BANDWIDTH_SHARE * frequency)
    along = min(depth / np.sin(OBLIQUE), wavelength * RANGE / APERTURE / np.cos(OBLIQUE))
    gain = power_ratio_of(electronics.gain_dbi)
    height = RANGE * np.sqrt(4.0 * np.pi / gain)  # height of the beam, which is as wide as it is high
    scattered = float(reflected(name, np.array(frequency), np.array(OBLIQUE), PAPER_ROUGHNESS)[1])
    section = 4.0 * scattered * np.cos(OBLIQUE) ** 2 * along * height
    received = transmitted_power(electronics) * gain**2 * wavelength**2 * section / ((4.0 * np.pi) ** 3 * RANGE**4)
    antennas = int(2.0 * APERTURE / wavelength) + 1
    points = int(2.0 * BANDWIDTH_SHARE * frequency * 6.0 / speed_of_light) + 2
    return float(10.0 * np.log10(received / sample_noise(electronics) * antennas**2 * points))


def _db(share: float) -> float:
    """A share of the power in decibels, at least -400."""
    return float(10.0 * np.log10(max(share, 1e-40)))


def _numbers(windows: list[Window], measured: list[dict[str, float]]) -> dict[str, float]:
    """All numbers that the claims and the page rest on."""
    numbers: dict[str, float] = {}
    for name in (*MATERIALS, "pec"):
        for label, frequency in (("10_ghz", MICROWAVE), ("300_ghz", TERAHERTZ)):
            mirrored, scattered = reflected(name, np.array(frequency), np.array(OBLIQUE), PAPER_ROUGHNESS)
            numbers[f"{name}_mirrored_{label}_db"] = _db(float(mirrored))
            numbers[f"{name}_scattered_{label}_db"] = _db(float(scattered))
        numbers[f"{name}_wall_snr_10_ghz_db"] = _wall_snr_db(name, MICROWAVE)
        numbers[f"{name}_wall_snr_300_ghz_db"] = _wall_snr_db(name, TERAHERTZ)
    smoothest = min(height for height, _ in ROUGHNESSES)
    for label, height, degrees in (("smoothest_45", smoothest, 45.0), ("published_85", PAPER_ROUGHNESS[0], 85.0)):
        angle = np.radians(degrees)
        coherent = float(coherent_factor(height, LIGHT, angle)) ** 2
        numbers[f"{label}_deg_mirrored_light_db"] = _db(float(np.abs(GLOSSY.reflection(LIGHT, angle)) ** 2) * coherent)
    numbers["scattered_light_db"] = _db(float(np.abs(GLOSSY.reflection(LIGHT, OBLIQUE)) ** 2))
    for window in windows:
        key = f"{window.name}_{_roughness_key(window.roughness)}"
        numbers[f"{key}_window_start_ghz"] = window.visible[INVISIBLE_DB] / 1e9
        numbers[f"{key}_window_stop_ghz"] = window.mirrors / 1e9
    for row in measured:
        key = (
            f"line_{_roughness_key((row['rms_height_m'], row['correlation_length_m']))}_{row['incidence_deg']:.0f}_deg"
        )
        for name in ("measured", "standard_error", "corrected", "ament"):
            numbers[f"{key}_{name}"] = row[name]
    for formula in ("corrected", "ament"):
        off = [abs(row["measured"] - row[formula]) / row["standard_error"] for row in measured]
        numbers[f"line_worst_{formula}_standard_errors"] = max(off)
    return numbers


def _roughness_key(roughness: tuple[float, float]) -> str:
    return f"h{1e6 * roughness[0]:.0f}_l{1e6 * roughness[1]:.0f}_um"


def _claims(numbers: dict[str, float]) -> tuple[Claim, ...]:
    """Three published claims, the two edges of the window, and the test of the formulas by full waves."""
    low = [numbers[f"{name}_scattered_10_ghz_db"] for name in MATERIALS]
    mirrored = [numbers[f"{name}_mirrored_300_ghz_db"] for name in MATERIALS]
    scattered = [numbers[f"{name}_scattered_300_ghz_db"] for name in MATERIALS]
    light = max(numbers["smoothest_45_deg_mirrored_light_db"], numbers["published_85_deg_mirrored_light_db"])
    paper = _roughness_key(PAPER_ROUGHNESS)
    starts = [numbers[f"{name}_{paper}_window_start_ghz"] for name in MATERIALS]
    stops = [numbers[f"{name}_{paper}_window_stop_ghz"] for name in MATERIALS]
    both = min(mirrored) > DULL_DB and min(scattered) > INVISIBLE_DB
    off = numbers["line_worst_corrected_standard_errors"]
    source = "section on scattering of building materials"
    return (
        Claim(
            claim="At terahertz frequencies walls are mirrors, and scatter enough to be visible, at once.",
            source=source,
            measured=f"mirrored {min(mirrored):.0f} to {max(mirrored):.0f} dB, scattered {min(scattered):.0f} to "
            f"{max(scattered):.0f} dB at 300 GHz",
            verdict="agrees" if both else "differs",
            why=f"All of {', '.join(MATERIALS)} at 45 degrees with the published roughness: agrees if all mirror above "
            f"{DULL_DB:g} dB and scatter above {INVISIBLE_DB:g} dB.",
        ),
        Claim(
            claim="To microwaves walls are mirrors alone: oblique ones are invisible.",
            source=source,
            measured=f"scattered {min(low):.0f} to {max(low):.0f} dB at 10 GHz, median {np.median(low):.1f} dB",
            verdict="agrees" if np.median(low) < INVISIBLE_DB else "differs",
            why=f"Agrees if the median of the five materials is below {INVISIBLE_DB:g} dB. Some lie above: scattering "
            "sets in by degrees, with the cube of the frequency where the correlation is shorter than the wavelength, "
            "and it is a matter of dynamic range what is called invisible.",
        ),
        Claim(
            claim="To light walls scatter alone: they are visible and no mirrors.",
            source=source,
            measured=f"mirrored below {max(light, -100.0):.0f} dB, scattered {numbers['scattered_light_db']:.0f} dB",
            verdict="agrees" if light < DULL_DB and numbers["scattered_light_db"] > INVISIBLE_DB else "differs",
            why="The smoothest wall of all (10 um) at 45 degrees, and the published roughness at 85 degrees.",
        ),
        Claim(
            claim="Where does the window of frequencies begin and end, for the published roughness?",
            source="",
            measured=f"from {min(starts):.0f}-{max(starts):.0f} GHz to {min(stops):.0f}-{max(stops):.0f} GHz",
            verdict="new",
            why="The range of each edge over the five materials; the table has all roughnesses.",
        ),
        Claim(
            claim="Do full waves lose as much in the specular direction as the formula with correlation length says?",
            source="",
            measured=f"within {off:.1f} standard errors; Ament's for slow heights is up to "
            f"{numbers['line_worst_ament_standard_errors']:.0f} off",
            verdict="new",
            why="Random conducting lines at 300 GHz, the integral equation, the mean of the field over seeds.",
        ),
    )


def _text(numbers: dict[str, float]) -> tuple[str, ...]:
    """What can be learnt."""
    paper = _roughness_key(PAPER_ROUGHNESS)
    return (
        "One quantity decides: the rms height in wavelengths, times the cosine of the angle. As long as it is small, "
        "the power that leaves the mirrored beam grows with its square; beyond one radian of phase the exponential "
        "puts the mirror out within half a decade. So the upper edge of the window is sharp and belongs to the "
        f"roughness: {numbers[f'concrete_{paper}_window_stop_ghz']:.0f} GHz for concrete with the published 50 um, "
        f"{numbers['concrete_h10_l200_um_window_stop_ghz']:.0f} GHz with 10 um.",
        "The lower edge is soft. Scattering rises with the square or the cube of frequency, so 20 dB more of dynamic "
        "range open the window by a factor of four to five, downwards. Noise is not what closes it: with the "
        "electronics that `plan` assumes, one resolution cell of oblique concrete at 3 m stands "
        f"{numbers['concrete_wall_snr_10_ghz_db']:.0f} dB above the noise at 10 GHz and "
        f"{numbers['concrete_wall_snr_300_ghz_db']:.0f} dB at 300 GHz. At 10 GHz an aperture of 8 cm is less than "
        "three wavelengths: side lobes of the glints, not noise, would cover what is 50 dB below them.",
        "Correlation lengths below the wavelength help mirrors: part of the fine structure scatters into waves that "
        "carry no power away. Ament's formula, which knows the height alone, puts the specular loss at 300 GHz for a "
        "correlation of 0.2 mm twice as high in dB as it is. Full waves tell the two formulas apart.",
    )


def _data(frequency: Array, angle: Array) -> xr.Dataset:
    """Shares of the power by material, roughness and frequency, and by angle at 300 GHz [dB]."""
    names = (*MATERIALS, "pec")

    def decibels(shares_: list[Any]) -> Array:
        return np.asarray(10.0 * np.log10(np.maximum(np.array(shares_, dtype=float), 1e-20)))

    over_f = [[reflected(name, frequency, np.array(OBLIQUE), rough) for rough in ROUGHNESSES] for name in names]
    over_a = [reflected(name, np.array(TERAHERTZ), angle, PAPER_ROUGHNESS) for name in names]
    tm = [shares(name, np.array(TERAHERTZ), angle, PAPER_ROUGHNESS)[0][1] for name in names]
    by_frequency = decibels(over_f)
    by_angle = decibels(over_a)
    db = {"units": "dB"}
    place = ("material", "roughness", "frequency")
    return xr.Dataset(
        {
            "mirrored": (place, by_frequency[:, :, 0], {**db, "long_name": "mirrored share at 45 degrees, TE"}),
            "scattered": (place, by_frequency[:, :, 1], {**db, "long_name": "scattered share at 45 degrees"}),
            "mirrored_te": (
                ("material", "angle"),
                by_angle[:, 0],
                {**db, "long_name": "at 300 GHz, published roughness"},
            ),
            "mirrored_tm": (
                ("material", "angle"),
                decibels(tm),
                {**db, "long_name": "at 300 GHz, published roughness"},
            ),
            "scattered_by_angle": (("material", "angle"), by_angle[:, 1], {**db, "long_name": "likewise"}),
            "rms_height": ("roughness", [height for height, _ in ROUGHNESSES], {"units": "m"}),
            "correlation_length": ("roughness", [length for _, length in ROUGHNESSES], {"units": "m"}),
        },
        coords={
            "material": list(names),
            "frequency": ("frequency", frequency, {"units": "Hz"}),
            "angle": ("angle", np.degrees(angle), {"units": "degree"}),
        },
    )
