"""Calibration: from the sweep as it was measured to the sweep as an ideal instrument would have measured it.

Each step takes a sweep and returns a new one, with one more line in its attribute `processing`. The raw sweep is not
changed, so a step can be left out by starting again from it. `estimate_elements`, `estimate_displacement` and
`find_bad` measure what a step needs.
"""

from mirrorfold.calibration.autofocus import autofocus
from mirrorfold.calibration.background import subtract_background, subtract_mean
from mirrorfold.calibration.displacement import displace_receivers, estimate_displacement
from mirrorfold.calibration.elements import ElementCalibration, apply_elements, estimate_elements
from mirrorfold.calibration.files import load_elements, save_elements
from mirrorfold.calibration.gate import time_gate
from mirrorfold.calibration.masking import Bad, find_bad, mask_bad
from mirrorfold.calibration.reference import normalise_by_reference
from mirrorfold.calibration.repairs import (
    conjugate,
    remove_cable,
    reverse_frequency,
    scale_angles,
    scale_frequencies,
    scale_positions,
    sort_frequencies,
    swap_axes,
    swap_iq,
    swap_tx_rx,
)

__all__ = [
    "Bad",
    "ElementCalibration",
    "apply_elements",
    "autofocus",
    "conjugate",
    "displace_receivers",
    "estimate_displacement",
    "estimate_elements",
    "find_bad",
    "load_elements",
    "mask_bad",
    "normalise_by_reference",
    "remove_cable",
    "reverse_frequency",
    "save_elements",
    "scale_angles",
    "scale_frequencies",
    "scale_positions",
    "sort_frequencies",
    "subtract_background",
    "subtract_mean",
    "swap_axes",
    "swap_iq",
    "swap_tx_rx",
    "time_gate",
]
