"""What a diagnosis says: what is wrong, how sure that is, and the command that puts it right."""

from __future__ import annotations

from dataclasses import dataclass

CERTAIN = 1.0


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a sweep.

    Attributes
    ----------
    name : str
        For programs: "conjugated", "frequency-reversed", "tx-rx-exchanged", "range-offset", "position-unit",
        "range-reversed", "nan", "dead-channels", "saturated-channels", "noise-channels", "bad-frequencies",
        "non-uniform-steps", "aliasing", "grating-lobes", "not-reciprocal", "no-echo", "frequency-unit", "angle-unit",
        "no-phase", "axes-exchanged".
    what : str
        For people, one sentence.
    sure : float
        Between 0 and 1.
    remedy : str
        Arguments of ``mirrorfold calibrate SWEEP.nc -o OUT.nc`` that put it right, or advice where nothing does.
    by_command : bool
        Whether `remedy` is such arguments.
    """

    name: str
    what: str
    sure: float
    remedy: str
    by_command: bool = True

    def command(self, path: str = "SWEEP.nc") -> str:
        """The command that puts it right, or the advice."""
        if not self.by_command:
            return self.remedy
        stem, dot, ending = path.rpartition(".")
        target = f"{stem}-repaired.{ending}" if dot and "/" not in ending else f"{path}-repaired.nc"
        return f"mirrorfold calibrate {path} -o {target} {self.remedy}"

    def sentence(self) -> str:
        """All of it in one line."""
        return f"{self.what} ({100 * self.sure:.0f} % sure)" if self.sure < CERTAIN else self.what
