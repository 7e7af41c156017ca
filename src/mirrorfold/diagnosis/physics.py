"""The classic mistakes in a sweep of pairs, or of one moving antenna, as findings.

First the unit of the positions is checked, then whether echoes add up in phase at all. If they do, `mistakes` explains
their wavefronts. If they do not, coarser tests remain: the size of the array, and the waves directly between antennas.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.plausible import FINE_PITCH, pitch
from mirrorfold.common.units import UNITS
from mirrorfold.diagnosis.direct import direct_findings
from mirrorfold.diagnosis.few_antennas import few_antenna_findings
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.diagnosis.mistakes import SURE_ENOUGH, Explanation, explain
from mirrorfold.diagnosis.neighbours import phase_findings
from mirrorfold.diagnosis.orders import order_findings
from mirrorfold.diagnosis.sharpness import sharpness_findings
from mirrorfold.diagnosis.wavefronts import CURVATURE_STEP, IN_PHASE, Wavefronts, in_phase, wavefronts
from mirrorfold.sweep import is_monostatic, place_doubts, wave_speed
from mirrorfold.sweep.pairs import Pairs, on_a_line, pairs_of

SUSPECT_PITCH = 15.0
"""Smallest pitch, in wavelengths, at which the positions are suspected to be in another unit. It is less than the
`COARSE_PITCH` from which on distances alone raise a doubt: here the waves must fit the other unit, too."""

GRATING_PITCH = 0.75
"""Pitch in wavelengths from which echoes have grating lobes at the mirrored angle, 42 degrees off broadside or less."""

RANGE_END = 0.1
"""Share of the ambiguous range, at its end, in which strong echoes suggest that later ones have wrapped around."""

MOST_ECHOES = (0.1, 0.9)
"""Quantiles of the ranges of echoes between which the curvature of their waves must change to tell their order."""

SURE_OF_UNIT = 0.97
"""Certainty that the positions are in another unit, where the waves fit it: hundreds of pairs add up in phase only at
the right positions, not by chance."""

SURE_OF_DISTANCE = 0.9
"""Certainty that a unit is wrong, judged by distances alone. Antennas could stand so far apart that the direct wave
between them wraps around the ambiguous range, but nobody sets them up like that."""


def wave_findings(sweep: xr.Dataset) -> tuple[list[Finding], dict[str, bool]]:
    """Find the classic mistakes that show in the waves of a valid sweep of pairs, or of one moving antenna.

    Returns
    -------
    findings : list of Finding
    judged : dict of bool
        `waves`: whether the array and the echoes allow a judgement of all mistakes; false, too,
        where delays tell nothing. `exchange`: whether an exchange of transmitters and receivers would
        show; where both stand at the same places, reciprocity hides the exchange, and it does no harm. Both are false
        where the waves are too flat.
    """
    if "rx" not in sweep.dims and sweep.attrs.get("scene_center") is not None:  # ranges count from the scene's centre
        found, judged = sharpness_findings(sweep)
        return found, {"waves": judged, "exchange": False}
    every = pairs_of(sweep)
    if is_monostatic(sweep):
        # What returns inside the instrument is the same at all places: a flat wave from range zero, as if time ran
        # backwards from the end of the ambiguous range.
        every = replace(every, s=every.s - every.s.mean(axis=1, keepdims=True))
    if not is_monostatic(sweep) and (found := few_antenna_findings(every)):
        return found, {"waves": False, "exchange": False}
    pairs = on_a_line(every)
    exchange = len(pairs.tx) == len(pairs.rx) and not _abreast(pairs)
    unit = _unit(pairs)
    if unit is not None:
        pairs = pairs.scaled(UNITS[unit])
    waves = wavefronts(pairs, exchange=exchange)
    if waves is None or in_phase(waves) < IN_PHASE:
        found = [_unit_finding(unit)] if unit is not None else unit_findings(sweep)
        if not found and "rx" in sweep.dims:
            found = direct_findings(every)
            if not found and waves is not None:
                found = order_findings(pairs, waves)
        return found or phase_findings(sweep), {"waves": False, "exchange": False}
    found = order_findings(pairs, waves) if unit is None else []
    found = found or phase_findings(sweep)
    if found:
        return found, {"waves": False, "exchange": False}
    found = [_unit_finding(unit)] if unit else []
    made = explain(pairs, waves)
    delays_tell = _delays_tell(pairs, waves, made)
    if not delays_tell:
        made = replace(made, reversed=False, offset=0.0, pitch_halved=False)
    found += _findings(made, speed_of_light / wave_speed(sweep))
    return found, {"waves": made.waves_suffice and delays_tell, "exchange": made.exchange_recognisable}


def _delays_tell(pairs: Pairs, waves: Wavefronts, made: Explanation) -> bool:
    """Whether delays tell a reversed order of the frequencies, and a range offset, from a correct sweep.

    They do not where a short array is so coarse that phases do not tell the side of an echo. The phases of a wave from
    u are also those of its grating lobe at ``u - wavelength / pitch``, on the other side, whose delays run the other
    way; the steps of a moving antenna count on both ways. Then curvature alone tells the order: waves of later echoes
    are curved less, by the phase ``k a^2 / 2r`` at the ends of the array, for elements up to a from its middle. It does
    not tell where all echoes have nearly the same. Nor does it where some stand at the end of the ambiguous range R,
    have probably wrapped around, and ``k a^2 / 2R`` is small.
    """
    if _step(pairs) * (2.0 if pairs.moving else 1.0) < GRATING_PITCH * pairs.wavelength:
        return True
    farthest = float(np.linalg.norm(np.concatenate([pairs.tx, pairs.rx]), axis=1).max())
    bend = 0.5 * pairs.wavenumber.mean() * farthest**2
    late = bool((waves.range > (1.0 - RANGE_END) * waves.ambiguous_range).any())
    backwards = made.conjugated != made.reversed
    near, far = np.quantile(waves.ambiguous_range - waves.range if backwards else waves.range, MOST_ECHOES)
    alike = bend * (far - near) < CURVATURE_STEP * near * far
    return not (alike or (late and bend < CURVATURE_STEP * waves.ambiguous_range))


def _findings(made: Explanation, index: float) -> list[Finding]:
    """Findings of all mistakes in an explanation, where it is sure enough.

    `index` is the speed of light over the wave speed, because the length of a cable is stated as for light in vacuum.
    """
    found = []
    if made.sure >= SURE_ENOUGH:
        if made.conjugated:
            what = (
                "The waves contract instead of expanding: the samples are conjugated (the other time convention), or "
                "I and Q are exchanged, which is the same but for a constant phase."
            )
            found.append(Finding("conjugated", what, made.sure, "--conjugate"))
        if made.reversed:
            what = "The delays run against the phases: the samples are stored from the highest frequency to the lowest."
            found.append(Finding("frequency-reversed", what, made.sure, "--reverse-frequency"))
        if made.exchanged:
            what = (
                "The waves fit when transmitters and receivers are exchanged: their positions are the wrong way round."
            )
            found.append(Finding("tx-rx-exchanged", what, made.sure, "--swap-tx-rx"))
    if made.pitch_halved and made.sure >= SURE_ENOUGH:
        what = "Waves bend as if the antennas stood twice as far apart as the file says: their pitch is halved."
        remedy = "measure the step of the stage, and import the sweep again with it"
        found.append(Finding("pitch-halved", what, made.offset_sure, remedy, by_command=False))
    elif made.offset and made.sure >= SURE_ENOUGH:
        direction, error = "far" if made.offset > 0 else "near", made.offset_error
        cable = _rounded(2.0 * made.offset * index, 2.0 * error * index)
        what = (
            f"Echoes stand {_rounded(abs(made.offset), error)} m too {direction} for the curvature of their waves "
            f"(+-{_rounded(error, error)} m): a delay of {cable} m of cable is left in the sweep."
        )
        found.append(Finding("range-offset", what, made.offset_sure, f"--cable-length {cable}"))
    return found


def _rounded(value: float, error: float) -> str:
    """A number as text, with so many decimals that the last one is at most half its error."""
    return f"{value:.{max(0, int(np.ceil(-np.log10(0.5 * error))))}f}"


def unit_findings(sweep: xr.Dataset) -> list[Finding]:
    """Findings of positions or directions that are probably in another unit, judged by their size alone."""
    return [Finding(doubt.name, doubt.what, SURE_OF_DISTANCE, doubt.option) for doubt in place_doubts(sweep)]


def _unit_finding(unit: str) -> Finding:
    """The finding that positions are in `unit`, such as "mm", instead of metres."""
    what = (
        f"The waves fit to positions a factor {1 / UNITS[unit]:g} smaller: they are in {_NAMES[unit]}, not in metres."
    )
    return Finding("position-unit", what, SURE_OF_UNIT, f"--position-unit {unit}")


_NAMES = {"mm": "millimetres", "cm": "centimetres", "um": "micrometres", "inch": "inches"}


def _unit(pairs: Pairs) -> str | None:
    """The unit, such as "mm", in which the positions of a far too coarse array make sense and fit the waves best.

    None where the array is not too coarse, or no unit fits.
    """
    step = _step(pairs) / pairs.wavelength
    if step < SUSPECT_PITCH:
        return None
    fitting = {}
    for unit in _NAMES:
        if FINE_PITCH[0] <= step * UNITS[unit] <= FINE_PITCH[1]:
            waves = wavefronts(on_a_line(pairs.scaled(UNITS[unit])), exchange=False)
            if waves is not None and in_phase(waves) >= IN_PHASE:
                fitting[unit] = in_phase(waves)
    return max(fitting, key=fitting.__getitem__) if fitting else None


def _step(pairs: Pairs) -> float:
    """Pitch of the finer array [m]; zero for single places."""
    return min(filter(None, (pitch(pairs.tx), pitch(pairs.rx))), default=0.0)


def _abreast(pairs: Pairs) -> bool:
    """Whether transmitters and receivers stand at the same places along the array, to a tenth of a wavelength (rms).

    Then the paths of pairs are the same after an exchange, or all differ alike: it would be judged by errors alone.
    """
    return bool(np.sqrt(np.mean(((pairs.tx - pairs.rx) @ pairs.axes[0]) ** 2)) < 0.1 * pairs.wavelength)
