"""Sessions of Acconeer's A121 sensors (HDF5): complex samples over distance, frame by frame.

The distance of a point is its number times the base step, 2.5 mm. A session samples several stretches of range
(subsweeps), each with its own pulse and step. Source: Acconeer AB, "A121 Handbook" (2022), sections on sampling and on
profiles.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.errors import InputError
from mirrorfold.io.readers import Reader, hdf5
from mirrorfold.io.readers.contents import Contents, Variable

CARRIER = 60.5e9
"""Centre of the transmitted pulses [Hz]."""

FRAMES = "sessions.session_0.group_0.entry_0.result.frame"
METADATA = "sessions.session_0.group_0.entry_0.metadata"
CONFIG = "sessions.session_0.session_config"
"""Names of the variables of the first sensor of the first session."""

SUFFIXES = (".h5", ".hdf5")


def read(path: Path) -> Contents:
    """Read the first sensor of a session: ``iq(frame, range)`` over ``range`` [m], in the finest of all steps.

    Where stretches overlap, the one with the finer step counts.
    """
    held = hdf5.read(path)
    for name in (FRAMES, METADATA, CONFIG):
        if name not in held.variables:
            raise InputError(f"{path}: holds no {name!r}, expected a recorded session of an A121 sensor")
    raw = held.array(FRAMES)
    if raw.ndim != 3 or raw.dtype.kind != "c" or 0 in raw.shape:
        raise InputError(f"{path}: its frames have shape {raw.shape} and type {raw.dtype}, expected complex ones")
    metadata, config = (_json(path, name, str(held.array(name))) for name in (METADATA, CONFIG))
    stretches = _stretches(path, metadata, config, raw.shape[-1])
    distance, iq = _joined(raw.mean(axis=1), stretches)
    variables = {
        "iq": Variable.of(iq, ("frame", "range")),
        "range": Variable.of(distance, ("range",), {"units": "m"}),
        "antenna": Variable.of(np.zeros((1, 3)), ("position", "axis"), {"units": "m"}),
    }
    variables |= {
        f"subsweep{n}": Variable.of(raw[:, :, part], ("frame", "sweep", "range"), {"start": start, "step": step})
        for n, (part, start, step) in enumerate(stretches)
    }
    mapping = {
        "s": {"variable": "iq", "dims": ["frame", "range"]},
        "range": {"variable": "range", "carrier": CARRIER},
        "antenna": {"position": [[0.0, 0.0, 0.0]]},
        "instrument": "Acconeer A121",
    }
    return Contents(path, READER.name, variables, mapping=mapping)


def _json(path: Path, name: str, text: str) -> dict[str, Any]:
    """A JSON object that is stored as text."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError(f"{path}: its {name!r} is no JSON text; record the session again") from None
    if not isinstance(value, dict):
        raise InputError(f"{path}: its {name!r} is no JSON object; record the session again")
    return value


def _stretches(
    path: Path, metadata: dict[str, Any], config: dict[str, Any], points: int
) -> list[tuple[slice, float, float]]:
    """For each stretch of ranges: the slice of its samples, its first range [m], and its step [m]."""
    try:
        base = float(metadata["base_step_length_m"])
        subsweeps = next(iter(config["groups"][0].values()))["subsweeps"]
        found = [
            (
                slice(int(offset), int(offset) + int(length)),
                base * int(subsweep["start_point"]),
                base * int(subsweep["step_length"]),
            )
            for offset, length, subsweep in zip(
                metadata["subsweep_data_offset"], metadata["subsweep_data_length"], subsweeps, strict=True
            )
        ]
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration) as error:
        raise InputError(f"{path}: the configuration of the session is not understood ({error!r})") from None
    reach = max((max(abs(start), abs(start + step * points)) for _, start, step in found), default=0.0)
    if not found or not np.isfinite(reach) or not 0.0 < reach < FARTHEST:
        raise InputError(f"{path}: its samples reach to {reach:g} m, expected distances up to {FARTHEST:g} m")
    for part, _, step in found:
        if not (0 <= part.start < part.stop <= points and step > FINEST):
            raise InputError(f"{path}: a stretch has samples {part.start} to {part.stop} of {points}, step {step:g} m")
    return found


FARTHEST = 100.0
"""Upper bound of the distances that these sensors measure [m]."""

FINEST = 1e-3
"""Lower bound of the steps of these sensors [m]; the base step is 2.5 mm."""


def _joined(raw: NDArray[np.complex64], stretches: list[tuple[slice, float, float]]) -> tuple[NDArray, NDArray]:
    """Distances in equal steps [m], and the samples of all stretches on them, (frames, distances).

    They are interpolated linearly, which is exact enough because the pulses are long. Finer stretches have precedence.
    """
    step = min(step for _, _, step in stretches)
    begin = min(start for _, start, _ in stretches)
    end = max(start + stride * (part.stop - part.start - 1) for part, start, stride in stretches)
    distance = begin + step * np.arange(int(np.floor((end - begin) / step + 1e-6)) + 1)
    joined = np.zeros((len(raw), distance.size), dtype=np.complex64)
    empty = np.ones(distance.size, dtype=bool)
    for part, start, stride in sorted(stretches, key=lambda stretch: stretch[2]):
        places = start + stride * np.arange(part.stop - part.start)
        inside = empty & (distance >= places[0] - 0.5 * step) & (distance <= places[-1] + 0.5 * step)
        for frame, values in zip(joined, raw[:, part], strict=True):
            frame[inside] = np.interp(distance[inside], places, values)
        empty &= ~inside
    return distance, joined


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is a recorded session of an A121 sensor."""
    if not head.startswith(hdf5.SIGNATURE) or path.suffix.lower() not in SUFFIXES:
        return False
    return {"generation", FRAMES} <= set(hdf5.read(path).variables)


READER = Reader("acconeer", "sessions of Acconeer A121 sensors", recognises, read, SUFFIXES)
