"""Patterns of the names of variables, in lower case, by what these hold, and the units with which names end."""

from __future__ import annotations

import re

from mirrorfold.common.units import KINDS, unit_named

FREQUENCY = re.compile(r"^f$|^fr|freq|^f_?axis|^f?_?(k|m|g|t)?hz$")
TIME = re.compile(r"^t$|^time|^t_?axis|_time$|^t_?(m|u|n|p)?s$")
REFERENCE = re.compile(r"^r_?0$|ref(erence)?_?range|range_?ref|^rref|scene_?range|^r_?ref")
SPEED = re.compile(r"velocity|speed|^c$|^c_?0$|^v$")
REAL = re.compile(r"(^|[_.])(re|real)($|[_.])|_re$|real$", re.IGNORECASE)
IMAGINARY = re.compile(r"(^|[_.])(im|imag|imaginary)($|[_.])|_im$|imag$", re.IGNORECASE)
MAGNITUDE = re.compile(r"^(s\d\d_?)?(mag(nitude)?|amp(l(itude)?)?|abs|db)(_?db)?$|_(mag|magnitude|abs|amp|db)$")
PHASE = re.compile(r"phase|angle|^arg|_ph(_?deg)?$|_deg$")
AZIMUTH, ELEVATION = re.compile(r"^az"), re.compile(r"^el(ev|$)|^el_")
HERTZ = r"(?:_?[kmgt]?hz)?"
"""Pattern of a unit of frequency that may stand at the end of a name."""

START = re.compile(rf"^f.*(start|min|low|begin)|^f_?(0|1|lo){HERTZ}$")
STOP = re.compile(rf"^f.*(stop|end|max|high)|^f_?(1|2|n|hi){HERTZ}$")
STEP = re.compile(rf"^f.*(step|delta|spacing)|^d(elta)?_?f(req\w*)?{HERTZ}$")
COUNT = re.compile(r"^n(um)?_?f(req\w*)?$|^f(req\w*)?_?(points|count)$")
"""Single numbers that describe equal steps of frequency; ``f1`` is the start, or the stop where there is ``f0``."""

PLACES = re.compile(r"pos|place|loc|coord|antenna|elem|sensor|phase_?cent|xyz")
TRANSMIT, RECEIVE = re.compile(r"tx|trans|source|emit|^t_"), re.compile(r"rx|rec|^r_|detect")
CHANNELS = re.compile(r"chan|pair")
LENGTH_UNIT = rf"(?:_?(?:{'|'.join(KINDS['length'])}))?"
"""Pattern of a unit of length that may stand at the end of a name."""

COORDINATE = re.compile(rf"^(?:ant|antenna|pos|el|elem|sensor|radar)?_?([xyz])_?(?:c|pos|axis)?{LENGTH_UNIT}$")
TX_COORDINATE = re.compile(
    rf"^(?:tx|trans(?:mitter)?|t)_?(?:pos)?_?([xyz]){LENGTH_UNIT}$|^([xyz])_?(?:tx|t){LENGTH_UNIT}$"
)
RX_COORDINATE = re.compile(
    rf"^(?:rx|rec(?:eiver)?|r)_?(?:pos)?_?([xyz]){LENGTH_UNIT}$|^([xyz])_?(?:rx|r){LENGTH_UNIT}$"
)

BEFORE_UNIT = {
    "frequency": r"f|freq|frequency|frequencies",
    "time": r"t|time|times",
    "length": r"[xyz]|d[xyz]|pos|position|place|pitch|step|spacing",
    "angle": r"az|azimuth|el|elevation|angle|theta|phi",
}
"""Patterns of what may stand before a unit without a mark between both, as in ``fGHz``."""


def unit_of_name(name: str, kind: str, said: str = "") -> str | None:
    """The unit of a variable, by the unit `said` in its file, else by the end of its name; None where neither tells.

    Examples
    --------
    >>> unit_of_name("fGHz", "frequency"), unit_of_name("tx_x_mm", "length"), unit_of_name("axis", "time")
    ('GHz', 'mm', None)
    """
    unit = unit_named(said) if said else None
    if unit in KINDS[kind]:
        return unit
    text = name.lower()
    for unit in KINDS[kind]:
        if re.search(rf"(?:[^a-z]|(?:^|[^a-z])(?:{BEFORE_UNIT[kind]})){re.escape(unit.lower())}[\])]?$", text):
            return unit
    return None
