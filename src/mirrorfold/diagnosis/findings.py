"""The result of a diagnosis: what is wrong with a sweep, how sure that is, and the command that corrects it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass

CERTAIN = 1.0
"""Certainty of findings that follow from the numbers without any doubt."""

PLACES = {
    "tx": "transmitters",
    "rx": "receivers",
    "position": "positions",
    "azimuth": "azimuths",
    "elevation": "elevations",
}
"""What sentences call the places along each dimension of the samples."""


@dataclass(frozen=True)
class Finding:
    """One mistake in a sweep.

    Attributes
    ----------
    name : str
        A name for programs: "conjugated", "frequency-reversed", "tx-rx-exchanged", "range-offset", "pitch-halved",
        "position-unit", "range-reversed", "nan", "constant", "dead-channels", "saturated-channels", "noise-channels",
        "bad-frequencies", "falling-frequencies", "non-uniform-steps", "frequency-unit", "angle-unit", "no-phase",
        "phase-unit", "time-domain", "iq-imbalance", "axes-exchanged", "positions-reversed", "samples-unordered",
        "element-phases", "silent-frequencies", "repeated-samples", "stuck-stage", "stage-backlash", "antenna-order".
    what : str
        A sentence for people.
    sure : float
        How sure the finding is, between 0 and 1.
    remedy : str
        Arguments of ``mirrorfold calibrate SWEEP.nc -o OUT.nc`` that correct the mistake; advice where none do.
    by_command : bool
        Whether `remedy` holds arguments, not advice.
    """

    name: str
    what: str
    sure: float
    remedy: str
    by_command: bool = True

    def command(self, path: str = "SWEEP.nc") -> str:
        """The command that corrects the mistake in the file at `path`, or the advice."""
        if not self.by_command:
            return self.remedy
        stem, dot, ending = path.rpartition(".")
        target = f"{stem}-repaired.{ending}" if dot and "/" not in ending else f"{path}-repaired.nc"
        return f"mirrorfold calibrate {shlex.quote(path)} -o {shlex.quote(target)} {self.remedy}"

    def sentence(self) -> str:
        """What was found and, unless it is certain, how sure that is."""
        return f"{self.what} ({100 * self.sure:.0f} % sure)" if self.sure < CERTAIN else self.what
