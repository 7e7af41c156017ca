"""Element calibrations in JSON files, which people can read too."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from mirrorfold.calibration.elements import CALIBRATION, ElementCalibration
from mirrorfold.common.arguments import path_of, wrong_kind
from mirrorfold.common.reading import check_file, parsed, read_text
from mirrorfold.errors import InputError
from mirrorfold.io.files import written_atomically

KIND = "element calibration"
"""The value of `mirrorfold_kind` in a file, by which it is recognised."""

LARGEST_FILE = 64_000_000
"""Largest size of a file that is read [bytes]; a hundred thousand elements need less."""


def save_elements(calibration: ElementCalibration, path: str | Path) -> Path:
    """Write an element calibration to a JSON file, and return its path.

    Raises
    ------
    InputError
        If `calibration` is no element calibration, or the file cannot be written.
    """
    if not isinstance(calibration, ElementCalibration):
        raise wrong_kind("calibration", calibration, CALIBRATION, reader="mf.calibrate.load_elements")
    path = path_of("save_elements", path)
    content: dict[str, Any] = {"mirrorfold_kind": KIND, "units": "m"}
    for field in fields(calibration):
        value = np.asarray(getattr(calibration, field.name))
        if value.dtype.kind == "c":
            content[field.name] = {"real": value.real.tolist(), "imag": value.imag.tolist()}
        else:
            content[field.name] = value.tolist()
    with written_atomically(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path


def load_elements(path: str | Path) -> ElementCalibration:
    """Read an element calibration from a JSON file.

    Raises
    ------
    InputError
        If the file is missing or holds something else.
    """
    path = path_of("load_elements", path)
    remedy = "give a file that `mirrorfold calibrate --save-elements` has written"
    check_file(path, remedy)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: is larger than {LARGEST_FILE / 1e6:g} MB; {remedy}")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {remedy}") from None
    content = parsed(read_text(path, remedy), "JSON", str(path), remedy)
    if not isinstance(content, dict) or content.get("mirrorfold_kind") != KIND:
        raise InputError(f"{path}: is no element calibration; {remedy}")
    values: dict[str, Any] = {}
    for field in fields(ElementCalibration):
        try:
            value = content[field.name]
            if isinstance(value, dict):
                value = np.asarray(value["real"], dtype=float) + 1j * np.asarray(value["imag"], dtype=float)
            values[field.name] = np.asarray(value, dtype=_type(field.name))
        except (KeyError, TypeError, ValueError, OverflowError):
            raise InputError(f"{path}: entry {field.name!r} is missing or no array of numbers; {remedy}") from None
        if not np.isfinite(values[field.name]).all():
            raise InputError(f"{path}: entry {field.name!r} holds numbers that are not finite; {remedy}")
    for side in ("tx", "rx"):
        count = values[f"{side}_delay"].shape
        shapes = {"gain": count, "valid": count, "offset": (*count, 3), "position": (*count, 3)}
        for name, shape in shapes.items():
            if len(count) != 1 or values[f"{side}_{name}"].shape != shape:
                raise InputError(f"{path}: entry '{side}_{name}' does not fit to '{side}_delay'; {remedy}")
    if values["residual"].ndim:
        raise InputError(f"{path}: entry 'residual' is no number; {remedy}")
    return ElementCalibration(**{**values, "residual": float(values["residual"])})


def _type(name: str) -> Any:
    """Type of the numbers of an entry."""
    return bool if name.endswith("valid") else complex if name.endswith("gain") else float
