"""Diagnosis: mistakes in a sweep, such as conjugated samples or wrong units, recognised from the sweep alone."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.calibration.record import scaled_to_single_precision
from mirrorfold.diagnosis.backlash import backlash_findings
from mirrorfold.diagnosis.exchanged_axes import axis_findings
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.diagnosis.imbalance import imbalance_findings
from mirrorfold.diagnosis.physics import unit_findings, wave_findings
from mirrorfold.diagnosis.quality import sample_findings
from mirrorfold.diagnosis.repeated import repeated_findings
from mirrorfold.diagnosis.scans import scan_findings
from mirrorfold.sweep import is_raster


def diagnose(sweep: xr.Dataset) -> tuple[list[Finding], dict[str, bool]]:
    """Find everything that looks wrong with a valid sweep.

    Parameters
    ----------
    sweep : xarray.Dataset
        A Sweep of pairs, of one moving antenna or of a raster scan.

    Returns
    -------
    findings : list of Finding
        The surest mistakes first; empty for a good sweep.
    judged : dict of bool
        Which mistakes the data suffice to recognise. `waves`: conjugated samples and reversed frequencies; `exchange`:
        transmitters taken for receivers.
    """
    sweep = sweep.assign(s=sweep["s"].copy(data=scaled_to_single_precision(sweep["s"].values)))
    found = sample_findings(sweep)
    sweep = _first_part(sweep)
    found += imbalance_findings(sweep) + repeated_findings(sweep) + backlash_findings(sweep)
    if is_raster(sweep):
        other, judged = scan_findings(sweep)
        other = unit_findings(sweep) or other
    else:
        exchanged = axis_findings(sweep)
        other, judged = (exchanged, {"waves": False, "exchange": True}) if exchanged else wave_findings(sweep)
    return sorted([*found, *other], key=lambda finding: -finding.sure), judged


def _first_part(sweep: xr.Dataset) -> xr.Dataset:
    """The first frame or polarization that is not zero throughout; all of them have the same mistakes."""
    leading = sweep["s"].dims[: sweep["s"].get_axis_num("frequency")]
    if not leading:
        return sweep
    holds = np.any(sweep["s"].values, axis=tuple(range(len(leading), sweep["s"].ndim)))
    first = np.unravel_index(int(np.argmax(holds)), holds.shape)
    return sweep.isel(dict(zip(leading, map(int, first), strict=True)))


__all__ = ["Finding", "diagnose", "sample_findings"]
