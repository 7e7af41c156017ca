"""Diagnosis: what is wrong with a sweep, told from the sweep alone."""

from __future__ import annotations

import xarray as xr

from mirrorfold.calibration.record import moderate
from mirrorfold.diagnosis.exchanged_axes import axis_findings
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.diagnosis.physics import doubt_findings, wave_findings
from mirrorfold.diagnosis.quality import sample_findings
from mirrorfold.diagnosis.scans import scan_findings
from mirrorfold.sweep import is_raster


def diagnose(sweep: xr.Dataset) -> tuple[list[Finding], dict[str, bool]]:
    """Everything that looks wrong with a valid sweep.

    Parameters
    ----------
    sweep : xarray.Dataset
        A Sweep of pairs, of one moving antenna or of a raster scan.

    Returns
    -------
    findings : list of Finding
        The surest mistakes first, none for a good sweep.
    judged : dict
        What could be judged at all: `waves` for the classic mistakes, `exchange` for transmitters and receivers.
    """
    sweep = sweep.assign(s=sweep["s"].copy(data=moderate(sweep["s"].values)))
    found = sample_findings(sweep)
    if is_raster(sweep):
        other, judged = scan_findings(sweep)
        other = doubt_findings(sweep) or other
    else:
        exchanged = axis_findings(sweep)
        other, judged = (exchanged, {"waves": False, "exchange": True}) if exchanged else wave_findings(sweep)
    return sorted([*found, *other], key=lambda finding: -finding.sure), judged


__all__ = ["Finding", "diagnose", "sample_findings"]
